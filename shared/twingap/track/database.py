"""An SQLite tracking store before MLflow opens it: made whole, or checked.

A store may be locked, no database, or written by a newer MLflow.
"""

from __future__ import annotations

import contextlib
import sqlite3
from pathlib import Path

from twingap.errors import TwingapError
from twingap.files import replacing

PATIENCE_S = 30.0
"""How long a lock is waited for; MLflow's own transactions take milliseconds."""


def check_database(database: Path, *, write: bool = True) -> None:
    """Raise a one-line error for an SQLite file that MLflow could not use.

    Parameters
    ----------
    database : Path
        May be missing; its folder is created where it is to be written.
    write : bool
        Whether it is to be written.

    Raises
    ------
    TwingapError
        When the file is locked, no database, cannot be written, or has the schema of a newer MLflow.
    """
    try:
        if write:
            database.parent.mkdir(parents=True, exist_ok=True)
        address = f"{database.absolute().as_uri()}?mode={'rwc' if write else 'ro'}"
        with contextlib.closing(sqlite3.connect(address, timeout=PATIENCE_S, uri=True)) as connection:
            if write:
                connection.execute("BEGIN IMMEDIATE")
            revision = _revision(connection)
            connection.rollback()
    except (OSError, sqlite3.Error) as error:
        raise explained(error, database) from error
    if revision is not None and not _known(revision):
        import mlflow

        raise TwingapError(
            f"the tracking store was written by a newer MLflow than {mlflow.__version__}, which is installed here",
            where=database,
            mend="update it (pip install --upgrade mlflow), or choose another store with --tracking-uri",
        )


def make_database(database: Path) -> None:
    """Make the tables of an SQLite store that has none, all of them or none.

    MLflow makes them by hundreds of migrations in place. One that is interrupted leaves a store that it refuses.

    Parameters
    ----------
    database : Path
        May be missing.

    Raises
    ------
    TwingapError
        When it cannot be written.
    """
    if database.exists():
        with contextlib.closing(sqlite3.connect(f"{database.absolute().as_uri()}?mode=ro", uri=True)) as connection:
            if connection.execute("SELECT count(*) FROM sqlite_master").fetchone() != (0,):
                return
    from mlflow.store.db.utils import _initialize_tables, create_sqlalchemy_engine_with_retry

    with replacing(database) as temporary:
        engine = create_sqlalchemy_engine_with_retry(f"sqlite:///{temporary}")
        try:
            _initialize_tables(engine)
        finally:
            engine.dispose()


def explained(error: OSError | sqlite3.Error, database: Path) -> TwingapError:
    """One-line error for a database that cannot be used."""
    reason = getattr(error, "strerror", None) or str(error)
    if "locked" in reason:
        return TwingapError(
            f"the tracking store is locked: another program has been writing to it for {PATIENCE_S:g} s",
            where=database,
            mend="wait for that run to end, or close the program that holds it open (a database browser, say)",
        )  # fmt: skip
    if "not a database" in reason:
        return TwingapError(
            "is no tracking store: the file is not a database", where=database, mend="check --tracking-uri"
        )
    mend = "choose a writable place with --tracking-uri, MLFLOW_TRACKING_URI or TWINGAP_HOME"
    return TwingapError(f"the tracking database cannot be used: {reason}", where=database, mend=mend)


def _revision(connection: sqlite3.Connection) -> str | None:
    """Version of the schema; None in a new file."""
    (count,) = connection.execute("SELECT count(*) FROM sqlite_master WHERE name = 'alembic_version'").fetchone()
    row = connection.execute("SELECT version_num FROM alembic_version").fetchone() if count else None
    return None if row is None else str(row[0])


def _known(revision: str) -> bool:
    """Whether the installed MLflow knows a version of the schema."""
    import mlflow.store.db_migrations

    versions = Path(mlflow.store.db_migrations.__path__[0]) / "versions"
    return not versions.is_dir() or any(versions.glob(f"{revision}_*.py"))
