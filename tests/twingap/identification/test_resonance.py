"""Resonance, damping and noise levels from healthy spectra."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import fftconvolve, lfilter

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification import equation_8, spectra, whittle
from twingap.identification.mode import autocorrelation, impulse_energy
from twingap.identification.resonance import Fixed
from twingap.records import Condition, Record, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin


def record_set(*samples: np.ndarray, fs_hz: float = 12000.0, fault: str = "healthy") -> RecordSet:
    records = [Record(Condition(f"r{i}", 1797.0, fs_hz, x.size, fault), x) for i, x in enumerate(samples)]
    return RecordSet.from_records("set", "g", BEARINGS["6205"], records)


def healthy(own: PhenomenologicalParameters, seed: int, *, fs_hz: float, count: int, samples: int) -> RecordSet:
    conditions = [Condition(f"r{i}", 1797.0, fs_hz, samples, "healthy") for i in range(count)]
    return PhenomenologicalTwin(BEARINGS["6205"], own).simulate(conditions, np.random.default_rng(seed))


@given(st.floats(300, 5500), st.floats(0.005, 0.4))
@settings(max_examples=12, deadline=None)
def test_autocorrelation_is_that_of_the_sampled_response(frequency_hz: float, damping: float) -> None:
    """Against the integral over the impulse response itself, lag by lag."""
    fs_hz, lags, fine = 12000.0, 40, 64
    w = 2 * np.pi * frequency_hz
    t = np.arange(12_000 * fine) / (fine * fs_hz)
    h = np.exp(-damping * w * t) * np.sin(np.sqrt(1 - damping**2) * w * t)
    direct = np.array([h[: h.size - k * fine] @ h[k * fine :] for k in range(lags)]) / fine
    assert autocorrelation(frequency_hz, damping, fs_hz, lags) == pytest.approx(direct / direct[0], abs=2e-4)
    assert impulse_energy(frequency_hz, damping, fs_hz) == pytest.approx(direct[0], rel=2e-3)


def test_expected_spectrum_is_the_mean_of_the_estimator() -> None:
    """A sharp mode, short segments: leakage and resolution are in the expectation."""
    own = PhenomenologicalParameters(1500.0, 0.004, structure_noise_rms=0.8, white_noise_rms=0.6)
    (s,) = spectra(healthy(own, 1, fs_hz=12000.0, count=300, samples=2048), segment_s=0.02)
    assert s.segment == 256
    acf = 0.64 * autocorrelation(1500.0, 0.004, 12000.0, s.segment)
    acf[0] += 0.36
    ratio = s.mean(lines=True)[0][s.usable] / s.expected(acf)[s.usable]
    assert abs(np.log(ratio).mean()) < 0.01
    assert np.abs(ratio - 1).max() < 0.25


SETTINGS = [
    # fs_hz, resonance_hz, damping, structure, records, samples: tolerances follow from what the records hold
    (12000.0, 3400.0, 0.05, 0.8, 8, 12000),
    (12000.0, 1000.0, 0.01, 0.5, 8, 8192),
    (48000.0, 3000.0, 0.10, 0.9, 4, 24000),
    (25600.0, 8000.0, 0.03, 0.3, 20, 5120),
    (12000.0, 3400.0, 0.004, 0.5, 8, 12000),
    (12000.0, 3000.0, 0.25, 0.9, 8, 12000),
]


@pytest.mark.parametrize(("fs_hz", "resonance_hz", "damping", "structure", "count", "samples"), SETTINGS)
def test_whittle_recovers_what_was_simulated(
    fs_hz: float, resonance_hz: float, damping: float, structure: float, count: int, samples: int
) -> None:
    white = np.sqrt(1 - structure**2)
    own = PhenomenologicalParameters(
        resonance_hz, damping, structure_noise_rms=structure, white_noise_rms=white, scale=0.03
    )
    fit = whittle(spectra(healthy(own, 5, fs_hz=fs_hz, count=count, samples=samples)))
    assert fit.stands_out and fit.misfit < 1.5
    assert fit.resonance_hz == pytest.approx(resonance_hz, rel=max(0.003, damping / 8))
    assert fit.damping_ratio == pytest.approx(damping, rel=0.2)
    assert fit.structure_noise_rms == pytest.approx(0.03 * structure, rel=0.08)
    assert fit.white_noise_rms == pytest.approx(0.03 * white, rel=0.08)


def test_records_at_two_rates_are_fitted_together() -> None:
    own = PhenomenologicalParameters(3400.0, 0.05)
    conditions = [
        Condition(f"r{i}", 1797.0, fs, n, "healthy") for i, (fs, n) in enumerate([(12000.0, 6000), (25600.0, 9000)] * 3)
    ]
    fit = whittle(spectra(PhenomenologicalTwin(BEARINGS["6205"], own).simulate(conditions, np.random.default_rng(3))))
    assert fit.resonance_hz == pytest.approx(3400, rel=0.01)
    assert fit.damping_ratio == pytest.approx(0.05, rel=0.2)


def test_lines_do_not_draw_the_fit() -> None:
    """Shaft harmonics and mains a hundred times the noise's spectrum, at speeds that differ between records."""
    own = PhenomenologicalParameters(3400.0, 0.05)
    plain = healthy(own, 7, fs_hz=12000.0, count=6, samples=12000)
    t = np.arange(12000) / 12000
    rng = np.random.default_rng(0)
    noisy = []
    for record in plain:
        shaft = 29.9 * (1 + 0.01 * rng.standard_normal())
        tones = sum(2.0 * np.sin(2 * np.pi * k * shaft * t + rng.uniform(0, 6)) for k in (1, 2, 3, 30, 31))
        noisy.append(record.samples + tones + np.sin(2 * np.pi * 50 * t))
    fit = whittle(spectra(record_set(*noisy)))
    assert fit.resonance_hz == pytest.approx(3400, rel=0.01)
    assert fit.damping_ratio == pytest.approx(0.05, rel=0.15)
    assert fit.white_noise_rms == pytest.approx(0.6, rel=0.05)


