"""How far: closures and their intervals, and metrics that move when what is missing is added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from twingap.gap.distance.closure import Closure, closure, closure_interval, paired
from twingap.gap.distance.closure_metrics import accuracy_between_records, closure_metrics, with_statistics
from twingap.gap.distance.curves import curves
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Axis
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.two_sample_tests import two_sample_tests
from twingap.records import Condition

Array = NDArray[np.float64]
BINS = 40
MISSING = np.where(np.arange(BINS) < 8, 3.0, 0.0)


def conditions_of(n: int) -> tuple[Condition, ...]:
    faults = ("healthy", "outer", "inner", "ball")
    return tuple(Condition(f"r{i}", 1500 + 500 * ((i * 7) % n) / n, 12000, 600, faults[i % 4]) for i in range(n))


def vectors_of(conditions: Sequence[Condition], rng: np.random.Generator, shift: Array | float = 0.0) -> FeatureVectors:
    edges = np.arange(BINS + 1.0)
    axes: dict[DomainName, Axis] = {"order": Axis(edges[:-1], edges[1:], ("lines",) * BINS, "shaft orders")}
    return FeatureVectors({"order": rng.standard_normal((len(conditions), BINS)) + shift}, axes, tuple(conditions))


def many(
    conditions: Sequence[Condition], rng: np.random.Generator, shift: Array | float, m: int = 10
) -> list[FeatureVectors]:
    return [vectors_of(conditions, rng, shift) for _ in range(m)]


def gap_closure(
    real: FeatureVectors,
    before: list[FeatureVectors],
    after: list[FeatureVectors],
    rng: np.random.Generator,
    draws: int = 400,
) -> Closure:
    pairs = paired(real, before, after)
    return closure_interval(*pairs, pairs[1].floor(rng)[0], rng, draws)


def test_closure_is_bounded_and_needs_a_gap() -> None:
    assert closure(2.0, 1.0, 0.0) == pytest.approx(0.5)
    assert closure(2.0, 0.1, 0.1) == pytest.approx(1.0)
    assert closure(1.0, 1.5, 0.0) == pytest.approx(-0.5)
    assert closure(0.1, 0.0, 0.1) == 0.0
    assert closure(0.11, 50.0, 0.1) == -10.0


@pytest.mark.parametrize(("n", "m"), [(8, 10), (24, 10), (12, 1)])
@pytest.mark.parametrize("left", [0.0, 1.0, 2.0])
def test_intervals_of_the_closure_cover(n: int, m: int, left: float) -> None:
    """With many replicates, as of a twin, and with one, as of a simulator of the user's own."""
    rng = np.random.default_rng(n)
    conditions, worlds = conditions_of(n), 60
    found = []
    for _ in range(worlds):
        real = vectors_of(conditions, rng, MISSING)
        before, after = many(conditions, rng, 0.0, m), many(conditions, rng, MISSING * (1 - left / 3), m)
        found.append(gap_closure(real, before, after, rng, draws=150))
    floor = np.mean([f.floor for f in found])
    # Spread is 1, and a fifth of it is added in squares.
    with_gap, without = (d / np.sqrt(1.04) * np.sqrt(8 / BINS) for d in (3.0, left))
    truth = (with_gap - max(without, floor)) / (with_gap - floor)
    covered = sum(f.ci[0] <= truth <= f.ci[1] for f in found)
    assert covered >= binom.ppf(0.001, worlds, 0.9)
    assert np.mean([f.closure for f in found]) == pytest.approx(truth, abs=0.1 if m > 1 else 0.2)
    assert np.mean([f.ci[1] - f.ci[0] for f in found]) < 1


def test_nothing_added_closes_nothing() -> None:
    rng = np.random.default_rng(2)
    conditions = conditions_of(16)
    found = gap_closure(
        vectors_of(conditions, rng, MISSING), many(conditions, rng, 0.0), many(conditions, rng, 0.0), rng
    )
    assert abs(found.closure) < 0.1
    assert found.ci[0] <= 0 <= found.ci[1]
    assert found.before > 5 * found.floor


def test_metrics_fall_to_their_floors_when_what_is_missing_is_added() -> None:
    rng = np.random.default_rng(3)
    conditions = conditions_of(16)
    effect = np.zeros((16, BINS))
    for i, c in enumerate(conditions):  # faults differ in a way that the first twin has wrong
        effect[i, {"healthy": 0, "outer": 1, "inner": 2, "ball": 3}[c.fault or ""]] = 8.0
    wrong = np.roll(effect, 1, axis=0)
    metrics = closure_metrics(
        vectors_of(conditions, rng, effect), many(conditions, rng, wrong), many(conditions, rng, effect), rng
    )
    by_name = {m.metric: m for m in metrics}
    assert metrics[0].metric == "overall gap"
    assert len(by_name) == len(metrics) == 5
    for metric in metrics:
        assert metric.closure is not None and 0.6 < metric.closure < 1.5
        assert metric.ci_after[0] <= metric.after <= metric.ci_after[1]
        assert metric.higher_is_better == ("accuracy" in metric.metric)
    (accuracy,) = [m for m in metrics if m.higher_is_better]
    assert accuracy.before < 0.2 and accuracy.after > 0.9 and accuracy.floor > 0.7


