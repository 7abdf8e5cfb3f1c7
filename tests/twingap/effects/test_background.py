"""Impacts and background of finished waveforms, told apart by what healthy records hold."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from twingap import Record
from twingap.effects import (
    DamageGrowth,
    EntryExit,
    ImpactScatter,
    LoadZone,
    MeanSlip,
    SlipJitter,
    SpeedGain,
    apply_to_waveform,
)
from twingap.effects.background import Background, amplified, passes_of
from twingap.streams import Streams


def background_of(lab: Any) -> Background:
    found = Background.of(list(lab.make([], "healthy", 6)))
    assert found is not None
    return found


def done(lab: Any, x: np.ndarray, effect: Any, background: Background | None, fault: str = "outer") -> np.ndarray:
    (condition,) = lab.conditions(fault, 1, 500.0)
    passes = np.arange(x.size) / lab.fs_hz * lab.fr * lab.bearing.bpfo
    still = None if background is None else x - background.impacts(x, passes)
    return apply_to_waveform([effect], Record(condition, x), lab.bearing, 1.0, Streams(7, 0), still).samples


def between_and_at(lab: Any, x: np.ndarray, fault: str = "outer") -> tuple[float, float]:
    """Power where nothing rings, and where impacts do, from quantiles of short stretches."""
    power = (x[: x.size // 24 * 24].reshape(-1, 24) ** 2).mean(axis=1)
    return float(np.quantile(power, 0.2)), float(np.quantile(power, 0.97))


@pytest.mark.parametrize(
    "effect",
    [DamageGrowth(rate_per_s=2e-3), SpeedGain(exponent=1.6, reference_speed_rpm=900.0, on_noise=0.0)],
)
def test_impacts_grow_and_the_noise_between_them_stays(lab: Any, effect: Any) -> None:
    x = lab.make([], "outer", time_s=500.0)[0]
    whole, separated = done(lab, x, effect, None), done(lab, x, effect, background_of(lab))
    np.testing.assert_allclose(whole, whole[0] / x[0] * x, rtol=1e-9)
    after, before = between_and_at(lab, separated), between_and_at(lab, x)
    gain = (whole[0] / x[0]) ** 2
    assert after[0] / before[0] < 0.3 * gain
    assert after[1] / before[1] > 0.6 * gain


@pytest.mark.parametrize("factor", [0.4, 0.7, 2.5])
def test_powers_of_stronger_impacts_and_of_noise_add(lab: Any, factor: float) -> None:
    """As of the machine whose impacts are so strong; amplitudes of parts of one waveform would not."""
    weak = replace(lab.parameters, impact_amplitude={"outer": 3.0})
    x = lab.where(parameters=weak).make([], "outer", 6)
    other = lab.where(parameters=replace(weak, impact_amplitude={"outer": 3.0 * factor}), seed=8).make([], "outer", 6)
    passes = np.arange(x.shape[1]) / lab.fs_hz * lab.fr * lab.bearing.bpfo
    background = background_of(lab)
    impacts = np.stack([background.impacts(one, passes) for one in x])
    made = np.stack([amplified(*pair, factor) for pair in zip(x, impacts, strict=True)])
    spectra = [welch(y, nperseg=64)[1].mean(axis=0)[2:-2] for y in (made, x + (factor - 1) * impacts, other)]
    off = [np.abs(10 * np.log10(power / spectra[2])).mean() for power in spectra[:2]]
    assert off[0] < 0.3
    assert off[0] < 0.6 * off[1]
    np.testing.assert_allclose(amplified(x[0], impacts[0], 1.0), x[0], atol=1e-9)


def test_a_second_impact_does_not_double_the_noise(lab: Any) -> None:
    x = lab.make([], "outer")[0]
    effect = EntryExit(arc_deg=6.0, exit_ratio=1.0)
    quiet = background_of(lab)
    before = between_and_at(lab, x)[0]
    assert between_and_at(lab, done(lab, x, effect, None))[0] > 1.6 * before
    assert between_and_at(lab, done(lab, x, effect, quiet))[0] < 1.35 * before


def test_passes_are_found_where_impacts_are_whatever_the_cage_does(quiet: Any) -> None:
    for slip in (0.0, 0.02):
        x = quiet.make([MeanSlip(slip=slip)], "outer")[0]
        passes = np.arange(x.size) / quiet.fs_hz * quiet.fr * quiet.bearing.bpfo
        found = passes_of(x, passes)
        assert found is not None
        rate, begin = found
        assert rate == pytest.approx(1 - slip, rel=1.5e-3)
        off = (passes[np.argmax(np.abs(x[:6000]))] * rate - begin) % 1.0
        assert off > 0.7 or off < 0.05, "the strongest sample comes a little before the middle of the energy"


def test_a_few_impulses_do_not_say_when_impacts_come(quiet: Any) -> None:
    passes = np.arange(48_000) / quiet.fs_hz * quiet.fr * quiet.bearing.bpfo
    for seed in range(8):
        rng = np.random.default_rng(seed)
        x = quiet.make([MeanSlip(slip=0.02)], "outer")[0]
        x = x / np.abs(x).max() + 0.02 * rng.standard_normal(x.size)
        x[rng.integers(0, x.size, 4)] += 60.0
        found = passes_of(x, passes)
        assert found is not None
        assert found[0] == pytest.approx(0.98, rel=1.5e-3)
        noise = rng.standard_normal(x.size)
        noise[rng.integers(0, x.size, seed % 3)] += 100.0
        assert passes_of(noise, passes) is None
    assert passes_of(np.zeros(48_000), passes) is None


def test_without_impacts_nobody_says_when_they_come(lab: Any) -> None:
    x = lab.make([], "healthy")[0]
    passes = np.arange(x.size) / lab.fs_hz * lab.fr * lab.bearing.bpfo
    for n in (x.size, 100):
        assert passes_of(x[:n], passes[:n]) is None


@pytest.mark.parametrize("effect", [ImpactScatter(sigma=0.5), SlipJitter(sigma=0.05)])
def test_scatter_and_jitter_of_impacts_act_as_on_impacts(lab: Any, effect: Any) -> None:
    line, long = lab.bearing.bpfo * lab.fr, lab.where(n_samples=240_000)
    x = long.make([], "outer")[0]
    before = lab.envelope(x[None])
    on_impacts = lab.envelope(long.make([effect], "outer"))
    on_separated = lab.envelope(done(long, x, effect, background_of(lab))[None])
    for n in (1, 2):
        kept = [lab.line(y, n * line) / lab.line(before, n * line) for y in (on_impacts, on_separated)]
        assert kept[0] == pytest.approx(kept[1], rel=0.12)
    raised = [lab.floor(y, 4.5 * line) / lab.floor(before, 4.5 * line) for y in (on_impacts, on_separated)]
    assert raised[0] == pytest.approx(raised[1], rel=0.2)


def test_short_records_and_healthy_ones_have_nothing_to_tell_apart(lab: Any) -> None:
    assert Background.of([np.ones(100)]) is None
    quiet = background_of(lab)
    x = np.arange(200.0)
    np.testing.assert_array_equal(quiet.impacts(x, x / 50), x)
    healthy = lab.make([], "healthy")[0]
    np.testing.assert_array_equal(done(lab, healthy, LoadZone(depth=0.8), quiet, "healthy"), healthy)
