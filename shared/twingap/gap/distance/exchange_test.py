"""Whether a simulator of the user's own differs from the machine by more than one recording does from the next.

pairs: a record, and what is simulated for it --differences of their signatures, their slopes over speed and time-->
t of each signature --signs of whole groups turned at random--> mean of squared t among those --> p-value

Machines that the null was learnt from have recordings that are alike but for chance. Real ones were mounted anew, wear
on, have defects of several sizes: one half of them against the other looks like a gap to whoever has not seen that.
Without a gap a record and the one simulated for it might change sides, whatever recordings are like; nothing else is
assumed (randomisation test, groups of random sign flips: Hemerik and Goeman 2018, doi:10.1007/s11749-017-0571-1). It
sees less than the learnt null does: what half of the records have as well is no news. So it is asked of gaps that no
single effect explains for sure.

All signatures together are asked, not the largest: finished records that were brought to another speed differ a little
in a few of them whenever there is no gap.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap import features as signatures
from twingap.gap.distance.feature_vectors import Grid
from twingap.gap.features import comparison
from twingap.gap.features.comparison import Measured
from twingap.records import Record

if TYPE_CHECKING:
    from twingap.gap.search.evidence import Evidence

Array = NDArray[np.float64]

EXCHANGES: Final = 999
"""Of three means (differences, slopes over speed, slopes over time) the rarest counts."""
_PLAIN: Final = 6.0
"""A t beyond counts as this one: no signature decides by itself."""
_CERTAIN: Final = 1e-12
"""Least variance over the mean square: a difference that is the same in all groups is no division by nought."""
_LEVEL: Final = "background.rms_log"


def exchange_p(evidence: Evidence) -> float | None:
    """P-value of no difference beyond that between recordings.

    Parameters
    ----------
    evidence : Evidence
        Of a simulator of the user's own: it has a record for each of the machine's.

    Returns
    -------
    float or None
        None where the records are of too few groups, see `Evidence.exchangeable`.
    """
    real = evidence.parts
    conditions = [c for part in real for c in part.conditions]
    if not evidence.exchangeable:
        return None
    # What is left of the level after matching it on the fit part is no difference of recordings.
    louder = np.nan_to_num(_mean(_differences(real, _made(evidence)))[signatures.NAMES.index(_LEVEL)])
    differences = _differences(real, _made(evidence, float(np.exp(louder))))
    timed = all(c.time_s is not None for c in conditions)
    courses = np.array([(math.log(c.speed_rpm), c.time_s if timed else 0.0) for c in conditions], dtype=float)
    return turned_p(differences, courses, evidence.groups, np.random.default_rng([evidence.root, len(real)]))


def turned_p(
    differences: Array, courses: Array, groups: NDArray[np.str_], rng: np.random.Generator, draws: int = EXCHANGES
) -> float:
    """P-value of differences that are as often negative as positive, all of a group together.

    Parameters
    ----------
    differences : Array [pairs, signatures]
        NaN where a signature does not apply.
    courses : Array [pairs, courses]
        What differences may change with, such as speed and time.
    groups : NDArray[str] [pairs]
    rng : numpy.random.Generator
    draws : int
        Of signs.

    Returns
    -------
    float
        Part of all draws, the first among them, that are as rare; 1 where no signature applies to half of the groups.
    """
    names = list(dict.fromkeys(groups))
    signs = rng.choice([-1.0, 1.0], size=(1 + draws, len(names)))
    signs[0] = 1.0
    weights = (np.ones(len(groups)), *(courses - courses.mean(axis=0)).T)
    told = []
    for weight in weights:
        weighed = differences * weight[:, None]
        told.append(_squared_t(np.array([_mean(weighed[groups == name]) for name in names]), signs))
    each = np.array(told).T
    rarity = np.array([(each >= own * (1 - 1e-9)).mean(axis=0) for own in each]).min(axis=1)
    return float((rarity <= rarity[0]).mean())


def _squared_t(means: Array, signs: Array) -> Array:
    """[draws] Mean over signatures of the squared t of what all groups [groups, signatures] have in common."""
    count = np.isfinite(means).sum(axis=0)
    asked = count >= max(3, len(means) / 2)
    if not asked.any():
        return np.zeros(len(signs))
    count, means = count[asked], np.nan_to_num(means[:, asked])
    mean, square = signs @ means / count, (means**2).sum(axis=0) / count
    variance = np.maximum(square - mean**2, _CERTAIN * square) / (count - 1)
    t = np.abs(np.divide(mean, np.sqrt(variance), out=np.zeros_like(mean), where=square > 0))
    return np.asarray((np.minimum(t, _PLAIN) ** 2).mean(axis=1))


def _mean(rows: Array) -> Array:
    """Mean of what is finite; NaN where nothing is."""
    known = np.isfinite(rows)
    count = known.sum(axis=0)
    total = np.where(known, rows, 0.0).sum(axis=0)
    return np.asarray(np.divide(total, count, out=np.full(rows.shape[1], np.nan), where=count > 0))


def _made(evidence: Evidence, louder: float = 1.0) -> tuple[Measured, ...]:
    """What is simulated for the records of each part, measured."""
    simulator, bearing = evidence.against().simulator, evidence.frame.bearing
    return tuple(
        comparison.measure(
            (
                Record(record.condition, record.samples * louder)
                for record in evidence.simulated(simulator, (), part.conditions, number)
            ),
            evidence.frame,
            Grid.of(part.conditions, bearing),
        )
        for number, part in enumerate(evidence.parts)
    )


def _differences(real: tuple[Measured, ...], made: tuple[Measured, ...]) -> Array:
    """[pairs, signatures] Measured less simulated."""
    return np.concatenate([ours.values - theirs.values for ours, theirs in zip(real, made, strict=True)])
