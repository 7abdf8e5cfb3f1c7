"""Envelopes of known modulations, lines at known orders, and two records of the CWRU bearing."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import loadmat

from twingap.bearing import BEARINGS, PUBLIC_BEARINGS
from twingap.errors import TwingapError
from twingap.signal import (
    Spectrum,
    analytic_signal,
    demodulate,
    envelope,
    impulsive_envelope_spectrum,
    lines_at,
    most_impulsive_band,
    squared_envelope_spectrum,
)

FS_HZ = 12000.0
T = np.arange(12000) / FS_HZ


def impacts(rate_hz, resonance_hz, seed=0, noise=0.3):
    """Ringing at a resonance, struck `rate_hz` times a second, in noise."""
    since = T % (1 / rate_hz)
    ringing = np.exp(-250 * since) * np.sin(2 * np.pi * resonance_hz * since)
    return ringing + noise * np.random.default_rng(seed).standard_normal(T.size)


@pytest.mark.parametrize("samples", [1, 2, 63, 64])
def test_analytic_signal_equals_the_definition(samples):
    x = np.random.default_rng(0).standard_normal((2, samples))
    spectrum = np.fft.fft(x)
    frequency = np.fft.fftfreq(samples)
    gain = np.where(frequency > 0, 2.0, np.where(frequency < 0, 0.0, 1.0))
    if samples % 2 == 0:
        gain[samples // 2] = 1.0
    found = analytic_signal(x)
    np.testing.assert_allclose(found, np.fft.ifft(spectrum * gain), atol=1e-12)
    np.testing.assert_allclose(found.real, x, atol=1e-12)


def test_the_whole_band_without_edges_is_the_analytic_signal():
    x = np.random.default_rng(1).standard_normal((2, 100))
    np.testing.assert_allclose(demodulate(x, 10.0, (0.0, 5.0), edge=0.0), analytic_signal(x), atol=1e-12)
    np.testing.assert_allclose(demodulate(x, 10.0, (0.0, 5.0)), analytic_signal(x), atol=1e-12)


def test_neighbouring_bands_add_up_to_the_signal():
    x = np.random.default_rng(1).standard_normal(101)
    low, high = demodulate(x, 101.0, (0.0, 20.5), edge=0.0), demodulate(x, 101.0, (20.6, 50.5), edge=0.0)
    np.testing.assert_allclose((low + high).real, x, atol=1e-12)


@given(st.floats(0, 0.95), st.integers(20, 300))
def test_depth_of_modulation_is_read(depth, rate_hz):
    x = 7.0 * (1 + depth * np.cos(2 * np.pi * rate_hz * T)) * np.cos(2 * np.pi * 3000 * T)
    spectrum = squared_envelope_spectrum(x, FS_HZ, (2000.0, 4000.0), normalise=True)
    mean = 1 + depth**2 / 2
    assert spectrum.at(rate_hz) == pytest.approx(2 * depth / mean, abs=1e-6)
    assert spectrum.at(2 * rate_hz) == pytest.approx(depth**2 / 2 / mean, abs=1e-6)
    raw = squared_envelope_spectrum(x, FS_HZ, (2000.0, 4000.0), normalise=False)
    assert raw.at(rate_hz) == pytest.approx(49 * 2 * depth, abs=1e-5)


def test_envelope_follows_the_amplitude():
    amplitude = 2 + np.cos(2 * np.pi * 10 * T)
    x = amplitude * np.cos(2 * np.pi * 2000 * T)
    np.testing.assert_allclose(envelope(x), amplitude, atol=1e-9)
    strong = x + 5 * np.cos(2 * np.pi * 5000 * T)
    np.testing.assert_allclose(envelope(strong, FS_HZ, (1500.0, 2500.0)), amplitude, atol=1e-9)


@given(st.floats(1e-6, 1e6), st.sampled_from([1, -1]))
def test_normalised_spectrum_does_not_depend_on_unit_or_sign(scale, sign):
    x = np.random.default_rng(3).standard_normal(256)
    one, other = (squared_envelope_spectrum(y, 256.0).values for y in (x, sign * scale * x + 3.0 * scale))
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_silence_has_an_empty_envelope_spectrum():
    assert (squared_envelope_spectrum(np.full((2, 63), 0.1), 63.0).values == 0).all()
    assert (squared_envelope_spectrum(np.full((2, 63), 0.1), 63.0, (3.0, 20.0)).values == 0).all()


@pytest.mark.parametrize("name", sorted(PUBLIC_BEARINGS))
@pytest.mark.parametrize("fault", ["inner", "outer", "ball"])
def test_impacts_peak_at_their_order_in_the_most_impulsive_band(name, fault):
    order = BEARINGS[name].fault_order(fault)
    shaft_hz = round(order * 8) / order  # a line between two bins would lose up to a third to both
    spectrum, (band,) = impulsive_envelope_spectrum(impacts(order * shaft_hz, 3400.0), FS_HZ, max_level=3)
    spectrum = spectrum.in_orders(60 * shaft_hz)
    assert band.low_hz < 3400 < band.high_hz
    assert abs(spectrum.frequency[spectrum.values.argmax()] - order) <= spectrum.resolution
    assert (lines_at(spectrum, order).prominence > 10).all()


def test_each_signal_gets_its_own_band():
    x = np.stack([impacts(30.0, 1100.0), impacts(30.0, 4400.0, seed=1)])[:, None]
    spectrum, bands = impulsive_envelope_spectrum(x, FS_HZ)
    assert spectrum.values.shape[:2] == (2, 1)
    assert bands == most_impulsive_band(x, FS_HZ)
    assert bands[0].low_hz < 1100 < bands[0].high_hz
    assert bands[1].low_hz < 4400 < bands[1].high_hz


def test_lines_and_sidebands_are_read_where_they_are():
    axis = np.arange(0, 20, 0.05)
    values = np.full((2, axis.size), 0.1)
    heights = {5.4: 5.0, 4.4: 2.0, 6.4: 2.5, 10.8: 3.0}
    for order, height in heights.items():
        values[0, round(order / 0.05)] = height
    lines = lines_at(Spectrum(axis, values), 5.4, harmonics=2, sideband_order=1.0, sidebands=1, tolerance=0.005)
    np.testing.assert_allclose(lines.orders, [[4.4, 5.4, 6.4], [9.8, 10.8, 11.8]])
    np.testing.assert_allclose(lines.strengths[0], [[2, 5, 2.5], [0.1, 3, 0.1]])
    np.testing.assert_allclose(lines.strengths[1], 0.1)
    np.testing.assert_allclose(lines.found[0, 0], [4.4, 5.4, 6.4])
    np.testing.assert_allclose(lines.prominence[0], [[20, 50, 25], [1, 30, 1]])


def test_a_slipped_line_is_found_within_the_tolerance_only():
    axis = np.arange(0, 20, 0.05)
    values = np.zeros(axis.size)
    values[108] = 1.0  # order 5.4
    spectrum = Spectrum(axis, values)
    near = lines_at(spectrum, 5.32, harmonics=1, tolerance=0.02)
    assert near.strengths[0, 0] == 1
    assert near.found[0, 0] == pytest.approx(5.4)
    assert near.prominence[0, 0] == np.inf
    far = lines_at(spectrum, 5.2, harmonics=1, tolerance=0.02)
    assert far.strengths[0, 0] == 0
    assert far.prominence[0, 0] == 1


def test_a_neighbouring_sideband_is_not_taken_for_the_line():
    axis = np.arange(0, 50, 0.05)
    values = np.ones(axis.size)
    values[[392, 400]] = 9.0, 5.0  # orders 19.6 and 20: the taller within 2 % of the other
    lines = lines_at(Spectrum(axis, values), 20.0, harmonics=1, sideband_order=0.4, sidebands=1, tolerance=0.02)
    assert lines.strengths[0].tolist() == [9.0, 5.0, 1.0]


def test_sidebands_below_zero_are_not_lines():
    lines = lines_at(Spectrum(np.arange(20.0), np.ones(20)), 2.0, harmonics=1, sideband_order=1.0, sidebands=2)
    assert np.isnan(lines.strengths[0, 0])
    assert np.isfinite(lines.strengths[0, 1:]).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": 0.0}, "order"),
        ({"harmonics": 0}, "harmonics"),
        ({"harmonics": 30}, "outside the spectrum"),
        ({"sidebands": 1}, "sideband_order"),
        ({"sidebands": -1, "sideband_order": 1.0}, "sidebands"),
        ({"tolerance": 0.6}, "tolerance"),
    ],
)
def test_lines_refuse_what_cannot_be(options, message):
    with pytest.raises(TwingapError, match=message):
        lines_at(Spectrum(np.arange(20.0), np.ones(20)), **{"order": 3.0, **options})


@pytest.mark.parametrize("band_hz", [(-1.0, 2.0), (2.0, 2.0), (3.0, 1.0), (0.0, 51.0), (np.nan, 2.0)])
def test_refuses_impossible_bands(band_hz):
    with pytest.raises(TwingapError, match="band"):
        squared_envelope_spectrum(np.ones(50), 100.0, band_hz)


def test_refuses_a_band_between_bins_and_a_band_without_a_rate():
    with pytest.raises(TwingapError, match="holds no bin"):
        demodulate(np.ones(50), 100.0, (10.1, 10.2))
    with pytest.raises(TwingapError, match="fs_hz"):
        envelope(np.ones(50), band_hz=(1.0, 2.0))


@pytest.mark.data
@pytest.mark.parametrize(("number", "fault"), [(105, "inner"), (106, "inner"), (130, "outer"), (234, "outer")])
def test_real_faults_peak_at_their_order(number, fault):
    if "TWINGAP_DATA" not in os.environ:
        pytest.skip("needs the CWRU records under TWINGAP_DATA")
    file = loadmat(Path(os.environ["TWINGAP_DATA"]) / "cwru" / f"{number}.mat")
    speed_rpm = float(file[f"X{number}RPM"].item())
    spectrum = squared_envelope_spectrum(file[f"X{number}_DE_time"].ravel(), FS_HZ).in_orders(speed_rpm)
    order = BEARINGS["6205"].fault_order(fault)
    below = (spectrum.frequency > 0.5) & (spectrum.frequency < 12)
    peak = spectrum.frequency[below][spectrum.values[below].argmax()]
    assert peak == pytest.approx(order, rel=0.02)
    assert (lines_at(spectrum, order, harmonics=3).prominence > 20).all()
