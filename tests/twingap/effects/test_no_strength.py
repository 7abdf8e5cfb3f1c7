"""An effect of no strength changes nothing, on either twin or on a finished waveform."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from twingap.bearing import BEARINGS
from twingap.effects import Effect, apply_to_waveform, catalogue, make_effect
from twingap.records import Condition, Record
from twingap.streams import Streams
from twingap.twins.contact import ContactTwin
from twingap.twins.phenomenological import PhenomenologicalTwin

Array = NDArray[np.float64]
BEARING = BEARINGS["6205"]
NONE: dict[str, dict[str, float]] = {
    "speed_fluctuation": {"level": 0.0},
    "mean_slip": {"slip": 0.0},
    "slip_jitter": {"sigma": 0.0},
    "impact_scatter": {"sigma": 0.0},
    "load_zone": {"depth": 0.0},
    "cage_modulation": {"depth": 0.0},
    "entry_exit": {"exit_ratio": 0.0},
    "distributed_roughness": {"level": 0.0},
    "speed_gain": {"exponent": 0.0},
    "damage_growth": {"rate_per_s": 0.0},
    "second_resonance": {"gain": 0.0},
    "shaft_harmonics": {"level_1x": 0.0, "level_2x": 0.0, "level_3x": 0.0},
    "looseness": {"level": 0.0},
    "mains_interference": {"level": 0.0},
    "drive_interference": {"level": 0.0},
    "gear_mesh": {"level": 0.0},
    "foreign_bearing": {"level": 0.0},
    "coloured_noise": {"level": 0.0},
    "impulsive_noise": {"level": 0.0},
    "waviness": {"level": 0.0},
    "clipping": {"rail": 1e9},
    "quantisation": {"step": 1e-9},
    "dropout": {"rate_hz": 0.0},
    "impulsive_share": {"share": 0.0},
    "ball_contact": {"depth": 0.0},
    "transfer_path": {"depth": 0.0},
    "line_spectrum": {"level": 0.0},
    "background_spectrum": {"level": 0.0},
    "sample_hold": {"repeats": 1},
}


def phenomenological(chain: Sequence[Effect], condition: Condition) -> Array:
    return PhenomenologicalTwin(BEARING, None, chain).make([condition], [Streams(3, 0)])[0].samples


def contact(chain: Sequence[Effect], condition: Condition) -> Array:
    return ContactTwin(BEARING, None, chain).make([condition], [Streams(3, 0)])[0].samples


def waveform(chain: Sequence[Effect], condition: Condition) -> Array:
    given = Record(condition, np.random.default_rng(0).standard_normal(condition.n_samples))
    return apply_to_waveform(chain, given, BEARING, 1.0, Streams(3, 0)).samples


NO_PLACE = {
    (waveform, "mean_slip"), (waveform, "distributed_roughness"), (contact, "entry_exit"),
    *((make, name) for make in (contact, waveform) for name in ("impulsive_share", "ball_contact")),
}  # fmt: skip
"""Refused, or the twin's own."""


def condition(fault: str) -> Condition:
    return Condition("a", 1700.0, 12000.0, 1500, fault, time_s=100.0)


@functools.cache
def without(make: Callable[[Sequence[Effect], Condition], Array], fault: str) -> Array:
    """The record without any effect, simulated once for all."""
    return make([], condition(fault))


@pytest.mark.parametrize("make", [phenomenological, contact, waveform])
@pytest.mark.parametrize("name", sorted(NONE))
def test_no_strength_is_no_change(name: str, make: Callable[[Sequence[Effect], Condition], Array]) -> None:
    if (make, name) in NO_PLACE:
        return
    for fault in ("healthy", "inner", "ball"):
        with_it = make([make_effect(name, NONE[name])], condition(fault))
        np.testing.assert_allclose(with_it, without(make, fault), atol=1e-8)


def test_every_effect_was_tried() -> None:
    """Except the low-pass, which has a corner and no strength."""
    assert set(catalogue()) - set(NONE) <= {"sensor_rolloff"} | {
        name for name in catalogue() if not catalogue()[name].__module__.startswith("twingap.effects")
    }
