"""Artefacts of the measuring chain in one record: clipped samples, settling after power-on, dropouts, spikes."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PILE: Final = 4
"""Ratio of the samples at an extreme to those at the next value from which they are clipped: a sinusoid that is
quantised has at most 2.4, noise less than 1. A larger value misses slight clipping."""
_LEAST_CLIPPED: Final = 3
_SPIKE: Final = 12.0
"""Height of a spike in robust standard deviations; lower ones hardly change peak to peak."""
_BESIDE: Final = 8
"""Samples on either side of a spike that are small; with one alone, a resonance near a quarter of the sampling rate,
whose every second sample is near zero, is taken for spikes. More miss spikes close to each other."""
_MOST: Final = 0.5
"""Share of the outlying samples that stand alone above which they are spikes; lower takes impacts whose response is
shorter than the sampling interval, and of which some fall on a sample, for spikes."""
_ALONE: Final = 0.15
"""Largest height of the samples beside a spike, relative to it; larger takes strongly damped impacts for spikes."""
_NOISE: Final = 3.5
"""Height that samples beside a spike may have in any case, in robust standard deviations; lower misses low spikes."""
_BLOCKS: Final = 64
_EXPLAINED: Final = 0.9
"""Share of the variance of block means that an exponential explains where the sensor settles; a larger value misses
settling beside strong low frequencies."""
_LEAST_SETTLING: Final = 1.0
"""Least initial offset, in standard deviations of the record without it; a larger value leaves smaller offsets in."""


def clipped_samples(x: Array) -> int:
    """Number of samples at the ends of the converter's range; 0 where none pile up there.

    Parameters
    ----------
    x : Array [samples]

    Notes
    -----
    Samples are clipped where the largest (or smallest) value occurs at least three times, and far more often than the
    next one: without clipping extreme values are the rarest.
    """
    return _at_the_top(x) + _at_the_top(-x)


def _at_the_top(x: Array) -> int:
    highest = x.max()
    at = int(np.count_nonzero(x == highest))
    if not _LEAST_CLIPPED <= at < x.size:
        return 0
    following = x[x < highest].max()
    return at if at > _PILE * np.count_nonzero(x == following) else 0


def without_settling(x: Array) -> tuple[Array, float]:
    """A record without the exponential offset with which a sensor settles after power-on.

    Parameters
    ----------
    x : Array [samples]

    Returns
    -------
    x : Array [samples]
        The record itself where no offset is found.
    offset : float
        Offset at the first sample, unit of x; 0 where none is found.

    Notes
    -----
    Fits a exp(-t / tau) + c to means of 64 blocks, tau from a fiftieth of the record to its length. It is removed where
    it explains nine tenths of their variance and begins above one standard deviation of what remains.
    """
    size = x.size // _BLOCKS
    if size < 4:
        return x, 0.0
    means = x[: size * _BLOCKS].reshape(_BLOCKS, size).mean(axis=-1)
    spread = float(np.sum((means - means.mean()) ** 2))
    if not spread > 0:
        return x, 0.0
    place = (np.arange(_BLOCKS) + 0.5) / _BLOCKS
    best = (spread, 0.0, 1.0)
    for tau in np.geomspace(0.02, 1.0, 60):
        # Mean of the exponential over each block.
        shape = np.exp(-place / tau) * np.sinh(0.5 / _BLOCKS / tau) / (0.5 / _BLOCKS / tau)
        centred = shape - shape.mean()
        a = float(centred @ means / (centred @ centred))
        rest = float(np.sum((means - means.mean() - a * centred) ** 2))
        if rest < best[0]:
            best = (rest, a, float(tau))
    rest, a, tau = best
    if rest > (1 - _EXPLAINED) * spread:
        return x, 0.0
    settled = x - a * np.exp(-np.arange(x.size) / (size * _BLOCKS) / tau)
    if abs(a) < _LEAST_SETTLING * float(settled.std()):
        return x, 0.0
    return settled, a


def constant_share(x: Array) -> float:
    """Longest run of equal consecutive samples, as a share of the record; large in a dropout."""
    changes = np.flatnonzero(np.diff(x))
    edges = np.concatenate(([-1], changes, [x.size - 1]))
    return float(np.diff(edges).max() / x.size)


def without_spikes(x: Array) -> tuple[Array, int]:
    """A record with spikes of a single sample replaced by the mean of their neighbours, and their number.

    Notes
    -----
    A structure rings on after an impact: at a quality factor of ten (damping of 5 %) and any resonance that the record
    can hold, one of the next four samples is nearly half as high. A single sample far outside the scatter between small
    ones on either side is electrical, as of a loose contact, unless most outlying samples of the record have company:
    impacts of one cause fall on samples and between them.
    """
    if x.size < 8:
        return x, 0
    centred = x - np.median(x)
    height = np.abs(centred)
    scatter = 1.4826 * float(np.median(height))
    outlying = np.flatnonzero((height > _SPIKE * scatter) & (scatter > 0))
    places = outlying[(outlying > 0) & (outlying < x.size - 1)]
    beside = np.concatenate((np.arange(-_BESIDE, 0), np.arange(1, _BESIDE + 1)))
    highest = height[np.clip(places[:, None] + beside, 0, x.size - 1)].max(axis=1)
    places = places[highest < np.maximum(_ALONE * height[places], _NOISE * scatter)]
    if not places.size > _MOST * outlying.size:
        return x, 0
    out = x.copy()
    out[places] = (x[places - 1] + x[places + 1]) / 2
    return out, int(places.size)
