"""A narrow hump of all records is a second mode, unless it is one of many, wide, unsteady, or the twin's own mode's."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from twingap.effects import SecondResonance

FS_HZ = 20000.0
HUMP = {"": 12.0, "_rival": 3.0, "_fs": 0.14, "_damping": 0.02, "_level": 0.6, "_unsteady": 0.3, "_peak_fs": 0.05}


def seen(own_mode: float | None = None, **other: float) -> Any:
    """Observations with this hump; `own_mode` is that of the twin, over the sampling rate, where its spectrum peaks."""
    peak = {} if own_mode is None else {"_peak_fs": own_mode}
    hump = {**HUMP, **peak, **{f"_{name}" if name != "z" else "": value for name, value in other.items()}}
    features = {f"pooled|hump{what}": value for what, value in hump.items()}
    own = None if own_mode is None else (own_mode * FS_HZ, 0.05)
    return SimpleNamespace(features=features, held_out={}, fs_hz=FS_HZ, own_mode=own)


@pytest.mark.parametrize("own_mode", [None, 0.05, 0.2, 0.45])
def test_a_clear_hump_is_a_mode_with_its_frequency_and_damping(own_mode: float | None) -> None:
    assert SecondResonance.certain(seen(own_mode)) and SecondResonance.shows_gap(seen(own_mode))
    assert SecondResonance.shown(seen(own_mode)) == {"frequency_hz": 0.14 * FS_HZ, "damping_ratio": 0.02}


NONE = (
    {"z": 4.9, "rival": 1.0}, {"z": math.nan}, {"rival": 7.0}, {"damping": 0.09}, {"unsteady": 0.9}, {"peak_fs": 0.36},
)  # fmt: skip


@pytest.mark.parametrize("other", NONE)
def test_what_else_makes_humps_is_no_mode(other: dict[str, float]) -> None:
    assert not SecondResonance.certain(seen(**other)) and not SecondResonance.shown(seen(**other))


@pytest.mark.parametrize("own_mode", [0.13, 0.165, 0.0705, 0.362])
def test_humps_of_the_twins_own_mode_are_none(own_mode: float) -> None:
    """It lies elsewhere or drifts, distortion repeats it, or a converter folds it."""
    assert not SecondResonance.certain(seen(own_mode))


def test_a_twin_that_is_not_calibrated_to_a_mode_says_nothing() -> None:
    assert not SecondResonance.certain(seen(own_mode=0.3, peak_fs=0.05))


def test_a_hump_that_other_effects_hide_still_gives_the_values() -> None:
    hidden = seen(z=3.0)
    hidden.held_out = seen().features
    assert not SecondResonance.certain(hidden)
    assert SecondResonance.shown(hidden)["frequency_hz"] == pytest.approx(0.14 * FS_HZ)


def test_machines_without_features_have_none() -> None:
    assert not SecondResonance.certain(SimpleNamespace(features={}, held_out={}, fs_hz=FS_HZ, own_mode=None))
