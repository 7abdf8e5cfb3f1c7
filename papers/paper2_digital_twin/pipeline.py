"""Paper 2: dynamics, live updating, degradation, diagnosis by data availability, the gap closed: one run.

dynamics --> live --> degradation --> lines --> availability --> transfer_gap
    +----------+---------+--------------+------------+----------------+--> headlines: one list of rows --> the caller
(each: jobs in OUT/results but for lines, tables, a nested run)

Used in: Paper 2, a bearing fault diagnosis framework based on a digital twin. The studies do not need each other; they
run one after the other so that each has all cores.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from twingap import files
from twingap.config import read_toml
from twingap.errors import TwingapError
from twingap.provenance import digest_of_path
from twingap.sweep.backends import BACKENDS
from twingap.track import NullTracker, Tracker

Progress = Callable[[str, int, int], None]
"""Called with what is going on, how much of it is done, and how much there is."""

STUDIES: Final[dict[str, tuple[str, ...]]] = {
    "dynamics": ("dynamics-balance", "dynamics-faults"),
    "live": ("live-targets", "live-false-alarms"),
    "degradation": ("degradation-claims",),
    "lines": ("lines-told",),
    "availability": ("availability-accuracy", "availability-crossings", "availability-choice"),
    "transfer_gap": ("transfer-gap",),
}
"""Study, in the order of running -> its tables that are headlines."""
TITLES: Final = {
    "dynamics": "contact dynamics: simulated",
    "live": "live updating: virtual machine",
    "degradation": "degradation curves",
    "lines": "recordings that show the line of their own fault",
    "availability": "diagnosis by how much labelled data there is",
    "transfer_gap": "what the paper's twin teaches, with its gap closed and without",
}
PROFILES: Final = ("smoke", "full")


@dataclass(frozen=True)
class Outcome:
    """The whole result.

    Parameters
    ----------
    profile : str
    studies : dict[str, Any]
        Study -> what its `run` returned; each has `tables`.
    rows : list[dict[str, Any]]
        Headlines: every row names its study and table; other columns are the table's own.
    missing : tuple[str, ...]
        Studies that this installation does not have.
    out : Path
    run_id : str or None
        Of the tracker's run.
    """

    profile: str
    studies: dict[str, Any]
    rows: list[dict[str, Any]]
    missing: tuple[str, ...]
    out: Path
    run_id: str | None

    def shown(self) -> dict[str, list[dict[str, Any]]]:
        """Title -> headline rows of like columns, to print one table after the other."""
        out: dict[str, list[dict[str, Any]]] = {}
        for row in self.rows:
            rest = {key: value for key, value in row.items() if key not in ("study", "table")}
            out.setdefault(f"{TITLES[row['study']]} ({row['table']})", []).append(rest)
        return out


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    tracker: Tracker | None = None,
    progress: Progress = lambda what, done, total: None,
    draw: bool = True,
    only: tuple[str, ...] = tuple(STUDIES),
) -> Outcome:
    """Run the paper's studies; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "full"}
        Each study's own configuration says what that is.
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``, the store of finished jobs.
    root : Path or None
        Data root; TWINGAP_DATA when None.
    seed : int
        First of each study's seeds.
    backend, address
        Where jobs run; see `twingap.sweep`.
    tracker : Tracker or None
        Where the run is logged; None keeps no log.
    progress : callable
    draw : bool
        Make the figures.
    only : tuple of str
        Which studies.

    Returns
    -------
    Outcome

    Raises
    ------
    TwingapError
        For a profile, study, backend, data root or folder that cannot be used.
    """
    if profile not in PROFILES:
        raise TwingapError(f"unknown profile {profile!r}", mend=f"use one of {', '.join(PROFILES)}")
    if unknown := [name for name in only if name not in STUDIES]:
        raise TwingapError(f"unknown study {unknown[0]!r}", mend=f"use one of {', '.join(STUDIES)}")
    if backend not in BACKENDS:
        raise TwingapError(f"unknown backend {backend!r}", mend=f"use one of {', '.join(BACKENDS)}")
    files.try_folder(out)
    there = {name: _module(name) for name in STUDIES if name in only}
    missing = tuple(name for name, module in there.items() if module is None)
    studies: dict[str, Any] = {}
    rows: list[dict[str, Any]] = []
    tags = {"paper": "paper2", "profile": profile}
    with (tracker or NullTracker()).run(f"paper2 · {profile} · seed {seed}", tags) as log:
        log.parameters({"profile": profile, "seed": seed, "studies": [n for n in there if n not in missing]})
        for name, module in there.items():
            if module is None:
                continue
            with log.run(name, {"paper": "paper2", "study": name, "profile": profile}) as of_study:
                config = Path(module.CONFIG)
                of_study.parameters(_settings(config, profile))
                of_study.data(config.name, digest_of_path(config), role="configuration")
                studies[name] = module.run(
                    profile, out=out, root=root, seed=seed, backend=backend, address=address, log=of_study,
                    progress=progress, draw=draw,
                )  # fmt: skip
            rows += headlines(name, studies[name].tables)
        run_id = getattr(log, "id", None)
    return Outcome(profile, studies, rows, missing, out, run_id)


def headlines(study: str, tables: dict[str, Any]) -> list[dict[str, Any]]:
    """A study's headline rows, each with study and table named; a study without its headline tables gives its first."""
    names = [name for name in STUDIES[study] if name in tables] or list(tables)[:1]
    return [{"study": study, "table": name, **row} for name in names for row in tables[name].to_dict("records")]


def _module(study: str) -> Any:
    """A study's module; None where the installation has none."""
    name = f"papers.paper2_digital_twin.{study}"
    return importlib.import_module(name) if importlib.util.find_spec(name) else None


def _settings(config: Path, profile: str) -> dict[str, Any]:
    """The configuration with the profile in use alone."""
    table = read_toml(config)
    return {**table, "profiles": {profile: table.get("profiles", {}).get(profile, {})}}
