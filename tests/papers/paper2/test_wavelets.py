"""Scalograms of tones."""

import numpy as np
import pytest

from papers.paper2_digital_twin.methods.scalograms import scalogram
from twingap.errors import TwingapError

FS_HZ = 8000.0
T = np.arange(4000) / FS_HZ


@pytest.mark.parametrize("tone_hz", [200.0, 1000.0, 2500.0])
@pytest.mark.parametrize("bandwidth", [1.5, 6.0])
def test_a_tone_reads_its_amplitude_in_its_row(tone_hz, bandwidth):
    frequencies = np.array([0.25, 0.5, 1.0, 1.5]) * tone_hz
    found = scalogram(5 * np.sin(2 * np.pi * tone_hz * T), FS_HZ, frequencies, bandwidth=bandwidth)
    assert found.shape == (4, T.size)
    middle = found[:, 1000:-1000]
    np.testing.assert_allclose(middle[2], 5.0, rtol=0.01)
    assert (middle.argmax(axis=0) == 2).all()


def test_a_burst_is_seen_when_it_happens():
    x = np.where(np.abs(T - 0.3) < 0.01, np.sin(2 * np.pi * 1000 * T), 0.0)
    row = scalogram(x, FS_HZ, [1000.0])[0]
    assert abs(T[row.argmax()] - 0.3) < 0.012
    assert row[T < 0.25].max() < 1e-3 * row.max()


def test_batches_equal_their_members():
    x = np.random.default_rng(0).standard_normal((2, 3, 200))
    found = scalogram(x, 100.0, [5.0, 20.0])
    assert found.shape == (2, 3, 2, 200)
    np.testing.assert_allclose(found[1, 2], scalogram(x[1, 2], 100.0, [5.0, 20.0]), atol=1e-12)


@pytest.mark.parametrize("frequencies", [[0.0], [-1.0], [50.0], [[1.0]], [np.nan], []])
def test_refuses_frequencies_out_of_range(frequencies):
    with pytest.raises(TwingapError):
        scalogram(np.zeros(10), 100.0, frequencies)
