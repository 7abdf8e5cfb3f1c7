"""Yardsticks of closures: what true effects close, and what a twin has left where nothing is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twingap.rigs.worlds import Case, make_world
from twingap.study.blind import blinded
from twingap.study.closure import _left, left_without_effects, true_closure

HUM = Case(
    "single", "twin", (("mains_interference", "strong"),), name="hum", n_records=12, duration_s=0.5, fs_hz=12000.0
)


@pytest.mark.parametrize(("arm", "most"), [("twin", 0.5), ("contact", 0.8)])
def test_without_its_effects_a_machine_is_nearer_to_its_twin(arm: str, most: float) -> None:
    """Less so where the twin is finished records, which do not follow its true speeds."""
    world = make_world(replace(HUM, arm=arm), 5)
    left = left_without_effects(world, 5)
    assert left is not None
    assert left < most * _left(blinded(world), np.random.default_rng(1))
    closure = true_closure(world, 5)
    assert closure is not None
    assert closure > 0.7


def test_a_twin_that_names_effects_without_values_needs_a_diagnosis() -> None:
    world = make_world(HUM, 5)
    named = {"twin": {"model": "phenomenological", "effects": ["load_zone"]}}
    assert left_without_effects(replace(world, twin=named), 5) is None
