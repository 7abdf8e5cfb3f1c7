"""Power densities that baselines are matched to, between knocks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from twingap.bearing import BEARINGS
from twingap.identification.baseline import _between_impulses, state_spectra
from twingap.records import Condition, Record
from twingap.signal.record_transforms import Frame

FS = 12_000.0
BEARING = BEARINGS["6205"]
FRAME = Frame(BEARING, (0.05 * FS, 0.45 * FS), 1.0)


def record(x: np.ndarray, fault: str = "healthy") -> Record:
    return Record(Condition("r", 1800.0, FS, x.size, fault), x)


def knocks(rng: np.random.Generator, n: int, count: int, level: float) -> np.ndarray:
    out, ring = np.zeros(n), level * np.exp(-np.arange(60) / 12) * np.sin(np.arange(60))
    for at in rng.integers(0, n - 60, count):
        out[at : at + 60] += ring
    return out


def test_a_few_strong_knocks_leave_the_density_of_noise() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(12_000)
    (quiet,), (knocked,) = (
        state_spectra([record(x)], FRAME) for x in (noise, noise + knocks(rng, noise.size, 3, 60.0))
    )
    assert np.mean((noise + knocks(rng, noise.size, 3, 60.0)) ** 2) > 1.5
    np.testing.assert_allclose(np.log(knocked.psd / quiet.psd), 0.0, atol=0.45)
    assert np.log(knocked.psd / quiet.psd).mean() == pytest.approx(0.0, abs=0.03)
    assert knocked.energy == pytest.approx(quiet.energy, rel=0.06)


@pytest.mark.parametrize("fault", ["inner", "ball"])
def test_what_a_defect_does_is_never_left_out(fault: str) -> None:
    """A narrow load zone leaves most of a turn quiet: its strikes are far louder than the rest, and no knocks."""
    rng = np.random.default_rng(1)
    x = rng.standard_normal(12_000)
    for at in range(0, x.size - 60, 3000):
        x[at : at + 60] += 40 * np.exp(-np.arange(60) / 12)
    (side,) = state_spectra([record(x, fault)], FRAME)
    (quiet,) = state_spectra([record(x)], FRAME)
    low, high = (np.array(FRAME.band_hz) / FS * x.size).round().astype(int)
    power = np.abs(np.fft.rfft(x - x.mean())) ** 2 * 2 / x.size**2
    assert side.energy == pytest.approx(power[low:high].sum(), rel=1e-3)
    assert side.energy > 1.5 * quiet.energy


def test_noise_short_records_and_records_that_are_loud_throughout_stay_whole() -> None:
    rng = np.random.default_rng(2)
    found = [_between_impulses(rng.standard_normal(12_000)) for _ in range(40)]
    assert sum(kept is not None for kept in found) <= 3
    assert min((kept.mean() for kept in found if kept is not None), default=1.0) > 0.95
    assert _between_impulses(rng.standard_normal(1000) + knocks(rng, 1000, 1, 60.0)) is None
    swelling = rng.standard_normal(12_000) * np.repeat([1.0, 9.0], 6000)
    assert _between_impulses(swelling) is None
    assert _between_impulses(np.zeros(12_000)) is None


def test_noise_of_a_sharp_mode_has_no_knocks() -> None:
    """Its power swells and fades; what is left out of it would be missing from the noise that is matched."""
    rng = np.random.default_rng(4)
    out = 0
    for _ in range(60):
        x = lfilter([1.0], [1.0, -2 * 0.99 * np.cos(0.7), 0.99**2], rng.standard_normal(25_600))
        kept = _between_impulses(x)
        out += 0 if kept is None else int(np.sum(kept < 0.5))
    assert out / (60 * 25_600) < 1e-3


def test_what_is_kept_goes_over_smoothly() -> None:
    rng = np.random.default_rng(3)
    x = rng.standard_normal(12_000)
    x[6000:6030] += 50.0
    kept = _between_impulses(x)
    assert kept is not None and kept.size == x.size
    assert kept[6015] == pytest.approx(0.0, abs=1e-9)
    assert kept[[0, -1]] == pytest.approx(1.0)
    assert np.abs(np.diff(kept)).max() < 0.05
    assert 0.9 < kept.mean() < 1.0
