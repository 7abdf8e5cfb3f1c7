"""Lines of the records that the twin lacks, fixed in Hz, in shaft orders, or at orders about a carrier.

records --> heights over the local floor --quantile over records, at a place in Hz or in orders--> test --+
twin ----> heights at the same places -------------------------------------------------------------------+--> lines
kinematics --> lines of impacts and their side lines, which are left out --------------------------------+
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import find_peaks
from scipy.stats import beta, norm

from twingap.bearing import Bearing
from twingap.effects import Effect, LineSpectrum
from twingap.gap.search.carrier_lines import CarrierLine, carrier_lines
from twingap.identification.calibrate import thinned
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms
from twingap.twins.simulator import Simulator

if TYPE_CHECKING:
    from twingap.gap.search.evidence import Evidence

_LEVEL: Final = 0.01
"""Family-wise level of the test for lines. A larger value finds more lines, false ones among them."""
_LEVEL_OF_STATE: Final = 0.05
"""Level at which a line has to stand out in each state. A smaller value leaves out lines that some states mask."""
_PART: Final = 0.3
"""Quantile over records of a line's height that is tested. A smaller value asks for the line in more of them."""
_LOUDER: Final = 2.0
"""Power of a line over that of the twin at its place from which it is missing in the twin."""
_RECORDS: Final = 8
"""Records of each state that are searched for lines. More find weaker lines and take longer."""
_LONGEST: Final = 1 << 18
"""Largest number of samples of these records. Longer records resolve closer lines."""
_MOST: Final = 512
"""Largest number of lines. More take longer to simulate."""
_FLOOR_BINS: Final = 40
"""Bins of a block whose median is the floor. More follow the noise less closely and hold fewer lines."""
_LOWEST: Final = 0.02
"""Part of the places at which heights are taken to be those of noise. A larger value finds fewer lines where there are
many."""
_SAME_BINS: Final = 2
"""Bins around a line that belong to it."""
_FEWEST_RECORDS: Final = 2
"""Records in which lines are sought. With one alone, any tone of that moment is a line."""
_SWEPT_BINS: Final = 6
"""Bins that a line in orders covers over the records, up to which it is found at a fixed frequency, too. A larger value
takes more lines at a fixed frequency for lines in orders."""
_FAULT_LINE: Final = 0.008
"""Relative distance from a fault's order within which its impacts are sought. A larger value follows more slip."""
_FAULT_STEPS: Final = 81
"""Orders that are tried within it. More place high multiples more exactly."""
_FAULT_LINES: Final = 12
"""Multiples of a fault's order that show where it is. More place it more exactly unless jitter smears them."""
_SIDE_LINES: Final = 2
"""Side lines of these multiples, on each side, that are those of impacts. A larger value leaves out more lines."""
_COMB_ERROR: Final = 0.0005
"""Relative error of the multiples of a fault's order. A larger value leaves out more lines at high orders."""


def missing_lines(
    evidence: Evidence,
    simulator: Simulator,
    effects: Sequence[Effect],
    fault: str = "",
    common: LineSpectrum | None = None,
) -> LineSpectrum:
    """Lines that the twin lacks, in the records of this fault of the fit part, or in all ("").

    Lines among `effects` are measured anew. `common` are lines of all records, to which those of the fault are added.
    Amplitudes are multiples of the twin's reference RMS.
    """
    others = tuple(effect for effect in effects if not isinstance(effect, LineSpectrum))
    fit = evidence.calibrated.fit
    fit = fit.take([i for i, c in enumerate(fit.conditions) if str(c.fault) == fault]) if fault else fit
    records = thinned(fit, _RECORDS)
    longest = [replace(c, n_samples=min(c.n_samples, _LONGEST)) for c in records.conditions]
    real = [
        RecordTransforms(record.samples[:_LONGEST], condition, evidence.frame)
        for record, condition in zip(records, longest, strict=True)
    ]
    made = [
        RecordTransforms(record.samples, record.condition, evidence.frame)
        for record in evidence.simulated(simulator, others, longest, 3)
    ]
    in_hz, in_orders = (_peaks(real, made, evidence.frame.bearing, by_order=by_order) for by_order in (False, True))
    shaft = np.array([record.shaft_hz for record in real])
    spread = float(np.ptp(shaft) / shaft.mean())
    resolution = max(record.df_hz for record in real)
    lines: list[Line] = []
    for place, amplitude in in_orders:
        moves = place * shaft.mean() * spread > 3 * resolution
        whole = abs(place - round(place)) * shaft.mean() < resolution and round(place) >= 1
        if moves or whole:
            lines.append(Line(place, amplitude, by_order=True))
    taken = np.array([line.place for line in lines]) * shaft.mean()
    for place, amplitude in in_hz:
        # Where speeds differ by little over the resolution, a line is found either way.
        swept = place * spread
        near = taken.size > 0 and swept <= _SWEPT_BINS * resolution
        if not (near and float(np.abs(taken - place).min()) < _SAME_BINS * resolution + 0.5 * swept):
            lines.append(Line(place, amplitude, by_order=False))
    about = carrier_lines(real, made) if common is None else []
    shaft_hz, reference = float(shaft.mean()), simulator.reference_rms
    near_hz = [line.hz(shaft_hz) for line in lines]
    about = [
        line for line in about
        if all(abs(line.carrier_hz + line.order * shaft_hz - other) > _SAME_BINS * resolution for other in near_hz)
    ]  # fmt: skip
    lines = [line._replace(amplitude=line.amplitude / reference) for line in lines]
    if common is not None:
        lines = _joined(_of_effect(common), lines, shaft_hz, _SAME_BINS * resolution)
    lines = sorted(lines, key=lambda line: line.amplitude, reverse=True)[:_MOST]
    first, second = (sorted(line for line in lines if line.by_order == kind) for kind in (False, True))
    return LineSpectrum(
        frequencies_hz=tuple(line.place for line in first), amplitudes=tuple(line.amplitude for line in first),
        orders=tuple(line.place for line in second), order_amplitudes=tuple(line.amplitude for line in second),
        **_about_carriers(about, reference, common),
    )  # fmt: skip


