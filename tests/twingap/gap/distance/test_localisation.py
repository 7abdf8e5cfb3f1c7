"""Where: no place is named when the twin equals the machine, and what is put somewhere is found there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors, measure_vectors
from twingap.gap.distance.grid import Axis, Grid
from twingap.gap.distance.localisation import adjusted, followed, locate, new_ones, presentable
from twingap.gap.distance.paired import Paired
from twingap.gap.report.model import Place
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Array = NDArray[np.float64]
BEARING = BEARINGS["6205"]
BINS = 60


def conditions_of(n: int, fs_hz: float = 12000.0, samples: int = 6000) -> list[Condition]:
    faults = ("healthy", "outer", "inner", "ball")
    return [Condition(f"r{i}", 1500 + 500 * ((i * 7) % n) / n, fs_hz, samples, faults[i % 4]) for i in range(n)]


def simulate(
    conditions: Sequence[Condition],
    rng: np.random.Generator,
    effects: Sequence[Effect] = (),
    resonance_hz: float = 3000.0,
) -> FeatureVectors:
    twin = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(resonance_hz=resonance_hz), effects)
    frame = Frame(BEARING, (0.7 * resonance_hz, 1.3 * resonance_hz), 1.0)
    vectors = (RecordTransforms(r.samples, r.condition, frame) for r in twin.stream(conditions, rng))
    return measure_vectors(vectors, Grid.of(conditions, BEARING))


def gaussian(
    conditions: Sequence[Condition], rng: np.random.Generator, shift: Array | float = 0.0, tails: bool = False
) -> FeatureVectors:
    edges = np.arange(BINS + 1.0)
    axes: dict[DomainName, Axis] = {
        "order": Axis(edges[:-1], edges[1:], ("lines",) * BINS, "shaft orders"),
        "condition": Axis(np.zeros(2), np.ones(2), ("level", "kurtosis"), ""),
    }
    n = len(conditions)
    noise = rng.standard_t(2, (n, BINS + 2)) if tails else rng.standard_normal((n, BINS + 2))
    both = noise + shift
    return FeatureVectors({"order": both[:, :BINS], "condition": both[:, BINS:]}, axes, tuple(conditions))


@pytest.fixture(scope="module")
def conditions() -> list[Condition]:
    return conditions_of(16)


@pytest.fixture(scope="module")
def replicates(conditions: list[Condition]) -> list[FeatureVectors]:
    rng = np.random.default_rng(0)
    return [simulate(conditions, rng) for _ in range(20)]


def places_of(
    effect: Effect | str, conditions: list[Condition], replicates: list[FeatureVectors], seed: int = 1
) -> tuple[Place, ...]:
    rng = np.random.default_rng(seed)
    real = simulate(conditions, rng, [make_effect(effect) if isinstance(effect, str) else effect])
    return locate(Paired(real, replicates), rng).places


@pytest.mark.parametrize("tails", [False, True])
@pytest.mark.parametrize(("n", "m"), [(1, 40), (2, 20), (8, 3), (16, 1)])
def test_family_wise_error_of_any_shape_of_noise(n: int, m: int, tails: bool) -> None:
    rng = np.random.default_rng(n)
    conditions, worlds = conditions_of(n), 100
    named = sum(bool(locate(Paired(*_world(conditions, m, rng, tails)), rng, draws=99).places) for _ in range(worlds))
    assert named <= binom.ppf(0.999, worlds, 0.05)


def _world(
    conditions: Sequence[Condition], m: int, rng: np.random.Generator, tails: bool
) -> tuple[FeatureVectors, list[FeatureVectors]]:
    return gaussian(conditions, rng, tails=tails), [gaussian(conditions, rng, tails=tails) for _ in range(m)]


@pytest.mark.slow
def test_family_wise_error_of_the_twin_against_itself() -> None:
    """Tiny records in all domains: dependent, discrete and skewed bins."""
    rng = np.random.default_rng(7)
    conditions, worlds, m = conditions_of(4, 4000.0, 256), 100, 2
    named = 0
    for _ in range(worlds):
        real, *sims = (simulate(conditions, rng, resonance_hz=1000.0) for _ in range(m + 1))
        named += bool(locate(Paired(real, sims), rng, draws=99).places)
    assert named <= binom.ppf(0.999, worlds, 0.05)


def test_shares_are_parts_of_the_gap(conditions: list[Condition], replicates: list[FeatureVectors]) -> None:
    rng = np.random.default_rng(3)
    for effects in ((), ("looseness",), ("sensor_rolloff", "slip_jitter")):
        found = locate(Paired(simulate(conditions, rng, [make_effect(e) for e in effects]), replicates), rng)
        shares = [place.share for place in found.places]
        assert sum(shares) <= 1 + 1e-9
        assert all(0 <= share <= 1 for share in shares)
        assert shares == sorted(shares, reverse=True)
        assert bool(found.places) == (found.p_value <= 0.05)


def test_mains_are_found_at_their_frequencies(conditions: list[Condition], replicates: list[FeatureVectors]) -> None:
    lines = [p for p in places_of("mains_interference", conditions, replicates) if p.domain == "frequency"]
    assert any(p.lo is not None and p.hi is not None and p.lo <= 50 <= p.hi <= p.lo + 20 for p in lines)
    assert all(p.unit == "Hz" for p in lines)


def test_a_rolloff_is_found_above_its_corner(conditions: list[Condition], replicates: list[FeatureVectors]) -> None:
    found = [p for p in places_of("sensor_rolloff", conditions, replicates) if p.domain == "frequency"]
    widest = max(found, key=lambda p: (p.hi or 0) - (p.lo or 0))
    assert (widest.lo or 0) > 2000 and (widest.hi or 0) > 4000


def test_half_orders_are_found_at_half_orders(conditions: list[Condition], replicates: list[FeatureVectors]) -> None:
    orders = [p for p in places_of("looseness", conditions, replicates) if p.domain == "order"]
    for half in (0.5, 1.5, 2.5):
        assert any((p.lo or 0) <= half <= (p.hi or 0) for p in orders)
    assert all((p.hi or 99) <= 20 for p in orders)


def test_what_only_faulty_bearings_do_is_said_of_them(
    conditions: list[Condition], replicates: list[FeatureVectors]
) -> None:
    found = places_of("slip_jitter", conditions, replicates)
    named = [p.condition["fault"] for p in found if p.condition and "fault" in p.condition]
    assert named and all("healthy" not in fault for fault in named)


def test_modulation_of_the_inner_race_is_found_at_shaft_sidebands(
    conditions: list[Condition], replicates: list[FeatureVectors]
) -> None:
    found = places_of("load_zone", conditions, replicates)
    lines = [p for p in found if p.domain == "envelope_order" and (p.hi or 0) - (p.lo or 0) < 0.5]
    wanted = [1.0, BEARING.bpfi - 1, BEARING.bpfi + 1, 2 * BEARING.bpfi + 1, 2 * BEARING.bpfi - 1]
    assert any((p.lo or 0) - 0.1 <= w <= (p.hi or 0) + 0.1 for w in wanted for p in lines)


@pytest.mark.parametrize(("n", "m", "size"), [(2, 40, 8.0), (12, 1, 8.0), (16, 20, 1.6)])
def test_a_bin_is_found_among_many_with_few_records_or_few_replicates(n: int, m: int, size: float) -> None:
    rng = np.random.default_rng(11)
    conditions = conditions_of(n)
    shift = np.zeros(BINS + 2)
    shift[[20, 21, 40]] = size
    hits = wrong = 0
    for _ in range(20):
        sims = [gaussian(conditions, rng) for _ in range(m)]
        found = [p for p in locate(Paired(gaussian(conditions, rng, shift), sims), rng).places if p.domain == "order"]
        hits += {(20.0, 22.0), (40.0, 41.0)} <= {(p.lo, p.hi) for p in found}
        wrong += any(p.lo not in (20.0, 21.0, 40.0) for p in found)
    assert hits >= 14
    assert wrong <= binom.ppf(0.999, 20, 0.05)


def test_a_loud_bin_does_not_hide_a_faint_one() -> None:
    rng = np.random.default_rng(12)
    conditions = conditions_of(12)
    shift = np.zeros(BINS + 2)
    shift[5], shift[30] = 100.0, 2.0
    sims = [gaussian(conditions, rng) for _ in range(10)]
    found = locate(Paired(gaussian(conditions, rng, shift), sims), rng).places
    assert {5.0, 30.0} <= {p.lo for p in found}
    assert found[0].lo == 5.0 and found[0].share > 0.9


def test_a_level_that_grows_with_speed_is_a_place_of_condition() -> None:
    rng = np.random.default_rng(13)
    conditions = conditions_of(24)
    speed = np.array([c.speed_rpm for c in conditions])
    shift = np.zeros((24, BINS + 2))
    shift[:, BINS] = (speed - speed.min()) / 80
    sims = [gaussian(conditions, rng) for _ in range(10)]
    found = locate(Paired(gaussian(conditions, rng, shift), sims), rng).places
    (place,) = [p for p in found if p.domain == "condition" and p.condition and "speed_rpm" in p.condition]
    assert place.condition is not None
    lo, hi = place.condition["speed_rpm"]
    assert speed.min() < lo < hi == speed.max()
    assert (place.lo, place.hi) == (None, None)


def test_a_level_of_one_fault_is_a_place_of_condition_that_names_it() -> None:
    rng = np.random.default_rng(14)
    conditions = conditions_of(16)
    shift = np.zeros((16, BINS + 2))
    shift[[c.fault == "inner" for c in conditions], BINS] = 6.0
    sims = [gaussian(conditions, rng) for _ in range(10)]
    found = locate(Paired(gaussian(conditions, rng, shift), sims), rng).places
    assert {"fault": "inner"} in [p.condition for p in found if p.domain == "condition"]


def test_step_down_agrees_with_its_definition() -> None:
    rng = np.random.default_rng(15)
    statistics = np.abs(rng.standard_normal((50, 8))).astype(np.float32)
    statistics[0, [2, 5]] += 2
    order = np.argsort(-statistics[0])
    expected, running = np.empty(8), 0.0
    for k, i in enumerate(order):
        rest = order[k:]
        running = max(running, float(np.mean(statistics[:, rest].max(axis=1) >= statistics[0, i])))
        expected[i] = running
    assert adjusted(statistics) == pytest.approx(expected)


def test_signs_and_what_adding_an_effect_does_to_a_place() -> None:
    """Bins 5 to 9 are higher in the records and close, 20 to 24 are higher in the twin, 40 to 44 the new twin makes."""
    conditions, rng = conditions_of(16), np.random.default_rng(3)
    high, low, made = np.zeros(BINS + 2), np.zeros(BINS + 2), np.zeros(BINS + 2)
    high[5:10], low[20:25], made[40:45] = 3.0, -3.0, -3.0
    real = gaussian(conditions, rng, high + low)
    before = Paired(real, [gaussian(conditions, rng) for _ in range(5)])
    after = Paired(real, [gaussian(conditions, rng, high - made) for _ in range(5)])
    places, rest = locate(before, rng).places, locate(after, rng).places
    assert {(p.lo, p.sign) for p in places} == {(5.0, "records_higher"), (20.0, "twin_higher")}
    told = {p.lo: p.after for p in followed(presentable(places), rest, before, after)}
    assert told == {5.0: "gone", 20.0: "same"}
    assert {p.lo: p.after for p in new_ones(rest, places)} == {20.0: None, 40.0: "new"}


def test_overlapping_places_are_one_and_small_ones_are_left_out() -> None:
    kept = presentable(
        [
            Place("frequency", 100.0, 200.0, "Hz", 0.2, 0.01, sign="records_higher"),
            Place("frequency", 150.0, 300.0, "Hz", 0.1, 0.001, sign="records_higher"),
            Place("frequency", 290.0, 310.0, "Hz", 0.3, 0.001, sign="twin_higher"),
            Place("order", 100.0, 200.0, "shaft orders", 0.009, 0.001, sign="records_higher"),
            Place("condition", None, None, "", 0.05, 0.001, {"fault": "inner"}),
            Place("condition", None, None, "", 0.05, 0.001, {"speed_rpm": [1.0, 2.0]}),
        ]
    )
    assert [(p.lo, p.hi, round(p.share, 3), p.p_value) for p in kept[:2]] == [
        (100.0, 300.0, 0.3, 0.001),
        (290.0, 310.0, 0.3, 0.001),
    ]
    assert [p.domain for p in kept[2:]] == ["condition", "condition"]
