"""Reality knows nothing of the twins, nor they of it: no import either way, written or through importlib."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import twingap

ROOT = Path(twingap.__file__).parent
RIGS_MAY = {"_compiled", "bearing", "records", "streams", "errors", "files", "rigs"}
MAY_NOT_KNOW_RIGS = ("effects", "twins", "identification", "adapt", "gap", "signal")


def modules(package: str) -> list[Path]:
    place = ROOT / package
    return sorted(place.rglob("*.py")) if place.is_dir() else [p for p in [ROOT / f"{package}.py"] if p.exists()]


def imported(source: str, module: str) -> Iterator[str]:
    """Dotted names of everything a module imports; "?" for an import by a name that is computed."""
    package = module.split(".")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level] if node.level else []
            whole = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{whole}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in ("import_module", "__import__", "reload", "spec_from_file_location", "run_module", "run_path"):
                first = node.args[0] if node.args else None
                if isinstance(first, ast.JoinedStr) and first.values:  # "twingap.adapt." and whatever lies below
                    first = first.values[0]
                    whole = isinstance(first, ast.Constant) and str(first.value).endswith(".")
                    yield f"{first.value}any" if whole and isinstance(first, ast.Constant) else "?"
                    continue
                yield first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else "?"


def parts_of_twingap(path: Path) -> set[str]:
    """First-level parts of twingap that a module reaches."""
    module = ".".join(["twingap", *path.relative_to(ROOT).with_suffix("").parts])
    reached = set()
    for name in imported(path.read_text(encoding="utf-8"), module):
        if name == "?":
            reached.add("?")
        elif name == "twingap" or name.startswith("twingap."):
            reached.add([*name.split("."), "(package)"][1])
    return reached


@pytest.mark.parametrize("path", modules("rigs"), ids=lambda p: p.name)
def test_rigs_import_only_the_ground_floor(path: Path) -> None:
    assert parts_of_twingap(path) <= RIGS_MAY


@pytest.mark.parametrize("path", [p for part in MAY_NOT_KNOW_RIGS for p in modules(part)], ids=lambda p: p.stem)
def test_simulators_and_diagnosis_do_not_know_the_rigs(path: Path) -> None:
    reached = parts_of_twingap(path)
    assert "rigs" not in reached and "?" not in reached


def test_no_detour_leads_from_the_rigs_to_the_twins() -> None:
    """Whatever the rigs reach, through however many modules, is neither simulator nor diagnosis."""
    reached, waiting = {"rigs"}, ["rigs"]
    while waiting:
        for path in modules(waiting.pop()):
            found = parts_of_twingap(path) - reached
            reached |= found
            waiting += found
    assert not reached & {*MAY_NOT_KNOW_RIGS, "?"}
    assert reached >= RIGS_MAY, "the walk went nowhere"


@pytest.mark.parametrize(
    "source",
    [
        "import twingap.twins.contact",
        "from twingap import twins",
        "from ..twins import contact",
        "from .. import twins",
        "import importlib\nimportlib.import_module('twingap.twins')",
        "from importlib import import_module as import_module\nimport_module('twingap.twins.base')",
        "__import__('twingap.twins')",
        "def late():\n    from twingap.twins.base import Twin",
    ],
)
def test_the_walk_sees_every_way_in(source: str) -> None:
    assert any(name.startswith("twingap.twins") for name in imported(source, "twingap.rigs.machine"))


def test_the_walk_sees_computed_names() -> None:
    assert "?" in set(imported("import importlib\nimportlib.import_module('twin' + 'gap.twins')", "twingap.rigs.x"))
