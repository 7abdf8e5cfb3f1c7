"""Boosted trees as flat arrays predict what scikit-learn predicts."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

from twingap.errors import TwingapError
from twingap.trees import Trees


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
        (Trees.of_boosting(classifier), classifier.decision_function(unseen)),
        (Trees.of_boosting(regressor), regressor.predict(unseen)),
    ):
        # Leaves are kept as float32; a row that took another way would be off by far more.
        np.testing.assert_allclose(trees(unseen)[:, 0], expected, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(trees(unseen[7:8]), trees(unseen)[7:8])


def test_a_row_at_a_threshold_goes_where_it_went() -> None:
    rng = np.random.default_rng(4)
    rows = rng.random((500, 3)).astype(np.float32)
    model = HistGradientBoostingRegressor(max_iter=30, random_state=0).fit(rows, rows[:, 0] > rows[:, 1])
    trees = Trees.of_boosting(model)
    at = np.unique(trees.value[trees.column == 0])
    close = np.concatenate([at, np.nextafter(at, np.float32(2)), np.nextafter(at, np.float32(-2))])
    own = np.full((close.size, 3), 0.5, np.float32)
    own[:, 0] = close
    np.testing.assert_allclose(trees(own)[:, 0], model.predict(own), rtol=0, atol=1e-6)


def test_a_feature_that_is_never_known_goes_its_way() -> None:
    rng = np.random.default_rng(3)
    rows = _rows(rng, 300)
    model = HistGradientBoostingClassifier(max_iter=20, random_state=0).fit(rows, np.isnan(rows[:, 1]))
    blind = np.full((2, 12), np.nan, np.float32)
    np.testing.assert_allclose(Trees.of_boosting(model)(blind)[:, 0], model.decision_function(blind), rtol=0, atol=1e-6)


def test_several_classes_predict_the_same() -> None:
    rng = np.random.default_rng(3)
    rows, unseen = _rows(rng, 400), _rows(rng, 100)
    known = np.nan_to_num(rows)
    label = (known[:, 0] > 0).astype(int) + 2 * (known[:, 1] * known[:, 2] > 0)
    model = HistGradientBoostingClassifier(max_iter=20, max_leaf_nodes=9, random_state=0).fit(rows, label)
    raised = np.exp(Trees.of_boosting(model)(unseen))
    np.testing.assert_allclose(raised / raised.sum(axis=1, keepdims=True), model.predict_proba(unseen), atol=2e-6)
    assert Trees.of_boosting(model)(unseen[:0]).shape == (0, 4)


def test_many_features_and_large_trees_predict_the_same() -> None:
    rng = np.random.default_rng(5)
    rows = rng.standard_normal((2000, 300)).astype(np.float32)
    target = rows[:, 290] + np.sin(3 * rows[:, 2])
    model = HistGradientBoostingRegressor(max_iter=3, max_leaf_nodes=150, min_samples_leaf=2).fit(rows, target)
    trees = Trees.of_boosting(model)
    assert trees.column.dtype == np.uint16 == trees.right.dtype
    np.testing.assert_allclose(trees(rows)[:, 0], model.predict(rows), rtol=0, atol=1e-6)


def test_categories_are_refused() -> None:
    rng = np.random.default_rng(3)
    rows = np.abs(np.round(np.nan_to_num(_rows(rng, 300))))
    model = HistGradientBoostingClassifier(max_iter=3, categorical_features=[3]).fit(rows, rows[:, 3] > 1)
    with pytest.raises(ValueError, match="expected"):
        Trees.of_boosting(model)


@pytest.fixture(scope="module")
def trees() -> Trees:
    rng = np.random.default_rng(3)
    rows = _rows(rng, 300)
    return Trees.of_boosting(HistGradientBoostingClassifier(max_iter=5).fit(rows, rng.integers(3, size=300)))


def test_arrays_make_the_same_trees_again(trees: Trees) -> None:
    rows = _rows(np.random.default_rng(6), 50)
    again = Trees.of_arrays(trees.arrays(), where="here")
    np.testing.assert_array_equal(again(rows), trees(rows))


@pytest.mark.parametrize("name", ["start", "roots", "column", "right", "value"])
def test_arrays_that_are_no_trees_are_refused(trees: Trees, name: str) -> None:
    broken = {
        "start": trees.start[:2], "roots": trees.roots + trees.column.size, "column": trees.column[:-1],
        "right": np.zeros_like(trees.right), "value": trees.value[1:],
    }  # fmt: skip
    with pytest.raises(TwingapError, match=r"here: .*install twingap again"):
        Trees.of_arrays(trees.arrays() | {name: broken[name]}, where="here")
    with pytest.raises(TwingapError, match=f"lacks the array '{name}'"):
        Trees.of_arrays({k: v for k, v in trees.arrays().items() if k != name}, where="here")
