"""Diagnoses of all machines of a fleet: in parallel, resumable, each with its own report.

folder --find_record_sets--> paths --read_machine--> digests --diagnose_machine--> OUT/<path>/gap.json, report.html
                                                                               --> Machine, Machine, ... --> Fleet
"""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from twingap.config import to_toml
from twingap.errors import TwingapError
from twingap.files import replacing
from twingap.fleet.record_sets import find_record_sets
from twingap.fleet.summary import NOT_DIAGNOSED, Fleet, Machine, fleet_of
from twingap.gap.api import diagnose
from twingap.gap.knowledge import shipped_digest
from twingap.gap.report.files import dumped, from_json, to_json, write_report
from twingap.provenance import digest_of_code, digest_of_value, versions
from twingap.records.folder import read_record_set
from twingap.sweep import Result, SweepError, sweep
from twingap.sweep.cluster import local_cluster
from twingap.twins.twin_file import TwinSpec, read_twin, tables_of

STORE: Final = ".diagnoses"
"""Folder of finished diagnoses within that of the results; hidden, so that no machine has its name."""
FILES: Final = ("gap.json", "report.html", "closest.toml")
_CODE: Final = ("bearing", "effects", "gap", "identification", "records", "signal", "twins")
"""Modules whose change makes diagnoses obsolete."""

Progress = Callable[[str, int, int], None]
"""progress(stage, done, total)."""


@dataclass(frozen=True)
class ReadJob:
    """A record set to be read."""

    path: str


@dataclass(frozen=True)
class DiagnoseJob:
    """A machine to be diagnosed; `records_sha256` ties the result to the content of its records."""

    path: str
    records_sha256: str
    seed: int
    quick: bool


def run_fleet(
    folder: str | os.PathLike[str],
    twin: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    seed: int = 0,
    quick: bool = False,
    backend: str = "loky",
    address: str | None = None,
    jobs: int | None = None,
    progress: Progress = lambda stage, done, total: None,
) -> Fleet:
    """Diagnose every record set below a folder.

    Each report is that of `twingap.diagnose` with the same seed. It is written when it is finished. A diagnosis that
    the output folder already holds is reused if records, twin, settings, code and learnt models are the same.

    Parameters
    ----------
    folder : path-like
        Folder that holds the record sets, at any depth. Workers of a cluster must see it at the same path.
    twin : path-like
        Twin file.
    out : path-like
        Output folder: one folder per machine, with the relative path of its record set.
    seed : int
    quick : bool
        As in `twingap.diagnose`.
    backend, address, jobs
        Where to run; see `twingap.sweep.backends.open_pool`.
    progress : callable
        Progress callback.

    Returns
    -------
    Fleet
        With a row also for each record set that could not be read or diagnosed.

    Raises
    ------
    TwingapError
        When there is no record set, none can be diagnosed, the output cannot be written, or another process is
        writing it.
    """
    root, out, spec = Path(folder).absolute(), Path(out), read_twin(twin)
    found = {path.encode("utf-8", "backslashreplace").decode(): path for path in find_record_sets(folder, out)}
    if backend == "dask" and address is None:
        with local_cluster(jobs) as own:  # one for reading and for diagnosing
            return run_fleet(
                folder, twin, out, seed=seed, quick=quick, backend="dask", address=own, progress=progress
            )  # fmt: skip
    reasons = {name: "the path is not UTF-8; rename it" for name, path in found.items() if name != path}
    where = {"backend": backend, "address": address, "n_jobs": jobs}

    digests = _swept(
        functools.partial(read_machine, root=root), [ReadJob(path) for path in found if path not in reasons], reasons,
        "reading records", progress, lambda result: None, data={"root": str(root)}, **where,
    )  # fmt: skip

    machines: dict[str, Machine] = {}

    def finished(result: Result[DiagnoseJob]) -> None:
        place, path = out / result.job.path, result.job.path
        table, twin_text = result.value.pop("gap"), result.value.pop("closest")  # not kept in memory
        report = from_json(table)
        if result.why or not _written(place, dumped(to_json(report)), twin_text):
            _write_twin(place / "closest.toml", twin_text)
            write_report(report, place)
        machines[path] = Machine.of(path, report)

    name = Path(twin).name
    data = {
        "twin": digest_of_value(tables_of(spec)), "twin_file": name, "learnt": shipped_digest(),
        "version": versions()["twingap"],
    }  # fmt: skip
    work = [DiagnoseJob(path, digest, seed, quick) for path, digest in digests.items()]
    _swept(
        functools.partial(diagnose_machine, root=root, twin=spec, twin_file=name), work, reasons, "diagnosing",
        progress, finished, store=out / STORE, data=data,
        version=digest_of_code(*(importlib.import_module(f"twingap.{part}") for part in _CODE)), **where,
    )  # fmt: skip
    reasons = {path: reason.replace(f"{root}{os.sep}", "") for path, reason in reasons.items()}
    if not machines:
        path = next(iter(reasons))
        raise TwingapError(f"none of {len(found)} record sets could be diagnosed: {path}: {reasons[path]}", where=root)
    for path in reasons:
        for old in FILES:  # of records that could be diagnosed before
            with suppress(OSError):
                (out / path / old).unlink()
    about = {
        "folder": root.resolve().name, "twin": name, "twin_model": spec.model, "twin_effects": list(spec.effects),
        "seed": seed, "quick": quick, "version": data["version"], "learnt_sha256": data["learnt"],
    }  # fmt: skip
    rows = [machines.get(path) or Machine(path, NOT_DIAGNOSED, reasons[path]) for path in found]
    return fleet_of(rows, about)


