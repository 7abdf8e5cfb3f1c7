"""Initial values of a search: read off features, and fitted to mean spectra with the mode that suits them."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest

from tests.twingap.gap.search.test_optimise import machine
from twingap.effects import Effect, make_effect
from twingap.gap.features.comparison import feature_names
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.gap.search.initial_values import better_initial, observations
from twingap.gap.search.parameter_prior import Prior
from twingap.gap.search.parameter_scale import to_number
from twingap.identification.calibrate import calibrate
from twingap.records import RecordSet
from twingap.twins.twin_file import TwinSpec

SPEC = TwinSpec("phenomenological")


def evidence_of(records: RecordSet) -> Evidence:
    spec = TwinSpec("phenomenological")
    calibrated = calibrate(records, spec, np.random.default_rng(1))
    return Evidence(calibrated, simulator_of(calibrated), spec, 7, THOROUGH)


def spectral(own: Evidence, given: Effect) -> list[Any]:
    """Values that explain the mean spectra best."""
    return list(given.spectral_values(observations(own, np.full(len(feature_names()), np.nan))))


def places(given: Effect, features: np.ndarray, own: Evidence) -> list[Effect]:
    """Initial values by these features."""
    return list(given.initial_values(observations(own, features)))


def begun(own: Evidence, given: Effect) -> Effect:
    """The given values, or better ones."""
    now = own.misfit(own.against([given]).simulator, [given])
    found = better_initial(own, (given,), given.name, own.against().fit, now)
    return found.effect if found else given


@pytest.mark.parametrize(("order", "corner_hz"), [(1, 700.0), (2, 1900.0)])
def test_a_low_pass_is_found_with_the_mode_that_goes_with_it(order: int, corner_hz: float) -> None:
    truth = make_effect("sensor_rolloff", {"order": order, "corner_hz": corner_hz, "background": 0.97})
    own = evidence_of(machine(truth))
    guess = make_effect("sensor_rolloff", {"order": 5, "corner_hz": 2400.0, "background": 0.4})
    first = spectral(own, guess)
    assert min(abs(np.log(one.corner_hz / corner_hz)) for one in first if one.order == order) < 0.35
    found = begun(own, guess)
    misfits = [own.misfit(own.against([e]).simulator, [e]) for e in (truth, found, guess)]
    assert misfits[1] < 1.25 * misfits[0] < misfits[2]


def test_silence_and_bands_without_any_power_are_no_trouble() -> None:
    own = evidence_of(machine(make_effect("quantisation", {"step": 4.0})))
    assert spectral(own, make_effect("sensor_rolloff"))
    assert spectral(own, make_effect("coloured_noise"))
    fit = own.calibrated.fit
    silent = RecordSet(fit.name, fit.unit, fit.bearing, list(fit.conditions), lambda i: np.zeros(fit[i].samples.size))
    own.calibrated = dataclasses.replace(own.calibrated, fit=silent)
    assert spectral(own, make_effect("sensor_rolloff")) == []
    assert spectral(own, make_effect("coloured_noise")) == []


@pytest.mark.parametrize("opposed", [False, True])
def test_a_second_mode_is_found_where_it_is_and_the_way_it_moves(opposed: bool) -> None:
    values = {"frequency_hz": 3600.0, "damping_ratio": 0.04, "gain": 0.9, "opposed": opposed}
    truth = make_effect("second_resonance", values)
    own = evidence_of(machine(truth))
    guess = make_effect("second_resonance", {"frequency_hz": 900.0, "damping_ratio": 0.1, "gain": 0.3})
    found = begun(own, guess)
    assert vars(found)["opposed"] == opposed
    # Either mode may be the twin's own, which is calibrated anew.
    assert min(abs(vars(found)["frequency_hz"] / place - 1) for place in (2400.0, 3600.0)) < 0.05
    misfits = [own.misfit(own.against([e]).simulator, [e]) for e in (truth, found, guess)]
    assert misfits[1] < 1.25 * misfits[0] < misfits[2]


def test_impulses_are_begun_at_as_many_and_as_strong_as_are_counted() -> None:
    values = {"level": 40.0, "rate_hz": 4.0, "resonance_hz": 4200.0, "damping_ratio": 0.1, "spread": 0.2}
    own = evidence_of(machine(make_effect("impulsive_noise", values)))
    guess = make_effect("impulsive_noise", {"level": 9.0, "rate_hz": 40.0, "resonance_hz": 1500.0})
    read = [vars(place) for place in places(guess, own.against().fit, own)]
    best = min(read, key=lambda one: sum(abs(np.log(one[k] / values[k])) for k in ("level", "rate_hz", "resonance_hz")))
    assert best["rate_hz"] == pytest.approx(4.0, rel=0.5)
    assert best["level"] == pytest.approx(40.0, rel=0.5)
    assert best["resonance_hz"] == pytest.approx(4200.0, rel=0.15)


@pytest.mark.parametrize("root", [7, 8, 9])
def test_impulses_of_which_few_records_show_any_are_not_made_rare_and_huge(root: int) -> None:
    truth = {"level": 9.0, "rate_hz": 3.0, "resonance_hz": 2400.0, "damping_ratio": 0.05, "spread": 0.3}
    calibrated = calibrate(machine(make_effect("impulsive_noise", truth)), SPEC, np.random.default_rng(1))
    own = Evidence(calibrated, simulator_of(calibrated), SPEC, root)
    guess = make_effect("impulsive_noise", truth | {"level": 11.0, "rate_hz": 4.0, "spread": 0.95})
    within = {"level": 1.1, "rate_hz": 0.9}
    priors = {(guess.name, p): Prior(to_number(guess, p, own.setting), off) for p, off in within.items()}
    start = better_initial(own, (guess,), guess.name, own.against().fit, np.inf, priors)
    found = vars(start.effect if start else guess)
    assert 0.5 < found["rate_hz"] < 20.0
    assert 4.0 < found["level"] < 25.0


def test_a_good_guess_stays() -> None:
    truth = make_effect("sensor_rolloff", {"order": 2, "corner_hz": 1900.0, "background": 0.97})
    own = evidence_of(machine(truth))
    found = begun(own, truth)
    assert own.misfit(own.against([found]).simulator, [found]) <= own.misfit(own.against([truth]).simulator, [truth])


@pytest.mark.parametrize(("low", "high"), [(600.0, 1400.0), (3000.0, 4200.0)])
@pytest.mark.parametrize("own_simulator", [False, True])
def test_a_band_of_noise_is_read_off_the_healthy_spectra(low: float, high: float, own_simulator: bool) -> None:
    truth = make_effect("coloured_noise", {"level": 0.8, "slope": 0.0, "low_hz": low, "high_hz": high})
    sim = machine() if own_simulator else None
    spec = TwinSpec("phenomenological")
    calibrated = calibrate(machine(truth), None if own_simulator else spec, np.random.default_rng(1), sim=sim)
    own = Evidence(calibrated, simulator_of(calibrated, sim), spec, 7, THOROUGH)
    first = spectral(own, make_effect("coloured_noise"))
    nearest = min(first, key=lambda one: abs(np.log(one.low_hz / low)) + abs(np.log(one.high_hz / high)))
    assert abs(np.log(nearest.low_hz / low)) + abs(np.log(nearest.high_hz / high)) < 0.7
    assert nearest.level == pytest.approx(0.8, rel=0.3)


def test_a_search_for_noise_begins_where_the_healthy_spectra_have_it() -> None:
    truth = make_effect("coloured_noise", {"level": 0.8, "slope": 0.0, "low_hz": 600.0, "high_hz": 1400.0})
    own = evidence_of(machine(truth))
    found = begun(own, make_effect("coloured_noise", {"level": 0.2, "slope": 1.0, "low_hz": 3500.0, "high_hz": 4600.0}))
    assert 450.0 < vars(found)["low_hz"] < 900.0
    assert 1000.0 < vars(found)["high_hz"] < 1900.0


def test_rare_strong_impulses_are_told_from_frequent_weak_ones() -> None:
    truth = make_effect(
        "impulsive_noise", {"level": 60.0, "rate_hz": 4.0, "resonance_hz": 2400.0, "damping_ratio": 0.05}
    )
    own = evidence_of(machine(truth))
    guess = make_effect("impulsive_noise", {"level": 15.0, "rate_hz": 64.0, "resonance_hz": 3300.0})
    found = begun(own, guess)
    assert vars(found)["rate_hz"] < 20.0
    assert vars(found)["resonance_hz"] == pytest.approx(2400.0, rel=0.05)
    misfits = [own.misfit(own.against([e]).simulator, [e]) for e in (found, guess)]
    assert misfits[0] < 0.8 * misfits[1]


def test_loose_parts_that_do_not_impulses_are_tried_too() -> None:
    truth = make_effect("looseness", {"level": 0.8, "decay": 0.97, "n_orders": 8, "in_phase": False})
    own = evidence_of(machine(truth))
    found = begun(own, make_effect("looseness", {"level": 0.2, "decay": 0.97, "n_orders": 8}))
    assert not vars(found)["in_phase"]
    assert vars(found)["level"] > 0.3


def test_an_estimate_that_is_far_too_strong_is_weakened() -> None:
    """A baseline that makes room for too much is a valley of its own, out of which no single step leads."""
    truth = make_effect("waviness", {"level": 0.5, "decay": 0.5, "n_harmonics": 3})
    own = evidence_of(machine(truth))
    guess = make_effect("waviness", {"level": 6.0, "decay": 0.95, "n_harmonics": 8})
    found = begun(own, guess)
    assert vars(found)["level"] <= 1.5
    misfits = [own.misfit(own.against(e).simulator, e) for e in ([found], [], [guess])]
    assert misfits[0] < min(0.7 * misfits[2], 1.2 * misfits[1])
    assert [vars(e)["level"] for e in guess.weaker()] == pytest.approx([3.0, 1.5, 0.72, 0.36])
    assert make_effect("dropout").weaker() == []


def test_a_slope_over_speed_is_an_exponent() -> None:
    truth = make_effect("speed_gain", {"exponent": 2.0, "reference_speed_rpm": 1650.0, "on_noise": 0.0})
    own = evidence_of(machine(truth))
    found = begun(own, make_effect("speed_gain", {"exponent": 0.4, "reference_speed_rpm": 1650.0, "on_noise": 0.5}))
    assert vars(found)["exponent"] == pytest.approx(2.0, abs=0.35)
    assert vars(found)["on_noise"] == 0.0


@pytest.mark.parametrize(
    ("effect", "feature", "value", "parameter", "expected"),
    [
        ("entry_exit", "comb|clear_arc_log", np.log(5.0), "arc_deg", 5.0),
        ("entry_exit", "impacts.cycle_rise_part|all.level", 0.3, "arc_deg", 0.3 * 360 / 9),
        ("speed_gain", "trend|speed_partial", -1.3, "exponent", -1.3),
        ("mean_slip", "context|slip_measured", 0.02, "slip", 0.02),
        ("foreign_bearing", "lines.comb_order|all.level", 5.53, "order", 5.53),
        ("foreign_bearing", "background.foreign_order|healthy.level", 6.31, "order", 6.31),
    ],
)
def test_a_signature_names_a_place(effect: str, feature: str, value: float, parameter: str, expected: float) -> None:
    own = evidence_of(machine())
    features = np.full(len(feature_names()), np.nan)
    without = [vars(place)[parameter] for place in places(make_effect(effect), features, own)]
    assert min((abs(one - expected) for one in without), default=1.0) > 1e-3 * abs(expected)
    features[feature_names().index(feature)] = value
    found = [vars(place)[parameter] for place in places(make_effect(effect), features, own)]
    assert len(found) > len(without)
    assert min(abs(one - expected) for one in found) < 1e-6 * abs(expected)


def test_an_order_of_impacts_from_elsewhere_is_tried_at_every_level_and_once() -> None:
    own = evidence_of(machine())
    features = np.full(len(feature_names()), np.nan)
    for name, order in (("lines.comb_order|all", 5.53), ("background.foreign_order|all", 5.535)):
        features[feature_names().index(f"{name}.level")] = order
    given = make_effect("foreign_bearing", {"level": 8.0, "order": 7.55})
    found = [vars(place) for place in places(given, features, own)]
    in_a_mode = [place["level"] for place in found if place["order"] == 5.53 and not place["own_path"]]
    assert in_a_mode == pytest.approx([8.0, 4.0, 2.0, 0.96, 0.48])
    assert not [place for place in found if place["order"] == 5.535]


def test_orders_of_impacts_from_elsewhere_are_tried_with_this_bearings_path() -> None:
    own = evidence_of(machine())
    features = np.full(len(feature_names()), np.nan)
    features[feature_names().index("lines.comb_order|all.level")] = 2.4
    given = make_effect("foreign_bearing", {"level": 8.0, "order": 7.55})
    found = [vars(place) for place in places(given, features, own)]
    tried = sorted((place["order"], place["sigma"], place["level"]) for place in found if place["own_path"])
    slips = sorted({sigma for _, sigma, _ in tried})
    assert slips[0] == 0
    assert 0.001 < slips[1] < 0.01
    orders, levels = (2.4, 7.55), (4.0, 6.4, 10.0)
    assert np.array(tried) == pytest.approx(np.array(list(itertools.product(orders, slips, levels))))


def test_growth_is_read_as_a_rate_over_the_run() -> None:
    own = evidence_of(machine())
    features = np.full(len(feature_names()), np.nan)
    features[feature_names().index("trend|time_impacts")] = 1.5
    (found,) = places(make_effect("damage_growth"), features, own)
    assert vars(found)["rate_per_s"] * own.setting.span_s == pytest.approx(
        1.0
    )  # the most that is allowed in one second
    features[feature_names().index("trend|time_impacts")] = -1.5
    assert not list(places(make_effect("damage_growth"), features, own))


def test_an_order_that_held_out_records_alone_show_is_tried() -> None:
    """Where a line lies is the same in both parts; no value is fitted to held-out records."""
    own = evidence_of(machine(make_effect("foreign_bearing", {"level": 8.0, "order": 4.37, "resonance_hz": 2600.0})))
    blank = np.full(len(feature_names()), np.nan)
    orders = {vars(place)["order"] for place in places(make_effect("foreign_bearing", {"order": 7.55}), blank, own)}
    assert min(abs(order / 4.37 - 1) for order in orders) < 0.01
