"""Effects of which nothing was learnt: fitted, tested on held-out records, named where they are missing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from tests.twingap.gap.conftest import FewEffects
from twingap.bearing import BEARINGS
from twingap.effects import Draft, Effect, Stage, make_effect, parameter, register, registry
from twingap.effects.handover import digests_of_effects
from twingap.gap import diagnose
from twingap.gap.search import effect_search, unlearnt
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

SPEC = TwinSpec("phenomenological", bearing=BEARINGS["6205"])
FAULTS = ("healthy", "outer", "inner", "ball")


@pytest.fixture(scope="module")
def soft_knee() -> Iterator[type[Effect]]:
    """A sensor that compresses large samples: no effect of the catalogue."""
    before = dict(registry.own_effects())

    @register
    @dataclass(frozen=True)
    class SoftKnee(Effect):
        """A sensor that compresses large samples."""

        stage: ClassVar[Stage] = Stage.ACQUISITION
        knee: float = parameter(
            5.0, unit="healthy rms", plausible=(0.5, 20.0), allowed=(0.01, 1e6), log=True, doc="level at which it bends"
        )

        def apply(self, draft: Draft, rng: np.random.Generator) -> None:
            bend = self.knee * draft.reference_rms
            draft.x = bend * np.tanh(draft.x / bend)

    yield SoftKnee
    registry.replace_own(before)


def machine(effects: tuple[Effect, ...] = (), seed: int = 1, count: int = 8) -> RecordSet:
    parameters = PhenomenologicalParameters(resonance_hz=2600.0, damping_ratio=0.04, scale=0.3)
    twin = PhenomenologicalTwin(BEARINGS["6205"], parameters, effects, unit="g")
    conditions = [
        Condition(f"r{i}", (1500.0, 1800.0)[(i // 4) % 2], 12000.0, 6000, FAULTS[i % 4]) for i in range(count)
    ]
    return twin.simulate(conditions, np.random.default_rng(seed))


def evidence_of(records: RecordSet) -> Evidence:
    calibrated = calibrate(records, SPEC, np.random.default_rng(0))
    return Evidence(calibrated, simulator_of(calibrated), SPEC, 7, THOROUGH)


@pytest.fixture(scope="module")
def lacking(soft_knee: type[Effect]) -> Evidence:
    """Evidence of a machine whose sensor compresses."""
    return evidence_of(machine((make_effect("soft_knee", {"knee": 1.2}),), count=12))


def test_an_effect_of_a_users_own_is_named_without_training(
    soft_knee: type[Effect], learnt: Any, few_effects: FewEffects
) -> None:
    few_effects("clipping")
    found = diagnose(
        machine((make_effect("soft_knee", {"knee": 1.2}),), count=12), SPEC, seed=0, learnt=learnt, quick=True
    )
    assert "soft_knee" in found.report.verdict.effects
    (candidate,) = (c for c in found.report.candidates if c.effect == "soft_knee")
    assert candidate.parameters["knee"].value == pytest.approx(1.2, rel=0.3)
    assert candidate.closure > 0.5
    digest = found.report.provenance["own_effects"]["soft_knee"]
    assert digest == digests_of_effects()["soft_knee"] and len(digest) == 64
    assert any("soft_knee" in chosen for chosen in found.report.verdict.confidence_set)


def test_it_is_a_gap_where_the_learnt_models_see_none(
    soft_knee: type[Effect], learnt: Any, few_effects: FewEffects, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(effect_search, "ALPHA", 0.0)  # whatever their scores
    few_effects("clipping")
    lacking = machine((make_effect("soft_knee", {"knee": 1.2}),), count=12)
    found = diagnose(lacking, SPEC, seed=0, learnt=learnt, quick=True).report
    assert found.verdict.effects == ("soft_knee",) and found.verdict.p_value < 0.02
    assert found.verdict.closure is not None and found.verdict.closure > 0.5
    bare = diagnose(machine(seed=3, count=12), SPEC, seed=0, learnt=learnt, quick=True).report
    assert bare.verdict.status == "no_gap" and not bare.verdict.effects


def test_an_effect_that_makes_up_for_the_calibration_is_not_obvious() -> None:
    assert unlearnt.Gain(0.001, 0.9, 0.2).obvious
    assert not unlearnt.Gain(0.001, 0.3, 0.0).obvious  # all of little
    assert not unlearnt.Gain(0.001, 3.0, 2.0).obvious  # little of much


def test_it_is_not_named_beside_what_is_missing(soft_knee: type[Effect], learnt: Any, few_effects: FewEffects) -> None:
    few_effects("mains_interference")
    hum = diagnose(
        machine((make_effect("mains_interference", {"level": 0.6}),)), SPEC, seed=0, learnt=learnt, quick=True
    )
    assert hum.report.verdict.effects == ("mains_interference",)
    (candidate,) = (c for c in hum.report.candidates if c.effect == "soft_knee")
    fitted = hum.explanation.fitted["soft_knee"].parameter_values()["knee"]
    assert candidate.parameters["knee"].value == fitted != soft_knee().parameter_values()["knee"]


def test_nothing_missing_is_named_and_what_was_not_fitted_has_no_values_in_the_report(
    soft_knee: type[Effect], learnt: Any, few_effects: FewEffects, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "_OWN", dict(registry.own_effects()))
    few_effects("clipping")

    @register
    @dataclass(frozen=True)
    class NeverFits(soft_knee):  # type: ignore[valid-type, misc]
        """A saturation that acts on no record."""

        def cannot_act_on(self, draft: Draft) -> str | None:
            return "the record is too short"

    found = diagnose(machine(seed=3), SPEC, seed=0, learnt=learnt, quick=True)
    assert "soft_knee" not in found.report.verdict.effects
    (candidate,) = (c for c in found.report.candidates if c.effect == "never_fits")
    assert not candidate.parameters and candidate.closure == 0 and candidate.gap_before == candidate.gap_after
    assert candidate.acts is not None and "never_fits" not in found.explanation.fitted
    assert list(found.report.provenance["own_effects"]) == ["soft_knee", "never_fits"]


def test_values_are_found_from_far_away(lacking: Evidence) -> None:
    found = unlearnt.fitted(lacking, "soft_knee", lacking.against().fit)
    assert found is not None
    assert found.parameter_values()["knee"] == pytest.approx(1.2, rel=0.3)


def test_the_test_tells_an_effect_that_is_there_from_one_that_is_not(lacking: Evidence) -> None:
    assert unlearnt.gain(lacking, (make_effect("soft_knee", {"knee": 1.2}),), ()).p_value < 0.02
    absent = evidence_of(machine(seed=3))
    assert unlearnt.gain(absent, (make_effect("soft_knee", {"knee": 3.0}),), ()).p_value > 0.2
    assert unlearnt.gain(absent, (), ()).p_value == 1.0


def test_probabilities_are_bounds_at_even_odds() -> None:
    assert unlearnt.probability(0.5) == 0.5
    assert unlearnt.probability(math.exp(-1)) == pytest.approx(0.5)
    assert unlearnt.probability(0.05) == pytest.approx(0.711, abs=1e-3)  # Sellke et al. 2001, table 1: 0.289
    assert unlearnt.probability(0.001) == pytest.approx(0.982, abs=1e-3)
    drawn = [unlearnt.probability(p) for p in np.geomspace(1e-6, 1, 50)]
    assert drawn == sorted(drawn, reverse=True)
