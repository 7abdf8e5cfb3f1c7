"""The classifier that ships with twingap: trees over order features and levels, learnt from fleets of random machines.

windows of one fleet --order_features | levels_above_the_quietest | setting--> trees --mean over a recording-->
    probabilities --temperature--> class, confidence

The features are relative to fault orders, turns of the shaft and the fleet's quietest record, so that one classifier
serves any bearing, rate and speed. It is stored as arrays (.npz) and JSON; `twingap.adapt.train_classifier` makes it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.confidence import Calibration, Reliability
from twingap.adapt.levels import NAMES, levels_above_the_quietest, operating_points
from twingap.adapt.order_features import names, order_features
from twingap.adapt.population import CLASSES
from twingap.adapt.trees import Trees
from twingap.adapt.windows import Windows
from twingap.bearing import BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.files import replacing

Array = NDArray[np.float64]

SETTING: Final = ("setting: ln turns in the window", "setting: ln samples per turn", "setting: recordings compared")
"""What the noise of the other features depends on: the resolution of orders, and how many recordings the quietest is
the least of (at most `MOST_COMPARED`)."""
MOST_COMPARED: Final = 8
FEATURES: Final = (*names(next(iter(BEARINGS.values()))), *(f"level: {name}" for name in NAMES), *SETTING)
VERSION: Final = 1
"""Of what the features mean. Raise it with every change of a feature that keeps its name."""
TREES_FILE: Final = "classifier.npz"
ABOUT_FILE: Final = "classifier.json"


def features(windows: Windows, bearing: Bearing) -> NDArray[np.float32]:
    """`FEATURES` of the windows of one fleet [windows, features].

    Parameters
    ----------
    windows : Windows
        `group` tells recordings apart; labels are not read.
    bearing : Bearing
    """
    turns = windows.samples.shape[1] * windows.speed_rpm / 60 / windows.fs_hz
    point = operating_points(windows.speed_rpm)
    of_point = np.array([len(set(windows.group[point == p])) for p in range(int(point.max(initial=-1)) + 1)])
    setting = np.column_stack([
        np.log(turns), np.log(windows.samples.shape[1] / turns), np.minimum(of_point[point], MOST_COMPARED),
    ])  # fmt: skip
    found = np.hstack([order_features(windows, bearing), levels_above_the_quietest(windows), setting])
    return found.astype(np.float32)


@dataclass(frozen=True)
class OrderClassifier:
    """A trained classifier.

    Parameters
    ----------
    trees : Trees
        One output a class: log odds.
    calibration : Calibration
        Of probabilities averaged over the windows of a recording.
    simulated : Reliability
        On simulated recordings that neither trees nor temperature were fitted to.
    made : dict
        How: seed, numbers of fleets and recordings.
    """

    trees: Trees
    calibration: Calibration
    simulated: Reliability
    made: Mapping[str, Any]

    def window_probabilities(self, rows: NDArray[np.float32]) -> Array:
        """Uncalibrated probabilities [windows, classes] from `features`."""
        return softmax(self.trees(rows))

    def probabilities(self, windows: Windows, bearing: Bearing, per_recording: int) -> Array:
        """Calibrated probabilities [recordings, classes] of one fleet.

        Parameters
        ----------
        windows : Windows
            Those of a recording follow each other.
        bearing : Bearing
        per_recording : int
            Windows of each recording.
        """
        return self.calibration(votes(self.window_probabilities(features(windows, bearing)), per_recording))

    def save(self, folder: Path) -> None:
        """Write `TREES_FILE` and `ABOUT_FILE`: equal classifiers give equal bytes."""
        about = {
            "version": VERSION, "classes": list(CLASSES), "features": list(FEATURES),
            "calibration": asdict(self.calibration), "simulated": asdict(self.simulated), "made": dict(self.made),
        }  # fmt: skip
        with replacing(folder / TREES_FILE) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(stream, **self.trees.arrays())  # type: ignore[arg-type]
        with replacing(folder / ABOUT_FILE) as temporary:
            temporary.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, folder: Path) -> OrderClassifier:
        """Read what `save` wrote.

        Raises
        ------
        TwingapError
            For files that are missing or damaged, or a classifier of other features or classes.
        """
        where = folder / ABOUT_FILE
        mend = "install twingap again, or make the classifier anew with `twingap train`"
        try:
            about = json.loads(where.read_text(encoding="utf-8"))
            with np.load(folder / TREES_FILE, allow_pickle=False) as stored:
                arrays = dict(stored)
            kept = (about["version"], tuple(about["features"]), tuple(about["classes"]))
            calibration, simulated = Calibration(**about["calibration"]), Reliability(**about["simulated"])
            made = dict(about["made"])
        except FileNotFoundError as error:
            raise TwingapError("is missing", where=str(error.filename), mend=mend) from None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise TwingapError(f"is no classifier: {error}", where=folder, mend=mend) from None
        if kept != (VERSION, FEATURES, CLASSES):
            raise TwingapError(
                "was learnt from other features or classes than this version of twingap has", where=where, mend=mend
            )
        trees = Trees.of_arrays(arrays, where=str(folder / TREES_FILE))
        if trees.start.size != len(CLASSES) or int(trees.column.max(initial=-1)) >= len(FEATURES):
            raise TwingapError("has other outputs or columns than stated", where=where, mend=mend)
        return cls(trees, calibration, simulated, made)


@cache
def shipped() -> OrderClassifier:
    """The classifier in the package, read once."""
    return OrderClassifier.load(shipped_folder())


def shipped_folder() -> Path:
    """Where the package keeps it."""
    return Path(__file__).with_name("learnt")


def votes(probabilities: Array, windows: int) -> Array:
    """Mean probabilities of each recording [recordings, classes], whose windows follow each other."""
    return np.asarray(probabilities.reshape(-1, windows, probabilities.shape[1]).mean(axis=1))


def softmax(log_odds: Array) -> Array:
    """Probabilities from log odds [rows, classes]."""
    raised = np.exp(log_odds - log_odds.max(axis=1, keepdims=True))
    return np.asarray(raised / raised.sum(axis=1, keepdims=True))
