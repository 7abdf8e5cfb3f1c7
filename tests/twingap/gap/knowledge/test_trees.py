"""Boosted trees as flat arrays say what scikit-learn says, to the bit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

from twingap.gap.knowledge.trees import Boosted


def _rows(rng: np.random.Generator, count: int) -> np.ndarray:
    rows = rng.standard_normal((count, 12)).astype(np.float32)
    rows[rng.random(rows.shape) < 0.2] = np.nan
    rows[:, 3] = np.round(rows[:, 3])  # few values: thresholds lie between them
    return rows


def test_classifier_and_regressor_are_kept_to_the_bit() -> None:
    rng = np.random.default_rng(3)
    rows, unseen = _rows(rng, 600), _rows(rng, 400)
    known = np.nan_to_num(rows)
    target = known[:, 0] * known[:, 3] + known[:, 5] + 0.3 * np.isnan(rows[:, 1])
    classifier = HistGradientBoostingClassifier(max_iter=40, random_state=0).fit(rows, target > 0)
    regressor = HistGradientBoostingRegressor(loss="absolute_error", max_iter=40, random_state=0).fit(rows, target)
    for trees, expected in (
        (Boosted.of(classifier), classifier.decision_function(unseen)),
        (Boosted.of(regressor), regressor.predict(unseen)),
    ):
        np.testing.assert_array_equal(trees.raw(unseen), expected)
        np.testing.assert_array_equal(trees.raw(unseen[7:8]), expected[7:8])


def test_a_feature_that_is_never_known_goes_its_way() -> None:
    rng = np.random.default_rng(3)
    rows = _rows(rng, 300)
    model = HistGradientBoostingClassifier(max_iter=20, random_state=0).fit(rows, np.isnan(rows[:, 1]))
    blind = np.full((2, 12), np.nan, np.float32)
    np.testing.assert_array_equal(Boosted.of(model).raw(blind), model.decision_function(blind))


def test_several_outputs_and_categories_are_refused() -> None:
    rng = np.random.default_rng(3)
    rows = np.abs(np.round(np.nan_to_num(_rows(rng, 300))))
    several = HistGradientBoostingClassifier(max_iter=3).fit(rows, rng.integers(3, size=300))
    kinds = HistGradientBoostingClassifier(max_iter=3, categorical_features=[3]).fit(rows, rows[:, 3] > 1)
    for model in (several, kinds):
        with pytest.raises(ValueError, match="one output over numeric"):
            Boosted.of(model)


def test_what_was_learnt_is_read_without_what_learns(learnt_home: Path) -> None:
    """Every command reads it: ten times as fast as scikit-learn is imported, which only training needs."""
    (path,) = (learnt_home / "gap").glob("learnt-*.gz")
    code = (
        "import sys; from pathlib import Path; from twingap.gap.knowledge import load;"
        f"learnt = load(Path({str(path)!r})); print(len(learnt.detectors), 'sklearn' in sys.modules, learnt.sight)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert int(told[0]) > 0
    assert told[1:] == ["False", "None"]
