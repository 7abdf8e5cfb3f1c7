"""Network classifier with domain adaptation, as a scikit-learn estimator.

labelled source rows --split by group--> train <-- unlabelled target rows
                            +--held out--> criteria of each checkpoint --> the network that predicts
"""

from __future__ import annotations

import math
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_consistent_length, check_is_fitted, check_random_state, validate_data

from twingap.adapt.alignment import Alignment
from twingap.adapt.mode_network import MULTIPLE, SHORTEST, Architecture
from twingap.adapt.selection import CRITERIA, DEFAULT, Evidence, select
from twingap.adapt.training import Inputs, Labels, Training, outputs, train
from twingap.adapt.windows import Windows, split_by_group

Array = NDArray[np.float64]


class DomainAdaptationClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """Network that is trained on labelled rows of one domain and adapted to unlabelled rows of another.

    Parameters
    ----------
    architecture : Architecture, optional
        Parts of the network. Default: all of them.
    alignment : Alignment, optional
        What draws the domains together. Default: one discriminator of the features (DANN).
    training : Training, optional
        Steps, batches and rates.
    held_out : float
        Part of the groups of each class that is kept from training, to choose a checkpoint.
    criterion : str
        Key of `twingap.adapt.CRITERIA`: how the checkpoint is chosen, without target labels.
    device : {"auto", "cpu", "cuda"}
    random_state : int, RandomState or None
        Split, weights and batches. The same integer gives the same network on the same kind of device.

    Attributes
    ----------
    classes_ : ndarray [classes]
    n_features_in_ : int
        Channels times points.
    channels_ : int
    trained_ : Trained
        All checkpoints.
    criteria_ : dict[str, tuple of float]
        Score of each checkpoint by each criterion.
    chosen_ : dict[str, int]
        Checkpoint that each criterion prefers.
    source_accuracy_ : tuple of float
        Accuracy of each checkpoint on held-out source rows.
    network_ : torch.nn.Module
        The network of the chosen checkpoint.

    Notes
    -----
    `twingap.adapt.METHODS` holds architectures and alignments by name; `twingap.adapt.ModeInputs` makes rows of
    windows. Rows are padded with zeros to a length that the network takes: a multiple of 32, at least 256 points.

    Examples
    --------
    >>> import numpy as np
    >>> from twingap.adapt import METHODS, DomainAdaptationClassifier, Training
    >>> rng = np.random.default_rng(0)
    >>> y = np.repeat(["healthy", "outer"], 20)
    >>> X = rng.standard_normal((40, 256)) * np.where(y == "outer", np.sin(np.arange(256)[:, None]), 1.0).T
    >>> dann = METHODS["DANN"]
    >>> classifier = DomainAdaptationClassifier(
    ...     dann.architecture, dann.alignment, training=Training(steps=4, checkpoints=2), random_state=0
    ... )
    >>> classifier.fit(X, y, X_target=0.5 * X[::-1]).predict_proba(X).shape
    (40, 2)
    """

    def __init__(
        self,
        architecture: Architecture | None = None,
        alignment: Alignment | None = None,
        *,
        training: Training | None = None,
        held_out: float = 0.25,
        criterion: str = DEFAULT,
        device: str = "auto",
        random_state: Any = None,
    ) -> None:
        self.architecture = architecture
        self.alignment = alignment
        self.training = training
        self.held_out = held_out
        self.criterion = criterion
        self.device = device
        self.random_state = random_state

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        X_target: ArrayLike | None = None,
        groups: ArrayLike | None = None,
        classes: ArrayLike | None = None,
    ) -> DomainAdaptationClassifier:
        """Train, and choose a checkpoint without target labels.

        Parameters
        ----------
        X : array [rows, channels, points] or [rows, points]
            Source rows.
        y : array [rows]
            Their labels, of at least two classes.
        X_target : array [rows, channels, points] or [rows, points], optional
            Target rows. Without them the network is not adapted, and the checkpoint is the one with the best accuracy
            on held-out source rows.
        groups : array [rows], optional
            Recording or machine of each source row; no group is both trained on and held out. Default: each row is a
            group.
        classes : array [classes], optional
            All labels in ascending order, where `y` may lack some. Default: those in `y`.

        Returns
        -------
        DomainAdaptationClassifier

        Raises
        ------
        ValueError
            For values that are not finite, or fewer than two classes.
        TwingapError
            For a class with too few groups to hold one out.
        """
        self.channels_ = X.shape[1] if getattr(X, "ndim", 2) == 3 else 1  # type: ignore[union-attr]
        rows, y = validate_data(self, _flat(X), y, dtype=np.float32)
        check_classification_targets(y)
        self.classes_ = np.unique(y) if classes is None else np.asarray(classes)
        if len(self.classes_) < 2:
            raise ValueError(f"y holds 1 class ({self.classes_[0]}), at least 2 classes expected")
        labels = np.searchsorted(self.classes_, y).astype(np.int64)
        seed = self.random_state
        if not isinstance(seed, Integral):
            seed = int(check_random_state(seed).randint(2**31))
        groups = np.arange(len(labels)) if groups is None else np.asarray(groups)
        check_consistent_length(labels, groups)
        x = self._padded(rows)
        part, held = split(labels, groups, self.held_out, int(seed))
        adapted = X_target is not None
        x_target = x[held] if X_target is None else self._inputs(X_target)
        alignment = Alignment(("features",)) if self.alignment is None else self.alignment
        self.trained_ = train(
            x[part], labels[part], x_target, alignment if adapted else Alignment(), self.training or Training(),
            int(seed), len(self.classes_), self.device, self.architecture or Architecture(),
        )  # fmt: skip
        nets = [self.trained_.network(i) for i in range(len(self.trained_.checkpoints))]
        evidence = [Evidence(outputs(net, x[held]), labels[held], outputs(net, x_target)) for net in nets]
        known = CRITERIA if adapted else {"source_accuracy": CRITERIA["source_accuracy"]}
        self.criteria_ = {name: tuple(rule(e) for e in evidence) for name, rule in known.items()}
        self.chosen_ = {name: select(evidence, name) for name in known}
        self.source_accuracy_ = tuple(float(np.mean(e.source.predicted == e.source_labels)) for e in evidence)
        self.network_ = nets[self.chosen_[self.criterion if adapted else "source_accuracy"]]
        return self

    def predict_proba(self, X: ArrayLike) -> Array:
        """Probabilities of the classes [rows, classes], in the order of `classes_`.

        Parameters
        ----------
        X : array [rows, channels, points] or [rows, points]
        """
        check_is_fitted(self)
        return outputs(self.network_, self._inputs(X)).probabilities

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """The most probable class of each row [rows].

        Parameters
        ----------
        X : array [rows, channels, points] or [rows, points]
        """
        probabilities = self.predict_proba(X)
        return np.asarray(self.classes_[probabilities.argmax(axis=1)])

    def _inputs(self, X: ArrayLike) -> Inputs:
        """Validated rows as the network takes them."""
        return self._padded(validate_data(self, _flat(X), dtype=np.float32, reset=False))

    def _padded(self, rows: Inputs) -> Inputs:
        """Rows [rows, channels, points], padded with zeros to a length that the network takes."""
        x = rows.reshape(len(rows), self.channels_, -1)
        points = max(SHORTEST, MULTIPLE * math.ceil(x.shape[2] / MULTIPLE))
        return np.pad(x, ((0, 0), (0, 0), (0, points - x.shape[2])))


def split(labels: Labels, groups: NDArray[Any], share: float, seed: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places of the rows to train on and of those held out; no group is on both sides.

    Parameters
    ----------
    labels : Labels [rows]
    groups : array [rows]
    share : float
        Part of the groups of each class that is held out.
    seed : int
    """
    nothing = np.zeros(len(labels))
    rows = Windows(np.empty((len(labels), 0)), nothing, nothing, groups, labels)
    _, held = split_by_group(rows, share, np.random.default_rng([seed, 2]))
    outside = np.isin(groups, held.group)
    return np.flatnonzero(~outside), np.flatnonzero(outside)


def _flat(X: Any) -> Any:
    """Rows of one dimension each."""
    return np.asarray(X).reshape(len(X), -1) if getattr(X, "ndim", 2) == 3 else X
