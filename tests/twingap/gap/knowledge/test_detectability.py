"""Effects that nobody could have seen: told by values and by what else there is, not by how plain they look."""

import numpy as np
import pytest

from twingap.gap.knowledge.detectability import learn_detectability
from twingap.gap.knowledge.detectors import Table, learn_classifier
from twingap.gap.knowledge.learn import Examples, learn

PARAMETERS = (("a", "level"), ("b", "depth"))


@pytest.fixture(scope="module")
def log_odds():
    """Of 900 machines: effect a is found where its level is above 0, but for one in ten; b wherever it is."""
    rng = np.random.default_rng(4)
    missing = rng.random((900, 2)) < 0.5
    values = np.where(missing, rng.uniform(-1, 1, (900, 2)), np.nan)
    lucky = rng.random(900) < 0.1
    found = (values[:, 0] > 0) ^ lucky
    a = np.where(missing[:, 0] & found, 4.0, -4.0) + rng.standard_normal(900)
    b = np.where(missing[:, 1], 3.0, -3.0) + rng.standard_normal(900)
    features = rng.standard_normal((900, 3))
    return {"a": a, "b": b}, missing, values, features, lucky


def test_what_hardly_any_of_its_like_were_found_of_is_hidden(log_odds):
    scores, missing, values, features, lucky = log_odds
    sight, hidden = learn_detectability(scores, missing, values, features, ("a", "b"), PARAMETERS, ("x", "y", "z"))
    faint, plain = (missing[:, 0] & (sign * values[:, 0] > 0.15) for sign in (-1, 1))
    assert hidden[faint, 0].mean() > 0.9
    assert hidden[plain, 0].mean() < 0.1
    # One that was missed among its like that were found stays missing, and one found by luck is hidden all the same.
    assert hidden[plain & lucky, 0].mean() < 0.3
    assert hidden[faint & lucky, 0].mean() > 0.7
    assert not hidden[:, 1].any()
    assert not (hidden & ~missing).any()
    again = sight.hidden(missing, values, features)
    assert (again == hidden).mean() > 0.95


def test_nothing_is_hidden_of_an_effect_that_few_machines_have_or_no_detector_hears(log_odds):
    scores, missing, values, features, _ = log_odds
    few = missing.copy()
    few[40:, 0] = False
    _, hidden = learn_detectability(scores, few, values, features, ("a", "b"), PARAMETERS, ("x", "y", "z"))
    assert not hidden[:, 0].any()
    sight, hidden = learn_detectability(
        {"b": scores["b"]}, missing, values, features, ("a", "b"), PARAMETERS, ("x", "y", "z")
    )
    assert not hidden.any()
    assert not sight.hidden(missing, values, features)[:, 0].any()


def test_examples_that_do_not_count_have_no_say_and_are_asked_about_all_the_same():
    rng = np.random.default_rng(1)
    features = rng.standard_normal((400, 20)).astype(np.float32)
    label = features[:, 2] > 0.5
    wrong = rng.random(400) < 0.4
    counted = ~wrong
    told = learn_classifier(Table(features), np.where(wrong, ~label, label), np.arange(400), range(20), None, counted)
    plain = learn_classifier(Table(features), label, np.arange(400), range(20), None, counted)
    assert told is not None
    assert plain is not None
    assert np.array_equal(told.out_of_fold, plain.out_of_fold)
    assert np.mean((told.out_of_fold[wrong] > 0) == label[wrong]) > 0.9


def test_labels_that_no_record_shows_do_not_make_what_is_absent_likelier():
    """Of machines with the effect half have it too weak to be seen: those without it are told as surely as they are."""
    rng = np.random.default_rng(2)
    n = 1600
    missing = (rng.random(n) < 0.3)[:, None]
    level = rng.uniform(-1, 1, n)
    features = rng.standard_normal((n, 12)).astype(np.float32)
    features[:, 5] += 8.0 * (missing[:, 0] & (level > 0))
    values = np.where(missing, level[:, None], np.nan)
    names = tuple(f"distance|{i}" for i in range(12))
    made = Examples(
        features, missing, np.zeros_like(missing), np.zeros(n, bool), np.arange(n), np.ones(n, bool), values, features
    )
    learnt = learn(made, ("own",), (("own", "level"),), names, lambda what, part: None)
    absent = learnt.log_odds(features[~missing[:, 0]])[:, 0]
    assert learnt.detectability is not None
    # Three in twenty have it undetectably: with those as missing, examples without any sign would have odds of 0.18.
    assert np.mean(1 / (1 + np.exp(-absent))) < 0.06
    assert np.median(learnt.log_odds(features[missing[:, 0] & (level > 0.1)])[:, 0]) > 2
