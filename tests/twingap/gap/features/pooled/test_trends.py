"""Trends over speed and over the run: nothing by chance, and what a machine does that its twin does not."""

import numpy as np
import pytest
from scipy import stats

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.features.pooled.trends import Levels, covariates, normal_deviate, slope
from twingap.gap.features.spectrum.record_summary import summarise
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

AMPLITUDES = {"inner": 6.0, "outer": 4.0}


@pytest.mark.parametrize("free", [3, 5, 12, 40])
def test_a_deviate_is_as_unlikely_as_its_t(free):
    t = np.array([-20.0, -4.0, -1.0, 0.0, 0.5, 2.0, 8.0])
    exact = np.sign(t) * stats.norm.isf(stats.t.sf(np.abs(t), free))
    np.testing.assert_allclose(normal_deviate(t, np.full(t.size, free)), exact, atol=0.2)


@pytest.mark.parametrize("per_kind", [2, 3, 8])
def test_a_handful_of_records_has_no_trend_by_chance(per_kind):
    rng, width = np.random.default_rng(1), 4000
    kinds = np.repeat(["healthy", "outer", "inner"], per_kind)
    speed = np.tile(np.linspace(-0.4, 0.4, per_kind), 3)
    y = rng.standard_normal((kinds.size, width)) + 5.0 * (kinds == "outer")[:, None]
    _, z = slope(speed, y, kinds)
    assert np.mean(np.abs(z[np.isfinite(z)]) > 2.0) == pytest.approx(0.045, abs=0.02)
    found, z = slope(speed, y + 8.0 * speed[:, None], kinds)
    assert np.median(found) == pytest.approx(8.0, abs=0.5)
    assert np.median(z) > 2


def levels(*effects, seed=0, along=False):
    """RMS of a machine with these effects, and of its twin with amplitudes as calibration leaves them: off by fault."""
    speeds = (1000.0, 1300.0, 1700.0, 2200.0)
    conditions = tuple(
        Condition(
            f"{fault}{speed:.0f}-{k}", speed, 12000.0, 6000, fault,
            time_s=3600.0 * (i + 4 * k) if along else None,
        )
        for fault in ("healthy", "inner", "outer") for k in range(2) for i, speed in enumerate(speeds)
    )  # fmt: skip
    wrong = {"inner": 4.5, "outer": 5.0}
    machine, twin = (
        PhenomenologicalTwin(BEARINGS["6205"], PhenomenologicalParameters(2500.0, 0.05, impact_amplitude=a), own)
        for a, own in ((AMPLITUDES, effects), (wrong, ()))
    )
    measured, simulated = (
        np.array([r.samples.std() for r in of.simulate(conditions, np.random.default_rng(seed + i))])
        for i, of in enumerate((machine, twin))
    )
    return Levels(conditions, measured, simulated, np.full(len(conditions), np.nan))


def test_records_of_a_fault_at_one_speed_are_one_observation():
    """Harmonics meet sharp modes in the same way in all of them: forty records at two speeds are no forty witnesses."""
    rng, deviates, naive = np.random.default_rng(3), [], []
    conditions = tuple(
        Condition(f"{fault}{speed:.0f}-{k}", speed, 12000.0, 6000, fault)
        for fault in ("healthy", "inner", "outer") for speed in (1000.0, 1400.0) for k in range(7)
    )  # fmt: skip
    kinds = np.array([c.fault for c in conditions])
    speed = covariates(conditions)[0]
    for _ in range(300):
        met = {(f, s): 0.06 * rng.standard_normal() for f in ("inner", "outer") for s in (1000.0, 1400.0)}
        off = np.array([met.get((str(c.fault), c.speed_rpm), 0.0) for c in conditions])
        level = np.where(kinds == "healthy", 1.0, 4.0)
        measured = level * np.exp(off + 0.005 * rng.standard_normal(len(conditions)))
        found = Levels(conditions, measured, level, np.full(len(conditions), np.nan)).trends()
        deviates.append(found["speed_impacts_z"])
        faulty = kinds != "healthy"
        (z,) = slope(speed[faulty], np.log(measured / level)[faulty, None], kinds[faulty])[1]
        naive.append(z)
    assert np.mean(np.abs(deviates) > 2) < 0.1 < 0.3 < np.mean(np.abs(naive) > 2)


def test_few_records_on_a_line_are_believed_as_far_as_levels_usually_are():
    """Six records a hundredth off a slope of two: the line is not exact by chance, nor is it in doubt."""
    rng = np.random.default_rng(6)
    x, kinds = np.tile([-0.2, 0.0, 0.2], 2), np.repeat(["inner", "outer"], 3)
    y = (2.0 * x + 0.01 * rng.standard_normal(6))[:, None]
    (bare,), (moderated,) = (slope(x, y, kinds, usual)[1] for usual in (0.0, 0.05))
    assert moderated > 4.5 > bare
    by_chance = [slope(x, 0.01 * rng.standard_normal((6, 400)), kinds, usual)[1] for usual in (0.0, 0.05)]
    assert np.mean(np.abs(by_chance[1]) > 2) < 0.01 < np.mean(np.abs(by_chance[0]) > 2)


