"""Jobs of worker processes: seal a world, diagnose it blind, open it, make training worlds for rivals.

SealJob     --make_world--> seal of the truth, digest of the records          (the truth stays in the worker)
DiagnoseJob --make_world--> Blind --diagnose--> report; --prepare--> rivals' statistics and two-sample test
OpenJob     --make_world--> truth, closure of the true effects, gap that no effect can close
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twingap.errors import TwingapError
from twingap.gap.report.files import to_json
from twingap.gap.report.model import GapReport
from twingap.records import RecordSet
from twingap.study import rivals, statistics
from twingap.study.blind import Blind, blinded
from twingap.study.usage import Usage
from twingap.twins.twin_file import TwinSpec

if TYPE_CHECKING:
    from twingap.rigs.worlds import Case

Diagnose = Callable[..., Any]
"""diagnose(records, twin, *, seed, sim=None, quick=False) -> a `Diagnosis`, or the content of a gap.json."""
Prepare = Callable[[RecordSet, TwinSpec, np.random.Generator, RecordSet | None], tuple[RecordSet, RecordSet]]
"""prepare(records, spec, rng, sim) -> (records, simulated records of the calibrated twin, same conditions)."""
Triples = Callable[[int, np.random.Generator], Iterable[tuple[RecordSet, RecordSet, frozenset[str]]]]
"""worlds(n, rng) -> (records, simulated records, missing effects): training worlds of the rivals."""


@dataclass(frozen=True)
class SealJob:
    """Job: seal a world; the nonce is random text that is hashed with the truth."""

    case: Case
    seed: int
    nonce: str


@dataclass(frozen=True)
class DiagnoseJob:
    """Job: diagnose a world blind."""

    case: Case
    seed: int
    records_sha256: str  # digest of the records when the world was sealed
    permutations: int  # permutations of the rivals' two-sample test; 0 leaves all rivals out
    closest: bool = False  # whether the diagnosis also seeks the closest twin


@dataclass(frozen=True)
class OpenJob:
    """Job: open a world."""

    case: Case
    seed: int


@dataclass(frozen=True)
class LearnJob:
    """Job: make some training worlds for the rivals, a chunk of all."""

    seed: int
    chunk: int
    count: int


def seal_world(job: SealJob) -> dict[str, str]:
    """Seal of a world's truth, and digest of its records."""
    from twingap.rigs.worlds import make_world, seal

    world = make_world(job.case, job.seed)
    return {"seal": seal(world.truth, job.nonce), "records_sha256": world.records.digest}


def diagnose_world(job: DiagnoseJob, diagnose: Diagnose, prepare: Prepare) -> dict[str, Any]:
    """Diagnosis of a world from its records, simulated records and twin alone.

    Returns
    -------
    dict
        report (content of gap.json without curves; None when refused), refused (reason), seconds, peak_mb; statistics
        [world statistics] and two_sample for the rivals.

    Raises
    ------
    TwingapError
        When the world differs from the sealed one.
    """
    from twingap.rigs.worlds import make_world

    world = make_world(job.case, job.seed)
    if world.records.digest != job.records_sha256:
        raise TwingapError("records differ from those that were sealed", where=f"case {job.case.name!r}")
    blind = blinded(world)
    del world
    root = root_of(job.case, job.seed)
    return timed_diagnosis(blind, root, diagnose, job.closest) | _for_rivals(blind, prepare, root, job.permutations)


def root_of(case: Case, seed: int) -> list[int]:
    """Root entropy of all random numbers of a world's diagnosis."""
    return [seed, zlib.crc32(case.name.encode())]


def timed_diagnosis(blind: Blind, root: Sequence[int], diagnose: Diagnose, closest: bool = False) -> dict[str, Any]:
    """Diagnosis of a blind world with its runtime and memory: report, refused, seconds, peak_mb."""
    report, refused = None, ""
    with Usage() as used:
        try:
            rng = np.random.default_rng([*root, 0])
            report = report_of(diagnose(blind.records, blind.twin, seed=rng, sim=blind.sim, quick=not closest))
        except TwingapError as error:
            refused = str(error)
    return {"report": report, "refused": refused, "seconds": used.seconds, "peak_mb": used.peak_mb}


def open_world(job: OpenJob) -> dict[str, Any]:
    """A world's truth as canonical JSON, the closure of its true effects, and the gap of its twin without effects."""
    from twingap.rigs.worlds import make_world
    from twingap.study.closure import left_without_effects, true_closure

    world = make_world(job.case, job.seed)
    left = left_without_effects(world, job.seed) if world.truth.effects else None
    return {"truth": world.truth.to_json(), "closure": true_closure(world, job.seed), "left": left}


def learn_from(job: LearnJob, worlds: Triples) -> dict[str, Any]:
    """Training examples for the rivals."""
    from twingap.effects import trainable

    rng = np.random.default_rng([job.seed, job.chunk, 0x1EA4])
    made = rivals.examples(worlds(job.count, rng), tuple(trainable()))
    return {"x": made.x, "present": made.present, "effects": list(made.effects)}


def report_of(diagnosis: Any) -> dict[str, Any]:
    """Content of gap.json, without the data of figures."""
    report = getattr(diagnosis, "report", diagnosis)
    table = to_json(report) if isinstance(report, GapReport) else dict(report)
    table.pop("curves", None)
    return table


def _for_rivals(blind: Blind, prepare: Prepare, root: Sequence[int], permutations: int) -> dict[str, Any]:
    if not permutations:
        return {"statistics": np.full(len(statistics.world_names()), np.nan), "two_sample": {}}
    try:
        real, simulated = prepare(blind.records, blind.twin, np.random.default_rng([*root, 1]), blind.sim)
    except TwingapError as error:
        nothing = np.full(len(statistics.world_names()), np.nan)
        return {"statistics": nothing, "two_sample": {"status": "refused", "why": str(error)}}
    ours, theirs = statistics.table(real), statistics.table(simulated)
    tested = rivals.two_sample(ours, theirs, np.random.default_rng([*root, 2]), permutations)
    return {"statistics": statistics.from_tables(ours, theirs, real, simulated), "two_sample": rivals.as_row(tested)}
