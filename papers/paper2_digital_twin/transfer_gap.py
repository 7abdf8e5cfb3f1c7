"""Study of closing the gap for transfer: a network trained on paper 2's twin as printed, and with the named effects.

contact twin, printed values --------------+--> virtual machines: noise drawn --> images --> network, no label --> judge
effects named for each data set, as found --+                                                    real recordings --^

Used in: Paper 2, section 3.2.3, and this project's question what its twin lacks. `availability` teaches the network by
a twin that was written for it; here it is the paper's, whose gap to both data sets `twingap study public` diagnoses.
Run as part of the paper, or alone: python -m papers.paper2_digital_twin.transfer_gap --profile full --out DIR
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import twingap._compiled
import twingap.adapt.training
import twingap.bearing
import twingap.effects
import twingap.signal
import twingap.streams
import twingap.twins
from papers.paper2_digital_twin import availability_jobs as jobs_module
from papers.paper2_digital_twin import availability_records as records_module
from papers.paper2_digital_twin import availability_source as source_module
from papers.paper2_digital_twin import availability_split as split_module
from papers.paper2_digital_twin import availability_study, methods
from papers.paper2_digital_twin.availability_jobs import NetworkJob, network
from papers.paper2_digital_twin.availability_records import TITLES, Measured, load, measure
from papers.paper2_digital_twin.availability_source import BASELINE_PIECES
from papers.paper2_digital_twin.availability_split import SPLITS
from papers.paper2_digital_twin.methods.scalograms import ImageOptions, Modulation, images, modulation, pieces_of
from papers.paper3_zoa_dann.significance import sign_flip
from papers.studies import Count, Progress, command, keep_tables, profile_of
from twingap.adapt.selection import select
from twingap.bearing import Bearing
from twingap.config import build, read_toml
from twingap.data import NotAtHandError
from twingap.effects import Effect, make_effect
from twingap.provenance import digest_of_code, digest_of_value
from twingap.records import Condition
from twingap.sweep import Result, sweep
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import PRESETS

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]
Kind = Literal["as printed", "gap closed"]
CONFIG: Final = Path(__file__).with_name("transfer_gap.toml")
KINDS: Final[tuple[Kind, ...]] = ("as printed", "gap closed")
RIG: Final = "virtual_cwru"


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
    """The study; every entry is explained in transfer_gap.toml."""

    data: tuple[str, ...]
    level_db: tuple[float, float]
    structure: tuple[float, float]
    named: dict[str, dict[str, dict[str, Any]]]
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Population:
    """Virtual machines of paper 2's twin: a job.

    Parameters
    ----------
    data : str
    kind : {"as printed", "gap closed"}
    effects : tuple of Effect
        That the twin has besides.
    classes : tuple of str
    speeds_rpm : tuple of float
        Of the real recordings, which are known without labels.
    fs_hz : float
    bearing : Bearing
    machines : int
    pooled : tuple of int
        Numbers of pieces that are averaged to one image.
    level_db, structure : tuple of float
        See transfer_gap.toml.
    image : ImageOptions
    seed : int
    """

    data: str
    kind: Kind
    effects: tuple[Effect, ...]
    classes: tuple[str, ...]
    speeds_rpm: tuple[float, ...]
    fs_hz: float
    bearing: Bearing
    machines: int
    pooled: tuple[int, ...]
    level_db: tuple[float, float]
    structure: tuple[float, float]
    image: ImageOptions
    seed: int


@dataclass(frozen=True)
class Study:
    """What came out.

    Parameters
    ----------
    tables : dict[str, pandas.DataFrame]
        transfer-gap (by data set and kind), transfer-gap-seeds (a row per data set, kind and seed).
    title : str
        Where the records come from.
    computed : int
        Networks trained now.
    """

    tables: dict[str, pd.DataFrame]
    title: str
    computed: int


def simulate(population: Population) -> dict[str, Any]:
    """Images of a population, as `availability_source.simulate` gives them: a machine has a record of each class.

    Returns
    -------
    dict
        ``images`` float32 [images, 3, carriers, orders], ``labels`` [images], ``machine`` [images].
    """
    own, made, labels, machine = population, [], [], []
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
            for size in own.pooled:
                chosen = rng.permutation(len(each))[:size]
                part = Modulation(each.lines[chosen], each.power[chosen]).pooled()
                made.append(images(part, power, own.image)[0])
                labels.append(place)
                machine.append(number)
    return {"images": np.stack(made), "labels": np.array(labels), "machine": np.array(machine)}


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


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> Study:
    """Run the study; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/`` and ``results/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without records the virtual rig is taken, and every table says so.
    seed : int
        The first of the seeds.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables go there as well.
    progress : callable
    config : Path
    draw : bool
        There is no figure.
    """
    options = build(Options, read_toml(config), config)
    common = availability_study.read_study()
    size = profile_of(options.profiles, profile, config)
    data: dict[str, Measured] = {}
    digests: dict[str, str] = {}
    for name in options.data[:1] if size.smoke else options.data:
        try:
            records = load(name, root, size.rig_duration_s)
        except NotAtHandError:
            if root is not None:  # who names data wants those used
                raise
            continue
        data[name], digests[name] = measure(records, name, common.image), records.digest
    if not data:
        records = load(RIG, root, size.rig_duration_s)
        data[RIG], digests[RIG] = measure(records, RIG, common.image), records.digest
    code = digest_of_code(
        records_module, source_module, split_module, jobs_module, methods, twingap.bearing, twingap.effects,
        twingap.signal, twingap._compiled, twingap.streams, twingap.twins, select, twingap.adapt.training, simulate,
    )  # fmt: skip
    populations = {
        f"{name} {kind}": _population(options, common, own, kind, size.machines, seed)
        for name, own in data.items()
        for kind in KINDS
    }
    training = dataclasses.replace(common.training, steps=size.steps)
    nets = [
        NetworkJob(name, kind, fold, common.folds, one, (), common.criterion, training, common.head, common.image)
        for one in range(seed, seed + size.seeds)
        for name in data
        for kind in KINDS
        for fold in range(1 if size.smoke else common.folds)
    ]
    count = Count("what closing the gap teaches", len(populations) + len(nets), progress)
    swept = functools.partial(
        sweep, store=out / "results", backend=backend, address=address, version=code, on_result=count
    )
    made = {r.job: r.value for r in swept(simulate, list(populations.values()))}
    source = {
        f"{name} {kind} {fold}": made[populations[f"{name} {kind}"]]
        for name in data
        for kind in KINDS
        for fold in range(common.folds)
    }
    trained: list[Result[NetworkJob]] = swept(
        functools.partial(network, data=data, source=source), nets,
        data={**digests, "source": digest_of_value({k: digest_of_value(p) for k, p in populations.items()})},
    )  # fmt: skip
    title = ", ".join(TITLES[name] for name in data)
    rows = seeds(trained, data)
    tables = {"transfer-gap": means(rows), "transfer-gap-seeds": rows}
    keep_tables(tables, out, log, title)
    return Study(tables, title, sum(bool(r.why) for r in trained))


def _population(
    options: Options, common: availability_study.StudyOptions, data: Measured, kind: Kind, machines: int, seed: int
) -> Population:
    named = options.named.get(data.name, options.named["cwru"]) if kind == "gap closed" else {}
    effects = tuple(make_effect(name, values, f"[named.{data.name}]") for name, values in named.items())
    speeds = tuple(sorted({round(s, 1) for s in data.speeds_rpm.values()}))
    return Population(
        data.name, kind, effects, data.classes, speeds, data.fs_hz, data.bearing, machines, common.source.pooled,
        options.level_db, options.structure, common.image, seed,
    )  # fmt: skip


def seeds(trained: Sequence[Result[NetworkJob]], data: Mapping[str, Measured]) -> pd.DataFrame:
    """Recordings called right without a label, folds together: by data set, split, kind and seed."""
    keys = list(dict.fromkeys((r.job.data, split, r.job.kind, r.job.seed) for r in trained for split in SPLITS))
    rows = []
    for name, split, kind, seed in keys:
        own, here = data[name], [r.value for r in trained if (r.job.data, r.job.kind, r.job.seed) == (name, kind, seed)]
        called = {recording: c for v in here for recording, c in v[split]["rows"]["0"]["calls"].items()}
        right = {recording: own.labels[recording] == c for recording, c in called.items()}
        faults = [np.mean([right[r] for r in right if own.labels[r] == k]) for k in {own.labels[r] for r in right}]
        score = [max(v[split]["scores"]["source_accuracy"]) for v in here]
        rows.append({
            "data": TITLES[name], "split by": split, "twin": kind, "seed": seed, "recordings": len(right),
            "accuracy": np.mean(list(right.values())), "balanced accuracy": np.mean(faults),
            "on its own machines held out": np.mean(score),
        })  # fmt: skip
    return pd.DataFrame(rows)


def means(rows: pd.DataFrame) -> pd.DataFrame:
    """Mean and deviation over seeds; what closing adds, and exact p of sign flips of the pairs."""
    found = []
    for (data, split), part in rows.groupby(["data", "split by"], sort=False):
        wide = part.pivot(index="seed", columns="twin", values="accuracy")
        gain = (wide["gap closed"] - wide["as printed"]).to_numpy(float)
        for kind in KINDS:
            own = part[part["twin"] == kind]
            found.append({
                "data": data, "split by": split, "twin": kind, "seeds": len(own),
                "recordings": own["recordings"].max(), "accuracy": own["accuracy"].mean(),
                "std": own["accuracy"].std(ddof=1) if len(own) > 1 else np.nan,
                "balanced accuracy": own["balanced accuracy"].mean(),
                "on its own machines held out": own["on its own machines held out"].mean(),
                "gain": gain.mean() if kind == "gap closed" else np.nan,
                "p": sign_flip(gain) if kind == "gap closed" else np.nan,
            })  # fmt: skip
    return pd.DataFrame(found)


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "What closing the gap of paper 2's twin buys the network without labels.",
        lambda study: {f"transfer-gap ({study.title})": study.tables["transfer-gap"]}, arguments,
        takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper2_digital_twin.transfer_gap import main as run_main

    run_main()
