"""The response to a force has the power by which records with defects exceed healthy ones, and follows its cause."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from twingap.effects.force_response import force_response
from twingap.effects.impact_train import BEFORE, response_of
from twingap.effects.modes import Mode, modal_response

Array = NDArray[np.float64]
FS_HZ = 20000.0


@pytest.fixture(scope="module")
def mode() -> Array:
    return np.asarray(modal_response([Mode(3000.0, 0.03)], FS_HZ, 600, np.zeros(1), np.ones(1)))


def records(mode: Array, count: int, impacts: float, seed: int) -> list[Array]:
    """Noise and, at random times that are far too close to tell them apart, impacts through the mode."""
    rng = np.random.default_rng(seed)
    force = impacts * rng.standard_normal((count, 30000)) * (rng.random((count, 30000)) < 0.1)
    noise = rng.standard_normal((count, 30000))
    return [fftconvolve(own, mode)[: own.size] + white for own, white in zip(force, noise, strict=True)]


def test_power_is_that_of_the_mode_where_single_impacts_do_not_stand_out(mode: Array) -> None:
    faulty = records(mode, 6, 1.0, 1)
    assert response_of(faulty, [100.0] * 6) is None
    found = force_response(records(mode, 4, 0.0, 2), faulty)
    assert found is not None
    assert found[BEFORE] == 1.0 == np.abs(found).max()
    assert np.abs(found[: BEFORE - 4]).max() < 0.05, "nothing before the force"
    near = slice(100, 220)  # 2000 to 4300 Hz, of 1024
    own, other = (np.log(np.abs(np.fft.rfft(x, 1024))[near]) for x in (found, mode))
    assert np.std(own - other) < 0.25


def test_none_without_healthy_records_or_more_power(mode: Array) -> None:
    healthy = records(mode, 4, 0.0, 2)
    assert force_response([], records(mode, 4, 1.0, 1)) is None
    assert force_response(healthy, records(mode, 4, 0.0, 3)) is None
    assert force_response([x[:600] for x in healthy], healthy) is None, "too short"
