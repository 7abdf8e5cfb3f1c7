"""A lightly damped second mode of a few decibels is named with its values; the same mode in the simulator is no gap."""

from __future__ import annotations

import pytest

from twingap.gap import diagnose
from twingap.rigs.worlds import Case, World, make_world
from twingap.rigs.worlds.world import replay
from twingap.twins.twin_file import TwinSpec


@pytest.fixture(scope="module")
def world() -> World:
    return make_world(Case("single", effects=(("second_resonance", "medium"),), name="h1", n_records=24), 5)


def test_a_mode_is_named_where_it_is(world: World) -> None:
    report = diagnose(world.records, TwinSpec("phenomenological", bearing=world.records.bearing), quick=True).report
    assert report.verdict.effects == ("second_resonance",)
    (candidate,) = (one for one in report.candidates if one.effect == "second_resonance")
    true = world.parameters["second_resonance"]["frequency_hz"]
    frequency = candidate.parameters["frequency_hz"]
    assert frequency.value == pytest.approx(true, rel=0.06)
    assert frequency.ci is not None and frequency.ci[1] < 1.2 * frequency.ci[0], "no wider than the hump"


def test_no_gap_where_the_simulator_has_the_same_mode(world: World) -> None:
    spec = TwinSpec("phenomenological", bearing=world.records.bearing)
    report = diagnose(world.records, spec, sim=replay(world, seed=1, nominal=True), quick=True).report
    assert report.verdict.status == "no_gap"
