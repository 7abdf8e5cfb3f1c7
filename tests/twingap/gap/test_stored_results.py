"""What ships fits the running version: features, names and whole diagnoses are those that were stored."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from tests.twingap.gap import stored
from twingap.gap.features.comparison import feature_names
from twingap.gap.knowledge.learn import Examples
from twingap.gap.knowledge.learnt import Learnt


@pytest.fixture(scope="module")
def kept() -> Examples:
    """Stored examples; features of the fit part and values of effects are not stored."""
    with np.load(stored.FOLDER / "features.npz") as file:
        table = dict(file)
    none = np.zeros((len(table["machine"]), 0))
    return Examples(**table, values=none, fit_features=none)


def test_features_are_those_that_were_learnt_from(kept: Examples) -> None:
    computed = stored.machines(0, stored.COMPUTED)
    rows = kept.machine < stored.COMPUTED
    np.testing.assert_array_equal(computed.machine, kept.machine[rows])
    np.testing.assert_array_equal(computed.missing, kept.missing[rows])
    now, then = computed.features.astype(float), kept.features[rows].astype(float)
    known = np.isfinite(then)
    np.testing.assert_array_equal(np.isfinite(now), known)
    off = np.abs(now - then) > 1e-3 + 1e-3 * np.abs(then)
    # A choice between candidates that are equal but for rounding may fall otherwise on another processor.
    assert off[known].mean() < 1e-3, [feature_names()[j] for j in np.flatnonzero((off & known).any(axis=0))[:20]]


def test_gaps_are_named_at_a_first_look(kept: Examples, learnt: Learnt) -> None:
    """Of machines not learnt from, by detectors alone: neither worse than a floor nor named without reason."""
    first = kept.first & ~kept.outside
    odds = learnt.log_odds(kept.features[first])
    limits = np.array([learnt.thresholds.get(name, 0.5) for name in learnt.effects])
    missing, modelled = kept.missing[first], kept.modelled[first]
    named = (odds > limits) & ~modelled
    assert len(missing) >= 40
    right = (named & missing).sum()
    assert right / missing.sum() >= RECALL
    assert right / named.sum() >= PRECISION
    alone = missing.sum(axis=1) == 1
    strongest = np.argmax(np.where(modelled, -np.inf, odds), axis=1)
    assert missing[alone, strongest[alone]].mean() >= FIRST


def test_p_values_of_no_gap_tell_machines_apart(kept: Examples, learnt: Learnt) -> None:
    first = np.flatnonzero(kept.first)
    has = [[n for n, there in zip(learnt.effects, kept.modelled[i], strict=True) if there] for i in first]
    p = np.array([learnt.p_value(kept.features[i], own) for i, own in zip(first, has, strict=True)])
    gap = kept.missing[first].any(axis=1) | kept.outside[first]
    assert (p[~gap] <= 0.05).mean() <= 0.15
    assert (p[gap] <= 0.05).mean() >= DETECTED


@pytest.mark.parametrize("number", stored.DIAGNOSED)
def test_diagnoses_end_as_stored(number: int) -> None:
    then: dict[str, Any] = json.loads((stored.FOLDER / "diagnoses.json").read_text(encoding="utf-8"))[number]
    now = stored.end(number)
    assert {key: now.get(key) for key in ("status", "effects", "error")} == {
        key: then.get(key) for key in ("status", "effects", "error")
    }
    if "error" not in then:
        assert now["p_value"] == pytest.approx(then["p_value"], abs=0.02)
        assert (now["closure"] is None) == (then["closure"] is None)
        assert now["closure"] is None or now["closure"] == pytest.approx(then["closure"], abs=0.05)


RECALL, PRECISION, FIRST, DETECTED = 0.56, 0.85, 0.7, 0.7
"""Floors, a little below what the shipped file reaches on these machines."""
