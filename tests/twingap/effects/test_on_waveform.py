"""Effects on finished waveforms: a foreign simulator's records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from twingap import Record, TwingapError
from twingap.effects import (
    CageModulation,
    DamageGrowth,
    DistributedRoughness,
    EntryExit,
    ForeignBearing,
    ImpactScatter,
    LoadZone,
    SecondResonance,
    SlipJitter,
    SpeedFluctuation,
    SpeedGain,
    apply_to_waveform,
    catalogue,
    make_effect,
)
from twingap.effects.impact_train import BEFORE
from twingap.streams import Streams

IMPOSSIBLE = {
    "mean_slip": "cage", "distributed_roughness": "no path", "impulsive_share": "no list of impacts",
    "ball_contact": "no list of impacts",
}  # fmt: skip


def finished(lab: Any, fault: str, effects: list[Any], time_s: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A finished record before and after."""
    (condition,) = lab.conditions(fault, 1, time_s)
    x = lab.make([], fault, time_s=time_s)
    done = apply_to_waveform(effects, Record(condition, x[0]), lab.bearing, lab.parameters.reference_rms, Streams(7, 0))
    assert done.condition == condition
    return x, done.samples[None]


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_effect_acts_or_says_why_not(lab: Any, name: str) -> None:
    lab = lab.where(n_samples=6000)
    before = lab.make([], "inner", time_s=600.0)[0].copy()
    (condition,) = lab.conditions("inner", 1, 600.0)
    record = Record(condition, before.copy())
    act = lambda: apply_to_waveform([make_effect(name)], record, lab.bearing, 1.0, Streams(7, 0))  # noqa: E731
    if name in IMPOSSIBLE:
        with pytest.raises(TwingapError, match=f"record 'r0', effect {name}: .*{IMPOSSIBLE[name]}"):
            act()
        return
    changed = name != "speed_gain" and name != "dropout"  # at the reference speed; perhaps no gap in half a second
    assert (act().samples != before).any() or not changed
    np.testing.assert_array_equal(act().samples, act().samples)
    np.testing.assert_array_equal(record.samples, before)


def test_no_effect_is_no_change(lab: Any) -> None:
    np.testing.assert_array_equal(*finished(lab, "inner", []))


def test_fluctuation_smears_and_modulation_draws_side_lines(lab: Any) -> None:
    line = lab.bearing.bpfo * lab.fr
    before, after = (lab.envelope(x) for x in finished(lab, "outer", [SpeedFluctuation(level=0.003)]))
    assert 1 > lab.line(after, line) / lab.line(before, line) > lab.line(after, 4 * line) / lab.line(before, 4 * line)
    for fault, effect, rate in (
        ("inner", LoadZone(depth=0.6), 1.0),
        ("ball", LoadZone(depth=0.6), lab.bearing.ftf),
        ("outer", CageModulation(depth=0.6), lab.bearing.ftf),
    ):
        side = (lab.bearing.fault_order(fault) - rate) * lab.fr
        before, after = (lab.envelope(x) for x in finished(lab, fault, [effect]))
        assert lab.prominence(before, side) < 5 < 8 < lab.prominence(after, side)


def test_jitter_and_scatter_on_waveforms_act_as_on_impacts(lab: Any) -> None:
    """Both ways to the same statistics: the impacts moved, or the finished waveform delayed and weighed."""
    line = lab.bearing.bpfo * lab.fr
    for effect, tolerance in ((SlipJitter(sigma=0.06), 0.1), (ImpactScatter(sigma=0.4), 0.15)):
        long = lab.where(n_samples=480_000)
        on_impacts = long.envelope(long.make([effect]))
        before, on_waveform = (lab.envelope(x) for x in finished(long, "outer", [effect]))
        for n in (1, 2):
            kept = [lab.line(x, n * line) / lab.line(before, n * line) for x in (on_impacts, on_waveform)]
            assert kept[0] == pytest.approx(kept[1], rel=tolerance)
        assert lab.floor(on_waveform, 4.5 * line) > 1.1 * lab.floor(before, 4.5 * line)


def test_entry_and_exit_comb_and_resonance_and_gains(lab: Any, quiet: Any) -> None:
    before, after = finished(quiet, "outer", [EntryExit(arc_deg=4.0, exit_ratio=0.7)])
    delay = 4.0 / 360 / lab.bearing.ftf / lab.fr
    f = np.arange(15, 35) * lab.bearing.bpfo * lab.fr
    gain = np.array([lab.line(after, fi) / lab.line(before, fi) for fi in f])
    np.testing.assert_allclose(gain, abs(1 + 0.7 * np.exp(-2j * np.pi * f * delay)), rtol=0.1)
    before, after = finished(lab, "healthy", [SecondResonance(frequency_hz=1200.0, gain=3.0)])
    power = [np.abs(np.fft.rfft(x[0])) ** 2 for x in (before, after)]
    near, far = slice(4700, 4900), slice(18000, 20000)  # bins of 0.25 Hz: 1200 Hz and 4500 to 5000 Hz
    assert power[1][near].sum() / power[0][near].sum() == pytest.approx(16, rel=0.15)
    assert power[1][far].sum() / power[0][far].sum() == pytest.approx(1, rel=0.15)
    for effect, factor in (
        (SpeedGain(exponent=2.0, reference_speed_rpm=900.0), 4.0),
        (DamageGrowth(rate_per_s=1e-3), np.exp(0.5)),
    ):
        before, after = finished(lab, "outer", [effect], time_s=500.0)
        np.testing.assert_allclose(after, factor * before)


