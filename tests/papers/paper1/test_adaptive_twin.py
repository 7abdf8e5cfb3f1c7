"""The twin without history: it only looks back, its signals have the amplitudes asked for, its labels fall."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from papers.paper1_rul_varying_speed.methods.adaptive_twin import (
    Adaptation,
    AdaptiveTwin,
    adapt,
    adapt_when_possible,
    find_anomaly,
    read_mode,
)
from papers.paper1_rul_varying_speed.methods.degradation import end_row
from papers.paper1_rul_varying_speed.methods.excited_modes import excited_modes
from papers.paper1_rul_varying_speed.methods.run import Run, period_rows, planned_speed, read_run, remaining_time_s
from papers.paper1_rul_varying_speed.methods.simulated_lives import (
    LifeSimulator,
    SignalModel,
    Snapshots,
    measured_snapshots,
    strengths,
)
from twingap.bearing import BEARINGS
from twingap.effects import Mode
from twingap.errors import TwingapError
from twingap.prognosis.anomaly import AnomalyRule
from twingap.records import Condition, Record, RecordSet
from twingap.signal.envelope import squared_envelope_spectrum

FS_HZ, LENGTH, DT_S = 12_000.0, 8192, 20.0
STEPS = np.repeat(np.arange(1000.0, 2001.0, 200.0), 3)
OPTIONS = Adaptation(
    reference_min=30.0, simulation_range_min=20.0, horizon_min=120.0, limit=12.0, lives=4, held_out_lives=1,
    mode_records=12, rule=AnomalyRule(horizon_rows=400),
)  # fmt: skip
ONSET, RATE = 200, 0.03


def speeds(rows: int) -> NDArray[np.float64]:
    return np.resize(STEPS, rows)


def known_run(seed: int = 0, rows: int = 330) -> Run:
    """Resonance crossed at 1400 rpm, damage from row 200 on, scatter of 3 %."""
    speed = speeds(rows)
    healthy = speed / 1000 + 1 / (1 + ((speed - 1400) / 120) ** 2)
    growth = np.exp(RATE * np.maximum(np.arange(rows) - ONSET, 0))
    p = healthy * growth * np.exp(0.03 * np.random.default_rng(seed).standard_normal(rows))
    return Run(DT_S * np.arange(rows), speed, p)


@pytest.fixture(scope="module")
def healthy_records() -> RecordSet:
    """Noise through one mode at 2600 Hz with damping 5 %."""
    rng = np.random.default_rng(3)
    w = 2 * np.pi * 2600 / FS_HZ
    ring = np.exp(-0.05 * w * np.arange(600)) * np.sin(np.sqrt(1 - 0.05**2) * w * np.arange(600))
    made = []
    for row in range(95):
        x = np.convolve(rng.standard_normal(LENGTH + 600), ring)[600 : 600 + LENGTH]
        condition = Condition(f"{row}", float(speeds(95)[row]), FS_HZ, LENGTH, None, None, DT_S * row, "run")
        made.append(Record(condition, 0.1 * x + 0.01 * rng.standard_normal(LENGTH)))
    return RecordSet.from_records("run", "g", BEARINGS["6205"], made)


@pytest.fixture(scope="module")
def twin(healthy_records: RecordSet) -> AdaptiveTwin:
    run = known_run()
    return adapt_when_possible(run, read_mode(healthy_records, run, OPTIONS), OPTIONS)


def simulator(twin: AdaptiveTwin, **model: Any) -> LifeSimulator:
    rng = np.random.default_rng(1)
    return LifeSimulator(twin, BEARINGS["6205"], "inner", FS_HZ, LENGTH, rng, SignalModel(**model))


# -- the run ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("profile", "period"),
    [
        (np.resize(STEPS, 200), STEPS.size),
        (np.resize(np.concatenate((STEPS, STEPS[::-1])), 200), 2 * STEPS.size),
        (np.full(50, 1800.0), 1),
        (np.linspace(1000, 2000, 40), 40),
    ],
)
def test_a_profile_repeats_itself(profile: NDArray[np.float64], period: int) -> None:
    assert period_rows(profile) == period
    planned = planned_speed(profile, profile.size + 3 * period, period)
    np.testing.assert_array_equal(planned[: profile.size], profile)
    np.testing.assert_allclose(planned[profile.size :], np.resize(profile[-period:], 3 * period))


def test_steps_held_for_long_are_not_taken_for_a_constant_speed() -> None:
    profile = np.resize(np.repeat(np.arange(1000.0, 2001.0, 100.0), 60), 3000)
    profile[1500] = 1000.0  # one abrupt change
    assert period_rows(profile) == 660


def test_rows_come_from_records(healthy_records: RecordSet) -> None:
    run = read_run(healthy_records)
    assert run.dt_s == DT_S and run.peak_to_peak[7] == np.ptp(healthy_records[7].samples)
    backwards = healthy_records.take(range(len(healthy_records) - 1, -1, -1))
    with pytest.raises(TwingapError, match="does not increase"):
        read_run(backwards)


# -- adapting ---------------------------------------------------------------------------------------------------------


def test_the_twin_finds_what_made_the_run(twin: AdaptiveTwin) -> None:
    assert twin.mode.resonance_hz == pytest.approx(2600, rel=0.03)
    assert twin.mode.damping_ratio == pytest.approx(0.05, rel=0.3)
    assert ONSET <= twin.onset_row <= ONSET + 20
    assert twin.damage.rate == pytest.approx(RATE, rel=0.15)
    assert twin.period_rows == STEPS.size
    run = known_run()
    end = end_row(run.peak_to_peak, OPTIONS.limit)
    assert end is not None and twin.lives[0].end_row <= end <= twin.lives[-1].end_row
    spans = [(life.end_row - twin.onset_row) * DT_S / 60 for life in (twin.lives[0], twin.lives[-1])]
    assert spans[1] - spans[0] <= OPTIONS.simulation_range_min
    assert len(twin.lives) == 4 and len(twin.held_out) == 1
    assert twin.lives[0].rate > twin.held_out[0].rate > twin.lives[-1].rate


def test_nothing_after_now_is_looked_at(twin: AdaptiveTwin) -> None:
    run = known_run()
    spoilt = run.peak_to_peak.copy()
    spoilt[twin.now_row + 1 :] = 99.0
    other = run.speed_rpm.copy()
    other[twin.now_row + 1 :] = 777.0
    again = adapt_when_possible(Run(run.time_s, other, spoilt), twin.mode, OPTIONS)
    assert again.now_row == twin.now_row and again.damage == twin.damage
    for one, two in zip(twin.lives, again.lives, strict=True):
        np.testing.assert_array_equal(one.speed_rpm, two.speed_rpm)
        np.testing.assert_array_equal(one.growth, two.growth)


def test_it_waits_until_growth_is_seen_and_says_when_there_is_nothing(twin: AdaptiveTwin) -> None:
    run = known_run()
    rule = dataclasses.replace(OPTIONS, after_alarm_min=0.0, level="free")
    _, _, anomaly = find_anomaly(run, rule)
    assert anomaly.alarm_row is not None
    told: list[str] = []
    flat = run.peak_to_peak.copy()
    seen = slice(anomaly.onset_row, anomaly.alarm_row + 6)
    healthy = twin.influence.amplitude(run.speed_rpm[seen])
    flat[seen] = healthy * np.linspace(1.5, 1.3, healthy.size)
    late = adapt_when_possible(Run(run.time_s, run.speed_rpm, flat), twin.mode, rule, told.append)
    assert told and late.now_row > anomaly.alarm_row
    calm = known_run(rows=ONSET)
    with pytest.raises(TwingapError, match="no anomaly in the whole run"):
        adapt_when_possible(calm, twin.mode, OPTIONS)
    with pytest.raises(TwingapError, match="no anomaly up to now"):
        adapt(calm, twin.mode, OPTIONS)


# -- simulated snapshots ----------------------------------------------------------------------------------------------


def test_simulated_peak_to_peak_is_what_the_life_says(twin: AdaptiveTwin) -> None:
    made = simulator(twin).snapshots(twin.lives, np.random.default_rng(2))
    wanted = np.concatenate([life.peak_to_peak[1:] for life in twin.lives])
    ratio = np.ptp(made.samples, axis=1) / wanted
    for low, high in ((0.0, 2.5), (2.5, 5.0), (5.0, 99.0)):
        assert ratio[(wanted > low) & (wanted <= high)].mean() == pytest.approx(1.0, abs=0.05)


def test_impacts_follow_speed_and_the_noise_of_equation_1_does_not(twin: AdaptiveTwin) -> None:
    # With impacts that are too weak to be heard, what is left is n(t): as strong at any speed.
    made = simulator(twin).records(np.repeat([1000.0, 1400.0, 2000.0], 6), np.zeros(18), np.random.default_rng(0))
    rms = made.std(axis=1).reshape(3, 6).mean(axis=1)
    np.testing.assert_allclose(rms / rms[0], np.ones(3), rtol=0.1)


def test_records_have_the_peak_to_peak_asked_for(twin: AdaptiveTwin) -> None:
    made = simulator(twin)
    speeds, wanted = np.repeat([1000.0, 1400.0, 2000.0], 4), np.resize([3.0, 5.0, 9.0, 14.0], 12)
    records = made.records(speeds, wanted, np.random.default_rng(0))
    np.testing.assert_allclose(np.ptp(records, axis=1), wanted, rtol=2e-3)


def test_strengths_are_found_whatever_noise_and_impacts_are() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((30, 500)).astype(np.float32)
    impacts = (rng.standard_normal((30, 500)) * (rng.random((30, 500)) < 0.02)).astype(np.float32)
    wanted = np.linspace(3.0, 60.0, 30)
    found = strengths(noise, impacts, wanted)
    made = np.ptp(noise + found[:, None].astype(np.float32) * impacts, axis=1)
    alone = np.ptp(noise, axis=1)
    np.testing.assert_allclose(made, np.maximum(wanted, alone), rtol=2e-3)
    assert ((found == 0) == (alone >= wanted)).all() and (found == 0).any()


# -- what unlabelled records say of the signal ------------------------------------------------------------------------


def struck_records(twin: AdaptiveTwin, zone: float, scatter: float) -> tuple[Snapshots, Snapshots]:
    """Healthy and faulty records of a machine with modes at 2600 and 900 Hz."""
    other = dataclasses.replace(twin.mode, resonance_hz=2600.0, damping_ratio=0.03)
    maker = LifeSimulator(
        dataclasses.replace(twin, mode=other), BEARINGS["6205"], "inner", FS_HZ, LENGTH, np.random.default_rng(4),
        SignalModel(load_zone=zone, scatter=scatter, noise_share=0.5),
    )  # fmt: skip
    maker.path = (Mode(2600.0, 0.03), Mode(900.0, 0.05, 0.4))
    speed = np.resize(np.unique(STEPS), 30)
    healthy, faulty = (
        maker.records(speed, height * twin.influence.amplitude(speed), np.random.default_rng(seed))
        for height, seed in ((0.0, 5), (2.5, 6))
    )
    nothing = np.zeros(30, np.int64)
    return tuple(Snapshots(x, speed, np.arange(1.0, 31), nothing) for x in (healthy, faulty))  # type: ignore[return-value]


def test_struck_modes_are_those_that_impacts_ring(twin: AdaptiveTwin) -> None:
    healthy, faulty = struck_records(twin, 0.3, 0.1)
    first, second = excited_modes(faulty.samples, faulty.speed_rpm, healthy.samples, healthy.speed_rpm, FS_HZ, 2)
    assert (first.frequency_hz, first.gain) == (pytest.approx(2600, rel=0.02), 1.0)
    assert second.frequency_hz == pytest.approx(900, rel=0.03)
    assert first.damping_ratio == pytest.approx(0.03, rel=0.5) and second.gain == pytest.approx(0.4, rel=0.5)
    with pytest.raises(TwingapError, match="nothing stands out"):
        excited_modes(healthy.samples, healthy.speed_rpm, faulty.samples, faulty.speed_rpm, FS_HZ)


def test_matched_strikes_are_as_impulsive_as_measured_ones(twin: AdaptiveTwin) -> None:
    rng = np.random.default_rng(1)
    found = []
    for zone, scatter in ((0.3, 0.1), (1.0, 0.6)):
        healthy, faulty = struck_records(twin, zone, scatter)
        made = LifeSimulator(
            twin, BEARINGS["6205"], "inner", FS_HZ, LENGTH, rng,
            SignalModel(noise="measured", path="excited", impact_shape="matched", modes=2),
            healthy=healthy, faulty=faulty,
        )  # fmt: skip
        again = made.records(faulty.speed_rpm, np.ptp(faulty.samples, axis=1).astype(float), rng)
        crest, wanted = (np.mean(np.ptp(x, axis=1) / x.std(axis=1)) for x in (again, faulty.samples))
        assert crest == pytest.approx(wanted, rel=0.12)
        found.append(made.impact_shape)
    assert found[1][1] > found[0][1], "more scatter is found where there is more"
    with pytest.raises(TwingapError, match="needs healthy records"):
        simulator(twin, noise="measured")


def test_simulated_records_show_the_fault(twin: AdaptiveTwin) -> None:
    made = simulator(twin).snapshots(twin.lives[:1], np.random.default_rng(2))
    last = len(made) - 1
    spectrum = squared_envelope_spectrum(made.samples[last].astype(float), FS_HZ)
    bpfi_hz = BEARINGS["6205"].bpfi * made.speed_rpm[last] / 60
    near = np.abs(spectrum.frequency - bpfi_hz) < 4
    away = (spectrum.frequency > 1.3 * bpfi_hz) & (spectrum.frequency < 1.45 * bpfi_hz)
    assert spectrum.values[near].max() > 5 * np.median(spectrum.values[away])


def test_labels_fall_by_the_revolution_and_with_slope_minus_one_at_constant_speed(twin: AdaptiveTwin) -> None:
    made = simulator(twin).snapshots(twin.lives, np.random.default_rng(2))
    assert made.revolutions is not None
    for number in range(len(twin.lives)):
        own = made.take(made.life == number)
        assert own.revolutions is not None and own.revolutions[-1] == 0
        np.testing.assert_allclose(-np.diff(own.revolutions), own.speed_rpm[1:] * DT_S / 60)
        life_s = remaining_time_s(own.revolutions, own.speed_rpm)
        steady = np.diff(own.speed_rpm) == 0
        np.testing.assert_allclose(np.diff(life_s)[steady] / DT_S, -1.0)
        faster = np.diff(own.speed_rpm) > 0
        assert (np.diff(life_s)[faster] < -DT_S).all(), "a higher speed takes more than the time that passed"
    np.testing.assert_array_equal(own.position, np.arange(1, len(own) + 1))


def test_a_set_comes_again_and_may_be_thinned(twin: AdaptiveTwin) -> None:
    whole = simulator(twin)
    one, two = (whole.snapshots(twin.lives, np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(one.samples, two.samples)
    few = whole.snapshots(twin.lives, np.random.default_rng(2), most=30)
    assert 25 <= len(few) <= 30 and set(few.life) == set(one.life)


def test_measured_snapshots_bring_no_label(healthy_records: RecordSet) -> None:
    shown = measured_snapshots(healthy_records, 10, range(11, 20), 4096)
    assert shown.revolutions is None and shown.position.tolist() == list(range(1, 10))
    np.testing.assert_array_equal(shown.samples[0], healthy_records[11].samples[:4096].astype(np.float32))
    with pytest.raises(TwingapError, match="9000 needed"):
        measured_snapshots(healthy_records, 10, [11], 9000)
