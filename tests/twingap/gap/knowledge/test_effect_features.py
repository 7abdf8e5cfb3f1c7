"""Features that may tell of an effect: all patterns name some, and none names everything."""

from __future__ import annotations

import pytest

from twingap.effects import trainable
from twingap.gap.features.comparison import feature_names
from twingap.gap.knowledge.effect_features import _matches, columns


@pytest.mark.parametrize("name", list(trainable()))
def test_every_pattern_names_a_feature(name: str) -> None:
    kind = trainable()[name]
    families = {feature.partition("|")[0] for feature in feature_names()}
    known = {*feature_names(), *families}
    for pattern in kind.features:
        only = type("Only", (kind,), {"features": (pattern,)})
        assert any(_matches(feature, only) for feature in known), pattern
    assert 0 < len(columns(name, feature_names())) < len(feature_names())


def test_an_unknown_effect_may_be_told_by_anything() -> None:
    assert columns("nothing_known", ("a|b", "c|d")) == (0, 1)
