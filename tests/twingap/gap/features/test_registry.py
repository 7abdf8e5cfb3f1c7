"""The registry of features and the domains: names, lengths and groups agree with what is measured."""

from typing import get_args

import numpy as np
import pytest

from tests.twingap.gap.features.machines import Machine
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.domains import DOMAINS
from twingap.gap.distance.grid import Grid
from twingap.gap.features import registry
from twingap.gap.features.comparison import feature_names


def test_every_feature_has_a_name_of_its_own():
    names = feature_names()
    assert len(set(names)) == len(names)
    assert len(set(registry.NAMES)) == len(registry.NAMES) == len(registry.OF_IMPACTS)


@pytest.mark.parametrize("kind", registry.RECORD_FEATURES, ids=lambda kind: kind.prefix)
def test_modules_measure_the_features_that_they_name(kind):
    for fault in ("healthy", "outer"):
        ((record, _),) = Machine().records(fault=fault, count=1)
        found = kind.measure(record)
        assert set(found) == set(kind.names)
        values = np.array(list(found.values()))
        # Features of impacts do not apply to healthy records; of the others, most apply to any record.
        assert np.isfinite(values).any() != (kind.of_impacts and fault == "healthy")


def test_features_are_in_the_order_of_their_names():
    ((record, _),) = Machine().records(fault="outer", count=1)
    values = dict(zip(registry.NAMES, registry.measure(record), strict=True))
    for kind in registry.RECORD_FEATURES:
        for name, value in kind.measure(record).items():
            assert values[f"{kind.prefix}.{name}"] == pytest.approx(value, nan_ok=True)


def test_domains_have_a_vector_as_long_as_their_axis():
    ((record, _),) = Machine().records(fault="outer", count=1)
    grid = Grid.of([record.condition], record.bearing)
    assert tuple(domain.name for domain in DOMAINS) == get_args(DomainName)
    for domain in DOMAINS:
        axis, vector = domain.axis(grid), domain.vector(record, grid)
        assert vector.shape == axis.lo.shape == axis.hi.shape == (len(axis.kind),)
        assert np.isfinite(vector).all()
        assert {curve.kind for curve in domain.curves} <= set(axis.kind)
        assert domain.label and domain.short_label and domain.phrase and domain.advice.endswith(".")