@pytest.fixture(scope="module")
def ringing() -> np.ndarray:
    """Response of a simulator to one impact: a mode at 2 kHz, at 12 kHz."""
    t = np.arange(200) / 12000.0
    return np.concatenate((np.zeros(BEFORE), np.exp(-600 * t) * np.cos(2 * np.pi * 2000 * t)))


def through(lab: Any, effect: Any, response: np.ndarray, fault: str = "healthy") -> np.ndarray:
    """What the effect adds to a finished waveform whose simulator answers an impact so."""
    (condition,) = lab.conditions(fault, 1)
    x = lab.make([], fault)[0]
    done = apply_to_waveform(
        [effect], Record(condition, x), lab.bearing, 2.0, Streams(7, 0), force_response=lambda: response
    )
    return np.asarray(done.samples - x)


def test_roughness_rings_as_the_simulator_does(lab: Any, ringing: np.ndarray) -> None:
    added = through(lab, DistributedRoughness(level=0.5, depth=0.8), ringing)
    assert added.std() == pytest.approx(0.5 * 2.0, rel=0.05)
    f, power = welch(added, lab.fs_hz, nperseg=1024)
    expected = np.abs(np.fft.rfft(ringing, 1024)) ** 2
    inside = slice(8, -8)
    off = np.log(power / power.sum() / (expected / expected.sum()))[inside]
    assert np.abs(off).mean() < 0.15
    assert f[power.argmax()] == pytest.approx(2000.0, abs=40.0)
    assert lab.prominence(lab.envelope(added[None]), lab.fr) > 8, "it swells with the shaft"
    halves = added[: added.size // 8].std() / added[added.size // 8 :].std()
    assert halves == pytest.approx(1.0, rel=0.15), "from the first sample on"


def test_a_neighbours_impacts_may_come_the_way_of_this_bearings(lab: Any, ringing: np.ndarray) -> None:
    """In a finished waveform as its impacts do; through the modes of a twin that has them."""
    own = ForeignBearing(level=3.0, order=4.37, own_path=True, resonance_hz=4500.0)
    added = through(lab, own, ringing)
    assert np.abs(added).max() == pytest.approx(3.0 * 2.0, rel=0.15)
    f, power = welch(added, lab.fs_hz, nperseg=1024)
    assert f[power.argmax()] == pytest.approx(2000.0, abs=40.0)
    assert lab.prominence(lab.envelope(added[None]), 4.37 * lab.fr) > 15
    made = lab.added(own)
    same = lab.added(replace(own, own_path=False, resonance_hz=3000.0, damping_ratio=lab.parameters.damping_ratio))
    np.testing.assert_allclose(made, same, atol=1e-9)


def test_yardstick_must_be_positive(lab: Any) -> None:
    (condition,) = lab.where(n_samples=10).conditions("outer", 1)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(TwingapError, match="reference_rms"):
            apply_to_waveform([], Record(condition, np.zeros(10)), lab.bearing, wrong, Streams(7, 0))


def test_one_sample_and_constant_records_survive(lab: Any) -> None:
    for n in (1, 2, 7):
        (condition,) = lab.where(n_samples=n).conditions("outer", 1, 10.0)
        for name in catalogue():
            if name not in IMPOSSIBLE:
                x = apply_to_waveform(
                    [make_effect(name)], Record(condition, np.ones(n)), lab.bearing, 1.0, Streams(7, 0)
                )
                assert np.isfinite(x.samples).all()


def test_an_angle_changed_in_place_is_followed(lab: Any) -> None:
    class Swing(SpeedFluctuation):
        def apply(self, draft: Any, rng: np.random.Generator) -> None:
            draft.turns += 0.05 * np.sin(4 * np.pi * draft.t)

    (condition,) = lab.conditions("inner", 1)
    record = Record(condition, lab.make([], "inner")[0])
    done = apply_to_waveform([Swing()], record, lab.bearing, lab.parameters.reference_rms, Streams(7, 0))
    assert np.abs(done.samples - record.samples).std() > 0.3 * record.samples.std()


def test_damage_of_a_finished_waveform_is_that_of_the_onset(lab: Any) -> None:
    """Impacts of the user's own simulator have a damage of their own: before it, they are smaller."""
    growth = DamageGrowth(rate_per_s=1e-3, onset_s=600.0)
    for time_s, factor in ((0.0, np.exp(-0.6)), (600.0, 1.0), (1600.0, np.e)):
        before, after = finished(lab, "inner", [growth], time_s=time_s)
        assert after.std() / before.std() == pytest.approx(factor, rel=0.05)
    before, after = finished(lab, "inner", [growth])
    np.testing.assert_array_equal(before, after)
