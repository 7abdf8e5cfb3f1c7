"""Features as normal deviates: even where nothing differs, whatever the number of records and what conditions do."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.distance.grid import Grid
from twingap.gap.features.comparison import compare, feature_names, measure_records
from twingap.gap.features.group_statistics import paired_z
from twingap.gap.features.measured import Pair
from twingap.gap.features.pooled import features as pooled
from twingap.records import Condition
from twingap.signal.record_transforms import Frame
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin


def beyond(z, limit=2.0):
    z = z[np.isfinite(z)]
    return np.mean(np.abs(z) > limit)


def compared(real, simulated):
    """Features by name, of these records alone."""
    ours, theirs = real.pooled, simulated.pooled
    values = compare(Pair(real, simulated), None, pooled.compare(ours, theirs, pooled.levels(ours, theirs)))
    return dict(zip(feature_names(), values, strict=True))


def test_pairs_share_what_conditions_do():
    rng, width = np.random.default_rng(0), 3000
    kinds = np.repeat(["healthy", "outer", "inner"], [4, 3, 3])
    condition = 30.0 * rng.standard_normal((10, width))  # of speed and fault: the same in both of a pair
    ours, theirs = (condition + rng.standard_normal((10, width)) for _ in range(2))
    small, nothing = np.full(width, 1e-3), np.full(width, np.nan)
    assert beyond(paired_z(ours - theirs, kinds, small, nothing)) == pytest.approx(0.045, abs=0.02)
    moved = paired_z(ours + 3.0 - theirs, kinds, small, nothing)
    assert np.median(moved) > 3
    # One pair of a kind has no spread: what the records of each side say stands instead.
    assert np.isnan(paired_z(ours[:1] - theirs[:1], kinds[:1], small, nothing)).all()


def test_distances_are_features_of_the_view_in_which_sets_lie_apart():
    bearing = BEARINGS["6205"]
    conditions = [Condition(f"r{i}", 1750.0 + 20 * i, 10000.0, 10000, "healthy") for i in range(6)]
    frame, grid = Frame(bearing, (1500.0, 3500.0), 1.0), Grid.of(conditions, bearing)

    def measured(seed, *effects):
        twin = PhenomenologicalTwin(bearing, PhenomenologicalParameters(2500.0, 0.05), effects)
        return measure_records(twin.simulate(conditions, np.random.default_rng(seed)), frame, grid)

    plain = measured(1)
    tones = measured(2, make_effect("shaft_harmonics", {"level_1x": 0.2, "level_2x": 0.2, "level_3x": 0.2}))
    same, apart = compared(plain, measured(3)), compared(plain, tones)
    assert abs(same["distance|all_domains"]) < 0.6
    assert apart["distance|order"] > 0.6 > abs(same["distance|order"])
    assert apart["distance|frequency_lines"] > abs(apart["distance|frequency_level"])


@pytest.mark.parametrize("slip", [0.0, 0.012, -0.03])
def test_rates_of_several_faults_give_one_slip(slip):
    bearing = BEARINGS["6205"]
    conditions = [
        Condition(f"{fault}{i}", 1500.0 + 100 * i, 12000.0, 12000, fault)
        for fault in ("healthy", "inner", "outer") for i in range(3)
    ]  # fmt: skip
    frame, grid = Frame(bearing, (1800.0, 3200.0), 1.0), Grid.of(conditions, bearing)

    def measured(seed, *effects):
        parameters = PhenomenologicalParameters(2500.0, 0.05, impact_amplitude={"inner": 8.0, "outer": 8.0})
        twin = PhenomenologicalTwin(bearing, parameters, effects)
        return measure_records(twin.simulate(conditions, np.random.default_rng(seed)), frame, grid)

    found = compared(measured(1, make_effect("mean_slip", {"slip": slip})), measured(2))
    assert found["context|slip_measured"] == pytest.approx(slip, abs=8e-4)
    assert found["context|slip_measured_rest"] < np.log(1e-3)
