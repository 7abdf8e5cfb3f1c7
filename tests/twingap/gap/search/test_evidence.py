"""Evidence of a search: what recurs is computed once, and is what it would be computed anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.gap.search import evidence
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec, flat

HUM, LOUD_HUM = (make_effect("mains_interference", {"level": level}) for level in (0.5, 0.9))
JITTER = make_effect("slip_jitter", {"sigma": 0.02})


@pytest.fixture(scope="module")
def records() -> RecordSet:
    own = PhenomenologicalParameters(1500.0, 0.05, {"inner": 5.0, "outer": 6.0}, 0.7, 0.6, 1.5)
    conditions = [
        Condition(f"{f}{i}", 1500.0 + 60 * i, 6000.0, 3000, f) for f in ("healthy", "inner") for i in range(6)
    ]
    made = PhenomenologicalTwin(BEARINGS["6205"], own, [HUM]).simulate(conditions, np.random.default_rng(4))
    return RecordSet.from_records("machine", "g", BEARINGS["6205"], made)


def evidence_of(records: RecordSet) -> Evidence:
    spec = TwinSpec("phenomenological")
    calibrated = calibrate(records, spec, np.random.default_rng(1))
    return Evidence(calibrated, simulator_of(calibrated), spec, 7)


def simulations(of: Evidence) -> list[bytes]:
    """Feature vectors of twins that differ in one thing each: baseline, effects, values, replicate, records."""
    bare, conditions, grid = of.against().simulator, of.fit.conditions, of._trial_grid
    louder = of.with_values(bare, (), {"scale": 1.1 * flat(bare.spec.parameters)["scale"]})  # type: ignore[attr-defined]
    chains: tuple[Sequence[Effect], ...] = ((), (HUM,), (LOUD_HUM,), (HUM, JITTER))
    asked = [(simulator, chain, conditions, 3) for simulator in (bare, louder) for chain in chains]
    asked += [(bare, (HUM,), conditions, 4), (bare, (HUM,), conditions[1:], 3)]
    return [of.simulated_vectors(*given[:3], grid, given[3]).matrix.tobytes() for given in asked]


def test_simulations_that_recur_are_made_once_and_no_other_stands_in(
    records: RecordSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(evidence, "_KEPT_VECTORS", 0)
    anew = simulations(evidence_of(records))
    assert len(set(anew)) == len(anew)
    monkeypatch.setattr(evidence, "_KEPT_VECTORS", 64)
    of = evidence_of(records)
    assert simulations(of) == anew
    made: list[int] = []
    simulate = TwinSimulator.simulate
    monkeypatch.setattr(TwinSimulator, "simulate", lambda *given: made.append(1) or simulate(*given))
    assert simulations(of) == anew and not made
    of.gap(of.against().simulator, (HUM,), 6)
    assert len(made) >= 1


def test_few_simulations_are_kept(records: RecordSet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "_KEPT_VECTORS", 3)
    of = evidence_of(records)
    simulations(of)
    assert len(of._kept_vectors) == 3


def test_a_twin_is_calibrated_with_an_effect_as_if_no_other_had_been_tried(records: RecordSet) -> None:
    one, other = evidence_of(records), evidence_of(records)
    one.against([LOUD_HUM])
    spectra = {psd.tobytes() for psd in one._bare_spectra.values()}
    assert len(spectra) == len(one._bare_spectra) > 10, "each mode has a spectrum of its own"
    (first, second) = (of.against([HUM]).simulator.spec for of in (one, other))  # type: ignore[attr-defined]
    assert first == second