def test_what_is_fixed_stays_fixed() -> None:
    records = spectra(healthy(PhenomenologicalParameters(), 2, fs_hz=12000.0, count=4, samples=6000))
    fit = whittle(records, fixed=Fixed(resonance_hz=3380.0, white_noise_rms=0.58))
    assert fit.resonance_hz == pytest.approx(3380.0) and fit.white_noise_rms == pytest.approx(0.58)
    assert abs(fit.damping_ratio - 0.05) < 0.02


def test_white_noise_alone_shows_no_mode() -> None:
    rng = np.random.default_rng(0)
    found = [whittle(spectra(record_set(*rng.standard_normal((4, 2048))))).stands_out for _ in range(6)]
    assert sum(found) == 0


def test_another_spectrum_is_seen_as_misfit() -> None:
    """Two modes far apart are not one."""
    rng = np.random.default_rng(0)
    samples = []
    for _ in range(6):
        x = rng.standard_normal(12000) * 0.05
        for f in (1200.0, 4200.0):
            pole = np.exp((-0.03 + 1j) * 2 * np.pi * f / 12000)
            x = x + lfilter([1.0], [1, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(12000))
        samples.append(x)
    assert whittle(spectra(record_set(*samples))).misfit > 4


@pytest.mark.parametrize("damping", [0.004, 0.01, 0.03, 0.08])
def test_equation_8_reads_a_known_decay(damping: float) -> None:
    """Single impact responses, as in the paper: rare impacts on a mode, little noise."""
    fs_hz, resonance_hz = 25600.0, 3000.0
    rng = np.random.default_rng(1)
    samples = []
    for _ in range(12):
        w = 2 * np.pi * resonance_hz / fs_hz
        t = np.arange(25600)
        h = np.exp(-damping * w * t) * np.sin(np.sqrt(1 - damping**2) * w * t)
        hits = np.zeros(25600)
        hits[rng.integers(0, 25600, 100)] = rng.standard_normal(100)
        samples.append(fftconvolve(hits, h)[:25600] + 1e-3 * rng.standard_normal(25600))
    fit = equation_8(spectra(record_set(*samples, fs_hz=fs_hz)))
    assert fit.resonance_hz == pytest.approx(resonance_hz, rel=0.02)
    assert fit.damping_ratio == pytest.approx(damping, rel=0.25)


@pytest.mark.parametrize(
    ("samples", "says"),
    [
        (np.zeros(4096), "all samples are equal"),
        (np.ones(10), "10 samples found, at least 64"),
        (np.r_[np.random.default_rng(0).standard_normal(200), np.nan], "not a finite number"),
    ],
)
def test_records_without_a_spectrum(samples: np.ndarray, says: str) -> None:
    with pytest.raises(TwingapError, match=says):
        spectra(record_set(samples))
