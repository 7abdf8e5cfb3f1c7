"""Conditions, records and record sets: the data model of vibration records.

Condition --(a twin, a rig, a machine)--> Record = Condition + samples;  RecordSet = records of one machine

On disk: `twingap.records.folder`; splits: `twingap.records.split`.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import FAULTS, Bearing
from twingap.errors import TwingapError

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
UNITS = ("m/s^2", "g", "")


@dataclass(frozen=True)
class Condition:
    """Condition under which a record was measured or simulated: all of it but the samples.

    Parameters
    ----------
    name : str
        Unique within its set (column `record`).
    speed_rpm : float
        Mean shaft speed, rev/min, positive.
    fs_hz : float
        Sampling rate, Hz.
    n_samples : int
        Length in samples.
    fault : str or None
        One of `twingap.bearing.FAULTS`; None = unknown.
    load_n, time_s : float or None
        Radial load in N; time since the start of the run in s. None = not given.
    group : str or None
        Recording or bearing that the record was cut from; None = the record's own name.
    extra : Mapping[str, Any]
        Other columns, passed on unchanged.

    Raises
    ------
    TwingapError
        For impossible values.
    """

    name: str
    speed_rpm: float
    fs_hz: float
    n_samples: int
    fault: str | None = None
    load_n: float | None = None
    time_s: float | None = None
    group: str | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"record {self.name!r}"
        if not (isinstance(self.name, str) and self.name):
            raise TwingapError(f"name = {self.name!r}, text expected", where="record")
        for key, value in (("speed_rpm", self.speed_rpm), ("fs_hz", self.fs_hz)):
            if not (isinstance(value, Real) and np.isfinite(value) and value > 0):
                raise TwingapError(f"{key} = {value!r}, a positive number expected", where=where)
        if not (isinstance(self.n_samples, Integral) and self.n_samples >= 1):
            raise TwingapError(f"n_samples = {self.n_samples!r}, a whole number of at least 1 expected", where=where)
        if self.fault is not None and self.fault not in FAULTS:
            raise TwingapError(f"unknown fault {self.fault!r}", where=where, mend=f"use one of {', '.join(FAULTS)}")
        if self.load_n is not None and not (np.isfinite(self.load_n) and self.load_n >= 0):
            raise TwingapError(f"load_n = {self.load_n!r}, a number of at least 0 expected", where=where)
        if self.time_s is not None and not np.isfinite(self.time_s):
            raise TwingapError(f"time_s = {self.time_s!r}, a finite number expected", where=where)
        if self.group is None:
            object.__setattr__(self, "group", self.name)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.n_samples / self.fs_hz


@dataclass(frozen=True)
class Record:
    """A condition and the vibration measured or simulated under it.

    Parameters
    ----------
    condition : Condition
    samples : Array [samples]
        In the unit of its record set.
    """

    condition: Condition
    samples: Array

    def __post_init__(self) -> None:
        if self.samples.shape != (self.condition.n_samples,):
            raise TwingapError(
                f"has samples of shape {self.samples.shape}, ({self.condition.n_samples},) expected",
                where=f"record {self.condition.name!r}",
            )


class RecordSet(Sequence[Record]):
    """Records of one machine. Samples may stay on disk until accessed.

    Parameters
    ----------
    name : str
    unit : {"m/s^2", "g", ""}
        Unit of all samples; "" = unknown.
    bearing : Bearing or None
        Bearing under test.
    conditions : sequence of Condition
        One per record, names unique.
    load : callable, int -> Array [samples]
        Loader of the samples of record i.
    """

    def __init__(
        self,
        name: str,
        unit: str,
        bearing: Bearing | None,
        conditions: Iterable[Condition],
        load: Callable[[int], Array],
    ) -> None:
        self.name, self.unit, self.bearing = name, unit, bearing
        self.conditions = tuple(conditions)
        self._load = load
        if unit not in UNITS:
            raise TwingapError(
                f"unit = {unit!r}", where=f"record set {name!r}", mend='use "m/s^2", "g" or "" (unknown)'
            )
        if not self.conditions:
            raise TwingapError("holds no records", where=f"record set {name!r}")
        seen: set[str] = set()
        for condition in self.conditions:
            if condition.name in seen:
                raise TwingapError(
                    f"record {condition.name!r} appears twice", where=f"record set {name!r}", mend="rename one of them"
                )
            seen.add(condition.name)

    @classmethod
    def from_records(cls, name: str, unit: str, bearing: Bearing | None, records: Iterable[Record]) -> RecordSet:
        """A set held in memory."""
        held = tuple(records)
        samples = tuple(r.samples for r in held)
        return cls(name, unit, bearing, (r.condition for r in held), samples.__getitem__)

    @property
    def digest(self) -> str:
        """Hex sha256 of the contents: unit, bearing, conditions and samples, in order.

        Name, format and location of the set are not included. Samples are hashed as little-endian float64. Reads every
        sample, one record at a time.
        """
        total = hashlib.sha256()
        bearing = None if self.bearing is None else asdict(self.bearing)
        total.update(_canonical({"unit": self.unit, "bearing": bearing}))
        for record in self:
            about = asdict(record.condition)
            about["extra"] = {key: value for key, value in record.condition.extra.items() if value is not None}
            total.update(_canonical(about))
            total.update(np.ascontiguousarray(record.samples, dtype="<f8").tobytes())
        return total.hexdigest()

    def __len__(self) -> int:
        return len(self.conditions)

    def __iter__(self) -> Iterator[Record]:
        return (self[i] for i in range(len(self)))

    @overload
    def __getitem__(self, index: int) -> Record: ...
    @overload
    def __getitem__(self, index: slice) -> RecordSet: ...
    def __getitem__(self, index: int | slice) -> Record | RecordSet:
        if isinstance(index, slice):
            return self.take(range(len(self))[index])
        place = range(len(self))[index]
        return Record(self.conditions[place], self._load(place))

    def take(self, places: Iterable[int]) -> RecordSet:
        """The records at these places, in this order."""
        kept = [range(len(self))[p] for p in places]
        load = _Taken(self._load, kept)
        return RecordSet(self.name, self.unit, self.bearing, (self.conditions[p] for p in kept), load)

    def select(self, keep: Callable[[Condition], bool]) -> RecordSet:
        """The records whose condition `keep` accepts.

        Raises
        ------
        TwingapError
            When none is left.
        """
        return self.take(i for i, condition in enumerate(self.conditions) if keep(condition))

    @property
    def groups(self) -> tuple[str, ...]:
        """Distinct groups, in order of first appearance."""
        return tuple(dict.fromkeys(c.group for c in self.conditions if c.group is not None))

    @property
    def table(self) -> pd.DataFrame:
        """One row per record: record, speed_rpm, fault, load_n, time_s, fs_hz, n_samples, group and further columns."""
        import pandas as pd  # slow import, not needed by most commands

        rows = [
            {
                "record": c.name, "speed_rpm": c.speed_rpm, "fault": c.fault, "load_n": c.load_n, "time_s": c.time_s,
                "fs_hz": c.fs_hz, "n_samples": c.n_samples, "group": c.group,
            }
            for c in self.conditions
        ]  # fmt: skip
        # A further column cannot replace one of these.
        return pd.DataFrame([{**row, **dict(c.extra), **row} for row, c in zip(rows, self.conditions, strict=True)])

    def _repr_html_(self) -> str:
        """Name, number, faults, speeds, rates and unit, for notebooks."""
        import pandas as pd

        faults = Counter(str(c.fault or "unknown") for c in self.conditions)
        speeds, rates = ([getattr(c, key) for c in self.conditions] for key in ("speed_rpm", "fs_hz"))
        about = {
            "records": len(self),
            "faults": ", ".join(f"{count} {fault}" for fault, count in faults.items()),
            "speed (rpm)": _range(speeds),
            "sampling rate (Hz)": _range(rates),
            "unit": self.unit or "unknown",
            "bearing": self.bearing.name if self.bearing else "unknown",
        }
        return pd.DataFrame({self.name: about}).to_html(border=0)

    def common_groups(self, other: RecordSet) -> tuple[str, ...]:
        """Groups that both sets contain; none for the parts of a split without leakage."""
        theirs = set(other.groups)
        return tuple(group for group in self.groups if group in theirs)

    def without_labels(self) -> RecordSet:
        """The same records with every fault unknown, for a diagnosis of unlabelled records."""
        hidden = tuple(replace(c, fault=None) for c in self.conditions)
        return RecordSet(self.name, self.unit, self.bearing, hidden, self._load)


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


@dataclass(frozen=True)
class _Taken:
    """Loader of the samples of selected records; a class, as closures cannot be pickled."""

    load: Callable[[int], Array]
    kept: Sequence[int]

    def __call__(self, index: int) -> Array:
        return self.load(self.kept[index])


def _canonical(value: Any) -> bytes:
    """JSON text that is the same for equal values."""

    def plain(item: Any) -> Any:
        return item.item() if isinstance(item, np.generic) else str(item)

    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=plain).encode()
