"""Domains in which a gap is measured: one object each, with its bins, vector, labels and advice.

record --frequency, envelope_order, order, amplitude, time, condition--> one vector each, on the bins of a Grid

All values are logarithms of dimensionless quantities, so that differences between records and twin add up. To add a
domain, add its name to `domain_names` and to `report/gap_report.schema.json`, and an object to `DOMAINS`, last in each;
bins that depend on the records are fields of `grid.Grid`. Distances, tests, localisation, figures and advice read
domains from here. Distances are features too (`features.distances`): run `twingap train` again for these to be used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.grid import SEGMENTS, Axis, Grid
from twingap.records import Array
from twingap.signal.order_statistics import order_statistics
from twingap.signal.record_transforms import RecordTransforms, between_blocks, medians

PER_DECIBEL: Final = 10 / np.log(10)
"""Decibels of a natural logarithm of power."""
_QUANTILES: Final = np.array([0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 1.0])
_TAILS: Final = np.array([0.5, 0.9, 0.99, 0.999])
"""Quantiles of |x| for the shape of the distribution, and of x on either side for its asymmetry."""
_TINY: Final = 1e-300


@dataclass(frozen=True)
class CurveStyle:
    """A curve of a report: one kind of a domain's bins (as in `Axis.kind`) over its axis.

    `factor` leads from the vector's natural logarithms to `y_unit`.
    """

    name: str
    kind: str
    title: str
    y_unit: str
    factor: float


@dataclass(frozen=True)
class Domain:
    """A domain in which a gap is measured."""

    name: DomainName
    axis: Callable[[Grid], Axis]  # its bins
    vector: Callable[[RecordTransforms, Grid], Array]  # [bins] of a record
    label: str  # in tables
    short_label: str  # in figures
    phrase: str  # within a sentence: "lies in ..."
    advice: str  # for a gap that lies here and that no effect explains, with a deciding measurement
    curves: tuple[CurveStyle, ...] = ()  # curves of the domain in a report


def _bins(unit: str, **edges: Sequence[float] | Array) -> Axis:
    lo = np.concatenate([np.asarray(e, float)[:-1] for e in edges.values()])
    hi = np.concatenate([np.asarray(e, float)[1:] for e in edges.values()])
    kind = [name for name, e in edges.items() for _ in range(len(e) - 1)]
    return Axis(lo, hi, tuple(kind), unit)


def _frequency(record: RecordTransforms, grid: Grid) -> Array:
    """Log level of the spectrum between its lines, over scale^2 per band; log excess of each band's largest line."""
    unit = record.frame.scale**2
    starts, stop, counts = _level_bins(grid, record.fs_hz, record.smooth.size)
    level = np.add.reduceat(record.smooth[:stop], starts) / counts * (grid.top_hz / unit)
    lines = _largest(_raw_excess(record), record.df_hz, grid, "lines_hz")
    return np.concatenate((np.log(level + 1e-10), lines))


def _order(record: RecordTransforms, grid: Grid) -> Array:
    """Log excess of the largest line near each shaft order."""
    return _largest(_raw_excess(record), record.df_hz, grid, "orders", record.shaft_hz)


def _envelope_order(record: RecordTransforms, grid: Grid) -> Array:
    """Log excess of the lines of the squared-envelope spectrum, and its log floor."""
    envelope = record.envelope
    spectrum, df_orders = envelope.spectrum, envelope.df_hz / record.shaft_hz
    # Beyond the width of the band the spectrum ends, in records and twin alike.
    cut = spectrum[: max(int(grid.top_envelope_order * 1.1 / df_orders) + 2, 16)]
    floor = _floor(cut) + 1e-15
    lines = _largest(np.log(cut / floor + 1e-3), df_orders, grid, "envelope_orders")
    broad = grid.envelope_floor
    places = np.clip(((broad[1:] + broad[:-1]) / 2 / df_orders).astype(int), 0, cut.size - 1)
    # The floor falls with the length of the record; its density per order does not.
    return np.concatenate((lines, np.log(floor[places] / df_orders)))


def _amplitude_axis(grid: Grid) -> Axis:
    middles = np.concatenate(([0.0], (_QUANTILES[1:] + _QUANTILES[:-1]) / 2, [1.0]))
    tails = np.concatenate((_TAILS, [1.0]))
    return _bins(
        "quantile", shape=middles, asymmetry=tails, level=[0.0, 1.0], extreme=[0.999, 1.0], repeated=[0.0, 1.0]
    )


