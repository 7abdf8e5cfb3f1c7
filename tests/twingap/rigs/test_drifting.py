"""The drifting machine: what drives it moves it the way physics says, and a poor line does what it is asked to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import welch

from twingap.errors import TwingapError
from twingap.rigs import make_rig
from twingap.rigs.drifting import STIFFNESS, WEAR, Course, Drifting, arrivals


@pytest.fixture(scope="module")
def course() -> Course:
    return Drifting().course(0)


def test_warming_up_thins_the_oil_and_closes_the_clearance(course: Course) -> None:
    early, warm = slice(0, 3), slice(80, 90)  # the first minutes, and an hour and a half later
    assert course.temperature_c[warm].mean() > course.temperature_c[early].mean() + 25
    assert course.damping[warm].mean() < 0.6 * course.damping[early].mean()
    assert course.clearance_um[warm].mean() < course.clearance_um[0] - 0.3


def test_cooling_thickens_the_oil_again(course: Course) -> None:
    part = course.time_s / course.time_s[-1]
    cooled, before = course.damping[(part > 0.26) & (part < 0.29)], course.damping[(part > 0.15) & (part < 0.17)]
    assert cooled.min() > 1.2 * before.max()


def test_wear_takes_what_is_stated_and_no_drift_takes_nothing(course: Course) -> None:
    assert course.stiffness[0] == STIFFNESS and course.stiffness[-1] == pytest.approx(STIFFNESS * (1 - WEAR))
    assert (np.diff(course.stiffness) <= 0).all()
    still = Drifting(drift=0.0).course(0)
    for values in (still.stiffness, still.damping, still.clearance_um, still.temperature_c):
        assert np.ptp(values) < 0.02 * values.mean()


def test_the_resonance_falls_with_the_stiffness() -> None:
    records = Drifting(duration_h=14.0, snapshot_s=0.5).records(0)

    def peak(place: int) -> float:
        f, p = welch(records[place].samples, 12000, nperseg=1024)
        return float(f[f > 500][p[f > 500].argmax()])

    # Frequency goes with K^(1/3) F^(1/6) of a Hertz contact, clearance apart; loads differ by less than a third.
    new, worn = np.median([peak(p) for p in (14, 15, 16)]), np.median([peak(p) for p in (76, 77, 78)])
    assert (1 - WEAR) ** (1 / 3) * 0.9 < worn / new < (1 - WEAR) ** (1 / 3) * 1.1


def test_same_seed_same_bytes_in_any_order() -> None:
    one, two = (Drifting(duration_h=1.0, snapshot_s=0.2).records(3) for _ in range(2))
    _ = two[4].samples
    np.testing.assert_array_equal(one[1].samples, two[1].samples)
    assert not np.array_equal(one[1].samples, Drifting(duration_h=1.0, snapshot_s=0.2).records(4)[1].samples)


def test_a_poor_line_loses_repeats_and_reorders_as_asked() -> None:
    sent = np.arange(0.0, 60_000.0, 60.0)
    at, which = arrivals(sent, np.random.default_rng(0), lost=0.1, repeated=0.2, delay_s=60.0)
    assert (np.diff(at) >= 0).all() and (at >= sent[which]).all()
    assert np.unique(which).size == pytest.approx(0.9 * sent.size, rel=0.05)
    assert which.size == pytest.approx(0.9 * 1.2 * sent.size, rel=0.05)
    assert (np.diff(which) < 0).mean() > 0.1
    still, order = arrivals(sent, np.random.default_rng(0), lost=0.0, repeated=0.0, late=0.0, delay_s=1e-9)
    np.testing.assert_allclose(still, sent, atol=1e-6)
    np.testing.assert_array_equal(order, np.arange(sent.size))


def test_it_is_made_by_name_and_records_what_its_instruments_read() -> None:
    rig = make_rig("drifting", duration_h=1.0, snapshot_s=0.2, state_period_s=60.0, snapshot_period_s=600.0)
    assert rig == Drifting(duration_h=1.0, snapshot_s=0.2)
    records, course = rig.records(3), Drifting(duration_h=1.0, snapshot_s=0.2).course(3)
    assert records.unit == "m/s^2" and len(records) == 5 and records.groups == ("machine",)
    for number, condition in enumerate(records.conditions):
        at = 10 * (number + 1)  # a snapshot every ten state messages
        assert condition.time_s == course.time_s[at] and condition.speed_rpm == course.speed_rpm[at]
        assert condition.load_n == course.load_n[at] and condition.extra["temperature_c"] == course.temperature_c[at]
        assert condition.fault == "healthy" and condition.n_samples == 2400
    assert records[2].samples.shape == (2400,) and records[2].samples.std() > 0


def test_impossible_options_are_one_line() -> None:
    with pytest.raises(TwingapError, match=r"rig drifting: drift = 9, between 0 and 1\.5 expected"):
        Drifting(drift=9.0)
