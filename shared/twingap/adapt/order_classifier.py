"""The classifier that ships with twingap: trees over order features and levels, learnt from fleets of random machines.

windows of one fleet --order_features | levels_above_the_quietest | setting--> trees --mean over a recording-->
    probabilities --temperature--> class, confidence

The features are relative to fault orders, turns of the shaft and the fleet's quietest record, so that one classifier
serves any bearing, rate and speed. It is stored as arrays (.npz) and JSON; `twingap.adapt.train_classifier` makes it.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.confidence import Calibration, Reliability
from twingap.adapt.fault_classifier import FaultClassifier
from twingap.adapt.levels import NAMES, levels_above_the_quietest, operating_points
from twingap.adapt.order_features import names, order_features
from twingap.adapt.population import CLASSES
from twingap.adapt.windows import Windows
from twingap.bearing import BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.files import replacing
from twingap.trees import Trees

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


def write_classifier(classifier: FaultClassifier, folder: Path, made: Mapping[str, Any]) -> None:
    """Write `TREES_FILE` and `ABOUT_FILE`: equal classifiers give equal bytes.

    Parameters
    ----------
    classifier : FaultClassifier
        Calibrated, of `FEATURES` and `CLASSES`.
    folder : Path
    made : mapping
        How it was made: seed, numbers of fleets and recordings.
    """
    assert classifier.calibration_ is not None and classifier.reliability_ is not None
    about = {
        "version": VERSION, "classes": list(CLASSES), "features": list(FEATURES),
        "calibration": asdict(classifier.calibration_), "simulated": asdict(classifier.reliability_),
        "made": dict(made),
    }  # fmt: skip
    with replacing(folder / TREES_FILE) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **classifier.trees_.arrays())  # type: ignore[arg-type]
    with replacing(folder / ABOUT_FILE) as temporary:
        temporary.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def read_classifier(folder: Path) -> FaultClassifier:
    """The classifier that `write_classifier` wrote.

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
        calibration, reliability = Calibration(**about["calibration"]), Reliability(**about["simulated"])
        seed = about["made"]["seed"]
    except FileNotFoundError as error:
        raise TwingapError("is missing", where=str(error.filename), mend=mend) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TwingapError(f"is no classifier: {error}", where=folder, mend=mend) from None
    if kept != (VERSION, FEATURES, CLASSES):
        raise TwingapError(
            "was learnt from other features or classes than this version of twingap has", where=where, mend=mend
        )
    trees = Trees.of_arrays(arrays, where=str(folder / TREES_FILE))
    if trees.start.size != len(CLASSES) or trees.columns > len(FEATURES):
        raise TwingapError("has other outputs or columns than stated", where=where, mend=mend)
    found = FaultClassifier(random_state=seed)
    found.trees_, found.n_features_in_ = trees, len(FEATURES)
    found.calibration_, found.reliability_ = calibration, reliability
    return of_names(found)


def of_names(classifier: FaultClassifier) -> FaultClassifier:
    """The classifier with the names of `CLASSES` as labels, in place of their places in it."""
    classifier.outputs_ = np.argsort(CLASSES)
    classifier.classes_ = np.array(CLASSES)[classifier.outputs_]
    return classifier


def shipped_classifier() -> FaultClassifier:
    """The fitted classifier that ships with twingap, for the rows of `OrderFeatures`.

    Returns
    -------
    FaultClassifier
        A copy, which may be changed. Its classes are the names of the states: ball, healthy, inner, outer.
    """
    return copy.deepcopy(_shipped())


@cache
def _shipped() -> FaultClassifier:
    return read_classifier(shipped_folder())


def shipped_folder() -> Path:
    """Where the package keeps it."""
    return Path(__file__).with_name("learnt")
