"""What lies beneath the lines is found and measured."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.twingap.gap.features.machines import MACHINES, NAMES, Machine
from twingap.bearing import BEARINGS
from twingap.effects import (
    ColouredNoise,
    DistributedRoughness,
    ForeignBearing,
    ImpulsiveNoise,
    Looseness,
    SecondResonance,
    SensorRolloff,
)
from twingap.gap.features.spectrum import difference
from twingap.gap.features.spectrum import features as spectrum
from twingap.gap.features.spectrum.record_summary import summarise
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

every_machine = pytest.mark.parametrize("machine", MACHINES, ids=NAMES)


def measured(machine: Machine, effects: list, name: str, fault: str = "healthy", **more: float) -> np.ndarray:
    return np.array([spectrum.measure(record)[name] for record, _ in machine.records(effects, fault, **more)])


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_baseline_is_one_mode_over_white_noise(machine: Machine, fault: str) -> None:
    for record, _ in machine.records(fault=fault, count=2):
        found = spectrum.measure(record)
        assert set(found) == set(spectrum.NAMES)
        assert found["mode_fs"] == pytest.approx(machine.resonance, rel=0.06)
        assert found["mode_damping_log"] == pytest.approx(math.log10(0.05), abs=0.3)
        assert found["foreign_score"] < 3.2
        assert found["impulse_count_log"] < 0.5


@every_machine
def test_roughness_swells_at_shaft_rate_and_tones_do_not_make_it(machine: Machine) -> None:
    assert (measured(machine, [DistributedRoughness(level=1.5, depth=0.9)], "rough_1x") > 0.7).all()
    assert measured(machine, [Looseness(level=0.3)], "rough_1x").mean() < 0.5
    depth = 10 ** measured(machine, [DistributedRoughness(level=5.0, depth=0.6)], "rough_depth", count=6).mean()
    # Squaring 1 + d cos gives a line of 2 d / (1 + d^2 / 2).
    assert depth == pytest.approx(2 * 0.6 / (1 + 0.18), rel=0.2)


@every_machine
def test_impulses_are_counted(machine: Machine) -> None:
    at = 0.12 * machine.fs_hz
    effect = ImpulsiveNoise(level=40.0, rate_hz=8.0, resonance_hz=at)
    rates = 10 ** measured(machine, [effect], "impulse_rate_log", count=8, length_s=2.0) - 0.3
    assert rates.mean() == pytest.approx(8.0, rel=0.3)
    ringing = 10 ** np.nanmedian(measured(machine, [effect], "impulse_hz_log", length_s=2.0))
    assert ringing == pytest.approx(at, rel=0.1)


@every_machine
@pytest.mark.parametrize("order", [4.37, 6.63])
def test_foreign_order(machine: Machine, order: float) -> None:
    effect = ForeignBearing(level=5.0, order=order, resonance_hz=0.1 * machine.fs_hz)
    for record, ratio in machine.records([effect]):
        found = spectrum.measure(record)
        assert found["foreign_score"] > 3.2
        assert found["foreign_order"] == pytest.approx(order * ratio, rel=0.005)


def pairs(machine: Machine, effects: list) -> dict[str, float]:
    """`compare` of records with effects against records without."""
    sides = []
    for own, seed in ((effects, 1), ([], 2)):
        made = [v for fault in ("healthy", "outer") for v, _ in machine.records(own, fault, count=3, seed=seed)]
        sides.append([summarise(v) for v in made])
    return difference.compare(*sides)


@every_machine
def test_no_difference_without_an_effect(machine: Machine) -> None:
    found = pairs(machine, [])
    assert set(found) == set(difference.NAMES)
    assert found["all_rms"] < 0.1, "three records a side"


@every_machine
def test_second_resonance_is_placed(machine: Machine) -> None:
    at = 0.4
    found = pairs(machine, [SecondResonance(frequency_hz=at * machine.fs_hz, damping_ratio=0.03, gain=1.5)])
    assert found["healthy_bump_fs"] == pytest.approx(at, rel=0.05)
    assert found["healthy_mode_fs"] == pytest.approx(at, rel=0.08)
    assert found["healthy_mode_share"] > 0.6


@every_machine
def test_loss_has_its_corner(machine: Machine) -> None:
    corner = 0.8 * machine.resonance
    found = pairs(machine, [SensorRolloff(corner_hz=corner * machine.fs_hz, order=3)])
    assert found["faulty_rolloff_share"] > 0.8
    assert found["faulty_rolloff_corner_fs"] == pytest.approx(corner, rel=0.25)
    assert found["faulty_rolloff_share"] > found["faulty_added_share"]


@every_machine
def test_added_noise_has_its_level_and_slope(machine: Machine) -> None:
    found = pairs(machine, [ColouredNoise(level=1.5, slope=1.0, low_hz=60.0, high_hz=0.5 * machine.fs_hz)])
    assert found["healthy_added_share"] > 0.8
    assert found["healthy_added_slope"] == pytest.approx(1.0, abs=0.5)
    assert found["healthy_added_level"] == pytest.approx(math.log10(1.5), abs=0.2)


@pytest.mark.parametrize("samples", [np.zeros(1000), np.r_[1.0, np.zeros(999)], np.arange(300.0), np.ones(10)])
def test_odd_records_do_no_harm(samples: np.ndarray) -> None:
    frame = Frame(BEARINGS["6205"], (2000.0, 4000.0), 1.0)
    record = RecordTransforms(samples, Condition("r", 1800.0, 12000.0, samples.size, "outer"), frame)
    assert not any(math.isinf(value) for value in spectrum.measure(record).values())
