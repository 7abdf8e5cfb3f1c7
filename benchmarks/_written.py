"""Results of benchmarks as files: bench.json, a page of tables, and a chart of the targets.

report, report, ... --by name--> bench.json --> benchmarks.md, benchmarks.svg
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from twingap.errors import TwingapError
from twingap.files import replacing

SCHEMA: Final = "twingap.bench/1"
ABOUT: Final = """Each benchmark compares a hot path with a named peer in the same run, or with what the machine can do
at most. A busy machine slows both, so ratios mean more than figures. Run all of them, or one by name, with

```console
$ twingap bench --out benchmarks
$ twingap bench vmd --out benchmarks
```

The folder gets this page, the chart and `bench.json`; a benchmark that is run again replaces its former result.
"""
_LONGEST: Final = 100.0
"""Ratio at which bars of the chart end; a larger one leaves less room for those near 1."""

Report = Mapping[str, Any]


def machine() -> dict[str, Any]:
    """Processor and number of cores."""
    name = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {"processor": name, "cores": os.cpu_count()}


def read(path: Path) -> list[dict[str, Any]]:
    """Reports of a bench.json.

    Raises
    ------
    TwingapError
        When it is no such file.
    """
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        if table["schema"] != SCHEMA:
            raise ValueError(f"schema {table['schema']!r}")
        return list(table["benchmarks"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TwingapError(f"is no result of benchmarks: {error}", where=path, mend="name a new folder") from error


def write(reports: Sequence[Report], folder: Path) -> list[Path]:
    """Write bench.json, benchmarks.md and benchmarks.svg; benchmarks of a former bench.json stay unless run again.

    Returns
    -------
    list of Path
        The files.
    """
    held = folder / "bench.json"
    by_name: dict[str, Report] = {one["benchmark"]: one for one in read(held)} if held.exists() else {}
    by_name |= {one["benchmark"]: {**one, "machine": machine()} for one in reports}
    together = [by_name[name] for name in sorted(by_name)]
    with replacing(held) as temporary:
        text = json.dumps({"schema": SCHEMA, "benchmarks": together}, indent=1, ensure_ascii=False, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with replacing(folder / "benchmarks.md") as temporary:
        temporary.write_text(page(together, "benchmarks.svg"), encoding="utf-8")
    draw(together, folder / "benchmarks.svg")
    return [held, folder / "benchmarks.md", folder / "benchmarks.svg"]


def page(reports: Sequence[Report], chart: str) -> str:
    """Markdown: the chart, and for each benchmark its table, targets and notes."""
    parts = ["# Benchmarks\n", ABOUT]
    if any(targets(one) for one in reports):
        parts.append(f"![What was measured over what is promised, for each target]({chart})\n")
    for one in reports:
        parts += [f"## {one['benchmark'].replace('_', ' ')}\n", f"{_text(one['title'])}.\n", _table(one["rows"])]
        if one["targets"]:
            parts.append(_table([
                {"target": t["target"], "measured": t["measured"], "at least": t["at least"],
                 "met": "sizes of `--quick`" if one["quick"] else "yes" if t["met"] else "no"}
                for t in one["targets"]
            ]))  # fmt: skip
        parts += [f"{_text(note)}\n" for note in one["notes"]]
        on = one["machine"]
        parts.append(f"Measured on {_text(on['processor'])}, {on['cores']} cores.\n")
    return "\n".join(parts)


def targets(report: Report) -> list[tuple[str, float, bool]]:
    """Name, measured over promised, and whether it was met, of a report's targets that can be drawn."""
    return [
        (t["target"], t["measured"] / t["at least"], t["met"])
        for t in report["targets"]
        if not report["quick"] and t["measured"] and t["measured"] > 0
    ]


def draw(reports: Sequence[Report], path: Path) -> None:
    """Chart: for each target, what was measured over what is promised, on a logarithmic axis."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = [(f"{one['benchmark']}: {name}", ratio, met) for one in reports for name, ratio, met in targets(one)]
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "twingap", "font.size": 9}):
        figure = Figure(figsize=(10, 0.26 * len(shown) + 1), layout="constrained")
        axes = figure.add_subplot()
        least = min([0.5, *(0.7 * ratio for _, ratio, _ in shown if ratio > 0)])
        axes.set_xscale("log")
        axes.set_xlim(least, _LONGEST)
        for place, (_, ratio, met) in enumerate(shown):
            end = min(max(ratio, least), _LONGEST)
            bars = axes.barh(place, end - 1, left=1, height=0.6, color="#0072b2" if met else "#d55e00")
            if not met:
                bars[0].set(hatch="//", edgecolor="white")
            axes.text(max(end, 1), place, f" {ratio:.3g}", va="center", fontsize=7, clip_on=False)
        axes.axvline(1, color="black", linewidth=1)
        axes.set_yticks(range(len(shown)), [name if len(name) < 90 else f"{name[:87]}..." for name, *_ in shown])
        axes.set_ylim(len(shown) - 0.4, -0.6)
        axes.set_xlabel(f"measured over promised (line: 1; hatched: missed; bars end at {_LONGEST:g})")
        axes.spines[["top", "right"]].set_visible(False)
        with replacing(path) as temporary:
            figure.savefig(temporary, format="svg", metadata={"Date": None})


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""
    head = list(dict.fromkeys(name for row in rows for name in row))
    lines = ["| " + " | ".join(_text(name) for name in head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(_text(row.get(name, "")) for name in head) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _text(value: Any) -> str:
    """One line of Markdown in which nothing is markup but code."""
    shown = "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
    parts = " ".join(shown.split()).replace("|", "\\|").split("`")
    for i in range(0, len(parts), 2):
        for mark in "*_<[":
            parts[i] = parts[i].replace(mark, "\\" + mark)
    return "`".join(parts)
