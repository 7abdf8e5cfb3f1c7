"""What estimates say holds values where distance is flat in them, and gives way where it is steep."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from tests.twingap.gap.search.test_optimise import OWN, evidence_of, machine
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.search.optimise import optimise
from twingap.gap.search.parameter_prior import FREEDOM, Prior, penalty, penalty_weight
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import flat

EXPONENT = ("speed_gain", "exponent")


def test_strain_is_that_of_a_t_distribution() -> None:
    priors = Prior(0.7, 0.3)
    for number in (0.7, 0.75, 1.4, -9.0):
        density = student(FREEDOM, priors.number, priors.spread).logpdf
        assert priors.penalty(number) == pytest.approx(2 * (density(priors.number) - density(number)))
        slope = (priors.penalty(number + 1e-6) - priors.penalty(number - 1e-6)) / 2e-6
        assert 2 * priors.stiffness(number) * (number - priors.number) == pytest.approx(slope, abs=1e-6)
    at = {EXPONENT: 1.0, ("", "scale"): 3.0}
    assert penalty({EXPONENT: priors}, at) == priors.penalty(1.0)
    assert penalty({EXPONENT: priors}, {}) == 0.0


def test_an_estimate_that_was_never_off_holds() -> None:
    priors = Prior(3.0, 0.0)
    assert priors.penalty(3.0) == 0.0
    assert priors.penalty(3.01) > Prior(3.0, 0.01).penalty(3.01) > 0
    assert np.isfinite([priors.stiffness(3.0), priors.stiffness(3.01)]).all()


def test_a_strain_counts_less_the_more_records_there_are() -> None:
    assert penalty_weight(4) == 2 * penalty_weight(8) > 0


def one_speed_each(exponent: float) -> RecordSet:
    """Healthy records at one speed and faulty ones at another: an exponent is no other than their amplitude."""
    conditions = [
        Condition(f"{fault}{i}", speed, 10000.0, 10000, fault, group=f"{fault}{i}")
        for fault, speed in (("healthy", 1500.0), ("inner", 2100.0))
        for i in range(4)
    ]
    gain = make_effect("speed_gain", {"exponent": exponent, "reference_speed_rpm": 1500.0})
    made = PhenomenologicalTwin(BEARINGS["6205"], OWN, [gain]).simulate(conditions, np.random.default_rng(4))
    return RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], made)


def test_what_distance_cannot_tell_stays_as_the_estimate_says() -> None:
    own = evidence_of(one_speed_each(1.8))
    start = make_effect("speed_gain", {"exponent": 1.8, "reference_speed_rpm": 1500.0})
    begun = own.against([start]).simulator
    values = flat(begun.spec.parameters)  # type: ignore[attr-defined]
    begun = own.with_values(begun, [start], {"impact_amplitude.inner": 1.4 * values["impact_amplitude.inner"]})
    free = optimise(own, begun, [start], {EXPONENT: 0.4})
    held = optimise(own, begun, [start], {EXPONENT: 0.4}, priors={EXPONENT: Prior(1.8, 0.3)})
    assert vars(free.effects[0])["exponent"] < 1.3
    assert vars(held.effects[0])["exponent"] == pytest.approx(1.8, abs=0.15)
    distances = [own.misfit(found.simulator, found.effects) for found in (free, held)]
    assert distances[1] < 1.1 * distances[0]  # the baseline, put off by 40 %, is held by what calibration says


def test_what_records_show_outweighs_what_an_estimate_says() -> None:
    own = evidence_of(machine(make_effect("mains_interference", {"level": 0.9})))
    start = make_effect("mains_interference", {"level": 0.1})
    priors = {("mains_interference", "level"): Prior(float(np.log(0.1)), 0.3)}
    found = optimise(own, own.against([start]).simulator, [start], {}, priors=priors)
    assert vars(found.effects[0])["level"] == pytest.approx(0.9, rel=0.2)
