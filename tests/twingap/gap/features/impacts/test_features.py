"""Every effect on the impacts is measured for what it is, on several bearings, rates, speeds and defects."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import (
    CageModulation,
    Effect,
    EntryExit,
    ImpactScatter,
    LoadZone,
    MeanSlip,
    SlipJitter,
    SpeedFluctuation,
)
from twingap.gap.features.impacts.features import NAMES, measure
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

WORLDS = [
    # bearing, fault, fs_hz, rpm, amplitude, resonance / fs
    ("6205", "outer", 12000.0, 1800.0, 8.0, 0.20),
    ("6205", "inner", 20000.0, 1500.0, 7.0, 0.17),
    ("ZA-2115", "outer", 20000.0, 1200.0, 8.0, 0.15),
    ("ZA-2115", "inner", 32000.0, 1000.0, 10.0, 0.12),
    ("UER204", "ball", 25600.0, 1500.0, 8.0, 0.12),
    ("UER204", "outer", 32000.0, 2400.0, 12.0, 0.10),
]

World = tuple[str, str, float, float, float, float]


def records(
    world: World, *effects: Effect, count: int = 5, speed_error: float = 0.0, seed: int = 1
) -> list[RecordTransforms]:
    """One-second records whose metadata claim speeds (1 + speed_error) times the true ones."""
    name, fault, fs, rpm, amplitude, resonance = world
    bearing = BEARINGS[name]
    parameters = PhenomenologicalParameters(resonance * fs, 0.05, {fault: amplitude})
    twin = PhenomenologicalTwin(bearing, parameters, effects)
    rng = np.random.default_rng(seed)
    conditions = [Condition(f"r{i}", rpm * rng.uniform(0.95, 1.05), fs, int(fs), fault) for i in range(count)]
    frame = Frame(bearing, ((resonance - 0.08) * fs, (resonance + 0.08) * fs), 1.0)
    out = []
    for record in twin.simulate(conditions, rng):
        own = record.condition
        claimed = Condition(own.name, own.speed_rpm * (1 + speed_error), own.fs_hz, own.n_samples, own.fault)
        out.append(RecordTransforms(record.samples, claimed, frame))
    return out


def values(name: str, world: World, *effects: Effect, speed_error: float = 0.0) -> np.ndarray:
    return np.array([measure(transforms)[name] for transforms in records(world, *effects, speed_error=speed_error)])


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("speed_error", [-0.035, 0.03])
def test_rate_tells_slip_and_wrong_speed_to_a_thousandth(world: World, speed_error: float) -> None:
    slip = 0.02
    bearing, fault = BEARINGS[world[0]], world[1]
    truth = math.log(bearing.slipped(1 - slip)[fault] / bearing.fault_order(fault) / (1 + speed_error))
    found = values("rate_log_ratio", world, MeanSlip(slip), speed_error=speed_error)
    assert np.abs(found - truth).max() < 1e-3


@pytest.mark.parametrize("world", WORLDS)
def test_jitter_is_recovered_and_is_not_a_walk(world: World) -> None:
    for sigma in (0.02, 0.05):
        measured = [measure(transforms) for transforms in records(world, SlipJitter(sigma))]
        assert np.median([m["jitter_sigma"] for m in measured]) == pytest.approx(sigma, rel=0.3)
        assert np.median([m["walk_sigma"] for m in measured]) < 0.35 * sigma


@pytest.mark.parametrize("world", WORLDS)
def test_accumulating_jitter_is_a_walk(world: World) -> None:
    measured = [measure(transforms) for transforms in records(world, SlipJitter(0.02, accumulating=True))]
    assert np.median([m["walk_sigma"] for m in measured]) == pytest.approx(0.02, rel=0.3)
    assert np.median([m["jitter_sigma"] for m in measured]) < 0.01


@pytest.mark.parametrize("world", WORLDS)
def test_scatter_is_recovered_and_moves_no_timing(world: World) -> None:
    for sigma in (0.25, 0.5):
        measured = [measure(transforms) for transforms in records(world, ImpactScatter(sigma))]
        assert np.median([m["scatter_sigma"] for m in measured]) == pytest.approx(sigma, rel=0.2)
        assert np.median([m["jitter_sigma"] for m in measured]) < 0.01


@pytest.mark.parametrize("world", WORLDS)
def test_baseline_has_none_of_it(world: World) -> None:
    measured = [measure(transforms) for transforms in records(world)]

    def middle(name: str) -> float:
        return float(np.median([m[name] for m in measured]))

    assert abs(middle("rate_log_ratio")) < 1e-3
    assert middle("jitter_sigma") < 0.006
    assert middle("walk_sigma") < 0.002
    assert middle("scatter_sigma") < 0.07
    assert middle("shaft_depth") < 0.08
    assert middle("cage_depth") < 0.08
    assert middle("wander_level") < 0.001
    assert middle("second_impact_gain") < 0.5


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(("effect", "name"), [(CageModulation, "cage_depth"), (LoadZone, "zone_depth")])
def test_depth_of_modulation(world: World, effect: Callable[[float], Effect], name: str) -> None:
    if name == "zone_depth" and world[1] == "outer":
        assert np.isnan(values(name, world, effect(0.4))).all()
        return
    for depth in (0.4, 0.8):
        assert np.median(values(name, world, effect(depth))) == pytest.approx(depth, rel=0.2)


def test_load_zone_of_the_inner_race_shows_the_shaft_rate_and_not_the_cage() -> None:
    measured = [measure(transforms) for transforms in records(WORLDS[1], LoadZone(0.5), speed_error=0.02)]
    assert np.median([m["shaft_log_ratio"] for m in measured]) == pytest.approx(-math.log(1.02), abs=3e-3)
    assert np.median([m["cage_depth"] for m in measured]) < 0.1


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("level", [0.002, 0.008, 0.03])
def test_wander_is_followed(world: World, level: float) -> None:
    measured = [measure(transforms) for transforms in records(world, SpeedFluctuation(level))]
    assert np.median([m["wander_level"] for m in measured]) == pytest.approx(level, rel=0.3)
    assert np.median([m["jitter_sigma"] for m in measured]) < 0.008
    assert np.median([abs(m["rate_log_ratio"]) for m in measured]) < 3e-3


@pytest.mark.parametrize("bandwidth_hz", [2.0, 8.0])
def test_wander_has_its_bandwidth(bandwidth_hz: float) -> None:
    worlds = records(WORLDS[0], SpeedFluctuation(0.01, bandwidth_hz), count=12)
    found = [measure(transforms)["wander_bandwidth_hz"] for transforms in worlds]
    assert np.median(found) == pytest.approx(bandwidth_hz, rel=0.4)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("arc_deg", [3.0, 8.0])
def test_arc_of_the_defect(world: World, arc_deg: float) -> None:
    bearing, fault, fs, rpm = BEARINGS[world[0]], world[1], world[2], world[3]
    body = {"outer": bearing.ftf, "inner": 1 - bearing.ftf, "ball": bearing.bsf}[fault]
    delay = arc_deg / 360 / body / (rpm / 60) * fs
    measured = [measure(transforms) for transforms in records(world, EntryExit(arc_deg), count=8)]
    assert np.nanmedian([m["arc_deg"] for m in measured]) == pytest.approx(arc_deg, rel=0.1)
    assert np.median([m["second_impact_gain"] for m in measured]) > 0.7
    # Within half a period of the resonance the two impacts all but cancel where they would be seen best.
    if delay * world[5] > 0.6:
        assert np.nanmedian([m["exit_ratio"] for m in measured]) == pytest.approx(1.0, rel=0.2)


@pytest.mark.parametrize("part", [0.2, 0.4])
def test_the_mean_cycle_rises_again_where_a_second_impact_comes(part: float) -> None:
    world = WORLDS[5]
    bearing, fault = BEARINGS[world[0]], world[1]
    body = {"outer": bearing.ftf, "inner": 1 - bearing.ftf, "ball": bearing.bsf}[fault]
    arc_deg = part / bearing.fault_order(fault) * 360 * body
    one = np.nanmedian(values("cycle_rise", world))
    two = [np.nanmedian(values(name, world, EntryExit(arc_deg, 0.9))) for name in ("cycle_rise", "cycle_rise_part")]
    assert two[0] > 4 * max(one, 0.01)
    assert two[1] == pytest.approx(part, abs=0.03)


def test_a_weak_second_impact_is_known_to_be_weak() -> None:
    found = values("exit_ratio", WORLDS[5], EntryExit(3.0, 0.5))
    assert np.median(found) == pytest.approx(0.5, rel=0.2)


def test_level_is_logarithmic_in_the_amplitude() -> None:
    name, fault, fs, rpm, amplitude, resonance = WORLDS[2]
    twice = (name, fault, fs, rpm, 2 * amplitude, resonance)
    gain = np.mean(values("level", twice)) - np.mean(values("level", WORLDS[2]))
    assert gain == pytest.approx(math.log(2), abs=0.1)


def test_noise_without_impacts_is_not_followed() -> None:
    rng = np.random.default_rng(5)
    frame = Frame(BEARINGS["6205"], (2000.0, 5000.0), 1.0)
    condition = Condition("noise", 1800.0, 20000.0, 20000, "outer")
    measured = [measure(RecordTransforms(rng.standard_normal(20000), condition, frame)) for _ in range(20)]
    assert sum(np.isfinite(m["rate_log_ratio"]) for m in measured) <= 1
    assert all(np.isfinite(m["evidence"]) for m in measured)


@pytest.mark.parametrize("fault", ["outer", "ball", "cage", "healthy", None])
def test_any_samples_can_be_measured(fault: str | None) -> None:
    rng = np.random.default_rng(6)
    impulse = np.zeros(20000)
    impulse[10000] = 1.0
    odd = [
        np.zeros(20000),
        np.full(20000, np.nan),
        rng.standard_normal(300),
        np.sign(rng.standard_normal(20000)),
        impulse,
        np.tile(np.r_[1.0, np.zeros(199)], 100),
        1e200 * rng.standard_normal(20000),
    ]
    for samples in odd:
        for band in ((2000.0, 5000.0), (9900.0, 10000.0)):
            for rpm in (30.0, 1800.0, 60000.0):
                condition = Condition("odd", rpm, 20000.0, samples.size, fault)
                out = measure(RecordTransforms(samples, condition, Frame(BEARINGS["6205"], band, 1.0)))
                assert tuple(out) == NAMES
                assert not np.isinf(list(out.values())).any()
                if fault in ("healthy", None):
                    assert np.isnan(list(out.values())).all()
