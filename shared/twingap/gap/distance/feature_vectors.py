"""Records as a few interpretable vectors with named bins: what the gap is measured, tested and localised in.

RecordView --frequency, envelope_order, order, amplitude, time, condition--> one vector each, on a common Grid
many, one after the other --measure--> Views: domain -> [records, bins]

All values are logarithms of dimensionless quantities, so that differences between records and twin add up. Only the
vectors are kept: thousands of records pass in bounded memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.gap.report.model import Domain
from twingap.records import Condition
from twingap.signal.order_statistics import order_statistics
from twingap.signal.record_transforms import RecordView, medians

Array = NDArray[np.float64]

DOMAINS: Final[tuple[Domain, ...]] = ("frequency", "envelope_order", "order", "amplitude", "time", "condition")
FEWEST_SAMPLES: Final = 64
SEGMENTS: Final = 16
"""Equal parts of a record in the time view."""

_LEVELS: Final = 40
_QUANTILES: Final = np.array([0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 1.0])
_TAILS: Final = np.array([0.5, 0.9, 0.99, 0.999])
_TINY: Final = 1e-300


@dataclass(frozen=True)
class Axis:
    """Bins of one view.

    Parameters
    ----------
    lo, hi : Array [bins]
        Bounds of each, in `unit`.
    kind : tuple of str [bins]
        What each bin measures ("level", "lines", ...); the bins of one kind ascend.
    unit : str
    """

    lo: Array
    hi: Array
    kind: tuple[str, ...]
    unit: str

    @cached_property
    def weight(self) -> Array:
        """[bins] Part of each bin in its view: kinds count alike, bins alike within their kind; sums to 1."""
        kinds = np.array(self.kind)
        names, counts = np.unique(kinds, return_counts=True)
        share = {name: 1 / (count * names.size) for name, count in zip(names, counts, strict=True)}
        return np.array([share[kind] for kind in self.kind])


@dataclass(frozen=True)
class Grid:
    """Common bins of all records that are to be compared.

    Parameters
    ----------
    top_hz : float
        Half the smallest sampling rate.
    top_order : float
        The highest shaft order that every record can show.
    top_envelope_order : float
    duration_s : float
        Typical record; the unit of the time view.

    Notes
    -----
    Frequencies: 40 equal bands for the level between the lines; for the lines, bands of 10 Hz up to 500 Hz and of 4 %
    above. Orders: steps of a quarter, so that half orders have bins of their own; whole orders above 40. Envelope
    orders: steps of a tenth, which part the cage's sidebands from the shaft's.
    """

    top_hz: float
    top_order: float
    top_envelope_order: float
    duration_s: float

    @classmethod
    def of(cls, conditions: Sequence[Condition], bearing: Bearing) -> Grid:
        """For these records of this bearing. Real and simulated records must be measured on one and the same grid.

        Raises
        ------
        TwingapError
            For no records, or one of fewer than 64 samples.
        """
        if not conditions:
            raise TwingapError("no records to measure", where="views")
        for condition in conditions:
            _long_enough(condition.n_samples, condition.name)
        orders = min(condition.fs_hz / 2 / (condition.speed_rpm / 60) for condition in conditions)
        return cls(
            top_hz=min(condition.fs_hz for condition in conditions) / 2,
            top_order=float(np.floor(min(orders * 0.98, 80.0))),
            top_envelope_order=float(np.ceil(min(2.2 * bearing.bpfi + 1, 30.0))),
            duration_s=float(np.median([condition.duration_s for condition in conditions])),
        )

    @cached_property
    def levels_hz(self) -> Array:
        """Edges of the bands of the smooth level, Hz."""
        return np.linspace(0, self.top_hz, _LEVELS + 1)

    @cached_property
    def lines_hz(self) -> Array:
        """Edges of the bands of the lines, Hz."""
        low = np.arange(5.0, min(505.0, self.top_hz + 1e-9), 10.0)
        count = int(np.ceil(np.log(self.top_hz / low[-1]) / 0.04)) if self.top_hz > low[-1] * 1.04 else 0
        high = np.geomspace(low[-1], self.top_hz, count + 1)[1:] if count else np.empty(0)
        return np.concatenate((low, high)) if low.size + high.size > 1 else np.array([0.0, self.top_hz])

    @cached_property
    def orders(self) -> Array:
        """Edges of the bands of shaft orders, centred on quarters (whole numbers above 40)."""
        fine = np.arange(0.375, min(40.0, max(self.top_order, 1.0)) + 0.2, 0.25)
        coarse = np.arange(41.5, self.top_order + 0.6, 1.0) if self.top_order > 41 else np.empty(0)
        return np.concatenate((fine, coarse))

    @cached_property
    def envelope_orders(self) -> Array:
        """Edges of the bands of envelope orders, centred on tenths."""
        return np.arange(0.15, self.top_envelope_order + 0.06, 0.1)

    @cached_property
    def axes(self) -> dict[Domain, Axis]:
        """Bins of each view, by domain."""
        middles = np.concatenate(([0.0], (_QUANTILES[1:] + _QUANTILES[:-1]) / 2, [1.0]))
        tails = np.concatenate((_TAILS, [1.0]))
        parts = np.linspace(0, self.duration_s, SEGMENTS + 1)
        broad = np.linspace(0.15, self.top_envelope_order, 9)
        return {
            "frequency": _axis("Hz", level=self.levels_hz, lines=self.lines_hz),
            "envelope_order": _axis("shaft orders", lines=self.envelope_orders, floor=broad),
            "order": _axis("shaft orders", lines=self.orders),
            "amplitude": _axis(
                "quantile", shape=middles, asymmetry=tails, level=[0.0, 1.0], extreme=[0.999, 1.0], repeated=[0.0, 1.0]
            ),
            "time": _axis("s", level=parts, kurtosis=parts, unrest=[0.0, self.duration_s], peak=[0.0, self.duration_s]),
            "condition": _axis("", level=[0.0, 1.0], kurtosis=[0.0, 1.0], band=[0.0, 1.0], lines=[0.0, 1.0]),
        }

    def vector(self, view: RecordView) -> dict[Domain, Array]:
        """All views of one record.

        Raises
        ------
        TwingapError
            For a record of fewer than 64 samples.
        """
        _long_enough(view.x.size, view.condition.name)
        return {domain: make(view, self) for domain, make in _VIEWS.items()}


@dataclass(frozen=True)
class Views:
    """Views of a set of records.

    Parameters
    ----------
    values : Mapping, domain -> Array [records, bins]
    axes : Mapping, domain -> Axis
    conditions : tuple of Condition [records]
    """

    values: Mapping[Domain, Array]
    axes: Mapping[Domain, Axis]
    conditions: tuple[Condition, ...]

    def __len__(self) -> int:
        return len(self.conditions)

    @property
    def domains(self) -> tuple[Domain, ...]:
        """In the order of `matrix`."""
        return tuple(self.values)

    @cached_property
    def matrix(self) -> Array:
        """[records, all bins] The views side by side."""
        return np.concatenate(list(self.values.values()), axis=1)

    def columns(self, domain: Domain) -> slice:
        """Where a domain stands in `matrix`."""
        sizes = [self.values[name].shape[1] for name in self.domains]
        place = self.domains.index(domain)
        return slice(sum(sizes[:place]), sum(sizes[: place + 1]))

    @cached_property
    def weight(self) -> Array:
        """[all bins] Part of each bin in the whole: views count alike, kinds alike within a view; sums to 1."""
        return np.concatenate([self.axes[domain].weight for domain in self.domains]) / len(self.domains)

    def take(self, places: Sequence[int] | NDArray[np.int64]) -> Views:
        """The records at these places."""
        kept = np.asarray(places, dtype=int)
        return Views(
            {domain: values[kept] for domain, values in self.values.items()},
            self.axes,
            tuple(self.conditions[i] for i in kept),
        )


def measure(views: Iterable[RecordView], grid: Grid) -> Views:
    """Measure records one after the other; a generator's records need not be in memory together.

    Parameters
    ----------
    views : iterable of RecordView
    grid : Grid
        The same for all sets that are to be compared.

    Returns
    -------
    Views

    Raises
    ------
    TwingapError
        For no records, or one of fewer than 64 samples.
    """
    rows: dict[Domain, list[Array]] = {domain: [] for domain in DOMAINS}
    conditions: list[Condition] = []
    for view in views:
        for domain, vector in grid.vector(view).items():
            rows[domain].append(vector)
        conditions.append(view.condition)
    if not conditions:
        raise TwingapError("no records to measure", where="views")
    return Views({domain: np.stack(own) for domain, own in rows.items()}, grid.axes, tuple(conditions))


def _frequency(view: RecordView, grid: Grid) -> Array:
    """Log level of the spectrum between its lines, over scale^2 per band; log excess of the largest line over it."""
    unit = view.frame.scale**2
    edges = np.searchsorted(view.smooth_hz, grid.levels_hz)
    starts = np.minimum(edges[:-1], view.smooth.size - 1)
    sums = np.add.reduceat(view.smooth[: max(edges[-1], starts[-1] + 1)], starts)
    level = sums / np.maximum(np.diff(edges), 1) * (grid.top_hz / unit)
    lines = _largest(_raw_excess(view), view.df_hz, grid.lines_hz)
    return np.concatenate((np.log(level + 1e-10), lines))


def _order(view: RecordView, grid: Grid) -> Array:
    """Log excess of the largest line near each shaft order."""
    return _largest(_raw_excess(view), view.df_hz, grid.orders * view.shaft_hz)


def _envelope_order(view: RecordView, grid: Grid) -> Array:
    """Log excess of the lines of the squared-envelope spectrum, and its log floor."""
    envelope = view.envelope
    spectrum, df_orders = envelope.spectrum, envelope.df_hz / view.shaft_hz
    # Orders beyond the width of the band show the end of its spectrum, in records and twin alike.
    cut = spectrum[: max(int(grid.top_envelope_order * 1.1 / df_orders) + 2, 16)]
    floor = _floor(cut) + 1e-15
    lines = _largest(np.log(cut / floor + 1e-3), df_orders, grid.envelope_orders)
    broad = np.linspace(0.15, grid.top_envelope_order, 9)
    places = np.clip(((broad[1:] + broad[:-1]) / 2 / df_orders).astype(int), 0, cut.size - 1)
    # The floor of a longer record is lower; its density per order is not.
    return np.concatenate((lines, np.log(floor[places] / df_orders)))


def _amplitude(view: RecordView, grid: Grid) -> Array:
    """Log quantiles of |x| / rms, log asymmetry, log rms / scale, and how often the extreme and equal samples occur."""
    x = view.x - view.x.mean()
    n, rms = x.size, max(np.sqrt(view.mean_square), 1e-9 * view.frame.scale)
    modulus = np.abs(x)
    places = np.minimum(np.ceil(_QUANTILES * n).astype(int), n) - 1
    quantiles = order_statistics(modulus, places)
    shape = np.log(quantiles / rms + 1e-3)
    far = np.minimum((0.5 + _TAILS / 2) * n, n - 1).astype(int)
    tails = order_statistics(x, np.concatenate((far, n - 1 - far)))
    high, low = tails[: far.size], -tails[far.size :]
    asymmetry = np.log((np.maximum(high, 0) + 0.05 * rms) / (np.maximum(low, 0) + 0.05 * rms))
    # Gaussian noise has one sample at its extreme, a converter's rails have many. Small parts are no news.
    extreme = np.count_nonzero(modulus >= 0.999 * quantiles[-1]) / n
    repeated = np.count_nonzero(view.x[1:] == view.x[:-1]) / n
    rest = (np.log(rms / view.frame.scale), np.log(extreme + 3e-4 + 2 / n), np.log(repeated + 3e-3))
    return np.concatenate((shape, asymmetry, rest))


def _time(view: RecordView, grid: Grid) -> Array:
    """Log rms (over the record's) and log kurtosis of 16 parts; how unequal they are, and the largest kurtosis."""
    x = view.x - view.x.mean()
    parts = x[: x.size // SEGMENTS * SEGMENTS].reshape(SEGMENTS, -1)
    square = parts * parts
    power = square.mean(axis=1)
    fourth = np.einsum("ij,ij->i", square, square) / square.shape[1]
    level = 0.5 * np.log(power / max(view.mean_square, _TINY) + 1e-4)
    kurtosis = np.log((fourth + _TINY) / (power**2 + 1e-8 * view.mean_square**2 + _TINY) + 0.1)
    return np.concatenate((level, kurtosis, (np.log(level.std() + 0.01), kurtosis.max())))


def _condition(view: RecordView, grid: Grid) -> Array:
    """What is compared between conditions: log rms, log kurtosis, log power in the impacts' band, log part of lines."""
    x = view.x - view.x.mean()
    power = view.mean_square
    square = x * x
    kurtosis = float(square @ square) / x.size / max(power**2, _TINY)
    smooth = float(view.smooth.sum()) * view.fs_hz / 2 / view.smooth.size
    return np.array(
        [
            0.5 * np.log(power / view.frame.scale**2 + 1e-18),
            np.log(kurtosis + 0.1),
            0.5 * np.log(view.envelope.mean / view.frame.scale**2 + 1e-18),
            # Part of the power that a smooth spectrum leaves unexplained.
            np.log(max(1 - smooth / max(power, _TINY), 0.0) + 0.1),
        ]
    )


_VIEWS: Final[dict[Domain, Callable[[RecordView, Grid], Array]]] = {
    "frequency": _frequency,
    "envelope_order": _envelope_order,
    "order": _order,
    "amplitude": _amplitude,
    "time": _time,
    "condition": _condition,
}


def _raw_excess(view: RecordView) -> Array:
    """[bins] Log of the raw tone spectrum over its local floor; made once a record."""
    cached: Array | None = view.__dict__.get("_raw_excess")
    if cached is None:
        tones = view.tones
        cached = np.log(tones / (_floor(tones) + 1e-9 * view.mean_square / tones.size + _TINY) + 1e-3)
        view.__dict__["_raw_excess"] = cached
    return cached


def _floor(power: Array, width: int = 40) -> Array:
    """[bins] Level between the lines: medians of blocks, joined in the logarithm: cheaper than a running one."""
    width = max(min(width, power.size // 4), 1)
    count = power.size // width
    levels = medians(power[: count * width].reshape(count, width))
    at = (np.arange(count) + 0.5) * width
    return np.asarray(np.exp(np.interp(np.arange(power.size) + 0.5, at, np.log(levels + _TINY))))


def _largest(values: Array, step: float, edges: Array) -> Array:
    """[edges - 1] Largest of a spectrum's bins between each two edges; the nearest bin where none lies between."""
    bins = np.clip(np.round(edges / step).astype(int), 1, values.size - 1)
    bins[1:] = np.maximum(bins[1:], bins[:-1])
    stop = min(max(bins[-1], bins[-2] + 1), values.size)
    return np.asarray(np.maximum.reduceat(values[:stop], np.minimum(bins[:-1], stop - 1)))


def _axis(unit: str, **edges: Sequence[float] | Array) -> Axis:
    lo = np.concatenate([np.asarray(e, float)[:-1] for e in edges.values()])
    hi = np.concatenate([np.asarray(e, float)[1:] for e in edges.values()])
    kind = [name for name, e in edges.items() for _ in range(len(e) - 1)]
    return Axis(lo, hi, tuple(kind), unit)


def _long_enough(samples: int, name: str) -> None:
    if samples < FEWEST_SAMPLES:
        raise TwingapError(
            f"has {samples} samples, at least {FEWEST_SAMPLES} expected", where=f"record {name!r}", mend="leave it out"
        )
