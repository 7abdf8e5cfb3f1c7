"""Comb scores over records whose speeds are uncertain: each record is shifted to where the comb is strongest.

record --normal deviates of its bins--> sum over the comb's lines, for each speed within reach --highest--> score
                                                                                     mean over records --> one comb

At the fortieth order, a speed error of half a per cent shifts lines too far for a mean over records. The maximum of
many trials is large by chance too, so scores are compared between combs that are searched in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twingap._compiled import njit
from twingap.gap.features.tones.whitened_spectra import Single, Whitened
from twingap.records import Array


@dataclass(frozen=True)
class Aligned:
    """Scores of combs in a set of records."""

    # [combs, records] Highest weighted sum of deviates over each comb's lines; NaN for a first line beyond the record.
    score: Array
    lines: Array  # [combs, lines] mean over records of each line's deviate there

    def mean(self, share: float = 0.6) -> Array:
        """[combs] Mean score; NaN of combs that fewer than this share of the records reach."""
        known = np.isfinite(self.score)
        total = np.where(known, self.score, 0.0).sum(axis=1)
        return np.where(known.mean(axis=1) > share, total / np.maximum(known.sum(axis=1), 1), np.nan)


def aligned(
    records: Sequence[Whitened], deviates: Sequence[Single], combs: Array, weights: Array, reach: Sequence[float]
) -> Aligned:
    """Score of each comb in each record, at the speed within reach where it stands highest.

    `deviates` [bins] are of each record; `combs` [combs, lines] are shaft orders, weighted by `weights` [lines];
    `reach` is the largest relative error of each record's speed.
    """
    score, total, count = np.full((len(combs), len(records)), np.nan), np.zeros(combs.shape), np.zeros(len(combs))
    for k, (record, own, far) in enumerate(zip(records, deviates, reach, strict=True)):
        _search(own, combs * (record.shaft_hz / record.df_hz), weights, far, score[:, k], total, count)
    return Aligned(score, total / np.maximum(count, 1)[:, None])


@njit()
def _search(
    deviates: Single, combs: Array, weights: Array, reach: float, score: Array, total: Array, count: Array
) -> None:
    """Add one record to the sums of `aligned`; `combs` in bins of the record."""
    end = deviates.size - 3
    for c in range(combs.shape[0]):
        first = combs[c, 0]
        if first * (1 + reach) > end:
            continue
        last = first
        for j in range(combs.shape[1]):
            last = combs[c, j] if combs[c, j] > last else last
        step = 1 / (first + last)  # half a bin, at the middle of the comb
        tries = math.ceil(reach / step)
        best, at = -np.inf, 1.0
        for k in range(-tries, tries + 1):
            ratio = 1 + k * step
            value = 0.0
            for j in range(combs.shape[1]):
                place = int(combs[c, j] * ratio + 0.5)
                if place < end:
                    value += weights[j] * deviates[place]
            if value > best:
                best, at = value, ratio
        score[c] = best
        count[c] += 1
        for j in range(combs.shape[1]):
            place = int(combs[c, j] * at + 0.5)
            if place < end:
                total[c, j] += deviates[place]
