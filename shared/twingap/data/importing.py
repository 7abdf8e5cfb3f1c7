"""Records from exports of data loggers: channels, units, rates and speeds as the files state them.

file --inspect--> channels, time axis, rate, unit --names, tacho--> speed, fault, load --> records of a record set

What is understood of each file is given before anything is written (`Understood`), with notes on how; what is not
stated anywhere is asked for by the option that states it.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import BEARINGS, FAULTS, Bearing
from twingap.errors import TwingapError, one_of
from twingap.records import Condition, Record
from twingap.records.samples import SUFFIXES, Channel, SampleFile, inspect
from twingap.signal import repaired_tacho

Array = NDArray[np.float64]

_TIME: Final = re.compile(
    r"\W*(time|zeit|temps|tiempo|t|x_value|x-value|timestamp|datetime|seconds?|elapsed time)(?![^\W_]).*", re.IGNORECASE
)
_RATE: Final = re.compile(r"(.*[./])?(f_?s|sampl(e|es|ing)?_?(rate|freq|frequency))(_hz)?", re.IGNORECASE)
"""Names of single numbers that state a sampling rate, as in MATLAB and NumPy files."""
_TACHO: Final = re.compile(r"\W*(tacho|keyphasor|key phasor|tach|once.per.(rev|turn))", re.IGNORECASE)
_SPEED_UNITS: Final = ("rpm", "1/min", "r/min", "rev/min", "u/min", "min-1", "min^-1", "/min")
_OF_NAME: Final = {"mps2": "m/s2", "ms2": "m/s2", "m_s2": "m/s2"}
"""Units as they are written at the end of a name."""
_TIME_UNITS: Final = {
    "": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0,
}  # fmt: skip
_UNITS: Final = {
    "g": ("g", 1.0), "mg": ("g", 1e-3), "m/s2": ("m/s^2", 1.0), "m/s^2": ("m/s^2", 1.0), "m/s²": ("m/s^2", 1.0),
    "m/s**2": ("m/s^2", 1.0), "ms-2": ("m/s^2", 1.0), "mm/s2": ("m/s^2", 1e-3), "mm/s^2": ("m/s^2", 1e-3),
    "mm/s²": ("m/s^2", 1e-3),
}  # fmt: skip
"""Units of acceleration as loggers write them, and what they are in units of record sets."""
_G: Final = 9.80665
_SHORT: Final = 0.8
"""Part of the usual length below which a note says that a record is short. A larger value gives more notes."""
_FEW_TURNS: Final = 4.0
"""Turns of the shaft below which a note says that a record holds few. A larger value gives more notes."""
_EVEN: Final = 0.05
"""Largest deviation of a time axis from even steps, in steps; a larger value accepts gaps in the record."""
_FAULTS: Final = {
    "healthy": ("healthy", "normal", "baseline", "ok", "good", "n", "h"),
    "inner": ("inner", "ir", "innerrace", "inner_race", "i"),
    "outer": ("outer", "or", "outerrace", "outer_race", "o"),
    "ball": ("ball", "b", "roller", "re", "rolling_element"),
    "cage": ("cage", "c"),
}
_NUMBERS: Final = ("speed_rpm", "load_n", "time_s", "fs_hz")


@dataclass(frozen=True)
class ImportOptions:
    """What the files do not state.

    Parameters
    ----------
    channels : tuple of str
        Channels to import, by name or index; empty = all vectors but time axes, speeds and tachos.
    unit : str or None
        Unit of the samples after scaling; None = as the files state it.
    scale : float
        Factor by which samples are multiplied, for a sensor's sensitivity.
    fs_hz : float or None
        Sampling rate, Hz; None = as the files state it, or by their time axis.
    speed_rpm : float or None
        Shaft speed of all records.
    speed_channel, tacho_channel : str or None
        Channel that holds the speed in rev/min, or pulses of a tacho.
    pulses_per_turn : int
    names : str or None
        Pattern of the file names, such as "{fault}_{speed_rpm:d}rpm.csv".
    fault : str or None
    load_n : float or None
    """

    channels: tuple[str, ...] = ()
    unit: str | None = None
    scale: float = 1.0
    fs_hz: float | None = None
    speed_rpm: float | None = None
    speed_channel: str | None = None
    tacho_channel: str | None = None
    pulses_per_turn: int = 1
    names: str | None = None
    fault: str | None = None
    load_n: float | None = None


@dataclass(frozen=True)
class Understood:
    """One record to be imported.

    Parameters
    ----------
    condition : Condition
    channel : Channel
    unit : str
        Of the record set, or empty.
    factor : float
        By which samples are multiplied.
    rate_from, speed_from : str
        Where rate and speed come from.
    notes : tuple of str
        How the file was understood.
    """

    condition: Condition
    channel: Channel
    unit: str
    factor: float
    rate_from: str
    speed_from: str
    notes: tuple[str, ...] = field(default=())

    def load(self, unit: str) -> Record:
        """The record, in a unit."""
        convert = {("g", "m/s^2"): _G, ("m/s^2", "g"): 1 / _G}.get((self.unit, unit), 1.0)
        with np.errstate(over="ignore"):  # refused where the record is written, as samples that are not finite
            return Record(self.condition, self.channel.load() * (self.factor * convert))

    def row(self) -> dict[str, Any]:
        """For a table."""
        c = self.condition
        return {
            "record": c.name, "channel": self.channel.name, "unit": self.unit or "unknown", "samples": c.n_samples,
            "seconds": c.duration_s, "fs_hz": c.fs_hz, "rate from": self.rate_from, "speed_rpm": c.speed_rpm,
            "speed from": self.speed_from, "fault": c.fault, "load_n": c.load_n, "time_s": c.time_s, "group": c.group,
            **{key: value for key, value in c.extra.items() if key != "speed_from"},
        }  # fmt: skip


def files_of(paths: Sequence[Path]) -> list[Path]:
    """The files, and those of a readable type in the folders among the paths, in order of their names."""
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.is_file() and p.suffix.lower() in SUFFIXES)
            if not inside:
                raise TwingapError("holds no file that can be read", where=path, mend=f"types: {', '.join(SUFFIXES)}")
            found += inside
        else:
            found.append(path)
    return found


def bearing_of(text: str) -> Bearing:
    """A bearing by name, or by its geometry as `Z,d,D` or `Z,d,D,angle` (mm, degrees)."""
    if text in BEARINGS:
        return BEARINGS[text]
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
        if len(numbers) not in (3, 4) or numbers[0] != int(numbers[0]):
            raise ValueError
    except (ValueError, OverflowError):
        raise TwingapError(
            f"unknown bearing {text!r}", where="--bearing",
            mend=f"{one_of(text, BEARINGS, 'bearings')}; or give its geometry: number of rollers, roller diameter, "
            "pitch diameter and contact angle, such as 9,7.94,39.04,0",
        ) from None  # fmt: skip
    return Bearing("unnamed", int(numbers[0]), *numbers[1:])


def understand(paths: Sequence[Path], options: ImportOptions) -> list[Understood]:
    """What is understood of the files, without loading more than time axes, speeds and tachos.

    Raises
    ------
    TwingapError
        Naming the file and the option that states what is missing.
    """
    if sum(v is not None for v in (options.speed_rpm, options.speed_channel, options.tacho_channel)) > 1:
        raise TwingapError("several sources of speed are given", where="--speed-rpm, --speed-channel, --tacho-channel")
    pattern = None if options.names is None else _pattern(options.names)
    found = [record for path in paths for record in _of_file(path, options, pattern, several=len(paths) > 1)]
    names = [record.condition.name for record in found]
    for name, count in Counter(names).items():
        if count > 1:
            raise TwingapError(f"several records would be called {name!r}", where=name, mend="rename the files")
    usual = float(np.median([record.condition.duration_s for record in found])) if found else 0.0
    return [_with_note_on_length(record, usual) for record in found]


def _with_note_on_length(record: Understood, usual_s: float) -> Understood:
    """The record, with notes where it is shorter than the usual record of the files, since its file may be cut off, and
    where it holds few turns of the shaft."""
    own, turns = record.condition.duration_s, record.condition.duration_s * record.condition.speed_rpm / 60
    notes = []
    if own <= _SHORT * usual_s:
        notes.append(f"{own:.4g} s long where half of the records have {usual_s:.4g} s or more: is the file whole?")
    if turns < _FEW_TURNS:
        notes.append(
            f"{turns:.2g} turns of the shaft in {own:.4g} s at {record.condition.speed_rpm:g} rpm: too few to tell "
            "faults apart; is the speed in rev/min?"
        )
    return replace(record, notes=(*record.notes, *notes))


def notes_on_groups(found: Sequence[Understood]) -> list[str]:
    """Notes on groups that hold records of several faults: a group is what cannot be split, such as a bearing."""
    faults: dict[str, set[str]] = {}
    for record in found:
        if record.condition.group is not None:
            faults.setdefault(record.condition.group, set()).add(str(record.condition.fault))
    mixed = sorted(group for group, own in faults.items() if len(own) > 1)
    if not mixed:
        return []
    held = ", ".join(sorted(faults[mixed[0]]))
    return [
        f"group {mixed[0]!r} holds records of several faults ({held}): a group is one recording or one bearing, never "
        "parted by a split; call a running number by another field, such as {number}"
    ]


def unit_of(found: Sequence[Understood]) -> str:
    """Unit of the record set: that of the first record; empty where any is unknown."""
    return "" if any(not record.unit for record in found) else found[0].unit


def records_of(found: Sequence[Understood]) -> Iterator[Record]:
    """The records, one in memory at a time."""
    unit = unit_of(found)
    return (record.load(unit) for record in found)


def _of_file(
    path: Path, options: ImportOptions, pattern: re.Pattern[str] | None, *, several: bool
) -> Iterator[Understood]:
    file = inspect(path)
    facts = {} if pattern is None else _facts(path, pattern, str(options.names))
    notes = list(file.notes)
    time = _time_axis(file)
    aside = {c.name for c in (time,) if c is not None}
    held = {c.name for c in file.channels}
    if options.speed_channel not in {None, *held} and "speed_rpm" in facts:
        notes.append(f"has no channel {options.speed_channel!r}: the speed is that of the name")
        options = replace(options, speed_channel=None)
    aside |= {file.find(n).name for n in (options.speed_channel, options.tacho_channel) if n is not None}
    refused = [c for c in file.channels if c.problem is not None and c.name not in aside]
    chosen = [file.find(name) for name in options.channels]
    if not chosen:
        chosen = [c for c in file.channels if c.problem is None and c.name not in aside and c.n_samples > 1]
        if not file.keyed:
            notes += [f"channel {c.name!r} is left out: {c.problem}" for c in refused if c.name]
        speeds = [c for c in chosen if _stated_unit(c).lower() in _SPEED_UNITS]
        if len(speeds) < len(chosen):
            chosen = [c for c in chosen if c not in speeds]
            stated = options.speed_channel or options.tacho_channel or options.speed_rpm or "speed_rpm" in facts
            if speeds and not stated:
                options, speeds = replace(options, speed_channel=speeds[0].name), speeds[1:]
            notes += [f"channel {c.name!r} is left out: give --speed-channel to take the speed from it" for c in speeds]
        tachos = [c for c in chosen if _TACHO.match(c.name)]
        if len(tachos) < len(chosen):
            chosen = [c for c in chosen if c not in tachos]
            notes += [f"channel {c.name!r} is left out: give --tacho-channel if it is a tacho" for c in tachos]
    if not chosen:
        if not any(c.n_samples for c in file.channels):
            raise TwingapError("holds no samples", where=path, mend="export it again with its samples")
        for channel in refused:
            raise TwingapError(str(channel.problem), where=channel.where, mend=channel.mend)
        raise TwingapError("holds no channel but time, speed and tacho", where=path, mend="name one with --channel")
    fs_hz, rate_from = _rate(file, time, options, facts, notes)
    speed_rpm, speed_from = _speed(file, options, facts, fs_hz, notes)
    fault = _fault(facts.pop("fault", options.fault), path)
    load_n = facts.pop("load_n", options.load_n)
    stem = facts.pop("record", path.stem)
    group, time_s = facts.pop("group", None), facts.pop("time_s", None)
    for place, channel in enumerate(chosen):
        unit, factor = _unit(channel, options, notes)
        name = stem if len(chosen) == 1 else f"{stem} {channel.name}".strip()
        extra = dict(facts) | ({"channel_name": channel.name} if len(chosen) > 1 else {})
        if options.tacho_channel is not None:
            extra["speed_from"] = speed_from
        condition = Condition(
            name.strip(), speed_rpm, fs_hz, channel.n_samples, fault=fault, load_n=load_n, time_s=time_s,
            group=group or (stem if len(chosen) > 1 else None), extra=extra,
        )  # fmt: skip
        yield Understood(
            condition, channel, unit, factor * options.scale, rate_from, speed_from, tuple(notes) if place == 0 else ()
        )


def _time_axis(file: SampleFile) -> Channel | None:
    return next((c for c in file.channels if _TIME.fullmatch(c.name) and c.n_samples > 2), None)


def _rate_numbers(file: SampleFile) -> list[tuple[float, str]]:
    """Sampling rate, Hz, of a number in a file with named arrays, and what states it; empty where rates differ."""
    named = [c for c in file.channels if file.keyed and c.n_samples == 1 and c.problem is None]
    rates = [(float(c.load()[0]), f"number {c.name!r}") for c in named if _RATE.fullmatch(c.name)]
    return rates[:1] if len({rate for rate, _ in rates}) == 1 and rates[0][0] > 0 else []


def _rate(
    file: SampleFile, time: Channel | None, options: ImportOptions, facts: dict[str, Any], notes: list[str]
) -> tuple[float, str]:
    """Sampling rate and where it comes from; what the file states must agree with what is given."""
    given = facts.pop("fs_hz", options.fs_hz)
    sources = [(given, "--fs-hz"), (file.fs_hz, "the file"), *_rate_numbers(file)]
    if time is not None and (rate := _rate_of(time, notes)) is not None:
        sources.append((rate, f"channel {time.name!r}"))
    known = [(float(rate), source) for rate, source in sources if rate is not None]
    if not known:
        if time is not None:
            try:
                time.load()
            except TwingapError as error:
                mend = "write all of its numbers alike, or give the sampling rate with --fs-hz"
                raise TwingapError(str(error), mend=mend) from None
        raise TwingapError("states no sampling rate", where=file.path, mend="give it with --fs-hz")
    first, source = known[0]
    for rate, other in known[1:]:
        if abs(rate - first) > 1e-3 * first:
            raise TwingapError(
                f"{source} gives {first:g} Hz but {other} {rate:g} Hz", where=file.path,
                mend="check the unit of the time axis, or import without it (--channel, --fs-hz)",
            )  # fmt: skip
    if source.startswith("channel"):  # time axes are rounded: rates are whole where they nearly are
        first = float(round(first)) if abs(first - round(first)) < 1e-4 * first else first
    return first, source


def _rate_of(time: Channel, notes: list[str]) -> float | None:
    """Sampling rate of a time axis; None, with a note, where it is none."""
    try:
        t = time.load()
    except TwingapError:
        notes.append(f"channel {time.name!r} holds no numbers: no sampling rate is taken from it")
        return None
    unit = _stated_unit(time).lower()
    if unit not in _TIME_UNITS:
        notes.append(f"channel {time.name!r} is in {time.unit!r}: no sampling rate is taken from it")
        return None
    span = float(t[-1] - t[0]) * _TIME_UNITS[unit]
    if not span > 0:
        return None
    off = np.abs((t - t[0]) * _TIME_UNITS[unit] / span * (t.size - 1) - np.arange(t.size))
    if off.max() > max(_EVEN, 2 * _resolution(t) * (t.size - 1) / float(t[-1] - t[0])):
        raise TwingapError(
            f"sample {int(off.argmax())} of the time axis {time.name!r} is {off.max():.3g} steps from even steps: "
            "samples are missing", where=time.path, mend="export it without gaps, or give --channel and --fs-hz",
        )  # fmt: skip
    return (t.size - 1) / span


def _resolution(t: Array) -> float:
    """Step to which times are rounded: the least difference between two intervals."""
    differences = np.diff(np.unique(np.round(np.diff(t[:2000]), 12)))
    differences = differences[differences > 1e-12]
    return float(differences.min()) if differences.size else 0.0


def _speed(
    file: SampleFile, options: ImportOptions, facts: dict[str, Any], fs_hz: float, notes: list[str]
) -> tuple[float, str]:
    """Mean speed and where it comes from."""
    if options.tacho_channel is not None:
        return _tacho_speed(file.find(options.tacho_channel), options.pulses_per_turn, fs_hz, notes)
    if options.speed_channel is not None:
        channel = file.find(options.speed_channel)
        speed = channel.load()
        mean = float(speed.mean())
        if not mean > 0:
            raise TwingapError(f"mean speed {mean:g}, a positive number expected", where=channel.where)
        if np.ptp(speed) > 0.02 * mean:
            notes.append(f"speed varies from {speed.min():.5g} to {speed.max():.5g} rpm: the mean is taken")
        facts.pop("speed_rpm", None)
        return mean, f"channel {channel.name!r}"
    if "speed_rpm" in facts:
        return float(facts.pop("speed_rpm")), "the name"
    if options.speed_rpm is not None:
        return options.speed_rpm, "--speed-rpm"
    raise TwingapError(
        "states no speed", where=file.path,
        mend="give --speed-rpm, --speed-channel, --tacho-channel, or {speed_rpm} in --names",
    )  # fmt: skip


def _tacho_speed(channel: Channel, pulses_per_turn: int, fs_hz: float, notes: list[str]) -> tuple[float, str]:
    x = channel.load()
    low, high = np.quantile(x, [0.01, 0.99])
    if high == low:
        low, high = float(x.min()), float(x.max())
    if not high > low:
        raise TwingapError("holds no pulses: all samples are equal", where=channel.where)
    times = _pulse_times(x, low + 0.4 * (high - low), low + 0.6 * (high - low)) / fs_hz
    if times.size < 3:
        raise TwingapError(f"holds {times.size} pulses, at least 3 expected", where=channel.where)
    try:
        pulses = repaired_tacho(times)
    except TwingapError as error:
        raise TwingapError(error.what, where=channel.where, mend=error.mend) from error
    notes += [f"tacho: {note}" for note in pulses.notes]
    intervals = np.diff(pulses.times_s)
    if np.ptp(intervals) > 0.1 * intervals.mean():
        between = f"{intervals.min():.4g} to {intervals.max():.4g} s"
        notes.append(f"speed varies: tacho intervals from {between}; the mean is taken")
    turns = (pulses.times_s.size - 1) / pulses_per_turn
    return 60 * turns / float(pulses.times_s[-1] - pulses.times_s[0]), f"tacho {channel.name!r}"


def _pulse_times(x: Array, low: float, high: float) -> Array:
    """Rising edges, in samples: above `high` after having been below `low`."""
    state = np.where(x > high, 1, np.where(x < low, -1, 0))
    known = np.flatnonzero(state)
    rising = np.flatnonzero(np.diff(state[known]) > 0)
    after = known[rising + 1]
    middle = (low + high) / 2
    before = np.maximum(after - 1, 0)
    step = x[after] - x[before]
    return np.asarray(before + np.where(step > 0, (middle - x[before]) / np.where(step > 0, step, 1), 0.0)).clip(0)


def _stated_unit(channel: Channel) -> str:
    """Unit that a channel states, beside its name or at the end of it ("time_ms", "acc_g")."""
    if stated := channel.unit.strip("[]() "):
        return stated
    ending = re.search(r"_(m_s2|[^_\W]+)$", channel.name.strip())
    unit = _OF_NAME.get(ending[1].lower(), ending[1].lower()) if ending else ""
    return unit if unit in (*_UNITS, *_TIME_UNITS, *_SPEED_UNITS) else ""


def _unit(channel: Channel, options: ImportOptions, notes: list[str]) -> tuple[str, float]:
    """Unit of the record set and the factor to it."""
    if options.unit is not None:
        return options.unit, 1.0
    stated = _stated_unit(channel)
    found = _UNITS.get(stated.lower())
    if found is not None:
        return found
    if stated:
        notes.append(
            f"channel {channel.name!r} is in {stated!r}, which is no acceleration: give --unit, and --scale for the "
            "sensor's sensitivity"
        )
    return "", 1.0


def _pattern(names: str) -> re.Pattern[str]:
    """Regular expression of a pattern such as "{fault}_{speed_rpm:d}rpm.csv"."""
    parts, at = [], 0
    for found in re.finditer(r"\{(\w+)(?::([a-z]?))?\}", names):
        parts.append(re.escape(names[at : found.start()]))
        key, kind = found[1], found[2] or ("g" if found[1] in _NUMBERS else "s")
        if kind not in "dgfs":
            raise TwingapError(f"{found[0]!r} has an unknown kind {kind!r}", where="--names", mend="use d, g or s")
        number = {"d": r"[+-]?\d+", "g": r"[+-]?\d+(?:[.,p]\d+)?", "f": r"[+-]?\d+(?:[.,p]\d+)?", "s": r"[^/]+?"}[kind]
        parts.append(f"(?P<{key}__{kind}>{number})")
        at = found.end()
    if not parts:
        raise TwingapError(f"{names!r} names no field", where="--names", mend='write "{fault}_{speed_rpm:d}rpm.csv"')
    parts.append(re.escape(names[at:]))
    try:
        return re.compile("".join(parts))
    except re.error as error:
        raise TwingapError(f"{names!r} is no pattern: {error}", where="--names") from error


def _facts(path: Path, pattern: re.Pattern[str], names: str) -> dict[str, Any]:
    """Values of the fields of a name, with or without the suffix."""
    depth = names.count("/")
    shown = "/".join(path.absolute().parts[-1 - depth :])
    found = pattern.fullmatch(shown) or pattern.fullmatch(shown.removesuffix(path.suffix))
    if found is None:
        raise TwingapError(f"its name does not fit the pattern {names!r}", where=path, mend="change --names")
    facts: dict[str, Any] = {}
    for key, text in found.groupdict().items():
        name, _, kind = key.rpartition("__")
        if kind == "s" and name not in _NUMBERS:
            facts[name] = text
            continue
        try:
            value = float(text.replace(",", ".").replace("p", "."))
        except ValueError:
            raise TwingapError(f"{text!r} found for {name}, a number expected", where=path) from None
        facts[name] = int(value) if kind == "d" and name not in _NUMBERS else value
    return facts


def _fault(text: str | None, path: Path) -> str | None:
    if text is None:
        return None
    wanted = text.lower().replace("-", "_").replace(" ", "_")
    for fault, words in _FAULTS.items():
        if wanted in words:
            return fault
    mend = f"use one of {', '.join(FAULTS)}"
    if re.search(r"[\d_-]", text):
        mend += "; a number or word beside it is a field of its own, such as {fault}_{run}_{speed_rpm:d}rpm"
    raise TwingapError(f"unknown fault {text!r}", where=path, mend=mend)


def finite_positive(value: float | None, option: str) -> None:
    """Refuse a number that is not finite and positive."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise TwingapError(f"{value:g} found, a positive number expected", where=option)
