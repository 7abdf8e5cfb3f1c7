"""Structure of the code: imports run one way, and no files import each other in a circle."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = {"twingap": ROOT / "shared" / "twingap", "papers": ROOT / "papers", "benchmarks": ROOT / "benchmarks"}
LAYERS = (
    ("errors", "streams", "_compiled", "trees"),
    ("files", "bearing", "provenance", "config"),
    ("records", "track"),
    ("signal", "sweep", "effects", "data", "rigs"),
    ("twins",),
    ("identification",),
    ("gap", "adapt", "prognosis"),
    ("study", "fleet"),
    ("cli",),
)
"""Parts of twingap from the bottom up; each imports those below it and its neighbours."""


def modules() -> dict[str, Path]:
    """Dotted name -> file of every module."""
    found = {}
    for package, folder in SOURCES.items():
        for path in folder.rglob("*.py"):
            parts = (package, *path.relative_to(folder).with_suffix("").parts)
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(path: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module is not None and node.level == 0:
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                if name in known or node.module in known:
                    yield name if name in known else node.module  # a module, or a name in one


@pytest.fixture(scope="module")
def graph() -> dict[str, set[str]]:
    """Module -> modules that it imports; `twingap` itself, which imports its verbs on use, is left out."""
    known = modules()
    del known["twingap"]
    return {name: set(imported(path, known)) - {name} for name, path in known.items()}


def test_no_files_import_each_other_in_a_circle(graph: dict[str, set[str]]) -> None:
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_imports_run_from_the_command_line_to_the_records(graph: dict[str, set[str]]) -> None:
    floor = {part: number for number, layer in enumerate(LAYERS) for part in layer}
    upwards = [
        f"{name} imports {other}"
        for name, others in graph.items()
        for other in others
        if name.startswith("twingap.") and other.startswith("twingap.")
        and floor[name.split(".")[1]] < floor[other.split(".")[1]]
    ]  # fmt: skip
    assert not upwards


def test_the_core_knows_no_paper_and_no_benchmark(graph: dict[str, set[str]]) -> None:
    allowed = {"twingap.cli.run", "twingap.cli.bench"}
    knowing = {n for n, others in graph.items() for o in others if n.startswith("twingap") and "twingap" not in o}
    assert knowing <= allowed
