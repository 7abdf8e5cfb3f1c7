"""Exchange test: does the user's simulator differ from the machine by more than recordings differ from each other?

pairs of a record and a simulated one --feature differences, and their slopes over speed and time--> t of each feature
t of each feature --random signs of whole groups--> mean of squared t under each draw --> p-value

Without a gap, a record and its simulated counterpart are exchangeable, however recordings vary; there is no further
assumption (randomisation test with sign flips of groups: Hemerik and Goeman 2018, doi:10.1007/s11749-017-0571-1). The
learnt null distribution assumes that recordings differ only at random, which mounting, wear and defect size violate on
real machines. The exchange test has less power, and is therefore applied only to gaps that no single effect explains
with certainty.

The statistic is the mean over all features, not the maximum: simulated records that were resampled to another speed
differ slightly in a few features even without a gap.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features import comparison
from twingap.gap.features.measured import Measured
from twingap.gap.features.registry import NAMES
from twingap.gap.search.evidence import Evidence
from twingap.records import Array, Record

EXCHANGES: Final = 999
"""Random draws of signs. A larger number resolves smaller p-values."""
_LARGEST_T: Final = 6.0
"""Largest absolute t; larger ones are clipped. A larger bound lets a single feature decide."""
_LEAST_VARIANCE: Final = 1e-12
"""Smallest variance over the mean square. It keeps t finite where a difference is the same in all groups."""
_LEVEL: Final = "background.rms_log"
"""Feature that is matched before the test: log10 of a level."""
_ROUNDING: Final = 1e-6
"""Difference of a feature below which it counts as a rounding error of the gain. A larger value ignores more."""


def exchange_p_value(evidence: Evidence) -> float | None:
    """P-value of no difference beyond that between recordings, for the user's own simulator.

    None where there are too few groups of records, see `Evidence.exchangeable`.
    """
    real = evidence.parts
    conditions = [c for part in real for c in part.conditions]
    if not evidence.exchangeable:
        return None
    # The level was matched on the fit part alone: remove the remaining difference over both parts.
    louder = np.nan_to_num(_mean(_differences(real, _measured_simulations(evidence)))[NAMES.index(_LEVEL)])
    differences = _differences(real, _measured_simulations(evidence, float(10**louder)))
    timed = all(c.time_s is not None for c in conditions)
    covariates = np.array([(math.log(c.speed_rpm), c.time_s if timed else 0.0) for c in conditions], dtype=float)
    return sign_flip_p_value(
        differences, covariates, evidence.groups, np.random.default_rng([evidence.root, len(real)])
    )


def sign_flip_p_value(
    differences: Array, covariates: Array, groups: NDArray[np.str_], rng: np.random.Generator, draws: int = EXCHANGES
) -> float:
    """P-value of differences [pairs, features] whose sign is random, with one sign for all pairs of a group [pairs].

    Differences are NaN where a feature does not apply; slopes are those over `covariates` [pairs, covariates], such as
    log speed and time. The p-value is the part of all draws, the observed one included, whose rarest statistic (mean
    difference or a slope) is at least as rare as observed; 1 where no feature applies to half of the groups.
    """
    names = list(dict.fromkeys(groups))
    signs = rng.choice([-1.0, 1.0], size=(1 + draws, len(names)))
    signs[0] = 1.0
    weights = (np.ones(len(groups)), *(covariates - covariates.mean(axis=0)).T)
    statistics = []
    for weight in weights:
        weighed = differences * weight[:, None]
        statistics.append(_squared_t(np.array([_mean(weighed[groups == name]) for name in names]), signs))
    each = np.array(statistics).T
    rarity = np.array([(each >= own * (1 - 1e-9)).mean(axis=0) for own in each]).min(axis=1)
    return float((rarity <= rarity[0]).mean())


def _squared_t(means: Array, signs: Array) -> Array:
    """[draws] Mean over features of the squared t of group means [groups, features]."""
    count = np.isfinite(means).sum(axis=0)
    known = count >= max(3, len(means) / 2)
    if not known.any():
        return np.zeros(len(signs))
    count, means = count[known], np.nan_to_num(means[:, known])
    mean, square = signs @ means / count, (means**2).sum(axis=0) / count
    variance = np.maximum(square - mean**2, _LEAST_VARIANCE * square) / (count - 1)
    t = np.abs(np.divide(mean, np.sqrt(variance), out=np.zeros_like(mean), where=square > 0))
    return np.asarray((np.minimum(t, _LARGEST_T) ** 2).mean(axis=1))


def _mean(rows: Array) -> Array:
    """[features] Mean of the finite values [rows, features]; NaN where there are none."""
    known = np.isfinite(rows)
    count = known.sum(axis=0)
    total = np.where(known, rows, 0.0).sum(axis=0)
    return np.asarray(np.divide(total, count, out=np.full(rows.shape[1], np.nan), where=count > 0))


def _measured_simulations(evidence: Evidence, louder: float = 1.0) -> tuple[Measured, ...]:
    """Features of the simulated records of each part."""
    simulator = evidence.against().simulator
    return tuple(
        comparison.measure_records(
            (
                Record(record.condition, record.samples * louder)
                for record in evidence.simulated(simulator, (), part.conditions, number)
            ),
            evidence.frame,
            evidence.grid(part.conditions),
        )
        for number, part in enumerate(evidence.parts)
    )


def _differences(real: tuple[Measured, ...], made: tuple[Measured, ...]) -> Array:
    """[pairs, features] Features of real records less those of simulated ones."""
    found = np.concatenate([ours.values - theirs.values for ours, theirs in zip(real, made, strict=True)])
    return np.where(np.abs(found) < _ROUNDING, 0.0, found)
