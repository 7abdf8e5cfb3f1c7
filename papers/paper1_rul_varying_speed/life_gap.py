"""The gap between this paper's twin and the runs by stage of life and speed, and what adding the named effects buys.

run, stage, speeds --> records ------------------------------+
the twin at their speeds and peaks to peak --> simulated ----+--> `twingap.gap` --> verdict: a row of life_gap.csv
records from the anomaly to now, bearing by bearing: named effects --> simulated lives --> trainings: life_gap_rmse.csv

Every simulated record has the speed and the peak to peak of a measured one: how a life goes on is another question,
which table 5 answers. Rows after now are looked at for the verdicts alone; what is added to the twin was named on
records up to now, without labels. FEMTO's runs have no twin of lives here: the phenomenological twin is calibrated to
each stage, and nothing is trained on it.

Run as ``python -m papers.paper1_rul_varying_speed.life_gap --out DIR``; interrupted, it goes on where it was.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from papers.paper1_rul_varying_speed import femto
from papers.paper1_rul_varying_speed.cases import Case, Target, load_target, read_case
from papers.paper1_rul_varying_speed.job import Added, Job, train_and_judge
from papers.paper1_rul_varying_speed.models import architecture_of
from papers.paper1_rul_varying_speed.options import CONFIG, Options, read_options
from papers.paper1_rul_varying_speed.pipeline import code_of_training
from twingap import files
from twingap.adapt.evaluate import t_interval
from twingap.data import load
from twingap.errors import TwingapError
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.simulated_lives import LifeSimulator, SignalModel, Snapshots
from twingap.provenance import digest_of_code, digest_of_path
from twingap.records import Condition, Record, RecordSet
from twingap.sweep import sweep
from twingap.twins.twin_file import TwinSpec

if TYPE_CHECKING:
    from twingap.gap import Diagnosis

HEALTHY, SEEN, LATER = "healthy", "anomaly to now", "after now"
STAGES: Final = (HEALTHY, SEEN, LATER)
BEFORE_ALARM, AFTER_ALARM = "before the alarm", "after the alarm"
SPEEDS: Final = {"slow": (0.0, 1300.0), "middle": (1300.0, 1700.0), "fast": (1700.0, np.inf)}
"""Of the rig, which steps from 1000 to 2000 rpm: rpm from, to."""
RECORDS: Final = 24
"""Of one diagnosis."""
COPIES: Final = 3
"""Simulated records for each measured one."""
MODELS: Final = ("CNN", "Proposed model 3")
VARIANT: Final = "printed"


@dataclass(frozen=True)
class Asked:
    """One diagnosis.

    Parameters
    ----------
    data : {"rig", "femto"}
    stage : str
    speed : str
        Key of `SPEEDS`, a FEMTO condition ("1" to "3"), or "all".
    bearings : tuple of str
    seed : int
    """

    data: str
    stage: str
    speed: str
    bearings: tuple[str, ...]
    seed: int

    @property
    def words(self) -> str:
        """In words."""
        return f"{self.data}, {', '.join(self.bearings)}, {self.stage}, {self.speed}"

    @property
    def rng(self) -> np.random.Generator:
        """Of its own."""
        return np.random.default_rng([self.seed, zlib.crc32(self.words.encode())])


# ------------------------------------------------------------------------------------------------------- the rig's runs


def stage_of(case: Case, stage: str) -> Snapshots:
    """Records of a stage, without labels."""
    if stage == HEALTHY:
        return case.known.healthy
    if stage == SEEN:
        return case.known.real
    return case.judged.take(case.later).unlabelled()


def pair_of(asked: Asked, cases: Sequence[Case], model: SignalModel) -> tuple[RecordSet, RecordSet]:
    """Measured records of a stage, and the twin's at their speeds and peaks to peak.

    Parameters
    ----------
    asked : Asked
    cases : sequence of Case
        Of its bearings.
    model : SignalModel
        Of the twin.

    Returns
    -------
    RecordSet, RecordSet
        Groups are bearings; of one bearing alone, each record is a group of its own.

    Raises
    ------
    TwingapError
        When fewer than two records are of this stage and speed.
    """
    rng = asked.rng
    real: list[Record] = []
    made: list[Record] = []
    low, high = SPEEDS.get(asked.speed, (0.0, np.inf))
    for case in cases:
        known = case.known
        own = stage_of(case, asked.stage)
        here = np.flatnonzero((own.speed_rpm >= low) & (own.speed_rpm < high))
        own = own.take(here[spread(here.size, RECORDS // len(cases))])
        if not len(own):
            continue
        fault = "healthy" if asked.stage == HEALTHY else known.fault
        names = [f"{case.name}-{int(p)}" for p in own.position]
        groups = [case.name if len(cases) > 1 else name for name in names]
        real += as_records(own.samples, own.speed_rpm, known.fs_hz, fault, names, groups)
        twin = LifeSimulator(
            known.twin, known.bearing, known.fault, known.fs_hz, own.samples.shape[1], rng, model, known.unit,
            healthy=known.healthy, struck=known.real,
        )  # fmt: skip
        for copy in range(COPIES):
            if fault == "healthy":
                samples = twin.noise(own.speed_rpm, rng)
            else:
                samples = twin.records(own.speed_rpm, np.ptp(own.samples, axis=1).astype(float), rng)
            again = [f"{name}-sim{copy}" for name in names]
            made += as_records(samples, own.speed_rpm, known.fs_hz, fault, again, groups)
    if len(real) < 2:
        raise TwingapError(f"{len(real)} records, 2 or more needed", where=asked.words)
    first = cases[0].known
    return (
        RecordSet.from_records(asked.words, first.unit, first.bearing, real),
        RecordSet.from_records(f"twin of {asked.words}", first.unit, first.bearing, made),
    )


def as_records(
    samples: Any, speed_rpm: Any, fs_hz: float, fault: str, names: Sequence[str], groups: Sequence[str]
) -> Iterator[Record]:
    """Rows of samples [records, length] as records."""
    for row, speed, name, group in zip(samples, speed_rpm, names, groups, strict=True):
        yield Record(Condition(name, float(speed), fs_hz, row.size, fault, group=group), np.asarray(row, float))


def spread(count: int, wanted: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """At most so many places of `count`, evenly."""
    if not count:
        return np.zeros(0, np.int64)
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).round().astype(np.int64))


def modelled(model: SignalModel) -> TwinSpec:
    """What the twin of lives has already: scatter of impacts, their zone and their timing."""
    values = {
        "slip_jitter": {"sigma": model.jitter}, "load_zone": {"depth": model.load_zone},
        "impact_scatter": {"sigma": model.scatter},
    }  # fmt: skip
    return TwinSpec("phenomenological", tuple(values), None, values)


# ------------------------------------------------------------------------------------------------------------ diagnoses


def diagnosed(asked: Asked, *, root: str | None, config: str) -> dict[str, Any]:
    """One diagnosis as a row: verdict, effects with values, the gap before and after, where it lies."""
    from twingap.gap import diagnose

    if asked.data == "femto":
        spec, real, sim = TwinSpec("phenomenological"), femto_records(asked, root), None
    else:
        options = read_options(Path(config))
        signal = options.variants[VARIANT].signal
        real, sim = pair_of(asked, [_case(name, root, config) for name in asked.bearings], signal)
        spec = modelled(signal)
    try:
        found = diagnose(real, spec, asked.rng, sim=sim)
    except TwingapError as error:
        return {"refused": str(error), "records": len(real)}
    return row_of(found) | {"records": len(real)}


def row_of(found: Diagnosis) -> dict[str, Any]:
    """What a table and a training need of a diagnosis."""
    from twingap.gap.evidence import values_of

    report, verdict = found.report, found.report.verdict
    after = found.explanation.after.effects if verdict.effects else ()
    first = report.metrics[0]
    return {
        "refused": "", "status": verdict.status, "p_value": verdict.p_value, "effects": list(verdict.effects),
        "added": {e.name: values_of(e) for e in after if e.name in verdict.effects},
        "closure": verdict.closure, "closure_ci": list(verdict.closure_ci) if verdict.closure_ci else None,
        "metric": first.metric, "before": first.before, "after": first.after, "floor": first.floor,
        "scale": found.calibrated.frame.scale,
        "where": [
            f"{p.domain}{f' {p.lo:.4g} to {p.hi:.4g} {p.unit}' if p.lo is not None and p.hi is not None else ''}"
            for p in report.places[:3]
        ],
    }  # fmt: skip


def target_of(options: Options, root: str | None, names: Sequence[str]) -> Target:
    """The paper's own set where the root holds it, else the virtual rig: the root may be there for FEMTO alone."""
    try:
        return load_target(options.target, None if root is None else Path(root), names)
    except TwingapError:
        if root is None:
            raise
    return load_target(options.target, None, names)


