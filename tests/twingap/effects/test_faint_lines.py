"""Faint lines are missing where the records have them beyond chance and the twin has not."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from twingap.effects import Effect, MainsInterference, ShaftHarmonics
from twingap.effects._faint_lines import lacks_faint_lines


def seen(kind: str, z: float, rival: float, theirs: float, their_rival: float) -> SimpleNamespace:
    name = f"pooled|faint_{kind}"
    ours = {name: z, f"{name}_rival": rival}
    ours |= {f"{name}.diff": z - theirs, f"{name}_rival.diff": rival - their_rival}
    return SimpleNamespace(features=ours, own_mode=(2000.0, 0.05))


@pytest.mark.parametrize("kind", ["sides", "mains", "shaft"])
def test_lines_of_the_records_alone_are_missing(kind: str) -> None:
    assert lacks_faint_lines(seen(kind, 9.0, 5.0, 1.0, 1.5), kind, 5.0)
    assert not lacks_faint_lines(seen(kind, 4.9, 1.0, 1.0, 1.5), kind, 5.0)
    assert not lacks_faint_lines(seen(kind, 9.0, 8.0, 1.0, 1.5), kind, 5.0)
    assert not lacks_faint_lines(seen(kind, 9.0, 5.0, 8.0, 5.0), kind, 5.0)


def test_the_best_of_many_places_is_high_by_chance_and_known_places_are_not() -> None:
    assert lacks_faint_lines(seen("sides", 9.0, 5.0, 5.2, 5.0), "sides", 5.0)
    assert not lacks_faint_lines(seen("mains", 6.4, 2.7, 4.1, 4.0), "mains", 5.0)


def test_waveforms_with_lines_as_faint_as_the_records_do_not_lack_them() -> None:
    found = seen("shaft", 7.0, 2.0, 2.0, 1.0)
    assert lacks_faint_lines(found, "shaft", 5.0)
    found.own_mode = None
    assert not lacks_faint_lines(found, "shaft", 5.0)


def test_lines_of_the_twin_in_a_part_of_its_records_count() -> None:
    found = seen("shaft", 8.0, 2.0, 1.0, 1.0)
    found.features |= {"pooled|faint_shaft_any": 8.0, "pooled|faint_shaft_any.diff": 3.5}
    assert not lacks_faint_lines(found, "shaft", 5.0)


def test_what_is_not_known_is_not_missing_and_a_twin_without_lines_needs_no_value() -> None:
    assert not lacks_faint_lines(SimpleNamespace(features={}, own_mode=None), "mains", 5.0)
    assert not lacks_faint_lines(seen("shaft", math.nan, 2.0, 1.0, 1.0), "shaft", 5.0)
    assert lacks_faint_lines(seen("shaft", 9.0, 2.0, math.nan, math.nan), "shaft", 5.0)


@pytest.mark.parametrize("effect", [ShaftHarmonics, MainsInterference])
def test_lines_that_are_clear_in_the_twin_are_not_missing(effect: type[Effect]) -> None:
    """The search for faint ones may not find them: at its speeds, they may be near multiples of the mains."""
    kind, clear = ("shaft", "order_few") if effect is ShaftHarmonics else ("mains", "mains_50_max")

    def of_twin(z: float) -> SimpleNamespace:
        found = seen(kind, 9.0, 2.0, 0.0, 0.0)
        found.features.update({f"pooled|{clear}": 2.9, f"pooled|{clear}.diff": 2.9 - math.log1p(z)})
        return found

    assert effect.certain(of_twin(0.5)) and effect.shows_gap(of_twin(0.5))
    assert not effect.certain(of_twin(15.0)) and not effect.shows_gap(of_twin(15.0))