def _about_carriers(lines: Sequence[CarrierLine], reference: float, common: LineSpectrum | None) -> dict[str, Any]:
    """Parameters of the lines about carriers; those of all records where these are given."""
    if common is not None:
        return {name: getattr(common, name) for name in ("carriers_hz", "carrier_orders", "carrier_amplitudes")}
    return {
        "carriers_hz": tuple(line.carrier_hz for line in lines), "carrier_orders": tuple(line.order for line in lines),
        "carrier_amplitudes": tuple(line.amplitude / reference for line in lines),
    }  # fmt: skip


class Line(NamedTuple):
    """A line at a place in Hz, or in shaft orders."""

    place: float
    amplitude: float
    by_order: bool

    def hz(self, shaft_hz: float) -> float:
        """Its frequency at a shaft speed."""
        return self.place * (shaft_hz if self.by_order else 1.0)


def _of_effect(effect: LineSpectrum) -> list[Line]:
    """The lines of an effect."""
    fixed = [Line(f, a, by_order=False) for f, a in zip(effect.frequencies_hz, effect.amplitudes, strict=True)]
    return fixed + [Line(o, a, by_order=True) for o, a in zip(effect.orders, effect.order_amplitudes, strict=True)]


def _joined(common: Sequence[Line], own: Sequence[Line], shaft_hz: float, same_hz: float) -> list[Line]:
    """The lines that all records have, as strong as some records have them, and the other lines of these records.

    Records at one speed do not tell whether a line is fixed in Hz or in orders; all records do.
    """
    left, joined = list(own), []
    for line in common:
        near = min(left, key=lambda other: abs(other.hz(shaft_hz) - line.hz(shaft_hz)), default=None)
        if near is not None and abs(near.hz(shaft_hz) - line.hz(shaft_hz)) < same_hz:
            left.remove(near)
            line = line._replace(amplitude=near.amplitude)
        joined.append(line)
    return joined + left


def _peaks(
    real: Sequence[RecordTransforms], made: Sequence[RecordTransforms], bearing: Bearing, *, by_order: bool
) -> list[tuple[float, float]]:
    """(place in Hz or orders, amplitude) of lines in most records that the twin lacks.

    A low quantile over records of the log power over the local floor is tested, so that a line has to be in most of
    them at one place: a line in Hz is not at one order where speeds differ, and the other way round.
    """
    steps = [record.df_hz / (record.shaft_hz if by_order else 1.0) for record in real]
    tops = [record.fs_hz / 2 / (record.shaft_hz if by_order else 1.0) for record in real]
    step, top = max(steps), 0.98 * min(tops)
    count = int(top / step)
    if count < 4 * _FLOOR_BINS or len(real) < _FEWEST_RECORDS:
        return []
    places = np.arange(count) * step
    over, power, own = (np.empty((len(real), count)) for _ in range(3))
    for row, (record, twin) in enumerate(zip(real, made, strict=True)):
        floor = _floor(record.tones)
        bins = record.df_hz / (record.shaft_hz if by_order else 1.0)
        over[row] = _on_grid(np.log(record.tones / floor + 1e-300), bins, step, count)
        power[row] = _on_grid(record.tones, bins, step, count)
        # The twin's floor does not count as a line of the twin.
        own[row] = np.maximum(
            _on_grid(twin.tones, bins, step, count) - _on_grid(_floor(twin.tones), bins, step, count), 0
        )
    # A line lies in neighbouring bins of records whose speeds or lengths differ a little.
    over, power, own = (maximum_filter1d(of, 2 * _SAME_BINS - 1, axis=1) for of in (over, power, own))
    height = np.quantile(over, _PART, axis=0, method="lower")
    # The largest of neighbouring bins, and of the bins within a step of the grid.
    bins = (2 * _SAME_BINS - 1) * math.ceil(step / min(steps))
    limit = np.full(count, _limit(height, len(real), bins, _LEVEL / count))
    low_hz, high_hz = real[0].frame.band_hz
    places_hz = places * (float(np.mean([record.shaft_hz for record in real])) if by_order else 1.0)
    if (inside := (places_hz > low_hz) & (places_hz < high_hz)).any():
        # Lines in the band of impacts are theirs, with many side lines, unless they are higher than most of these.
        limit[inside] = np.maximum(limit[inside], _limit_among_lines(height[inside], _LEVEL / count))
    everywhere = np.ones(count, bool)
    states = [str(record.condition.fault) for record in real]
    for state in dict.fromkeys(states):  # lines of one fault alone are those of its impacts
        rows = [i for i, s in enumerate(states) if s == state]
        own_height = np.quantile(over[rows], _PART, axis=0, method="lower")
        everywhere &= own_height > _limit(own_height, len(rows), bins, _LEVEL_OF_STATE)
    level, twin_level = np.median(power, axis=0), np.median(own, axis=0)
    combs = [_comb(record, bearing) for record in real]
    found = []
    for at in find_peaks(np.where(everywhere, height, -np.inf), height=limit)[0]:
        if level[at] < _LOUDER * float(twin_level[at]):
            continue
        place = float(places[at])
        if not by_order and place < 2 * step:
            continue
        if _of_impacts(place, by_order, real, combs):
            continue
        found.append((place, math.sqrt(2 * max(float(level[at] - twin_level[at]), 0.0))))
    return found


