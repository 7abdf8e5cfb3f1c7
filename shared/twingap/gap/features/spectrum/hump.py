"""The narrow hump by which the spectra of records differ most from the twin's: a mode that the twin lacks.

log spectra between lines, record less simulation, mean of each state --less their median over many bands, smoothed at
several widths, over the scatter of all places--> z of each place in every state --> highest place, and its best rival

A mode raises the spectra of all records by the same amount at one frequency. The bands of other features are wider than
a lightly damped mode, which raises them by a fraction of a decibel. Errors of calibrated values make humps and dips
side by side, or wide humps, which count as scatter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from twingap.gap.features.spectrum.record_summary import RecordSummary
from twingap.records import Array
from twingap.signal.record_transforms import medians

NAMES: Final = (
    "hump", "hump_rival", "hump_fs", "hump_damping", "hump_level", "hump_unsteady", "hump_peak_fs",
)  # fmt: skip
"""Keys of `compare`."""
_WIDTHS: Final = (1.0, 2.0, 4.0, 8.0)
"""Standard deviations, in bands of the spectrum, by which it is smoothed. More find humps of other widths."""
_WIDE: Final = 30
"""Width of the median that is the level beside a hump, in such deviations. A smaller value takes a part of the hump for
it."""
_ENDS: Final = (0.02, 0.96)
"""Places at which humps are sought, parts of half the sampling rate: beyond, filters end the spectra."""
_APART: Final = 6
_BANDS_APART: Final = 3
"""Distance from a hump, in such deviations and bands more, from which another one is a rival. A smaller value takes the
hump's own flanks for rivals."""
_NEAR_BANDS: Final = 12
_NEAR: Final = 0.2
"""Bands about a hump, and part of its place, in which a mode is fitted. Wider ones hold more of what is beside it."""
_OFFSETS: Final = np.arange(-3.0, 3.25, 0.5)
_DAMPINGS: Final = np.geomspace(0.006, 0.12, 14)
_HEIGHTS: Final = np.geomspace(0.05, 40.0, 20)
"""Distances from a hump's place, in bands, damping ratios and heights of the fitted modes. More fit closer and take
longer."""
_FEWEST: Final = 4
"""Records that are needed. In fewer, chance makes humps."""


def compare(real: Sequence[RecordSummary], simulated: Sequence[RecordSummary]) -> dict[str, float]:
    """`NAMES` -> value of records and simulations of the same conditions; NaN with few records, or two sampling rates.

    z of the highest place: in the state where it is least, times the root of the number of states; z of the best rival,
    which is a hump elsewhere or a dip anywhere; frequency over the sampling rate, and damping ratio, of the mode that
    fits the hump best; its height, ln of power; the scatter of the height over records, over its mean; and the
    frequency of the highest simulated level, over the sampling rate.
    """
    out = dict.fromkeys(NAMES, math.nan)
    theirs = {summary.condition.name: summary for summary in simulated}
    pairs = [(own, theirs[own.condition.name]) for own in real if own.condition.name in theirs]
    if len(pairs) < _FEWEST or len({summary.fs_hz for pair in pairs for summary in pair}) > 1:
        return out
    off = np.array([own.between_log - their.between_log for own, their in pairs])
    states = [str(own.condition.fault) for own, _ in pairs]
    if len(set(states)) < 2:  # then both halves of the records
        states = [str(place % 2) for place in range(len(pairs))]
    curves = np.array([off[[s == state for s in states]].mean(axis=0) for state in dict.fromkeys(states)])
    found = [_highest(curves, width) for width in _WIDTHS]
    peak = int(np.argmax(gaussian_filter1d(np.mean([their.between_log for _, their in pairs], axis=0), _WIDTHS[0])))
    z, rival, place, width = max(found, key=lambda one: one[0] - one[1])
    mean = curves.mean(axis=0)
    centre, damping = _mode(_raised(mean, 0.0, beside=_WIDTHS[-1]), place)
    heights = np.array([_raised(record, width)[place] for record in off])
    return {
        "hump": z, "hump_rival": rival, "hump_fs": centre / (2 * off.shape[1]), "hump_damping": damping,
        "hump_level": float(heights.mean()), "hump_unsteady": float(heights.std() / max(heights.mean(), 1e-9)),
        "hump_peak_fs": (peak + 0.5) / (2 * off.shape[1]),
    }  # fmt: skip


def _highest(curves: Array, width: float) -> tuple[float, float, int, float]:
    """z, that of the best rival, and place of the highest hump of a width in mean differences [states, bands]."""
    bands = curves.shape[1]
    begin, end = (int(part * bands) for part in _ENDS)
    own = np.array([_over_scatter(curve, width) for curve in curves])[:, begin:end]
    whole = _over_scatter(curves.mean(axis=0), width)[begin:end]
    root = math.sqrt(len(curves))
    humps = np.minimum(whole, root * own.min(axis=0))
    dips = np.minimum(-whole, root * (-own).min(axis=0))
    place = int(np.argmax(humps))
    apart = np.abs(np.arange(humps.size) - place) > _APART * width + _BANDS_APART
    rival = max(humps[apart].max(initial=0.0), dips.max(initial=0.0))
    return float(humps[place]), float(rival), begin + place, width


def _mode(curve: Array, place: int) -> tuple[float, float]:
    """Place, in bands, and damping ratio of the mode whose power, added to a level, fits a curve best about a hump."""
    reach = max(_NEAR_BANDS, round(_NEAR * place))
    low, high = max(place - reach, 0), min(place + reach + 1, curve.size)
    f = np.arange(low, high) + 0.5
    centre, damping, height = np.meshgrid(place + 0.5 + _OFFSETS, _DAMPINGS, _HEIGHTS, indexing="ij")
    shape = 1 / (1 + np.square((f - centre[..., None]) / (damping * centre)[..., None]))
    misfit = np.square(np.log1p(height[..., None] * shape) - curve[low:high]).sum(axis=-1)
    best = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    return float(centre[best]), float(damping[best])


def _raised(curve: Array, width: float, beside: float = 0.0) -> Array:
    """[bands] A curve over its wide median, smoothed; the median is that for a smoothing of `beside` where given."""
    size = min(int(_WIDE * (beside or width)) | 1, curve.size // 2 | 1)
    raised = curve - median_filter(curve, size=size, mode="nearest")
    return np.asarray(gaussian_filter1d(raised, width, mode="nearest") if width else raised)


def _over_scatter(curve: Array, width: float) -> Array:
    """[bands] The same over the scatter of all places."""
    raised = _raised(curve, width)
    return raised / max(1.4826 * float(medians(np.abs(raised - medians(raised)))), 1e-9)
