"""Transforms of a record against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms


@pytest.mark.parametrize("n", [64, 301, 4099, 12000])
def test_spectra_are_those_of_the_centred_record_without_and_with_a_window(n: int) -> None:
    rng = np.random.default_rng(n)
    x = 3.0 + rng.standard_normal(n) + 2.0 * np.cos(2 * np.pi * (n // 8) * np.arange(n) / n)
    record = RecordTransforms(x, Condition("r", 1800.0, 12000.0, n, "inner"), Frame(BEARINGS["6205"], (2e3, 4e3), 1.0))
    centred = x - x.mean()
    np.testing.assert_allclose(record.transform, np.fft.rfft(centred), rtol=0, atol=1e-9 * n)
    window = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    np.testing.assert_allclose(record.tones, 2 * np.abs(np.fft.rfft(centred * window) / (n / 2)) ** 2, atol=1e-12)
    assert record.tones[n // 8] == pytest.approx(2.0**2 / 2, rel=0.4)
