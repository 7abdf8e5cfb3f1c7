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
from twingap.adapt.order_features import names, order_features_at
from twingap.adapt.population import CLASSES
from twingap.adapt.windows import Windows
from twingap.bearing import BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.files import replacing
from twingap.identification.speed_without_labels import FAULTS, SpeedProbabilities
from twingap.trees import Trees

Array = NDArray[np.float64]

SETTING: Final = ("setting: ln turns in the window", "setting: ln samples per turn", "setting: recordings compared")
"""What the noise of the other features depends on: the resolution of orders, and how many recordings the quietest is
the least of (at most `MOST_COMPARED`)."""
MOST_COMPARED: Final = 8
SPEEDS: Final = 5
"""Most candidates of a record's speed; more cover more of what is possible where records hardly show it."""
LINE_WEIGHT: Final = 0.2
"""Log odds of two faults per unit of difference of their lines' scores; larger trusts lines more than trees."""
SPEED_WIDTH: Final = 0.01
"""Half the relative range of speeds that a candidate stands for: what the search for lines tolerates."""
FEATURES: Final = (*names(next(iter(BEARINGS.values()))), *(f"level: {name}" for name in NAMES), *SETTING)
VERSION: Final = 2
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
    return np.asarray(features_at(windows, windows.speed_rpm[None], bearing)[0])


def features_at(windows: Windows, speeds_rpm: Array, bearing: Bearing) -> NDArray[np.float32]:
    """`FEATURES` of the windows of one fleet at several candidates of their speeds.

    Parameters
    ----------
    windows : Windows
        `group` tells recordings apart, stated speeds tell operating points apart; labels are not read.
    speeds_rpm : Array [candidates, windows]
    bearing : Bearing

    Returns
    -------
    float32 array [candidates, windows, features]
    """
    n, point = windows.samples.shape[1], operating_points(windows.speed_rpm)
    of_point = np.array([len(set(windows.group[point == p])) for p in range(int(point.max(initial=-1)) + 1)])
    compared, levels = np.minimum(of_point[point], MOST_COMPARED), levels_above_the_quietest(windows)
    lines = order_features_at(windows, speeds_rpm, bearing)
    out = []
    for speed_rpm, at_speed in zip(speeds_rpm, lines, strict=True):
        turns = n * speed_rpm / 60 / windows.fs_hz
        out.append(np.column_stack([at_speed, levels, np.log(turns), np.log(n / turns), compared]))
    return np.array(out, dtype=np.float32)


def rows_at_speeds(windows: Windows, speeds: SpeedProbabilities, bearing: Bearing) -> tuple[NDArray[np.float32], Array]:
    """Rows of each record at the likeliest of its speeds, and their weights.

    Parameters
    ----------
    windows : Windows
        As many of each record, in the records' order.
    speeds : SpeedProbabilities
        Of the records.
    bearing : Bearing

    Returns
    -------
    rows : float32 array [records, candidates * windows, features]
    weights : Array [records, candidates * windows]
        Probabilities of the speeds.
    """
    ratios, weights = speeds.candidates(SPEEDS, SPEED_WIDTH)
    count, records = ratios.shape
    each = len(windows) // records
    found = features_at(windows, windows.speed_rpm * np.repeat(ratios, each, axis=1), bearing)
    rows = found.reshape(count, records, each, -1).swapaxes(0, 1).reshape(records, count * each, -1)
    return rows, np.repeat(weights.T, each, axis=1)


def weighed_by_lines(probabilities: Array, speeds: SpeedProbabilities) -> Array:
    """Probabilities of `CLASSES`, those of faults weighed against each other by the lines of whole records.

    A window has few turns, in which lines of different faults hardly differ; a record has many. The probability of a
    healthy record stays.

    Parameters
    ----------
    probabilities : Array [records, classes]
    speeds : SpeedProbabilities
        Of the records, with their lines.
    """
    assert speeds.lines is not None
    places = [CLASSES.index(fault) for fault in FAULTS]
    faulty = probabilities[:, places]
    weighed = faulty * np.exp(LINE_WEIGHT * (speeds.lines - speeds.lines.max(axis=1, keepdims=True)))
    out = probabilities.copy()
    out[:, places] = weighed * faulty.sum(axis=1, keepdims=True) / weighed.sum(axis=1, keepdims=True)
    return out


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
