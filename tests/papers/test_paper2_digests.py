"""Keys of stored results hold all of twingap's and the paper's shared code that a study's jobs are computed by."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import papers
import twingap
from papers.paper2_digital_twin import availability, dynamics, live, transfer_gap

FOLDERS = {"twingap": Path(twingap.__file__).parent, "papers": Path(papers.__file__).parent}
PLUMBING = tuple(
    f"twingap.{name}" for name in ("config", "data", "errors", "files", "provenance", "records", "sweep", "track")
)
"""Reads, holds, writes and schedules: what a job is given has a key of its own."""
TRAINING = tuple(f"twingap.adapt.{name}" for name in ("alignment", "dann", "mode_network", "nets"))
"""Networks and losses of `adapt.training` that the Inception network does without."""
SHARED = ("twingap.", "papers.paper2_digital_twin.methods", "papers.paper2_digital_twin.live_twin",
          "papers.paper2_digital_twin.contact_motion")  # fmt: skip
"""Code that computes; the other modules of the paper lay out studies and show what came out."""


class StoppedError(Exception):
    """Brings what was asked to be digested."""


def files_of(part: Any) -> list[Path]:
    """Those that `digest_of_code` reads."""
    module = part if isinstance(part, ModuleType) else inspect.getmodule(part)
    assert module is not None and module.__file__ is not None
    own = Path(module.__file__)
    return sorted(own.parent.rglob("*.py")) if own.name == "__init__.py" else [own]


def imported(path: Path) -> Iterator[str]:
    """Modules of `SHARED` code that a file imports, now or later, without what only checks types."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typing = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if node in typing:
            continue
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.startswith(SHARED))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in FOLDERS:
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                name = name if home(name).exists() else node.module
                if name.startswith(SHARED):
                    yield name


def home(name: str) -> Path:
    """File of a module."""
    package, *parts = name.split(".")
    place = FOLDERS[package].joinpath(*parts)
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


@pytest.mark.parametrize(
    ("study", "not_called"),
    [(dynamics, ()), (live, ()), (availability, TRAINING), (transfer_gap, TRAINING)],
    ids=["dynamics", "live", "availability", "transfer_gap"],
)
def test_a_digest_of_code_holds_what_its_code_imports(
    study: ModuleType, not_called: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def digest_of_code(*parts: Any) -> str:
        raise StoppedError(parts)

    config = tmp_path / "study.toml"
    text = study.CONFIG.read_text(encoding="utf-8")
    config.write_text(text.replace("rig_duration_s = 4.0", "rig_duration_s = 0.8"), encoding="utf-8")
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    monkeypatch.setattr(study, "digest_of_code", digest_of_code)
    with pytest.raises(StoppedError) as stopped:
        study.run("smoke", out=tmp_path / "out", backend="sequential", config=config)
    held = {path for part in stopped.value.args[0] for path in files_of(part)}
    own = held - {Path(str(study.__file__))}  # the study itself also reads, draws and writes
    needed = {name for path in own for name in imported(path) if not name.startswith(PLUMBING + not_called)}
    assert len(needed) > 10 and {home(name) for name in needed} <= held
