"""Ends of searches: probabilities that hold."""

import numpy as np
import pytest

from twingap.gap.knowledge.score_calibration import FALSE, Outcome, learn_score_calibration


def outcomes(count, seed):
    """Searches whose log odds are twice as bold as they should be, and bolder where something is left over."""
    rng = np.random.default_rng(seed)
    made, missing = [], []
    for _ in range(count):
        truth = rng.normal(-2.0, 2.5)
        rest = float(rng.choice([0.01, 0.8]))
        odds = 2 * truth + (1.0 if rest < 0.05 else 0.0)
        made.append(Outcome(odds, odds + rng.normal(0, 0.5), odds > 0.3, int(rng.integers(0, 4)), 0.01, rest))
        missing.append(bool(rng.random() < 1 / (1 + np.exp(-truth))))
    return made, missing


def test_probabilities_hold_on_searches_not_learnt_from():
    judge = learn_score_calibration(*outcomes(4000, 0), np.arange(4000))
    fresh, missing = outcomes(6000, 1)
    said = np.array([judge.probability(outcome) for outcome in fresh])
    bold = 1 / (1 + np.exp(-np.array([outcome.certainty for outcome in fresh])))
    truth = np.array(missing)
    for low, high in ((0.05, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 0.95)):
        inside = (said >= low) & (said < high)
        assert truth[inside].mean() == pytest.approx(said[inside].mean(), abs=0.08)
    # The log odds as they came do not: that is what there is to be learnt.
    inside = (bold > 0.8) & (bold < 0.95)
    assert truth[inside].mean() < bold[inside].mean() - 0.1


def test_odds_beyond_all_bounds_are_no_number_that_is_none():
    judge = learn_score_calibration(*outcomes(500, 2), np.arange(500))
    for odds in (-1e6, 1e6):
        assert 0 <= judge.probability(Outcome(odds, odds, True, 1, 0.0, 0.0)) <= 1


def test_too_few_searches_teach_nothing():
    made, _ = outcomes(200, 3)
    assert learn_score_calibration(made, [False] * 200, range(200)) is None


def test_what_is_named_on_searches_not_learnt_from_is_seldom_false():
    made, missing = outcomes(4000, 4)
    judge = learn_score_calibration(made, missing, np.arange(4000) // 20)
    fresh, truth = outcomes(20000, 5)
    said, right = np.array([judge.probability(outcome) for outcome in fresh]), np.array(truth)
    named = said >= judge.named_from
    assert (~right[named]).mean() == pytest.approx(FALSE, abs=0.02)
    # A little below there are too many, or it would be the limit.
    assert (~right[said >= judge.named_from - 0.05]).mean() > FALSE
