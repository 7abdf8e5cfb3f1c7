"""Trees as flat arrays: the predictions of scikit-learn's ensembles, stored and read back."""

from dataclasses import replace

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier

from twingap.adapt.trees import Trees
from twingap.errors import TwingapError


def fitted() -> tuple[HistGradientBoostingClassifier, np.ndarray]:
    rng = np.random.default_rng(0)
    x = rng.standard_normal((400, 6)).astype(np.float32)
    x[:, 5] = np.round(x[:, 5])  # thresholds halfway between numbers that occur
    y = (x[:, 0] + x[:, 5] > 0).astype(int) + 2 * (x[:, 1] * x[:, 2] > 0)
    model = HistGradientBoostingClassifier(max_iter=20, max_leaf_nodes=9, early_stopping=False, random_state=0)
    return model.fit(x, y), np.concatenate([x, rng.standard_normal((400, 6)).astype(np.float32)])


def test_trees_predict_what_scikit_learn_predicts() -> None:
    model, rows = fitted()
    raised = np.exp(Trees.of_boosting(model)(rows))
    np.testing.assert_allclose(raised / raised.sum(axis=1, keepdims=True), model.predict_proba(rows), atol=2e-6)
    assert Trees.of_boosting(model)(rows[:0]).shape == (0, 4)


def test_a_number_on_a_threshold_goes_to_the_left_as_in_scikit_learn() -> None:
    model, rows = fitted()
    trees = Trees.of_boosting(model)
    node = int(np.flatnonzero(trees.column == 0)[0])
    for other in (np.float32(np.inf), np.float32(-np.inf), trees.threshold[node]):
        row = rows[:1].copy()
        row[0, 0] = np.nextafter(trees.threshold[node], other)
        raised = np.exp(trees(row))
        np.testing.assert_allclose(raised / raised.sum(), model.predict_proba(row), atol=2e-6)


def test_arrays_make_the_same_trees_again() -> None:
    model, rows = fitted()
    trees = Trees.of_boosting(model)
    again = Trees.of_arrays(trees.arrays(), where="here")
    np.testing.assert_array_equal(again(rows), trees(rows))
    assert {name: a.dtype for name, a in again.arrays().items()} == {n: a.dtype for n, a in trees.arrays().items()}


@pytest.mark.parametrize("name", ["right", "roots", "values", "column"])
def test_arrays_that_are_no_trees_are_refused(name: str) -> None:
    trees = Trees.of_boosting(fitted()[0])
    broken = replace(trees, **{name: getattr(trees, name)[:-1] if name in ("values", "column") else -trees.right - 1})
    with pytest.raises(TwingapError, match=r"here: .*install twingap again"):
        Trees.of_arrays(broken.arrays(), where="here")
    with pytest.raises(TwingapError, match=f"lacks the array '{name}'"):
        Trees.of_arrays({k: v for k, v in trees.arrays().items() if k != name}, where="here")


def test_a_tree_that_would_never_end_is_refused() -> None:
    trees = Trees.of_boosting(fitted()[0])
    inner = int(np.flatnonzero(trees.column >= 0)[-1])
    right = trees.right.copy()
    right[inner] = inner
    with pytest.raises(TwingapError, match="contains no valid trees"):
        Trees.of_arrays(replace(trees, right=right).arrays(), where="here")
