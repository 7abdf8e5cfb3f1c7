"""Rails: levels that records reach again and again and never exceed, since the converter cuts them off there.

samples --highest and lowest level, visits of it, visits of levels in a strip inside it--> Extreme
Extremes of many records at one level --visits against what a density that falls outwards allows--> Rail

Noise of fine resolution never reaches the same extreme twice: a few visits are proof, though they are one sample in
thousands. On the grid of a coarse converter each level of the strip is visited at least as often as the extreme, up to
the factor by which the density of a sine rises towards its peaks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

Array = NDArray[np.float64]

_STRIP: Final = 0.02
"""Width of the strip inside an extreme, as a part of a record's span. A wider one holds more samples, and less of the
density near the extreme."""
_LEVELS: Final = 8
"""Fewest levels of a strip. More make strips of coarse converters reach far into a record."""
_FOR_RESOLUTION: Final = 1024
"""Samples by which the resolution is found. More find finer grids, and take longer."""
_EQUAL: Final = 4e-7
"""Largest relative difference of equal samples after conversions of unit in single precision."""
_SINE: Final = 3.0
"""Visits of an extreme over those of another level in its strip, at most, without a rail: 2.4 for a sine on a grid. A
larger value misses rails of coarse converters."""
_MOST: Final = 30.0
"""Largest evidence; beyond, more makes no difference."""


class Extreme(NamedTuple):
    """One extreme of a record.

    Parameters
    ----------
    level : float
        Its value, in the unit of the samples.
    visits : int
        Separate visits of it; samples in a row are one.
    inside : int
        Visits of levels in the strip inside it.
    repeated : int
        Most visits of one of those levels.
    levels : float
        Number of levels in the strip: its width over the resolution of the samples.
    """

    level: float
    visits: int
    inside: int
    repeated: int
    levels: float


class Rail(NamedTuple):
    """A level at which records are cut off.

    Parameters
    ----------
    level : float
        In the unit of the samples.
    evidence : float
        -log10 of the probability, at most, of as many visits without a rail at any of the extremes that were compared.
    """

    level: float
    evidence: float


def extremes(x: Array) -> tuple[Extreme, Extreme]:
    """The highest and the lowest level of a record.

    Parameters
    ----------
    x : Array [samples]
        In any unit.
    """
    high, low = _highest(x), _highest(-x)
    return high, low._replace(level=-low.level)


def best_rail(of: Sequence[Extreme]) -> Rail:
    """The rail with the most evidence among extremes of records; of evidence 0 where no level is reached twice.

    Highest and lowest levels may be given together: they differ.
    """
    tried = sorted({extreme.level for extreme in of if extreme.visits > 1})
    found = [Rail(level, _evidence(of, level) - math.log10(len(of))) for level in tried]
    best = max(found, key=lambda rail: rail.evidence, default=Rail(0.0, 0.0))
    return best._replace(evidence=min(max(best.evidence, 0.0), _MOST))


def _highest(x: Array) -> Extreme:
    top, low = float(x.max()), float(x.min())
    same = _EQUAL * max(abs(top), abs(low))
    steps = np.diff(np.sort(x[:: max(1, x.size // _FOR_RESOLUTION)]))
    resolution = max(float(steps[steps > same].min(initial=np.inf)), 2 * same)
    if not math.isfinite(resolution):
        return Extreme(top, 1, 0, 0, 1.0)
    strip = max(_STRIP * (top - low), _LEVELS * resolution)
    there = x >= top - same
    near = x >= top - strip
    begins = near & ~np.concatenate(([False], np.abs(np.diff(x)) <= same))  # samples in a row are one visit
    others = np.sort(x[begins & ~there])
    ends = np.flatnonzero(np.diff(others, append=np.inf) > same)
    repeated = int(np.diff(ends, prepend=-1).max(initial=0))
    return Extreme(top, int(np.count_nonzero(there & begins)), others.size, repeated, strip / resolution)


def _evidence(of: Sequence[Extreme], level: float) -> float:
    """-log10 of the largest probability that a falling density visits its extreme so often."""
    here = [extreme for extreme in of if abs(extreme.level - level) <= _EQUAL * abs(level)]
    visits = sum(extreme.visits for extreme in here)
    if visits <= _SINE * max(extreme.repeated for extreme in here):
        return 0.0
    # Every record has one extreme: a visit more than that has to be at this level, among all of the strip.
    chance = _SINE / (_SINE + min(extreme.levels for extreme in here))
    more = visits - len(here)
    return -float(binom.logsf(more - 1, more + sum(extreme.inside for extreme in here), chance)) / math.log(10)