def _amplitude(record: RecordTransforms, grid: Grid) -> Array:
    """Log quantiles of |x| / rms, log asymmetry, log rms / scale, and how often the extreme and equal samples occur."""
    x = record.centred
    n, rms = x.size, max(np.sqrt(record.mean_square), 1e-9 * record.frame.scale)
    modulus = np.abs(x)
    quantiles = order_statistics(modulus, np.minimum(np.ceil(_QUANTILES * n).astype(int), n) - 1)
    shape = np.log(quantiles / rms + 1e-3)
    far = np.minimum((0.5 + _TAILS / 2) * n, n - 1).astype(int)
    tails = order_statistics(x, np.concatenate((far, n - 1 - far)))
    high, low = tails[: far.size], -tails[far.size :]
    asymmetry = np.log((np.maximum(high, 0) + 0.05 * rms) / (np.maximum(low, 0) + 0.05 * rms))
    # Gaussian noise has one sample at its extreme, a clipped record has many. The constant equalises small parts.
    extreme = np.count_nonzero(modulus >= 0.999 * quantiles[-1]) / n
    repeated = np.count_nonzero(record.x[1:] == record.x[:-1]) / n
    rest = (np.log(rms / record.frame.scale), np.log(extreme + 3e-4 + 2 / n), np.log(repeated + 3e-3))
    return np.concatenate((shape, asymmetry, rest))


def _time_axis(grid: Grid) -> Axis:
    parts = np.linspace(0, grid.duration_s, SEGMENTS + 1)
    return _bins("s", level=parts, kurtosis=parts, unevenness=[0.0, grid.duration_s], peak=[0.0, grid.duration_s])


