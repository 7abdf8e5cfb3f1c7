"""Tones are found, told apart and measured."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.twingap.gap.features.machines import MACHINES, NAMES, Machine
from twingap.bearing import BEARINGS
from twingap.effects import (
    DriveInterference,
    ForeignBearing,
    GearMesh,
    Looseness,
    MainsInterference,
    MeanSlip,
    ShaftHarmonics,
    Waviness,
)
from twingap.gap.features.tones import features as tones
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

every_machine = pytest.mark.parametrize("machine", MACHINES, ids=NAMES)


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer", "inner"])
def test_nothing_is_seen_where_nothing_is(machine: Machine, fault: str) -> None:
    for record, _ in machine.records(fault=fault, seed=3):
        found = tones.measure(record)
        assert set(found) == set(tones.NAMES)
        assert found["shaft_lock"] < 0.7 and found["gear_score"] < 0.8 and found["pair_score"] < 0.8
        assert found["comb_score"] == 0
        # A few of a fault's hundred lines may be missed beside stronger ones.
        assert math.expm1(found["free_count_log"]) <= max(3, 0.1 * math.expm1(found["peaks_log"]))


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_speed_is_locked_to_shaft_tones(machine: Machine, fault: str) -> None:
    for record, ratio in machine.records([ShaftHarmonics()], fault):
        found = tones.measure(record)
        assert found["shaft_lock"] > 1
        assert found["shaft_ratio_log"] == pytest.approx(math.log(ratio), abs=0.003)
        assert found["order_1_level"] == pytest.approx(math.log10(0.5), abs=0.06)
        assert found["half_mean"] < 0.5


@every_machine
def test_looseness_has_half_orders(machine: Machine) -> None:
    for record, ratio in machine.records([Looseness(level=0.4)]):
        found = tones.measure(record)
        assert found["half_mean"] > 1 and found["order_high_mean"] > 1
        assert found["order_decay"] == pytest.approx(0.85, abs=0.05)
        assert found["shaft_ratio_log"] == pytest.approx(math.log(ratio), abs=0.002)
        assert found["gear_score"] < 3


@every_machine
@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
def test_mains_are_told_from_each_other(machine: Machine, mains_hz: float) -> None:
    for record, _ in machine.records([MainsInterference(mains_hz=mains_hz)]):
        found = tones.measure(record)
        assert (found["mains_is_60"] > 0.5) == (mains_hz == 60)
        assert abs(found["mains_is_60"]) > 0.5
        assert found["mains_level"] == pytest.approx(math.log10(0.5), abs=0.08)
        assert found["shaft_lock"] < 0.7


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_carrier_is_found_to_a_thousandth(machine: Machine, fault: str) -> None:
    carrier = 0.11 * machine.fs_hz + 3.3
    effect = DriveInterference(level=1.0, carrier_hz=carrier, sideband_order=2.0, depth=0.8)
    for record, ratio in machine.records([effect], fault):
        found = tones.measure(record)
        assert found["pair_score"] > 1
        assert 10 ** found["pair_hz_log"] == pytest.approx(carrier, rel=1e-3)
        assert found["pair_side_order"] == pytest.approx(2 * ratio, rel=0.03)
        assert found["pair_depth_log"] == pytest.approx(math.log10(0.8), abs=0.1)


@every_machine
@pytest.mark.parametrize("teeth", [23, 41])
def test_teeth_are_counted(machine: Machine, teeth: int) -> None:
    for record, ratio in machine.records([GearMesh(teeth=teeth, level=0.8)]):
        found = tones.measure(record)
        assert found["gear_teeth"] == teeth
        assert found["shaft_ratio_log"] == pytest.approx(math.log(ratio), abs=0.001)
        assert found["gear_level"] == pytest.approx(math.log10(0.8), abs=0.08)


@every_machine
@pytest.mark.parametrize("race", ["outer", "inner"])
def test_waviness_is_named_by_its_race_and_slip(machine: Machine, race: str) -> None:
    bearing, slip = BEARINGS[machine.bearing], 0.015
    rate = bearing.slipped(1 - slip)[race] / bearing.fault_order(race)
    for record, ratio in machine.records([Waviness(inner=race == "inner"), MeanSlip(slip=slip)]):
        found = tones.measure(record)
        other = "inner" if race == "outer" else "outer"
        assert found[f"wave_{race}_score"] > found[f"wave_{other}_score"] + 1
        assert found[f"wave_{race}_ratio_log"] == pytest.approx(math.log(ratio * rate), abs=0.004)
        assert found[f"wave_{race}_level"] == pytest.approx(math.log10(0.5), abs=0.1)


@every_machine
def test_a_comb_of_strange_impacts_does_not_lock_the_shaft(machine: Machine) -> None:
    effect = ForeignBearing(level=8.0, order=4.37, resonance_hz=0.12 * machine.fs_hz)
    for record, ratio in machine.records([effect]):
        found = tones.measure(record)
        assert found["comb_order"] == pytest.approx(4.37 * ratio, rel=0.005)
        assert found["shaft_lock"] < 0.7 and found["pair_score"] < 0.8


@pytest.mark.parametrize("samples", [np.zeros(1000), np.ones(50), np.r_[1.0, np.zeros(999)], np.arange(300.0)])
def test_odd_records_do_no_harm(samples: np.ndarray) -> None:
    frame = Frame(BEARINGS["6205"], (2000.0, 4000.0), 1.0)
    record = RecordTransforms(samples, Condition("r", 1800.0, 12000.0, samples.size, "outer"), frame)
    assert not any(math.isinf(value) for value in tones.measure(record).values())
