"""Worlds: reproducible, neutral in what they tell, within their stated ranges; plans balanced; seals tight."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from twingap.bearing import FAULTS
from twingap.errors import TwingapError
from twingap.rigs.worlds import (
    CATALOGUE,
    KINDS,
    ON_FAULTS,
    STRENGTHS,
    TEST_BEARINGS,
    UNCATALOGUED,
    Case,
    Truth,
    World,
    cases,
    machine,
    make_world,
    open_seal,
    replay,
    seal,
)
from twingap.rigs.worlds.base import OVERSAMPLING, Mode, noise_norm, thin, through
from twingap.rigs.worlds.motion import deposit

NONCE = "0123456789abcdef"


def small(kind: str, arm: str = "twin", effects: tuple[str, ...] = (), uncatalogued: tuple[str, ...] = ()) -> Case:
    with_strength = tuple((name, "medium") for name in effects), tuple((name, "strong") for name in uncatalogued)
    return Case(kind, arm, *with_strength, n_records=4, duration_s=0.25, fs_hz=10_000.0, faults=("healthy", "inner"))


CROWD = small("crowd", effects=("load_zone", "gear_mesh", "clipping"), uncatalogued=("echo",))


@pytest.fixture(scope="module")
def crowd() -> World:
    return make_world(CROWD, 5)


def test_same_seed_same_bytes(crowd: World) -> None:
    again = make_world(CROWD, 5)
    assert again.records.digest == crowd.records.digest and again.truth.to_json() == crowd.truth.to_json()
    assert make_world(CROWD, 6).records.digest != crowd.records.digest
    assert make_world(replace(CROWD, name="other"), 5).records.digest != crowd.records.digest


def test_a_machine_with_all_its_effects_is_the_world(crowd: World) -> None:
    assert machine(CROWD, 5, crowd.parameters).digest == crowd.records.digest
    assert machine(CROWD, 5, ()).digest != crowd.records.digest
    with pytest.raises(TwingapError, match="no effect 'dropout'; it has"):
        machine(CROWD, 5, ["dropout"])


def test_clipping_alone_differs_at_the_rails_alone(crowd: World) -> None:
    without = machine(CROWD, 5, [n for n in crowd.parameters if n != "clipping"])
    p = crowd.parameters["clipping"]
    for one, other in zip(crowd.records, without, strict=True):
        np.testing.assert_array_equal(one.samples, np.clip(other.samples, p["low"], p["high"]))


def test_replay_is_reproducible_and_new(crowd: World) -> None:
    one, two = replay(crowd, seed=1), replay(crowd, seed=1)
    assert one.digest == two.digest
    assert replay(crowd, seed=2).digest != one.digest != crowd.records.digest
    assert one.conditions == crowd.records.conditions
    level = [np.log(np.std([r.samples for r in s])) for s in (one, machine(CROWD, 5, CROWD.effect_names))]
    assert level[0] == pytest.approx(level[1], abs=0.3)


def test_a_world_without_effects_has_none() -> None:
    world = make_world(small("none"), 3)
    assert world.truth.effects == world.truth.uncatalogued == () and not world.truth.parameters
    assert world.records.digest == machine(world.case, 3, ()).digest
    assert world.sim is None and world.twin["twin"] == {"model": "phenomenological", "effects": []}


def test_without_effects_twin_machines_are_the_baseline() -> None:
    """Strikes of one size, strictly periodic; noise of unit RMS."""
    for seed in range(3):
        world = make_world(replace(small("none"), duration_s=1.0), seed)
        quiet = [np.std(r.samples) for r in world.records if r.condition.fault == "healthy"]
        assert np.array(quiet) / world.base.gain == pytest.approx(1.0, abs=0.1)
        assert not world.base.own and len(world.base.modes) == 1


def test_contact_worlds_bring_simulated_records() -> None:
    case = small("single", "contact", ("speed_gain",))
    world = make_world(case, 1)
    assert world.sim is not None and world.sim.conditions == world.records.conditions
    assert world.sim.unit == "" and "speed_gain" not in world.base.own
    plain = machine(case, 1, ())
    for mine, theirs in zip(plain, world.sim, strict=True):
        assert abs(np.corrcoef(mine.samples, theirs.samples)[0, 1]) < 0.3, "fresh draws"
    ratio = [np.std(a.samples) / np.std(b.samples) for a, b in zip(plain, world.sim, strict=True)]
    assert max(ratio) / min(ratio) < 1.6, "but for one gain, alike"


def test_records_tell_nothing_of_the_case() -> None:
    for world in (make_world(small("none"), 0), make_world(CROWD, 0)):
        c = world.records.conditions
        assert world.records.name == "machine" and all(not one.extra for one in c)
        assert [one.name for one in c] == [f"r{i:03d}" for i in range(len(c))]


def test_conditions_stay_in_range() -> None:
    errors, seen = [], Counter[str]()
    for seed in range(40):
        case = Case("none", n_records=24, duration_s=0.1)
        layout = make_world(case, seed).layout
        true, stated = np.array(layout.speed_rpm), np.array(layout.stated_rpm)
        assert true.min() > 590 and true.max() < 3610 and true.max() / true.min() > 1.35
        errors.append(np.abs(stated / true - 1).max())
        for fault in set(layout.fault):
            assert len({g for g, f in zip(layout.group, layout.fault, strict=True) if f == fault}) >= 2
        assert all(len({f for g, f in zip(layout.group, layout.fault, strict=True) if g == one}) == 1
                   for one in layout.group)  # fmt: skip
        seen.update([layout.bearing.name, f"{layout.fs_hz:g}", f"run {layout.time_s is not None}"])
        seen.update([f"load {layout.load_stated}", f"faults {len(set(layout.fault))}"])
    assert max(errors) < 0.0305 and np.median(errors) > 0.005
    assert len(seen) >= 5 + 6 + 2 + 2 + 3, seen
    assert max(b.contact_angle_deg for b in TEST_BEARINGS.values()) == 40


def test_what_an_effect_needs_is_there() -> None:
    for seed in range(6):
        for name in ON_FAULTS:
            layout = make_world(Case("single", effects=((name, "weak"),), n_records=6, duration_s=0.1), seed).layout
            assert layout.faults and set(layout.fault) <= set(FAULTS)
            if name == "damage_growth":
                assert layout.time_s is not None
            if name == "mean_slip":
                assert {"inner", "outer"} <= set(layout.faults)
            if name == "load_zone":
                assert {"inner", "ball"} & set(layout.faults)


@pytest.mark.parametrize("name", UNCATALOGUED)
def test_effects_outside_the_catalogue_change_the_records(name: str) -> None:
    case = small("outside", uncatalogued=(name,))
    world, without = make_world(case, 2), machine(case, 2, ())
    changed = [np.std(a.samples - b.samples) / np.std(b.samples) for a, b in zip(world.records, without, strict=True)]
    assert max(changed) > 0.1 and world.truth.uncatalogued == (name,) and not world.truth.effects
    assert all(np.isfinite(r.samples).all() for r in world.records)


def test_modelled_effects_are_no_gap() -> None:
    world = make_world(replace(small("none"), modelled=("load_zone",)), 0)
    assert world.twin["twin"]["effects"] == ["load_zone"] and world.truth.effects == ()
    assert set(world.base.own) == {"load_zone"}


# --- seals ---


def test_a_seal_opens_with_its_truth_only(crowd: World) -> None:
    sealed = seal(crowd.truth, NONCE)
    assert open_seal(sealed, crowd.truth.to_json(), NONCE).to_json() == crowd.truth.to_json()
    assert open_seal(sealed, crowd.truth, NONCE).effects == crowd.truth.effects
    altered = [
        replace(crowd.truth, effects=crowd.truth.effects[1:]),
        replace(crowd.truth, uncatalogued=()),
        replace(crowd.truth, seed=6),
        crowd.truth.to_json() + " ",
    ]
    for other in altered:
        with pytest.raises(TwingapError, match="not those that were sealed"):
            open_seal(sealed, other, NONCE)
    with pytest.raises(TwingapError, match="not those that were sealed"):
        open_seal(sealed, crowd.truth, NONCE + "0")
    with pytest.raises(TwingapError, match="at least 16"):
        seal(crowd.truth, "short")


def test_truth_goes_through_json(crowd: World) -> None:
    text = crowd.truth.to_json()
    assert Truth.from_json(text).to_json() == text
    values = json.loads(text)
    assert set(values["parameters"]) == {"load_zone", "gear_mesh", "clipping", "echo"} == set(values["strength"])
    assert values["speed_rpm"] == list(crowd.layout.speed_rpm)
    for bad in ("{}", "nonsense", "[]"):
        with pytest.raises(TwingapError, match="no truth"):
            Truth.from_json(bad)


# --- plans ---


def test_the_plan_of_three_hundred() -> None:
    plan = cases(300, 4)
    kinds = Counter(c.kind for c in plan)
    assert kinds == {"none": 60, "single": 90, "pair": 50, "crowd": 40, "outside": 30, "outside_plus": 30}
    singles = {c.effects[0] for c in plan if c.kind == "single"}
    assert singles == {(name, strength) for name in CATALOGUE for strength in STRENGTHS}
    assert 0.28 < np.mean([c.arm == "contact" for c in plan]) < 0.38
    alone = {c.effects[0][0] for c in plan if c.kind == "single" and c.arm == "contact"}
    assert not alone & {"mean_slip", "distributed_roughness"}
    together = Counter(n for c in plan if c.kind in ("pair", "crowd") for n in c.effect_names)
    assert set(together) == set(CATALOGUE) and max(together.values()) <= min(together.values()) + 2
    assert {o[0] for c in plan if c.kind == "outside" for o in c.uncatalogued} == set(UNCATALOGUED)
    assert all(3 <= len(c.effects) <= 5 for c in plan if c.kind == "crowd")
    assert all(s != "weak" for c in plan if c.kind == "crowd" for _, s in c.effects)
    assert not any({"shaft_harmonics", "looseness"} <= set(c.effect_names) for c in plan)
    assert len({c.name for c in plan}) == 300 and plan == cases(300, 4) != cases(300, 5)


@pytest.mark.parametrize("n", [6, 7, 12, 20, 61, 500])
def test_smaller_plans_hold_every_kind(n: int) -> None:
    plan = cases(n)
    assert len(plan) == n and {c.kind for c in plan} == set(KINDS)


def test_too_small_a_plan() -> None:
    with pytest.raises(TwingapError, match="5 worlds, at least 6"):
        cases(5)


# --- base dynamics ---


def test_a_mode_rings_as_its_equation_says() -> None:
    fs, f0, zeta = 16_000.0, 2100.0, 0.04
    n, at = OVERSAMPLING * 800, 0.0103
    force = deposit(np.array([at]), np.ones(1), np.full(1, 1e-6), 0.0, n, OVERSAMPLING * fs, False)
    x = thin(through((Mode(f0, zeta, 1.0),), force, False, fs), False)
    t = np.arange(x.size) / fs - at
    w = 2 * np.pi * f0
    h = np.where(t > 0, np.exp(-zeta * w * np.abs(t)) * np.sin(w * np.sqrt(1 - zeta**2) * t), 0.0)
    np.testing.assert_allclose(x, h, atol=0.13)  # the pulse fills a cell of the fine grid
    assert np.corrcoef(x, h)[0, 1] > 0.995


@pytest.mark.parametrize("hertz", [False, True])
def test_noise_norm_is_that_of_noise(hertz: bool) -> None:
    modes = (Mode(1500.0, 0.03, 1.0), Mode(4000.0, 0.02, -0.4))
    noise = np.random.default_rng(0).standard_normal(OVERSAMPLING * 160_000)
    x = thin(through(modes, noise, hertz, 16_000.0), hertz)[2000:]
    assert np.std(x) == pytest.approx(noise_norm(modes, hertz, 16_000.0), rel=0.03)


@pytest.mark.parametrize("hertz", [False, True])
def test_pulses_keep_their_impulse_wherever_they_begin(hertz: bool) -> None:
    for begin in np.linspace(0.0100, 0.0101, 7):
        force = deposit(np.array([begin]), np.array([3.0]), np.full(1, 5e-5), 0.0, 4000, 64_000.0, hertz)
        assert force.sum() / 64_000 == pytest.approx(3.0, rel=1e-9)
        middle = (np.arange(4000) + 0.5) @ force / force.sum() / 64_000
        assert middle == pytest.approx(begin + 2.5e-5, abs=2e-6)


# --- mistakes ---


@pytest.mark.parametrize(
    ("case", "message"),
    [
        ({"kind": "odd"}, "unknown kind 'odd'"),
        ({"kind": "single", "effects": (("nothing", "weak"),)}, "unknown effect 'nothing'"),
        ({"kind": "single", "effects": (("dropout", "huge"),)}, "unknown strength 'huge'"),
        ({"kind": "pair", "effects": (("dropout", "weak"), ("dropout", "strong"))}, "names an effect twice"),
        ({"kind": "none", "n_records": 2}, "2 records"),
    ],
)
def test_cases_that_cannot_be(case: dict[str, object], message: str) -> None:
    with pytest.raises(TwingapError, match=message):
        Case(**case)  # type: ignore[arg-type]


def test_worlds_that_cannot_be() -> None:
    with pytest.raises(TwingapError, match="load_zone shows on faults only"):
        make_world(Case("single", effects=(("load_zone", "weak"),), faults=("healthy",)), 0)
    with pytest.raises(TwingapError, match="unknown bearing 'x'"):
        make_world(Case("none", bearing="x"), 0)
    with pytest.raises(TwingapError, match="seed = -1"):
        make_world(Case("none"), -1)
