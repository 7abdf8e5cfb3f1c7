"""What was done to simulated spectra: one change at a time."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Mode, make_effect
from twingap.gap.features.spectrum import change
from twingap.gap.features.spectrum.record_summary import summarise
from twingap.gap.knowledge.machines import StructuredTwin
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters

FS_HZ = 12000.0
FAULTS = ("healthy",) * 4 + ("outer", "inner") * 3
OWN_MODES = (Mode(0.33 * FS_HZ, 0.03, 0.7), Mode(0.08 * FS_HZ, 0.05, 0.4))
"""What machine and simulator both have."""


def summaries(effects=(), seed=0, *, scale=1.0, tilt=0.0, part=0.0, modes=OWN_MODES, resonance=0.2, faults=FAULTS):
    bearing = BEARINGS["6205"]
    parameters = PhenomenologicalParameters(
        resonance_hz=resonance * FS_HZ, damping_ratio=0.05, impact_amplitude=dict.fromkeys(("inner", "outer"), 8.0),
        structure_noise_rms=0.8, white_noise_rms=0.6, scale=scale,
    )  # fmt: skip
    twin = StructuredTwin(bearing, parameters, effects, modes, 0.0, tilt, part)
    conditions = [Condition(f"r{i}", 1500.0 + 20 * i, FS_HZ, 12000, fault) for i, fault in enumerate(faults)]
    frame = Frame(bearing, (0.15 * FS_HZ, 0.25 * FS_HZ), 1.0)
    records = [
        RecordTransforms(r.samples, r.condition, frame) for r in twin.simulate(conditions, np.random.default_rng(seed))
    ]
    return [summarise(v) for v in records]


def compared(*effects, own=False, **about):
    return change.compare(summaries(effects, 1, **about), summaries(seed=2), same_sampling=own)


@pytest.mark.parametrize("about", [{}, {"scale": 1.3}, {"tilt": 0.15}, {"tilt": -0.3}, {"resonance": 0.201}])
def test_levels_and_small_errors_of_calibration_are_no_change(about):
    found = compared(**about)
    assert found["base_cost"] < 0.7
    # Chance takes at most a few units of chi square for each of a handful of places.
    assert max(found[f"{c}_gain"] for c in change.CHANGES) < np.log1p(40)


@pytest.mark.parametrize("effects", [(), (make_effect("sensor_rolloff", {"corner_hz": 0.22 * FS_HZ, "order": 2}),)])
def test_a_response_that_is_no_sum_of_samples_of_ringing_loses_nothing_by_a_sensor(effects):
    found = change.compare(summaries(effects, 1, part=0.8, modes=()), summaries(seed=2, modes=()))
    assert (found["rolloff_gain"] > np.log1p(150)) == bool(effects)
    if not effects:
        assert found["continuous"] == pytest.approx(0.8, abs=0.35)
        alike = change.compare(summaries(seed=1, part=0.8, modes=()), summaries(seed=2, modes=()), same_sampling=True)
        # A simulator of this machine is sampled as the machine is.
        assert alike["base_cost"] > found["base_cost"] + 0.1


@pytest.mark.parametrize("place", [0.05, 0.14, 0.27])
def test_another_mode_is_found_where_it_is_among_those_that_both_have(place):
    extra = {"frequency_hz": place * FS_HZ, "damping_ratio": 0.03, "gain": 0.5}
    found = compared(make_effect("second_resonance", extra))
    assert found["mode_lead"] > 0
    assert np.exp(found["mode_fs"]) == pytest.approx(place, rel=0.04)
    assert found["mode_gain"] > np.log1p(150)


@pytest.mark.parametrize("modes", [(), OWN_MODES])
def test_a_mode_that_moves_a_sensor_against_the_others_is_no_noise(modes):
    """It takes away below its peak what it adds above: noise does neither, and one more heap of power not both."""
    extra = {"frequency_hz": 0.12 * FS_HZ, "damping_ratio": 0.06, "gain": 0.7, "opposed": True}
    real = summaries((make_effect("second_resonance", extra),), 1, modes=modes)
    found = change.compare(real, summaries(seed=2, modes=modes))
    assert found["parallel_lead"] > 0.3
    assert found["parallel_over_mode"] > 0.2
    assert np.exp(found["parallel_fs"]) == pytest.approx(0.12, rel=0.08)
    assert found["parallel_strength"] < 0


def test_noise_in_a_band_adds_the_same_power_to_noise_and_impacts():
    band = {"level": 0.5, "slope": 0.0, "low_hz": 0.10 * FS_HZ, "high_hz": 0.16 * FS_HZ}
    found = compared(make_effect("coloured_noise", band))
    assert found["band_lead"] > -0.15
    assert found["band_gain"] > max(found["power_law_gain"], found["rolloff_gain"]) + 0.2
    assert np.exp(found["band_low"]) == pytest.approx(0.10, abs=0.02)
    assert np.exp(found["band_high"]) == pytest.approx(0.16, abs=0.035)
    # A mode that impacts excite rises over struck spectra as over quiet ones; added noise drowns among impacts.
    assert found["band_noise"] > found["band_impacts"]


def test_noise_of_a_power_law_is_told_from_a_mode():
    pink = {"level": 1.0, "slope": 1.5, "low_hz": 0.002 * FS_HZ, "high_hz": 0.5 * FS_HZ}
    found = compared(make_effect("coloured_noise", pink))
    assert max(found["power_law_lead"], found["power_law_gain"] - found["mode_gain"]) > 0
    assert found["power_law_exponent"] == pytest.approx(1.5, abs=0.5)


def test_a_sensor_that_rolls_off_leads_and_says_where():
    found = compared(make_effect("sensor_rolloff", {"corner_hz": 0.22 * FS_HZ, "order": 2}))
    assert found["rolloff_lead"] > 0.2
    assert np.exp(found["rolloff_corner"]) == pytest.approx(0.22, rel=0.3)
    assert found["rolloff_impacts"] < -0.5


def test_healthy_records_alone_are_enough_to_see_a_mode():
    extra = make_effect("second_resonance", {"frequency_hz": 0.14 * FS_HZ, "damping_ratio": 0.03, "gain": 0.5})
    healthy = ("healthy",) * 8
    found = change.compare(summaries([extra], 1, faults=healthy), summaries(seed=2, faults=healthy))
    assert found["mode_gain"] > np.log1p(100)
    assert np.isnan(found["mode_balance"])


def test_sets_that_are_no_pairs_say_nothing():
    ours = summaries()
    assert all(np.isnan(value) for value in change.compare(ours, ours[:-1]).values())
    assert all(np.isnan(value) for value in change.compare([], []).values())
