"""What is learnt, on numbers whose truth is known."""

from itertools import product

import numpy as np
import pytest

from twingap.errors import TwingapError
from twingap.gap.knowledge.detectors import Table, learn_classifier, learn_estimator
from twingap.gap.knowledge.learn import Examples, learn
from twingap.gap.knowledge.null import (
    BARE,
    DISTANCE,
    HEALTHY,
    MODELS,
    OWN,
    OWN_SIMULATOR,
    RECORDS,
    WITH_EFFECTS,
    MachineScores,
    Null,
)


@pytest.fixture(scope="module")
def examples():
    rng = np.random.default_rng(0)
    n, width = 500, 60
    features = rng.standard_normal((n, width)).astype(np.float32)
    missing = np.stack([features[:, 3] > 0.8, features[:, 7] + 0.3 * rng.standard_normal(n) > 1.0], axis=1)
    values = np.where(missing[:, :1], 2.0 * features[:, 11:12] + 1.0, np.nan)
    features[rng.random(features.shape) < 0.03] = np.nan
    first = rng.random(n) < 0.8
    return Examples(features, missing, np.zeros_like(missing), np.zeros(n, bool), np.arange(n), first, values, features)


def test_scores_of_unseen_machines_are_log_odds(examples):
    found = learn_classifier(Table(examples.features), examples.missing[:, 0], examples.machine, range(60))
    assert found is not None
    probability = 1 / (1 + np.exp(-found.out_of_fold))
    assert probability.mean() == pytest.approx(examples.missing[:, 0].mean(), abs=0.03)
    assert np.mean((found.out_of_fold > 0) == examples.missing[:, 0]) > 0.93


def test_a_label_that_nothing_tells_of_scores_no_better_than_chance(examples):
    label = np.random.default_rng(5).random(len(examples)) < 0.4
    found = learn_classifier(Table(examples.features), label, examples.machine, range(60))
    assert found is not None
    assert np.mean((found.out_of_fold > 0) == label) < 0.68


def test_a_value_is_read_off_the_feature_that_tells_it(examples):
    found = learn_estimator(Table(examples.fit_features), examples.values[:, 0], examples.machine, range(60))
    assert found is not None
    assert found.anchors[0].column == 11
    here = np.isfinite(examples.values[:, 0])
    off = np.abs(found.estimate(examples.fit_features[here]) - examples.values[here, 0])
    assert np.median(off) < 0.1


def test_values_are_learnt_where_no_machine_of_a_fold_has_the_effect():
    rng = np.random.default_rng(2)
    machine = np.array([m for m in range(60) if m % 5 != 3])
    features = rng.standard_normal((machine.size, 5)).astype(np.float32)
    found = learn_estimator(Table(features), 2.0 * features[:, 1] + features[:, 2], machine, range(5))
    assert found is not None
    assert found.anchors[0].column == 1


def test_too_few_examples_teach_nothing(examples):
    few = np.zeros(len(examples), bool)
    few[:5] = True
    assert learn_classifier(Table(examples.features), few, examples.machine, range(60)) is None


def test_too_few_machines_without_a_gap_are_an_error_that_says_so(examples):
    gap = examples.missing.any(axis=1)
    rows = np.append(np.flatnonzero(gap), np.flatnonzero(~gap)[:3])
    few = Examples(*[values[rows] for values in vars(examples).values()])
    names = tuple(f"context|records{k}" for k in range(60))
    with pytest.raises(TwingapError, match="and 3 without one are too few"):
        learn(few, ("a", "b"), (), names, lambda what, part: None)


@pytest.fixture(scope="module")
def learnt(examples):
    names = tuple(f"context|records{k}" for k in range(60))
    return learn(examples, ("a", "b"), (("a", "size"),), names, lambda what, part: None)


def test_the_null_is_of_machines_without_a_gap_and_p_values_are_even(examples, learnt):
    nothing = ~examples.missing.any(axis=1) & examples.first
    of = learnt.null.machines
    assert len(of) == nothing.sum()
    own = np.array([learnt.null.p_value(of.take(np.arange(len(of)) == k)) for k in range(len(of))])
    assert np.mean(own <= 0.1) == pytest.approx(0.1, abs=0.02)
    assert learnt.p_value(examples.features[np.flatnonzero(examples.missing.all(axis=1))[0]]) < 0.1


def test_no_detector_is_asked_of_what_the_twin_has(examples, learnt):
    only_a = examples.missing[:, 0] & ~examples.missing[:, 1] & (examples.features[:, 3] > 1.5)
    x = examples.features[np.flatnonzero(only_a)[0]]
    assert learnt.p_value(x) < 0.05
    assert learnt.p_value(x, ("b",)) < 0.05
    assert learnt.p_value(x, ("a",)) > 2 * learnt.p_value(x)  # what hears any gap still does


