"""Feature vectors of records: interpretable vectors with named bins, for distances, tests and localisation.

RecordTransforms of many records, one after the other --measure_vectors--> FeatureVectors: domain -> [records, bins]

The content of the vectors is defined in `domains`. Samples are not kept, so memory is bounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.domains import DOMAINS
from twingap.gap.distance.grid import Axis, Grid, require_length
from twingap.records import Array, Condition
from twingap.signal.record_transforms import RecordTransforms


@dataclass(frozen=True)
class FeatureVectors:
    """Feature vectors of a set of records."""

    values: Mapping[DomainName, Array]  # domain -> [records, bins]
    axes: Mapping[DomainName, Axis]
    conditions: tuple[Condition, ...]  # [records]

    def __len__(self) -> int:
        return len(self.conditions)

    @property
    def domains(self) -> tuple[DomainName, ...]:
        """Domains in the order of `matrix`."""
        return tuple(self.values)

    @cached_property
    def matrix(self) -> Array:
        """[records, all bins] The domains side by side."""
        return np.concatenate(list(self.values.values()), axis=1)

    def columns(self, domain: DomainName) -> slice:
        """Columns of a domain in `matrix`."""
        sizes = [self.values[name].shape[1] for name in self.domains]
        place = self.domains.index(domain)
        return slice(sum(sizes[:place]), sum(sizes[: place + 1]))

    @cached_property
    def weight(self) -> Array:
        """[all bins] Weight of each bin: equal for domains, and for kinds within a domain; the sum is 1."""
        return np.concatenate([self.axes[domain].weight for domain in self.domains]) / len(self.domains)

    def take(self, places: Sequence[int] | NDArray[np.int64]) -> FeatureVectors:
        """The records at these places."""
        kept = np.asarray(places, dtype=int)
        return FeatureVectors(
            {domain: values[kept] for domain, values in self.values.items()},
            self.axes,
            tuple(self.conditions[i] for i in kept),
        )


def measure_vectors(records: Iterable[RecordTransforms], grid: Grid) -> FeatureVectors:
    """Measure records one after the other; a generator's records need not be in memory together.

    `grid` is the same for all sets that are to be compared.

    Raises
    ------
    TwingapError
        For no records, or one of fewer than 64 samples.
    """
    rows: dict[DomainName, list[Array]] = {domain.name: [] for domain in DOMAINS}
    conditions: list[Condition] = []
    for record in records:
        require_length(record.x.size, record.condition.name)
        for domain in DOMAINS:
            rows[domain.name].append(domain.vector(record, grid))
        conditions.append(record.condition)
    if not conditions:
        raise TwingapError("no records to measure", where="feature vectors")
    axes = {domain.name: domain.axis(grid) for domain in DOMAINS}
    return FeatureVectors({name: np.stack(own) for name, own in rows.items()}, axes, tuple(conditions))
