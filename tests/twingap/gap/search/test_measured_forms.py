"""Roll-off and noise take the form of the records where it is another than the regular one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.twingap.gap.search.test_free_spectra import OWN, evidence_of
from twingap.bearing import BEARINGS
from twingap.effects import ColouredNoise, Effect, SensorRolloff, make_effect
from twingap.effects.sensor_rolloff import RealPoleRolloff
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.measured_forms import with_measured_forms
from twingap.gap.search.optimise import validation_distance
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalTwin


def both(evidence: Evidence, given: Effect) -> tuple[float, float, Effect]:
    """Distance of the fit part with the regular form, with the measured one, and the latter."""
    compared = evidence.against((given,))
    simulator, (found,) = with_measured_forms(evidence, compared.simulator, (given,))
    before = validation_distance(evidence, compared.simulator, (given,))
    return before, validation_distance(evidence, simulator, (found,)), found


def test_a_roll_off_of_another_form_gets_its_gain() -> None:
    """Equal real poles, which fall earlier and more slowly than a Butterworth filter of the same corner."""
    true = RealPoleRolloff(corner_hz=2500.0, order=2, background=1.0)
    before, after, found = both(evidence_of(true), SensorRolloff(corner_hz=2500.0, order=2, background=1.0))
    assert after < 0.65 * before
    assert isinstance(found, SensorRolloff) and found.frequencies_hz
    assert np.all(np.diff(found.gains_db) <= 0)
    places = np.linspace(600.0, 4000.0, 20)
    pole_hz = true.corner_hz / np.sqrt(np.sqrt(2) - 1)
    off = found.gain_db(places) + 20 * np.log10(1 + (places / pole_hz) ** 2)
    # A level common to all frequencies is the calibrated twin's.
    assert np.abs(off - np.median(off)).max() < 1.5
    assert found.corner_hz == 2500.0 and "corner_hz" in found.measured_parameters


def test_noise_of_another_form_gets_its_density() -> None:
    """A hump with soft edges, which no band has."""
    places = (0.0, 3000.0, 3800.0, 4600.0, 5000.0)
    true = ColouredNoise(level=1.5, frequencies_hz=places, densities_db=(-80.0, -50.0, -27.0, -50.0, -80.0))
    given = ColouredNoise(level=1.5, slope=0.0, low_hz=3500.0, high_hz=4100.0)
    before, after, found = both(evidence_of(true), given)
    assert after < 0.7 * before
    assert isinstance(found, ColouredNoise) and found.frequencies_hz
    at = np.array([3500.0, 3800.0, 4100.0, 4300.0])
    got, wanted = (10 * np.log10(of.density(at, 10000.0)) for of in (found, true))
    assert got - got[1] == pytest.approx(wanted - wanted[1], abs=2.5)


@pytest.mark.parametrize(
    "true",
    [
        make_effect("sensor_rolloff", {"corner_hz": 1500.0, "order": 2, "background": 1.0}),
        make_effect("coloured_noise", {"level": 2.0, "slope": 0.0, "low_hz": 3500.0, "high_hz": 4500.0}),
    ],
    ids=lambda effect: effect.name,
)
def test_the_measured_form_is_never_farther(true: Effect) -> None:
    before, after, _ = both(evidence_of(true), true)
    assert after <= before


def test_measured_forms_are_simulated_as_stated() -> None:
    """The gain of a roll-off, and the power and density of a noise."""
    n, fs_hz = 40_000, 10_000.0
    rolloff = SensorRolloff(frequencies_hz=(0.0, 1000.0, 4000.0), gains_db=(0.0, 0.0, -20.0))
    hz = np.fft.rfftfreq(n, 1 / fs_hz)
    gains = 20 * np.log10(np.abs(rolloff._response(n, fs_hz)))
    np.testing.assert_allclose(np.interp([500.0, 2500.0, 4000.0], hz, gains), [0.0, -10.0, -20.0], atol=0.5)
    noise = ColouredNoise(
        level=1.5, frequencies_hz=(0.0, 999.0, 1001.0, 5000.0), densities_db=(-33.0, -33.0, -43.0, -43.0)
    )
    twin, bare = (PhenomenologicalTwin(BEARINGS["6205"], OWN, effects) for effects in ((noise,), ()))
    conditions = [Condition("a", 1500.0, fs_hz, n, "healthy")]
    added = (
        twin.simulate(conditions, np.random.default_rng(0))[0].samples
        - bare.simulate(conditions, np.random.default_rng(0))[0].samples
    )
    power = np.square(np.abs(np.fft.rfft(added))) * 2 / (n * fs_hz) / (1.5 * bare.reference_rms) ** 2
    for low, high, level in ((100, 900, -33.0), (1200, 4800, -43.0)):
        inside = (hz > low) & (hz < high)
        assert 10 * np.log10(power[inside].mean()) == pytest.approx(level, abs=0.5)


def test_a_report_lists_as_few_numbers_as_describe_the_form() -> None:
    """So that they can be pasted into a twin file, which then simulates the same within half a decibel."""
    places = np.linspace(0.0, 5000.0, 122)
    gains = -10 * np.log10(1 + (places / 2000.0) ** 6)
    rolloff = SensorRolloff(frequencies_hz=tuple(places.tolist()), gains_db=tuple(gains.tolist()))
    listed = rolloff.listed_profiles
    assert len(listed["frequencies_hz"]) == len(listed["gains_db"]) < 25
    short = SensorRolloff(**listed)
    np.testing.assert_allclose(short.gain_db(places), gains, atol=0.6)
    assert not any(SensorRolloff().listed_profiles.values())
