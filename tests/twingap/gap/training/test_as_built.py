"""Effects as a machine has them keep their names, and differ from the catalogue's in what is theirs to differ in."""

import numpy as np
import pytest
from scipy.signal import welch

from twingap.effects import catalogue, make_effect
from twingap.gap.training import as_built as module
from twingap.gap.training.as_built import CHANCE
from twingap.gap.training.machines import draw_machine

MACHINE = draw_machine(np.random.default_rng(0), own_simulator=False, most_records=4)
UNEVEN = ("mains_interference", "gear_mesh", "waviness", "looseness")


def as_built(effect, rng):
    return module.as_built(effect, MACHINE, rng)


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


def test_noise_of_a_slope_may_be_flat_below_a_corner():
    """Through a pole or two: as much below the corner as just above it, and falling beyond."""
    law = {"level": 1.0, "slope": 2.0, "low_hz": 50.0, "high_hz": 5900.0}
    effect = make_effect("coloured_noise", law)
    (other,) = {
        type(one)
        for seed in range(40)
        if type(one := as_built(effect, np.random.default_rng(seed))) is not type(effect)
    }
    twin = MACHINE.twin((other(**law),))
    quiet = [c for c in MACHINE.conditions if c.fault == "healthy"] or list(MACHINE.conditions)
    with_it, without = (
        np.concatenate([r.samples for r in of.simulate(quiet, np.random.default_rng(1))])
        for of in (twin, MACHINE.twin(()))
    )
    added, fs_hz = with_it - without, quiet[0].fs_hz
    f, power = welch(added, fs_hz, nperseg=2048)
    level = [power[(f > low) & (f < high)].mean() for low, high in ((20, 80), (80, 160), (800, 1200))]
    assert level[0] == pytest.approx(level[1], rel=0.5)
    assert level[2] < 0.05 * level[0]


def test_defects_may_take_as_much_of_a_pass_on_a_roller_as_on_a_race():
    effect = make_effect("entry_exit", {"arc_deg": 4.0, "exit_ratio": 0.8})
    made = [as_built(effect, np.random.default_rng(seed)) for seed in range(300)]
    other = [one for one in made if type(one) is not type(effect)]
    parts = {round(one.pass_part, 9) for one in other}
    assert parts == {round(4.0 * MACHINE.bearing.n_rollers / 360, 9)}
