"""A line below the shaft's order that no effect makes is reported, and not taken for a loose part."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from twingap.gap import diagnose
from twingap.gap.search.effect_search import CERTAIN, _shown
from twingap.rigs.worlds import Case, make_world
from twingap.twins.twin_file import TwinSpec


def verdict_of(case: Case):
    world = make_world(case, 9878)
    report = diagnose(world.records, TwinSpec("phenomenological", bearing=world.records.bearing), quick=True).report
    return report.verdict, [note for note in report.notes if "of the shaft's order" in note]


@pytest.mark.parametrize("strength", ["moderate", "strong"])
def test_a_whirl_is_no_loose_part_and_no_effect_explains_it(strength: str) -> None:
    case = Case("outside", uncatalogued=(("whirl", strength),), name=f"whirl {strength}", n_records=24)
    verdict, notes = verdict_of(case)
    assert verdict.status in ("unexplained", "partly_explained")
    assert set(verdict.effects) <= {"line_spectrum"}  # a free list of lines, whatever makes them
    assert len(notes) == 1
    order = make_world(case, 9878).parameters["whirl"]["order"]
    assert float(notes[0].split("line at ")[1].split(" of")[0]) == pytest.approx(order, abs=0.02)


def test_a_loose_part_is_named_and_has_no_unknown_line() -> None:
    case = Case("single", effects=(("looseness", "strong"),), name="loose", n_records=24)
    verdict, notes = verdict_of(case)
    assert verdict.effects == ("looseness",)
    assert verdict.status == "explained"
    assert notes == []


@pytest.mark.parametrize(
    ("certain", "excluded", "odds"), [(1, 0, CERTAIN), (0, 1, -CERTAIN), (1, 1, -CERTAIN), (0, 0, 0.5)]
)
def test_what_features_rule_out_is_improbable_whatever_speaks_for_it(certain: int, excluded: int, odds: float) -> None:
    effect = SimpleNamespace(certain=lambda seen: bool(certain), excluded=lambda seen: bool(excluded))
    assert _shown(effect, 0.5, SimpleNamespace(features={})) == odds
