"""Rails, grids and gaps are found and measured, each without the others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.twingap.gap.features.machines import MACHINES, NAMES, Machine
from twingap.bearing import BEARINGS
from twingap.effects import Clipping, Dropout, Quantisation, ShaftHarmonics
from twingap.gap.features.acquisition import features as acquisition
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

every_machine = pytest.mark.parametrize("machine", MACHINES, ids=NAMES)


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_nothing_is_seen_where_nothing_is(machine: Machine, fault: str) -> None:
    for record, _ in machine.records([ShaftHarmonics(level_1x=4.0)], fault):
        found = acquisition.measure(record)
        assert set(found) == set(acquisition.NAMES)
        assert math.isnan(found["clip_rail_log"]) and found["clip_repeats"] == 0
        assert found["grid_step_log"] == pytest.approx(math.log10(acquisition.FINEST))
        assert found["gap_rate_log"] == pytest.approx(-1)


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer"])
@pytest.mark.parametrize("rail", [2.0, 2.7])
def test_rails(machine: Machine, fault: str, rail: float) -> None:
    for record, _ in machine.records([Clipping(rail=rail)], fault):
        found = acquisition.measure(record)
        assert 10 ** found["clip_rail_log"] == pytest.approx(rail, rel=0.01)
        assert found["clip_repeats"] > 0.5
        assert found["gap_rate_log"] == pytest.approx(-1)


@every_machine
@pytest.mark.parametrize("step", [0.02, 0.25, 1.0])
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_step_of_a_grid_whatever_the_gain(machine: Machine, step: float, fault: str) -> None:
    for record, _ in machine.records([Quantisation(step=step)], fault):
        single = RecordTransforms(np.float32(record.x).astype(float), record.condition, record.frame)
        for one in (record, single):
            found = acquisition.measure(one)
            assert 10 ** found["grid_step_log"] == pytest.approx(step, rel=0.05)
            assert found["grid_misfit"] < 0.05
            assert found["gap_rate_log"] < 0.3, "a grid repeats values by itself"


@every_machine
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_gaps_are_counted_and_measured(machine: Machine, fault: str) -> None:
    made = machine.records([Dropout(rate_hz=6.0, length_s=0.005)], fault, count=6, length_s=2.0)
    found = [acquisition.measure(record) for record, _ in made]
    assert np.mean([10 ** one["gap_rate_log"] - 0.1 for one in found]) == pytest.approx(6.0, rel=0.35)
    assert np.mean([10 ** one["gap_length_log"] for one in found]) == pytest.approx(0.005, rel=0.35)
    assert all(one["gap_jump"] > 0.7 for one in found)
    assert all(math.isnan(one["clip_rail_log"]) for one in found)


@pytest.mark.parametrize("samples", [np.zeros(1000), np.r_[1.0, np.zeros(999)], np.arange(300.0), np.ones(10)])
def test_odd_records_do_no_harm(samples: np.ndarray) -> None:
    frame = Frame(BEARINGS["6205"], (2000.0, 4000.0), 1.0)
    record = RecordTransforms(samples, Condition("r", 1800.0, 12000.0, samples.size, "outer"), frame)
    assert not any(math.isinf(value) for value in acquisition.measure(record).values())
