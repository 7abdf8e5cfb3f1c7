"""Records of every fault from the digital twin: many virtual machines about which only speed and bearing are known.

healthy background: measured ("grafted") or of the twin with named effects ("effects") --+--> healthy level of carriers
strikes of a defect through six drawn modes ---------------------------------------------+
stationary roughness through the same modes ---------------------------------------------+--> pieces --> images
faint strikes of a sound race -----------------------------------------------------------+      labelled by the defect

Used in: Paper 2, section 3.2.3, the network trained on twin data where no fault record exists. Records of good order do
exist there (paper 2 trains its map on them), so that the twin may stand on them. The twin is the phenomenological one
with named effects rather than the paper's contact model: the effects are what real machines have and the contact
model lacks (kind "bare", one mode, periodic strikes, white noise, shows what they are worth).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.paper2_digital_twin.methods.scalograms import ImageOptions, Modulation, images, modulation, pieces_of
from twingap import Bearing, Condition
from twingap.effects import Effect, make_effect
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Image = NDArray[np.float32]
Rng = np.random.Generator
Kind = Literal["grafted", "effects", "bare"]
BASELINE_PIECES: Final = 3
TWINS: Final = 3
"""Twins of two modes each whose responses to the same strikes are summed: real structures have several modes."""


@dataclass(frozen=True)
class SourceOptions:
    """Where virtual machines are drawn from; ranges are explained in config.toml."""

    pooled: tuple[int, ...]
    speed_spread: float
    resonance: tuple[float, ...]
    damping: tuple[float, ...]
    gain_db: tuple[float, ...]
    level_db: tuple[float, ...]
    ball_level_db: tuple[float, ...]
    rough_db: tuple[float, ...]
    ball_rough_db: tuple[float, ...]
    companion_db: tuple[float, ...]
    ball_companion_db: tuple[float, ...]
    tone_level: tuple[float, ...]
    remount_db: float
    scatter: tuple[float, ...]
    ball_scatter: tuple[float, ...]
    jitter: tuple[float, ...]
    ball_jitter: tuple[float, ...]
    rough_swing: tuple[float, ...]
    turning_loads: float
    load_extent: tuple[float, ...]
    cage_depth: tuple[float, ...]
    slip: tuple[float, ...]
    orderly_balls: float


@dataclass(frozen=True)
class Plant:
    """A population of virtual machines to be simulated: a job."""

    kind: Kind  # one of "grafted", "effects", "bare"
    data: str  # data set whose machine is imitated
    # healthy recordings that the population may stand on ("grafted" alone looks at their samples)
    backgrounds: tuple[str, ...]
    classes: tuple[str, ...]
    speeds_rpm: tuple[float, ...]  # of the real recordings, which are known without labels
    fs_hz: float
    bearing: Bearing
    machines: int
    options: SourceOptions
    image: ImageOptions
    seed: int


@dataclass(frozen=True)
class Background:
    samples: Array  # [samples]
    speed_rpm: float


@dataclass(frozen=True)
class _Machine:
    """What stays with a machine whatever bearing is mounted."""

    speed_rpm: float
    modes: tuple[tuple[float, float, float], ...]
    background: dict[str, dict[str, Any]]
    structure: float


def simulate(plant: Plant, healthy: dict[str, Background]) -> dict[str, Any]:
    """Images of a population, a record of each class for each machine, on healthy recordings by name: ``images``
    float32 [images, 3, carriers, orders], ``labels`` and ``machine`` [images]."""
    made: list[Image] = []
    about: list[tuple[int, int]] = []
    for number in range(plant.machines):
        rng = np.random.default_rng([plant.seed, number])
        own = _machine(plant, rng)
        under = None
        if plant.kind == "grafted":
            under = healthy[str(rng.choice(plant.backgrounds))]
            own = replace(own, speed_rpm=under.speed_rpm)
        power = _measured(plant, own, _background(plant, own, under, BASELINE_PIECES, rng)).power.mean(axis=0)
        for place, fault in enumerate(plant.classes):
            found = _record(plant, own, under, fault, rng)
            made += pooled_images(found, plant.options.pooled, power, plant.image, rng)
            about += [(place, number)] * len(plant.options.pooled)
    labels, machine = np.array(about).T
    return {"images": np.stack(made), "labels": labels, "machine": machine}


def pooled_images(
    found: Modulation, sizes: tuple[int, ...], power: Array, image: ImageOptions, rng: Rng
) -> Iterator[Image]:
    """An image of so many pieces of a record, drawn by lot, for each number of them."""
    for size in sizes:
        chosen = rng.permutation(len(found))[:size]
        part = Modulation(found.lines[chosen], found.power[chosen]).pooled()
        yield images(part, power, image)[0]


def _machine(plant: Plant, rng: Rng) -> _Machine:
    own, fs_hz = plant.options, plant.fs_hz
    modes = tuple(
        (_log(own.resonance, rng) * fs_hz, _log(own.damping, rng), 10 ** (_uniform(own.gain_db, rng) / 20))
        for _ in range(2 * TWINS)
    )
    background: dict[str, dict[str, Any]] = {
        "shaft_harmonics": {f"level_{n}x": _log(own.tone_level, rng) for n in (1, 2, 3)},
        "mains_interference": {"level": _log(own.tone_level, rng), "mains_hz": float(rng.choice([50.0, 60.0]))},
        "drive_interference": {"level": _log(own.tone_level, rng), "carrier_hz": _log(own.resonance, rng) * fs_hz},
        "coloured_noise": {"level": _log(own.tone_level, rng), "low_hz": 20.0, "high_hz": 0.45 * fs_hz},
        "sensor_rolloff": {"corner_hz": float(rng.uniform(0.25, 0.9)) * fs_hz, "order": int(rng.integers(1, 4))},
    }
    return _Machine(float(rng.choice(plant.speeds_rpm)), modes, background, float(rng.uniform(0.2, 0.95)))


def _background(plant: Plant, own: _Machine, under: Background | None, pieces: int, rng: Rng) -> Array:
    """Vibration of the machine in good order: a stretch of a healthy recording, or the twin's."""
    length = pieces * plant.image.piece_samples(plant.fs_hz, own.speed_rpm)
    if under is not None:
        start = int(rng.integers(under.samples.size - length + 1))
        return under.samples[start : start + length]
    effects: tuple[Effect, ...] = ()
    if plant.kind == "effects":
        second = dict(zip(("frequency_hz", "damping_ratio", "gain"), own.modes[1], strict=True))
        effects = tuple(make_effect(n, v) for n, v in {"second_resonance": second, **own.background}.items())
    white = math.sqrt(1 - own.structure**2)
    parameters = PhenomenologicalParameters(own.modes[0][0], own.modes[0][1], {}, own.structure, white)
    return _simulated(plant, own.speed_rpm, parameters, effects, "healthy", length, int(rng.integers(2**31)))