def test_an_amplitude_that_calibration_missed_is_no_trend():
    found = [levels(seed=10 * k).trends() for k in range(6)]
    assert np.mean([t["speed_impacts_size"] > 2.5 for t in found]) < 0.35
    assert np.abs([t["speed_impacts"] for t in found]).max() < 0.15
    assert all(np.isnan(t["time_impacts"]) for t in found)


def test_a_gain_that_impacts_alone_have_is_read_off_them():
    gain = {"exponent": 1.4, "reference_speed_rpm": 1500.0}
    found = levels(make_effect("speed_gain", {**gain, "on_noise": 0.0})).trends()
    assert found["speed_impacts"] == pytest.approx(1.4, abs=0.2)
    assert found["speed_impacts_z"] == found["speed_impacts_size"] > 4
    assert abs(found["speed_noise"]) < 0.05
    both = levels(make_effect("speed_gain", gain)).trends()
    assert both["speed_noise"] > 0.4


def test_growth_along_a_run_is_told_from_the_speeds_of_the_run():
    growth = make_effect("damage_growth", {"rate_per_s": 1.0 / 25000, "onset_s": 0.0})
    found = levels(growth, along=True).trends()
    assert found["time_partial_z"] > 4
    assert found["time_partial"] == pytest.approx(1.0, abs=0.15)
    assert abs(found["speed_partial"]) < 0.2 < found["speed_impacts"]


def test_a_run_is_counted_in_parts_of_itself():
    conditions = tuple(Condition(f"r{k}", 1000.0, 1e4, 100, time_s=50.0 + 10 * k) for k in range(3))
    _, time = covariates(conditions)
    assert np.ptp(time) == pytest.approx(1.0)
    assert np.isnan(covariates(tuple(Condition(f"r{k}", 1e3, 1e4, 100) for k in range(3)))[1]).all()


def test_a_record_that_stands_in_both_parts_counts_once():
    conditions = [
        Condition(f"{fault}{i}", 1500.0 + 300.0 * i, 10000.0, 5000, fault, group=fault)
        for fault in ("healthy", "inner") for i in range(4)
    ]  # fmt: skip
    parameters = PhenomenologicalParameters(2500.0, 0.05, impact_amplitude=AMPLITUDES)
    made = PhenomenologicalTwin(BEARINGS["6205"], parameters).simulate(conditions, np.random.default_rng(0))
    records = RecordSet.from_records("machine", "g", BEARINGS["6205"], made)
    spec = TwinSpec("phenomenological")
    calibrated = calibrate(records, spec, np.random.default_rng(1))
    assert calibrated.shared  # a group of its own each fault: nothing is left to hold out
    evidence = Evidence(calibrated, simulator_of(calibrated), spec, 3)
    assert sorted(summary.condition.name for summary in evidence.pooled.summaries) == sorted(c.name for c in conditions)
    by_name = {r.condition.name: float(r.samples.std()) for r in records}
    of_all = Levels.of(evidence.pooled.summaries, evidence.pooled.summaries)
    assert of_all.measured == pytest.approx([by_name[c.name] for c in of_all.conditions])


def summaries(*effects, seed=0):
    """What is kept of records of two faults at four speeds."""
    conditions = [
        Condition(f"{fault}{speed:.0f}-{k}", speed, 12000.0, 12000, fault)
        for fault in ("healthy", "inner", "outer") for k in range(2) for speed in (1000.0, 1300.0, 1700.0, 2200.0)
    ]  # fmt: skip
    bearing = BEARINGS["6205"]
    parameters = PhenomenologicalParameters(2500.0, 0.05, impact_amplitude=AMPLITUDES)
    made = PhenomenologicalTwin(bearing, parameters, effects).simulate(conditions, np.random.default_rng(seed))
    frame = Frame(bearing, (1800.0, 3200.0), 1.0)
    return [summarise(RecordTransforms(r.samples, r.condition, frame)) for r in made]


def test_impacts_are_followed_by_their_harmonics_where_tones_drown_them():
    """Strong tones widen what the RMS says of impacts; what stands at harmonics hears none of them."""
    gain = make_effect("speed_gain", {"exponent": 1.4, "reference_speed_rpm": 1500.0, "on_noise": 0.0})
    tone = make_effect("drive_interference", {"level": 4.0, "depth": 0.2, "carrier_hz": 4100.0, "sideband_order": 3.0})
    plain = Levels.of(summaries(tone, seed=1), summaries()).trends()
    assert abs(plain["speed_harmonics"]) < 0.1
    found = Levels.of(summaries(tone, gain, seed=1), summaries()).trends()
    alone = Levels.of(summaries(gain, seed=1), summaries()).trends()
    assert found["speed_harmonics"] == pytest.approx(1.4, abs=0.35)
    assert found["speed_harmonics"] == pytest.approx(alone["speed_harmonics"], abs=0.02)
    assert found["speed_impacts_z"] < 0.7 * alone["speed_impacts_z"]
    assert found["speed_harmonics_z"] > found["speed_impacts_z"]
