"""Speed reading of one record: log ratios of shaft rate and fault rate to nominal, with errors.

record --periodogram----------> tones at 1x, 2x, 3x, half orders; triplets one order apart -----> ratio (shaft)  --+
       --envelopes of bands --> comb at the fault's order -> its rate -> side lines one order away -> ratio (shaft) +
                                       |                                                                            |
                                       +-----------------------------------------------------------> ratio (comb) --+
                                                                                                                 Reading
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.records import Condition
from twingap.signal.record_transforms import medians, tone_power

Array = NDArray[np.float64]

FEWEST_TURNS: Final = 4.0
"""Turns of the shaft that a record has to hold for its speed to be read. Fewer leave its lines too wide."""
REACH: Final = 0.06
"""Largest relative error of nominal speeds that is searched; wider finds larger errors and more chance matches."""
SLIP_REACH: Final = 0.02
"""Further relative shift of a comb by slip that is searched; wider gives more chance matches."""
COMB: Final = 4.5
"""Sum of log(1 + z / 3) over a comb's harmonics from which it counts as present; lower gives more false combs."""
SHAFT_LINE: Final = 16.0
"""Power over the local mean from which a line counts as present: noise exceeds it in 1e-7 of the bins; lower gives more
false lines."""
LONE_LINE: Final = 40.0
"""The same for a line at 1x that no other line confirms; higher, as real spectra are not flat at low frequencies."""
ORDERS: Final = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Orders of the shaft at which tones are searched."""
SMEARED: Final = 1e-3
"""Least relative error of a comb with smeared lines (varying speed or jitter of impacts); larger lowers its weight."""
SHARP: Final = 0.75
"""Fraction of a harmonic's energy within one bin of its maximum from which the rate counts as steady."""
BARRED: Final = 0.008
"""Half the width, in log ratio, of what another bearing's comb bars; larger bars more of a record's own combs."""
SHAFT_LINES: Final = "shaft lines"
SIDEBANDS: Final = "sidebands"
NOT_DETECTED: Final = "not detected"


@dataclass(frozen=True)
class Reading:
    """Speed reading of one record: log ratios to nominal with standard errors, infinite where not detected.

    Parameters
    ----------
    shaft, shaft_sigma : float
        Log ratio of the shaft rate, and its standard error.
    found_by : str
        "shaft lines", "sidebands" or "not detected".
    comb, comb_sigma : float
        Log ratio of the fault's rate to its kinematic rate at nominal speed, and its standard error.
    height : float
        Height of the comb, see `COMB`.
    """

    shaft: float = 0.0
    shaft_sigma: float = math.inf
    found_by: str = NOT_DETECTED
    comb: float = 0.0
    comb_sigma: float = math.inf
    height: float = 0.0


def read_speed(samples: Array, condition: Condition, bearing: Bearing, barred: float = math.nan) -> Reading:
    """Speed reading of one record.

    Parameters
    ----------
    samples : Array [n]
    condition : Condition
        With the nominal speed; the comb is searched where the fault is known.
    bearing : Bearing
    barred : float
        Log ratio about which no comb of the fault is sought, as another bearing's lies there; NaN for none.

    Returns
    -------
    Reading
    """
    x = np.asarray(samples, float)
    shaft_hz = condition.speed_rpm / 60
    if x.size < 64 or not np.ptp(x) > 0 or shaft_hz * condition.duration_s < FEWEST_TURNS:
        return Reading()
    df = condition.fs_hz / x.size
    comb: _Comb | None = None
    if condition.fault not in (None, "healthy", "cage"):
        rate = bearing.fault_order(str(condition.fault)) * shaft_hz
        comb = _find_comb(_envelopes(x, condition.fs_hz, rate, shaft_hz), rate, bearing.ftf * shaft_hz, barred)
    fault_hz = comb.rate_hz if comb is not None else None
    known = condition.fault == "healthy" or comb is not None
    found = _tones(x, df, shaft_hz, fault_hz, triplets=known)
    how = SHAFT_LINES
    if comb is not None:
        aside = _sidebands(comb, shaft_hz)
        if aside is not None and aside[1] < found[1]:
            how = SIDEBANDS
        if aside is not None:
            found = _pooled(found, aside)
    shaft, sigma = found
    return Reading(
        shaft, sigma, how if math.isfinite(sigma) else NOT_DETECTED,
        comb.log_ratio if comb else 0.0, comb.sigma if comb else math.inf, comb.height if comb else 0.0,
    )  # fmt: skip


