"""A drive whose carrier has no line: named and placed by its pair of lines; none where the simulator has it, too."""

from __future__ import annotations

import pytest

from twingap.gap import diagnose
from twingap.rigs.worlds import Case, World, make_world
from twingap.rigs.worlds.world import replay
from twingap.twins.twin_file import TwinSpec


@pytest.fixture(scope="module")
def world() -> World:
    made = make_world(Case("single", effects=(("drive_interference", "medium"),), name="d7", n_records=16), 5)
    assert made.parameters["drive_interference"]["suppressed"]
    return made


def test_the_pair_is_named_and_placed(world: World) -> None:
    report = diagnose(world.records, TwinSpec("phenomenological", bearing=world.records.bearing), quick=True).report
    assert report.verdict.effects == ("drive_interference",)
    (drive,) = (one for one in report.candidates if one.effect == "drive_interference")
    truth = world.parameters["drive_interference"]
    assert drive.parameters["carrier_hz"].value == pytest.approx(truth["carrier_hz"], abs=2.0)
    assert drive.parameters["sideband_order"].value == pytest.approx(truth["pole_pairs"], rel=0.02)


def test_no_gap_where_the_simulator_has_the_same_drive(world: World) -> None:
    spec = TwinSpec("phenomenological", bearing=world.records.bearing)
    report = diagnose(world.records, spec, sim=replay(world, seed=1, nominal=True), quick=True).report
    assert report.verdict.status == "no_gap"
