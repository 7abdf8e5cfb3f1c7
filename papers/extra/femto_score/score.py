"""The score of the IEEE PHM 2012 challenge, and the prediction with the highest expected score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from papers.arrays import Array
from papers.paper1_rul_varying_speed.methods.metrics import phm2012_accuracy

_TRIED: Final = np.linspace(0.02, 1.0, 99)
"""Shares of the life so far that are tried."""


def best_point(lives: Array) -> float:
    """Prediction with the highest expected score, among equally likely remaining lives [n]."""
    kept = lives[lives > 0]
    if not kept.size:
        return 0.0
    return float(kept[int(np.argmax([phm2012_accuracy(kept, np.full(kept.size, value)).mean() for value in kept]))])


def best_share(ratios: Sequence[float]) -> float:
    """Share of the life so far with the highest mean score, where remaining over past life has these ratios."""
    true = np.asarray(ratios)
    return float(max(_TRIED, key=lambda share: phm2012_accuracy(true, np.full(true.size, share)).mean()))


def within(lives: Array, lived: float, band: tuple[float, float]) -> Array:
    """Remaining lives [n] whose cut lies in a band of life; the closest that does where none is."""
    low, high = lived * (1 / band[1] - 1), lived * (1 / band[0] - 1)
    kept = lives[(lives >= low) & (lives <= high)]
    return kept if kept.size else np.clip([np.median(lives)], low, high)
