"""Comparison of measured records with simulated ones: one vector of named features, the same for every machine.

measured records  --measure_records--> Measured --+
                                                  +--compare--> vector of features, named by `feature_names`
simulated records --measure_records--> Measured --+

The vector holds, in this order: statistics of record features over groups of records (`group_statistics`), features of
the two sets (`registry.SET_FEATURES`), features of all records pooled over both parts (`pooled.features`), and context
(`context`). Where a set has no record of a kind, a feature is NaN.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np

from twingap.gap.distance.feature_vectors import measure_vectors
from twingap.gap.distance.grid import Grid
from twingap.gap.features import context, group_statistics, registry
from twingap.gap.features.measured import Measured, Pair
from twingap.gap.features.pooled import features as pooled
from twingap.gap.features.spectrum.record_summary import RecordSummary, summarise
from twingap.identification.speed import Speeds
from twingap.records import Array, Record
from twingap.signal.record_transforms import Frame, RecordTransforms


def measure_records(records: Iterable[Record], frame: Frame, grid: Grid) -> Measured:
    """Measure all record features and feature vectors, one record in memory at a time.

    `frame` is bearing, band and amplitude scale, `grid` the bins of feature vectors; both are the same for sets that
    are to be compared.
    """
    values: list[Array] = []
    summaries: list[RecordSummary] = []

    def transformed() -> Iterator[RecordTransforms]:
        for record in records:
            transforms = RecordTransforms(record.samples, record.condition, frame)
            values.append(registry.measure(transforms))
            summaries.append(summarise(transforms))
            yield transforms

    vectors = measure_vectors(transformed(), grid)
    return Measured(np.array(values), tuple(summaries), vectors)


@cache
def feature_names() -> tuple[str, ...]:
    """Names of what `compare` returns, in its order."""
    return (
        *group_statistics.feature_names(),
        *(f"{kind.prefix}|{name}" for kind in registry.SET_FEATURES for name in kind.names),
        *pooled.feature_names(),
        *(f"context|{name}" for name in context.NAMES),
    )


def compare(pair: Pair, speeds: Speeds | None, of_pooled: Array, *, has_effects: bool = False) -> Array:
    """[features] Differences between measured and simulated records, and what they depend on; see `feature_names`.

    `speeds` are speed correction and cage slip from the calibration; `of_pooled` is from `pooled.features.compare`, of
    these records or of both parts; `has_effects` is whether the given twin has effects, of which the machine may have a
    variant.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # means of empty sets are NaN on purpose
        statistics = group_statistics.compare(pair)
        of_sets = []
        for kind in registry.SET_FEATURES:
            found = kind.compare(pair)
            of_sets.append(np.array([found[name] for name in kind.names], float))
        about = context.measure(pair, speeds, statistics, has_effects=has_effects)
        out = np.concatenate((statistics, *of_sets, of_pooled, about))
    return np.where(np.isfinite(out), out, np.nan)
