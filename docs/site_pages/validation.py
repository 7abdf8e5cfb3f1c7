"""The page of the validation: scores of the current blind study, read from its result file.

reports/gap/studyN/study.json or study.md --tables by heading--> scores with targets, methods side by side, figure
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from site_pages.markdown import safe, table

Row = Mapping[str, str]

HEAD = """# Validation

A blind study says how well the diagnosis does on machines that nobody has seen. A generator that shares no code with
the twins or the diagnosis makes the machines: other dynamics, other ranges, several bearings and sampling rates. What
each machine has and its twin lacks is sealed by its hash before any of them is diagnosed, and opened afterwards. A
third of the machines is diagnosed through finished simulated records in place of a twin. `twingap study blind` runs
such a study.

The numbers below are those of the current study, {cases} machines. All of them come from its
result file, `{link}`. Rates have exact (Clopper-Pearson) 95 % intervals.
"""

WORLDS: Final = """
Kinds of machines:

none
: The twin lacks nothing that a catalogue could name.

single, pair, crowd
: One, two, three to five effects of the catalogue are missing.

outside
: What is missing is no effect of the catalogue.

outside_plus
: The same, and effects of the catalogue are missing too.

path, lines
: The machine's path has eight or more modes and is not of minimum phase, or its records hold 50 lines and more; the
  twin has one mode and no lines.

rich
: A machine with both and one or two other effects. The built-in twin lacks all of these; where simulated records are
  given, they have path and lines, too.

rich_none
: A machine with path and lines, and simulated records that have the same.
"""


def current_study(reports: Path) -> Path:
    """The result file of the latest study below reports/gap.

    Raises
    ------
    FileNotFoundError
        When there is none.
    """
    files = [*reports.glob("gap/study*/study.json"), *reports.glob("gap/study*/study.md")]
    files += [*reports.glob("gap/study.json"), *reports.glob("gap/study.md")]
    if not files:
        raise FileNotFoundError(f"no study.json or study.md below {reports / 'gap'}")

    def place(path: Path) -> tuple[int, bool]:
        found = re.search(r"(\d+)$", path.parent.name)
        return int(found[1]) if found else 10**9, path.suffix == ".json"

    return max(files, key=place)


def read_tables(path: Path) -> dict[str, list[Row]]:
    """Tables of a study by their heading, as text."""
    if path.suffix == ".json":
        from twingap.study.tables import markdown

        text = markdown(json.loads(path.read_text(encoding="utf-8")))
    else:
        text = path.read_text(encoding="utf-8")
    tables: dict[str, list[Row]] = {"": [{"text": text.split("\n\n")[1]}]}
    for section in text.split("\n## ")[1:]:
        heading, _, body = section.partition("\n")
        lines = [line for line in body.splitlines() if line.startswith("|")]
        if len(lines) < 3:
            continue
        head, *rows = ([cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines)
        tables[heading.strip()] = [dict(zip(head, row, strict=True)) for row in rows[1:]]
    return tables


def pages(docs: Path) -> dict[str, str]:
    """explanation/validation.md, and its figure."""
    path = current_study(docs.parent / "reports")
    tables = read_tables(path)
    draw(tables["Scores against targets"], docs / "explanation" / "scores.png")
    return {"explanation/validation.md": page(tables, path.relative_to(docs.parent).as_posix())}


def page(tables: Mapping[str, Sequence[Row]], path: str) -> str:
    """The page."""
    found = re.search(r"(\d+) (worlds|machines|cases)", tables[""][0]["text"])
    head = HEAD.replace("{cases}", found[1] if found else "many").replace("{link}", path)
    rates = [row for row in tables["Scores against targets"] if drawn(row) is not None]
    parts = [
        head,
        WORLDS,
        "## Scores against targets\n",
        "```{figure} scores.png\n:alt: Scores of the study with their intervals and targets\n:class: card\n\n"
        "Scores between 0 and 1 with their 95 % intervals; bars are the targets. The table has the numbers.\n```\n"
        if rates
        else "",
        table([{key: _shown(value) for key, value in row.items()} for row in tables["Scores against targets"]]),
        "Of a machine with one missing effect, *first-named right* counts the machines where that effect comes first. "
        "*Closure over true closure* compares what the named effects close with what the true ones close.\n",
    ]
    sections = {
        "Rivals on the same worlds": "Other methods on the same machines. Those that learn were taught by simulated "
        "machines of the generator.",
        "Statuses by kind of world": "What was concluded, by kind of machine.",
        "Outside the catalogue": "What was missing and is no effect of the catalogue, and how often it was recognised.",
        "Reliability of probabilities": "Probabilities that were stated for effects, and how often these were missing "
        "indeed.",
        "By effect": "Machines in which each effect was found, by its strength.",
    }
    titles = {
        "Rivals on the same worlds": "Other methods",
        "Statuses by kind of world": "Statuses",
        "By effect": "Effects",
    }
    for heading, about in sections.items():
        if rows := tables.get(heading):
            parts += [f"## {titles.get(heading, heading)}\n", about + "\n"]
            parts += [table([{key: _shown(value) for key, value in row.items()} for row in rows])]
    return "\n".join(parts)


def _shown(value: str) -> str:
    """A cell; numbers that are 0 to three decimals are shown so."""
    value = re.sub(r"\b0\.000\d+\b", "0.000", value)
    return value if value.startswith("**") else safe(value)


def drawn(row: Row) -> tuple[float, float, float] | None:
    """Value and interval of a score between 0 and 1; None for others."""
    interval = re.fullmatch(r"(\S+) to (\S+)", row["95 % interval"])
    try:
        value = float(row["value"])
    except ValueError:
        return None
    if interval is None or value > 1 or "bound" in row["score"]:
        return None
    return value, float(interval[1]), float(interval[2])


def draw(rows: Sequence[Row], path: Path) -> None:
    """Scores with intervals and targets, in a PNG file."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    shown = [(row, found) for row in rows if (found := drawn(row)) is not None]
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(8.5, 0.42 * len(shown) + 1.2), layout="constrained")
    for place, (row, (value, low, high)) in enumerate(shown):
        axes.plot([low, high], [place, place], color="#0072b2", linewidth=2.5)
        axes.plot(value, place, "o", color="#0072b2", markersize=7)
        if target := re.search(r"(at most|at least) ([\d.]+)", row["target"]):
            axes.plot([float(target[2])] * 2, [place - 0.36, place + 0.36], color="#d55e00", linewidth=3)
    axes.set_yticks(range(len(shown)), [f"{row['score']} ({row['among']})" for row, _ in shown], fontsize=11)
    axes.invert_yaxis()
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("score (dot), 95 % interval (line), target (bar)", fontsize=11)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=100)
    plt.close(figure)
