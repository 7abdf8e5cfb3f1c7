"""Whether one method beats another: exact sign-flip tests of paired differences, corrected for their number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

STEP: Final = 1e-4  # differences are counted in hundredths of a point; what is finer is rounded away


def sign_flip(differences: Sequence[float] | NDArray[np.float64], step: float = STEP) -> float:
    """Two-sided p that differences [pairs] are symmetric about zero, from all 2^n sign flips of their sum; 1 without
    any.

    If two methods were alike, each paired difference would have had the other sign as often (Fisher 1935). The
    distribution over all flips is exact for any number of pairs: it is built up pair by pair, as the number of ways to
    reach each sum, counted in units of `step`. Pairs that share recordings are not independent as samples of machines:
    p speaks of the randomness of training on these recordings.
    """
    signed = np.rint(np.asarray(differences, dtype=np.float64) / step)
    observed, counted = abs(int(signed.sum())), np.abs(signed).astype(np.int64)
    counted = counted[counted > 0]
    if not counted.size:
        return 1.0
    # In units of their greatest common divisor the sums are fewer, and the same.
    unit = int(np.gcd.reduce(counted))
    counted, observed = counted // unit, observed // unit
    total = int(counted.sum())
    ways = np.zeros(2 * total + 1)
    ways[total] = 1.0
    for value in counted:
        shifted = np.zeros_like(ways)
        shifted[value:] += 0.5 * ways[:-value]
        shifted[:-value] += 0.5 * ways[value:]
        ways = shifted
    sums = np.abs(np.arange(-total, total + 1))
    return min(1.0, float(ways[sums >= observed].sum()))


def paired(one: pd.Series[Any], other: pd.Series[Any], name: str = "gain") -> tuple[pd.Series[Any], dict[str, Any]]:
    """Differences of accuracies with the same index, and their columns of a table: `name` is their mean, in points."""
    found = (one - other).dropna()
    return found, {
        "pairs": len(found), name: 100 * found.mean(), "won": int((found > 0).sum()), "lost": int((found < 0).sum()),
        "p": sign_flip(found.to_numpy(float)),
    }  # fmt: skip


def corrected(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows with a column ``p_holm`` beside their ``p``."""
    return [row | {"p_holm": p} for row, p in zip(rows, holm([row["p"] for row in rows]), strict=True)]


def holm(p_values: Sequence[float]) -> list[float]:
    """P values corrected for their number by Holm's step-down (1979): the chance of any false find stays below each."""
    p, number = np.asarray(p_values, dtype=np.float64), len(p_values)
    order = np.argsort(p, kind="stable")
    found = np.empty(number)
    found[order] = np.maximum.accumulate(np.minimum(1.0, np.arange(number, 0, -1) * p[order]))
    return [float(value) for value in found]
