"""Tacho pulses: missing and double ones are found, repaired or refused."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.errors import TwingapError
from twingap.signal import repaired_tacho, turns_from_tacho

TRUE = np.cumsum(np.full(275, 1 / 30))
MISSING = np.delete(TRUE, np.arange(7, 275, 20))


def test_missing_pulses_are_filled_in() -> None:
    found = repaired_tacho(MISSING)
    np.testing.assert_allclose(found.times_s, TRUE, rtol=0, atol=1e-12)
    assert found.missing[:2] == (6, 25)
    assert found.notes == ("14 pulses are missing, the first after pulse 6: filled in",)


@pytest.mark.parametrize("pulses", [TRUE, MISSING])
def test_double_pulses_are_taken_out(pulses: np.ndarray) -> None:
    found = repaired_tacho(np.sort(np.append(pulses, pulses[50] + 0.002)))
    np.testing.assert_allclose(found.times_s, TRUE, rtol=0, atol=1e-12)
    assert found.double == (51,)


def test_two_missing_in_a_row_and_several_per_turn() -> None:
    found = repaired_tacho(np.delete(TRUE, [40, 41, 43]))
    np.testing.assert_allclose(found.times_s, TRUE, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "pulses",
    [
        TRUE,
        np.sqrt(np.arange(1, 300)),  # constant acceleration
        np.sqrt(300.0) - np.sqrt(np.arange(299, 0, -1)),
        np.cumsum((1 + 0.2 * np.sin(np.arange(300) / 5)) / 30),
    ],
)
def test_a_changing_speed_is_no_fault(pulses: np.ndarray) -> None:
    found = repaired_tacho(pulses)
    assert found.notes == ()
    np.testing.assert_array_equal(found.times_s, pulses)


def test_angles_are_refused_repaired_or_kept() -> None:
    right = turns_from_tacho(TRUE, 900, 100.0)
    with pytest.raises(TwingapError, match="14 pulses are missing, the first after pulse 6"):
        turns_from_tacho(MISSING, 900, 100.0)
    with pytest.warns(UserWarning, match="14 pulses are missing"):
        np.testing.assert_allclose(turns_from_tacho(MISSING, 900, 100.0, repair="repair"), right, atol=1e-9)
    assert abs(turns_from_tacho(MISSING, 900, 100.0, repair="keep") - right).max() > 10


def test_pulses_without_order_are_refused() -> None:
    with pytest.raises(TwingapError, match="intervals are irregular"):
        repaired_tacho(np.cumsum(np.random.default_rng(0).exponential(size=200) ** 3))
