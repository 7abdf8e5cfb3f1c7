"""Shapes of spectra: one mode and white noise, and what is more."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.features.spectrum import path
from twingap.gap.features.spectrum.record_summary import summarise
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

RATES = {"6205": 12000.0, "UER204": 25600.0, "ZA-2115": 20000.0}


def measured(name, effects=(), faults=("healthy",) * 6, seed=0):
    return path.measure(summaries(name, effects, faults, seed))


def summaries(name, effects=(), faults=("healthy",) * 6, seed=0):
    fs_hz, bearing = RATES[name], BEARINGS[name]
    parameters = PhenomenologicalParameters(resonance_hz=0.2 * fs_hz, damping_ratio=0.05)
    twin = PhenomenologicalTwin(bearing, parameters, effects)
    conditions = [Condition(f"r{i}", 1500.0, fs_hz, 12000, fault) for i, fault in enumerate(faults)]
    frame = Frame(bearing, (0.15 * fs_hz, 0.25 * fs_hz), 1.0)
    records = twin.simulate(conditions, np.random.default_rng(seed))
    return [summarise(RecordTransforms(r.samples, r.condition, frame)) for r in records]


@pytest.mark.parametrize("name", RATES)
def test_one_mode_and_white_noise_are_found_and_nothing_more(name):
    found = measured(name)
    assert np.exp(found["base_fs"]) == pytest.approx(0.2, rel=0.02)
    assert np.exp(found["base_damping"]) == pytest.approx(0.05, rel=0.2)
    assert found["base_cost"] < 0.8
    # Chance takes at most a few units of chi square for each of a handful of places.
    assert max(found[f"{model}_gain"] for model in path.MODELS) < np.log1p(35)


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("ratio", [0.3, 1.9])
def test_another_mode_is_found_where_it_is(name, ratio):
    fs_hz = RATES[name]
    effect = make_effect("second_resonance", {"frequency_hz": 0.2 * ratio * fs_hz, "damping_ratio": 0.05, "gain": 0.6})
    found = measured(name, [effect])
    assert found["mode_lead"] > 0
    at = [np.exp(found["mode_fs"]), 0.2 * ratio]
    assert at[0] == pytest.approx(at[1], rel=0.05)


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("opposed", [False, True])
def test_whether_a_mode_moves_against_the_first_is_seen(name, opposed):
    values = {"frequency_hz": 0.3 * RATES[name], "damping_ratio": 0.05, "gain": 0.4, "opposed": opposed}
    found = measured(name, [make_effect("second_resonance", values)])
    assert found["mode_lead"] > 0
    assert np.exp(found["mode_fs"]) == pytest.approx(0.3, rel=0.05)
    assert (found["mode_opposed"] > 0) == opposed


@pytest.mark.parametrize("gain", [0.4, 1.5])
@pytest.mark.parametrize("opposed", [False, True])
def test_two_modes_are_found_where_one_fitted_to_both_lies_between(opposed, gain):
    values = {"frequency_hz": 0.3 * RATES["6205"], "damping_ratio": 0.05, "gain": gain, "opposed": opposed}
    best, other = path.two_modes(summaries("6205", [make_effect("second_resonance", values)]), 1.0)
    (first, second), strength = best.frequencies_hz, abs(best.gain)
    if first > second:
        first, second, strength = second, first, 1 / strength
    assert (first, second) == pytest.approx((0.2, 0.3), rel=0.02)
    assert best.dampings == pytest.approx((0.05, 0.05), rel=0.2)
    assert strength == pytest.approx(gain, rel=0.15)
    assert (best.gain < 0) == opposed == (other.gain > 0)


@pytest.mark.parametrize("name", RATES)
def test_a_loss_that_most_noise_passes_is_told_from_one_before_it(name):
    shares = []
    for background in (0.0, 0.95):
        values = {"corner_hz": 0.12 * RATES[name], "order": 2, "background": background}
        shares.append(measured(name, [make_effect("sensor_rolloff", values)])["rolloff_noise"])
    assert shares[0] < 0.3 < 0.6 < shares[1]


@pytest.mark.parametrize("name", RATES)
def test_a_sensor_that_rolls_off_is_no_noise(name):
    fs_hz = RATES[name]
    found = measured(name, [make_effect("sensor_rolloff", {"corner_hz": 0.16 * fs_hz, "order": 4})])
    assert found["rolloff_gain"] > found["slope_gain"]
    assert np.exp(found["rolloff_corner"]) == pytest.approx(0.16, rel=0.25)


@pytest.mark.parametrize("name", RATES)
def test_coloured_noise_is_no_path(name):
    fs_hz = RATES[name]
    pink = {"level": 1.0, "slope": 1.5, "low_hz": 0.002 * fs_hz, "high_hz": 0.5 * fs_hz}
    found = measured(name, [make_effect("coloured_noise", pink)])
    assert found["slope_gain"] > max(found["mode_gain"], found["rolloff_gain"]) - 0.3
    assert found["slope_power"] == pytest.approx(1.5, abs=0.5)


def test_no_record_says_nothing():
    assert all(np.isnan(value) for value in path.measure([]).values())
    assert path.two_modes([], 1.0) == []