def test_records_whose_effect_the_twin_has_do_not_teach_that_it_is_absent():
    """Feature 3 shows the effect in the records, whatever the twin, which has it in half of the cases."""
    rng = np.random.default_rng(1)
    n = 600
    features = rng.standard_normal((n, 30)).astype(np.float32)
    there, has = features[:, 3] > 0.8, rng.random(n) < 0.5
    missing, modelled = (there & ~has)[:, None], (there & has)[:, None]
    machine, first, outside = np.arange(n), np.ones(n, bool), np.zeros(n, bool)
    examples = Examples(features, missing, modelled, outside, machine, first, np.empty((n, 0)), features)
    learnt = learn(examples, ("a",), (), tuple(f"context|records{k}" for k in range(30)), lambda what, part: None)
    odds = learnt.log_odds(features[missing[:, 0]])[:, 0]
    assert np.mean(odds > np.log(9)) > 0.9


def judged(scores, records=0.0):
    """Machines of these scores whose distance is not known."""
    scores = np.asarray(scores, float)
    n = len(scores)
    return MachineScores(
        scores, np.broadcast_to(np.asarray(records, float), n).copy(), np.full(n, np.nan), np.zeros(n), np.ones(n, bool)
    )


def one(scores, distance, kind, records=1.0, with_healthy=True):
    """A machine."""
    return MachineScores(scores, np.log([records]), np.array([distance]), np.array([kind]), np.array([with_healthy]))


def test_a_score_is_ranked_among_machines_judged_by_as_many_records():
    rng = np.random.default_rng(3)
    records = np.log(rng.integers(2, 25, 1000))
    null = Null(judged((rng.standard_normal(1000) * np.exp(1.5 - 0.5 * records))[:, None], records))
    for count in (3, 8, 20):
        fresh = rng.standard_normal(1000) * np.exp(1.5 - 0.5 * np.log(count))
        p = np.array([null.p_value(judged([[score]], np.log(count))) for score in fresh])
        assert np.mean(p <= 0.05) == pytest.approx(0.05, abs=0.03)
    assert null.p_value(judged([[10.0]], 50.0)) == null.p_value(
        judged([[10.0]], records.max())
    )  # beyond what was seen: the nearest


def test_of_several_scores_the_rarest_counts_and_the_level_holds():
    rng = np.random.default_rng(4)
    drawn = rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], 1600)
    scales = np.array([1.0, 30.0])  # ranks do not mind the unit
    null = Null(judged(drawn[:600] * scales))
    p = np.array([null.p_value(judged(scores[None])) for scores in drawn[600:] * scales])
    assert np.mean(p <= 0.05) == pytest.approx(0.05, abs=0.025)
    assert null.p_value(judged([[6.0, 0.0]])) < 0.01
    assert null.p_value(judged([[0.0, 180.0]])) < 0.01


def test_what_no_detector_hears_is_a_gap_where_it_is_far_off_for_a_simulator_of_its_kind():
    rng = np.random.default_rng(6)
    own = (np.arange(1600) % 3 == 0).astype(float)
    distance = rng.gamma(4.0, 0.25, 1600) * np.where(own, 0.5, 1.0)  # nothing had to be matched there
    scores = rng.standard_normal((1600, 2))
    every = MachineScores(scores, np.zeros(1600), distance, own, np.ones(1600, bool))
    null, fresh = Null(every.take(np.arange(1600) < 800)), range(800, 1600)
    p = np.array([null.p_value(every.take(np.arange(1600) == k)) for k in fresh])
    assert np.mean(p <= 0.05) == pytest.approx(0.05, abs=0.025)
    far = {kind: null.p_value(one(np.zeros((1, 2)), 1.9, kind)) for kind in (0, 1)}
    assert far[1] < 0.02 < 0.1 < far[0]
    assert null.p_value(one(np.zeros((1, 2)), np.nan, 1)) > 0.3


def test_each_kind_of_simulator_holds_its_level():
    """A twin is less like any machine than its own simulator is, and one that models effects less still: none pays."""
    rng = np.random.default_rng(8)
    kinds = np.arange(7500) % 3  # bare, own simulator, with effects
    scores = (rng.standard_normal((7500, 1)) * np.array([1.0, 0.3, 4.0])[kinds][:, None]) + np.zeros((1, 2))
    records, distance = np.log(rng.integers(2, 25, 7500)), rng.gamma(4.0, 0.25, 7500)
    every = MachineScores(scores, records, distance, kinds.astype(float), np.ones(7500, bool))
    null, fresh = Null(every.take(np.arange(7500) < 3000)), np.arange(3000, 7500)
    p = np.array([null.p_value(every.take(np.arange(7500) == k)) for k in fresh])
    for kind in range(3):
        assert np.mean(p[kinds[fresh] == kind] <= 0.05) == pytest.approx(0.05, abs=0.03)
    found = {
        kind: null.p_value(one(np.full((1, 2), 1.5), 1.0, kind, records=12.0))
        for kind in (BARE, OWN_SIMULATOR, WITH_EFFECTS)
    }
    assert found[OWN_SIMULATOR] < 0.03 < found[BARE] < found[WITH_EFFECTS]


