"""Effects as a machine has them keep their names, and differ from the catalogue's in what is theirs to differ in."""

import numpy as np
import pytest

from twingap.effects import catalogue
from twingap.gap.training.as_built import CHANCE, as_built

UNEVEN = ("mains_interference", "gear_mesh", "waviness", "looseness")


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_names_are_kept(name):
    effect = catalogue()[name]()
    assert {as_built(effect, np.random.default_rng(seed)).name for seed in range(20)} == {name}


@pytest.mark.parametrize("name", UNEVEN)
def test_some_have_harmonics_in_no_geometric_row(name):
    effect = catalogue()[name]()
    made = [as_built(effect, np.random.default_rng(seed)) for seed in range(400)]
    other = [one for one in made if type(one) is not type(effect)]
    assert len(other) / 400 == pytest.approx(CHANCE, abs=0.08)
    assert all(one is effect for one in made if type(one) is type(effect))
    for one in other[:20]:
        # Second differences of logarithms of a geometric row are nil.
        assert np.abs(np.diff(np.log(one.levels[:4]), 2)).max() > 1e-3
        assert one.levels.size == effect.levels.size


def test_half_of_the_uneven_hums_are_at_twice_the_mains():
    effect = catalogue()["mains_interference"](level=1.0, decay=0.8)
    made = [as_built(effect, np.random.default_rng(seed)) for seed in range(600)]
    other = [one for one in made if type(one) is not type(effect)]
    twice = [one for one in other if one.levels[1] > 5 * one.levels[0]]
    assert 0.35 < len(twice) / len(other) < 0.65


def test_effects_that_have_no_other_form_are_the_catalogues():
    effect = catalogue()["clipping"]()
    assert all(as_built(effect, np.random.default_rng(seed)) is effect for seed in range(50))
