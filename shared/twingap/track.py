"""Tracking: what a run was given, what it made, and where both are kept.

Tracker --run("paper3")--> Run --run("seed 0")--> Run ...      parameters, metrics, tables, figures, data, files

The library and the papers speak to `Run` alone; this module alone knows MLflow, and imports it only when asked for.

Parallel work never races on the database, because workers do not log: they return results and the parent logs them
(`twingap.sweep` calls `on_result` in the parent). A `Run` is therefore used from the process that opened it.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import sqlite3
import tempfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Protocol

import filelock
import pandas as pd

from twingap.errors import TwingapError
from twingap.provenance import plain, versions
from twingap.tidy import clean_file, clean_name, flat_table, flatten

Status = Literal["FINISHED", "FAILED", "KILLED"]
LONGEST_VALUE = 6000
"""Characters of a parameter's value that MLflow keeps; longer ones go whole into an artifact."""


class Tracker(Protocol):
    """Somewhere runs are kept."""

    def run(self, name: str, tags: Mapping[str, object] | None = None) -> AbstractContextManager[Run]:
        """Open a run; it ends with the block: FINISHED, FAILED (an exception) or KILLED (interrupted)."""
        ...


class Run(ABC):
    """One run, open inside its ``with`` block. It is a `Tracker` too: runs nest.

    A tracker for another library implements the six methods with an underscore; what a table or a figure becomes is
    settled here, the same for all.
    """

    def parameters(self, values: object, prefix: str = "") -> None:
        """Log settings.

        Parameters
        ----------
        values : mapping or dataclass
            Nested tables become dotted names. A value longer than `LONGEST_VALUE` characters is cut, and kept whole
            as the artifact ``parameters/<name>.txt``.
        prefix : str
            Put before every name.
        """
        flat = flatten(plain(values), prefix)
        texts = {self._name(k): v if isinstance(v, str) else json.dumps(v, ensure_ascii=False) for k, v in flat.items()}
        for name, text in texts.items():
            if len(text) > LONGEST_VALUE:
                self.text(f"parameters/{name}.txt", text)
                texts[name] = text[: LONGEST_VALUE - 20] + f" ... ({len(text)} long)"
        self._parameters(texts)

    def metrics(self, values: Mapping[str, float | int | None], step: int = 0) -> None:
        """Log numbers. None and NaN mean "not measured": they are named in the tag ``not_measured``, not plotted.

        Parameters
        ----------
        values : mapping
            Name -> number. Characters that no tracking library takes are replaced ("%" by "percent").
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
        """Log which data went in.

        Parameters
        ----------
        name : str
            Of the record set, manifest or file.
        sha256 : str
            Its digest, from `twingap.provenance.digest_of_records` or `digest_of_path`.
        role : str
            What it was used for: "training", "test", "manifest", ...
        source : str
            Where it can be had.
        """
        self.tags({f"data.{role}.{name}": sha256})

    def twin(self, toml: str, name: str = "twin.toml") -> None:
        """Log the twin that made the records: its TOML text."""
        self.text(f"twin/{name}", toml)

    def text(self, name: str, text: str) -> None:
        """Log a text as the artifact `name`, which may name folders: ``notes/reading.md``."""
        place = Path(name)
        with tempfile.TemporaryDirectory() as folder:
            written = Path(folder) / clean_file(place.name)
            written.write_text(text, encoding="utf-8")
            self._file(written, "" if str(place.parent) == "." else place.parent.as_posix())

    def file(self, path: str | os.PathLike[str], folder: str = "") -> None:
        """Log any file, or a folder with all it holds, under the artifact folder `folder`."""
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
        """Log words to find the run by."""
        self._tags({self._name(key): str(value) for key, value in values.items()})

    @contextmanager
    def run(self, name: str, tags: Mapping[str, object] | None = None) -> Iterator[Run]:
        """Open a run inside this one."""
        with ending(self._child(name)) as child:
            child.tags(tags or {})
            yield child

    def __init__(self) -> None:
        self._missing: set[str] = set()
        self._names: dict[str, str] = {}

    def _name(self, name: str) -> str:
        """A clean name, kept apart from another that would become the same."""
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
    def _child(self, name: str) -> Run: ...
    @abstractmethod
    def _end(self, status: Status) -> None: ...


@contextmanager
def ending(run: Run) -> Iterator[Run]:
    """End the run as its block ended."""
    try:
        yield run
    except KeyboardInterrupt:
        run._end("KILLED")
        raise
    except BaseException:
        run._end("FAILED")
        raise
    run._end("FINISHED")


class NullTracker:
    """Keeps nothing: the default of library functions that can log."""

    @contextmanager
    def run(self, name: str, tags: Mapping[str, object] | None = None) -> Iterator[Run]:
        """A run that forgets all it is told."""
        yield _NullRun()


class _NullRun(Run):
    def _parameters(self, values: Mapping[str, str]) -> None: ...
    def _metrics(self, values: Mapping[str, float], step: int) -> None: ...
    def _tags(self, values: Mapping[str, str]) -> None: ...
    def _file(self, path: Path, folder: str, kind: Literal["file", "table", "image"] = "file") -> None: ...
    def _child(self, name: str) -> Run:
        return _NullRun()

    def _end(self, status: Status) -> None: ...


class MlflowTracker:
    """Keeps runs in MLflow: an SQLite file by default, or any tracking server.

    Parameters
    ----------
    uri : str, optional
        As MLflow writes it: ``sqlite:///runs/mlflow.db``, ``http://server:5000``, ``postgresql://...``. Default:
        ``MLFLOW_TRACKING_URI``, else ``mlflow.db`` in `state_folder`. Artifacts of an SQLite store lie beside it.
    experiment : str
        Made when missing.

    Raises
    ------
    TwingapError
        When the store cannot be reached (told within seconds), written, or read.
    """

    def __init__(self, uri: str | None = None, experiment: str = "twingap") -> None:
        self.uri, self.experiment = tracking_uri(uri), experiment
        database = sqlite_path(self.uri)
        if database is None:
            with _patience(retries=0, seconds=5):
                self._open(None)
            return
        self.uri = f"sqlite:///{database}"
        _check_sqlite(database)
        # Two processes that open a fresh store at once would both create its tables.
        with filelock.FileLock(database.with_name(database.name + ".lock"), timeout=120):
            self._open(database.parent / "artifacts" / clean_file(experiment))

    def _open(self, artifacts: Path | None) -> None:
        with _explained(self.uri):
            self._client = _quiet_mlflow().MlflowClient(self.uri)
            found = self._client.get_experiment_by_name(self.experiment)
            if found is None:
                place = None if artifacts is None else artifacts.as_uri()
                self._id = _created(self._client, self.experiment, place)
            elif found.lifecycle_stage != "active":
                raise TwingapError(
                    f"experiment {self.experiment!r} was deleted",
                    where=self.uri,
                    mend=f"bring it back with: mlflow experiments restore --experiment-id {found.experiment_id}",
                )
            else:
                self._id = found.experiment_id

    @contextmanager
    def run(self, name: str, tags: Mapping[str, object] | None = None) -> Iterator[Run]:
        """A run of the experiment, with the versions of all that computes."""
        with ending(_MlflowRun(self._client, self.uri, self._id, name, None)) as run:
            run.tags({**{f"version.{k}": v for k, v in versions().items()}, **(tags or {})})
            yield run


class _MlflowRun(Run):
    def __init__(self, client: Any, uri: str, experiment_id: str, name: str, parent: str | None) -> None:
        super().__init__()
        self._client, self._uri, self._experiment_id = client, uri, experiment_id
        self._listed: list[dict[str, str]] = []
        tags = {} if parent is None else {"mlflow.parentRunId": parent}
        with _explained(uri):
            self.id: str = client.create_run(experiment_id, run_name=name, tags=tags).info.run_id

    def data(self, name: str, sha256: str, role: str = "data", source: str = "") -> None:
        from mlflow.entities import Dataset, DatasetInput, InputTag

        super().data(name, sha256, role, source)
        # MLflow keeps 36 characters of a digest; the tag above has all 64.
        given = Dataset(
            name[:400], sha256[:32], "local", json.dumps({"uri": source}), profile=f'{{"sha256": "{sha256}"}}'
        )
        with _explained(self._uri):
            self._client.log_inputs(self.id, [DatasetInput(given, [InputTag("mlflow.data.context", role[:400])])])

    def _parameters(self, values: Mapping[str, str]) -> None:
        from mlflow.entities import Param

        self._batch(params=[Param(name, value) for name, value in values.items()])

    def _metrics(self, values: Mapping[str, float], step: int) -> None:
        from mlflow.entities import Metric

        now = int(datetime.now(UTC).timestamp() * 1000)
        self._batch(metrics=[Metric(name, value, now, step) for name, value in values.items()])

    def _tags(self, values: Mapping[str, str]) -> None:
        from mlflow.entities import RunTag

        self._batch(tags=[RunTag(name, value[:5000]) for name, value in values.items()])

    def _batch(self, **what: list[Any]) -> None:
        (items,) = what.values()
        with _explained(self._uri):
            for begin in range(0, len(items), 100):  # MLflow takes 100 parameters or tags at once
                self._client.log_batch(self.id, **{key: values[begin : begin + 100] for key, values in what.items()})

    def _file(self, path: Path, folder: str, kind: Literal["file", "table", "image"] = "file") -> None:
        with _explained(self._uri):
            self._client.log_artifact(self.id, str(path), folder or None)
            if kind == "image":
                # Once more as an image with a key, which the UI lays side by side for several runs.
                import PIL.Image

                with PIL.Image.open(path) as image:
                    self._client.log_image(self.id, image, key=path.stem, step=0)
        if kind == "table":
            # What MLflow's log_table does, except that a table logged again replaces itself instead of growing.
            entry = {"path": f"{folder}/{path.name}", "type": "table"}
            listed = json.dumps([*self._listed, entry])
            if entry not in self._listed and len(listed) < 5000:
                self._listed.append(entry)
                self._tags({"mlflow.loggedArtifacts": listed})

    def _child(self, name: str) -> Run:
        return _MlflowRun(self._client, self._uri, self._experiment_id, name, self.id)

    def _end(self, status: Status) -> None:
        with _explained(self._uri):
            self._client.set_terminated(self.id, status)


def _quiet_mlflow() -> Any:
    """MLflow, without migration logs, usage reports, or minutes of silent retries (unless the user set those)."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "4")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "30")
    import mlflow

    for name in ("alembic", "mlflow"):
        logging.getLogger(name).setLevel(logging.ERROR)
    return mlflow


