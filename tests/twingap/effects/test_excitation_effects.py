"""Signatures of effects on the excitation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import welch
from scipy.stats import kurtosis

from twingap.effects import (
    CageModulation,
    DamageGrowth,
    DistributedRoughness,
    Draft,
    EntryExit,
    ImpactScatter,
    LoadZone,
    SlipJitter,
    SpeedGain,
    make_effect,
)
from twingap.twins.phenomenological import periodic_impacts

ON_FAULTS = ["slip_jitter", "impact_scatter", "load_zone", "cage_modulation", "entry_exit", "damage_growth"]


@pytest.mark.parametrize("name", ON_FAULTS)
def test_effects_on_impacts_leave_healthy_records_alone(lab: Any, name: str) -> None:
    without, with_it = lab.where(n_samples=4000).pair(name, "healthy", time_s=3600.0)
    np.testing.assert_array_equal(with_it, without)


def train(lab: Any, effect: SlipJitter, n_samples: int) -> tuple[np.ndarray, float]:
    """Angles of many impacts after the effect, in spacings, and their order."""
    condition = lab.where(n_samples=n_samples).conditions("outer", 1)[0]
    t = np.arange(n_samples) / lab.fs_hz
    draft = Draft(condition, lab.bearing, 1.0, t, t * lab.fr)
    draft.impacts = periodic_impacts(draft, 1.0, 0.3)
    effect.apply(draft, np.random.default_rng(0))
    return draft.impacts.delayed_turns * draft.fault_order, draft.fault_order


def coherence(places: np.ndarray, harmonic: int) -> float:
    """Amplitude of a harmonic of the impact train's spectrum, 1 for strictly periodic impacts."""
    return float(abs(np.exp(2j * np.pi * harmonic * places).mean()))


def test_places_that_jitter_keep_sharp_lines_that_fall_with_the_harmonic(lab: Any) -> None:
    for size in (120_000, 1_200_000):
        places, _ = train(lab, SlipJitter(sigma=0.05), size)
        for n in (1, 2, 3, 5):
            assert coherence(places, n) == pytest.approx(np.exp(-((2 * np.pi * n * 0.05) ** 2) / 2), abs=0.03)


def test_spacings_that_jitter_broaden_lines_as_the_square_of_the_harmonic(lab: Any) -> None:
    short, _ = train(lab, SlipJitter(sigma=0.02, accumulating=True), 12_000)
    long, _ = train(lab, SlipJitter(sigma=0.02, accumulating=True), 4_800_000)
    assert coherence(long, 1) < 0.25 < 0.7 < coherence(short, 1), "a broad line is lower the longer one looks"
    # The correlation of a random walk falls as exp(-width * lag), width = (2 pi n sigma)^2 / 2 per spacing.
    lag = 20
    steps = long[lag:] - long[:-lag]
    widths = [-np.log(abs(np.exp(2j * np.pi * n * steps).mean())) / lag for n in (1, 2, 3)]
    np.testing.assert_allclose(widths, [(2 * np.pi * n * 0.02) ** 2 / 2 for n in (1, 2, 3)], rtol=0.05)
    spacing = np.diff(long)
    assert spacing.std() == pytest.approx(0.02, rel=0.05)


def test_jitter_never_runs_out_of_impacts(lab: Any) -> None:
    for seed in range(12):
        effect = SlipJitter(sigma=0.5, accumulating=True)
        x = lab.where(seed=seed, n_samples=60_000).make([effect])
        power = (x.reshape(-1, 1000) ** 2).mean(axis=1)
        assert power[-2:].max() > 1.5, "noise alone has 1"
        assert power[:2].max() > 1.5


def test_jitter_in_the_envelope_lowers_high_harmonics_and_raises_the_floor(lab: Any) -> None:
    without, with_it = (lab.envelope(x) for x in lab.pair(SlipJitter(sigma=0.05), count=4))
    line = lab.bearing.bpfo * lab.fr
    kept = [lab.line(with_it, n * line) / lab.line(without, n * line) for n in (1, 2, 3)]
    np.testing.assert_allclose(kept, [np.exp(-((2 * np.pi * n * 0.05) ** 2) / 2) for n in (1, 2, 3)], atol=0.06)
    assert lab.floor(with_it, 2.5 * line) > 1.3 * lab.floor(without, 2.5 * line)


