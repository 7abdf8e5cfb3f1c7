"""Results on disk, one per job, keyed by content: written atomically and verified when read.

<key>.json    the job, the code version, the data digests and the result
<key>.npz     its arrays, if any; written before the JSON, whose presence marks the job as done
failed/<key>.txt    traceback of a job that failed
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import filelock
import numpy as np
from numpy.typing import NDArray

from twingap import files
from twingap.errors import TwingapError
from twingap.provenance import digest_of_value, plain

Arrays = Mapping[str, NDArray[Any]]
ARRAY = "$array"


@dataclass(frozen=True)
class Identity:
    """Everything on which a result depends; equal identities have the same result.

    Parameters
    ----------
    function : str
        Qualified name of the function.
    job : Any
        The job in plain JSON form.
    version : str
        Version of the code.
    data : Mapping[str, str]
        Digest of each data set that the function reads.
    """

    function: str
    job: Any
    version: str
    data: Mapping[str, str]

    @property
    def key(self) -> str:
        """Hex sha256 of all fields."""
        return digest_of_value(self)


def encode(value: Any) -> tuple[str, dict[str, NDArray[Any]]]:
    """A job's value as JSON text and the arrays to which it refers.

    Raises
    ------
    TypeError
        For values that JSON and .npz cannot hold.
    """
    arrays: dict[str, NDArray[Any]] = {}

    def lifted(item: Any) -> Any:
        if isinstance(item, np.ndarray):
            if item.dtype.hasobject:
                raise TypeError("an array of Python objects cannot be stored")
            arrays[f"a{len(arrays)}"] = item
            return {ARRAY: f"a{len(arrays) - 1}"}
        if isinstance(item, Mapping):
            if ARRAY in item:
                raise TypeError(f"the key {ARRAY!r} is taken")
            return {key: lifted(inner) for key, inner in item.items()}
        if dataclasses.is_dataclass(item) and not isinstance(item, type):
            return {field.name: lifted(getattr(item, field.name)) for field in dataclasses.fields(item)}
        if isinstance(item, (list, tuple)):
            return [lifted(inner) for inner in item]
        return item

    return json.dumps(plain(lifted(value))), arrays


def decode(text: str, arrays: Arrays) -> Any:
    """Inverse of `encode`, with tuples as lists."""

    def placed(item: dict[str, Any]) -> Any:
        return arrays[item[ARRAY]] if set(item) == {ARRAY} else item

    return json.loads(text, object_hook=placed)


class ResultStore:
    """A folder of results.

    Parameters
    ----------
    folder : path-like
        Created when missing.

    Raises
    ------
    TwingapError
        When it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self._earlier: list[dict[str, Any]] | None = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise TwingapError(f"cannot be made: {error.strerror}", where=self.folder, mend="name another") from error

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Lock the folder for this process; the lock ends with the process, however that ends.

        Raises
        ------
        TwingapError
            At once, when another process holds the lock or the folder cannot be written.
        """
        lock = filelock.FileLock(self.folder / ".lock", timeout=0)
        try:
            lock.acquire()
        except filelock.Timeout:
            mend = "wait for it, or name another folder"
            raise TwingapError("another sweep is at work here", where=self.folder, mend=mend) from None
        except OSError as error:
            raise TwingapError(
                f"cannot be written: {error.strerror}", where=self.folder, mend="name another"
            ) from error
        try:
            for left in self.folder.glob(".[0-9a-f]*"):  # partial files of a killed process
                left.unlink(missing_ok=True)
            yield
        finally:
            lock.release()

    def read(self, key: str) -> tuple[Any, float] | None:
        """Value and runtime, s, of a finished job; None when there is none or it is damaged."""
        held = self._parsed(self.folder / f"{key}.json")
        if held is None or held["key"] != key:
            return None
        arrays: dict[str, NDArray[Any]] = {}
        if held["arrays"]:
            try:
                with np.load(self.folder / f"{key}.npz", allow_pickle=False) as archive:
                    arrays = {name: archive[name] for name in archive.files}
            except Exception:  # a damaged zip file raises many kinds of errors
                return None
            if _digest(arrays) != held["arrays"]:
                return None
        return decode(held["value"], arrays), float(held["seconds"])

    def write(self, label: str, identity: Identity, text: str, arrays: Arrays, seconds: float) -> None:
        """Store a finished job's encoded value."""
        key = identity.key
        if arrays:
            with files.replacing(self.folder / f"{key}.npz") as target, target.open("wb") as stream:
                np.savez(stream, allow_pickle=False, **arrays)
        held = {
            "label": label, "key": key, "identity": plain(identity), "seconds": seconds,
            "arrays": _digest(arrays) if arrays else "", "value": text, "sha256": _sha256(text),
        }  # fmt: skip
        with files.replacing(self.folder / f"{key}.json") as target:
            target.write_text(json.dumps(held, indent=1), encoding="utf-8")
        self.failure_path(key).unlink(missing_ok=True)

    def write_failure(self, label: str, key: str, traceback: str) -> None:
        """Store a failed job's traceback."""
        with files.replacing(self.failure_path(key)) as target:
            target.write_text(f"{label}\n\n{traceback}", encoding="utf-8")

    def failure_path(self, key: str) -> Path:
        """Path of a failed job's traceback."""
        return self.folder / "failed" / f"{key}.txt"

    def why_missing(self, label: str, identity: Identity) -> str:
        """Reason why this job has no reusable result: the first that applies, as text."""
        if self.failure_path(identity.key).exists():
            return "failed before"
        if (self.folder / f"{identity.key}.json").exists():
            return "stored result damaged"
        now = plain(identity)
        others = [h for h in self._others() if h["identity"].get("function") == identity.function]
        same_job = [h["identity"] for h in others if h["identity"].get("job") == now["job"]]
        if any(h.get("version") == now["version"] for h in same_job):
            return "data changed"
        if same_job:
            return "code changed" if any(h.get("data") == now["data"] for h in same_job) else "code and data changed"
        return "job changed" if any(h["label"] == label for h in others) else "no result"

    def _others(self) -> list[dict[str, Any]]:
        """All results in the folder, whatever their version; read once."""
        if self._earlier is None:
            parsed = (self._parsed(path) for path in sorted(self.folder.glob("*.json")))
            self._earlier = [held for held in parsed if held is not None]
        return self._earlier

    @staticmethod
    def _parsed(path: Path) -> dict[str, Any] | None:
        try:
            held = json.loads(path.read_text(encoding="utf-8"))
            whole = _sha256(held["value"]) == held["sha256"] and {"label", "key", "arrays", "seconds"} <= held.keys()
            return held if whole and isinstance(held["identity"], dict) else None
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _digest(arrays: Arrays) -> str:
    """Hex sha256 of arrays: names, types, shapes and bytes."""
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        total.update(f"{name} {array.dtype.str} {arrays[name].shape} ".encode())
        total.update(array.tobytes())
    return total.hexdigest()
