"""Tones of 5 to 8 dB over the noise of one record are named; the same tones in the simulator are no gap."""

from __future__ import annotations

import pytest

from twingap.gap import diagnose
from twingap.gap.search.effect_search import SHOWN_P
from twingap.rigs.worlds import Case, World, make_world
from twingap.rigs.worlds.world import replay
from twingap.twins.twin_file import TwinSpec

TONES = (("mains_interference", "f5"), ("shaft_harmonics", "f3"), ("drive_interference", "f2"))
"""Effects, and names of worlds in which their lines are not at orders of the shaft."""


def faint(effect: str, name: str) -> World:
    return make_world(Case("single", effects=((effect, "weak"),), name=name, n_records=24), 5)


@pytest.mark.parametrize(("effect", "name"), TONES)
def test_a_faint_tone_is_named(effect: str, name: str) -> None:
    world = faint(effect, name)
    report = diagnose(world.records, TwinSpec("phenomenological", bearing=world.records.bearing), quick=True).report
    assert report.verdict.effects == (effect,)
    assert report.verdict.p_value <= 0.05
    if effect == "drive_interference":  # its lines alone show the gap, and nothing points to a further effect
        assert report.verdict.p_value == 2 * SHOWN_P
        assert report.verdict.status == "explained"


@pytest.mark.parametrize(("effect", "name"), TONES[:2])
def test_no_gap_where_the_simulator_has_the_same_tone(effect: str, name: str) -> None:
    world = faint(effect, name)
    spec = TwinSpec("phenomenological", bearing=world.records.bearing)
    report = diagnose(world.records, spec, sim=replay(world, seed=1, nominal=True), quick=True).report
    assert report.verdict.status == "no_gap"