def _time(record: RecordTransforms, grid: Grid) -> Array:
    """Log rms (over the record's) and log kurtosis of 16 parts; how unequal they are, and the largest kurtosis."""
    x = record.centred
    parts = x[: x.size // SEGMENTS * SEGMENTS].reshape(SEGMENTS, -1)
    square = parts * parts
    power = square.mean(axis=1)
    fourth = np.einsum("ij,ij->i", square, square) / square.shape[1]
    level = 0.5 * np.log(power / max(record.mean_square, _TINY) + 1e-4)
    kurtosis = np.log((fourth + _TINY) / (power**2 + 1e-8 * record.mean_square**2 + _TINY) + 0.1)
    return np.concatenate((level, kurtosis, (np.log(level.std() + 0.01), kurtosis.max())))


def _condition(record: RecordTransforms, grid: Grid) -> Array:
    """Log rms, log kurtosis, log power in the band of impacts and log part of lines, compared between conditions."""
    power = record.mean_square
    square = record.centred**2
    kurtosis = float(square @ square) / square.size / max(power**2, _TINY)
    smooth = float(record.smooth.sum()) * record.fs_hz / 2 / record.smooth.size
    return np.array(
        [
            0.5 * np.log(power / record.frame.scale**2 + 1e-18),
            np.log(kurtosis + 0.1),
            0.5 * np.log(record.envelope.mean / record.frame.scale**2 + 1e-18),
            # Part of the power that a smooth spectrum leaves unexplained.
            np.log(max(1 - smooth / max(power, _TINY), 0.0) + 0.1),
        ]
    )


def _raw_excess(record: RecordTransforms) -> Array:
    """[bins] Log of the raw tone spectrum over its local floor; made once a record."""
    cached: Array | None = record.__dict__.get("_raw_excess")
    if cached is None:
        tones = record.tones
        cached = np.log(tones / (_floor(tones) + 1e-9 * record.mean_square / tones.size + _TINY) + 1e-3)
        record.__dict__["_raw_excess"] = cached
    return cached


def _floor(power: Array, width: int = 40) -> Array:
    """[bins] Level between the lines: medians of blocks, interpolated in the logarithm."""
    width = max(min(width, power.size // 4), 1)
    count = power.size // width
    logs = np.log(medians(power[: count * width].reshape(count, width)) + _TINY)
    floor = between_blocks(logs, width, power.size, 0.5 * (1 - width % 2))
    return np.asarray(np.exp(floor, out=floor))


def _largest(values: Array, step: float, grid: Grid, edges: str, factor: float = 1.0) -> Array:
    """[edges - 1] Largest bin of a spectrum between edges of the grid, times a factor; the nearest bin where there is
    none."""
    starts, stop = _line_bins(grid, edges, factor, step, values.size)
    return np.asarray(np.maximum.reduceat(values[:stop], starts))


@lru_cache(maxsize=2048)
def _line_bins(grid: Grid, edges: str, factor: float, step: float, size: int) -> tuple[NDArray[np.int64], int]:
    """First bin of each band of a spectrum of `size` bins, and where the last one ends."""
    bins = np.clip(np.round(getattr(grid, edges) * factor / step).astype(int), 1, size - 1)
    bins[1:] = np.maximum(bins[1:], bins[:-1])
    stop = min(max(int(bins[-1]), int(bins[-2]) + 1), size)
    return np.minimum(bins[:-1], stop - 1), stop


@lru_cache(maxsize=32)
def _level_bins(grid: Grid, fs_hz: float, size: int) -> tuple[NDArray[np.int64], int, NDArray[np.int64]]:
    """First bin of each band of a smooth spectrum of `size` bins, the end of the last, and their numbers of bins."""
    middles_hz = (np.arange(size) + 0.5) * (fs_hz / 2 / size)
    edges = np.searchsorted(middles_hz, grid.levels_hz)
    starts = np.minimum(edges[:-1], size - 1)
    return starts, max(int(edges[-1]), int(starts[-1]) + 1), np.maximum(np.diff(edges), 1)


DOMAINS: Final = (
    Domain(
        name="frequency",
        axis=lambda grid: _bins("Hz", level=grid.levels_hz, lines=grid.lines_hz),
        vector=_frequency,
        label="spectrum",
        short_label="spectrum",
        phrase="the spectrum",
        advice="In the raw spectrum, a broad peak fixed in Hz indicates a mode or noise, narrow lines a disturbance. "
        "To decide, " + measurements.HAMMER + ".",
        curves=(
            CurveStyle("spectrum", "level", "Spectrum between its lines", "dB", PER_DECIBEL),
            CurveStyle("lines", "lines", "Lines of the spectrum", "dB over the floor", PER_DECIBEL),
        ),
    ),
    Domain(
        name="envelope_order",
        axis=lambda grid: _bins("shaft orders", lines=grid.envelope_orders, floor=grid.envelope_floor),
        vector=_envelope_order,
        label="envelope spectrum",
        short_label="envelope",
        phrase="the envelope spectrum",
        advice="Impacts or modulations repeat at these multiples of shaft speed. Check the bearing's geometry and the "
        "other rotating parts. To decide, " + measurements.TACHO + ".",
        curves=(CurveStyle("envelope", "lines", "Envelope spectrum", "dB over the floor", PER_DECIBEL),),
    ),
    Domain(
        name="order",
        axis=lambda grid: _bins("shaft orders", lines=grid.orders),
        vector=_order,
        label="order spectrum",
        short_label="orders",
        phrase="the order spectrum",
        advice="Some part turns at these multiples of shaft speed: list shafts, gears and fans with their ratios. To "
        "decide, " + measurements.OTHER_SPEED + ".",
        curves=(CurveStyle("order", "lines", "Order spectrum", "dB over the floor", PER_DECIBEL),),
    ),
    Domain(
        name="amplitude",
        axis=_amplitude_axis,
        vector=_amplitude,
        label="amplitude distribution",
        short_label="amplitude",
        phrase="the amplitude distribution",
        advice="The distribution of the samples differs there. To decide, " + measurements.CHAIN + ".",
        curves=(CurveStyle("amplitude", "shape", "Amplitudes |x|", "dB of rms", 2 * PER_DECIBEL),),
    ),
    Domain(
        name="time",
        axis=_time_axis,
        vector=_time,
        label="time within the record",
        short_label="time",
        phrase="time within the record",
        advice="The records change over time: check for run-up, load steps, or a fault of the recorder. To decide, "
        "record longer at constant speed and load.",
        curves=(CurveStyle("time", "level", "Level within the record", "dB of the record's rms", 2 * PER_DECIBEL),),
    ),
    Domain(
        name="condition",
        axis=lambda grid: _bins("", level=[0.0, 1.0], kurtosis=[0.0, 1.0], band=[0.0, 1.0], lines=[0.0, 1.0]),
        vector=_condition,
        label="operating condition",
        short_label="condition",
        phrase="the operating conditions",
        advice="The gap lies at some operating conditions. Check the metadata of those records first (speed, load, "
        "fault label), then record that condition again.",
    ),
)
"""In the order of the feature vector."""

DOMAIN: Final = {domain.name: domain for domain in DOMAINS}
"""By name."""