@functools.lru_cache(maxsize=6)
def _case(name: str, root: str | None, config: str) -> Case:
    options = read_options(Path(config))
    return read_case(target_of(options, root, (name,)), name, options.target, options.adaptation)


def femto_records(asked: Asked, root: str | None) -> RecordSet:
    """Snapshots of a FEMTO stage; what wears is not known after the alarm."""
    every = load("femto", root)
    places: list[int] = []
    for bearing in asked.bearings:
        own = [i for i, c in enumerate(every.conditions) if c.group == bearing]
        rows = femto.take_features(femto.Features(bearing), root=root)
        run = femto.Measured(*(np.asarray(rows[k], float) for k in ("features", "time_s", "speed_rpm")))
        alarm = femto.followed(run, OnlineLife()).alarm_row or len(own) - 1
        begin, end = (0, alarm) if asked.stage == BEFORE_ALARM else (alarm, len(own))
        places += [own[begin + int(k)] for k in spread(end - begin, RECORDS // len(asked.bearings))]
    fault = "healthy" if asked.stage == BEFORE_ALARM else None
    chosen = every.take(places)
    named = (Record(dataclasses.replace(r.condition, fault=fault), r.samples) for r in chosen)
    return RecordSet.from_records(asked.words, every.unit, every.bearing, named)


# ------------------------------------------------------------------------------------------------------------ trainings


def added(row: dict[str, Any]) -> Added | None:
    """Effects of a verdict as part of a training; None when none is named or could be added."""
    if row["refused"] or not row["added"]:
        return None
    return Added(
        tuple((name, tuple(sorted(values.items()))) for name, values in row["added"].items()), float(row["scale"])
    )  # fmt: skip


def trainings_of(
    case: Case, options: Options, more: Added | None, seeds: int, steps: int, most: int
) -> Iterator[Job]:  # fmt: skip
    """Trainings without and with the named effects."""
    chosen = options.variants[VARIANT]
    own = dataclasses.replace(options.training, steps=steps, alike=chosen.alike)
    for seed in range(seeds):
        for what in (None, more) if more is not None else (None,):
            for model in MODELS:
                shape = architecture_of(model, printed=options.judging.printed)
                yield Job(
                    case.name, VARIANT, model, dataclasses.replace(shape, length=options.target.window_samples), seed,
                    own, chosen.signal, 1, most, options.judging.criterion, added=what,
                )  # fmt: skip


def verdicts(title: str, answers: Sequence[tuple[Asked, dict[str, Any]]]) -> pd.DataFrame:
    """A row per diagnosis."""
    rows = []
    for asked, row in answers:
        line: dict[str, Any] = {
            "data": title if asked.data == "rig" else "FEMTO",
            "bearings": asked.bearings[0] if len(asked.bearings) == 1 else f"{len(asked.bearings)} bearings",
            "stage": asked.stage, "speed": asked.speed, "records": row["records"],
        }  # fmt: skip
        if row["refused"]:
            rows.append(line | {"verdict": row["refused"]})
            continue
        ends = row["closure_ci"] or (np.nan, np.nan)
        rows.append(line | {
            "verdict": row["status"], "p_value": row["p_value"], "effects": ", ".join(row["effects"]),
            "gap_before": row["before"], "gap_after": row["after"], "floor": row["floor"],
            "closure": np.nan if row["closure"] is None else row["closure"], "closure_low": ends[0],
            "closure_high": ends[1], "where": "; ".join(row["where"]),
        })  # fmt: skip
    return pd.DataFrame(rows)


def errors(title: str, results: Sequence[tuple[Case, Job, dict[str, Any]]]) -> pd.DataFrame:
    """RMSE (min) by run and model without and with the effects; of runs where none was added, both alike."""
    rows = []
    for case, job, value in results:
        rows.append({
            "data": title, "bearing": case.name, "model": job.model, "seed": job.seed,
            "added": "" if job.added is None else ", ".join(name for name, _ in job.added.effects),
            "rmse_min": value["rmse_min"][value["place"]], "oracle_min": min(value["rmse_min"]),
        })  # fmt: skip
    return pd.DataFrame(rows)


def summary(every: pd.DataFrame) -> pd.DataFrame:
    """Mean RMSE over runs by model, before and after, and the ratio with its 90 % interval over seeds."""
    out = []
    for model, own in every.groupby("model", sort=False):
        before = own[own["added"] == ""].pivot(index="bearing", columns="seed", values="rmse_min")
        after = own[own["added"] != ""].pivot(index="bearing", columns="seed", values="rmse_min")
        after = after.reindex(before.index).fillna(before)
        ratios = (after.mean() / before.mean()).to_numpy()
        low, high = t_interval(list(ratios), 0.9)
        out.append({
            "data": own["data"].iloc[0], "model": model, "runs": len(before), "seeds": ratios.size,
            "before_min": before.to_numpy().mean(), "after_min": after.to_numpy().mean(), "ratio": ratios.mean(),
            "low_90": low, "high_90": high, "runs_better": int((after.mean(axis=1) < before.mean(axis=1)).sum()),
        })  # fmt: skip
    return pd.DataFrame(out)


def questions(bearings: Sequence[str], femto_runs: Sequence[str], seed: int) -> Iterator[Asked]:
    """Every diagnosis: the rig's by stage and speed, each run up to now, FEMTO's by stage and condition."""
    for stage in STAGES:
        for speed in SPEEDS:
            yield Asked("rig", stage, speed, tuple(bearings), seed)
    for bearing in bearings:
        yield Asked("rig", SEEN, "all", (bearing,), seed)
    for condition in sorted({name[len("Bearing")] for name in femto_runs}):
        own = tuple(name for name in femto_runs if name[len("Bearing")] == condition)
        for stage in (BEFORE_ALARM, AFTER_ALARM):
            yield Asked("femto", stage, condition, own, seed)


def run(
    out: Path,
    *,
    root: str | None = None,
    seed: int = 0,
    seeds: int = 2,
    steps: int = 800,
    most_records: int = 2000,
    backend: str = "sequential",
    bearings: Sequence[str] = (),
    config: Path = CONFIG,
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Diagnose and train what is missing, and write the tables.

    Parameters
    ----------
    out : Path
        Tables; results are kept in its folder store.
    root : str, optional
        Data root: the rig is taken unless it holds the paper's own set, FEMTO is left out unless it holds that.
    seed : int
        Of the diagnoses.
    seeds, steps, most_records : int
        Of the trainings.
    backend : str
    bearings : sequence of str
        Which of the rig's runs; all of profile full when empty.
    config : Path

    Returns
    -------
    DataFrame, DataFrame, DataFrame
        `verdicts`, `errors`, `summary`.
    """
    import twingap.gap
    from twingap.gap.training import train

    options = read_options(config)
    names = tuple(bearings) or options.profile("full").bearings
    target = target_of(options, root, names)
    cases = {name: read_case(target, name, options.target, options.adaptation) for name in names}
    femto_runs, data = _femto(root)
    learnt = train()
    asked = list(questions(names, femto_runs, seed))
    answers = sweep(
        functools.partial(diagnosed, root=root, config=str(config)), asked, store=out / "store", backend=backend,
        version=code_of_training() + digest_of_code(twingap.gap, femto, sys.modules[__name__]),
        data={"learnt": files.sha256(learnt), **data, **{name: case.digest for name, case in cases.items()}},
        describe=lambda job: job.words,
    )  # fmt: skip
    told = [(a.job, dict(a.value)) for a in answers]
    named = {job.bearings[0]: added(row) for job, row in told if job.data == "rig" and job.speed == "all"}
    trained = []
    for name, case in cases.items():
        results = sweep(
            functools.partial(train_and_judge, case=case),
            list(trainings_of(case, options, named[name], seeds, steps, most_records)),
            data={"run": case.digest, "adaptation": repr(options.adaptation)}, store=out / "store", backend=backend,
            version=code_of_training(), describe=lambda j: f"{j.bearing}, {j.model}, seed {j.seed}, {j.added}",
        )  # fmt: skip
        trained += [(case, r.job, dict(r.value)) for r in results]
    every = verdicts(target.title, told), errors(target.title, trained)
    tables = (*every, summary(every[1]))
    for title, frame in zip(("life_gap", "life_gap_rmse", "life_gap_summary"), tables, strict=True):
        with files.replacing(out / f"{title}.csv") as path:
            frame.to_csv(path, index=False, float_format="%.4g", lineterminator="\n")
    return tables


def _femto(root: str | None) -> tuple[tuple[str, ...], dict[str, str]]:
    """FEMTO's runs at hand, and the digest of their files."""
    from twingap.data.root import data_root

    try:
        return load("femto", root).groups, {"femto": digest_of_path(data_root(root) / "femto")}
    except TwingapError:
        return (), {}


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    from papers.paper1_rul_varying_speed.figures import write
    from papers.paper1_rul_varying_speed.life_gap_figures import gaps

    parser = argparse.ArgumentParser(prog="life_gap", description="The gap by stage of life and speed.")
    parser.add_argument("--out", type=Path, required=True, help="folder of tables and figure")
    parser.add_argument("--root", help="data root; default: TWINGAP_DATA")
    parser.add_argument("--seeds", type=int, default=2, help="trainings per run and model")
    parser.add_argument("--backend", default="sequential", help="where diagnoses and trainings run")
    options = parser.parse_args(arguments)
    told, _, short = run(options.out, root=options.root, seeds=options.seeds, backend=options.backend)
    write(gaps(told), options.out / "life_gap.png")
    print(told.to_string(index=False, float_format="%.3g"))
    print(short.to_string(index=False, float_format="%.3g"))


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of whoever imports the study.
    from papers.paper1_rul_varying_speed.life_gap import main as run_main

    try:
        run_main()
    except TwingapError as error:
        sys.exit(f"life_gap: {error}")