def test_a_kind_of_which_there_are_few_is_ranked_among_a_wider_one():
    rng = np.random.default_rng(9)
    kinds = np.repeat([BARE, OWN_SIMULATOR, WITH_EFFECTS], [400, 400, 30])
    scores = rng.standard_normal((830, 1)) * np.where(kinds == OWN_SIMULATOR, 0.1, 1.0)[:, None]
    null = Null(MachineScores(scores, np.zeros(830), np.full(830, np.nan), kinds, np.ones(830, bool)))
    few, bare = (null.p_value(one(np.full((1, 1), 1.0), np.nan, kind)) for kind in (WITH_EFFECTS, BARE))
    assert few == pytest.approx(bare, abs=0.03)  # twins of either kind, not other simulators


def test_without_a_healthy_record_the_level_holds_as_with_one():
    """Calibration is further off then, for a twin; a simulator of the machine's own has none."""
    rng = np.random.default_rng(11)
    kinds, with_healthy = (np.arange(6000) % 2).astype(float), rng.random(6000) > 0.2
    further = np.where((kinds == BARE) & ~with_healthy, 2.5, 1.0)
    every = MachineScores(
        rng.standard_normal((6000, 1)) * further[:, None], np.zeros(6000), np.full(6000, np.nan), kinds, with_healthy
    )
    null, fresh = Null(every.take(np.arange(6000) < 2000)), np.arange(2000, 6000)
    p = np.array([null.p_value(every.take(np.arange(6000) == k)) for k in fresh])
    for kind, there in product((BARE, OWN_SIMULATOR), (True, False)):
        own = p[(kinds[fresh] == kind) & (with_healthy[fresh] == there)]
        assert np.mean(own <= 0.05) == pytest.approx(0.05, abs=0.025)
    strong = {
        there: null.p_value(one(np.full((1, 1), 2.5), np.nan, BARE, with_healthy=there)) for there in (True, False)
    }
    assert strong[True] < 0.02 < 0.1 < strong[False]


def test_what_a_machine_is_met_through_is_read_off_its_features():
    names = (RECORDS, OWN, MODELS, DISTANCE, HEALTHY)
    features = np.array([[2.0, 0, 0, 0.1, 0.3], [2.0, 1, 0, 0.1, 0.0], [2.0, 0, 1, 0.1, 1.0]])
    found = MachineScores.of(np.zeros((3, 2)), features, names)
    assert found.kind.tolist() == [BARE, OWN_SIMULATOR, WITH_EFFECTS]
    assert found.with_healthy.tolist() == [True, False, True]


def test_the_twin_as_given_and_one_with_effects_added_are_calibrated_apart():
    rng = np.random.default_rng(5)
    n = 4000
    first = rng.random(n) < 0.6
    label = rng.random(n) < np.where(first, 0.4, 0.08)  # few are left once others have been added
    features = rng.standard_normal((n, 6)).astype(np.float32)
    features[:, 0] += 1.5 * label
    found = learn_classifier(Table(features), label, np.arange(n), range(6), first)
    for part, later in ((first, False), (~first, True)):
        said = 1 / (1 + np.exp(-found.score(features[part], later=later)))
        assert said.mean() == pytest.approx(label[part].mean(), abs=0.04)
        out_of_fold = 1 / (1 + np.exp(-found.out_of_fold[part]))
        assert out_of_fold.mean() == pytest.approx(label[part].mean(), abs=0.02)
    assert np.all(found.score(features, later=True).mean() < found.score(features).mean() - 1)


def test_estimates_say_how_far_they_may_be_off_one_by_one():
    """Teeth are read exactly where their comb is heard, and not at all where it is not."""

    def drawn(n, seed):
        rng = np.random.default_rng(seed)
        value, heard = rng.uniform(-1, 1, n), rng.random(n) < 0.7
        read = np.where(heard, value + 0.01 * rng.standard_normal(n), rng.uniform(-1, 1, n))
        noise = rng.standard_normal((n, 6))
        return np.column_stack((read, heard + 0.1 * rng.standard_normal(n), noise)).astype(np.float32), value

    features, value = drawn(600, 0)
    found = learn_estimator(Table(features), value, np.arange(600), range(8))
    assert found is not None
    fresh, truth = drawn(4000, 1)
    off, within = np.abs(found.estimate(fresh) - truth), found.within(fresh)
    # All folds' models together are a little better than each alone, by which their errors were measured.
    assert 0.865 <= np.mean(off <= within) <= 0.95
    heard = fresh[:, 1] > 0.5
    assert np.median(within[heard]) < 0.25 * np.median(within[~heard])
    assert np.median(within[heard]) < 0.5 * found.error
