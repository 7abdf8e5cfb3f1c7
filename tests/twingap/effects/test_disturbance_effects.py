"""Signatures of disturbances: what is added is seen alone, since adding an effect leaves all other draws untouched."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch
from scipy.stats import kurtosis

from twingap.effects import (
    ColouredNoise,
    DriveInterference,
    ForeignBearing,
    GearMesh,
    ImpulsiveNoise,
    Looseness,
    MainsInterference,
    MeanSlip,
    ShaftHarmonics,
    SpeedFluctuation,
    Waviness,
    catalogue,
    make_effect,
)
from twingap.effects.base import Stage
from twingap.errors import TwingapError

DISTURBANCES = [name for name, kind in catalogue().items() if kind.stage is Stage.DISTURBANCE]
TONAL = ["shaft_harmonics", "looseness", "mains_interference", "drive_interference", "gear_mesh", "waviness"]


def lines_of(lab: Any, x: np.ndarray, part: float = 0.02) -> np.ndarray:
    """Frequencies (Hz) of all spectral peaks above a part of the largest."""
    spectrum = np.abs(np.fft.rfft(x[0] * np.blackman(x.shape[-1])))
    inner = spectrum[1:-1]
    top = (inner > spectrum[:-2]) & (inner >= spectrum[2:]) & (inner > part * spectrum.max())
    return (1 + np.flatnonzero(top)) * lab.fs_hz / x.shape[-1]


@pytest.mark.parametrize("name", DISTURBANCES)
def test_adds_the_same_whatever_else_is_modelled(lab: Any, name: str) -> None:
    lab = lab.where(n_samples=3000)
    alone = lab.added(name, "healthy")
    for others in (["slip_jitter"], [other for other in DISTURBANCES if other != name]):
        beside = lab.make([*others, name], "outer") - lab.make(others, "outer")
        np.testing.assert_allclose(beside, alone, atol=1e-10)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_levels_are_multiples_of_the_healthy_rms(lab: Any, name: str) -> None:
    from dataclasses import replace

    lab = lab.where(n_samples=3000)
    larger = lab.where(parameters=replace(lab.parameters, scale=10.0))
    np.testing.assert_allclose(larger.added(name), 10 * lab.added(name), rtol=1e-6, atol=1e-9)
    assert np.abs(lab.where(n_samples=24000).added(name)).max() > 0


@pytest.mark.parametrize("name", TONAL)
def test_tones_stay_out_of_the_envelope_lines_of_faults(lab: Any, name: str) -> None:
    with_it = lab.envelope(lab.make([name], "healthy", count=2))
    for order in (lab.bearing.bpfo, lab.bearing.bpfi, 2 * lab.bearing.bsf):
        assert lab.prominence(with_it, order * lab.fr) < 4


def test_shaft_harmonics_are_three_tones_that_survive_synchronous_averaging(lab: Any) -> None:
    lab = lab.where(speed_rpm=1500.0)  # 480 samples a turn
    x = lab.added(ShaftHarmonics(level_1x=0.5, level_2x=0.3, level_3x=0.2))
    np.testing.assert_allclose(lines_of(lab, x), [25, 50, 75])
    np.testing.assert_allclose([lab.line(x, f) for f in (25, 50, 75)], [0.5, 0.3, 0.2], rtol=1e-3)
    average = x.reshape(-1, 480).mean(axis=0)
    np.testing.assert_allclose(np.tile(average, 100), x[0], atol=1e-9)
    assert lab.prominence(lab.envelope(lab.make([ShaftHarmonics()], "healthy")), 25.0) < 4


def test_looseness_has_half_orders_and_shaft_harmonics_have_none(lab: Any) -> None:
    effect = Looseness(level=0.4, decay=0.9, half_ratio=0.5, n_orders=6)
    x = lab.added(effect)
    np.testing.assert_allclose(lines_of(lab, x), lab.fr * np.arange(0.5, 6.5, 0.5))
    assert lab.line(x, 2.5 * lab.fr) == pytest.approx(0.4 * 0.9**1.5 * 0.5, rel=1e-3)
    assert lab.line(x, 3.0 * lab.fr) == pytest.approx(0.4 * 0.9**2, rel=1e-3)
    assert lab.line(lab.added(ShaftHarmonics()), 2.5 * lab.fr) < 1e-6


@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
def test_mains_stays_in_hz_and_has_no_width(lab: Any, mains_hz: float) -> None:
    effect = MainsInterference(mains_hz=mains_hz, n_harmonics=4)
    for speed in (1800.0, 1130.0):
        x = lab.where(speed_rpm=speed).added(effect)
        np.testing.assert_allclose(lines_of(lab, x), mains_hz * np.arange(1, 5))
    wandering = [SpeedFluctuation(level=0.05)]
    x = lab.make([*wandering, effect], "healthy") - lab.make(wandering, "healthy")
    assert lab.line(x, mains_hz) == pytest.approx(0.5, rel=1e-3)


def test_drive_has_a_fixed_carrier_with_a_pair_of_lines_tied_to_speed(lab: Any) -> None:
    effect = DriveInterference(carrier_hz=4000.0, sideband_order=3.0, depth=0.8)
    for speed in (1800.0, 1200.0):
        x = lab.where(speed_rpm=speed).added(effect)
        side = 3 * speed / 60
        np.testing.assert_allclose(lines_of(lab, x), [4000 - side, 4000, 4000 + side])
        assert lab.line(x, 4000 + side) == pytest.approx(0.4 * lab.line(x, 4000.0), rel=1e-3)


def test_gear_mesh_sits_at_whole_orders_with_shaft_sidebands(lab: Any) -> None:
    lab = lab.where(speed_rpm=1500.0)
    x = lab.added(GearMesh(teeth=31, depth=0.5, n_harmonics=3))
    expected = sorted(31 * k + side for k in (1, 2, 3) for side in (-1, 0, 1))
    np.testing.assert_allclose(lines_of(lab, x) / 25, expected)
    np.testing.assert_allclose(np.tile(x[0, :480], 100), x[0], atol=1e-9)  # a comb of first order: every turn is alike
    high = lab.added(GearMesh(teeth=100, n_harmonics=6))  # 2500, 5000, then above 6000 Hz
    np.testing.assert_allclose(lines_of(lab, high) / 25, [99, 100, 101, 199, 200, 201])


def test_a_search_begins_at_the_teeth_that_either_half_of_the_records_shows() -> None:
    """The median over records that show a mesh or its double lies between them."""
    shown = {"all": 54.0, "healthy": 36.0, "faulty": 72.0}
    features = {f"lines.gear_teeth|{of}.level": teeth for of, teeth in shown.items()}
    seen = SimpleNamespace(features=features | {"pooled|gear_teeth": math.log(36)})
    assert [one.teeth for one in GearMesh(teeth=54, level=0.3).initial_values(seen)] == [36, 72]  # type: ignore[arg-type]
    nothing = SimpleNamespace(features=dict.fromkeys(seen.features, math.nan))
    assert list(GearMesh().initial_values(nothing)) == []  # type: ignore[arg-type]


def test_foreign_bearing_draws_envelope_lines_at_its_own_order(lab: Any) -> None:
    effect = ForeignBearing(order=4.37, resonance_hz=2600.0)
    without, with_it = (lab.envelope(x) for x in lab.pair(effect, "healthy", count=2))
    for n in (1, 2, 3):
        assert lab.prominence(with_it, n * 4.37 * lab.fr) > 15
        assert lab.prominence(without, n * 4.37 * lab.fr) < 4
    for order in (lab.bearing.bpfo, lab.bearing.bpfi, 1.0, 4.0):
        assert lab.prominence(with_it, order * lab.fr) < 4
    assert np.abs(lab.added(effect)).max() == pytest.approx(5.0, rel=0.15), "the level is an impact's response"


def test_slip_of_a_foreign_bearing_smears_its_high_harmonics(lab: Any) -> None:
    """Deviations accumulate, as those of slipping rollers do: the higher a line, the more height it loses."""
    heights = []
    for sigma in (0.0, 0.01):
        effect = ForeignBearing(level=10.0, order=4.37, resonance_hz=2600.0, sigma=sigma)
        _, x = lab.pair(effect, "healthy", count=4)
        heights.append([lab.prominence(lab.envelope(x), n * 4.37 * lab.fr) for n in (1, 3, 6)])
    lost = np.array(heights[0]) / heights[1]
    assert lost[0] < 4
    assert lost[1] > 1.5 * lost[0]
    assert lost[2] > 1.5 * lost[1]


@pytest.mark.parametrize(
    ("slope", "low_hz", "high_hz"), [(0.0, 20, 2e4), (1.0, 20, 2e4), (2.0, 50, 2e4), (0.0, 800, 1500)]
)
def test_coloured_noise_has_its_slope_its_band_and_a_flat_envelope(
    lab: Any, slope: float, low_hz: float, high_hz: float
) -> None:
    x = lab.added(ColouredNoise(level=2.0, slope=slope, low_hz=low_hz, high_hz=high_hz), count=6)
    assert x.std() == pytest.approx(2.0, rel=0.05)
    f, power = welch(x, lab.fs_hz, nperseg=2048)
    inside = (f > low_hz + 40) & (f < min(high_hz - 40, 5800))
    fitted = np.polyfit(np.log(f[inside]), np.log(power.mean(axis=0)[inside]), 1)[0]
    assert fitted == pytest.approx(-slope, abs=0.15)
    assert power.mean(axis=0)[(f > 1.2 * high_hz) | (f < 0.7 * low_hz - 20)].sum() < 1e-3 * power.mean(axis=0).sum()
    assert abs(kurtosis(x.ravel())) < 0.3
    envelope = lab.envelope(x, 1.2 * low_hz, min(high_hz, 4000))
    for order in (1.0, lab.bearing.bpfo, lab.bearing.bpfi):
        assert lab.prominence(envelope, order * lab.fr) < 3
    power_in_time = (x.reshape(-1, 1000) ** 2).mean(axis=1)
    assert power_in_time.max() < 20 * power_in_time.mean(), "stationary"


def test_impulsive_noise_has_high_kurtosis_and_no_envelope_lines(lab: Any) -> None:
    effect = ImpulsiveNoise(level=30.0, rate_hz=5.0, resonance_hz=2500.0)
    without, with_it = lab.pair(effect, "healthy", count=6)
    assert kurtosis(without.ravel()) < 0.3 < 10 < kurtosis(with_it.ravel())
    envelope = lab.envelope(with_it)
    for order in (1.0, lab.bearing.bpfo, lab.bearing.bpfi, lab.bearing.ftf):
        assert lab.prominence(envelope, order * lab.fr) < 4
    loud = np.abs(lab.where(n_samples=1_200_000).added(ImpulsiveNoise(level=1.0, rate_hz=5.0, damping_ratio=0.1))[0])
    quiet_before = np.convolve(loud, np.ones(40), "full")[: loud.size] - loud
    begins = np.flatnonzero((loud > 1e-3) & (quiet_before < 1e-3))
    assert 0.75 * 500 < begins.size < 1.15 * 500, "5 a second for 100 s"
    peaks = np.array([loud[begin : begin + 60].max() for begin in begins])
    assert peaks.mean() == pytest.approx(0.86, rel=0.15), "the level is the mean; the mode's first peak is at 0.86"
    gaps = np.diff(begins) / lab.fs_hz
    assert gaps.std() == pytest.approx(gaps.mean(), rel=0.15), "waiting times without memory"


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0])
def test_impulses_are_as_even_as_their_spread_says(spread: float) -> None:
    drawn = ImpulsiveNoise(spread=spread)._strengths(200_000, np.random.default_rng(0))
    assert np.abs(drawn).mean() == pytest.approx(1.0, rel=0.01)
    assert np.abs(drawn).std() == pytest.approx(spread, abs=0.01)
    assert np.mean(drawn > 0) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("slip", [0.0, 0.02])
def test_waviness_draws_lines_in_the_raw_spectrum_and_none_in_the_envelope(lab: Any, slip: float) -> None:
    cage = [MeanSlip(slip=slip)]
    with_it, without = lab.make([*cage, Waviness()], "healthy", 2), lab.make(cage, "healthy", 2)
    order = lab.bearing.bpfo * (1 - slip)
    for n in (1, 2, 3, 4):
        assert lab.line(with_it - without, n * order * lab.fr) == pytest.approx(0.5 * 0.6 ** (n - 1), rel=0.02)
        assert lab.prominence(lab.envelope(with_it), n * order * lab.fr) < 4
    inner = lab.added(Waviness(inner=True))
    assert lab.line(inner, lab.bearing.bpfi * lab.fr) == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("name", ["shaft_harmonics", "looseness", "gear_mesh", "waviness", "foreign_bearing"])
def test_what_is_tied_to_the_shaft_follows_its_fluctuation(lab: Any, name: str) -> None:
    wandering = [SpeedFluctuation(level=0.05)]
    steady = np.abs(np.fft.rfft(lab.added(name)[0])).max()
    smeared = np.abs(np.fft.rfft((lab.make([*wandering, name], "healthy") - lab.make(wandering, "healthy"))[0])).max()
    assert smeared < 0.9 * steady


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("drive_interference", {"carrier_hz": 5990.0}),
        ("gear_mesh", {"teeth": 300}),
        ("foreign_bearing", {"resonance_hz": 6000.0}),
        ("impulsive_noise", {"resonance_hz": 9000.0}),
        ("coloured_noise", {"low_hz": 6000.0}),
    ],
)
def test_what_the_sampling_rate_cannot_show_is_refused(lab: Any, name: str, parameters: dict[str, float]) -> None:
    with pytest.raises(TwingapError, match=f"effect {name}: .* lies above half the sampling rate"):
        lab.make([make_effect(name, parameters)], "healthy")


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.0])
def test_coloured_noise_does_not_repeat_with_the_record(lab: Any, slope: float) -> None:
    """Start and end are as far apart as they are in time, however short the record."""
    noise = ColouredNoise(level=1.0, slope=slope, low_hz=40.0, high_hz=2000.0)
    x = lab.where(n_samples=600).added(noise, count=800)
    scale = np.sqrt(np.mean(x[:, 0] ** 2) * np.mean(x[:, -1] ** 2))
    assert abs(np.mean(x[:, 0] * x[:, -1])) / scale < 0.15
    level = np.sqrt(np.mean(x**2, axis=0))
    assert level[:5].mean() == pytest.approx(level.mean(), rel=0.1)


def test_looseness_impulses_once_every_two_turns(lab: Any) -> None:
    """All orders in phase at one angle: there, and nowhere else within two turns, amplitudes add up."""
    effect = Looseness(level=0.5, decay=0.9, half_ratio=0.8, n_orders=8)
    whole, half = np.arange(1, 9), np.arange(0.5, 8)
    together = 0.5 * ((0.9 ** (whole - 1)).sum() + 0.8 * (0.9 ** (half - 1)).sum())
    x = lab.where(speed_rpm=600.0, n_samples=24000).added(effect)[0] / lab.parameters.reference_rms
    tops = np.flatnonzero(x > 0.97 * together)
    assert x.max() == pytest.approx(together, rel=0.01)
    assert np.unique(tops // 40).size <= 2 * 10, "ten impulses in 20 turns"
    assert np.diff(tops)[np.diff(tops) > 100] == pytest.approx(2400, abs=20)


def test_half_order_of_looseness_is_finite_whatever_the_decay() -> None:
    """It lies before order 1: a decay of nothing would make it infinite."""
    with pytest.raises(TwingapError, match="decay"):
        Looseness(decay=0.0)
    assert np.isfinite(Looseness(decay=0.05).levels).all()


def test_looseness_out_of_phase_has_the_same_lines_and_no_impulses(lab: Any) -> None:
    where = lab.where(speed_rpm=600.0, n_samples=24000)
    lines, tops = [], []
    for in_phase in (True, False):
        x = where.added(Looseness(level=0.5, decay=0.9, half_ratio=0.8, n_orders=8, in_phase=in_phase))[0]
        lines.append(np.abs(np.fft.rfft(x)))
        tops.append(np.abs(x).max())
    np.testing.assert_allclose(lines[0], lines[1], atol=1e-6 * lines[0].max())
    assert tops[1] < 0.85 * tops[0]
