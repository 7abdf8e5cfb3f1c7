"""Growth along a run: its rate is that of all records, also where those of the fit part are of a short time."""

from __future__ import annotations

import math

import pytest

from twingap.gap import diagnose
from twingap.rigs.worlds import Case, make_world
from twingap.twins.twin_file import TwinSpec


def test_the_rate_is_found_and_closes_the_gap() -> None:
    world = make_world(
        Case("single", effects=(("damage_growth", "medium"),), name="damage_growth0", n_records=24), 9871
    )
    report = diagnose(world.records, TwinSpec("phenomenological", bearing=world.records.bearing), quick=True).report
    assert report.verdict.effects == ("damage_growth",)
    assert report.verdict.closure is not None and report.verdict.closure > 0.6
    (growth,) = (one for one in report.candidates if one.effect == "damage_growth")
    times = world.layout.time_s or ()
    nepers = growth.parameters["rate_per_s"].value * (max(times) - growth.parameters["onset_s"].value)
    truth = world.parameters["damage_growth"]["growth_db"] * math.log(10) / 20
    assert nepers == pytest.approx(truth, rel=0.35)