def read_machine(job: ReadJob, *, root: Path) -> str:
    """Digest of a record set; raises for one that cannot be read."""
    return read_record_set(root / job.path).digest


def diagnose_machine(job: DiagnoseJob, *, root: Path, twin: TwinSpec, twin_file: str) -> dict[str, Any]:
    """Content of gap.json and of closest.toml, or None, of one machine."""
    found = diagnose(root / job.path, twin, seed=job.seed, quick=job.quick)
    stated = found.report.provenance
    if stated["records_sha256"] != job.records_sha256:
        raise TwingapError("changed while it was read", where=root / job.path, mend="run the command again")
    closer = found.closest_twin() if found.write_closest else None
    return {
        "gap": to_json(replace(found.report, provenance={**stated, "twin": twin_file})),
        "closest": None if closer is None else to_toml(tables_of(closer)),
    }


def _swept(
    function: Callable[[Any], Any], work: Sequence[Any], reasons: dict[str, str], stage: str, progress: Progress,
    on_result: Callable[[Result[Any]], None], **where: Any,
) -> dict[str, Any]:  # fmt: skip
    """Path -> result of each job; what failed goes into `reasons`."""
    done = 0

    def one_more(result: Result[Any]) -> None:
        nonlocal done
        done += 1
        on_result(result)
        progress(stage, done, len(work))

    progress(stage, 0, len(work))
    if not work:
        return {}
    try:
        results = sweep(function, work, on_result=one_more, describe=lambda job: job.path, **where)
    except SweepError as error:
        results = error.results
        reasons |= {failure.job.path: failure.error for failure in error.failures}
    return {result.job.path: result.value for result in results}


def _written(place: Path, text: str, twin: str | None) -> bool:
    """Whether a machine's folder holds this diagnosis; its page is written before gap.json."""
    return (
        (place / "report.html").is_file()
        and _text(place / "gap.json") == text
        and _text(place / "closest.toml") == twin
    )


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None


def _write_twin(path: Path, text: str | None) -> None:
    """Write the closest twin; without one, an earlier one is removed."""
    if text is None:
        with suppress(OSError):
            path.unlink()
        return
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
