"""Support vector machine for few labelled records, its settings chosen by grouped cross-validation.

Two pieces of one recording are nearly the same: a fold that holds one and trains on the other shows nothing, and a
scaler fitted before the split has seen the answer's size. Neither can happen here.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array

SETTINGS: Final = {"svc__C": [1.0, 10.0, 100.0], "svc__gamma": ["scale", 0.01]}
"""Tried where two recordings of each class or more are at hand; else C = 10 and "scale"."""
FOLDS: Final = 3


@dataclass(frozen=True)
class FewLabels:
    pipeline: Any
    # balanced accuracy over folds without a shared recording; None where there were too few to cut any
    cross_validated: float | None
    n_classes: int

    def probabilities(self, features: Array) -> Array:
        """Soft votes [records, classes]: softmax of the one-against-rest margins."""
        margin = np.asarray(self.pipeline.decision_function(features), dtype=np.float64)
        known = self.pipeline.classes_
        if margin.ndim == 1:
            margin = np.stack((-margin, margin), axis=-1)
        weight = np.exp(margin - margin.max(axis=1, keepdims=True))
        out = np.zeros((len(features), self.n_classes))
        out[:, known] = weight / weight.sum(axis=1, keepdims=True)
        return out


def fit_few_labels(features: Array, labels: NDArray[np.int64], groups: NDArray[np.str_], n_classes: int) -> FewLabels:
    """Fit on labelled records of two classes or more: features [records, features] as measured, and the recording of
    each."""
    from sklearn.model_selection import GridSearchCV, StratifiedGroupKFold
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    svc = SVC(C=10.0, gamma="scale", class_weight="balanced", decision_function_shape="ovr")
    pipeline = make_pipeline(StandardScaler(), svc)
    fewest = min(np.unique(groups[labels == c]).size for c in np.unique(labels))
    splits = []
    if (folds := min(FOLDS, fewest)) > 1:
        # A fold that lacks a class on the training side cannot be scored.
        every = StratifiedGroupKFold(folds).split(features, labels, groups)
        splits = [s for s in every if np.unique(labels[s[0]]).size == np.unique(labels).size]
    if not splits:
        return FewLabels(pipeline.fit(features, labels), None, n_classes)
    search = GridSearchCV(pipeline, SETTINGS, scoring="balanced_accuracy", cv=splits).fit(features, labels)
    return FewLabels(search.best_estimator_, float(search.best_score_), n_classes)
