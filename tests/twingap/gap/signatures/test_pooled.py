"""Lines that only the mean of many records shows."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.signatures import pooled
from twingap.gap.view import Frame, RecordView
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalTwin

RATES = {"6205": 12000.0, "UER204": 25600.0, "ZA-2115": 20000.0}


def whitened(name, effects=(), count=12, faults=("healthy", "outer", "inner"), seed=0):
    fs_hz, bearing = RATES[name], BEARINGS[name]
    speeds = np.linspace(1400.0, 2100.0, count)
    conditions = [
        Condition(f"r{i}", float(speeds[i]), fs_hz, int(fs_hz), faults[i % len(faults)]) for i in range(count)
    ]
    frame = Frame(bearing, (2500.0, 4500.0), 1.0)
    records = PhenomenologicalTwin(bearing, None, effects).simulate(conditions, np.random.default_rng(seed))
    return [pooled.whitened(RecordView(r.samples, r.condition, frame)) for r in records]


def measured(name, *effects, **options):
    return pooled.measure(whitened(name, effects, **options), BEARINGS[name])


@pytest.mark.parametrize("name", RATES)
def test_mains_too_weak_for_one_record_stands_in_the_mean_and_in_hz_only(name):
    hum = make_effect("mains_interference", {"level": 0.03, "mains_hz": 50.0, "n_harmonics": 1})
    with_it, without = measured(name, hum), measured(name)
    assert with_it["mains_50_1"] > 2.0 > without["mains_50_1"] + 0.8
    assert with_it["order_1"] < 2.0


@pytest.mark.parametrize("name", RATES)
def test_what_turns_with_the_shaft_adds_up_in_orders(name):
    gear = make_effect("gear_mesh", {"level": 0.06, "teeth": 29, "depth": 1.0, "n_harmonics": 1})
    found = measured(name, gear)
    assert np.exp(found["gear_teeth"]) == pytest.approx(29)
    assert found["gear"] > measured(name)["gear"]


@pytest.mark.parametrize(("name", "order"), [("6205", 4.3), ("UER204", 3.6), ("ZA-2115", 4.61)])
def test_the_orders_of_another_bearing_are_found(name, order):
    other = make_effect("foreign_bearing", {"level": 4.0, "order": order, "resonance_hz": 3000.0})
    found = measured(name, other)
    assert np.exp(found["foreign_order"]) == pytest.approx(order, rel=0.005)


def test_nothing_looks_like_nothing_however_many_records():
    for count in (6, 24):
        z = [measured("6205", count=count, seed=seed) for seed in range(3)]
        for name in ("mains_50_mean", "half_mean", "order_high", "mains_60_mean"):
            assert abs(np.mean([found[name] for found in z])) < 0.8


def test_no_record_says_nothing():
    assert all(np.isnan(value) for value in pooled.measure([], BEARINGS["6205"]).values())
