"""Spectral kurtosis and kurtogram: what noise gives, what impacts give, and direct calculations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.signal import fast_kurtogram, gaussian_sk_sd, spectral_kurtosis
from twingap.signal.kurtosis import band_filter


def ringing(resonance_hz, fs_hz, samples, rng, rate_hz=60.0, noise=0.2):
    since = np.arange(samples) / fs_hz % (1 / rate_hz)
    x = np.exp(-600 * since) * np.sin(2 * np.pi * resonance_hz * since)
    return x + noise * rng.standard_normal(samples)


def test_gaussian_noise_has_the_mean_and_scatter_that_theory_says():
    frames, length, records = 50, 64, 300
    x = np.random.default_rng(0).standard_normal((records, frames * length))
    # White noise and the same through a filter: a stationary signal's kurtosis knows nothing of its colour.
    coloured = x[:, 1:] + 0.9 * x[:, :-1]
    for noise, count in ((x, frames), (coloured, frames - 1)):
        inner = spectral_kurtosis(noise, 1.0, window_samples=length, overlap=0.0).values[:, 3:-3]
        assert abs(inner.mean()) < 4 * gaussian_sk_sd(count) / np.sqrt(inner.size / 2)
        assert inner.std() == pytest.approx(gaussian_sk_sd(count), rel=0.05)


def test_spectral_kurtosis_equals_the_sums_written_out():
    x, length, hop = np.random.default_rng(1).standard_normal(500), 40, 10
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    centred = x - x.mean()
    second, fourth, frames = np.zeros(21), np.zeros(21), 0
    for start in range(0, 500 - length + 1, hop):
        for k in range(21):
            value = sum(window[n] * centred[start + n] * np.exp(-2j * np.pi * k * n / length) for n in range(length))
            second[k] += abs(value) ** 2
            fourth[k] += abs(value) ** 4
        frames += 1
    ratio = frames * fourth / second**2
    direct = frames / (frames - 1) * ((frames + 1) / frames * ratio - 2)
    found = spectral_kurtosis(x, 80.0, window_samples=length)
    np.testing.assert_allclose(found.values[1:-1], direct[1:-1], rtol=1e-9)
    np.testing.assert_allclose(found.frequency, np.arange(21) * 2.0)


def test_a_steady_tone_has_minus_one():
    x = np.cos(2 * np.pi * 0.25 * np.arange(64 * 200))
    assert spectral_kurtosis(x, 1.0, window_samples=64).at(0.25) == pytest.approx(-1, abs=0.03)


def test_impacts_stand_out_at_their_resonance_only():
    rng = np.random.default_rng(2)
    spectrum = spectral_kurtosis(
        ringing(3000.0, 12000.0, 24000, rng, rate_hz=50.0, noise=0.2), 12000.0, window_samples=64
    )
    assert 2600 < spectrum.frequency[spectrum.values.argmax()] < 3400
    far = np.abs(spectrum.frequency - 3000) > 2000
    assert spectrum.values.max() > 8 * np.abs(spectrum.values[far]).max()


def test_gaussian_noise_has_no_impulsive_band():
    kurtogram = fast_kurtogram(np.random.default_rng(3).standard_normal((60, 4096)), 1.0)
    sd = 2 / np.sqrt(kurtogram.n_samples)
    # Samples of an envelope are correlated by the filters' overlap: allow for half as many.
    assert (np.abs(kurtogram.kurtosis.mean(axis=0)) < 5 * np.sqrt(2) * sd / np.sqrt(60) + 4 / kurtogram.n_samples).all()
    assert (kurtogram.kurtosis.std(axis=0) < 1.7 * sd).all()


@settings(max_examples=15, deadline=None)
@given(st.floats(0.06, 0.44), st.integers(0, 1000))
def test_impacts_are_found_in_their_band(centre, seed):
    rng = np.random.default_rng(seed)
    x = ringing(12000 * centre, 12000.0, 12000, rng)
    (band,) = fast_kurtogram(x, 12000.0, max_level=4).best
    width = band.high_hz - band.low_hz
    assert band.low_hz - width / 4 <= 12000 * centre <= band.high_hz + width / 4
    assert band.kurtosis > 0.5
    assert band.centre_hz == (band.low_hz + band.high_hz) / 2


def test_tree_equals_one_filter_a_band():
    """Each band once more by one filter at the full rate: the stages convolved, spread by the rate they ran at."""
    fs_hz, x = 2.0, np.random.default_rng(4).standard_normal(1537) ** 3
    kurtogram = fast_kurtogram(x, fs_hz, max_level=3)
    spectrum = np.fft.fft(x - x.mean())
    spectrum[1:769] *= 2
    spectrum[769:] = 0
    analytic = np.fft.ifft(spectrum)
    paths = [[]]
    for depth in range(3):
        halves = [path for path in paths if len(path) == depth and all(parts == 2 for _, parts in path)]
        paths += [[*path, (part, 2)] for path in halves for part in range(2)]
        if depth < 2:
            paths += [[*path, (part, 3)] for path in halves for part in range(3)]
    assert len(paths) == kurtogram.level.size
    for path in paths:
        taps, spread, low, width, odd = np.ones(1, complex), 1, 0.0, fs_hz / 2, 0
        for part, parts in path:
            own = band_filter(part, parts)
            own = own * (-1.0) ** (odd * np.arange(own.size))
            wide = np.zeros((own.size - 1) * spread + 1, complex)
            wide[::spread] = own
            taps, spread, width = np.convolve(taps, wide), spread * parts, width / parts
            low, odd = low + part * width, part % 2
        energy = np.abs(np.convolve(analytic, taps, mode="valid")[::spread]) ** 2
        direct = (energy**2).mean() / energy.mean() ** 2 - 2
        (place,) = np.flatnonzero(np.isclose(kurtogram.low_hz, low) & np.isclose(kurtogram.high_hz, low + width))
        assert kurtogram.level[place] == pytest.approx(np.log2(spread))
        assert kurtogram.n_samples[place] == energy.size
        assert kurtogram.kurtosis[place] == pytest.approx(direct, rel=1e-9, abs=1e-9)


def test_bands_of_a_level_tile_the_spectrum_and_the_image_shows_them():
    kurtogram = fast_kurtogram(np.random.default_rng(5).standard_normal((2, 3, 2048)), 100.0)
    for level in np.unique(kurtogram.level):
        own = kurtogram.level == level
        assert own.sum() == round(2**level)
        np.testing.assert_allclose(kurtogram.low_hz[own][1:], kurtogram.high_hz[own][:-1])
        assert kurtogram.high_hz[own][-1] == pytest.approx(50)
    levels, edges, image = kurtogram.image()
    assert image.shape == (2, 3, levels.size, edges.size - 1)
    (row,) = np.flatnonzero(levels == 2)
    column = np.searchsorted(edges, 30.0) - 1
    (band,) = np.flatnonzero((kurtogram.level == 2) & (kurtogram.low_hz == 25.0))
    assert (image[..., row, column] == kurtogram.kurtosis[..., band]).all()


@given(st.floats(1e-6, 1e6), st.sampled_from([-1, 1]), st.floats(-10, 10))
@settings(max_examples=20, deadline=None)
def test_neither_unit_sign_nor_offset_matters(scale, sign, offset):
    x = np.random.default_rng(6).standard_normal(600) ** 3
    y = sign * scale * (x + offset)
    np.testing.assert_allclose(fast_kurtogram(x, 1.0).kurtosis, fast_kurtogram(y, 1.0).kurtosis, rtol=1e-6, atol=1e-6)
    inner = slice(1, None)  # what rounding leaves of the mean sits at 0 Hz
    a, b = (spectral_kurtosis(z, 1.0, window_samples=50).values[inner] for z in (x, y))
    np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)


def test_silence_is_not_impulsive():
    x = np.full((2, 512), 0.1)
    assert (fast_kurtogram(x, 1.0).kurtosis == 0).all()
    assert (spectral_kurtosis(x, 1.0, window_samples=32).values == 0).all()


def test_refuses_records_too_short():
    with pytest.raises(TwingapError, match="at least 256"):
        fast_kurtogram(np.zeros(255), 1.0)
    with pytest.raises(TwingapError, match="at most 2"):
        fast_kurtogram(np.zeros(512), 1.0, max_level=3)
    with pytest.raises(TwingapError, match="max_level"):
        fast_kurtogram(np.zeros(512), 1.0, max_level=0)
    with pytest.raises(TwingapError, match="two expected"):
        spectral_kurtosis(np.zeros(100), 1.0, window_samples=100)
    with pytest.raises(TwingapError, match="n_frames"):
        gaussian_sk_sd(1)
