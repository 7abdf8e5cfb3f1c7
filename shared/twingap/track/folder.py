"""Tracker that stores runs as plain folders, for tests and for work without a tracking library."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from twingap import files
from twingap.provenance import versions
from twingap.track.tidy import clean_file
from twingap.track.tracker import Run, Status, ending


class FolderTracker:
    """Tracker that stores runs as folders: ``parameters.json``, ``metrics.csv``, ``tags.json``, artifacts, ``runs/``.

    Parameters
    ----------
    root : path-like
        Created when missing.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        self.root = Path(root)

    @contextmanager
    def run(self, name: str, tags: Mapping[str, object] | None = None) -> Iterator[Run]:
        """A run in a new folder of the root, ``000-name``, ``001-name``, ..."""
        with ending(_FolderRun(self.root, name)) as run:
            run.tags({**{f"version.{k}": v for k, v in versions().items()}, **(tags or {})})
            yield run


class _FolderRun(Run):
    def __init__(self, root: Path, name: str) -> None:
        super().__init__()
        root.mkdir(parents=True, exist_ok=True)
        number = sum(1 for p in root.iterdir() if p.is_dir())
        self.folder = root / f"{number:03d}-{clean_file(name)}"
        self.folder.mkdir()
        self._tags({"name": name, "status": "RUNNING"})

    def _parameters(self, values: Mapping[str, str]) -> None:
        self._merge("parameters.json", values)

    def _metrics(self, values: Mapping[str, float], step: int) -> None:
        with (self.folder / "metrics.csv").open("a", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([name, step, repr(value)] for name, value in values.items())

    def _tags(self, values: Mapping[str, str]) -> None:
        self._merge("tags.json", values)

    def _file(self, path: Path, folder: str, kind: Literal["file", "table", "image"] = "file") -> None:
        with files.replacing(self.folder / folder / path.name) as target:
            target.write_bytes(path.read_bytes())

    def _child(self, name: str, duration_s: float | None) -> Run:
        child = _FolderRun(self.folder / "runs", name)
        if duration_s is not None:
            child._tags({"duration_s": repr(duration_s)})
        return child

    def _end(self, status: Status) -> None:
        self._tags({"status": status})

    def _merge(self, name: str, values: Mapping[str, str]) -> None:
        place = self.folder / name
        held = json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
        with files.replacing(place) as target:
            target.write_text(json.dumps({**held, **values}, indent=1, ensure_ascii=False), encoding="utf-8")
