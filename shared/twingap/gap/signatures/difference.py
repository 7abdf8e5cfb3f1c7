"""What sets two mean spectra apart: real records against simulated ones, fitted with the shapes that effects give.

mean log smooth spectra, real - simulated --> bump, dip, slope
        |--> one more mode | loss of the sensor | added noise in a band --> share explained, parameters
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.signatures.shape import bump, mode_shape, slope_of
from twingap.gap.view import RecordView

Array = NDArray[np.float64]

_SETS: Final = ("healthy", "faulty", "all")
_OF_SET: Final = (
    "rms",
    "offset",
    "low",
    "middle",
    "high",
    "slope",
    "bump",
    "bump_fs",
    "bump_width",
    "dip",
    "dip_fs",
    "mode_gain",
    "mode_share",
    "mode_fs",
    "mode_damping_log",
    "loss_share",
    "loss_corner_fs",
    "loss_order",
    "added_share",
    "added_level",
    "added_slope",
    "added_low_fs",
    "added_high_fs",
    "rest_share",
)
COMPARED: Final[tuple[str, ...]] = (
    *(f"{of}_{what}" for of in _SETS for what in _OF_SET),
    "added_level_change",
    "mode_gain_change",
)
"""Keys of `compare`."""


def compare(real: Sequence[RecordView], simulated: Sequence[RecordView], points: int = 128) -> dict[str, float]:
    """Shape of the difference of mean log smooth spectra, real less simulated.

    Parameters
    ----------
    real, simulated : sequence of RecordView
        Of comparable conditions. Sampling rates may differ between records: places are fractions of them.
    points : int
        Bands that curves are held in.

    Returns
    -------
    dict[str, float]
        `COMPARED` -> value, once for healthy, for faulty and for all records. Per set: rms, mean and the means of
        thirds of the curve in log10 of power; highest and lowest place; and three models, each with its share of the
        curve explained (1 all) and its parameters: one more mode (added in proportion to the simulated level), a
        Butterworth loss before the white noise, and added noise of a power law in a band. Frequencies over fs.
    """
    out = dict.fromkeys(COMPARED, math.nan)
    for of in _SETS:
        curves = [_mean_log(views, of, points) for views in (real, simulated)]
        if curves[0] is not None and curves[1] is not None:
            for what, value in _difference(curves[0], curves[1]).items():
                out[f"{of}_{what}"] = value if math.isfinite(value) else math.nan
    out["added_level_change"] = out["faulty_added_level"] - out["healthy_added_level"]
    out["mode_gain_change"] = out["faulty_mode_gain"] - out["healthy_mode_gain"]
    return out


def _mean_log(views: Sequence[RecordView], of: str, points: int) -> Array | None:
    """[points] Mean over records of ln of density times fs / scale^2."""
    own = [view for view in views if of == "all" or (view.condition.fault == "healthy") == (of == "healthy")]
    if not own:
        return None
    logs = []
    for view in own:
        unit = view.fs_hz / max(view.frame.scale, 1e-300) ** 2
        logs.append(np.log(np.maximum(view.smooth * unit, 1e-30)).reshape(points, -1).mean(axis=1))
    return np.asarray(np.mean(logs, axis=0))


def _difference(real: Array, simulated: Array) -> dict[str, float]:
    """What one pair of mean log spectra shows."""
    f = (np.arange(real.size) + 0.5) / (2 * real.size)
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
    power = np.exp(simulated)
    total = float((curve**2).mean()) + 1e-4
    shares = []

    def best(modelled: Array) -> tuple[float, int]:
        """Share of the curve explained by the best of candidate curves [candidates, points], and which."""
        left = ((curve - modelled) ** 2).mean(axis=1)
        place = int(np.argmin(left))
        shares.append(1 - float(left[place]) / total)
        return shares[-1], place

    centres, dampings, gains = np.geomspace(0.015, 0.48, 40), np.geomspace(0.01, 0.2, 5), np.geomspace(0.03, 100, 10)
    shapes = mode_shape(f, np.repeat(centres, 5)[:, None], np.tile(dampings, 40)[:, None])
    # Heights over the simulated level at the centre.
    level = np.interp(np.repeat(centres, 5), f, power)[:, None]
    added = (shapes * level / power)[:, None, :] * gains[None, :, None]
    share, at = best(np.log1p(added).reshape(-1, f.size))
    mode, gain = divmod(at, gains.size)
    out |= {"mode_share": share, "mode_gain": math.log10(gains[gain]), "mode_fs": float(centres[mode // 5])}
    out["mode_damping_log"] = math.log10(dampings[mode % 5])

    corners, orders = np.geomspace(0.02, 0.8, 40), np.arange(1, 7)
    loss = 1 / (1 + (f[None, None, :] / corners[:, None, None]) ** (2 * orders[None, :, None]))
    # White noise comes after the sensor; the least density bounds it from above.
    whites = float(np.quantile(power, 0.05)) * np.array([0.0, 0.5, 0.9])[:, None, None, None]
    kept = (loss * np.maximum(power - whites, 0.0) + np.minimum(whites, power)) / power
    share, at = best(np.log(np.maximum(kept, 1e-12)).reshape(-1, f.size))
    corner, order = divmod(at % (corners.size * orders.size), orders.size)
    out |= {"loss_share": share, "loss_corner_fs": float(corners[corner]), "loss_order": float(orders[order])}

    slopes, edges = np.linspace(-1.0, 2.5, 8), np.array([0, 2, 4, 8, 12, 16, 24, 32, 48, 64, 80, 96, 112, 128])
    edges = edges * real.size // 128
    candidates, parameters = [], []
    levels = np.geomspace(0.003, 30, 13)
    for slope in slopes:
        law = f ** (-slope)
        for i, low in enumerate(edges[:-1]):
            for high in edges[i + 1 :]:
                inside = np.zeros_like(f)
                inside[low:high] = law[low:high]
                candidates.append(inside / inside.sum() * (2 * real.size))
                parameters.append((slope, low, high))
    laws = np.array(candidates)
    # The level by its best match at the middle of the band first, then a search about it: few candidates remain.
    with np.errstate(divide="ignore"):
        wanted = np.maximum(np.expm1(np.minimum(curve, 30.0)), 1e-3) * power
    logs = np.where(laws > 0, np.log(np.maximum(wanted, 1e-30))[None, :] - np.log(np.maximum(laws, 1e-30)), np.nan)
    start = np.exp(np.nanmedian(logs, axis=1))
    factors = np.array([0.5, 0.7, 1.0, 1.4])
    modelled = np.log1p(laws[:, None, :] * (start[:, None] * factors)[:, :, None] / power)
    share, at = best(modelled.reshape(-1, f.size))
    law_at, factor = divmod(at, factors.size)
    slope, low, high = parameters[law_at]
    amount = float(np.clip(start[law_at] * factors[factor], levels[0] ** 2, levels[-1] ** 2))
    # Densities are in scale^2 / fs: the mean of `laws` is 2, so that half the amount is a mean square.
    out |= {"added_share": share, "added_level": 0.5 * math.log10(amount), "added_slope": float(slope)}
    out |= {"added_low_fs": low / real.size / 2, "added_high_fs": high / real.size / 2}
    out["rest_share"] = 1 - max(shares)
    return out
