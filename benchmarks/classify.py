"""Recordings of ten virtual machines with wrong speeds that `twingap classify` names rightly, and how sure it is."""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import Measurement, Target
from twingap.adapt.classify import classify
from twingap.adapt.confidence import Reliability, reliability
from twingap.adapt.population import CLASSES
from twingap.bearing import Bearing
from twingap.records import Record
from twingap.rigs import WrongSpeeds
from twingap.signal.envelope import squared_envelope_spectrum
from twingap.twins.twin_file import TwinSpec

RIGS: Final = 10
LEAST_RIGHT, LARGEST_ERROR = 0.9, 0.05
BANDS: Final = 7
STANDS_OUT: Final = 5.0
"""Amplitude of a line over the median around it from which it counts as there; noise alone does not reach it."""
GROUPS: Final = ("lines", "healthy", "no lines")


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Fractions of recordings classified correctly, by group, and expected calibration error over all rigs."""
    rows, all_probabilities, all_truth, all_groups, same = [], [], [], [], True
    for number in range(seed, seed + (1 if quick else RIGS)):
        records = WrongSpeeds(3 if quick else 12).records(number)
        assert records.bearing is not None
        begin = time.process_time()
        found = classify(records, TwinSpec("phenomenological"))
        spent = time.process_time() - begin
        if number == seed:
            other = classify(records, TwinSpec("contact"))
            same = bool(np.array_equal(found.probabilities, other.probabilities))
        truth = np.array([CLASSES.index(str(c.fault)) for c in records.conditions])
        groups = np.array([group_of(record, records.bearing) for record in records])
        right = found.probabilities.argmax(axis=1) == truth
        rows.append(
            {"rig": number, "bearing": records.bearing.name, "recordings": len(records)}
            | {name: _fraction(right[groups == name]) for name in GROUPS}
            | {"confidence": f"{found.confidence.mean():.2f}", "right": f"{right.mean():.2f}", "s": f"{spent:.1f}"}
        )
        all_probabilities.append(found.probabilities)
        all_truth.append(truth)
        all_groups.append(groups)
    probabilities, truth, groups = (np.concatenate(part) for part in (all_probabilities, all_truth, all_groups))
    right = probabilities.argmax(axis=1) == truth
    visible = groups != "no lines"
    over_all, where_visible = reliability(probabilities, truth), reliability(probabilities[visible], truth[visible])
    targets = (
        Target("right of the recordings with lines", float(right[groups == "lines"].mean()), LEAST_RIGHT),
        Target("right of those and of the healthy", float(right[visible].mean()), LEAST_RIGHT),
        Target(
            f"{LARGEST_ERROR:g} over the expected calibration error, all",
            LARGEST_ERROR / max(over_all.error, 1e-9), 1.0,
        ),
        Target("same with a contact twin in the file", float(same), 1.0),
    )  # fmt: skip
    return Measurement(
        f"{len(rows)} virtual machines, stated speeds 3 to 6 % wrong, {len(truth)} recordings",
        rows,
        () if quick else targets,
        (
            "lines: the fault has envelope lines at its true rate; no lines: it has none, as a rough ball",
            f"all: {_stated(over_all)}",
            f"all but those without lines: {_stated(where_visible)}",
        ),
    )


def group_of(record: Record, bearing: Bearing) -> str:
    """Which of `GROUPS` a recording is of: read at its true speed and fault, which `classify` does not know.

    Parameters
    ----------
    record : Record
        With `true_rpm` in its condition.
    bearing : Bearing
    """
    c = record.condition
    if c.fault == "healthy":
        return "healthy"
    rate_hz = bearing.fault_order(str(c.fault)) * float(c.extra["true_rpm"]) / 60
    edges = np.linspace(0.02, 0.49, BANDS + 1) * c.fs_hz
    for low, high in pairwise(edges):
        if high - low < 2.5 * rate_hz:
            continue
        spectrum = squared_envelope_spectrum(record.samples, c.fs_hz, (float(low), float(high)), window="hann")
        for at in (rate_hz, 2 * rate_hz):
            off = np.abs(spectrum.frequency / at - 1)
            if spectrum.values[off < 0.015].max() > STANDS_OUT * np.median(spectrum.values[off < 0.15]):
                return "lines"
    return "no lines"


def _stated(found: Reliability) -> str:
    return (
        f"{found.accuracy:.1%} right at a mean confidence of {found.confidence:.1%}, expected calibration error "
        f"{found.error:.1%}"
    )


def _fraction(right: NDArray[np.bool_]) -> str:
    return f"{right.sum()} of {right.size}"
