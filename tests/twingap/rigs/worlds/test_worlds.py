"""Worlds: reproducible, neutral in what they tell, within their stated ranges; plans balanced; seals tight."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from twingap.bearing import FAULTS
from twingap.errors import TwingapError
from twingap.records import Record
from twingap.rigs.worlds import (
    CATALOGUE,
    KINDS,
    ON_FAULTS,
    RICH,
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
from twingap.rigs.worlds.base import OVERSAMPLING, Mode, noise_norm, path_modes, thin, through, unit_response
from twingap.rigs.worlds.motion import deposit
from twingap.rigs.worlds.rich import zeros_outside

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


# --- rich machines ---


def rich(kind: str, arm: str = "twin", effects: tuple[str, ...] = RICH, modelled: tuple[str, ...] = ()) -> World:
    return make_world(replace(small(kind, arm, effects), modelled=modelled, duration_s=1.0), 3)


@pytest.fixture(scope="module")
def both() -> World:
    return rich("rich")


def minimum_phase(h: np.ndarray, n: int = 2**15) -> np.ndarray:
    """Response of minimum phase with the same gain, by the cepstrum."""
    gain = np.abs(np.fft.fft(h, n))
    cepstrum = np.fft.ifft(np.log(gain + 1e-6 * gain.max())).real
    cepstrum[1 : n // 2] *= 2
    cepstrum[n // 2 + 1 :] = 0
    return np.asarray(np.fft.ifft(np.exp(np.fft.fft(cepstrum))).real)


def test_zeros_outside_are_counted() -> None:
    """Two modes of equal sign have their zero between them; of opposite sign, beyond; a late one makes many."""
    near, far = Mode(1500.0, 0.02, 1.0), Mode(1800.0, 0.02, 0.9)
    assert zeros_outside((near,), False, 16_000.0) == zeros_outside((near, far), False, 16_000.0) == 0
    assert zeros_outside((near, replace(far, gain=-0.95)), False, 16_000.0) == 1
    p = {"frequencies_hz": [1800.0], "damping_ratios": [0.02], "gains": [3.0], "delays_s": [4e-4]}
    assert zeros_outside((near, *path_modes(p)), False, 16_000.0) > 5


def test_a_rich_path_is_not_of_minimum_phase(both: World) -> None:
    base, p = both.base, both.truth.parameters["transfer_path"]
    full = replace(base, pulse_s=1e-7).with_modes(*path_modes(p))
    assert len(full.modes) >= 8 and p["zeros_outside"] >= 4
    likeness = []
    for one in (replace(base, pulse_s=1e-7), full):
        h = unit_response(one)
        least = minimum_phase(h)
        same = np.fft.ifft(np.fft.fft(h, least.size) * np.conj(np.fft.fft(least))).real
        likeness.append(np.abs(same).max() / np.sum(h**2))
    assert likeness[0] > 0.98 and likeness[1] < 0.93


def heights(record: Record, places_hz: list[float]) -> np.ndarray:
    """Power of the lines at these places over the median around them."""
    power = np.abs(np.fft.rfft(record.samples * np.hanning(record.samples.size))) ** 2
    bins = [round(hz * record.condition.duration_s) for hz in places_hz]
    return np.array([power[k - 1 : k + 2].max() / np.median(power[k - 25 : k + 26]) for k in bins])


def test_rich_records_hold_fifty_lines_beside_an_empty_carrier(both: World) -> None:
    p = both.truth.parameters["line_spectrum"]
    empty, pair = [], []
    for record, rpm in zip(both.records, both.layout.speed_rpm, strict=True):
        beside = [c + o * rpm / 60 for c, o in zip(p["carriers_hz"], p["carrier_orders"], strict=True)]
        places = [*beside, *(o * rpm / 60 for o in p["orders"]), *p["frequencies_hz"]]
        assert len({round(hz) for hz, height in zip(places, heights(record, places), strict=True) if height > 8}) >= 50
        empty += list(heights(record, p["carriers_hz"][:1]))
        pair += list(heights(record, beside[2:4]))
    assert np.median(empty) < 8 and min(pair) > 20


def test_a_rich_simulator_has_path_and_lines_too() -> None:
    world = rich("rich_none", "contact", (), RICH)
    assert world.truth.effects == () and set(world.truth.base["own"]) >= set(RICH)
    assert world.sim is not None and world.twin["twin"]["effects"] == []
    own = world.base.own["line_spectrum"]
    for record, rpm in zip(world.sim, world.layout.stated_rpm, strict=True):
        pair = [own["carriers_hz"][0] + order * rpm / 60 for order in (-2, 2)]
        assert heights(record, pair).min() > 20
    with pytest.raises(TwingapError, match="no values for a path"):
        Case("rich_none", modelled=RICH)


def test_rich_worlds_leave_the_others_as_they_are() -> None:
    plan = cases(30, 4, 15)
    assert plan[:30] == cases(30, 4) and len({c.name for c in plan}) == 45
    more = cases(6, 4, 150)[6:]
    assert Counter(c.kind for c in more) == {"path": 40, "lines": 40, "rich": 50, "rich_none": 20}
    assert all(set(RICH) <= {*c.effect_names, *c.modelled} for c in more if c.kind.startswith("rich"))
    assert all(len(c.effects) == (c.kind != "rich_none") for c in more if c.kind != "rich")
    assert not any({"second_resonance", "gear_mesh", "mains_interference"} & set(c.effect_names) for c in more)


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
