"""A diagnosis as a tracked run, so that several diagnoses compare.

GapReport + files --track_report--> Run: parameters (verdict, twin, records, seed), metrics (p-value, closures, gaps),
                                    tables (where, which, shrink), artifacts (gap.json, report.html)
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from twingap.gap.report.model import GapReport

if TYPE_CHECKING:
    from twingap.track import Tracker

_OWN_PLACE = ("runtime_s", "records_sha256")
"""Entries of the provenance that are no settings: logged as a metric and as data."""


def track_report(tracker: Tracker, report: GapReport, files: Iterable[str | os.PathLike[str]] = ()) -> None:
    """Log a diagnosis as a run, named by records, twin and seed.

    It nests in `tracker` if that is a run. `files`, such as gap.json and report.html, are kept with the run.

    Raises
    ------
    TwingapError
        When the tracker's store cannot be written.
    """
    verdict, stated = report.verdict, report.provenance
    records, effects = str(stated.get("records", "")), ", ".join(verdict.effects)
    words = (records, stated.get("twin"), f"seed {stated.get('seed', 0)}", "quick" if stated.get("quick") else "")
    name = " · ".join(str(word) for word in words if word)
    with tracker.run(name, {"kind": "gap", "status": verdict.status, "effects": effects}) as run:
        run.parameters({
            "status": verdict.status, "effects": effects,
            "closest": ", ".join(effect.effect for effect in report.closest.effects),
            "confidence_set": json.dumps([list(names) for names in verdict.confidence_set], ensure_ascii=False),
            **{key: value for key, value in stated.items() if key not in _OWN_PLACE},
        })  # fmt: skip
        run.metrics(_metrics(report))
        run.data(records or "records", str(stated["records_sha256"]))
        for table, frame in (("where", report.where), ("which", report.which), ("shrink", report.shrink)):
            # Tables in a cell of a CSV file as JSON.
            plain = frame.map(lambda cell: json.dumps(cell, ensure_ascii=False) if isinstance(cell, dict) else cell)
            run.table(table, plain)
        run.text("verdict.md", "\n\n".join((report.sentence, *report.notes)) + "\n")
        for path in files:
            run.file(path)


def _metrics(report: GapReport) -> dict[str, Any]:
    """Numbers to compare diagnoses by. A closure that is not defined counts as not measured."""
    found: dict[str, Any] = {
        "p_value": report.verdict.p_value, "closure": report.verdict.closure,
        "explanations": len(report.verdict.confidence_set), "places": len(report.places),
        "rest_places": len(report.rest), "runtime_s": report.provenance["runtime_s"],
    }  # fmt: skip
    for metric in report.metrics:
        found |= {f"before/{metric.metric}": metric.before, f"after/{metric.metric}": metric.after}
        found |= {f"floor/{metric.metric}": metric.floor, f"closure/{metric.metric}": metric.closure}
    for c in report.candidates:
        found |= {f"probability/{c.effect}": c.probability, f"candidate_closure/{c.effect}": c.closure}
    if report.closest.attribution:
        found["closest_closure"] = report.closest.closure
        found |= {f"closest/{metric.metric}": metric.after for metric in report.closest.metrics}
        found |= {f"share/{share.group}": share.share for share in report.closest.attribution}
    found |= {f"test_p/{test.name}": test.p_value for test in report.tests}
    found |= {f"calibration/{name}": p.value for name, p in report.calibration.items()}
    return found
