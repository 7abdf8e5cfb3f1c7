"""The closest twin: all that brings records and twin together, and what each group of effects closes."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, catalogue, make_effect
from twingap.effects.by_state import ByState
from twingap.gap import diagnose
from twingap.gap.report.files import to_json
from twingap.gap.report.schema import problems
from twingap.gap.search import closest_twin as search
from twingap.gap.search.closest_twin import closest_spec, closest_twin
from twingap.gap.search.effect_search import Explanation
from twingap.gap.search.evidence import Compared, Evidence, simulator_of
from twingap.gap.search.free_spectra import measured
from twingap.gap.search.optimise import optimise, validation_distance
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec, read_twin, write_twin

pytestmark = pytest.mark.usefixtures("few_trials")

LACKS = (
    make_effect("second_resonance", {"frequency_hz": 900.0, "damping_ratio": 0.04, "gain": 1.5}),
    make_effect("impact_scatter", {"sigma": 0.7}),
)
"""What few detectors do not name."""
PLAIN = (*LACKS, make_effect("looseness", {}))
"""A plain gap with something that is named."""
OWN = PhenomenologicalParameters(2400.0, 0.05, {"inner": 5.0, "outer": 6.0}, 0.7, 0.6, 1.5)
SPEC = TwinSpec("phenomenological", bearing=BEARINGS["6205"])


def machine(*effects: Effect) -> RecordSet:
    conditions = [
        Condition(f"{fault}{i}", 1500.0 + 300.0 * (i % 2), 10000.0, 10000, fault, group=f"{fault}{i}")
        for fault in ("healthy", "inner")
        for i in range(6)
    ]
    made = PhenomenologicalTwin(BEARINGS["6205"], OWN, effects).simulate(conditions, np.random.default_rng(4))
    return RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], made)


def found_in(records: RecordSet) -> tuple[Evidence, Explanation]:
    """A gap that was called, and nothing named."""
    calibrated = calibrate(records, SPEC, np.random.default_rng(1))
    evidence = Evidence(calibrated, simulator_of(calibrated), SPEC, 7)
    bare = optimise(evidence, evidence.against().simulator, (), {})
    now = Compared(evidence, (), bare.simulator)
    return evidence, Explanation(0.01, True, (), {}, ((),), 0.01, now, now, {"slip_jitter": "so says the test"})


@pytest.fixture(scope="module")
def closer(learnt: Any) -> tuple[Evidence, Explanation, Compared]:
    evidence, found = found_in(machine(*LACKS))
    return evidence, found, closest_twin(evidence, found, learnt)


def test_what_nobody_named_is_brought_nearer(closer: tuple[Evidence, Explanation, Compared]) -> None:
    evidence, found, nearer = closer
    before_left = validation_distance(evidence, found.after.simulator, found.after.effects)
    assert validation_distance(evidence, nearer.simulator, nearer.effects) < 0.3 * before_left
    names = {effect.name for effect in nearer.effects}
    assert "slip_jitter" not in names, "what cannot act is not tried"
    assert names & {"impact_scatter", "impulsive_share"} and names & {"second_resonance", "transfer_path"}


def test_the_closest_twins_file_makes_the_same_records(
    closer: tuple[Evidence, Explanation, Compared], tmp_path: Any
) -> None:
    evidence, _, nearer = closer
    spec = closest_spec(nearer)
    assert spec is not None
    assert set(spec.effects) == {effect.name for effect in nearer.effects}
    write_twin(tmp_path / "closest.toml", spec)
    again = TwinSimulator(read_twin(tmp_path / "closest.toml"), BEARINGS["6205"])
    conditions = evidence.fit.conditions[:3]
    one, other = (
        simulator.simulate(effects, conditions, 5, 0)
        for simulator, effects in ((nearer.simulator, nearer.effects), (again, ()))
    )
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a.samples, b.samples, rtol=1e-9, atol=1e-12)


def test_a_twin_as_near_as_chance_allows_gets_nothing(learnt: Any) -> None:
    evidence, found = found_in(machine())
    left = validation_distance(evidence, found.after.simulator, ())
    nearer = closest_twin(evidence, found, learnt)
    # Chance may be fitted a little, never by much.
    assert validation_distance(evidence, nearer.simulator, nearer.effects) >= 0.6 * left


@pytest.fixture(scope="module")
def both(learnt: Any) -> tuple[Any, Any]:
    """A quick diagnosis and a whole one, of which few detectors name little."""
    few = dataclasses.replace(learnt, detectors={name: learnt.detectors[name] for name in ("looseness", "clipping")})
    records = machine(*PLAIN)
    return diagnose(records, SPEC, learnt=few, quick=True), diagnose(records, SPEC, learnt=few)


def test_a_diagnosis_tells_of_it_beside_the_verdict_and_changes_nothing_else(both: tuple[Any, Any]) -> None:
    quick, asked = both
    told = asked.report.closest
    assert not quick.report.closest.attribution and quick.report.closest.twin == ""
    assert asked.report.verdict.effects == quick.report.verdict.effects
    assert asked.report.metrics == quick.report.metrics
    assert problems(to_json(asked.report)) == problems(to_json(quick.report)) == []
    assert told.metrics[0].after < asked.report.metrics[0].after
    assert told.closure_ci[0] <= told.closure <= told.closure_ci[1]
    spec = asked.closest_twin()
    assert spec is not None and {one.effect for one in told.effects} == set(spec.effects)
    closest, after = list(asked.sim_closest()), list(asked.sim_after())
    assert [r.condition.name for r in closest] == [r.condition.name for r in after]
    assert any(not np.array_equal(a.samples, b.samples) for a, b in zip(closest, after, strict=True))
    # Without one, the closest twin is the verdict's.
    same = zip(quick.sim_closest(), quick.sim_after(), strict=True)
    assert all(np.array_equal(a.samples, b.samples) for a, b in same)


def test_shares_add_up_and_fall(both: tuple[Any, Any]) -> None:
    told = both[1].report.closest
    shares = [share.share for share in told.attribution]
    assert sum(shares) == pytest.approx(told.closure, abs=0.02) and shares == sorted(shares, reverse=True)
    for share in told.attribution:
        assert sum(one.share for one in share.effects) == pytest.approx(share.share, abs=1e-6)
        assert share.share_ci[0] <= share.share <= share.share_ci[1]
    assert any(share.shown for share in told.attribution)
    assert {share.group for share in told.attribution} <= {kind.group for kind in catalogue().values()}


def test_finished_records_have_no_twin_file(learnt: Any) -> None:
    calibrated = calibrate(machine(*LACKS), None, np.random.default_rng(1), sim=machine())
    evidence = Evidence(calibrated, simulator_of(calibrated, machine()), SPEC, 7)
    assert closest_spec(evidence.against()) is None
    now = evidence.against()
    found = Explanation(0.01, True, (), {}, ((),), 0.01, now, now, {})
    nearer = closest_twin(evidence, found, learnt)
    assert closest_spec(nearer) is None
    assert evidence.misfit(nearer.simulator, nearer.effects) < evidence.misfit(now.simulator, ())


MANY = (
    make_effect("impact_scatter", {"sigma": 0.4}),
    make_effect("load_zone", {"depth": 0.6}),
    make_effect("sensor_rolloff", {"corner_hz": 3000.0}),
    make_effect("looseness", {"level": 0.6}),
)


def test_many_effects_are_fitted_together_where_much_is_left(learnt: Any) -> None:
    evidence, found = found_in(machine(*MANY))
    start = search._Twin(found.after.simulator, (), evidence.misfit(found.after.simulator, ()))
    made = search._all_together(evidence, start, start, found, learnt)
    left = validation_distance(evidence, made.simulator, made.effects)
    assert left < 0.5 * validation_distance(evidence, start.simulator, ())
    assert made.names & {effect.name for effect in MANY} and "slip_jitter" not in made.names
    # What does nothing is left out again.
    for effect in made.effects:
        rest = tuple(other for other in made.effects if other is not effect)
        assert evidence.misfit(made.simulator, rest) > 0.98 * made.misfit


def test_a_path_of_all_faults_replaces_those_of_each_where_it_is_closer(learnt: Any) -> None:
    """One path, measured from all records, holds for other records better than one of each fault's few."""
    evidence, _ = found_in(machine(*LACKS))
    bare = evidence.against().simulator
    made = measured(evidence, bare, (LACKS[1],), ("transfer_path", "background_spectrum"), by="fault")
    assert made is not None
    each = search._Twin(*made, evidence.misfit(*made), "fault")
    settled = search._settled_elsewhere(evidence, each, learnt, frozenset())
    assert settled.by == "all" and settled.misfit < each.misfit
    assert not any(isinstance(effect, ByState) for effect in settled.effects)
