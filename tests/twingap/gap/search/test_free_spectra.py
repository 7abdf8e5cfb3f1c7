"""Path, background and lines measured from spectra are those that the records have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.effects.by_state import ByState, State, of_state
from twingap.effects.registry import measured_from_spectra
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.gap.search.free_spectra import BACKGROUND, LINES, PATH, By, by_of, measured
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

OWN = PhenomenologicalParameters(2400.0, 0.05, {"inner": 20.0, "outer": 25.0}, 0.7, 0.6, 1.5)
SPEC = TwinSpec("phenomenological", bearing=BEARINGS["6205"])
FAULTS = ("healthy", "inner", "outer")


def evidence_of(
    *effects: Effect, faults: tuple[str, ...] = FAULTS, n: int = 12, conditions: Sequence[Condition] = ()
) -> Evidence:
    conditions = conditions or [
        Condition(f"{fault}{i}", 1500.0 + 37.0 * i, 10000.0, 10000, fault) for fault in faults for i in range(n)
    ]
    made = PhenomenologicalTwin(BEARINGS["6205"], OWN, effects).simulate(conditions, np.random.default_rng(4))
    records = RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], made)
    calibrated = calibrate(records, SPEC, np.random.default_rng(1))
    return Evidence(calibrated, simulator_of(calibrated), SPEC, 7)


def closes(evidence: Evidence, names: tuple[str, ...], by: By = "all") -> tuple[float, dict[str, Any]]:
    """Misfit with these spectra measured over that without, and the effects."""
    bare = evidence.against().simulator
    made = measured(evidence, bare, (), names, by=by)
    assert made is not None
    return evidence.misfit(*made) / evidence.misfit(bare, ()), {effect.name: effect for effect in made[1]}


def test_path_is_recovered_up_to_a_constant_gain() -> None:
    """A notch and two humps within 2 dB where impacts have energy."""
    places = (0.0, 900.0, 1600.0, 2400.0, 3200.0, 4200.0, 5000.0)
    gains = (0.0, 6.0, -8.0, 0.0, 8.0, -4.0, -4.0)
    true = make_effect("transfer_path", {"frequencies_hz": places, "gains_db": gains})
    evidence = evidence_of(true)
    factor, found = closes(evidence, (PATH, BACKGROUND))
    assert factor < 0.4
    # The baseline's mode was calibrated to the same records, so that its shape is a part of the path.
    at = np.linspace(700.0, 4300.0, 40)
    whole = evidence.against().simulator.spec.parameters
    mode = [
        20 * np.log10(1 / np.abs(f0**2 - at**2 + 2j * z * at * f0)) - 20 * np.log10(1 / f0**2)
        for f0, z in ((whole["resonance_hz"], whole["damping_ratio"]), (OWN.resonance_hz, OWN.damping_ratio))
    ]
    path = found[PATH]
    got = np.interp(at, path.frequencies_hz, path.gains_db) + mode[0]
    wanted = np.interp(at, places, gains) + mode[1]
    off = (got - wanted) - np.median(got - wanted)
    assert np.quantile(np.abs(off), 0.8) < 2.0


def test_path_is_not_told_between_the_lines_of_impacts() -> None:
    """Side lines that the twin lacks are no gains of the path, which lines of impacts at another speed would meet."""
    swell = make_effect("load_zone", {"depth": 0.9})
    conditions = [
        Condition(f"{fault}{i}", 2900.0 + i, 10000.0, 20000, fault) for fault in ("healthy", "inner") for i in range(6)
    ]
    evidence = evidence_of(swell, conditions=conditions)
    simulator, chain = measured(evidence, evidence.against().simulator, (), (PATH, BACKGROUND)) or pytest.fail()
    faster = [replace(c, speed_rpm=1.04 * c.speed_rpm) for c in conditions if c.fault == "inner"]
    machine = PhenomenologicalTwin(BEARINGS["6205"], OWN, (swell,)).simulate(faster, np.random.default_rng(5))
    made = evidence.simulated(simulator, chain, faster, 2)
    levels = [twin.samples.std() / own.samples.std() for twin, own in zip(made, machine, strict=True)]
    assert np.median(levels) == pytest.approx(1.0, abs=0.15)


def test_background_takes_the_place_of_the_twins_noise() -> None:
    noise = make_effect("coloured_noise", {"level": 2.0, "slope": 0.0, "low_hz": 3500.0, "high_hz": 4500.0})
    factor, found = closes(evidence_of(noise), (BACKGROUND,))
    assert factor < 0.5
    density = np.interp([2000.0, 4000.0], found[BACKGROUND].frequencies_hz, found[BACKGROUND].densities_db)
    assert density[1] - density[0] > 6.0


def test_lines_are_found_in_hz_and_in_orders() -> None:
    true = make_effect(
        "line_spectrum",
        {"frequencies_hz": (1237.0, 3311.0), "amplitudes": (0.6, 0.4), "orders": (9.7,), "order_amplitudes": (0.5,)},
    )
    factor, found = closes(evidence_of(true), (LINES,))
    assert factor < 0.8
    lines = found[LINES]
    np.testing.assert_allclose(lines.frequencies_hz, (1237.0, 3311.0), atol=2.0)
    np.testing.assert_allclose(lines.amplitudes, (0.6, 0.4), rtol=0.35)
    np.testing.assert_allclose(lines.orders, (9.7,), atol=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_where_nothing_is_missing_no_line_is_found(seed: int) -> None:
    """Impacts have lines of their own, which the twin has too."""
    jitter = make_effect("impact_scatter", {"sigma": 0.05 * seed})
    evidence = evidence_of(jitter)
    made = measured(evidence, evidence.against().simulator, (), (LINES,))
    count = 0 if made is None else sum(len(e.frequencies_hz) + len(e.orders) for e in made[1])
    assert count <= 1


def test_without_healthy_records_the_background_is_what_lies_between_lines() -> None:
    hum = make_effect("coloured_noise", {"level": 2.0, "slope": 1.0})
    evidence = evidence_of(hum, faults=("inner", "outer"))
    distance, found = closes(evidence, (BACKGROUND,))
    assert distance < 0.8 * evidence.gap(evidence.against().simulator, ())
    density = found[BACKGROUND]
    low, high = np.interp([200.0, 5000.0], density.frequencies_hz, density.densities_db)
    assert low - high > 6.0  # noise that falls by 3 dB per octave, 14 dB over these


@pytest.mark.parametrize("by", ["all", "fault"])
def test_a_line_that_moves_little_is_counted_once(by: By) -> None:
    """The shaft's own line covers a few bins over the speeds, so that it is found at a fixed frequency, too."""
    orders = {"frequencies_hz": (), "amplitudes": (), "orders": (1.0,), "order_amplitudes": (1.0,)}
    evidence = evidence_of(make_effect("line_spectrum", orders), n=6)
    _, found = closes(evidence, (LINES,), by=by)
    lines = of_state(found[LINES], State("healthy"))
    assert lines.frequencies_hz == ()
    np.testing.assert_allclose(lines.orders, (1.0,), atol=0.02)