def test_scatter_raises_the_floor_and_keeps_the_harmonics(lab: Any) -> None:
    without, with_it = (lab.envelope(x) for x in lab.pair(ImpactScatter(sigma=0.4), count=4))
    line = lab.bearing.bpfo * lab.fr
    assert lab.floor(with_it, 1.5 * line) > 2 * lab.floor(without, 1.5 * line)
    kept = [lab.line(with_it, n * line) / lab.line(without, n * line) for n in (1, 2, 3)]
    # Squared strengths have mean 1 + sigma^2: all harmonics rise together.
    np.testing.assert_allclose(kept, 1.16, rtol=0.15)
    for side in (lab.fr, lab.bearing.ftf * lab.fr):
        assert lab.prominence(with_it, line + side) < 4


def sidebands(lab: Any, effect: Any, fault: str, rate: float) -> tuple[float, float]:
    """Prominence of the side line at `rate` orders below the fault's line, without and with the effect."""
    without, with_it = (lab.envelope(x) for x in lab.pair(effect, fault, count=4))
    line = (lab.bearing.fault_order(fault) - rate) * lab.fr
    return lab.prominence(without, line), lab.prominence(with_it, line)


def test_load_zone_at_shaft_rate_inner_cage_rate_ball_and_nothing_else(lab: Any) -> None:
    effect, ftf = LoadZone(depth=0.5), lab.bearing.ftf
    for fault, own, foreign in (("inner", 1.0, ftf), ("ball", ftf, 1.0)):
        before, after = sidebands(lab, effect, fault, own)
        assert before < 4 < 15 < after
        assert max(sidebands(lab, effect, fault, foreign)) < 4
    for fault in ("outer", "cage"):
        without, with_it = lab.where(n_samples=4000).pair(effect, fault)
        np.testing.assert_array_equal(with_it, without)


def test_a_load_that_turns_meets_the_outer_race_once_a_turn_and_stays_on_the_inner_one(lab: Any) -> None:
    effect, ftf = LoadZone(depth=0.5, rotating=True), lab.bearing.ftf
    for fault, own in (("outer", 1.0), ("ball", 1 - ftf)):
        before, after = sidebands(lab, effect, fault, own)
        assert before < 4 < 15 < after
    for fault in ("inner", "cage"):
        without, with_it = lab.where(n_samples=4000).pair(effect, fault)
        np.testing.assert_array_equal(with_it, without)


@pytest.mark.parametrize("extent", [0.2, 0.5, 0.8, 1.0])
def test_a_narrow_load_zone_is_stribecks_and_leaves_the_mean_strength(lab: Any, extent: float) -> None:
    condition = lab.conditions("inner", 1)[0]
    turns = np.arange(20_000) / 2000
    draft = Draft(condition, lab.bearing, 1.0, turns / lab.fr, turns)
    weights = [LoadZone(depth=d, extent=extent)._weight(draft, turns, np.random.default_rng(3)) for d in (1.0, 0.4)]
    assert weights[0].mean() == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(weights[1], 0.6 + 0.4 * weights[0])
    # Stribeck's half angle of the zone: cos(psi) = 1 - 2 epsilon.
    assert np.mean(weights[0] > 1e-9) == pytest.approx(np.arccos(1 - 2 * extent) / np.pi, abs=2e-3)
    law = np.maximum(1 - (1 - np.cos(2 * np.pi * (turns - turns[np.argmax(weights[0])]))) / (2 * extent), 0)
    np.testing.assert_allclose(weights[0], law / law.mean(), atol=0.01)


@pytest.mark.parametrize("fault", ["inner", "outer", "ball"])
def test_cage_modulation_at_cage_rate_whatever_the_fault(lab: Any, fault: str) -> None:
    before, after = sidebands(lab, CageModulation(depth=0.5), fault, lab.bearing.ftf)
    assert before < 4 < 15 < after
    assert max(sidebands(lab, CageModulation(depth=0.5), fault, 1.0)) < 4


@pytest.mark.parametrize("speed_rpm", [900.0, 1800.0])
def test_entry_and_exit_make_a_comb_at_one_over_the_delay(quiet: Any, speed_rpm: float) -> None:
    lab = quiet.where(speed_rpm=speed_rpm)
    without, with_it = lab.pair(EntryExit(arc_deg=4.0, exit_ratio=0.7))
    delay = 4.0 / 360 / lab.bearing.ftf / lab.fr
    f = np.arange(1, 40) * lab.bearing.bpfo * lab.fr
    gain = np.array([lab.line(with_it, fi) / lab.line(without, fi) for fi in f])
    np.testing.assert_allclose(gain, abs(1 + 0.7 * np.exp(-2j * np.pi * f * delay)), rtol=0.02)
    cepstra = [np.fft.irfft(np.log(abs(np.fft.rfft(x[0])) + 1e-9 * abs(x).max())) for x in (without, with_it)]
    at = delay * lab.fs_hz
    first = 6  # shorter quefrencies belong to the mode
    rise = (cepstra[1] - cepstra[0])[first : int(1.7 * at)]
    assert abs(first + int(np.argmax(rise)) - at) <= 1
    assert rise.max() > 4 * np.abs(rise[np.abs(first + np.arange(rise.size) - at) > 2]).mean()