def comb_of(samples: Array, condition: Condition, bearing: Bearing, fault: str) -> float:
    """Log ratio to nominal of the comb at a fault's order in a record of any state; NaN where there is none."""
    x, shaft_hz = np.asarray(samples, float), condition.speed_rpm / 60
    if x.size < 64 or not np.ptp(x) > 0 or shaft_hz * condition.duration_s < FEWEST_TURNS:
        return math.nan
    rate = bearing.fault_order(fault) * shaft_hz
    comb = _find_comb(_envelopes(x, condition.fs_hz, rate, shaft_hz), rate, bearing.ftf * shaft_hz)
    return math.nan if comb is None else comb.log_ratio


def comb_heights(samples: Array, condition: Condition, bearing: Bearing) -> dict[str, float]:
    """Height of each fault's comb in a record of unknown fault: fault -> height, 0 without a comb."""
    x, shaft_hz = np.asarray(samples, float), condition.speed_rpm / 60
    out = {}
    for fault in ("inner", "outer", "ball"):
        rate = bearing.fault_order(fault) * shaft_hz
        comb = _find_comb(_envelopes(x, condition.fs_hz, rate, shaft_hz), rate, bearing.ftf * shaft_hz)
        out[fault] = comb.height if comb is not None else 0.0
    return out


# ---------------------------------------------------------------------------------------------------------- one record


@dataclass(frozen=True)
class _Comb:
    """A fault's comb in the envelope of one band."""

    rate_hz: float
    log_ratio: float
    sigma: float
    height: float
    power: Array
    z: Array
    df_hz: float
    top: int  # usable bins of the spectrum, limited by the band's width


_Band = tuple[Array, Array, float, int, Array]
"""Power spectrum of the envelope, the same over its local mean, bin spacing, usable bins, squared envelope."""