def _record(plant: Plant, own: _Machine, under: Background | None, fault: str, rng: Rng) -> Modulation:
    """One record of a class, measured."""
    options, rich = plant.options, plant.kind != "bare"
    speed = own.speed_rpm * (1 + (options.speed_spread * rng.uniform(-1, 1) if under is None else 0.0))
    own = replace(own, speed_rpm=speed)
    base = _background(plant, own, under, options.pooled[-1], rng)
    x = base * 10 ** (options.remount_db * rng.standard_normal() / 20 if rich else 0.0)
    rms = float(base.std())
    defect = 0.0
    if fault != "healthy":
        struck = rms * 10 ** (_uniform(options.ball_level_db if fault == "ball" else options.level_db, rng) / 20)
        rough = rms * 10 ** (_uniform(options.ball_rough_db if fault == "ball" else options.rough_db, rng) / 20)
        x = x + struck * _unit(_strikes(plant, own, fault, x.size, rng))
        if rich:
            x = x + rough * _unit(_roughness(plant, own, x.size, rng))
        defect = math.hypot(struck, rough)
    if rich:
        level = rms * 10 ** (_uniform(options.companion_db, rng) / 20)
        if fault == "ball":
            level = max(level, defect * 10 ** (_uniform(options.ball_companion_db, rng) / 20))
        race = str(rng.choice([f for f in ("inner", "outer") if f != fault]))
        x = x + level * _unit(_strikes(plant, own, race, x.size, rng))
    return _measured(plant, own, x)