def test_where_nothing_is_added_no_measure_moves() -> None:
    rng = np.random.default_rng(8)
    conditions = conditions_of(16)
    sims = many(conditions, rng, 0.0, 4)
    for metric in closure_metrics(vectors_of(conditions, rng, 0.1 * MISSING), sims, sims, rng):
        assert metric.before == metric.after, metric.metric


def test_a_test_states_the_statistic_of_the_measure_and_its_own_p_value() -> None:
    rng = np.random.default_rng(10)
    conditions = tuple(replace(c, group=f"g{i // 2}") for i, c in enumerate(conditions_of(8)))
    real, sims = vectors_of(conditions, rng, 0.3 * MISSING), many(conditions, rng, 0.0, 12)
    tests = two_sample_tests(Paired(real, sims), rng, 99)
    metrics = {m.metric: m for m in closure_metrics(real, sims[:3], sims[:3], rng)}
    auc, mmd = with_statistics(tests, metrics.values())
    assert auc.statistic == metrics["AUC of a classifier, records against twin"].before != tests[0].statistic
    assert mmd.statistic == metrics["MMD^2 between records and twin"].before != tests[1].statistic
    assert [auc.p_value, mmd.p_value] == [test.p_value for test in tests]
    assert with_statistics(tests, ()) == tuple(tests)


def test_accuracy_is_left_out_where_one_record_of_a_fault_has_no_other_to_be_learnt_from() -> None:
    rng = np.random.default_rng(9)
    for each, told in ((1, False), (2, True)):
        few = tuple(c for c in conditions_of(16) if c.fault in ("inner", "outer"))
        kept = [c for fault in ("inner", "outer") for c in [c for c in few if c.fault == fault][:each]]
        metrics = closure_metrics(vectors_of(kept, rng), many(kept, rng, 0.0, 3), many(kept, rng, 0.0, 3), rng)
        assert any(m.higher_is_better for m in metrics) == told


def test_accuracy_is_left_out_where_faults_are_unknown() -> None:
    rng = np.random.default_rng(4)
    hidden = tuple(replace(c, fault=None) for c in conditions_of(8))
    metrics = closure_metrics(vectors_of(hidden, rng), many(hidden, rng, 0.0, 3), many(hidden, rng, 0.0, 3), rng)
    assert not any(m.higher_is_better for m in metrics)


def test_labels_of_the_same_group_are_not_learnt_from() -> None:
    """Groups carry a signature that betrays the fault, and nothing else does: without it there is only chance."""
    rng = np.random.default_rng(5)
    faults = ["outer", "inner"] * 24
    groups = [f"g{i // 2 % 6}{fault}" for i, fault in enumerate(faults)]
    own = {g: 5 * rng.standard_normal(BINS) for g in groups}
    conditions = [
        Condition(f"r{i}", 1800, 12000, 600, f, group=g) for i, (f, g) in enumerate(zip(faults, groups, strict=True))
    ]
    real = vectors_of(conditions, rng, np.stack([own[g] for g in groups]))
    assert accuracy_between_records(real, faults, groups, rng).mean() < 0.75
    alone = [c.name for c in conditions]
    assert accuracy_between_records(real, faults, alone, rng).mean() > 0.95


@pytest.mark.parametrize("n", [1, 2, 3])
def test_few_records_are_enough_to_run(n: int) -> None:
    rng = np.random.default_rng(6)
    conditions = conditions_of(n)
    metrics = closure_metrics(
        vectors_of(conditions, rng, MISSING), many(conditions, rng, 0.0, 4), many(conditions, rng, MISSING, 4), rng
    )
    for metric in metrics:
        assert np.isfinite([metric.before, metric.after, metric.floor, *metric.ci_after]).all()
    assert metrics[0].after < metrics[0].before


def test_curves_hold_medians_and_bands() -> None:
    rng = np.random.default_rng(7)
    conditions = conditions_of(16)
    real, before = vectors_of(conditions, rng, MISSING), many(conditions, rng, 0.0)
    (curve,) = curves(real, before).values()
    assert curve.after is None and len(curve.x) == BINS
    factor = 10 / np.log(10)
    assert np.allclose(curve.real, factor * np.median(real.matrix, axis=0))
    assert np.allclose(curve.before, factor * np.median(np.concatenate([b.matrix for b in before]), axis=0))
    assert set(curve.bands) == {"real", "before"}
    (after,) = curves(real, before, before).values()
    assert after.after == after.before
