"""Diagnosis by how much fault data there is: SOM-MQE, SVM and a network from the twin, on real recordings.

CWRU, HIT-SM --> pieces --+--> healthy map: alarm, severity
                          +--> n labelled records of each fault --> SVM | maps by class | network, corrected by a head
   twin on healthy records --> images --> network, no label -------------------------------------------^
                                                   accuracy by recording and by bearing --> crossing points

Used in: Paper 2, section 3, which names the three regimes and prints no number. Run as part of the
paper, or alone: python -m papers.paper2_digital_twin.availability --profile full --out DIR
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

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
from papers.paper2_digital_twin import methods
from papers.paper2_digital_twin.availability_jobs import (
    AlarmJob,
    CheckJob,
    NetworkJob,
    ShallowJob,
    alarm,
    check,
    network,
    shallow,
)
from papers.paper2_digital_twin.availability_records import Measured, load, measure
from papers.paper2_digital_twin.availability_source import Background, Kind, Plant, simulate
from papers.paper2_digital_twin.availability_split import ALL, SPLITS, judged
from papers.paper2_digital_twin.availability_study import CONFIG, Study, StudyOptions, StudyProfile, read_study
from papers.paper2_digital_twin.methods.scalograms import ImageOptions
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.adapt.selection import select
from twingap.data import NotAtHandError
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_value
from twingap.records import RecordSet
from twingap.sweep import Result, sweep

if TYPE_CHECKING:
    from twingap.track import Run

RIG: Final = "virtual_cwru"
SHORTEST: Final = 4
"""A recording at hand in stretches shorter than so many pieces is no background for the twin."""


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
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without records the virtual rig is taken, and every table says so.
    seed : int
        The first of the seeds.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figures go there as well.
    progress : callable
    config : Path
    draw : bool
        Make the figures.
    """
    options = read_study(config)
    sizes = profile_of(options.profiles, profile, config)
    training = dataclasses.replace(options.training, steps=sizes.steps)
    records = _record_sets(options, root, sizes)
    data = {name: measure(found, name, options.image) for name, found in records.items()}
    digests = {name: found.digest for name, found in records.items()}
    healthy = {name: _backgrounds(found, data[name], options.image) for name, found in records.items()}
    # A function stands for its module: the rest of `twingap.adapt` may change without a new run.
    code = digest_of_code(
        records_module, source_module, split_module, jobs_module, methods, twingap.bearing, twingap.effects,
        twingap.signal, twingap._compiled, twingap.streams, twingap.twins, select, twingap.adapt.training,
    )  # fmt: skip
    folds = range(1 if sizes.smoke else options.folds)
    seeds = range(seed, seed + sizes.seeds)
    counts = (*options.counts, ALL)
    kinds: dict[Kind, int] = {"grafted": sizes.seeds, **dict.fromkeys(options.ablation, sizes.ablation_seeds)}
    plants = {
        f"{name} {kind} {fold}": _plant(options, own, kind, fold, sizes.machines, tuple(healthy[name]), seed)
        for name, own in data.items()
        for kind, wanted in kinds.items()
        for fold in folds
        if wanted
    }
    # Seed by seed, so that what an interrupted run has finished is whole for the seeds that it has.
    nets = [
        NetworkJob(
            name, kind, fold, options.folds, s, counts if kind == "grafted" else (), options.criterion, training,
            options.head, options.image,
        )
        for kind, wanted in kinds.items()
        for s in seeds[:wanted]
        for name in data
        for fold in folds
    ]  # fmt: skip
    shallows = [
        ShallowJob(name, fold, options.folds, s, counts, options.map) for name in data for s in seeds for fold in folds
    ]
    alarms = [
        AlarmJob(name, without, s, options.false_alarm, options.map)
        for name, own in data.items()
        for without in ("", *own.healthy())
        for s in seeds
    ]
    first = next(iter(data))
    checking = _plant(options, data[first], "effects", 0, 1, (), seed)
    checks = [CheckJob(checking, 15, 4.0, s, options.false_alarm, options.map) for s in range(sizes.check_machines)]
    unique = list(dict.fromkeys(plants.values()))
    total = len(unique) + len(nets) + len(shallows) + len(alarms) + len(checks)
    step = Count("availability", total, progress)
    swept = functools.partial(
        sweep, store=out / "results", backend=backend, address=address, version=code, on_result=step
    )
    swept_data = functools.partial(swept, data=digests)
    few: list[Result[ShallowJob]] = swept_data(functools.partial(shallow, data=data), shallows)
    rung: list[Result[AlarmJob]] = swept_data(functools.partial(alarm, data=data), alarms)
    checked: list[Result[CheckJob]] = swept(check, checks)
    made: dict[str, Any] = {}
    for name in data:  # one data set's healthy recordings travel to a worker at a time
        here = [p for p in unique if p.data == name]
        found: list[Result[Plant]] = swept(
            functools.partial(simulate, healthy=healthy[name]), here, data={"records": digests[name]}
        )
        by_plant = {r.job: r.value for r in found}
        made |= {key: by_plant[p] for key, p in plants.items() if p.data == name}
    networks: list[Result[NetworkJob]] = swept(
        functools.partial(network, data=data, source=made), nets,
        data={**digests, "source": digest_of_value({k: digest_of_value(p) for k, p in plants.items()})},
    )  # fmt: skip
    from papers.paper2_digital_twin import tables_availability as tables

    study = Study(options, data, networks, few, rung, checked, {})
    study.tables.update(tables.all_tables(study))
    keep_tables(study.tables, out, log, study.title, tables.write)
    if draw:
        from papers.paper2_digital_twin import figures_availability as figures

        keep_figures(figures.all_figures(study), out, log, figures.SIZES)
    return study


