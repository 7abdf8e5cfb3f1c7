"""Spread, Student's intervals over seeds and comparisons of errors, as columns of a table."""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

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


def by_seed(errors: pd.DataFrame) -> pd.DataFrame:
    """Errors [runs, seeds], min, of the trainings of one method: rows with bearing, seed and rmse_min."""
    return errors.pivot(index="bearing", columns="seed", values="rmse_min")


def compared(before: pd.DataFrame, after: pd.DataFrame, levels: Sequence[float] = (0.9,)) -> dict[str, float]:
    """Errors before and after [runs, seeds], min, the ratio of their means with its intervals over seeds, and on how
    many runs it is below 1; runs that `after` lacks count as unchanged."""
    after = after.reindex(index=before.index, columns=before.columns).fillna(before)
    ratios = (after.mean() / before.mean()).to_numpy()
    return {
        "runs": len(before), "seeds": ratios.size, "before_min": before.to_numpy().mean(),
        "after_min": after.to_numpy().mean(), "ratio": ratios.mean(), **intervals(ratios, levels),
        "runs_better": int((after.mean(axis=1) < before.mean(axis=1)).sum()),
    }  # fmt: skip
