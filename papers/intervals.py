"""Spread and Student's intervals over seeds, as columns of a table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from twingap.adapt.evaluate import t_interval


def std(values: Sequence[float]) -> float:
    """Standard deviation over seeds (n - 1); NaN for fewer than two."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")


def intervals(
    values: Iterable[float], levels: Sequence[float], lowest: float = -np.inf, highest: float = np.inf, name: str = ""
) -> dict[str, float]:
    """Columns ``low_95`` and ``high_95`` of each level; ends beyond what a value can be are cut."""
    row = {}
    for level in levels:
        low, high = t_interval(list(values), level)
        row[f"{name}low_{100 * level:.0f}"], row[f"{name}high_{100 * level:.0f}"] = max(low, lowest), min(high, highest)
    return row
