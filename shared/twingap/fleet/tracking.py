"""A fleet as a tracked run, with one run inside for each machine.

Fleet + files --track_fleet--> Run: settings, counts, tables; Run for each machine, as for a diagnosis of its own
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from twingap.fleet.summary import Fleet
from twingap.gap.report.files import read_report
from twingap.gap.report.tracking import track_report
from twingap.provenance import plain

if TYPE_CHECKING:
    from twingap.track import Run, Tracker


def track_fleet(
    tracker: Tracker, fleet: Fleet, out: str | os.PathLike[str], files: Iterable[str | os.PathLike[str]] = ()
) -> None:
    """Log a fleet as a run, named by folder, twin and seed.

    Parameters
    ----------
    tracker : Tracker
    fleet : Fleet
    out : path-like
        Folder of the reports.
    files : iterable of path-like
        Files to keep with the run: fleet.json, fleet.csv, fleet.html.

    Raises
    ------
    TwingapError
        When the tracker's store cannot be written.
    """
    import pandas as pd

    about = fleet.about
    with tracker.run(f"{about['folder']} · {about['twin']} · seed {about['seed']}", {"kind": "fleet"}) as run:
        run.parameters(about)
        run.metrics({"machines": len(fleet.machines), **{f"status/{k}": n for k, n in fleet.statuses.items()}})
        run.metrics({f"named/{row.effect}": row.named / row.of for row in fleet.effects})
        run.metrics({f"prevalence/{row.effect}": row.prevalence for row in fleet.effects})
        run.metrics({f"share/{row.group}": row.share for row in fleet.groups})
        run.table("machines", fleet.frame)
        run.table("effects", pd.DataFrame([plain(row) for row in fleet.effects]))
        for path in files:
            run.file(path)
        for machine in fleet.machines:
            tags = {"machine": machine.path}
            if not machine.diagnosed:
                with run.run(machine.path, {**tags, "kind": "gap", "status": machine.status, "reason": machine.reason}):
                    continue
            place = Path(out) / machine.path
            report = read_report(place)
            inner = _Inside(run, tags, float(report.provenance["runtime_s"]))
            track_report(inner, report, (place / "gap.json", place / "report.html"))


@dataclass(frozen=True)
class _Inside:
    """Tracker whose runs nest in a run, with further tags and the duration of work that is done."""

    parent: Run
    tags: Mapping[str, object]
    duration_s: float

    def run(self, name: str, tags: Mapping[str, object] | None = None) -> AbstractContextManager[Run]:
        """Open a run inside the parent."""
        return self.parent.run(name, {**(tags or {}), **self.tags}, duration_s=self.duration_s)
