"""Statistics of record features over groups of records: differences of two sets, and their significance.

values [records, features] of both sets --by fault, or healthy and faulty--> difference, z, level
                                        --within each fault--> spread; slopes over speed and over time, with z
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.measured import Pair
from twingap.gap.features.pooled.trends import about_means, covariates, normal_deviate, slope
from twingap.gap.features.registry import NAMES, OF_IMPACTS
from twingap.records import Array
from twingap.signal.record_transforms import known_medians

Mask = NDArray[np.bool_]

GROUPS: Final = {True: ("all", "outer", "inner", "ball"), False: ("all", "healthy", "faulty")}
"""Groups of records for means, of features of impacts (True) and of all others."""
_FEWEST_FREE: Final = 2
"""Smallest number of degrees of freedom for z of paired differences; with fewer, z is from the spread on each side."""


@cache
def feature_names() -> tuple[str, ...]:
    """Names of what `compare` returns, in its order."""
    names: list[str] = []
    for of_impacts, groups in GROUPS.items():
        own = [name for name, of in zip(NAMES, OF_IMPACTS, strict=True) if of == of_impacts]
        names += [f"{n}|{group}.{kind}" for group in groups for kind in ("diff", "z", "level") for n in own]
    kinds = ("spread", "on_speed", "on_speed.z", "on_time", "on_time.z")
    return (*names, *(f"{name}|{kind}" for kind in kinds for name in NAMES))


def compare(pair: Pair) -> Array:
    """[statistics] Statistics of all record features; see `feature_names`."""
    return np.concatenate([*_by_group(pair), _spread(pair), *_trends(pair)])


def extent(statistics: Array) -> Array:
    """[6] Extent of the differences in the statistics of `compare`: ln(1 + .) of the 1st, 4th, 13th, 41st and 121st
    largest |z|, and of the mean square."""
    z = np.sort(np.abs(statistics[_z_places()]))
    z = z[np.isfinite(z)][::-1]
    if z.size == 0:
        return np.full(6, np.nan)
    return np.array([*(np.log1p(z[min(k, z.size - 1)]) for k in (0, 3, 12, 40, 120)), np.log1p(np.mean(z**2))])


@cache
def _z_places() -> NDArray[np.int64]:
    return np.array([i for i, name in enumerate(feature_names()) if name.endswith(".z") and "|on_" not in name])


def _by_group(pair: Pair) -> list[Array]:
    """Difference of means, the same as a normal deviate, and the measured median: [features] each, group by group."""
    real, simulated = pair.real, pair.simulated
    columns = []
    ours, theirs = real.faults(), simulated.faults()
    paired = _are_paired(ours, theirs)
    for of_impacts, groups in GROUPS.items():
        own = np.equal(OF_IMPACTS, of_impacts)
        for group in groups:
            r = real.values[_in_group(ours, group)][:, own]
            b = simulated.values[_in_group(theirs, group)][:, own]
            if len(r) == 0 or len(b) == 0:
                columns += [np.full(int(own.sum()), np.nan)] * 3
                continue
            mean_r, mean_b = np.nanmean(r, axis=0), np.nanmean(b, axis=0)
            n_r, n_b = np.isfinite(r).sum(axis=0), np.isfinite(b).sum(axis=0)
            # The spread of two records is uncertain: a hundredth of the level keeps z finite.
            small = 1e-3 + 0.01 * np.abs(mean_b)
            within = np.nansum((r - mean_r) ** 2, axis=0) + np.nansum((b - mean_b) ** 2, axis=0)
            variance = within / np.maximum(n_r + n_b - 2, 1) + small**2
            diff = mean_r - mean_b
            t = diff / np.sqrt(variance * (1 / np.maximum(n_r, 1) + 1 / np.maximum(n_b, 1)))
            z = normal_deviate(t, n_r + n_b - 2)
            if paired:
                z = paired_z(r - b, ours[_in_group(ours, group)], small, z)
            columns += [diff, z, known_medians(r)]  # a median, robust against a wrong line
    return columns


def paired_z(differences: Array, kinds: NDArray[np.str_], small: Array, otherwise: Array) -> Array:
    """[features] Normal deviates of the mean of `differences` [pairs, features] between records and simulated ones.

    The influence of speed and fault is in both records of a pair and does not increase the error. Each kind [pairs] of
    record, its fault, has its own mean. `small` [features] is a standard deviation that is added in squares, so that z
    stays finite without spread, `otherwise` [features] the values for features with too few known pairs.
    """
    known = np.isfinite(differences)
    count = known.sum(axis=0)
    free = count - sum(known[kinds == kind].any(axis=0).astype(int) for kind in np.unique(kinds))
    squares = np.nansum(about_means(differences, kinds) ** 2, axis=0)
    error = np.sqrt((squares / np.maximum(free, 1) + small**2) / np.maximum(count, 1))
    found = normal_deviate(np.nanmean(differences, axis=0) / error, free)
    return np.where(free >= _FEWEST_FREE, found, otherwise)


def _are_paired(ours: NDArray[np.str_], theirs: NDArray[np.str_]) -> bool:
    return len(theirs) == len(ours) and bool((ours == theirs).all())


def _in_group(faults: NDArray[np.str_], group: str) -> Mask:
    if group == "all":
        return np.ones(faults.size, bool)
    return np.asarray((faults != "healthy") if group == "faulty" else (faults == group))


def _spread(pair: Pair) -> Array:
    """[features] Log ratio of the spread between records of one fault."""
    rests = [about_means(side.values, side.faults()) for side in (pair.real, pair.simulated)]
    real, simulated = (np.log(np.nanstd(rest, axis=0) + 1e-3) for rest in rests)
    return np.asarray(real - simulated)


def _trends(pair: Pair) -> list[Array]:
    """Slope of measured less simulated over log speed and over time (run = 1), and its z: [features] each."""
    residual = pair.real.values.copy()
    ours, theirs = pair.real.faults(), pair.simulated.faults()
    if _are_paired(ours, theirs):
        residual -= pair.simulated.values
    return [column for x in covariates(pair.real.conditions) for column in slope(x, residual, ours)]
