"""Spectra that impacts leave: the path shows in them, added noise does not."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.features.impacts import impulse_response
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

RATES = {"6205": 12000.0, "UER204": 25600.0, "ZA-2115": 20000.0}
SPEEDS = (1100.0, 1450.0, 1900.0)


def impact_spectra(name, effects=(), faults=("outer", "inner"), seed=0, amplitude=12.0):
    fs_hz, bearing = RATES[name], BEARINGS[name]
    impacts = dict.fromkeys(("inner", "outer", "ball"), amplitude)
    parameters = PhenomenologicalParameters(
        resonance_hz=0.2 * fs_hz, damping_ratio=0.05, impact_amplitude=impacts
    )  # fmt: skip
    twin = PhenomenologicalTwin(bearing, parameters, effects)
    conditions = [
        Condition(f"{fault}{i}", speed, fs_hz, int(fs_hz), fault)
        for fault in faults for i, speed in enumerate(SPEEDS)
    ]  # fmt: skip
    frame = Frame(bearing, (0.15 * fs_hz, 0.25 * fs_hz), 1.0)
    records = twin.simulate(conditions, np.random.default_rng(seed))
    return [impulse_response.impact_spectrum(RecordTransforms(r.samples, r.condition, frame)) for r in records]


def compared(name, effects, noise=None, **more):
    return impulse_response.compare(impact_spectra(name, effects, seed=1, **more), impact_spectra(name, **more), noise)


@pytest.mark.parametrize("name", RATES)
def test_one_machine_answers_as_it_answered_before(name):
    found = compared(name, ())
    assert abs(found["level"]) < 0.05
    assert found["rms"] < -0.9


@pytest.mark.parametrize("name", RATES)
def test_another_mode_shows_in_the_answer_and_a_band_of_noise_does_not(name):
    fs_hz = RATES[name]
    mode = make_effect("second_resonance", {"frequency_hz": 0.3 * fs_hz, "damping_ratio": 0.03, "gain": 0.8})
    found = compared(name, [mode])
    assert found["bump"] > 0.4
    assert found["bump_fs"] == pytest.approx(0.3, abs=0.02)
    band = {"level": 1.5, "slope": 0.0, "low_hz": 0.27 * fs_hz, "high_hz": 0.33 * fs_hz}
    noisy = compared(name, [make_effect("coloured_noise", band)])
    assert noisy["bump"] < 0.5 * found["bump"]


@pytest.mark.parametrize("name", RATES)
def test_a_sensor_that_rolls_off_takes_from_the_answer_what_it_takes_from_the_noise(name):
    fs_hz = RATES[name]
    f = (np.arange(impulse_response.PLACES) + 0.5) / (2 * impulse_response.PLACES)
    lost = -np.log1p((f / 0.2) ** 8)
    found = compared(name, [make_effect("sensor_rolloff", {"corner_hz": 0.2 * fs_hz, "order": 4})], lost)
    assert found["common"] > 0.9
    assert found["high"] < -0.15 < 0.15 < found["low"]


def test_weak_impacts_are_seen_in_many_records():
    few = compared("6205", (), faults=("outer",), amplitude=1.2)
    strong = compared("6205", (), faults=("outer",), amplitude=12.0)
    assert few["known"] < strong["known"]


def test_nothing_is_said_without_impacts():
    assert all(np.isnan(v) for v in impulse_response.compare([], impact_spectra("6205"), None).values())
    assert impact_spectra("6205", faults=("healthy",)) == [None] * 3


@pytest.mark.parametrize("name", RATES)
def test_tones_of_other_things_are_no_impact_rate(name):
    """Some comb always catches a few of a gear's lines: beside weak impacts windows stay where kinematics has them."""
    rng, fs_hz, bearing = np.random.default_rng(4), RATES[name], BEARINGS[name]
    frame = Frame(bearing, (0.15 * fs_hz, 0.25 * fs_hz), 1.0)
    parameters = PhenomenologicalParameters(0.2 * fs_hz, 0.05, impact_amplitude={"outer": 1.0, "inner": 1.0})
    moved = 0
    for seed in range(8):
        gear = {"level": rng.uniform(0.2, 1.0), "teeth": int(rng.integers(10, 40)), "depth": 0.8, "n_harmonics": 3}
        shaft = {f"level_{k}x": 0.4 / k for k in (1, 2, 3)}
        effects = [make_effect("gear_mesh", gear), make_effect("shaft_harmonics", shaft)]
        conditions = [Condition(f"{f}{s}", s, fs_hz, int(fs_hz), f) for f in ("outer", "inner") for s in SPEEDS]
        twin = PhenomenologicalTwin(bearing, parameters, effects)
        for record in twin.simulate(conditions, np.random.default_rng(seed)):
            transforms = RecordTransforms(record.samples, record.condition, frame)
            rate_hz = transforms.fault_order * transforms.shaft_hz
            moved += impulse_response.impact_spectrum(transforms).power.size != int(
                (0.5 * fs_hz - 0.5 * rate_hz) / rate_hz
            )
    assert moved <= 1
