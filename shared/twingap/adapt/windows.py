"""Records cut into windows of equal length, on which classifiers are trained and evaluated.

RecordSet --cut--> Windows (samples, group, speed, label) --inputs--> network input [windows, channels, length]
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.records import RecordSet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Windows:
    """Windows of a record set.

    Parameters
    ----------
    samples : Array [windows, length]
        Samples as recorded.
    fs_hz, speed_rpm : Array [windows]
        Sampling rate and speed of the record of each window.
    group : NDArray[str] [windows]
        Recording (or bearing) of each window.
    labels : NDArray[int64] [windows] or None
        Index of the fault in the list of classes; None = unknown, as required for a target domain.
    """

    samples: Array
    fs_hz: Array
    speed_rpm: Array
    group: NDArray[np.str_]
    labels: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.samples)

    def unlabelled(self) -> Windows:
        """The same windows without labels."""
        return replace(self, labels=None)

    def take(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> Windows:
        """Some of the windows, in the given order."""
        labels = None if self.labels is None else self.labels[places]
        return Windows(
            self.samples[places], self.fs_hz[places], self.speed_rpm[places], self.group[places], labels
        )  # fmt: skip


def cut(records: RecordSet, length: int, per_record: int, classes: Sequence[str] | None = None) -> Windows:
    """Windows cut from each record, evenly spaced; they overlap only where the record is too short.

    Parameters
    ----------
    records : RecordSet
    length : int
        Samples per window.
    per_record : int
        Windows per record, the same for all, so that long recordings do not have more weight.
    classes : sequence of str, optional
        Faults in the order of their labels; without it faults are not used.

    Returns
    -------
    Windows
        In the order of the records, then of time.

    Raises
    ------
    TwingapError
        For a record shorter than a window, or one whose fault is not in `classes`.
    """
    if length < 2 or per_record < 1:
        raise TwingapError(
            f"{per_record} windows of {length} samples", mend="use at least 1 window of at least 2 samples"
        )
    samples, group, labels = [], [], []
    fs_hz, speed_rpm = [], []
    for condition in records.conditions:
        where = f"record {condition.name!r}"
        if condition.n_samples < length:
            raise TwingapError(f"has {condition.n_samples} samples, a window needs {length}", where=where)
        if classes is not None:
            if condition.fault not in classes:
                raise TwingapError(f"fault {condition.fault!r}, one of {', '.join(classes)} expected", where=where)
            labels += [classes.index(condition.fault)] * per_record
    for record in records:
        c = record.condition
        starts = np.round(np.linspace(0, c.n_samples - length, per_record)).astype(np.int64)
        samples += [record.samples[s : s + length] for s in starts]
        group += [c.group or c.name] * per_record
        fs_hz += [c.fs_hz] * per_record
        speed_rpm += [c.speed_rpm] * per_record
    known = None if classes is None else np.array(labels, dtype=np.int64)
    return Windows(np.stack(samples), np.array(fs_hz), np.array(speed_rpm), np.array(group), known)


def joined(parts: Iterable[Windows]) -> Windows:
    """Concatenated windows; labelled only if all parts are."""
    held = list(parts)
    labels = [w.labels for w in held if w.labels is not None]
    return Windows(
        np.concatenate([w.samples for w in held]),
        np.concatenate([w.fs_hz for w in held]),
        np.concatenate([w.speed_rpm for w in held]),
        np.concatenate([w.group for w in held]),
        np.concatenate(labels) if len(labels) == len(held) else None,
    )


def split_by_group(windows: Windows, share: float, rng: np.random.Generator) -> tuple[Windows, Windows]:
    """Two parts that share no group; the second has about `share` of the groups of every class.

    Raises
    ------
    TwingapError
        When a class has too few groups for both parts.
    """
    strata = np.zeros(len(windows), dtype=np.int64) if windows.labels is None else windows.labels
    held_out: set[str] = set()
    for stratum in np.unique(strata):
        groups = np.unique(windows.group[strata == stratum])
        count = max(1, round(share * groups.size))
        if count >= groups.size:
            raise TwingapError(
                f"{groups.size} groups cannot be split with a fraction of {share:g}", mend="cut more records"
            )
        held_out |= set(rng.permutation(groups)[:count])
    second = np.isin(windows.group, sorted(held_out))
    first_part, second_part = windows.take(~second), windows.take(second)
    if set(first_part.group) & set(second_part.group):
        raise TwingapError("a group has two classes and cannot be split", mend="give each record its own group")
    return first_part, second_part
