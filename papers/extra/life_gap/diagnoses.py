"""One diagnosis of the life-gap study: records of a stage and speed, the twin's beside them, the verdict as a row."""

import contextlib
import dataclasses
import functools
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from papers.arrays import spread
from papers.extra.femto import jobs as femto
from papers.paper1_rul_varying_speed.cases import Case, Target, load_target, read_case
from papers.paper1_rul_varying_speed.lives.options import Options, read_options
from papers.paper1_rul_varying_speed.methods.simulated_lives import LifeSimulator, SignalModel, Snapshots
from twingap import Condition, Record, RecordSet, TwingapError
from twingap.data import NotAtHandError, load
from twingap.prognosis.online import OnlineLife
from twingap.twins.twin_file import TwinSpec

HEALTHY, SEEN, LATER = "healthy", "anomaly to now", "after now"
STAGES: Final = (HEALTHY, SEEN, LATER)
BEFORE_ALARM, AFTER_ALARM = "before the alarm", "after the alarm"
SPEEDS: Final = {"slow": (0.0, 1300.0), "middle": (1300.0, 1700.0), "fast": (1700.0, np.inf)}
"""Of the rig, which steps from 1000 to 2000 rpm: rpm from, to."""
RECORDS: Final = 24  # of one diagnosis
COPIES: Final = 3  # simulated records for each measured one
VARIANT: Final = "printed"


@dataclass(frozen=True)
class Asked:
    data: str  # one of "rig", "femto"
    stage: str
    speed: str  # key of `SPEEDS`, a FEMTO condition ("1" to "3"), or "all"
    bearings: tuple[str, ...]
    seed: int

    @property
    def words(self) -> str:
        return f"{self.data}, {', '.join(self.bearings)}, {self.stage}, {self.speed}"

    @property
    def rng(self) -> np.random.Generator:
        return np.random.default_rng([self.seed, zlib.crc32(self.words.encode())])


def stage_of(case: Case, stage: str) -> Snapshots:
    """Records of a stage, without labels."""
    if stage == HEALTHY:
        return case.known.healthy
    if stage == SEEN:
        return case.known.real
    return case.judged.take(case.later).unlabelled()


def pair_of(asked: Asked, cases: Sequence[Case], model: SignalModel) -> tuple[RecordSet, RecordSet]:
    """Measured records of a stage of these bearings, and the twin's at their speeds and peaks to peak; groups are
    bearings, or records where there is one bearing. Raises `TwingapError` for fewer than two records."""
    rng = asked.rng
    real: list[Record] = []
    made: list[Record] = []
    low, high = SPEEDS.get(asked.speed, (0.0, np.inf))
    for case in cases:
        known = case.known
        own = stage_of(case, asked.stage)
        here = np.flatnonzero((own.speed_rpm >= low) & (own.speed_rpm < high))
        if not here.size:
            continue
        own = own.take(here[spread(here.size, RECORDS // len(cases))])
        fault = "healthy" if asked.stage == HEALTHY else known.fault
        names = [f"{case.name}-{int(p)}" for p in own.position]
        groups = [case.name if len(cases) > 1 else name for name in names]
        real += as_records(own.samples, own.speed_rpm, known.fs_hz, fault, names, groups)
        twin = LifeSimulator(
            known.twin, known.bearing, known.fault, known.fs_hz, own.samples.shape[1], rng, model, known.unit,
            healthy=known.healthy, faulty=known.real,
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
    unit, bearing = cases[0].known.unit, cases[0].known.bearing
    return (
        RecordSet.from_records(asked.words, unit, bearing, real),
        RecordSet.from_records(f"twin of {asked.words}", unit, bearing, made),
    )


def as_records(
    samples: Any, speed_rpm: Any, fs_hz: float, fault: str, names: Sequence[str], groups: Sequence[str]
) -> Iterator[Record]:
    for row, speed, name, group in zip(samples, speed_rpm, names, groups, strict=True):
        yield Record(Condition(name, float(speed), fs_hz, row.size, fault, group=group), np.asarray(row, float))


def modelled(model: SignalModel) -> TwinSpec:
    """What the twin of lives has already: scatter of impacts, their zone and their timing."""
    values = {
        "slip_jitter": {"sigma": model.jitter}, "load_zone": {"depth": model.load_zone},
        "impact_scatter": {"sigma": model.scatter},
    }  # fmt: skip
    return TwinSpec("phenomenological", tuple(values), None, values)


def diagnosed(asked: Asked, *, root: str | None, config: str) -> dict[str, Any]:
    """One diagnosis as a row: verdict, effects with values, the gap before and after, where it lies."""
    if asked.data == "femto":
        spec, real, sim = TwinSpec("phenomenological"), femto_records(asked, root), None
    else:
        options = read_options(Path(config))
        signal = options.variants[VARIANT].signal
        real, sim = pair_of(asked, [_case(name, root, config) for name in asked.bearings], signal)
        spec = modelled(signal)
    return row_of(asked, real, spec, sim)


def row_of(asked: Asked, real: RecordSet, spec: TwinSpec, sim: RecordSet | None) -> dict[str, Any]:
    """Diagnose; what a table and a training need of it."""
    from twingap.gap import diagnose

    try:
        found = diagnose(real, spec, seed=asked.rng, sim=sim, quick=True)
    except TwingapError as error:
        return {"refused": str(error), "records": len(real)}
    report, verdict = found.report, found.report.verdict
    after = found.explanation.after.effects if verdict.effects else ()
    first = report.metrics[0]
    return {
        "refused": "", "records": len(real), "status": verdict.status, "p_value": verdict.p_value,
        "effects": list(verdict.effects),
        "added": {e.name: e.parameter_values() for e in after if e.name in verdict.effects},
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
    if root is not None:
        with contextlib.suppress(NotAtHandError):
            return load_target(options.target, Path(root), names)
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
        run = femto.Measured(**femto.take_features(femto.Features(bearing), root=root))
        alarm = femto.followed(run, OnlineLife()).alarm_row or len(own) - 1
        begin, end = (0, alarm) if asked.stage == BEFORE_ALARM else (alarm, len(own))
        places += [own[begin + int(k)] for k in spread(end - begin, RECORDS // len(asked.bearings))]
    fault = "healthy" if asked.stage == BEFORE_ALARM else None
    chosen = every.take(places)
    named = (Record(dataclasses.replace(r.condition, fault=fault), r.samples) for r in chosen)
    return RecordSet.from_records(asked.words, every.unit, every.bearing, named)
