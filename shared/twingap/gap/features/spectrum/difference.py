"""Difference of two mean spectra, real less simulated, fitted with the shapes of effects.

mean log smooth spectra, real - simulated --> bump, dip, slope
        |--> one more mode | roll-off of the sensor | added noise in a band --> share explained, parameters
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit
from twingap.gap.features.spectrum.record_summary import RecordSummary, log_bands
from twingap.gap.features.spectrum.smooth_shape import bump, mode_shape, slope_of
from twingap.records import Array
from twingap.signal.record_transforms import medians

_POINTS: Final = 128
"""Bands that curves are held in: more resolve sharper modes, each with more noise."""
# Grids of the fitted shapes: finer ones explain a little more of a difference, and take longer.
_CENTRES, _DAMPINGS, _GAINS = np.geomspace(0.015, 0.48, 40), np.geomspace(0.01, 0.2, 5), np.geomspace(0.03, 100, 10)
_CORNERS, _ORDERS = np.geomspace(0.02, 0.8, 40), np.arange(1, 7)
_SLOPES = np.linspace(-1.0, 2.5, 8)
_EDGES = np.array([0, 2, 4, 8, 12, 16, 24, 32, 48, 64, 80, 96, 112, 128])
_FACTORS = np.array([0.5, 0.7, 1.0, 1.4])
_AMOUNTS: Final = (0.003**2, 30.0**2)
"""Bounds of added noise, mean square over scale^2."""
_SETS: Final = ("healthy", "faulty", "all")
_OF_SET: Final = (
    "rms", "offset", "low", "middle", "high", "slope", "bump", "bump_fs", "bump_width", "dip", "dip_fs", "mode_gain",
    "mode_share", "mode_fs", "mode_damping_log", "rolloff_share", "rolloff_corner_fs", "rolloff_order", "added_share",
    "added_level", "added_slope", "added_low_fs", "added_high_fs", "rest_share",
)  # fmt: skip
NAMES: Final = (*(f"{of}_{what}" for of in _SETS for what in _OF_SET), "added_level_change", "mode_gain_change")
"""Keys of `compare`."""


def compare(real: Sequence[RecordSummary], simulated: Sequence[RecordSummary]) -> dict[str, float]:
    """`NAMES` -> value: shape of the difference of mean log smooth spectra, real less simulated.

    Once for healthy, for faulty and for all records: rms, mean and the means of thirds of the curve in log10 of power;
    highest and lowest place; and three models, each with its share of the curve explained (1 all) and its parameters:
    one more mode (added in proportion to the simulated level), a Butterworth roll-off before the white noise, and added
    noise of a power law in a band. Sampling rates may differ between records: frequencies are over them.
    """
    out = dict.fromkeys(NAMES, math.nan)
    for of in _SETS:
        curves = [_mean_log(records, of) for records in (real, simulated)]
        if curves[0] is not None and curves[1] is not None:
            for what, value in _difference(curves[0], curves[1]).items():
                out[f"{of}_{what}"] = value if math.isfinite(value) else math.nan
    out["added_level_change"] = out["faulty_added_level"] - out["healthy_added_level"]
    out["mode_gain_change"] = out["faulty_mode_gain"] - out["healthy_mode_gain"]
    return out


def _mean_log(records: Sequence[RecordSummary], of: str) -> Array | None:
    """[_POINTS] Mean over records of ln of density times fs / scale^2."""
    own = [record for record in records if of == "all" or (record.condition.fault == "healthy") == (of == "healthy")]
    if not own:
        return None
    return np.asarray(np.mean([log_bands(record, _POINTS) for record in own], axis=0))


def _difference(real: Array, simulated: Array) -> dict[str, float]:
    """Features of one pair of mean log spectra."""
    f = _frequencies()
    curve = real - simulated
    ten = curve / math.log(10)
    third = real.size // 3
    out = {
        "rms": float(np.sqrt(np.mean(ten**2))),
        "offset": float(np.median(ten)),
        "low": float(ten[:third].mean()),
        "middle": float(ten[third : 2 * third].mean()),
        "high": float(ten[2 * third :].mean()),
        "slope": slope_of(np.log10(f), ten),
    }
    wide = np.convolve(ten, [0.25, 0.5, 0.25], mode="same") - out["offset"]
    height, place, width = bump(wide)
    out |= {"bump": height, "bump_fs": float(f[place]), "bump_width": width / real.size}
    depth, place, _ = bump(-wide)
    out |= {"dip": depth, "dip_fs": float(f[place])}
    power, shapes = np.exp(simulated), _shapes()
    total = float((curve**2).mean()) + 1e-4

    def share_of(left: float) -> float:
        """Share of the curve that is explained when so much of its square is left."""
        return 1 - left / real.size / total

    # Heights over the simulated level at the centre.
    level = np.interp(shapes.centre, f, power)[:, None]
    all_points = np.zeros(len(level), np.int64), np.full(len(level), f.size)
    left, mode, gain = _best_fit(curve, shapes.mode * level / power, np.tile(_GAINS, (len(level), 1)), *all_points)
    out |= {"mode_share": share_of(left), "mode_gain": math.log10(_GAINS[gain]), "mode_fs": float(shapes.centre[mode])}
    out["mode_damping_log"] = math.log10(shapes.damping[mode])

    # White noise comes after the sensor; the least density bounds it from above.
    whites = float(np.quantile(power, 0.05)) * np.array([0.0, 0.5, 0.9])[:, None, None]
    kept = (shapes.rolloff * np.maximum(power - whites, 0.0) + np.minimum(whites, power)) / power
    apart = ((curve - np.log(np.maximum(kept, 1e-12)).reshape(-1, f.size)) ** 2).sum(axis=1)
    at = int(np.argmin(apart))
    corner, order = divmod(at % len(shapes.rolloff), _ORDERS.size)
    out |= {"rolloff_share": share_of(float(apart[at])), "rolloff_corner_fs": float(_CORNERS[corner])}
    out["rolloff_order"] = float(_ORDERS[order])

    # The level by its best match at the middle of the band first, then a search about it: few candidates remain.
    wanted = np.log(np.maximum(np.expm1(np.minimum(curve, 30.0)), 1e-3) * power) - shapes.log_law
    start = np.empty(shapes.law.shape[:2])
    for place, (low, high) in enumerate(shapes.bands):
        start[:, place] = np.exp(medians(wanted[:, low:high]) + shapes.log_mean[:, place])
    low, high = np.tile(shapes.bands, (_SLOPES.size, 1)).T
    candidates = start.reshape(-1, 1) * _FACTORS
    ratio = (shapes.law / power).reshape(-1, f.size)
    left, law, factor = _best_fit(curve, ratio, candidates, low, high)
    amount = float(np.clip(candidates[law, factor], *_AMOUNTS))
    # Densities are in scale^2 / fs: the mean of a law is 2, so that half the amount is a mean square.
    slope = float(_SLOPES[law // len(shapes.bands)])
    out |= {"added_share": share_of(left), "added_level": 0.5 * math.log10(amount), "added_slope": slope}
    out |= {"added_low_fs": low[law] / real.size / 2, "added_high_fs": high[law] / real.size / 2}
    out["rest_share"] = 1 - max(out["mode_share"], out["rolloff_share"], out["added_share"])
    return out


def _frequencies() -> Array:
    """[_POINTS] Middles of the bands, parts of the sampling rate."""
    return (np.arange(_POINTS) + 0.5) / (2 * _POINTS)


class _Shapes(NamedTuple):
    """Shapes that every pair of spectra is fitted with.

    `centre`, `damping` [modes]; `mode` [modes, points], 1 at resonance; `rolloff` [corners x orders, points] of power;
    `bands` [bands, 2], first point and one beyond the last; `law` [slopes, bands, points], of mean 2 over all points, 0
    outside the band; `log_law` [slopes, points], ln of the power law, and `log_mean` [slopes, bands], ln of the
    power law over `law` in its band.
    """

    centre: Array
    damping: Array
    mode: Array
    rolloff: Array
    bands: NDArray[np.int64]
    law: Array
    log_law: Array
    log_mean: Array


@cache
def _shapes() -> _Shapes:
    f = _frequencies()
    centre, damping = np.repeat(_CENTRES, _DAMPINGS.size), np.tile(_DAMPINGS, _CENTRES.size)
    rolloff = 1 / (1 + (f / _CORNERS[:, None, None]) ** (2 * _ORDERS[:, None]))
    bands = np.array([(low, high) for i, low in enumerate(_EDGES[:-1]) for high in _EDGES[i + 1 :]])
    power_law = f ** -_SLOPES[:, None]
    law = np.zeros((_SLOPES.size, len(bands), _POINTS))
    size = np.empty(law.shape[:2])
    for place, (low, high) in enumerate(bands):
        size[:, place] = power_law[:, low:high].sum(axis=1) / (2 * _POINTS)
        law[:, place, low:high] = power_law[:, low:high] / size[:, place, None]
    mode = mode_shape(f, centre[:, None], damping[:, None])
    return _Shapes(centre, damping, mode, rolloff.reshape(-1, _POINTS), bands, law, np.log(power_law), np.log(size))


def _best_fit(
    curve: Array, ratio: Array, factor: Array, low: NDArray[np.int64], high: NDArray[np.int64]
) -> tuple[float, int, int]:
    """Least square of `curve` less ln(1 + ratio [candidate] factor [candidate, choice]), the candidate, the choice.

    A candidate's ratio is 0 outside low:high; sums that exceed the least so far are not finished.
    """
    before = np.concatenate(([0.0], np.cumsum(curve * curve)))
    found = _search(before, curve, ratio, factor, np.ascontiguousarray(low), np.ascontiguousarray(high))
    return float(found[0]), int(found[1]), int(found[2])


@njit()
def _search(before, curve, ratio, factor, low, high):  # type: ignore[no-untyped-def]  # pragma: no cover
    # `before` holds the sums of the curve's squares up to each point.
    least, best, choice = np.inf, 0, 0
    for c in range(ratio.shape[0]):
        outside = before[low[c]] + before[curve.size] - before[high[c]]
        for k in range(factor.shape[1]):
            total = outside
            for i in range(low[c], high[c]):
                off = curve[i] - math.log1p(ratio[c, i] * factor[c, k])
                total += off * off
                if total >= least:
                    break
            if total < least:
                least, best, choice = total, c, k
    return least, best, choice
