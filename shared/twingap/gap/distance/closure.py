"""Closure: the part of the gap that vanishes when effects are added to the twin, with its interval.

records, replicates before, replicates after --Paired, one scale--> overall gap before and after, floor --> closure
                                             --bootstrap over groups, before and after together--> 90 % intervals

The interval of the closure is conservative: its coverage is above 90 % (`tests/twingap/gap/distance/test_closure.py`).
Intervals of the gaps themselves take the spread between records as known and cover less where a gap is large; in the
closure this error cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.report.model import Interval
from twingap.records import Array

LEVEL: Final = 0.9
"""Probability of intervals."""
CLOSURE_BOUNDS: Final = (-10.0, 2.0)
"""Bounds of closures; values beyond occur where the gap is hardly larger than its floor."""


@dataclass(frozen=True)
class Closure:
    """The gap before and after effects were added to the twin."""

    before: float  # over all domains, without the effects
    after: float
    floor: float  # between records and records
    closure: float  # (before - after) / (before - floor), clipped to -10 .. 2; 0 where there was no gap to close
    ci: Interval  # 90 %


def closure(before: float, after: float, floor: float) -> float:
    """(before - after) / (before - floor): 1 where the gap is at its floor, negative where it has grown.

    0 where the gap was at its floor before. Clipped to `CLOSURE_BOUNDS`.
    """
    return float(_closures(np.array([before]), np.array([after]), floor)[0])


def paired(
    real: FeatureVectors, before: Sequence[FeatureVectors], after: Sequence[FeatureVectors], scale: Array | None = None
) -> tuple[Paired, Paired]:
    """Comparisons before and after, both standardised by `scale` [bins], or by the smaller of their spreads."""
    first, second = Paired(real, before), Paired(real, after)
    scale = np.minimum(first.scale, second.scale) if scale is None else scale
    return Paired(real, before, scale), Paired(real, after, scale)


def closure_interval(
    before: Paired, after: Paired, floor: float, rng: np.random.Generator, draws: int = 400
) -> Closure:
    """Closure from two comparisons, made by `paired`, with an interval from one bootstrap of both.

    `floor` is that of the comparison after, from `Paired.floor`.
    """
    (b,), (a,) = before.over_domains(before.squares())[0], after.over_domains(after.squares())[0]
    signs = before.draw_residuals(rng, draws)
    drawn_b, drawn_a = (p.over_domains(p.resampled(signs))[0] for p in (before, after))
    value = closure(float(b), float(a), floor)
    return Closure(float(b), float(a), floor, value, percentile_interval(_closures(drawn_b, drawn_a, floor), value))


def _closures(before: Array, after: Array, floor: float) -> Array:
    """[draws] Closures, bounded; 0 where `before` does not exceed its floor."""
    open_gap = before - floor
    there = open_gap > 1e-9 * max(abs(floor), 1e-9)
    ratio = (before - after) / np.where(there, open_gap, 1.0)
    return np.clip(np.where(there, ratio, 0.0), *CLOSURE_BOUNDS)


def percentile_interval(drawn: Array, value: float) -> Interval:
    """Percentile interval of `LEVEL` from draws of the bootstrap, extended to include the estimate."""
    if not drawn.size:
        return value, value
    low, high = np.quantile(drawn, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2])
    return min(float(low), value), max(float(high), value)