def _created(client: Any, experiment: str, artifacts: str | None) -> str:
    """The new experiment's id, or that of the one which another process made a moment ago."""
    from mlflow.exceptions import MlflowException

    try:
        return str(client.create_experiment(experiment, artifacts, {"mlflow.experimentKind": "custom_model_development"}))
    except MlflowException:
        found = client.get_experiment_by_name(experiment)
        if found is None:
            raise
        return str(found.experiment_id)


def _check_sqlite(database: Path) -> None:
    """Fail in one line where SQLAlchemy would fail in fifty."""
    mend = "choose a writable place with --tracking-uri, MLFLOW_TRACKING_URI or TWINGAP_HOME"
    try:
        database.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.closing(sqlite3.connect(database, timeout=30)) as connection:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("PRAGMA user_version")
            connection.rollback()
    except (OSError, sqlite3.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise TwingapError(f"the tracking database cannot be used: {reason}", where=database, mend=mend) from error


@contextmanager
def _patience(retries: int, seconds: int) -> Iterator[None]:
    """Within the block MLflow gives up soon."""
    wanted = {"MLFLOW_HTTP_REQUEST_MAX_RETRIES": str(retries), "MLFLOW_HTTP_REQUEST_TIMEOUT": str(seconds)}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _explained(uri: str) -> Iterator[None]:
    """Turn what a tracking store can raise into the one error that users see."""
    try:
        yield
    except TwingapError:
        raise
    except Exception as error:
        line = str(error).strip().partition("\n")[0][:300] or type(error).__name__
        if "Max retries exceeded" in line or "Connection" in type(error).__name__:
            line = "the tracking server does not answer"
        mend = "start it, or choose another with --tracking-uri or MLFLOW_TRACKING_URI"
        raise TwingapError(line, where=f"tracking store {uri}", mend=mend) from error


def state_folder() -> Path:
    """Where runs made here are kept: ``TWINGAP_HOME``, or ``.twingap`` in the current folder."""
    return Path(os.environ.get("TWINGAP_HOME") or ".twingap").absolute()


def tracking_uri(uri: str | None = None) -> str:
    """The tracking store in use: `uri`, else ``MLFLOW_TRACKING_URI``, else SQLite in the state folder."""
    return uri or os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{state_folder() / 'mlflow.db'}"


def sqlite_path(uri: str) -> Path | None:
    """The database file of a ``sqlite:///`` address; None for any other."""
    return Path(uri.removeprefix("sqlite:///").split("?")[0]).absolute() if uri.startswith("sqlite:///") else None
