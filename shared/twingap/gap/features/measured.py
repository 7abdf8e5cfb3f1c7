"""Sets of records, measured: features of each record, summaries for pooled measurements, and feature vectors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.features.pooled.features import PooledRecords
from twingap.gap.features.spectrum import path
from twingap.gap.features.spectrum.record_summary import RecordSummary
from twingap.records import Array, Condition


@dataclass(frozen=True)
class Measured:
    """A set of records, measured."""

    values: Array  # [records, features] in the order of `registry.NAMES`; NaN where a feature does not apply
    summaries: tuple[RecordSummary, ...]  # [records] summaries for measurements over several records
    vectors: FeatureVectors  # [records] feature vectors for distances

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions of the records."""
        return tuple(summary.condition for summary in self.summaries)

    @cached_property
    def pooled(self) -> PooledRecords:
        """These records for pooled measurements, without the other part."""
        return PooledRecords(self.summaries)

    @cached_property
    def spectral_fit(self) -> Array:
        """[path.NAMES] Fits of models to the mean spectra, and their values."""
        found = path.measure(self.summaries)
        return np.array([found[name] for name in path.NAMES])

    def faults(self) -> NDArray[np.str_]:
        """[records] Fault of each, "" when unknown."""
        return np.array([c.fault or "" for c in self.conditions])


@dataclass(frozen=True)
class Pair:
    """Measured records and simulated ones; of the same conditions in the same order, they compare record by record.

    `external` is whether the simulated records are from the user's simulator of this machine. The response is then
    sampled in the same way on both sides, and no parameter was fitted.
    """

    real: Measured
    simulated: Measured
    external: bool = False
