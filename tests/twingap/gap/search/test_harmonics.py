"""Amplitudes of harmonics are measured as records have them, and kept by searches for other values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.gap.held_out import values_of_effect
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.gap.search.harmonics import with_measured_harmonics
from twingap.gap.search.optimise import optimise
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

OWN = PhenomenologicalParameters(2400.0, 0.05, {"inner": 20.0, "outer": 25.0}, 0.7, 0.6, 1.5)
SPEC = TwinSpec("phenomenological", bearing=BEARINGS["6205"])
ODD = (1.0, 0.0, 0.5, 0.0, 0.3)
SERIES = {
    "mains_interference": {"level": 0.8, "mains_hz": 50.0, "amplitudes": ODD},
    "looseness": {"level": 0.7, "in_phase": False, "amplitudes": (0.4, 1.0, 0.0, 0.6, 0.3, 0.9)},
    "gear_mesh": {"level": 0.9, "teeth": 17, "depth": 0.4, "amplitudes": (1.0, 0.2, 0.7)},
    "waviness": {"level": 0.8, "amplitudes": (1.0, 0.3, 0.8)},
}
FAULTS = ("healthy", "inner")


def evidence_of(*effects: Effect) -> Evidence:
    conditions = [
        Condition(f"{fault}{i}", 1310.0 + 97.0 * i, 10000.0, 20000, fault) for fault in FAULTS for i in range(8)
    ]
    made = PhenomenologicalTwin(BEARINGS["6205"], OWN, effects).simulate(conditions, np.random.default_rng(4))
    records = RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], made)
    calibrated = calibrate(records, SPEC, np.random.default_rng(1))
    return Evidence(calibrated, simulator_of(calibrated), SPEC, 7)


def wrong(name: str) -> Effect:
    """The effect as a search begins with it: a decay, at another level."""
    return make_effect(name, {**SERIES[name], "level": 0.35, "amplitudes": ()})


def absolute(evidence: Evidence, effect: Any, simulator: Any) -> np.ndarray:
    """Amplitudes of the harmonics in the unit of the records."""
    return np.asarray(effect.levels) * simulator.reference_rms


@pytest.mark.parametrize("name", SERIES)
def test_amplitudes_are_those_of_the_records(name: str) -> None:
    true: Any = make_effect(name, SERIES[name])
    evidence = evidence_of(true)
    chain = (wrong(name),)
    simulator = evidence.against(chain).simulator
    found = with_measured_harmonics(evidence, simulator, chain)
    assert found is not None
    twin, (effect,) = found
    levels = absolute(evidence, effect, twin)
    machine = PhenomenologicalTwin(BEARINGS["6205"], OWN, (true,))
    wanted = np.asarray(true.levels) * machine.reference_rms
    np.testing.assert_allclose(levels[: wanted.size], wanted, rtol=0.1, atol=0.05 * wanted.max())
    assert np.all(levels[wanted.size :] < 0.05 * wanted.max())
    assert evidence.misfit(twin, (effect,)) < 0.7 * evidence.misfit(simulator, chain)


def test_amplitudes_of_the_shaft_are_those_of_the_records() -> None:
    true: Any = make_effect("shaft_harmonics", {"level_1x": 0.1, "level_2x": 0.5, "level_3x": 0.06})
    evidence = evidence_of(true)
    chain = (make_effect("shaft_harmonics"),)
    simulator = evidence.against(chain).simulator
    found = with_measured_harmonics(evidence, simulator, chain)
    assert found is not None
    twin, (effect,) = found
    wanted = np.asarray(true.levels) * PhenomenologicalTwin(BEARINGS["6205"], OWN, (true,)).reference_rms
    np.testing.assert_allclose(absolute(evidence, effect, twin), wanted, rtol=0.15)


def test_a_weak_harmonic_of_the_mains_between_stronger_ones_is_measured() -> None:
    true: Any = make_effect("mains_interference", {"level": 0.2, "mains_hz": 50.0, "amplitudes": (1.0, 0.0, 0.2, 0.7)})
    evidence = evidence_of(true)
    chain = (wrong("mains_interference"),)
    simulator = evidence.against(chain).simulator
    twin, (effect,) = with_measured_harmonics(evidence, simulator, chain) or (simulator, chain)
    wanted = np.asarray(true.levels) * PhenomenologicalTwin(BEARINGS["6205"], OWN, (true,)).reference_rms
    np.testing.assert_allclose(absolute(evidence, effect, twin)[2:4], wanted[2:], rtol=0.3)


@pytest.mark.parametrize("part", [2, 3])
def test_a_mesh_whose_second_or_third_harmonic_stands_out_has_its_teeth(part: int) -> None:
    strongest = tuple(float(k == part) + 0.3 for k in range(1, 4))
    evidence = evidence_of(make_effect("gear_mesh", {**SERIES["gear_mesh"], "amplitudes": strongest}))
    chain = (make_effect("gear_mesh", {"teeth": part * 17, "level": 0.5}),)
    _, (effect,) = with_measured_harmonics(evidence, evidence.against(chain).simulator, chain) or (None, chain)
    assert effect.parameter_values()["teeth"] == 17


def test_a_mesh_keeps_its_teeth_where_no_lower_harmonic_is_there() -> None:
    evidence = evidence_of(make_effect("gear_mesh", {**SERIES["gear_mesh"], "teeth": 48}))
    chain = (make_effect("gear_mesh", {"teeth": 48, "level": 0.5}),)
    _, (effect,) = with_measured_harmonics(evidence, evidence.against(chain).simulator, chain) or (None, chain)
    assert effect.parameter_values()["teeth"] == 48


def test_lines_beside_a_hum_are_none_of_it() -> None:
    """A hum is fixed in Hz, so that a line four bins beside its sixth harmonic is not measured with it."""
    sixth = (1.0, 0.0, 0.0, 0.0, 0.0, 0.4)
    hum = make_effect("mains_interference", {"level": 0.5, "mains_hz": 50.0, "amplitudes": sixth})
    lines = {"frequencies_hz": (302.0,), "amplitudes": (0.6,), "orders": (), "order_amplitudes": ()}
    beside = make_effect("line_spectrum", lines)
    evidence = evidence_of(hum, beside)
    chain = (wrong("mains_interference"),)
    simulator = evidence.against(chain).simulator
    twin, (effect,) = with_measured_harmonics(evidence, simulator, chain) or (simulator, chain)
    machine = PhenomenologicalTwin(BEARINGS["6205"], OWN, (hum, beside))
    assert absolute(evidence, effect, twin)[5] == pytest.approx(0.2 * machine.reference_rms, rel=0.2)


def test_a_chain_without_a_series_has_nothing_to_measure() -> None:
    clipping = make_effect("clipping")
    evidence = evidence_of()
    assert with_measured_harmonics(evidence, evidence.against().simulator, (clipping,)) is None


def test_a_search_for_values_leaves_what_lines_show() -> None:
    evidence = evidence_of(make_effect("looseness", SERIES["looseness"]))
    given: Any = replace(wrong("looseness"), amplitudes=(0.5, 1.0))  # type: ignore[type-var]
    found = optimise(evidence, evidence.against((given,)).simulator, (given,), {})
    (effect,) = found.effects
    assert effect.amplitudes == given.amplitudes  # type: ignore[attr-defined]
    for name in ("level", "decay", "half_ratio", "n_orders"):
        assert getattr(effect, name) == pytest.approx(getattr(given, name))


@pytest.mark.parametrize("name", SERIES)
def test_amplitudes_take_the_place_of_the_decay(name: str) -> None:
    effect: Any = make_effect(name, SERIES[name])
    np.testing.assert_allclose(effect.levels, np.multiply(effect.level, effect.amplitudes))
    regular: Any = replace(effect, amplitudes=())
    assert regular.idle_parameters == frozenset() and effect.idle_parameters < {f.name for f in effect.parameters()}
    for parameter in effect.idle_parameters:
        assert not np.array_equal(replace(regular, **{parameter: 1}).levels, regular.levels)
        np.testing.assert_array_equal(replace(effect, **{parameter: 1}).levels, effect.levels)


def test_a_report_holds_each_amplitude() -> None:
    values = values_of_effect(make_effect("mains_interference", SERIES["mains_interference"]), {})
    assert [values[f"amplitudes.{k}"].value for k in range(1, 6)] == list(ODD)
    assert "decay" not in values and "n_harmonics" not in values and values["level"].value == 0.8
    assert not any(key.startswith("amplitudes") for key in values_of_effect(wrong("mains_interference"), {}))
