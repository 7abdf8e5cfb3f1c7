"""True speeds: recovered where records show them, left alone where they do not, slip told from speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification.speed import estimate_speeds
from twingap.identification.speed_reading import NOT_DETECTED, SHAFT_LINES, SIDEBANDS, read_speed
from twingap.records import Condition, RecordSet
from twingap.twins.twin_file import TwinSpec, build_twin

ALL = ("healthy", "inner", "outer", "ball")


def world(
    bearing: str = "6205",
    fs_hz: float = 10_000.0,
    effects: Sequence[str] = (),
    *,
    factor: float = 1.0,
    own: float = 0.0,
    slip: float = 0.0,
    of_rollers: float = 1.0,
    faults: Sequence[str] = ALL,
    n: int = 8,
    amplitude: float = 6.0,
    seed: int = 0,
    **parameters: Any,
) -> tuple[RecordSet, np.ndarray[Any, Any]]:
    """Simulated records whose nominal speeds are off, and true over nominal speeds."""
    rng = np.random.default_rng(seed)
    given: dict[str, Any] = {
        "resonance_hz": 0.17 * fs_hz,
        "impact_amplitude": {"inner": amplitude, "outer": 1.2 * amplitude, "ball": amplitude},
        **parameters,
    }
    if slip:
        given["mean_slip"] = {"slip": slip, "of_rollers": of_rollers}
        effects = (*effects, "mean_slip")
    twin = build_twin(TwinSpec("phenomenological", tuple(effects), parameters=given), BEARINGS[bearing])
    conditions = [
        Condition(
            f"r{i}", 1300 + 400 * (i // len(faults)) + rng.uniform(-20, 20), fs_hz, int(fs_hz), faults[i % len(faults)]
        )
        for i in range(n)
    ]
    made = twin.simulate(conditions, rng)
    ratios = factor * (1 + own * rng.standard_normal(n))
    wrong = [
        replace(r, condition=replace(r.condition, speed_rpm=r.condition.speed_rpm / ratio))
        for r, ratio in zip(made, ratios, strict=True)
    ]
    return RecordSet.from_records("world", "m/s^2", BEARINGS[bearing], wrong), ratios


@pytest.mark.parametrize("bearing", ["6205", "6203", "ZA-2115"])
@pytest.mark.parametrize(("fs_hz", "factor"), [(10_000.0, 0.96), (20_000.0, 1.03), (50_000.0, 1.0)])
def test_a_tachometer_that_is_off_is_found_without_shaft_lines(bearing: str, fs_hz: float, factor: float) -> None:
    records, ratios = world(bearing, fs_hz, factor=factor)
    speeds = estimate_speeds(records)
    assert [e.ratio for e in speeds.estimates] == pytest.approx(ratios, rel=5e-4)
    assert speeds.slip == 0
    assert speeds.common_ratio == pytest.approx(factor, rel=5e-4)


@pytest.mark.parametrize("bearing", ["6205", "6203", "ZA-2115"])
@pytest.mark.parametrize("slip", [0.015, -0.01])
def test_slip_is_told_from_a_wrong_tachometer_by_inner_and_outer(bearing: str, slip: float) -> None:
    records, ratios = world(bearing, factor=1.02, slip=slip)
    speeds = estimate_speeds(records)
    assert speeds.slip == pytest.approx(slip, abs=5e-4)
    how = "lags" if slip > 0 else "runs ahead of"
    assert any(f"the cage {how} its kinematic speed by {100 * abs(speeds.slip):.2f} %" in note for note in speeds.notes)
    assert [e.ratio for e in speeds.estimates] == pytest.approx(ratios, rel=5e-4)
    assert speeds.decidable


@pytest.mark.parametrize("of_rollers", [0.0, -1.0, 0.4])
@pytest.mark.parametrize("slip", [0.03, -0.02])
def test_rollers_that_do_not_follow_the_inner_ring_do_not_hide_slip(slip: float, of_rollers: float) -> None:
    records, ratios = world(factor=1.02, slip=slip, of_rollers=of_rollers, n=12)
    speeds = estimate_speeds(records)
    assert speeds.slip == pytest.approx(slip, abs=5e-4)
    assert [e.ratio for e in speeds.estimates] == pytest.approx(ratios, rel=5e-4)
    assert speeds.scatter == 0


def test_slip_is_told_though_nominal_speeds_scatter() -> None:
    records, ratios = world(own=0.015, slip=0.045, n=24, seed=3)
    speeds = estimate_speeds(records)
    assert speeds.slip == pytest.approx(0.045, abs=0.012)
    assert speeds.slip_evidence > 3
    assert speeds.slip_free / speeds.slip_sigma > 4
    combs = [c.fault != "healthy" for c in records.conditions]
    off = np.array([e.ratio for e in speeds.estimates]) / ratios - 1
    assert np.abs(off[combs]).max() < 0.012
    without, _ = world(own=0.015, n=24, seed=3)
    plain = estimate_speeds(without)
    assert plain.slip == 0
    assert abs(plain.slip_free) < 2.5 * plain.slip_sigma


@pytest.mark.parametrize("fs_hz", [10_000.0, 20_000.0])
def test_shaft_lines_show_each_records_own_speed_and_the_slip(fs_hz: float) -> None:
    records, ratios = world("6205", fs_hz, ["shaft_harmonics"], factor=1.02, own=0.01, slip=0.015)
    speeds = estimate_speeds(records)
    assert {e.found_by for e in speeds.estimates} <= {SHAFT_LINES, SIDEBANDS}
    off = np.array([e.ratio for e in speeds.estimates]) / ratios - 1
    assert np.median(np.abs(off)) < 3e-4
    assert np.abs(off).max() < 1e-3  # of a healthy record at 20 Hz: its lines are 1 Hz wide
    assert (np.abs(off) < 4 * np.array([e.sigma for e in speeds.estimates])).all()
    assert speeds.slip == pytest.approx(0.015, abs=5e-4)
    assert speeds.scatter > 1e-3


def test_side_lines_of_the_inner_race_show_the_shaft() -> None:
    records, ratios = world("6205", 20_000.0, ["load_zone"], factor=0.97, slip=0.02, faults=["inner"], n=3)
    for record, ratio in zip(records, ratios, strict=True):
        reading = read_speed(record.samples, record.condition, BEARINGS["6205"])
        assert reading.found_by == SIDEBANDS
        assert reading.shaft == pytest.approx(np.log(ratio), abs=3 * reading.shaft_sigma)
        assert reading.shaft_sigma < 0.01


def test_a_gear_on_a_healthy_machine_shows_the_shaft() -> None:
    records, ratios = world("6205", 20_000.0, ["gear_mesh"], factor=1.02, own=0.01, faults=["healthy"], n=3)
    speeds = estimate_speeds(records)
    assert [e.ratio for e in speeds.estimates] == pytest.approx(ratios, rel=3e-4)


def test_right_speeds_stay_to_the_last_digit() -> None:
    records, _ = world()
    assert [e.ratio for e in estimate_speeds(records).estimates] == pytest.approx(np.ones(len(records)), abs=2e-5)


def test_slip_with_right_speeds_is_slip() -> None:
    records, ratios = world(slip=0.01)
    speeds = estimate_speeds(records)
    assert speeds.slip == pytest.approx(0.01, abs=2e-4)
    assert [e.ratio for e in speeds.estimates] == pytest.approx(ratios, rel=2e-4)


def test_outer_race_alone_decides_nothing_and_says_so() -> None:
    records, _ = world(slip=0.015, faults=["outer"], n=4)
    speeds = estimate_speeds(records)
    assert not speeds.decidable
    assert speeds.slip == 0
    assert any("slip" in note for note in speeds.notes)
    # The comb's own deviation was put down to the speed.
    assert speeds.estimates[0].ratio == pytest.approx(1 - 0.015, abs=5e-4)


def test_healthy_noise_keeps_its_nominal_speed() -> None:
    records, _ = world(faults=["healthy"], factor=1.03, n=4)
    speeds = estimate_speeds(records)
    assert [e.found_by for e in speeds.estimates] == [NOT_DETECTED] * 4
    assert [e.ratio for e in speeds.estimates] == [1.0] * 4
    assert any("do not show" in note for note in speeds.notes)


def test_faults_too_weak_to_see_keep_their_nominal_speed() -> None:
    for seed in range(4):
        records, _ = world(amplitude=0.02, seed=seed)
        assert [e.ratio for e in estimate_speeds(records).estimates] == [1.0] * len(records)


@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
def test_mains_is_no_shaft(mains_hz: float) -> None:
    # 1x, 2x and 3x of these speeds lie within reach of multiples of the mains.
    twin = build_twin(
        TwinSpec(
            "phenomenological", ("mains_interference",), parameters={"mains_interference": {"mains_hz": mains_hz}}
        ),
        BEARINGS["6205"],
    )
    conditions = [Condition(f"{rpm}", rpm, 10_000.0, 10_000, "healthy") for rpm in (1450.0, 1750.0, 2950.0, 3500.0)]
    records = twin.simulate(conditions, np.random.default_rng(0))
    assert [e.ratio for e in estimate_speeds(records).estimates] == [1.0] * 4


def test_one_misleading_record_does_not_move_the_others() -> None:
    records, _ = world(n=12)
    odd = list(records)
    odd[1] = replace(odd[1], condition=replace(odd[1].condition, speed_rpm=odd[1].condition.speed_rpm / 1.04))
    speeds = estimate_speeds(RecordSet.from_records("odd", "m/s^2", records.bearing, odd))
    rest = [e.ratio for i, e in enumerate(speeds.estimates) if i != 1]
    assert rest == pytest.approx(np.ones(11), abs=1e-3)


def test_lines_of_another_shaft_are_rarely_taken_for_slip() -> None:
    """A neighbour turns 6.5 % slower: if its lines were the shaft's, the cage would run ahead as no cage does."""
    slips = []
    for seed in range(6):
        records, _ = world(n=16, seed=seed)
        loud = []
        for record in records:
            t = np.arange(record.samples.size) / record.condition.fs_hz
            other_hz = 0.935 * record.condition.speed_rpm / 60
            tones = sum(2.0 / k * np.sin(2 * np.pi * k * other_hz * t + k) for k in (1, 2, 3))
            loud.append(replace(record, samples=record.samples + tones))
        found = estimate_speeds(RecordSet.from_records("world", "m/s^2", records.bearing, loud))
        slips.append(abs(found.slip))
    assert np.median(slips) < 0.01
    assert max(slips) < 0.06


