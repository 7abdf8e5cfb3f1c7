"""Features of one record's smooth spectrum: relative bands, its best single mode, and the residual.

smooth spectrum --> relative bands
          |-------> best single mode + white noise --> residual: bump, dip, slopes, steps at edges of a band
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms

BANDS: Final = 32
"""Equal bands of the smooth spectrum between 0 and half the sampling rate."""
_DAMPINGS: Final = np.geomspace(0.01, 0.3, 9)
"""Damping ratios that are tried for the single mode."""


def measure_shape(record: RecordTransforms, smooth: Array, out: dict[str, float]) -> None:
    """Relative bands, and the smooth spectrum against its best single mode over white noise."""
    smooth = np.maximum(smooth, 1e-300)
    total = float(smooth.sum())
    for i, value in enumerate(smooth.reshape(BANDS, -1).mean(axis=1) * BANDS / total * (smooth.size / BANDS)):
        out[f"band_{i:02d}"] = math.log10(max(value, 1e-12))
    log_s = np.log(smooth).reshape(128, -1).mean(axis=1)
    f = (np.arange(128) + 0.5) / 256
    low, high = (edge / record.fs_hz for edge in record.frame.band_hz)
    inside = np.flatnonzero((f >= low) & (f <= high))
    if inside.size == 0:
        inside = np.array([int(np.argmin(np.abs(f - (low + high) / 2)))])
    top = float(f[inside[int(np.argmax(log_s[inside]))]])
    fit, centre, damping, strength, white = _single_mode(f, log_s, top)
    out["mode_fs"], out["mode_damping_log"] = centre, math.log10(damping)
    out["mode_over_white_log"] = math.log10(max(strength, 1e-12) / max(white, 1e-300) + 1e-6)
    out["white_level"] = 0.5 * math.log10(max(white * record.fs_hz / 2, 1e-300) / max(record.frame.scale, 1e-300) ** 2)
    rest = (log_s - np.log(fit)) / math.log(10)
    out["rest_rms"] = float(np.sqrt(np.mean(rest[1:] ** 2)))
    below, above = (f < 0.6 * centre), (f > min(1.6 * centre, 0.4))
    if np.count_nonzero(below) >= 4:
        out["rest_low"] = float(rest[below].mean())
        out["rest_low_slope"] = slope_of(np.log10(f[below]), rest[below])
    if np.count_nonzero(above) >= 4:
        out["rest_high"] = float(rest[above].mean())
        out["rest_high_slope"] = slope_of(f[above], rest[above])
    wide = np.convolve(rest, [0.25, 0.5, 0.25], mode="same")
    height, place, width = bump(wide)
    out["rest_bump"], out["rest_bump_fs"], out["rest_bump_width"] = height, float(f[place]), width / 128
    out["rest_bump_hz_log"] = math.log10(f[place] * record.fs_hz)
    depth, place, _ = bump(-wide)
    out["rest_dip"], out["rest_dip_fs"] = depth, float(f[place])
    # Ends of a band of noise: the largest step between eight bands on either side, resonance left out.
    fine = np.log10(smooth) - np.interp(np.arange(512), np.arange(128) * 4 + 1.5, np.log10(fit))
    summed = np.concatenate(([0.0], np.cumsum(fine)))
    at = np.arange(8, 504)
    steps = (summed[at + 8] - 2 * summed[at] + summed[at - 8]) / 8
    steps *= np.abs(at / 1024 - centre) > 5 * damping * centre + 8 / 1024
    best = int(np.argmax(np.abs(steps)))
    out["edge_step"], out["edge_hz_log"] = float(steps[best]), math.log10(at[best] / 1024 * record.fs_hz)


def _single_mode(f: Array, log_s: Array, top: float) -> tuple[Array, float, float, float, float]:
    """Best a |H|^2 + w of one mode near `top`: the spectrum, its centre, damping, a at resonance, w."""
    centre = np.repeat(np.clip(top * np.array([0.97, 1.0, 1.03]), 1e-3, 0.5), _DAMPINGS.size)
    damping = np.tile(_DAMPINGS, 3)
    shapes = mode_shape(f, centre[:, None], damping[:, None])
    s = np.exp(log_s - log_s.max())
    a, w = _mode_and_white(shapes, s)
    fit = np.maximum(a[:, None] * shapes + w[:, None], 1e-9)
    cost = np.abs(np.log(s) - np.log(fit)).mean(axis=1)
    best = int(np.argmin(cost))
    unit = math.exp(log_s.max())
    strength, white = float(a[best]) * unit, max(float(w[best]), 1e-9) * unit
    return fit[best] * unit, float(centre[best]), float(damping[best]), strength, white


def _mode_and_white(shapes: Array, s: Array) -> tuple[Array, Array]:
    """[shapes] a and w of a shape + w to s [8 k], by weighted least squares: relative errors count."""
    fit: Array = np.broadcast_to(s, shapes.shape)
    for _ in range(5):
        weight = 1 / np.maximum(fit, 1e-12) ** 2
        weighted = weight * shapes
        terms = np.stack([weight * (shapes * shapes), weighted, weight, weighted * s, weight * s])
        # Eight partial sums each: differences of these sums all but cancel for some shapes.
        sums = terms.reshape(5, len(shapes), -1, 8).sum(axis=2)
        while sums.shape[-1] > 1:
            sums = sums[..., ::2] + sums[..., 1::2]
        hh, h1, n1, hs, s1 = sums[..., 0]
        determinant = np.maximum(hh * n1 - h1 * h1, 1e-300)
        a = np.maximum((hs * n1 - s1 * h1) / determinant, 0.0)
        w = np.maximum((hh * s1 - h1 * hs) / determinant, 0.0)
        a, w = np.where(w > 0, a, hs / hh), np.where(a > 0, w, s1 / n1)
        fit = np.maximum(a[:, None] * shapes + w[:, None], 1e-9)
    return a, w


def mode_shape(f: Array, centre: Array | float, damping: Array | float) -> Array:
    """|H|^2 of a mode's displacement response, 1 at resonance."""
    height = (2 * damping * centre**2) ** 2
    return np.asarray(height / ((centre**2 - f**2) ** 2 + (2 * damping * f * centre) ** 2))


def bump(curve: Array) -> tuple[float, int, int]:
    """Height, place and width (points above half of it) of a curve's highest place."""
    place = int(np.argmax(curve))
    height = float(curve[place])
    over = curve > height / 2
    left, right = place, place
    while left > 0 and over[left - 1]:
        left -= 1
    while right < curve.size - 1 and over[right + 1]:
        right += 1
    return height, place, right - left + 1


def slope_of(x: Array, y: Array) -> float:
    """Of the least-squares line."""
    apart = x - x.mean()
    return float(apart @ y) / max(float(apart @ apart), 1e-300)
