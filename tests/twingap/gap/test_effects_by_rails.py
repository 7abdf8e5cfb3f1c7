"""Clipping of a few samples in ten thousand is named; where the simulator's records have the same rail, it is not."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.gap import diagnose
from twingap.rigs.worlds import Case, World, make_world
from twingap.rigs.worlds.world import replay
from twingap.twins.twin_file import TwinSpec


@pytest.fixture(scope="module")
def world() -> World:
    return make_world(Case("single", effects=(("clipping", "weak"),), name="r1", n_records=24), 5)


def test_rare_clipping_is_named_with_its_rail(world: World) -> None:
    report = diagnose(world.records, TwinSpec("phenomenological", bearing=world.records.bearing), quick=True).report
    assert report.verdict.effects == ("clipping",)
    (candidate,) = (one for one in report.candidates if one.effect == "clipping")
    healthy = np.sqrt(np.mean([r.samples.var() for r in world.records if r.condition.fault == "healthy"]))
    assert candidate.parameters["rail"].value * healthy == pytest.approx(world.parameters["clipping"]["high"], rel=0.03)


def test_no_gap_where_the_simulator_clips_alike(world: World) -> None:
    spec = TwinSpec("phenomenological", bearing=world.records.bearing)
    report = diagnose(world.records, spec, sim=replay(world, seed=1, nominal=True), quick=True).report
    assert "clipping" not in report.verdict.effects
