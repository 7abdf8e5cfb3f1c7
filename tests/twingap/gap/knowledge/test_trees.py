"""Boosted trees as flat arrays predict what scikit-learn predicts."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

from twingap.gap.knowledge.trees import Boosted


def _rows(rng: np.random.Generator, count: int) -> np.ndarray:
    rows = rng.standard_normal((count, 12)).astype(np.float32)
    rows[rng.random(rows.shape) < 0.2] = np.nan
    rows[:, 3] = np.round(rows[:, 3])  # few values: thresholds lie between them
    return rows


def test_classifier_and_regressor_predict_the_same() -> None:
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
        # Leaves are kept as float32; a row that took another way would be off by far more.
        np.testing.assert_allclose(trees.raw(unseen), expected, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(trees.raw(unseen[7:8]), trees.raw(unseen)[7:8])


def test_a_row_at_a_threshold_goes_where_it_went() -> None:
    rng = np.random.default_rng(4)
    rows = rng.random((500, 3)).astype(np.float32)
    model = HistGradientBoostingRegressor(max_iter=30, random_state=0).fit(rows, rows[:, 0] > rows[:, 1])
    trees = Boosted.of(model)
    at = np.unique(trees.value[trees.column == 0])
    close = np.concatenate([at, np.nextafter(at, np.float32(2)), np.nextafter(at, np.float32(-2))])
    own = np.full((close.size, 3), 0.5, np.float32)
    own[:, 0] = close
    np.testing.assert_allclose(trees.raw(own), model.predict(own), rtol=0, atol=1e-6)


def test_a_feature_that_is_never_known_goes_its_way() -> None:
    rng = np.random.default_rng(3)
    rows = _rows(rng, 300)
    model = HistGradientBoostingClassifier(max_iter=20, random_state=0).fit(rows, np.isnan(rows[:, 1]))
    blind = np.full((2, 12), np.nan, np.float32)
    np.testing.assert_allclose(Boosted.of(model).raw(blind), model.decision_function(blind), rtol=0, atol=1e-6)


def test_several_outputs_and_categories_are_refused() -> None:
    rng = np.random.default_rng(3)
    rows = np.abs(np.round(np.nan_to_num(_rows(rng, 300))))
    several = HistGradientBoostingClassifier(max_iter=3).fit(rows, rng.integers(3, size=300))
    kinds = HistGradientBoostingClassifier(max_iter=3, categorical_features=[3]).fit(rows, rows[:, 3] > 1)
    for model in (several, kinds):
        with pytest.raises(ValueError, match="one output over numeric"):
            Boosted.of(model)
