"""What the records of single bearings show exactly is set in the closest twin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from tests.twingap.gap.search.test_free_spectra import SPEC, evidence_of
from twingap.effects import make_effect
from twingap.effects.by_state import State, of_state
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.gap.search.read_by_unit import read_by_unit
from twingap.records import Condition, RecordSet

CONDITIONS = [
    Condition(f"{fault}{unit}{i}", 1500.0 + 37.0 * i, 10000.0, 10000, fault, extra={"bearing_id": unit})
    for fault, unit in (("healthy", "none"), ("outer", "a"), ("outer", "b"), ("inner", "c"))
    for i in range(8)
]


def at_stated_speeds(evidence: Evidence) -> Evidence:
    """Evidence at the stated speeds, which are right: without lines of the shaft, slip is taken for wrong speeds."""
    fit, stated = evidence.calibrated.fit, {c.name: c for c in CONDITIONS}
    conditions = [stated[c.name] for c in fit.conditions]
    right = RecordSet(fit.name, fit.unit, fit.bearing, conditions, lambda place: fit[place].samples)
    calibrated = replace(evidence.calibrated, fit=right)
    return Evidence(calibrated, simulator_of(calibrated), SPEC, 7)


def values(effect: Any, fault: str, unit: str) -> dict[str, Any]:
    own: dict[str, Any] = of_state(effect, State(fault, unit)).parameter_values()
    return own


def test_each_bearing_slips_as_its_lines_show() -> None:
    true = {"slip": 0.0, "outer": {"units": {"a": {"slip": 0.011}, "b": {"slip": -0.006}}}}
    evidence = at_stated_speeds(evidence_of(make_effect("mean_slip", true), conditions=CONDITIONS))
    bare = evidence.against().simulator
    (slip,) = read_by_unit(evidence, bare, (), "mean_slip") or ()
    for fault, unit, value in (("outer", "a", 0.011), ("outer", "b", -0.006), ("inner", "c", 0.0)):
        assert values(slip, fault, unit)["slip"] == pytest.approx(value, abs=5e-4)
    assert values(slip, "healthy", "none")["slip"] == 0.0
    assert evidence.misfit(bare, (slip,)) < evidence.misfit(bare, ())


def test_units_recorded_in_different_ranges_have_steps_of_their_own() -> None:
    true = {"step": 0.05, "outer": {"units": {"a": {"step": 0.4}}}}
    evidence = evidence_of(make_effect("quantisation", true), conditions=CONDITIONS)
    bare = evidence.against().simulator
    (coarse,) = read_by_unit(evidence, bare, (), "quantisation") or ()
    steps = [values(coarse, *own)["step"] for own in (("outer", "a"), ("outer", "b"), ("healthy", "none"))]
    assert steps[0] == pytest.approx(8 * steps[1], rel=1e-3) == pytest.approx(8 * steps[2], rel=1e-3)
    assert evidence.misfit(bare, (coarse,)) < evidence.misfit(bare, ())


@pytest.mark.parametrize("name", ["quantisation", "clipping"])
def test_nothing_is_set_where_records_show_nothing(name: str) -> None:
    evidence = evidence_of(conditions=CONDITIONS)
    assert read_by_unit(evidence, evidence.against().simulator, (), name) is None
