"""The page of the benchmarks, from the result file that `twingap bench --out` writes.

reports/bench/bench.json --> table, targets and notes of each benchmark; chart of the targets
"""

from __future__ import annotations

from pathlib import Path

from benchmarks import _written


def pages(docs: Path) -> dict[str, str]:
    """explanation/benchmarks.md, and its chart; before anything was measured, how to measure it."""
    path = docs.parent / "reports" / "bench" / "bench.json"
    reports = _written.read(path) if path.exists() else []
    if reports:
        _written.draw(reports, docs / "explanation" / "benchmarks.svg")
    return {"explanation/benchmarks.md": _written.page(reports, "benchmarks.svg")}