def test_a_large_slip_beside_true_speeds_is_slip() -> None:
    """Combs alone would move the speeds away from those given, which the lines of the shaft confirm."""
    records, _ = world(slip=0.072, effects=["shaft_harmonics"], faults=("healthy", "outer"), n=16)
    found = estimate_speeds(records)
    assert found.slip == pytest.approx(0.072, abs=3e-3)
    assert [e.ratio for e in found.estimates] == pytest.approx([1.0] * 16, abs=2e-3)


def test_a_wandering_speed_does_not_pull_the_mean() -> None:
    records, _ = world("6205", 20_000.0, ["speed_fluctuation"], n=12, seed=5)
    off = np.abs([e.ratio - 1 for e in estimate_speeds(records).estimates])
    assert np.median(off) < 2e-3  # the speed itself wanders by 1e-2


def test_corrected_records_keep_their_samples() -> None:
    records, _ = world(factor=1.02)
    speeds = estimate_speeds(records)
    corrected = speeds.corrected(records)
    for before, after, e in zip(records, corrected, speeds.estimates, strict=True):
        np.testing.assert_array_equal(before.samples, after.samples)
        assert after.condition.speed_rpm == before.condition.speed_rpm * e.ratio


def test_short_and_constant_records_say_nothing() -> None:
    bearing = BEARINGS["6205"]
    for x in (np.zeros(4000), np.ones(100), np.arange(50.0)):
        reading = read_speed(x, Condition("x", 1800.0, 10_000.0, x.size, "inner"), bearing)
        assert reading.found_by == NOT_DETECTED
        assert np.isinf(reading.comb_sigma)


