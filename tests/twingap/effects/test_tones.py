"""Lines at fixed frequencies, read off records with noise and with harmonics of the shaft beside them."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.effects._tones import common_levels, hann_lobe
from twingap.effects.mains_interference import MainsInterference
from twingap.records import Condition, Record
from twingap.signal.record_transforms import tone_power, tone_spectrum

FS_HZ = 5120.0
HUM = 0.2


def records(
    rpm: float,
    seconds: float,
    *,
    hum: float = HUM,
    shaft: float = 0.3,
    noise: float = 0.3,
    count: int = 8,
    seed: int = 0,
) -> list[Record]:
    """Hum, twice the shaft's speed, which is known to 0.04 %, and noise that falls with frequency."""
    rng, out = np.random.default_rng(seed), []
    for i in range(count):
        c = Condition(f"r{i}", rpm, FS_HZ, int(FS_HZ * seconds), "healthy")
        t, phases = np.arange(c.n_samples) / FS_HZ, rng.uniform(0, 2 * np.pi, 2)
        falling = np.fft.rfft(rng.standard_normal(t.size))
        falling[1:] /= np.sqrt(np.arange(1, falling.size))
        x = np.fft.irfft(falling, t.size)
        x *= noise / x.std()
        x += hum * np.cos(2 * np.pi * 50 * t + phases[0])
        true_hz = rpm / 60 * (1 + 0.0004 * rng.standard_normal())
        x += shaft * np.cos(2 * np.pi * 2 * true_hz * t + phases[1])
        out.append(Record(c, x))
    return out


def level(own: list[Record]) -> float:
    return float(common_levels(own, np.array([50.0]))[0])


@pytest.mark.parametrize(
    ("rpm", "seconds"), [(1470.0, 2.0), (1530.0, 2.0), (1485.0, 4.0), (1455.0, 1.5), (1800.0, 2.0)]
)
@pytest.mark.parametrize("seed", range(3))
def test_hum_beside_a_line_of_the_shaft_is_read_off_where_records_resolve_both(
    rpm: float, seconds: float, seed: int
) -> None:
    assert level(records(rpm, seconds, seed=seed)) == pytest.approx(HUM, rel=0.15)


@pytest.mark.parametrize("rpm", [1500.0, 1490.0])
def test_where_records_do_not_resolve_them_none_is_read_off_and_the_reason_is_stated(rpm: float) -> None:
    own = records(rpm, 2.0)
    assert level(own) == 0.0
    assert "8 of 8 records" in MainsInterference.not_read_off([r.condition for r in own])
    longer = [Condition("long", 1490.0, FS_HZ, int(8 * FS_HZ), "healthy")] * 3
    assert MainsInterference.not_read_off(longer) == ""


@pytest.mark.parametrize("seconds", [1.5, 2.0, 4.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_strong_line_of_the_shaft_is_no_hum(seconds: float, seed: int) -> None:
    for rpm in (1470.0, 1480.0, 1520.0, 1544.0):
        assert level(records(rpm, seconds, hum=0.0, shaft=2.0, seed=seed)) < 0.05


def test_records_at_several_speeds_help_each_other() -> None:
    """Those that resolve the two decide."""
    own = [*records(1500.0, 1.0, count=5), *records(1700.0, 1.0, count=4, seed=1)]
    assert level(own) == pytest.approx(HUM, rel=0.15)


@pytest.mark.parametrize("seed", range(4))
def test_two_of_four_records_that_keep_clear_of_the_mains_are_enough(seed: int) -> None:
    def four(hum: float) -> list[Record]:
        speeds = enumerate((1500.0, 1500.0, 1650.0, 1710.0))
        return [one for i, rpm in speeds for one in records(rpm, 2.0, hum=hum, count=1, seed=10 * seed + i)]

    found = MainsInterference.read_off(four(HUM), four(0.0))
    assert found["level"] == pytest.approx(HUM, rel=0.15) and found["mains_hz"] == 50.0
    assert MainsInterference.read_off(four(0.0), four(0.0)) == {}
    assert MainsInterference.not_read_off([r.condition for r in four(HUM)]) == ""
    why = MainsInterference.not_read_off([r.condition for r in four(HUM)[:3]])
    assert why.startswith("in 2 of 3 records") and why.endswith("at a speed of which no multiple lies at 50 Hz")


@pytest.mark.parametrize("seed", range(4))
def test_a_hum_that_noise_nearly_hides_is_read_off_many_records(seed: int) -> None:
    own = records(1800.0, 1.0, noise=0.5, shaft=0.0, count=12, seed=seed)
    assert level(own) == pytest.approx(HUM, rel=0.15)
    assert level(records(1800.0, 1.0, hum=0.0, noise=0.5, count=12, seed=seed)) == 0.0


def test_the_lobe_of_a_line_is_that_of_the_window() -> None:
    n, place, bins = 4096, 50.3, np.arange(46, 56)
    x = np.cos(2 * np.pi * place * np.arange(n) / n + 0.7)
    spectrum = tone_spectrum(x)
    np.testing.assert_allclose(np.abs(spectrum) ** 2, tone_power(x), atol=1e-12)
    line = np.sqrt(0.5) * np.exp(0.7j)
    np.testing.assert_allclose(spectrum[bins], line * hann_lobe(bins - place), atol=5e-3)
