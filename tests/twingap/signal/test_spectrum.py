"""Spectra on signals whose spectra are known, and against sums written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.signal import Spectrum, amplitude_spectrum, averaged_spectrum, nearest_bin, power_spectral_density


@given(
    samples=st.integers(16, 301),
    data=st.data(),
    amplitude=st.floats(1e-3, 1e3),
    offset=st.floats(-10, 10),
    window=st.sampled_from(["hann", "boxcar", "hamming"]),
)
def test_a_sine_on_a_bin_reads_its_amplitude(samples, data, amplitude, offset, window):
    # Two bins clear of 0 and of half the rate, where a Hann line would meet its mirror image.
    line = data.draw(st.integers(3, (samples - 1) // 2 - 3))
    t = np.arange(samples)
    spectrum = amplitude_spectrum(
        amplitude * np.cos(2 * np.pi * line * t / samples + 0.7) + offset, samples, window=window
    )
    assert spectrum.frequency[line] == pytest.approx(line)
    assert spectrum.values[line] == pytest.approx(amplitude, rel=1e-6)
    assert spectrum.at(line + 0.4) == spectrum.values[line]


@pytest.mark.parametrize("samples", [63, 64])
def test_parseval(samples):
    x = np.random.default_rng(0).standard_normal((3, samples))
    values = amplitude_spectrum(x, 1.0, window="boxcar").values
    squares = values**2 / 2
    if samples % 2 == 0:
        squares[:, -1] *= 2
    np.testing.assert_allclose(squares.sum(axis=-1), x.var(axis=-1), rtol=1e-12)


def test_a_line_at_half_the_rate_is_not_doubled():
    assert amplitude_spectrum(2.0 * (-1.0) ** np.arange(8), 8.0, window="boxcar").values[-1] == pytest.approx(2.0)


@pytest.mark.parametrize("segment", [64, 65])
def test_density_integrates_to_the_variance_and_equals_the_sums_written_out(segment):
    fs_hz, x = 100.0, np.random.default_rng(1).standard_normal(40 * segment)
    psd = power_spectral_density(x, fs_hz, segment_samples=segment)
    assert psd.values.sum() * psd.resolution == pytest.approx(x.var(), rel=0.05)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(segment) / segment)
    hop, centred, total, count = segment - round(0.5 * segment), x - x.mean(), 0.0, 0
    for start in range(0, x.size - segment + 1, hop):
        total = total + np.abs(np.fft.rfft(window * centred[start : start + segment])) ** 2
        count += 1
    direct = 2 * total / count / (fs_hz * (window**2).sum())
    direct[0] /= 2
    if segment % 2 == 0:
        direct[-1] /= 2
    np.testing.assert_allclose(psd.values, direct, rtol=1e-10)


def test_averaging_keeps_a_line_and_steadies_the_floor():
    rng, fs_hz = np.random.default_rng(2), 1000.0
    t = np.arange(20000) / fs_hz
    x = 3 * np.sin(2 * np.pi * 125 * t) + 0.5 * rng.standard_normal((2, t.size))
    spectrum = averaged_spectrum(x, fs_hz, segment_samples=400)
    np.testing.assert_allclose(spectrum.at(125), 3, rtol=0.01)
    floor = spectrum.values[:, spectrum.frequency > 200]
    assert (floor.std(axis=-1) < 0.15 * floor.mean(axis=-1)).all()
    single = amplitude_spectrum(x[:, :400], fs_hz).values[:, 81:]
    assert (single.std(axis=-1) > 0.3 * single.mean(axis=-1)).all()


@given(st.integers(2, 50), st.floats(0.01, 100), st.floats(0, 1))
def test_nearest_bin_is_nearest(bins, step, part):
    axis = np.arange(bins) * step
    wanted = part * axis[-1]
    assert abs(axis[nearest_bin(axis, wanted)] - wanted) == pytest.approx(np.abs(axis - wanted).min(), abs=1e-9)


def test_nearest_bin_refuses_what_lies_outside():
    axis = np.arange(5.0)
    assert nearest_bin(axis, [[0.5, 4.4]]).tolist() == [[0, 4]]
    for outside in (-0.6, 4.6, np.nan):
        with pytest.raises(TwingapError, match="outside"):
            nearest_bin(axis, outside)
    with pytest.raises(TwingapError, match="two in a row"):
        nearest_bin([1.0], 1.0)


def test_in_orders_divides_by_shaft_speed():
    spectrum = Spectrum(np.arange(5.0) * 30, np.zeros(5)).in_orders(1800.0)
    assert spectrum.frequency.tolist() == [0, 1, 2, 3, 4]
    with pytest.raises(TwingapError, match="speed_rpm"):
        spectrum.in_orders(0.0)


@pytest.mark.parametrize("segment", [1, 11, 2.5, True])
def test_refuses_impossible_segments(segment):
    with pytest.raises(TwingapError, match="segment_samples"):
        averaged_spectrum(np.zeros(10), 1.0, segment_samples=segment)


def test_refuses_unknown_windows_overlaps_and_rates():
    with pytest.raises(TwingapError, match="window"):
        amplitude_spectrum(np.zeros(10), 1.0, window="hanning-ish")
    with pytest.raises(TwingapError, match="window"):
        amplitude_spectrum(np.zeros(10), 1.0, window="kaiser")
    with pytest.raises(TwingapError, match="overlap"):
        power_spectral_density(np.zeros(10), 1.0, segment_samples=4, overlap=1.0)
    for rate in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(TwingapError, match="fs_hz"):
            amplitude_spectrum(np.zeros(10), rate)


@pytest.mark.parametrize("window", ["hann", "boxcar"])
def test_averaged_nothing_is_doubled_at_half_the_rate(window):
    x = 3.0 * (-1.0) ** np.arange(640)
    assert averaged_spectrum(x, 1.0, segment_samples=64, window=window).values[-1] == pytest.approx(3.0)
    assert amplitude_spectrum(x, 1.0, window=window).values[-1] == pytest.approx(3.0)
