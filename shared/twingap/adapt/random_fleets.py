"""Simulated fleets of random machines: any bearing, sampling rate, speed and number of recordings.

random bearing, rate, speed, fleet size --> Fleets of a bare phenomenological twin --> windows --> features
                                                  |                                        ^
                                                  +--wrong speeds stated--> likely speeds -+
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.fleets import DISTURBANCES, Draw, Fleets
from twingap.adapt.order_classifier import MOST_COMPARED, SPEEDS, features, rows_at_speeds
from twingap.adapt.population import CLASSES, TRIES, Population
from twingap.adapt.window_length import length_for
from twingap.adapt.windows import cut
from twingap.bearing import PUBLIC_BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.identification.speed_without_labels import speeds_without_labels
from twingap.records import Condition, RecordSet
from twingap.twins.twin_file import TwinSpec

RATES_HZ: Final = (8000.0, 100_000.0)
SPEEDS_RPM: Final = (300.0, 3600.0)
"""Ranges of the sampling rate and of the shaft speed, drawn log-uniformly. The classifier is not
trained for machines outside them."""
CATALOGUE_SHARE: Final = 0.3
"""Fraction of machines with a bearing of `PUBLIC_BEARINGS`; the others have a random geometry."""
ROLLERS: Final = (6, 20)
FILL: Final = (0.55, 0.95)
LARGEST_RATIO: Final = 0.35
"""Random geometry: number of rollers, fraction of the pitch circle that they fill, and largest ratio of roller to
pitch diameter."""
ANGLED_SHARE: Final = 0.4
LARGEST_ANGLE_DEG: Final = 40.0
"""Fraction of random bearings with a contact angle, and the largest angle."""
SLOWER_SHARE: Final = 0.3
SLOWEST: Final = 3.0
"""Fraction of fleets that are classified together with slower ones, and largest ratio of speeds. The slowest shaft
determines the length of windows, so that faster ones have more turns in each."""
SHORT_SHARE: Final = 0.15
"""Fraction of fleets whose records are so short that a window has three turns only."""
SINGLE_SHARE: Final = 0.15
"""Fraction of fleets of a single recording; the others have 2 to `MOST_COMPARED`."""
WRONG_SHARE: Final = 0.5
LARGEST_ERROR: Final = 0.06
OWN_ERROR: Final = 0.004
"""Fraction of fleets with wrong speeds, the largest relative error, and the standard deviation about a common error.
In half of them the error is common to all recordings, in the others each has its own."""
IMPULSIVE: Final[tuple[str, float, Draw]] = (
    "impulsive_noise", 0.4,
    lambda rng, fs_hz: {
        "level": _log(rng, 1.0, 12.0), "rate_hz": fs_hz * _log(rng, 5e-4, 0.05),
        "resonance_hz": fs_hz * _log(rng, 0.05, 0.45), "damping_ratio": _log(rng, 0.02, 0.2),
        "spread": rng.uniform(0.3, 1.0),
    },
)  # fmt: skip
"""Impulses without a fault, and the fraction of fleets with them: a healthy machine may be impulsive."""


@dataclass(frozen=True)
class Fleet:
    """Windows of one simulated fleet.

    Parameters
    ----------
    features : float32 array [recordings, windows, features]
    labels : NDArray[int64] [recordings]
        Index in `CLASSES`.
    weights : Array [recordings, windows]
        Of the windows.
    """

    features: NDArray[np.float32]
    labels: NDArray[np.int64]
    weights: NDArray[np.float64]


def random_bearing(rng: np.random.Generator) -> Bearing:
    """A bearing of the catalogue or of random geometry.

    Parameters
    ----------
    rng : numpy.random.Generator
    """
    if rng.random() < CATALOGUE_SHARE:
        return list(PUBLIC_BEARINGS.values())[int(rng.integers(len(PUBLIC_BEARINGS)))]
    rollers = int(rng.integers(ROLLERS[0], ROLLERS[1] + 1))
    ratio = min(LARGEST_RATIO, rng.uniform(*FILL) * math.sin(math.pi / rollers))
    angle = rng.uniform(0.0, LARGEST_ANGLE_DEG) if rng.random() < ANGLED_SHARE else 0.0
    return Bearing("random", rollers, 40.0 * ratio, 40.0, angle)


def random_fleet(
    rng: np.random.Generator, windows: int, *, lengths: tuple[float, float], wrong_speeds: bool = False
) -> Fleet:
    """Features of one fleet of a random machine.

    Parameters
    ----------
    rng : numpy.random.Generator
    windows : int
        Windows per recording, evenly spaced.
    lengths : (float, float)
        Range of the recordings' length, in windows.
    wrong_speeds : bool
        Whether stated speeds may be wrong. Windows are then repeated for `SPEEDS` speeds, weighted by their
        probabilities, as `classify` does.
    """
    for _ in range(TRIES):
        bearing = random_bearing(rng)
        fs_hz, speed_rpm = (float(np.exp(rng.uniform(*np.log(range_)))) for range_ in (RATES_HZ, SPEEDS_RPM))
        beside = float(SLOWEST ** rng.random()) if rng.random() < SLOWER_SHARE else 1.0
        short = rng.random() < SHORT_SHARE
        members = 1 if rng.random() < SINGLE_SHARE else int(rng.integers(2, MOST_COMPARED + 1))
        try:
            length = _length(bearing, fs_hz, speed_rpm, max(SPEEDS_RPM[0], speed_rpm / beside), short)
        except TwingapError:  # a combination of rate and speed that `classify` refuses
            continue
        n_samples = round(length * rng.uniform(*lengths))
        condition = Condition("random", speed_rpm, fs_hz, n_samples)
        population = Population(TwinSpec("phenomenological"), bearing, "", (condition,), frozenset(), n_samples)
        made = Fleets(population, members, disturbances=(*DISTURBANCES, IMPULSIVE)).fleet(0, rng)
        labels = np.array([CLASSES.index(str(c.fault)) for c in made.conditions], dtype=np.int64)
        if not wrong_speeds:
            read = features(cut(made, length, windows), bearing).reshape(members, windows, -1)
            return Fleet(read, labels, np.ones((members, windows)))
        made = _stated_wrongly(made, rng)
        rows, weights = rows_at_speeds(cut(made, length, windows), speeds_without_labels(made, bearing), bearing)
        missing = ((0, 0), (0, SPEEDS * windows - rows.shape[1]))
        return Fleet(np.pad(rows, (*missing, (0, 0))), labels, np.pad(weights, missing))
    raise TwingapError("no random machine could be classified", where="random_fleet")


def _stated_wrongly(records: RecordSet, rng: np.random.Generator) -> RecordSet:
    """Records whose stated speeds are wrong, for `WRONG_SHARE` of the fleets."""
    off = np.zeros(len(records))
    if rng.random() < WRONG_SHARE:
        common = rng.random() < 0.5
        off = rng.uniform(-LARGEST_ERROR, LARGEST_ERROR, 1 if common else len(records)) + np.zeros(len(records))
        off = np.clip(off + OWN_ERROR * rng.standard_normal(len(records)), -LARGEST_ERROR, LARGEST_ERROR)
    stated = [
        replace(r, condition=replace(r.condition, speed_rpm=r.condition.speed_rpm / (1 + e)))
        for r, e in zip(records, off, strict=True)
    ]
    return RecordSet.from_records(records.name, records.unit, records.bearing, stated)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _length(bearing: Bearing, fs_hz: float, speed_rpm: float, slowest_rpm: float, short: bool) -> int:
    """Samples of a window, by the rule for real records."""
    plenty = 1 << 20
    conditions = [Condition("own", speed_rpm, fs_hz, plenty), Condition("slowest", slowest_rpm, fs_hz, plenty)]
    length = length_for(conditions, bearing, where="random fleet")
    if short:
        try:
            return length_for([Condition("short", slowest_rpm, fs_hz, length // 2)], bearing, where="random fleet")
        except TwingapError:  # half a window has fewer than three turns
            pass
    return length
