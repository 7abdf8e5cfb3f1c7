"""Tracker that stores runs in MLflow; the only module that imports MLflow, when a tracker is made."""

from __future__ import annotations

import json
import logging
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import filelock

from twingap.errors import TwingapError
from twingap.provenance import versions
from twingap.track.database import check_database, make_database
from twingap.track.store import sqlite_path, tracking_uri
from twingap.track.tidy import clean_file
from twingap.track.tracker import Run, Status, ending

_ONE_AT_A_TIME = threading.Lock()


class MlflowTracker:
    """Tracker that stores runs in MLflow: an SQLite file by default, or any tracking server.

    Parameters
    ----------
    uri : str, optional
        MLflow's tracking URI: ``sqlite:///runs/mlflow.db``, ``http://server:5000``, ``postgresql://...``. Default:
        ``MLFLOW_TRACKING_URI``, else ``mlflow.db`` in `state_folder`. Artifacts of an SQLite store lie next to it.
    experiment : str
        Created when missing.

    Raises
    ------
    TwingapError
        When the store cannot be reached (within seconds), written, or read.
    """

    def __init__(self, uri: str | None = None, experiment: str = "twingap") -> None:
        self.uri, self.experiment = tracking_uri(uri), experiment
        database = sqlite_path(self.uri)
        _settle()
        if database is None:
            with _patience(retries=0, seconds=5):
                self._reach()
                self._open(None)
            return
        self.uri = f"sqlite:///{database}"
        check_database(database)
        # Two processes that open a new store at once would both create its tables.
        with filelock.FileLock(database.with_name(database.name + ".lock"), timeout=120):
            with _explained(self.uri):
                _quiet_mlflow()
                make_database(database)
            self._open(database.parent / "artifacts" / clean_file(experiment))

    def _reach(self) -> None:
        """Raise where a database does not answer; MLflow would try for minutes."""
        if self.uri.startswith(("postgresql", "mysql", "mssql")):
            with _explained(self.uri):
                import sqlalchemy

                sqlalchemy.create_engine(self.uri).connect().close()

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
        """A run of the experiment, with the versions of the software."""
        with ending(_MlflowRun(self._client, self.uri, self._id, name, None)) as run:
            run.tags({**{f"version.{k}": v for k, v in versions().items()}, **(tags or {})})
            yield run


class _MlflowRun(Run):
    def __init__(
        self, client: Any, uri: str, experiment_id: str, name: str, parent: str | None, duration_s: float | None = None
    ) -> None:
        super().__init__()
        self._client, self._uri, self._experiment_id = client, uri, experiment_id
        self._listed: list[dict[str, str]] = []
        tags = {} if parent is None else {"mlflow.parentRunId": parent}
        begin = None if duration_s is None else round((datetime.now(UTC).timestamp() - duration_s) * 1000)
        with _explained(uri):
            self.id: str = client.create_run(experiment_id, begin, tags, name).info.run_id

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
            for begin in range(0, len(items), 100):  # MLflow's limit of parameters or tags per call
                self._client.log_batch(self.id, **{key: values[begin : begin + 100] for key, values in what.items()})

    def _file(self, path: Path, folder: str, kind: Literal["file", "table", "image"] = "file") -> None:
        with _explained(self._uri):
            self._client.log_artifact(self.id, str(path), folder or None)
            if kind == "image":
                # Logged again as an image with a key, which the UI shows next to those of other runs.
                import PIL.Image

                with PIL.Image.open(path) as image:
                    self._client.log_image(self.id, image, key=path.stem, step=0)
        if kind == "table":
            # As MLflow's log_table, but a table logged again replaces the previous one instead of extending it.
            entry = {"path": f"{folder}/{path.name}", "type": "table"}
            listed = json.dumps([*self._listed, entry])
            if entry not in self._listed and len(listed) < 5000:
                self._listed.append(entry)
                self._tags({"mlflow.loggedArtifacts": listed})

    def _child(self, name: str, duration_s: float | None) -> Run:
        return _MlflowRun(self._client, self._uri, self._experiment_id, name, self.id, duration_s)

    def _end(self, status: Status) -> None:
        with _explained(self._uri):
            self._client.set_terminated(self.id, status)


def _settle() -> None:
    """Settings of MLflow that users have not made: no telemetry, and two minutes for a server to come back."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "6")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "30")


def _quiet_mlflow() -> Any:
    """MLflow without migration logs."""
    import mlflow

    for name in ("alembic", "mlflow"):
        logging.getLogger(name).setLevel(logging.ERROR)
    return mlflow


def _created(client: Any, experiment: str, artifacts: str | None) -> str:
    """Id of the new experiment, or of the one that another process has just created."""
    from mlflow.exceptions import MlflowException

    try:
        return str(
            client.create_experiment(experiment, artifacts, {"mlflow.experimentKind": "custom_model_development"})
        )
    except MlflowException:
        found = client.get_experiment_by_name(experiment)
        if found is None:
            raise
        return str(found.experiment_id)


@contextmanager
def _patience(retries: int, seconds: int) -> Iterator[None]:
    """Limit MLflow's retries and timeouts within the block, in which one thread is at a time."""
    wanted = {"MLFLOW_HTTP_REQUEST_MAX_RETRIES": str(retries), "MLFLOW_HTTP_REQUEST_TIMEOUT": str(seconds)}
    with _ONE_AT_A_TIME:
        before = {name: os.environ[name] for name in wanted}
        os.environ.update(wanted)
        try:
            yield
        finally:
            os.environ.update(before)


@contextmanager
def _explained(uri: str) -> Iterator[None]:
    """Convert the errors of a tracking store to `TwingapError`."""
    try:
        yield
    except TwingapError:
        raise
    except Exception as error:
        line = str(error).strip().partition("\n")[0][:300] or type(error).__name__
        if "Max retries exceeded" in line or "Connection" in type(error).__name__:
            line = "the tracking server does not answer"
        mend = "start it, or choose another with --tracking-uri or MLFLOW_TRACKING_URI"
        if "database is locked" in str(error):
            line, mend = "the tracking store is locked by another program", "wait for it to end, or close it"
        if "out-of-date database schema" in str(error):
            line, mend = "was written by an older MLflow", f"make a copy of it, then: mlflow db upgrade {uri}"
        raise TwingapError(line, where=f"tracking store {uri}", mend=mend) from error