def _record_sets(options: StudyOptions, root: Path | None, sizes: StudyProfile) -> dict[str, RecordSet]:
    """Those of the data sets that are at hand; the virtual rig when none is."""
    found: dict[str, RecordSet] = {}
    for name in options.data[:1] if sizes.smoke else options.data:
        try:
            found[name] = load(name, root, sizes.rig_duration_s)
        except NotAtHandError:
            if root is not None:  # who names data wants those used
                raise
    return found or {RIG: load(RIG, root, sizes.rig_duration_s)}


def _backgrounds(records: RecordSet, data: Measured, image: ImageOptions) -> dict[str, Background]:
    """Healthy recordings that are long enough for the twin to stand on."""
    found = {}
    for place, c in enumerate(records.conditions):
        least = SHORTEST * image.piece_samples(c.fs_hz, c.speed_rpm)
        if c.group in data.healthy() and c.n_samples >= least:
            found[str(c.group)] = Background(records[place].samples, c.speed_rpm)
    return found


def _plant(
    options: StudyOptions, data: Measured, kind: Kind, fold: int, machines: int, backgrounds: tuple[str, ...], seed: int
) -> Plant:
    """The population of a fold; those that stand on no measured record are the same for all folds."""
    under: tuple[str, ...] = ()
    if kind == "grafted":
        # Healthy recordings are dealt alike in every seed and split.
        own = judged(data, SPLITS[0], fold, options.folds, seed)
        under = tuple(b for b in backgrounds if b not in own)
        if not under:
            raise TwingapError("no healthy recording is left to learn from", where=f"{data.name}, fold {fold}")
    speeds = tuple(sorted({round(s, 1) for s in data.speeds_rpm.values()}))
    return Plant(
        kind, data.name, under, data.classes, speeds, data.fs_hz, data.bearing, machines, options.source, options.image,
        seed,
    )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    names = ("availability-accuracy", "availability-crossings")
    command(
        run, "Diagnosis by how much fault data there is.",
        lambda study: {f"{name} ({study.title})": study.tables[name] for name in names},
        arguments, takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper2_digital_twin.availability import main as run_main

    run_main()