@pytest.mark.parametrize("turned", [False, True])
def test_a_second_impact_may_go_the_other_way(quiet: Any, turned: bool) -> None:
    lab = quiet.where()
    without, with_it = lab.pair(EntryExit(arc_deg=4.0, exit_ratio=0.7, turned=turned))
    delay = 4.0 / 360 / lab.bearing.ftf / lab.fr
    f = np.arange(1, 40) * lab.bearing.bpfo * lab.fr
    gain = np.array([lab.line(with_it, fi) / lab.line(without, fi) for fi in f])
    second = -0.7 if turned else 0.7
    np.testing.assert_allclose(gain, abs(1 + second * np.exp(-2j * np.pi * f * delay)), rtol=0.02)


def test_entry_and_exit_make_no_new_order(lab: Any) -> None:
    with_it = lab.envelope(lab.make([EntryExit()], count=4))
    line = lab.bearing.bpfo * lab.fr
    assert lab.prominence(with_it, line) > 20
    for foreign in (0.5 * line, 1.5 * line, line + lab.fr, line + lab.bearing.ftf * lab.fr):
        assert lab.prominence(with_it, foreign) < 4


def test_roughness_modulates_at_shaft_rate_without_a_tone_or_an_impact(lab: Any) -> None:
    effect = DistributedRoughness(level=1.0, depth=0.8)
    without, with_it = lab.pair(effect, "healthy", count=4)
    assert lab.prominence(lab.envelope(without), lab.fr) < 3 < 8 < lab.prominence(lab.envelope(with_it), lab.fr)
    assert lab.prominence(with_it, lab.fr) < 3, "no line of first order"
    assert lab.prominence(lab.envelope(with_it), lab.bearing.bpfo * lab.fr) < 3
    added = with_it - without
    assert added.std() == pytest.approx(1.0, rel=0.03), "its level is that of the response"
    assert kurtosis(added.ravel()) < 3, "Gaussian, modulated; impacts reach tens"
    synchronous = added.reshape(-1, 400).mean(axis=0)  # 400 samples a turn
    assert synchronous.std() < 0.1 * added.std(), "a mean over turns leaves nothing"


def test_speed_gain_changes_size_between_speeds_and_not_shape(quiet: Any) -> None:
    effect = SpeedGain(exponent=1.5, reference_speed_rpm=1200.0)
    for fault in ("healthy", "outer"):
        for speed in (1200.0, 600.0, 2400.0):
            without, with_it = quiet.where(speed_rpm=speed, n_samples=6000).pair(effect, fault)
            np.testing.assert_allclose(with_it, (speed / 1200) ** 1.5 * without, rtol=1e-9, atol=1e-9)


def test_speed_gain_leaves_the_measuring_chain_alone(lab: Any) -> None:
    added = lab.where(speed_rpm=3600.0).added(SpeedGain(exponent=2.0, reference_speed_rpm=1800.0))
    f, power = welch(added[0], lab.fs_hz, nperseg=2048)
    structure = (f > 2700) & (f < 3300)
    assert power[structure].mean() > 50 * power[f < 500].mean(), (
        "what grew has the mode's shape, not that of white noise"
    )


@pytest.mark.parametrize("on_noise", [0.0, 0.5])
def test_speed_may_be_felt_by_impacts_and_less_by_the_noise(quiet: Any, on_noise: float) -> None:
    effect = SpeedGain(exponent=2.0, reference_speed_rpm=1200.0, on_noise=on_noise)
    lab = quiet.where(speed_rpm=2400.0, n_samples=6000)
    without, with_it = lab.pair(effect, "healthy")
    np.testing.assert_allclose(with_it, 4.0**on_noise * without, rtol=1e-9, atol=1e-9)
    struck = lab.pair(effect, "outer")
    assert struck[1].std() > 3.5 * struck[0].std()


