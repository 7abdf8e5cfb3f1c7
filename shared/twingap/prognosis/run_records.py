"""Rows of one run to failure from a record set, in order of time; samples are read one record at a time.

record set folder --> records.csv, sorted by time_s --> RunRow, ... --load--> peak to peak, kurtosis, rms

Unlike in `records.read_record_set`, a row may state that the machine stood still (speed_rpm 0) and then needs no file,
and a record with samples that are not finite is no error here. All other checks of a row are the same.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from twingap.errors import TwingapError
from twingap.prognosis.one_run import in_order, side_by_side
from twingap.records.artefacts import clipped_samples, constant_share, without_settling, without_spikes
from twingap.records.folder import channel_of, read_description
from twingap.records.measurable import refuse_unmeasurable
from twingap.records.samples import Channel, SampleFile
from twingap.records.table import Row, read_table

_LONGEST_S: Final = 1e10
"""Longest duration of a run (300 years); longer ones are input errors."""
_FASTEST_RPM: Final = 3e6
"""Highest speed accepted; higher ones are input errors."""
_M_S2: Final = {"m/s^2": 1.0, "g": 9.80665}
"""Units that can be converted, in m/s^2."""
_DIGITS: Final = 6
"""Significant digits of a fingerprint; more would not survive single precision and a change of unit."""


class Amplitude(NamedTuple):
    """Amplitude and kurtosis of a record; all NaN when the machine stands still.

    Parameters
    ----------
    peak_to_peak : float
        Peak to peak of the first samples, in the unit of the records.
    kurtosis : float
        Kurtosis; 3 for Gaussian noise.
    rms : float
        RMS about the mean.
    full_peak_to_peak : float
        Peak to peak of all samples.
    clipped : int
        Samples at the ends of the converter's range: the true peak to peak is larger.
    settling : float
        Offset at the first sample with which the sensor settled, which is taken out; 0 where it did not.
    constant : float
        Longest run of equal samples, as a share of the record.
    spikes : int
        Spikes of a single sample, which are taken out.
    """

    peak_to_peak: float
    kurtosis: float
    rms: float
    full_peak_to_peak: float
    clipped: int = 0
    settling: float = 0.0
    constant: float = 0.0
    spikes: int = 0

    def fingerprint(self, unit: str) -> tuple[float, float] | None:
        """Values that identify a record independently of file, name and unit; None without vibration."""
        if not (self.rms > 0 and np.isfinite(self.kurtosis)):
            return None
        return _rounded(self.rms * _M_S2.get(unit, 1.0)), _rounded(self.kurtosis)


@dataclass(frozen=True)
class RunRow:
    """One row of a run.

    Parameters
    ----------
    name : str
    time_s, speed_rpm : float
        Time, s, and speed; 0 while the machine stands still.
    channel : Channel or None
        Source of the samples; None when the row names no file.
    load_n : float or None
        Load, N.
    """

    name: str
    time_s: float
    speed_rpm: float
    channel: Channel | None
    load_n: float | None = None

    def amplitude(self, n_samples: int | None = None) -> Amplitude:
        """Peak to peak, kurtosis and rms of the record.

        Parameters
        ----------
        n_samples : int, optional
            Number of first samples for peak to peak; all when absent.

        Raises
        ------
        TwingapError
            When the samples cannot be read, one is not finite, or they cannot be measured by an accelerometer.
        """
        if self.channel is None or self.speed_rpm == 0:
            return Amplitude(*(float("nan"),) * 4)
        x = self.channel.load()
        refuse_unmeasurable(x, f"record {self.name!r}")
        clipped = clipped_samples(x)
        constant = constant_share(x)
        x, spikes = without_spikes(x)
        x, settling = without_settling(x)
        centred = x - x.mean()
        power = float(np.mean(centred**2))
        kurtosis = float(np.mean(centred**4)) / power**2 if power > 0 else float("nan")
        full = float(np.ptp(x))
        part = full if n_samples is None else float(np.ptp(x[:n_samples]))
        return Amplitude(part, kurtosis, float(np.sqrt(power)), full, clipped, settling, constant, spikes)


@dataclass(frozen=True)
class Run:
    """A run to failure, or its beginning.

    Parameters
    ----------
    name : str
    unit : str
    rows : tuple of RunRow
        Rows in order of time; rows of equal time in the order of the table.
    notes : tuple of str
        Changes and peculiarities.
    """

    name: str
    unit: str
    rows: tuple[RunRow, ...]
    notes: tuple[str, ...]

    def __iter__(self) -> Iterator[RunRow]:
        return iter(self.rows)

    def load_n(self, rows: int | None = None) -> float | None:
        """Equivalent load of the first rows of the running machine, or of all, N: cube root of the mean cube (ISO 281).

        None where a load is not known.
        """
        loads = [row.load_n for row in self.rows if row.speed_rpm > 0][:rows]
        known = [load for load in loads if load]
        if not known or len(known) < len(loads):
            return None
        return known[0] if len(set(known)) == 1 else float(np.mean(np.power(known, 3.0)) ** (1 / 3))


def read_run(
    folder: str | os.PathLike[str], group: str | None = None, *, several: str = "choose one by --group"
) -> Run:
    """Run from a record set.

    Parameters
    ----------
    folder : path-like
        Folder of the record set.
    group : str, optional
        Group whose rows are the run, where the set contains several bearings.
    several : str
        Advice in the error message for a set of several bearings.

    Returns
    -------
    Run

    Raises
    ------
    TwingapError
        With file, row, column and reason: a row without time_s, several runs, a missing file, all rows at the same
        time, an invalid cell.
    """
    folder = Path(folder)
    about = read_description(folder).recordset
    table = folder / "records.csv"
    rows = read_table(table, ("record", "file", "speed_rpm", "time_s"))
    rows, notes = _one_run(rows, table, group, several)
    opened: dict[str, SampleFile] = {}
    found = []
    rates = set[float]()
    for row in rows:
        time_s = row.number_in("time_s", needed=True)
        speed_rpm = row.number_in("speed_rpm", needed=True, least=0)
        name = row.text("record", needed=True)
        assert time_s is not None and speed_rpm is not None and name is not None
        if speed_rpm > _FASTEST_RPM:
            mend = "give revolutions per minute"
            raise TwingapError(
                f"{speed_rpm:g} rpm, at most {_FASTEST_RPM:g} rpm expected", where=row.where("speed_rpm"), mend=mend
            )
        turning = speed_rpm > 0
        rate = row.rate(about.fs_hz if turning else about.fs_hz or 1.0)
        channel = _channel(folder, row, rate, opened, needed=turning)
        # Other cells of a row at standstill are checked in the same way.
        checked = row if turning else replace(row, cells={**row.cells, "speed_rpm": "1"})
        load_n = checked.condition(rate, 1 if channel is None else channel.n_samples, {}).load_n
        if turning:
            rates.add(rate)
        found.append(RunRow(name, time_s, speed_rpm, channel, load_n))
    order, sorting = in_order([row.time_s for row in found], [row.name for row in found], table)
    notes += sorting
    times = [found[place].time_s for place in order]
    if times and times[-1] - times[0] > _LONGEST_S:
        raise TwingapError(
            f"time_s spans {times[-1] - times[0]:.3g} s, at most {_LONGEST_S:.3g} s expected", where=table,
            mend="give seconds since the start of the run",
        )  # fmt: skip
    if len(times) > 1 and times[0] == times[-1]:
        raise TwingapError(
            f"all {len(times)} rows have time_s = {times[0]:g}: no time passes, so no remaining time can be estimated",
            where=table, mend="give seconds since the start of the run",
        )  # fmt: skip
    if len(rates) > 1:
        notes.append(f"fs_hz varies ({min(rates):g} to {max(rates):g} Hz): amplitude may vary with it")
    if still := sum(row.speed_rpm == 0 for row in found):
        notes.append(f"the machine stands still in {still} rows: no life is consumed, and no remaining time is given")
    name = about.name or folder.resolve().name
    return Run(name, about.unit, tuple(found[place] for place in order), tuple(notes))


def _one_run(rows: tuple[Row, ...], table: Path, group: str | None, several: str) -> tuple[tuple[Row, ...], list[str]]:
    """The rows of one run, and a note where several groups follow one another."""
    if group is not None:
        kept = tuple(row for row in rows if row.text("group") == group)
        if not kept:
            known = ", ".join(dict.fromkeys(row.text("group") or "" for row in rows if row.text("group")))
            mend = f"groups found: {known:.200}" if known else "leave --group out"
            raise TwingapError(f"contains no group {group!r}", where=table, mend=mend)
        return kept, []
    groups = [row.text("group") for row in rows]
    if side_by_side(groups, (row.number_in("time_s") for row in rows)):
        names = [name for name in dict.fromkeys(groups) if name is not None]
        raise TwingapError(
            f"contains {len(names)} groups that overlap in time ({', '.join(names[:6])}): not one run", where=table,
            mend=several,
        )  # fmt: skip
    named = {name for name in groups if name is not None}
    if len(named) < 2:
        return rows, []
    return rows, [
        f"{len(named)} groups that follow one another in time ({', '.join(sorted(named)[:6])}): assumed to be "
        f"recordings of one run; if they are not, {several}"
    ]


def other_groups(folder: str | os.PathLike[str], group: str | None) -> list[str]:
    """Other groups of a record set whose times overlap with each other's: other runs, and not parts of one."""
    if group is None:
        return []
    rows = read_table(Path(folder) / "records.csv", ("record", "file", "speed_rpm", "time_s"))
    groups = [row.text("group") for row in rows]
    if not side_by_side(groups, (row.number_in("time_s") for row in rows)):
        return []
    return [name for name in dict.fromkeys(groups) if name is not None and name != group]


def in_unit(limit: float, unit: str, wanted: str) -> float | None:
    """Amplitude converted to another unit; None when it cannot be converted."""
    if unit == wanted:
        return limit
    return limit * _M_S2[unit] / _M_S2[wanted] if unit in _M_S2 and wanted in _M_S2 else None


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS - 1}e}")


def _channel(folder: Path, row: Row, rate: float, opened: dict[str, SampleFile], *, needed: bool) -> Channel | None:
    """The channel of a row; a row at standstill may name none, or one that cannot be read."""
    if row.text("file", needed=needed) is None:
        return None
    try:
        return channel_of(folder, row, rate, opened)
    except TwingapError:
        if needed:
            raise
        return None
