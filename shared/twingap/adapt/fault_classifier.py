"""Fault classifier: boosted trees with a calibrated temperature, as a scikit-learn estimator.

rows [records, windows, features] --trees--> probabilities of windows --mean--> of records --temperature--> calibrated

`twingap classify` uses it with the features of `OrderFeatures`; it takes any finite features.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from twingap.adapt.confidence import Calibration, Reliability, calibrate_temperature, cross_checked
from twingap.trees import Trees

Array = NDArray[np.float64]


class FaultClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """Boosted trees for rows of features, several of which may belong to one record.

    The trees classify single rows (windows). Where a record has several, their probabilities are averaged. `calibrate`
    fits a temperature to further records, after which probabilities can be taken at their word. All classes have the
    same weight, whatever their numbers of records.

    Parameters
    ----------
    n_estimators : int
        Boosting rounds: trees for each class. More rounds fit the training data more closely.
    learning_rate : float
        Factor on the contribution of each tree. A smaller value needs more rounds.
    max_leaf_nodes : int
        Largest number of leaves of a tree.
    min_samples_leaf : int
        Smallest number of rows in a leaf. A larger value gives smoother trees.
    l2_regularization : float
        Penalty on the values of the leaves.
    max_features : float
        Part of the features that each split chooses from.
    random_state : int, RandomState or None
        Same value, same trees, whatever the number of cores.

    Attributes
    ----------
    classes_ : ndarray [classes]
        Labels in ascending order.
    n_features_in_ : int
        Features of a row.
    trees_ : Trees
        Log odds of the classes; with two classes those of the second.
    outputs_ : ndarray [classes]
        Output of the trees for each of `classes_`.
    calibration_ : Calibration or None
        None until `calibrate` was called.
    reliability_ : Reliability or None
        Accuracy and confidence, cross-validated on the records that the temperature was fitted to.

    See Also
    --------
    twingap.adapt.OrderFeatures : Features of records.
    twingap.adapt.shipped_classifier : The fitted classifier that ships with twingap.

    Examples
    --------
    >>> import numpy as np
    >>> from twingap.adapt import FaultClassifier
    >>> rng = np.random.default_rng(0)
    >>> y = np.repeat(["healthy", "outer"], 100)
    >>> X = rng.standard_normal((200, 3)) + 4.0 * (y == "outer")[:, None]
    >>> classifier = FaultClassifier(n_estimators=20, random_state=0).fit(X, y)
    >>> classifier.score(X, y) > 0.95
    True
    >>> classifier.predict_proba(X[:5]).shape
    (5, 2)
    """

    def __init__(
        self,
        *,
        n_estimators: int = 150,
        learning_rate: float = 0.06,
        max_leaf_nodes: int = 12,
        min_samples_leaf: int = 40,
        l2_regularization: float = 5.0,
        max_features: float = 0.3,
        random_state: Any = None,
    ) -> None:
        self.n_estimators = n_estimators
        self.learning_rate = learning_rate
        self.max_leaf_nodes = max_leaf_nodes
        self.min_samples_leaf = min_samples_leaf
        self.l2_regularization = l2_regularization
        self.max_features = max_features
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> FaultClassifier:
        """Fit the trees; a former calibration is dropped.

        Parameters
        ----------
        X : array [records, windows, features] or [records, features]
        y : array [records]
            Labels of at least two classes.

        Returns
        -------
        FaultClassifier

        Raises
        ------
        ValueError
            For features that are not finite, or fewer than two classes.
        """
        from sklearn.ensemble import HistGradientBoostingClassifier  # slow to import, and not needed to predict
        from threadpoolctl import threadpool_limits

        rows, windows = _flat(X)
        rows, y = validate_data(self, rows, y if windows == 1 else np.repeat(np.asarray(y), windows), dtype=np.float32)
        check_classification_targets(y)
        self.classes_, places = np.unique(y, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError(f"y holds 1 class ({self.classes_[0]}), at least 2 classes expected")
        model = HistGradientBoostingClassifier(
            max_iter=self.n_estimators, learning_rate=self.learning_rate, max_leaf_nodes=self.max_leaf_nodes,
            min_samples_leaf=self.min_samples_leaf, l2_regularization=self.l2_regularization,
            max_features=self.max_features, early_stopping=False, class_weight="balanced",
            random_state=self.random_state,
        )  # fmt: skip
        with threadpool_limits(1):  # sums over rows depend on the number of threads
            model.fit(rows, places)
        self.trees_, self.outputs_ = Trees.of_boosting(model), np.arange(len(self.classes_))
        self.calibration_: Calibration | None = None
        self.reliability_: Reliability | None = None
        return self

    def calibrate(self, X: ArrayLike, y: ArrayLike, window_weight: ArrayLike | None = None) -> FaultClassifier:
        """Fit the temperature to records that the trees were not fitted to.

        Parameters
        ----------
        X : array [records, windows, features] or [records, features]
            As many windows a record as are to be classified later.
        y : array [records]
            Labels, all among `classes_`.
        window_weight : array [records, windows], optional
            Weights of the windows in the mean of each record; equal by default.

        Returns
        -------
        FaultClassifier

        Raises
        ------
        ValueError
            For labels that are not among `classes_`.
        """
        predicted, y = self._uncalibrated(X, window_weight), np.asarray(y)
        if unknown := sorted({str(label) for label in y} - {str(label) for label in self.classes_}):
            raise ValueError(f"labels {', '.join(unknown)} are not among the classes of the fit")
        labels = self.outputs_[np.searchsorted(self.classes_, y)]
        self.calibration_ = calibrate_temperature(predicted, labels)
        self.reliability_ = cross_checked(predicted, labels)
        return self

    def predict_proba(self, X: ArrayLike, window_weight: ArrayLike | None = None) -> Array:
        """Probabilities of the classes, calibrated where `calibrate` was called.

        Parameters
        ----------
        X : array [records, windows, features] or [records, features]
        window_weight : array [records, windows], optional
            Weights of the windows in the mean of each record; equal by default.

        Returns
        -------
        Array [records, classes]
            In the order of `classes_`.
        """
        predicted = self._uncalibrated(X, window_weight)
        return (predicted if self.calibration_ is None else self.calibration_(predicted))[:, self.outputs_]

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """The most probable class of each record [records].

        Parameters
        ----------
        X : array [records, windows, features] or [records, features]
        """
        probabilities = self.predict_proba(X)
        return np.asarray(self.classes_[probabilities.argmax(axis=1)])

    def _uncalibrated(self, X: ArrayLike, window_weight: ArrayLike | None = None) -> Array:
        """Mean probabilities over the windows of each record, in the order of the trees' outputs."""
        check_is_fitted(self)
        rows, windows = _flat(X)
        odds = self.trees_(validate_data(self, rows, dtype=np.float32, reset=False))
        if odds.shape[1] == 1:
            odds = np.hstack([np.zeros_like(odds), odds])
        return votes(softmax(odds), windows, window_weight)


def votes(probabilities: Array, windows: int, window_weight: ArrayLike | None = None) -> Array:
    """Mean probabilities of each record [records, classes], whose windows follow each other."""
    of_windows = probabilities.reshape(-1, windows, probabilities.shape[1])
    if window_weight is None:
        return np.asarray(of_windows.mean(axis=1))
    weight = np.asarray(window_weight, float)
    return np.asarray(np.einsum("rwc,rw->rc", of_windows, weight) / weight.sum(axis=1, keepdims=True))


def softmax(log_odds: Array) -> Array:
    """Probabilities from log odds [rows, classes]."""
    raised = np.exp(log_odds - log_odds.max(axis=1, keepdims=True))
    return np.asarray(raised / raised.sum(axis=1, keepdims=True))


def _flat(X: Any) -> tuple[Any, int]:
    """Rows of features, and how many of them follow each other for a record."""
    if getattr(X, "ndim", 2) != 3:
        return X, 1
    return np.asarray(X).reshape(-1, X.shape[2]), X.shape[1]