def test_side_lines_of_impacts_are_no_lines_of_another_source() -> None:
    """Impacts that swell once a turn have lines beside the multiples of their order."""
    evidence = evidence_of(make_effect("load_zone", {"depth": 0.9}), faults=("healthy", "inner"))
    made = measured(evidence, evidence.against().simulator, (), (LINES,), by="fault")
    lines = None if made is None else of_state(made[1][0], State("inner"))
    orders = getattr(lines, "orders", ())
    sides = [k * BEARINGS["6205"].bpfi + side for k in range(1, 20) for side in (-1, 1)]
    assert sum(min(abs(order - side) for side in sides) < 0.03 for order in orders) <= 1


def test_each_fault_has_its_own_where_bearings_differ() -> None:
    """The path of one fault is turned upside down: one path for all cannot be right, one each can."""
    up = make_effect(
        "transfer_path",
        {
            "frequencies_hz": (500.0, 2000.0, 4500.0), "gains_db": (-6.0, 0.0, 6.0),
            "outer": {"gains_db": (6.0, 0.0, -6.0)},
        },
    )  # fmt: skip
    evidence = evidence_of(up)
    shared, _ = closes(evidence, measured_from_spectra())
    own, found = closes(evidence, measured_from_spectra(), by="fault")
    assert own < 0.8 * shared
    path = found[PATH]
    assert isinstance(path, ByState)
    tilts = []
    for fault in ("inner", "outer"):
        one = of_state(path, State(fault))
        low, high = np.interp([1000.0, 4000.0], one.frequencies_hz, one.gains_db)
        tilts.append(high - low)
    assert tilts[0] - tilts[1] > 8.0


def test_each_unit_has_its_own_where_bearings_of_a_fault_differ() -> None:
    """Two bearings of a fault have opposite paths, whose mean is flat."""
    tilted = {"frequencies_hz": (500.0, 2000.0, 4500.0), "gains_db": (-6.0, 0.0, 6.0)}
    path = make_effect(PATH, {**tilted, "outer": {"units": {"two": {"gains_db": (6.0, 0.0, -6.0)}}}})
    conditions = [
        Condition(f"{fault}{unit}{i}", 1500.0 + 37.0 * i, 10000.0, 10000, fault, extra={"bearing_id": unit})
        for fault, unit in (("healthy", "none"), ("outer", "one"), ("outer", "two"))
        for i in range(8)
    ]
    evidence = evidence_of(path, conditions=conditions)
    bare = evidence.against().simulator
    simulator, chain = measured(evidence, bare, (), (PATH, BACKGROUND), by="fault") or (bare, ())
    made = measured(evidence, simulator, chain, (PATH, BACKGROUND), by="unit")
    assert made is not None and by_of(made[1]) == "unit" and by_of(chain) != "unit"
    own = next(effect for effect in made[1] if effect.name == PATH)
    tilts = []
    for unit in ("one", "two"):
        one = of_state(own, State("outer", unit))
        low, high = np.interp([1000.0, 4000.0], one.frequencies_hz, one.gains_db)
        tilts.append(high - low)
    assert tilts[0] - tilts[1] == pytest.approx(16.0, abs=4.0)  # 8 dB from 1 to 4 kHz, up and down
    shared = next(effect for effect in chain if effect.name == PATH)
    assert of_state(own, State("outer", "three")) == of_state(shared, State("outer")), "a bearing never seen"


def test_lines_that_the_twin_has_are_not_found_again() -> None:
    hum = make_effect("mains_interference", {"level": 0.8})
    evidence = evidence_of(hum)
    bare = evidence.against().simulator
    assert measured(evidence, bare, (), (LINES,)) is not None
    assert measured(evidence, bare, (hum,), (LINES,)) is None


def test_noise_that_falls_within_the_lowest_band_is_followed() -> None:
    noise = make_effect("coloured_noise", {"level": 9.0, "slope": 2.0, "low_hz": 0.5, "high_hz": 4000.0})
    _, found = closes(evidence_of(noise), (BACKGROUND,))
    at = np.array([8.0, 15.0, 30.0])
    density = np.interp(at, found[BACKGROUND].frequencies_hz, found[BACKGROUND].densities_db)
    assert density[0] - density[2] > 6.0