def _limit(heights: Array, records: int, bins: int, level: float) -> float:
    """Height over the floor that noise exceeds with this probability.

    `heights` [places] are quantiles `_PART` over records of the largest log power over the floor of some bins. The
    power of noise is exponentially distributed over its median. Where the lowest heights are above those of noise, as
    on a sloping floor, the limit is higher by as much; a spectrum full of lines does not raise it.
    """
    least = math.floor(_PART * (records - 1))  # records that may be lower

    def of_noise(part: float) -> float:
        # Of `records` heights, more than `least` are below with this probability: a beta quantile.
        below = float(beta.ppf(part, least + 1, records - least))
        return math.log(max(-math.log1p(-(below ** (1 / bins))), 1e-300) / math.log(2))

    excess = float(np.quantile(heights, _LOWEST)) - of_noise(_LOWEST)
    return of_noise(1 - level) + max(excess, 0.0)


def _limit_among_lines(heights: Array, level: float) -> float:
    """Height above which others of a spectrum full of lines are with this probability, from the lower half of them."""
    middle = float(np.median(heights))
    return middle + (middle - float(np.quantile(heights, 0.25))) / 0.6745 * float(norm.isf(level))


def _comb(record: RecordTransforms, bearing: Bearing) -> Array:
    """[lines] Orders of the lines of a record's impacts and of their side lines; empty without a known fault.

    The fault's order is that, near the kinematic one, at whose first multiples the spectrum is highest.
    """
    if record.fault_order is None:
        return np.empty(0)
    bins_per_order = record.shaft_hz / record.df_hz
    heights = maximum_filter1d(np.log(record.tones / _floor(record.tones) + 1e-300), 3)
    orders = record.fault_order * np.linspace(1 - _FAULT_LINE, 1 + _FAULT_LINE, _FAULT_STEPS)
    places = np.round(orders[:, None] * np.arange(1, _FAULT_LINES + 1) * bins_per_order).astype(int)
    order = orders[
        np.argmax(np.where(places < heights.size, heights[np.minimum(places, heights.size - 1)], 0).sum(axis=1))
    ]
    aside = bearing.side_line_order(str(record.condition.fault)) or 0.0
    multiples = order * np.arange(1, int(heights.size / bins_per_order / order) + 2)
    sides = aside * np.arange(-_SIDE_LINES, _SIDE_LINES + 1)
    return np.unique(multiples[:, None] + sides)


def _of_impacts(place: float, by_order: bool, real: Sequence[RecordTransforms], combs: Sequence[Array]) -> bool:
    """Whether a line is one of impacts' in most records."""
    hits = 0
    for record, comb in zip(real, combs, strict=True):
        if comb.size:
            order = place if by_order else place / record.shaft_hz
            near = _SAME_BINS * record.df_hz / record.shaft_hz + _COMB_ERROR * order
            hits += float(np.abs(comb - order).min()) < near
    return hits > len(real) / 2


def _on_grid(values: Array, step: float, wide: float, count: int) -> Array:
    """[count] Largest of the bins of a spectrum within each bin of a coarser grid."""
    edges = np.round((np.arange(count) - 0.5) * wide / step + 1e-9).astype(int)
    edges = np.clip(edges, 0, values.size - 1)
    stop = min(round((count - 0.5) * wide / step), values.size)
    return np.asarray(np.maximum.reduceat(values[: max(stop, edges[-1] + 1)], edges))


def _floor(power: Array) -> Array:
    """[bins] Level between the lines: medians of blocks."""
    count = max(power.size // _FLOOR_BINS, 1)
    levels = np.median(power[: count * _FLOOR_BINS].reshape(count, -1), axis=1) + 1e-300
    at = (np.arange(count) + 0.5) * _FLOOR_BINS
    return np.asarray(np.exp(np.interp(np.arange(power.size) + 0.5, at, np.log(levels))))