def _strikes(plant: Plant, own: _Machine, fault: str, length: int, rng: Rng) -> Array:
    """Strikes of a defect alone, through all modes: twins of two modes each with the same random numbers."""
    options, seed = plant.options, int(rng.integers(2**31))
    if plant.kind == "bare":
        silent = PhenomenologicalParameters(own.modes[0][0], own.modes[0][1], {fault: 1.0}, 1e-9, 0.0)
        return _simulated(plant, own.speed_rpm, silent, (), fault, length, seed)
    orderly = fault != "ball" or rng.random() < options.orderly_balls
    chosen: dict[str, dict[str, Any]] = {
        "mean_slip": {"slip": _uniform(options.slip, rng)},
        "slip_jitter": {"sigma": _log(options.jitter if orderly else options.ball_jitter, rng)},
        "impact_scatter": {"sigma": _log(options.scatter if orderly else options.ball_scatter, rng)},
        "cage_modulation": {"depth": _uniform(options.cage_depth, rng)},
    }
    if rng.random() < 0.5:
        chosen["entry_exit"] = {"arc_deg": _log((0.5, 8.0), rng), "exit_ratio": _log((0.3, 3.0), rng)}
    total = np.zeros(length)
    for first, second in zip(own.modes[::2], own.modes[1::2], strict=True):
        beside = {"frequency_hz": second[0], "damping_ratio": second[1], "gain": second[2] / first[2]}
        effects = tuple(make_effect(n, v) for n, v in {**chosen, "second_resonance": beside}.items())
        silent = PhenomenologicalParameters(first[0], first[1], {fault: first[2]}, 1e-9, 0.0)
        total += _simulated(plant, own.speed_rpm, silent, effects, fault, length, seed)
    return total * _loaded(plant, own, fault, length, rng)


def _loaded(plant: Plant, own: _Machine, fault: str, length: int, rng: Rng) -> Array:
    """Load on a defect over the record.

    A load that stands still (weight, belt) is met once a turn by a defect of the inner race, once a turn of the cage by
    one of a ball, and always or never by one of the outer race; a load that turns with the shaft (unbalance) is met
    once a turn by one of the outer race, and always by one of the inner. Stribeck's distribution
    (1 - (1 - cos angle) / (2 extent))^1.5, 0 outside the zone; clearance narrows the zone (extent below 1/2), and then
    the envelope has many harmonics of that turn.
    """
    turning = rng.random() < plant.options.turning_loads
    extent = _uniform(plant.options.load_extent, rng)
    speed = {"inner": 1.0, "outer": 0.0, "ball": plant.bearing.ftf}[fault] - (1.0 if turning else 0.0)
    angle = 2 * math.pi * (speed * np.arange(length) / plant.fs_hz * own.speed_rpm / 60 + rng.random())
    if speed == 0:
        return np.ones(length)
    return np.asarray(np.maximum(1 - (1 - np.cos(angle)) / (2 * extent), 0.0) ** 1.5)


def _roughness(plant: Plant, own: _Machine, length: int, rng: Rng) -> Array:
    """Noise through the same modes, louder once a turn: rolling on what the defect has roughened."""
    total = np.zeros(length)
    for frequency_hz, damping, gain in own.modes:
        noise = PhenomenologicalParameters(frequency_hz, damping, {}, gain, 0.0)
        total += _simulated(plant, own.speed_rpm, noise, (), "healthy", length, int(rng.integers(2**31)))
    depth, phase = _uniform(plant.options.rough_swing, rng), float(rng.random())
    turns = np.arange(length) / plant.fs_hz * own.speed_rpm / 60
    return np.asarray(total * (1 + depth * np.cos(2 * math.pi * (turns + phase))))


def _simulated(
    plant: Plant, speed_rpm: float, parameters: PhenomenologicalParameters, effects: tuple[Effect, ...], fault: str,
    length: int, seed: int,
) -> Array:  # fmt: skip
    twin = PhenomenologicalTwin(plant.bearing, parameters, effects)
    condition = Condition(fault, speed_rpm, plant.fs_hz, length, fault)
    return twin.simulate([condition], np.random.default_rng(seed))[0].samples


def _measured(plant: Plant, own: _Machine, x: Array) -> Modulation:
    length = plant.image.piece_samples(plant.fs_hz, own.speed_rpm)
    return modulation(pieces_of(x, length), plant.fs_hz, own.speed_rpm, plant.image)


def _unit(x: Array) -> Array:
    rms = float(x.std())
    return x / rms if rms > 0 else x


def _uniform(bounds: tuple[float, ...], rng: Rng) -> float:
    return float(rng.uniform(bounds[0], bounds[1]))


def _log(bounds: tuple[float, ...], rng: Rng) -> float:
    return float(np.exp(rng.uniform(math.log(bounds[0]), math.log(bounds[1]))))


def healthy_recordings(plant: Plant, seed: int, count: int, seconds: float) -> list[Array]:
    """Recordings of one simulated healthy machine at one of the plant's speeds, on which false alarms are counted;
    their levels differ by a quarter of `remount_db` (standard deviation), as nothing is mounted anew between them."""
    rng = np.random.default_rng([plant.seed, seed, 17])
    own = _machine(plant, rng)
    turns = seconds * own.speed_rpm / 60
    pieces = max(1, round(turns / plant.image.turns))
    made = []
    for _ in range(count):
        x = _background(plant, own, None, pieces, rng)
        made.append(x * 10 ** (0.25 * plant.options.remount_db * rng.standard_normal() / 20))
    return made