def _envelopes(x: Array, fs_hz: float, rate_hz: float, shaft_hz: float) -> list[_Band]:
    """Squared envelopes of overlapping bands."""
    df = fs_hz / x.size
    spectrum = scipy.fft.rfft(x - x.mean())
    width = max(spectrum.size // 6, int((3 * rate_hz + 4 * shaft_hz) / df))
    width = min(width, spectrum.size - 1)
    starts = np.unique(np.linspace(1, spectrum.size - width, max(1, 2 * (spectrum.size // width) - 1)).astype(int))
    taper = 1 - np.abs(np.linspace(-1, 1, width)) ** 8
    highest = int(min(width, (6.5 * rate_hz + 4 * shaft_hz) / df))
    m = scipy.fft.next_fast_len(2 * width)
    out = []
    for start in starts:
        padded = np.zeros(m, complex)
        padded[:width] = spectrum[start : start + width] * taper
        z = scipy.fft.ifft(padded)
        squared = z.real**2 + z.imag**2
        power = tone_power(squared / max(float(squared.mean()), 1e-300))[: highest + 4]
        out.append((power, power / _floor(power), df, highest, squared))
    return out


def _floor(power: Array, width: int = 49) -> Array:
    """Mean noise level of a periodogram [bins] from medians of half-overlapping segments, without lines."""
    if power.size < 2 * width:
        return np.full(power.size, max(float(medians(power)) / math.log(2), 1e-300))
    step = width // 2
    windows = np.lib.stride_tricks.sliding_window_view(power, width)[::step]
    places = np.arange(len(windows)) * step + width // 2
    levels = np.maximum(medians(windows), 1e-300)
    return np.asarray(np.exp(np.interp(np.arange(power.size), places, np.log(levels))) / math.log(2))


def _find_comb(envelopes: Sequence[_Band], rate_hz: float, cage_hz: float, barred: float = math.nan) -> _Comb | None:
    """The highest comb of harmonics in any band, but for those about a log ratio; None where none is significant."""
    reach = REACH + SLIP_REACH
    best: tuple[float, float, int] | None = None
    for number, (_, z, df, top, _) in enumerate(envelopes):
        count = min(4, int(top * df / (rate_hz * (1 + reach))))
        if count < 1 or rate_hz * reach < df:  # too few impacts to resolve the search range
            continue
        step = 0.4 * df / (count * rate_hz)
        grid = np.arange(1 - reach, 1 + reach, step)
        at = np.outer(np.arange(1, count + 1), grid) * (rate_hz / df)
        heights = np.log1p(_near(z, at) / 3)
        # A prior that favours nominal speed decides between a comb and its sidebands at cage rate.
        score = heights.sum(axis=0) - (grid - 1) ** 2 / (2 * 0.025**2)
        score[np.abs(np.log(grid) - barred) < BARRED] = -math.inf
        place = int(np.argmax(score))
        threshold = COMB * (0.4 + 0.15 * count)  # fewer harmonics, each of which has to be higher
        if score[place] > threshold and (heights[:, place] > math.log1p(8 / 3)).sum() >= min(2, count):
            height = float(score[place] / threshold)
            if best is None or height > best[0]:
                best = height, float(grid[place]), number
    if best is None:
        return None
    height, ratio, number = best
    power, z, df, top, squared = envelopes[number]
    orders = np.arange(1, 7, dtype=float)
    refined = _fit_lines(power, z, df, orders * rate_hz, ratio, 6.0, top)
    refined = _fit_lines(power, z, df, orders * rate_hz, refined[0] if refined else ratio, 6.0, top)
    if refined is None:
        return None
    ratio, sigma = refined
    smeared = _mean_rate(squared, ratio * rate_hz / df, 0.7 * cage_hz / df, power, z)
    if smeared is not None:
        ratio, sigma = smeared[0] * df / rate_hz, max(sigma, smeared[1])
    return _Comb(ratio * rate_hz, math.log(ratio), sigma / ratio, height * COMB, power, z, df, top)


def _mean_rate(squared: Array, place: float, widest: float, power: Array, z: Array) -> tuple[float, float] | None:
    """Cycles of a smeared comb within the record and their relative error; None where its first harmonic is sharp.

    Where the speed varies, the maximum of a smeared line is a poor estimate of the mean rate. The phase accumulated by
    the first harmonic over the record gives it, where the harmonic is above the noise.
    """
    half = int(min(max(4.0, 0.08 * place), widest))  # excludes sidebands at cage rate
    k = round(place)
    low, high = k - half, k + half + 1
    if half < 4 or low < 2 or high > power.size:
        return None
    own = scipy.fft.rfft(squared - squared.mean())[low:high]
    energy = own.real**2 + own.imag**2
    # `power` is relative to the mean, and of a Hann window: noise of variance s^2 has 3 s^2 / n there, n s^2 here.
    floor = float(power[k] / z[k]) * (squared.mean() * squared.size) ** 2 / 3
    signal = float((energy - floor).sum())
    peak = int(np.argmax(energy))
    sharp = float((energy - floor)[max(peak - 1, 0) : peak + 2].sum())
    if signal <= floor * math.sqrt(own.size) or sharp > SHARP * signal:
        return None
    noise = floor * own.size
    if signal < 4 * noise:
        bins = np.arange(own.size)
        weights = np.maximum(energy - 3 * floor, 0)
        spread = math.sqrt(float((weights * (bins - peak) ** 2).sum() / max(float(weights.sum()), 1e-300)))
        return place, max(spread, 1.0) / place
    m = 8 * own.size
    around = np.zeros(m, complex)
    around[: own.size] = own
    phase = np.unwrap(np.angle(scipy.fft.ifft(around)))
    # The filtered signal wraps around, so its ends are left out.
    first, last = round(0.02 * m), round(0.98 * m) - 1
    cycles = (phase[last] - phase[first]) / (2 * math.pi) * m / (last - first)
    return float(low + cycles), SMEARED


def _near(z: Array, at: Array) -> Array:
    """Spectrum at fractional bins: the higher of the two neighbours."""
    low = np.clip(at.astype(int), 0, z.size - 2)
    return np.asarray(np.maximum(z[low], z[low + 1]))


def _peak(power: Array, z: Array, place: float, reach: float = 1.3) -> tuple[float, float]:
    """Position (fractional bins) and height of the highest line within `reach` bins; height 0 where there is none."""
    low, high = max(round(place - reach), 1), min(round(place + reach) + 1, power.size - 1)
    if high <= low:
        return place, 0.0
    k = low + int(np.argmax(power[low:high]))
    left, mid, right = np.sqrt(power[k - 1 : k + 2])
    side, sign = (right, 1.0) if right > left else (left, -1.0)
    if mid <= 0 or max(left, right) > mid:  # a slope, not a peak
        return place, 0.0
    # Hann window: the ratio of neighbours gives the position of a tone exactly.
    alpha = side / mid
    return k + sign * float(np.clip((2 * alpha - 1) / (1 + alpha), -0.5, 0.5)), float(z[k])


def _fit_lines(
    power: Array, z: Array, df: float, at_hz: Array, ratio: float, least: float, top: int
) -> tuple[float, float] | None:
    """Ratio of line frequencies to `at_hz`, from all lines within about a bin of `ratio`; None without any."""
    places, heights, nominal = [], [], []
    for frequency in at_hz:
        expected = ratio * frequency / df
        if not 2 < expected < top:
            continue
        place, height = _peak(power, z, expected)
        if height > least:
            places.append(place)
            heights.append(height)
            nominal.append(frequency / df)
    return _ratio_of(np.array(places), np.array(nominal), np.array(heights), 3.0)


def _ratio_of(places: Array, nominal: Array, heights: Array, limit: float) -> tuple[float, float] | None:
    """Weighted least squares of positions on nominal ones, through 0; excess scatter of the lines widens the error."""
    for _ in range(4):
        if places.size == 0:
            return None
        # Error of a tone's position in bins at power z over noise, window included; at least 1 % of a bin.
        sigma = np.sqrt(0.55**2 / np.maximum(heights, 1) + 0.01**2)
        weight = (nominal / sigma) ** 2
        ratio = float(np.sum(weight * places / nominal) / weight.sum())
        off = np.abs(places - ratio * nominal) / sigma
        spread = max(1.0, 1.5 * float(np.median(off)))
        kept = off <= limit * spread
        if kept.all():
            break
        places, nominal, heights = places[kept], nominal[kept], heights[kept]
    chi = math.sqrt(max(1.0, float(np.sum(off**2)) / max(places.size - 1, 1)))
    return ratio, max(chi / math.sqrt(float(weight.sum())), 2e-5)


def _tones(x: Array, df: float, shaft_hz: float, fault_hz: float | None, *, triplets: bool) -> tuple[float, float]:
    """Log ratio of the shaft from tones of the raw spectrum, and its error; infinite where none is significant."""
    power = tone_power(x)
    top = min(power.size, int((max(ORDERS) + 1) * (1 + REACH) * shaft_hz / df) + 40)
    low = power[:top]
    z = low / _floor(low, 25)
    z[:3] = 0
    masked = z.copy()
    # Neither mains lines nor the fault's own harmonics are tied to the shaft rate.
    for base in (50.0, 60.0, *(() if fault_hz is None else (fault_hz,))):
        for frequency in np.arange(base, top * df, base):
            k = round(frequency / df)
            masked[max(k - 1, 0) : k + 2] = 0
    found = (0.0, math.inf)
    if shaft_hz / df >= 4:
        found = max((_chain(low, masked, shaft_hz / df, start) for start in (1.0, 2.0, 3.0)), key=lambda c: c[0])[1]
    if triplets:
        mesh = _mesh(power, df, shaft_hz, fault_hz)
        if mesh is not None:
            found = _pooled(found, mesh)
    return found


def _chain(power: Array, z: Array, shaft: float, start: float) -> tuple[float, tuple[float, float]]:
    """Height, log ratio and its error of a family of tones that begins with the highest one around order `start`.

    Low orders come first: each next order is searched where those before predict it, since real spectra contain lines
    of other machines near most integer orders, and a high order may be off by 1 to 2 %.

    Parameters
    ----------
    power, z : Array [bins]
        Power of the raw spectrum, and the same over its local mean; 0 at lines that are not the shaft's.
    shaft : float
        Nominal 1x, bins.
    start : float
        Order of the first tone.
    """
    nothing = -math.inf, (0.0, math.inf)
    if start * shaft * (1 + REACH) > z.size - 3:
        return nothing
    place, height = _peak(power, z, start * shaft, REACH * start * shaft)
    if height < SHAFT_LINE:
        return nothing
    lines = [(start, place, height)]
    ratio, error = place / (start * shaft), 0.4 / (start * shaft)
    for order in (o for o in (1.0, 2.0, 3.0, *ORDERS) if o != start):
        expected, reach = order * ratio * shaft, min(0.4 + 3 * order * error * shaft, 1.3)
        if any(o == order for o, _, _ in lines) or expected > z.size - 3:
            continue
        place, height = _peak(power, z, expected, reach)
        if height < SHAFT_LINE or abs(place - expected) > reach:
            continue
        lines.append((order, place, height))
        o, places, heights = (np.array(v) for v in zip(*lines, strict=True))
        fitted = _ratio_of(places, o * shaft, heights, 3.0)
        if fitted is not None:
            ratio, error = fitted
    o, places, heights = (np.array(v) for v in zip(*lines, strict=True))
    low_orders = np.isin(o, (1.0, 2.0, 3.0))
    alone = bool((heights[o == 1] > LONE_LINE).any())
    if not (alone or low_orders.sum() >= 2 or (low_orders.any() and o.size >= 3)):
        return nothing
    fitted = _ratio_of(places, o * shaft, heights, 3.0)
    if fitted is None or abs(fitted[0] - 1) > REACH + 0.005:
        return nothing
    worth = np.where(o == 1, 1.5, np.where(o <= 3, 1.0, 0.5))
    score = float(worth @ np.log1p(heights / 4)) - (fitted[0] - 1) ** 2 / (2 * 0.03**2)
    return score, (math.log(fitted[0]), fitted[1] / fitted[0])


def _mesh(power: Array, df: float, shaft_hz: float, fault_hz: float | None) -> tuple[float, float] | None:
    """Log ratio from a gear mesh: three lines one order apart, the middle one at an integer order."""
    begin = int(6 * shaft_hz / df)
    if power.size - begin < 200 or shaft_hz / df < 8:
        return None
    z = power / _floor(power)
    inner = z[1:-1]
    peaks = np.flatnonzero((inner > 25) & (inner >= z[:-2]) & (inner > z[2:])) + 1
    peaks = peaks[peaks > begin]
    if fault_hz is not None:  # excludes harmonics of the fault and their sidebands
        order = peaks * df / fault_hz
        rest = np.abs(order - np.rint(order)) * fault_hz
        aside = np.abs(rest[:, None] - shaft_hz * np.array([0.0, 1.0, 2.0]))
        peaks = peaks[(aside > 3 * df + 0.06 * shaft_hz).all(axis=1)]
    if peaks.size < 3:
        return None
    peaks = peaks[np.argsort(z[peaks])[::-1][:24]]
    lo, hi = (1 - REACH) * shaft_hz / df - 1, (1 + REACH) * shaft_hz / df + 1
    best: tuple[float, float, float] | None = None
    for middle in peaks:
        gaps = peaks - middle
        above, below = peaks[(gaps > lo) & (gaps < hi)], peaks[(-gaps > lo) & (-gaps < hi)]
        for a, b in product(above, below):
            if abs((a - middle) - (middle - b)) > 1.5 or min(z[a], z[b]) * 400 < z[middle]:
                continue
            weakest = float(min(z[a], z[b], z[middle]))
            if best is None or weakest > best[2]:
                centre, upper, lower = (_peak(power, z, float(k), 0.6)[0] for k in (middle, a, b))
                best = centre, (upper - lower) / 2, weakest
    if best is None:
        return None
    centre, gap, weakest = best
    sigma = math.sqrt(0.55**2 / weakest + 0.01**2) / math.sqrt(2)
    teeth = round(centre / gap)
    error = teeth * sigma / gap
    if abs(centre / gap - teeth) < 3 * error + 0.02 and error < 0.15:
        ratio = centre / teeth * df / shaft_hz
        return math.log(ratio), max(math.sqrt(2) * sigma / centre, 3e-5)
    return math.log(gap * df / shaft_hz), sigma / gap


def _sidebands(comb: _Comb, shaft_hz: float) -> tuple[float, float] | None:
    """Log ratio of the shaft from envelope lines one and two orders beside a comb's lines, and at integer orders."""
    orders = np.array([(m, j) for m in range(5) for j in (-2, -1, 1, 2) if m > 0 or j > 0])
    base, steps = orders[:, 0] * comb.rate_hz / comb.df_hz, orders[:, 1] * shaft_hz / comb.df_hz
    inside = (base + steps * 1.08 > 3) & (base + np.abs(steps) * 1.08 < comb.top)
    base, steps = base[inside], steps[inside]
    if base.size < 3 or shaft_hz / comb.df_hz < 6:
        return None
    grid = np.arange(1 - REACH, 1 + REACH, 0.15 * comb.df_hz / shaft_hz)
    # Sidebands cannot lie at the comb's own lines (or their leakage).
    at = base[:, None] + steps[:, None] * grid
    heights = np.log1p(_near(comb.z, at) / 4)
    score = heights.sum(axis=0) - (grid - 1) ** 2 / (2 * 0.03**2)
    ratio = float(grid[np.argmax(score)])
    found = [(*_peak(comb.power, comb.z, b + s * ratio), b, s) for b, s in zip(base, steps, strict=True)]
    kept = [(place - b, s, h) for place, h, b, s in found if h > 9]
    first = sum(abs(s) < 1.5 * shaft_hz / comb.df_hz for _, s, _ in kept)
    if len(kept) < 3 or first < 2:
        return None
    away, nominal, high = (np.array(v) for v in zip(*kept, strict=True))
    fitted = _ratio_of(np.abs(away), np.abs(nominal), high, 2.5)
    if fitted is None or abs(fitted[0] - 1) > REACH + 0.005:
        return None
    # All harmonics share the slow noise of impact amplitudes: many sidebands are hardly more informative than one.
    single = 0.55 / math.sqrt(float(high.max())) / float(np.abs(nominal[np.argmax(high)]))
    return math.log(fitted[0]), max(fitted[1] / fitted[0], single)


def _pooled(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Combination of two readings of one quantity; the more precise one where they contradict each other."""
    if not math.isfinite(a[1]) or not math.isfinite(b[1]):
        return a if math.isfinite(a[1]) else b
    if abs(a[0] - b[0]) > 5 * math.hypot(a[1], b[1]):
        return a if a[1] < b[1] else b
    wa, wb = a[1] ** -2, b[1] ** -2
    return (wa * a[0] + wb * b[0]) / (wa + wb), (wa + wb) ** -0.5