def test_an_unknown_bearing_is_refused() -> None:
    records, _ = world(n=1)
    with pytest.raises(TwingapError, match="bearing is not known"):
        estimate_speeds(RecordSet.from_records("r", "", None, list(records)))


NEIGHBOUR = {"level": 8.0, "order": 2.53, "resonance_hz": 2600.0}
"""A bearing whose second line lies 6.6 % below that of an inner race of a 6205."""


@pytest.mark.parametrize("amplitude", [1.5, 3.0])
def test_impacts_of_another_bearing_move_no_speeds(amplitude: float) -> None:
    records, ratios = world(
        effects=["foreign_bearing"], faults=["healthy", "inner"], n=12, amplitude=amplitude, foreign_bearing=NEIGHBOUR
    )
    assert [e.ratio for e in estimate_speeds(records).estimates] == pytest.approx(ratios, abs=2e-3)


@pytest.mark.parametrize(("effects", "faults"), [([], ["inner", "outer"]), (["shaft_harmonics"], ["inner"])])
def test_faint_lines_of_this_bearing_in_healthy_records_bar_no_speeds(effects: list[str], faults: list[str]) -> None:
    """A bearing that is called healthy has some wear too: its lines lie where a wrong tachometer puts them."""
    worn, ratios = world(effects=effects, faults=faults, n=12, factor=0.97, amplitude=4.0)
    called = [replace(r, condition=replace(r.condition, fault="healthy")) if k in (0, 1, 6, 7) else r
              for k, r in enumerate(worn)]  # fmt: skip
    records = RecordSet.from_records("worn", "m/s^2", worn.bearing, called)
    speeds = estimate_speeds(records)
    assert [e.ratio for e in speeds.estimates] == pytest.approx(ratios, rel=1e-3)
    assert np.isfinite(speeds.slip_sigma), "combs are read: without them nothing is known of slip"


def test_a_tachometer_that_is_off_is_found_beside_another_bearing() -> None:
    records, ratios = world(
        effects=["foreign_bearing"], faults=["healthy", "outer"], n=12, factor=0.97, foreign_bearing=NEIGHBOUR
    )
    assert [e.ratio for e in estimate_speeds(records).estimates] == pytest.approx(ratios, rel=1e-3)


def test_one_record_of_many_does_not_move_the_speeds_of_all_by_much() -> None:
    silent, _ = world(faults=["inner"], n=8, amplitude=0.0)
    heard, _ = world(faults=["inner"], n=8, factor=1.05)
    records = RecordSet.from_records("one", "m/s^2", silent.bearing, [*list(silent)[:-1], list(heard)[-1]])
    assert [e.ratio for e in estimate_speeds(records).estimates] == [1.0] * 8
    alone = RecordSet.from_records("alone", "m/s^2", silent.bearing, [list(heard)[-1]])
    assert estimate_speeds(alone).estimates[0].ratio == pytest.approx(1.05, abs=2e-3)
