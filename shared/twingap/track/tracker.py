"""Tracking of runs: their inputs, their results, and the store of both.

Tracker --run("paper3")--> Run --run("seed 0")--> Run ...      parameters, metrics, tables, figures, data, files

The library and the papers use `Run` alone; `twingap.track.mlflow` alone uses MLflow.

Parallel work never races on the database, because workers do not log: they return results and the parent logs them
(`twingap.sweep` calls `on_result` in the parent). A `Run` is therefore used only in the process that opened it.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import tempfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Literal, Protocol

import pandas as pd

from twingap.errors import TwingapError
from twingap.provenance import plain
from twingap.track.tidy import clean_file, clean_name, flat_table, flatten

Status = Literal["FINISHED", "FAILED", "KILLED"]
LONGEST_VALUE = 6000
"""Characters of a parameter's value that MLflow keeps; longer ones are stored in full as an artifact."""


class Tracker(Protocol):
    """A store of runs."""

    def run(self, name: str, tags: Mapping[str, object] | None = None) -> AbstractContextManager[Run]:
        """Open a run; it ends with the block: FINISHED, FAILED (an exception) or KILLED (interrupted)."""
        ...


class Run(ABC):
    """One run, open inside its ``with`` block. It is a `Tracker` too: runs nest.

    A tracker for another library implements the six methods with an underscore; the form of tables and figures is
    defined here, the same for all.
    """

    def parameters(self, values: object, prefix: str = "") -> None:
        """Log settings.

        Parameters
        ----------
        values : mapping or dataclass
            Nested tables get dotted names. A value longer than `LONGEST_VALUE` characters is cut, and stored in full
            as the artifact ``parameters/<name>.txt``.
        prefix : str
            Prefix of every name.
        """
        flat = flatten(plain(values), prefix)
        texts = {self._name(k): v if isinstance(v, str) else json.dumps(v, ensure_ascii=False) for k, v in flat.items()}
        for name, text in texts.items():
            if len(text) > LONGEST_VALUE:
                self.text(f"parameters/{name}.txt", text)
                texts[name] = text[: LONGEST_VALUE - 20] + f" ... ({len(text)} long)"
        self._parameters(texts)

    def metrics(self, values: Mapping[str, float | int | None], step: int = 0) -> None:
        """Log numbers. None and NaN mean "not measured": they are listed in the tag ``not_measured``, not plotted.

        Parameters
        ----------
        values : mapping
            Name -> number. Characters that some tracking library does not accept are replaced ("%" by "percent").
        step : int
            Epoch, iteration or seed: the horizontal axis of the metric's curve.
        """
        numbers = {self._name(k): math.nan if v is None else float(v) for k, v in values.items()}
        known = {k: v for k, v in numbers.items() if not math.isnan(v)}
        if len(known) < len(numbers):
            self._missing |= numbers.keys() - known.keys()
            self._tags({"not_measured": ", ".join(sorted(self._missing))})
        self._metrics(known, step)

    def table(self, name: str, frame: pd.DataFrame) -> None:
        """Log a table as ``tables/<name>.json`` (which the MLflow UI shows and compares) and ``tables/<name>.csv``."""
        flat = flat_table(frame)
        with tempfile.TemporaryDirectory() as folder:
            base = Path(folder) / clean_file(name)
            flat.to_csv(base.with_name(base.name + ".csv"), index=False)
            as_json = base.with_name(base.name + ".json")
            flat.to_json(as_json, orient="split", index=False, date_format="iso", double_precision=15)
            self._file(base.with_name(base.name + ".csv"), "tables")
            self._file(as_json, "tables", kind="table")

    def figure(self, name: str, figure: Any) -> None:
        """Log a matplotlib figure (``figures/<name>.png`` and ``.svg``) or a plotly one (``.html``, works offline)."""
        with tempfile.TemporaryDirectory() as folder:
            base = Path(folder) / clean_file(name)
            if hasattr(figure, "savefig"):
                png, svg = base.with_name(base.name + ".png"), base.with_name(base.name + ".svg")
                figure.savefig(png, dpi=150, bbox_inches="tight")
                figure.savefig(svg, bbox_inches="tight", metadata={"Date": None})
                self._file(svg, "figures")
                self._file(png, "figures", kind="image")
            elif hasattr(figure, "write_html"):
                html = base.with_name(base.name + ".html")
                figure.write_html(html, include_plotlyjs=True)
                self._file(html, "figures")
            else:
                raise TypeError(f"{type(figure).__name__} is neither a matplotlib nor a plotly figure")

    def data(self, name: str, sha256: str, role: str = "data", source: str = "") -> None:
        """Log the identity of input data.

        Parameters
        ----------
        name : str
            Name of the record set, manifest or file.
        sha256 : str
            Its digest, from `RecordSet.digest` or `twingap.provenance.digest_of_path`.
        role : str
            Use of the data: "training", "test", "manifest", ...
        source : str
            Where it can be obtained.
        """
        self.tags({f"data.{role}.{name}": sha256})

    def twin(self, toml: str, name: str = "twin.toml") -> None:
        """Log the twin that made the records, as TOML text."""
        self.text(f"twin/{name}", toml)

    def text(self, name: str, text: str) -> None:
        """Log a text as the artifact `name`, which may contain folders: ``notes/reading.md``."""
        place = Path(name)
        with tempfile.TemporaryDirectory() as folder:
            written = Path(folder) / clean_file(place.name)
            written.write_text(text, encoding="utf-8")
            self._file(written, "" if str(place.parent) == "." else place.parent.as_posix())

    def file(self, path: str | os.PathLike[str], folder: str = "") -> None:
        """Log any file, or a folder with its content, under the artifact folder `folder`."""
        place = Path(path)
        if place.is_dir():
            for inside in sorted(p for p in place.rglob("*") if p.is_file()):
                parent = Path(folder) / place.name / inside.parent.relative_to(place)
                self._file(inside, parent.as_posix())
        elif place.is_file():
            self._file(place, folder)
        else:
            raise TwingapError("is not there to be logged", where=place)

    def tags(self, values: Mapping[str, object]) -> None:
        """Log tags for finding the run."""
        self._tags({self._name(key): str(value) for key, value in values.items()})

    @contextmanager
    def run(
        self, name: str, tags: Mapping[str, object] | None = None, *, duration_s: float | None = None
    ) -> Iterator[Run]:
        """Open a run inside this one.

        Parameters
        ----------
        name : str
        tags : mapping, optional
        duration_s : float, optional
            How long the work took that is logged after it was done elsewhere, s; the run is shown with this duration.
        """
        with ending(self._child(name, duration_s)) as child:
            child.tags(tags or {})
            yield child

    def __init__(self) -> None:
        self._missing: set[str] = set()
        self._names: dict[str, str] = {}

    def _name(self, name: str) -> str:
        """A clean name, distinct from others that would become the same."""
        clean = clean_name(name)
        return clean if self._names.setdefault(clean, name) == name else f"{clean}-{zlib.crc32(name.encode()):08x}"

    @abstractmethod
    def _parameters(self, values: Mapping[str, str]) -> None: ...
    @abstractmethod
    def _metrics(self, values: Mapping[str, float], step: int) -> None: ...
    @abstractmethod
    def _tags(self, values: Mapping[str, str]) -> None: ...
    @abstractmethod
    def _file(self, path: Path, folder: str, kind: Literal["file", "table", "image"] = "file") -> None: ...
    @abstractmethod
    def _child(self, name: str, duration_s: float | None) -> Run: ...
    @abstractmethod
    def _end(self, status: Status) -> None: ...


@contextmanager
def ending(run: Run) -> Iterator[Run]:
    """End the run with the status of its block.

    Where a failed or interrupted run cannot be ended either (a full disk, an unreachable server), the block's own
    exception is raised.
    """
    try:
        yield run
    except KeyboardInterrupt:
        with contextlib.suppress(Exception):
            run._end("KILLED")
        raise
    except BaseException:
        with contextlib.suppress(Exception):
            run._end("FAILED")
        raise
    run._end("FINISHED")


class NullTracker:
    """Tracker that discards everything: the default of library functions that can log."""

    @contextmanager
    def run(self, name: str, tags: Mapping[str, object] | None = None) -> Iterator[Run]:
        """A run that discards everything that is logged."""
        yield _NullRun()


class _NullRun(Run):
    def _parameters(self, values: Mapping[str, str]) -> None: ...
    def _metrics(self, values: Mapping[str, float], step: int) -> None: ...
    def _tags(self, values: Mapping[str, str]) -> None: ...
    def _file(self, path: Path, folder: str, kind: Literal["file", "table", "image"] = "file") -> None: ...
    def _child(self, name: str, duration_s: float | None) -> Run:
        return _NullRun()

    def _end(self, status: Status) -> None: ...