def test_damage_grows_along_the_run_from_its_onset(quiet: Any) -> None:
    lab = quiet.where(n_samples=6000)
    effect = DamageGrowth(rate_per_s=1e-3, onset_s=500.0)
    for time_s, growth in ((0.0, 1.0), (500.0, 1.0), (1500.0, np.exp(1.0)), (3500.0, np.exp(3.0))):
        without, with_it = lab.pair(effect, "inner", time_s=time_s)
        np.testing.assert_allclose(with_it, growth * without, rtol=1e-3, atol=100.0)
    np.testing.assert_array_equal(*lab.pair(effect, "inner"))


def test_damage_growth_needs_no_speed_and_speed_gain_no_time(quiet: Any) -> None:
    lab = quiet.where(n_samples=3000)
    early, late = (lab.make(["speed_gain"], time_s=time) for time in (0.0, 1e4))
    np.testing.assert_array_equal(early, late)
    gains = []
    for speed in (900.0, 1800.0):
        without, with_it = lab.where(speed_rpm=speed).pair("damage_growth", time_s=1000.0)
        gains.append(with_it.std() / without.std())
    assert gains[0] == pytest.approx(gains[1], rel=1e-3)


def test_impacts_of_one_pass_share_their_chances(quiet: Any) -> None:
    """Entry and exit belong to one roller: jitter and scatter move both alike, so the comb stays."""
    lab, doubled = quiet.where(n_samples=24000), EntryExit(arc_deg=4.0, exit_ratio=1.0)
    shared = [SlipJitter(sigma=0.03), ImpactScatter(sigma=0.3)]
    one, two = lab.make(shared), lab.make([*shared, doubled])
    delay = 4.0 / 360 / lab.bearing.ftf / lab.fr * lab.fs_hz
    spectra = [np.fft.rfft(x[0] * np.hanning(24000)) for x in (one, two)]
    k = np.arange(5000, 7000)
    comb = abs(1 + np.exp(-2j * np.pi * k * delay / 24000))
    strong = abs(spectra[0][k]) > np.median(abs(spectra[0][k]))
    np.testing.assert_allclose(abs(spectra[1][k] / spectra[0][k])[strong], comb[strong], atol=0.1)


def test_unknown_fault_is_said_so(lab: Any) -> None:
    (condition,) = lab.conditions("outer", 1)
    unlabelled = type(condition)("r", 1800, 12000, 100)
    t = np.arange(100) / 12000
    draft = Draft(unlabelled, lab.bearing, 1.0, t, 30 * t, excitation="waveform", x=t)
    for name in ON_FAULTS:
        assert "unknown" in str(make_effect(name).cannot_act_on(draft))


@pytest.mark.parametrize("fault", ["outer", "inner", "ball"])
@pytest.mark.parametrize("ratio", [1.0, 0.97])
def test_a_roller_leaves_a_defect_when_it_has_rolled_over_it(lab: Any, fault: str, ratio: float) -> None:
    """The delay is the time that the struck body takes to turn by the arc, angles followed step by step."""
    t = np.linspace(0.0, 1.0, 200_001)
    draft = Draft(lab.where(n_samples=t.size).conditions(fault, 1)[0], lab.bearing, 1.0, t, t, cage_speed_ratio=ratio)
    cage = 0.5 * (1 - 7.94 / 39.04) * ratio * t
    # Rolling without slip on the inner ring: a ball of diameter d spins by what the ring's circumference passes it.
    turned = {"outer": cage, "inner": t - cage, "ball": (t - cage) * (39.04 - 7.94) / 7.94}[fault]
    if fault == "ball" and ratio == 1.0:
        assert turned[-1] == pytest.approx(lab.bearing.bsf, rel=1e-9)
    assert EntryExit(arc_deg=3.0).delay_turns(draft) == pytest.approx(np.interp(3.0 / 360, turned, t), rel=1e-6)


def test_scatter_of_a_gain_has_the_spread_of_scattered_impacts(lab: Any) -> None:
    n = 2_000_000
    t = np.arange(n) / lab.fs_hz
    condition = lab.where(n_samples=n).conditions("outer", 1)[0]
    draft = Draft(condition, lab.bearing, 1.0, t, t * lab.fr, excitation="waveform", x=np.ones(n))
    ImpactScatter(sigma=0.3).apply(draft, np.random.default_rng(0))
    assert draft.gain is not None
    assert draft.gain.mean() == pytest.approx(1.0, abs=0.01)
    assert draft.gain.std() == pytest.approx(0.3, rel=0.04)
