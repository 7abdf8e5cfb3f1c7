"""Support vector machine on features of variational modes (VMD+SVM), without adaptation.

modes [windows, K, N] --> level, centre frequency, shape of each mode --> standardised --> SVC (radial kernel)

The paper gives no details of the method. Features do not depend on the unit of the signal, and settings are the
defaults of scikit-learn. The method is deterministic, so its spread over seeds is 0, as in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.signal.features import time_features

if TYPE_CHECKING:
    from twingap.adapt.training import Inputs, Labels

Array = NDArray[np.float64]

SHAPES: Final = ("kurtosis", "skewness", "crest_factor", "shape_factor", "impulse_factor", "clearance_factor")
"""Features of each mode from `twingap.signal.time_features`."""


def mode_features(modes: Inputs) -> Array:
    """Log energy fraction, centre frequency (cycles/sample) and `SHAPES` of each mode [windows, K (2 + shapes)]."""
    x = modes.astype(np.float64)
    power = np.square(np.abs(np.fft.rfft(x, axis=-1)))
    total = np.maximum(power.sum(axis=-1), 1e-300)
    centre = (power * np.fft.rfftfreq(x.shape[-1])).sum(axis=-1) / total
    energy = np.square(x).sum(axis=-1)
    share = np.log(np.maximum(energy / np.maximum(energy.sum(axis=1, keepdims=True), 1e-300), 1e-9))
    shapes = time_features(x).select(SHAPES).values
    each = np.concatenate([share[..., None], centre[..., None], np.nan_to_num(shapes)], axis=-1)
    return np.asarray(each.reshape(len(x), -1))


@dataclass(frozen=True)
class ModeSVM:
    """Trained support vector machine.

    Parameters
    ----------
    machine : sklearn Pipeline
        Standardisation and SVC.
    n_classes : int
    """

    machine: Any
    n_classes: int

    def probabilities(self, modes: Inputs) -> Array:
        """Softmax of the one-against-rest decision values [windows, classes]; they are not calibrated."""
        found = np.asarray(self.machine.decision_function(mode_features(modes)), dtype=np.float64)
        if found.ndim == 1:
            found = np.stack([-found, found], axis=1)
        values = np.full((len(found), self.n_classes), -np.inf)
        values[:, self.machine.classes_] = found
        raised = np.exp(values - values.max(axis=1, keepdims=True))
        return np.asarray(raised / raised.sum(axis=1, keepdims=True))

    def features(self, modes: Inputs) -> Array:
        """Standardised features [windows, features]."""
        return np.asarray(self.machine[0].transform(mode_features(modes)))


def train_svm(modes: Inputs, labels: Labels, n_classes: int) -> ModeSVM:
    """Train a support vector machine on labelled windows.

    Parameters
    ----------
    modes : Inputs [windows, K, N]
    labels : Labels [windows]
    n_classes : int
    """
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    machine = make_pipeline(StandardScaler(), SVC(decision_function_shape="ovr"))
    machine.fit(mode_features(modes), labels)
    return ModeSVM(machine, n_classes)
