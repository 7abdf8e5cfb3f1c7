"""Variants of effects keep the effects' names, and differ from the catalogue's form as real machines do."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch

from twingap.effects import Draft, catalogue, make_effect, trainable
from twingap.effects.damage_growth import PowerLawGrowth
from twingap.effects.draft import Impacts
from twingap.effects.entry_exit import SoftEntryExit
from twingap.gap.knowledge import simulated_gaps
from twingap.gap.knowledge.machines import draw_machine
from twingap.gap.knowledge.simulated_gaps import VARIANT
from twingap.records import Condition

MACHINE = draw_machine(np.random.default_rng(0), own_simulator=False, most_records=4)
UNEVEN = ("mains_interference", "gear_mesh", "waviness", "looseness")
OTHERWISE = sorted(set(trainable()) - {"second_resonance", "damage_growth", "mean_slip"})


def maybe_variant(effect, rng):
    return simulated_gaps.maybe_variant(effect, MACHINE, rng)


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_names_are_kept(name):
    effect = catalogue()[name]()
    assert {maybe_variant(effect, np.random.default_rng(seed)).name for seed in range(20)} == {name}


@pytest.mark.parametrize("name", UNEVEN)
def test_some_have_harmonics_in_no_geometric_row(name):
    effect = catalogue()[name]()
    made = [maybe_variant(effect, np.random.default_rng(seed)) for seed in range(400)]
    other = [one for one in made if type(one) is not type(effect)]
    assert len(other) / 400 == pytest.approx(VARIANT, abs=0.08)
    assert all(one is effect for one in made if type(one) is type(effect))
    for one in other[:20]:
        # Second differences of logarithms of a geometric row are nil.
        assert np.abs(np.diff(np.log(one.levels[:4]), 2)).max() > 1e-3
        assert one.levels.size == effect.levels.size


def test_half_of_the_uneven_hums_are_at_twice_the_mains():
    effect = catalogue()["mains_interference"](level=1.0, decay=0.8)
    made = [maybe_variant(effect, np.random.default_rng(seed)) for seed in range(600)]
    other = [one for one in made if type(one) is not type(effect)]
    twice = [one for one in other if one.levels[1] > 5 * one.levels[0]]
    assert 0.35 < len(twice) / len(other) < 0.65


@pytest.mark.parametrize("name", ["second_resonance", "mean_slip"])
def test_effects_that_have_no_other_form_are_the_catalogues(name):
    effect = catalogue()[name]()
    assert all(maybe_variant(effect, np.random.default_rng(seed)) is effect for seed in range(50))


def test_noise_of_a_slope_may_be_flat_below_a_corner():
    """Through a pole or two: as much below the corner as just above it, and falling beyond."""
    law = {"level": 1.0, "slope": 2.0, "low_hz": 50.0, "high_hz": 5900.0}
    effect = make_effect("coloured_noise", law)
    (other,) = {
        type(one)
        for seed in range(40)
        if type(one := maybe_variant(effect, np.random.default_rng(seed))) is not type(effect)
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
    made = [maybe_variant(effect, np.random.default_rng(seed)) for seed in range(300)]
    other = [one for one in made if type(one) is not type(effect)]
    parts = {round(one.pass_part, 9) for one in other}
    assert parts == {0.0, round(4.0 * MACHINE.bearing.n_rollers / 360, 9)}


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_push_has_the_strength_of_the_fainter_impact_at_low_frequencies_and_little_at_high_ones(ratio):
    """Of one pass: two blows, or one blow and a push, as far apart and as strong."""
    made = {}
    for soft in (0.0, 0.1):
        impacts = Impacts(np.zeros(1), np.ones(1), np.zeros(1, int))
        SoftEntryExit(arc_deg=4.0, exit_ratio=ratio, soft=soft).on_impacts(draft_of("outer"), impacts, None)
        made[soft] = impacts
    delay = np.ptp(made[0.0].turns)

    def answer(impacts, per_delay):
        return abs(impacts.amplitudes @ np.exp(-2j * np.pi * per_delay * impacts.turns / delay))

    assert answer(made[0.1], 0.0) == pytest.approx(1 + ratio)
    assert answer(made[0.1], 0.5) == pytest.approx(answer(made[0.0], 0.5), rel=0.12)
    # Where both blows of a sharp pair add up, only the louder of the two is left beside a push.
    assert answer(made[0.0], 5.0) == pytest.approx(1 + ratio)
    assert answer(made[0.1], 5.0) == pytest.approx(max(1.0, ratio), rel=0.02)


def other_of(name, values):
    """Another form of an effect of these values."""
    effect = make_effect(name, values)
    for seed in range(60):
        one = maybe_variant(effect, np.random.default_rng(seed))
        if type(one) is not type(effect):
            return one
    raise AssertionError(f"{name} has no other form")


def draft_of(fault, speed_rpm=1500.0, n=20_000, time_s=None):
    condition = Condition("r", speed_rpm, 10_000.0, n, fault, None, time_s)
    t = np.arange(n) / 10_000
    return Draft(condition, MACHINE.bearing, 1.0, t, t * speed_rpm / 60, x=np.zeros(n))


@pytest.mark.parametrize("name", OTHERWISE)
def test_all_others_have_another_form(name):
    values = {"slope": 1.5} if name == "coloured_noise" else {}
    assert other_of(name, values).name == name


def test_speed_that_hunts_or_runs_up_varies_by_as_much():
    one = other_of("speed_fluctuation", {"level": 0.02, "bandwidth_hz": 10.0})
    draft = draft_of("inner")
    one.apply(draft, np.random.default_rng(0))
    speed = np.diff(draft.turns) * 10_000 / 25
    assert speed.mean() == pytest.approx(1.0, abs=1e-6)
    assert speed.std() == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize("name", ["slip_jitter", "impact_scatter"])
def test_chances_of_another_law_have_the_same_mean_and_spread(name):
    one = other_of(name, {"sigma": 0.3})
    rng = np.random.default_rng(0)
    drawn = one._lateness(100_000, rng) if name == "slip_jitter" else one._strengths(100_000, 0.3, rng)
    mean, spread = (0.0, 1.0) if name == "slip_jitter" else (1.0, 0.3)
    assert drawn.mean() == pytest.approx(mean, abs=0.01)
    assert drawn.std() == pytest.approx(spread, rel=0.02)


def test_a_zone_of_load_leaves_the_mean_strength():
    one = other_of("load_zone", {"depth": 0.8})
    weight = one._weight(draft_of("inner"), np.arange(5000) / 5000, np.random.default_rng(0))
    assert weight.mean() == pytest.approx(1.0, abs=0.01)
    assert weight.min() == pytest.approx(0.2, abs=0.01)


def test_roughness_of_a_zone_is_as_strong_as_any():
    one = other_of("distributed_roughness", {"depth": 0.7})
    assert np.mean(one._swell(np.arange(7200) / 7200) ** 2) == pytest.approx(1 + 0.7**2 / 2, rel=0.01)


def test_damage_grows_otherwise_on_machines_with_a_run_alone():
    growth = make_effect("damage_growth", {"rate_per_s": 1e-3})
    for seed in range(12):
        machine = draw_machine(np.random.default_rng(seed), own_simulator=False, most_records=8)
        made = {type(simulated_gaps.maybe_variant(growth, machine, np.random.default_rng(k))) for k in range(40)}
        assert len(made) == (2 if machine.conditions[0].time_s is not None else 1)


def test_damage_comes_to_the_same_end():
    values = {"rate_per_s": 0.002, "onset_s": 100.0}
    one = PowerLawGrowth(**values, until_s=1000.0, power=2.0)
    effect = make_effect("damage_growth", values)
    at = {t: draft_of("outer", time_s=t) for t in (50.0, 550.0, 1000.0)}
    assert one.growth(at[50.0]) == effect.growth(at[50.0]) == 1.0
    assert one.growth(at[1000.0]) == pytest.approx(effect.growth(at[1000.0]))
    assert one.growth(at[550.0]) < effect.growth(at[550.0]) < replace(one, power=0.5).growth(at[550.0])


def test_forces_of_what_turns_may_grow_with_speed():
    effect = make_effect("shaft_harmonics", {})
    made = [maybe_variant(effect, np.random.default_rng(seed)) for seed in range(60)]
    rising = next(one for one in made if getattr(one, "rise", 0.0) > 0)
    rms = {}
    for speed_rpm in (1000.0, 2000.0):
        draft = draft_of("healthy", speed_rpm)
        rising.apply(draft, np.random.default_rng(0))
        rms[speed_rpm] = draft.x.std()
    assert rms[2000.0] / rms[1000.0] == pytest.approx(2**rising.rise, rel=1e-2)


def test_sensors_of_real_poles_have_the_same_corner():
    one = other_of("sensor_rolloff", {"corner_hz": 1000.0, "order": 3})
    response = np.abs(one._response(10_000, 10_000.0))
    assert 20 * np.log10(response[1000]) == pytest.approx(-3.01, abs=0.01)
    assert response[0] == pytest.approx(1.0)


def test_rails_may_lie_unevenly_steps_beside_zero_and_gaps_be_zeros():
    x = np.random.default_rng(0).standard_normal(20_000)
    found = {}
    for name, values in (("clipping", {"rail": 1.5}), ("quantisation", {"step": 0.5}), ("dropout", {"rate_hz": 10.0})):
        draft = draft_of("healthy")
        draft.x = x.copy()
        other_of(name, values).apply(draft, np.random.default_rng(0))
        found[name] = draft.x
    assert found["clipping"].max() == 1.5
    assert found["clipping"].min() != -1.5
    assert set(np.unique(np.mod(found["quantisation"], 0.5))) == {0.25}
    assert np.mean(found["dropout"] == 0) > 0.02
