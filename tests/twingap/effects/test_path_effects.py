"""Signatures of effects on the path."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, freqs, welch

from twingap.effects import Draft, SecondResonance, SensorRolloff
from twingap.errors import TwingapError


def peak_hz(lab: Any, x: np.ndarray, low_hz: float, high_hz: float) -> float:
    f, power = welch(x, lab.fs_hz, nperseg=2048)
    band = (f > low_hz) & (f < high_hz)
    return float(f[band][np.argmax(power.mean(axis=0)[band])])


@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_second_resonance_stays_at_its_frequency_across_speeds(quiet: Any, fault: str) -> None:
    effect = SecondResonance(frequency_hz=1400.0, damping_ratio=0.02, gain=0.8)
    for speed in (900.0, 1800.0):
        lab = quiet.where(speed_rpm=speed)
        without, with_it = lab.pair(effect, fault)
        assert abs(peak_hz(lab, with_it, 1000, 2000) - 1400) < (20 if fault == "healthy" else 120)
        assert abs(peak_hz(lab, with_it, 2200, 4000) - 3000) < 200, "the first mode is still there"
        power = [welch(x, lab.fs_hz, nperseg=512)[1][0] for x in (without, with_it)]
        at = round(1400 / lab.fs_hz * 512)
        assert power[1][at] > 10 * power[0][at]


def test_second_resonance_makes_no_rotation_lines(lab: Any) -> None:
    with_it = lab.make([SecondResonance(frequency_hz=2500.0)], "healthy", count=4)
    for order in (1.0, lab.bearing.bpfo, lab.bearing.bpfi):
        assert lab.prominence(lab.envelope(with_it), order * lab.fr) < 3


def test_rolloff_is_butterworth_and_the_same_in_all_records(quiet: Any) -> None:
    effect = SensorRolloff(corner_hz=2500.0, order=3)
    b, a = butter(3, 2 * np.pi * 2500.0, analog=True)
    for fault, speed in (("healthy", 1800.0), ("outer", 1800.0), ("inner", 900.0)):
        without, with_it = quiet.where(speed_rpm=speed).pair(effect, fault)
        f = np.fft.rfftfreq(quiet.n_samples, 1 / quiet.fs_hz)
        window = np.hanning(quiet.n_samples)
        spectra = [np.fft.rfft(x[0] * window) for x in (without, with_it)]
        _, expected = freqs(b, a, 2 * np.pi * f)
        strong = (abs(spectra[0]) > 0.01 * abs(spectra[0]).max()) & (f < 5990)
        got = spectra[1][strong] / spectra[0][strong]
        np.testing.assert_allclose(got, expected[strong], atol=0.05)


def test_rolloff_has_settled_when_the_record_begins(quiet: Any) -> None:
    x = quiet.where(n_samples=600).make([SensorRolloff(corner_hz=1500.0, order=2)], "healthy", count=400)
    level = x.std(axis=0)
    assert level[:3].mean() == pytest.approx(level[100:].mean(), rel=0.2)


def test_rolloff_beyond_half_the_rate_costs_little_and_leaves_white_noise(lab: Any) -> None:
    without, with_it = lab.pair(SensorRolloff(corner_hz=50000.0, order=1), "healthy")
    assert np.abs(with_it - without).max() < 0.3
    f, power = welch(lab.pair(SensorRolloff(corner_hz=500.0, order=4), "healthy")[1][0], lab.fs_hz, nperseg=1024)
    white = 2 * (lab.parameters.white_noise_rms**2) / lab.fs_hz
    assert power[f > 1500].mean() == pytest.approx(white, rel=0.1)


@pytest.mark.parametrize("part", [0.25, 0.9, 1.0])
def test_a_sensor_loses_the_background_that_it_hears_and_none_of_the_chain_behind_it(lab: Any, part: float) -> None:
    corner_hz, order = 900.0, 3
    x = lab.make([SensorRolloff(corner_hz=corner_hz, order=order, background=part)], "healthy", count=8)
    f, power = welch(x, lab.fs_hz, nperseg=1024)
    white = 2 * (lab.parameters.white_noise_rms**2) / lab.fs_hz
    loss = 1 / (1 + (f / corner_hz) ** (2 * order))
    quiet_band = (f > 4800) & (f < 5900)  # far above the mode, whose own noise the low-pass has taken
    expected = white * (part * loss + 1 - part)[quiet_band].mean()
    assert power.mean(axis=0)[quiet_band].mean() == pytest.approx(expected, rel=0.12, abs=2e-3 * white)


def test_background_has_settled_when_the_record_begins(lab: Any) -> None:
    x = lab.where(n_samples=600).make([SensorRolloff(corner_hz=400.0, order=2, background=1.0)], "healthy", count=400)
    level = x.std(axis=0)
    assert level[:3].mean() == pytest.approx(level[100:].mean(), rel=0.2)


def test_without_a_heard_background_the_white_noise_is_the_same_sample_by_sample(lab: Any) -> None:
    corner = {"corner_hz": 2500.0, "order": 2}
    one, other = (lab.make([SensorRolloff(**corner, **more)], "healthy") for more in ({}, {"background": 0.0}))
    np.testing.assert_array_equal(one, other)


def test_an_opposed_mode_cancels_where_one_in_phase_adds(quiet: Any) -> None:
    """Below the lower of two modes both move with the force: in phase their motion adds up, opposed it cancels."""
    made = [
        quiet.pair(SecondResonance(frequency_hz=5000.0, damping_ratio=0.03, gain=1.0, opposed=opposed), "outer")[1]
        for opposed in (False, True)
    ]
    f, power = welch(np.array(made)[:, 0], quiet.fs_hz, nperseg=1024)
    below = (f > 300) & (f < 1500)
    assert power[0][below].mean() > 4 * power[1][below].mean()
    peak = (f > 4900) & (f < 5100)
    assert power[0][peak].mean() == pytest.approx(power[1][peak].mean(), rel=0.3)


def test_a_finished_waveform_rings_with_the_first_mode_or_against_it(lab: Any) -> None:
    condition = lab.where(n_samples=1 << 15).conditions("healthy", 1)[0]
    t = np.arange(condition.n_samples) / lab.fs_hz
    x = np.random.default_rng(0).standard_normal(t.size)
    heights = []
    for opposed in (False, True):
        draft = Draft(condition, lab.bearing, 1.0, t, t * lab.fr, excitation="waveform", x=x)
        effect = SecondResonance(frequency_hz=2000.0, damping_ratio=0.05, gain=0.6, opposed=opposed)
        effect.apply(draft, np.random.default_rng(0))
        power = np.abs(np.fft.rfft(draft.filters[0](x)) / np.fft.rfft(x))
        heights.append(float(power[round(2000.0 * t.size / lab.fs_hz)]))
    assert heights == pytest.approx([1.6, 0.4], abs=0.02)


def test_resonance_beyond_half_the_rate_is_refused(lab: Any) -> None:
    with pytest.raises(
        TwingapError, match="second_resonance: 7000 Hz lies above half the sampling rate of record 'r0'"
    ):
        lab.make([SecondResonance(frequency_hz=7000.0)])
