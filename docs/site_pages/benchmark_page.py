"""The page of the benchmarks, from the result file that `twingap bench --out` writes.

reports/bench/bench.json --> table, targets and notes of each benchmark; chart of the targets
"""

from __future__ import annotations

from pathlib import Path

from benchmarks import _written


def pages(docs: Path) -> dict[str, str]:
    """explanation/benchmarks.md, and its chart."""
    reports = _written.read(docs.parent / "reports" / "bench" / "bench.json")
    _written.draw(reports, docs / "explanation" / "benchmarks.svg")
    return {"explanation/benchmarks.md": _written.page(reports, "benchmarks.svg")}
