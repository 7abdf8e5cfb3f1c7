"""Study of closing the gap for transfer: a network trained on paper 2's twin as printed, and with the named effects.

contact twin, printed values --------------+--> virtual machines: noise drawn --> images --> network, no label --> judge
effects named for each data set, as found --+                                                    real recordings --^

Used in: Paper 2, section 3.2.3, and this project's question what its twin lacks. `availability` teaches the network by
a twin that was written for it; here it is the paper's, whose gap to both data sets `twingap study public` diagnoses.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from papers.framework import Inputs, Work
from papers.paper2_digital_twin.availability.jobs import NetworkJob, read_options
from papers.paper2_digital_twin.availability.jobs import Options as Common
from papers.paper2_digital_twin.availability.records import Measured
from papers.paper2_digital_twin.availability.source import BASELINE_PIECES, Image, pooled_images
from papers.paper2_digital_twin.methods.scalograms import ImageOptions, modulation, pieces_of
from twingap import Bearing, Condition
from twingap.effects import Effect, make_effect
from twingap.provenance import digest_of_value
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import PRESETS

Kind = Literal["as printed", "gap closed"]
KINDS: Final[tuple[Kind, ...]] = ("as printed", "gap closed")


@dataclass(frozen=True)
class Size:
    """How much is run: seeds (folds of recordings and trainings), virtual machines of a source, steps of a training."""

    seeds: int
    machines: int
    steps: int
    rig_duration_s: float
    smoke: bool


@dataclass(frozen=True)
class Options:
    data: tuple[str, ...]
    level_db: tuple[float, float]
    structure: tuple[float, float]
    named: dict[str, dict[str, dict[str, Any]]]
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Population:
    """Virtual machines of paper 2's twin: a job."""

    data: str
    kind: Kind  # one of "as printed", "gap closed"
    effects: tuple[Effect, ...]  # that the twin has besides
    classes: tuple[str, ...]
    speeds_rpm: tuple[float, ...]  # of the real recordings, which are known without labels
    fs_hz: float
    bearing: Bearing
    machines: int
    pooled: tuple[int, ...]  # numbers of pieces that are averaged to one image
    level_db: tuple[float, float]  # level_db, structure: see config.toml
    structure: tuple[float, float]
    image: ImageOptions
    seed: int


def simulate(population: Population) -> dict[str, Any]:
    """Images of a population, as `availability.source.simulate` gives them: a machine has a record of each class."""
    own = population
    made: list[Image] = []
    about: list[tuple[int, int]] = []
    for number in range(own.machines):
        rng = np.random.default_rng([own.seed, number])
        speed = float(rng.choice(own.speeds_rpm))
        twin = machine_of(own, speed, rng)
        length = own.image.piece_samples(own.fs_hz, speed)
        asked = [("before", "healthy", BASELINE_PIECES), *((fault, fault, own.pooled[-1]) for fault in own.classes)]
        conditions = [Condition(name, speed, own.fs_hz, count * length, fault) for name, fault, count in asked]
        records = twin.simulate(conditions, rng)
        found = [modulation(pieces_of(r.samples, length), own.fs_hz, speed, own.image) for r in records]
        power = found[0].power.mean(axis=0)
        for place, each in enumerate(found[1:]):
            made += pooled_images(each, own.pooled, power, own.image, rng)
            about += [(place, number)] * len(own.pooled)
    labels, machine = np.array(about).T
    return {"images": np.stack(made), "labels": labels, "machine": machine}


def machine_of(population: Population, speed_rpm: float, rng: np.random.Generator) -> ContactTwin:
    """One machine: the printed twin in noise whose level nobody can know, the same for all its records."""
    level, structure = (float(rng.uniform(low, high)) for low, high in (population.level_db, population.structure))
    noise = _struck_rms(population.bearing, speed_rpm, population.fs_hz) / 10 ** (level / 20)
    parameters = dataclasses.replace(
        PRESETS["paper"], structure_noise_rms=structure * noise, white_noise_rms=math.sqrt(1 - structure**2) * noise
    )
    return ContactTwin(population.bearing, parameters, population.effects)


@functools.lru_cache(maxsize=64)
def _struck_rms(bearing: Bearing, speed_rpm: float, fs_hz: float) -> float:
    """RMS of the printed twin's vibration with a defect of the inner race, without any noise, m/s^2."""
    quiet = dataclasses.replace(PRESETS["paper"], structure_noise_rms=0.0, white_noise_rms=0.0)
    condition = Condition("reference", speed_rpm, fs_hz, round(fs_hz), "inner")
    (record,) = ContactTwin(bearing, quiet).simulate([condition], np.random.default_rng(0))
    return float(record.samples.std())


def _population(options: Options, common: Common, data: Measured, kind: Kind, machines: int, seed: int) -> Population:
    named = options.named.get(data.name, options.named["cwru"]) if kind == "gap closed" else {}
    effects = tuple(make_effect(name, values, f"[named.{data.name}]") for name, values in named.items())
    speeds = tuple(sorted({round(s, 1) for s in data.speeds_rpm.values()}))
    return Population(
        data.name, kind, effects, data.classes, speeds, data.fs_hz, data.bearing, machines, common.source.pooled,
        options.level_db, options.structure, common.image, seed,
    )  # fmt: skip


def populations(work: Work) -> list[Population]:
    """Of each set, the printed twin and the closed one."""
    common = read_options()
    every = itertools.product(work["data"].values(), KINDS)
    return [_population(work.options, common, own, kind, work.size.machines, work.seed) for own, kind in every]


def networks(work: Work) -> Iterator[NetworkJob]:
    common, size = read_options(), work.size
    training = dataclasses.replace(common.training, steps=size.steps)
    seeds, folds = range(work.seed, work.seed + size.seeds), range(1 if size.smoke else common.folds)
    for seed, name, kind, fold in itertools.product(seeds, work["data"], KINDS, folds):
        yield NetworkJob(
            name, kind, fold, common.folds, seed, (), common.criterion, training, common.head, common.image
        )


def inputs(work: Work) -> Inputs:
    """Real sets, and what the twins made: the same for every fold."""
    made = {f"{r.job.data} {r.job.kind} {fold}": r for r in work["populations"] for fold in range(read_options().folds)}
    records = {name: own.digest for name, own in work["records"].items()}
    return {
        "data": (work["data"], digest_of_value(records)),
        "source": ({name: r.value for name, r in made.items()}, digest_of_value({n: r.key for n, r in made.items()})),
    }
