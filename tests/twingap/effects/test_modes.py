"""What rings at a record's start: as if machine and noise had always run, and nothing of the record's own end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import welch

from twingap.bearing import BEARINGS
from twingap.effects import DistributedRoughness, SensorRolloff, SpeedGain
from twingap.effects.modes import PAST, Mode, modal_response, response_rms
from twingap.records import Condition
from twingap.twins.base import Twin
from twingap.twins.contact import PRESETS, ContactTwin
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Array = NDArray[np.float64]
FS_HZ = 12000.0
SHARP = Mode(1500.0, 0.004)


def stirred(modes: list[Mode], n: int, count: int, seed: int = 0) -> Array:
    """Responses [count, n] to white noise that has always acted."""
    rng = np.random.default_rng(seed)
    draw = rng.standard_normal
    return np.stack([modal_response(modes, FS_HZ, n, force=draw(n), past=draw(PAST)) for _ in range(count)])


@pytest.mark.parametrize(
    "modes",
    [[SHARP], [SHARP, Mode(2100.0, 0.05, 0.7)], [SHARP, SHARP], [Mode(5990.0, 0.5), Mode(300.0, 0.01, -2.0), SHARP]],
    ids=["sharp", "two", "equal", "three"],
)
def test_noise_is_stationary_from_the_first_sample(modes: list[Mode]) -> None:
    """Covariances of neighbours at the start are those of a response to a force that began long before."""
    count, n = 6000, 8
    x = stirred(modes, n, count)
    rng = np.random.default_rng(1)
    long = modal_response(modes, FS_HZ, 1_200_000, force=rng.standard_normal(1_200_000))[200_000:]
    expected = [np.mean(long[: long.size - lag] * long[lag:]) for lag in range(n)]
    assert expected[0] == pytest.approx(response_rms(modes, FS_HZ) ** 2, rel=0.05)
    for at in (0, 1):
        found = [np.mean(x[:, at] * x[:, at + lag]) for lag in range(n - 1)]
        np.testing.assert_allclose(found, expected[: n - 1], atol=float(0.08 * expected[0]))


@pytest.mark.parametrize(
    "modes",
    [[Mode(600.0, 0.1)], [Mode(3200.0, 0.012)], [Mode(5600.0, 0.03)], [Mode(900.0, 0.03), Mode(3100.0, 0.02, 0.7)]],
    ids=["low", "middle", "high", "two"],
)
def test_noise_has_the_spectrum_of_a_force_that_acts_all_the_time(modes: list[Mode]) -> None:
    """The power of the continuous response at a frequency and at all its aliases, from the Laplace transform of h."""
    x = stirred(modes, 1 << 16, 16)
    f, found = welch(x, FS_HZ, nperseg=512)
    s = 2j * np.pi * (f[:, None] + FS_HZ * np.arange(-100, 101))
    through = sum(m.gain * m.pole.imag / ((s - m.pole) * (s - m.pole.conjugate())) for m in modes)
    expected = 2 * FS_HZ * (np.abs(through) ** 2).sum(axis=1)
    inside = slice(8, -8)  # leakage of a sharp mode into what its neighbours hold
    off = 10 * np.log10(found.mean(axis=0) / expected)[inside]
    assert np.abs(off).max() < (0.6 if len(modes) == 1 else 1.2)
    assert np.abs(off).mean() < 0.25


def test_the_record_does_not_know_its_own_end() -> None:
    """Correlation of start and end is what is left of a mode's ringing: nothing, after 0.34 s."""
    x = stirred([SHARP], 4096, 1500)
    for start in (0, 1, 2):
        for end in (-1, -2, -3):
            assert abs(np.corrcoef(x[:, start], x[:, end])[0, 1]) < 4 / np.sqrt(1500)


def test_sharp_mode_in_a_short_record_has_its_expected_spectrum() -> None:
    """43 ms of a mode that rings for longer than that: periodogram at the peak, leakage included, within sampling."""
    n, count = 516, 4000
    x = stirred([SHARP], n, count) / response_rms([SHARP], FS_HZ)
    at = 1500 + np.array([-40.0, 0.0, 40.0])
    power = np.abs(x @ np.exp(-2j * np.pi * at[None] / FS_HZ * np.arange(n)[:, None])) ** 2
    # The autocovariance by hand, from h and what came before: sum over m of h[m] h[m + lag].
    w, m = 2 * np.pi * 1500, np.arange(20_000) / FS_HZ
    h = np.exp(-0.004 * w * m) * np.sin(np.sqrt(1 - 0.004**2) * w * m)
    covariance = np.array([h[: h.size - lag] @ h[lag:] for lag in range(n)]) / (h @ h)
    cosines = np.cos(2 * np.pi * at[:, None] / FS_HZ * np.arange(n))
    weights = (n - np.arange(n)) * covariance
    expected = 2 * cosines @ weights - weights[0]
    np.testing.assert_allclose(power.mean(axis=0), expected, atol=4 * power.std(axis=0).max() / np.sqrt(count))


def _phenomenological(*effects: object) -> Twin:
    slow = PhenomenologicalParameters(400.0, 0.03, {}, structure_noise_rms=1.0, white_noise_rms=0.0)
    return PhenomenologicalTwin(BEARINGS["6205"], slow, effects)  # type: ignore[arg-type]


def _contact(*effects: object) -> Twin:
    soft = replace(PRESETS["physical"], stiffness=2e8, damping=40.0, structure_noise_rms=1000.0, white_noise_rms=0.0)
    return ContactTwin(BEARINGS["6205"], soft, effects)  # type: ignore[arg-type]


@pytest.mark.parametrize("make", [_phenomenological, _contact])
@pytest.mark.parametrize(
    "effects",
    [
        (),
        (DistributedRoughness(level=2.0),),
        (SpeedGain(exponent=2.0, reference_speed_rpm=600.0), DistributedRoughness(level=2.0)),
        (SensorRolloff(corner_hz=200.0, order=3),),
    ],
    ids=["structure_noise", "roughness", "speed_gain", "rolloff"],
)
def test_records_of_a_twin_are_as_strong_at_their_start_as_later(make: object, effects: tuple[object, ...]) -> None:
    twin = make(*effects)  # type: ignore[operator]
    conditions = [Condition(f"{i}", 1800.0, 8000.0, 400, "healthy") for i in range(1200)]
    x = np.stack([record.samples for record in twin.stream(conditions, np.random.default_rng(0))])
    level = np.sqrt((x**2).mean(axis=0))
    assert level[:12].mean() == pytest.approx(level.mean(), rel=0.06)
    assert level[-12:].mean() == pytest.approx(level.mean(), rel=0.06)
    assert abs(np.corrcoef(x[:, 0], x[:, -1])[0, 1]) < 0.2
