"""Prognostic metrics against values worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from papers.paper1_rul_varying_speed.methods import metrics
from twingap.errors import TwingapError

TRUE = np.array([40.0, 30.0, 20.0, 10.0, 0.0])


@pytest.mark.parametrize(
    ("predicted", "accuracy"),
    [(100.0, 1.0), (105.0, 0.5), (110.0, 0.25), (80.0, 0.5), (60.0, 0.25), (120.0, 2.0**-4), (0.0, 2.0**-5)],
)
def test_phm2012_halves_every_5_percent_late_and_every_20_percent_early(predicted: float, accuracy: float) -> None:
    assert metrics.phm2012_accuracy([100.0], [predicted])[0] == pytest.approx(accuracy)


def test_phm2012_punishes_late_more_than_early_and_takes_the_plain_mean() -> None:
    """Worked by hand. 50 min remain, 5 min missed: Er = 100 (50 - 55) / 50 = -10 late, Er = +10 early.

    Late: exp(-ln(0.5) (-10) / 5) = 0.5^2 = 0.25. Early: exp(ln(0.5) 10 / 20) = 0.5^0.5 = 0.70711.
    """
    late, early, right = metrics.phm2012_accuracy([50.0, 50.0, 50.0], [55.0, 45.0, 50.0])
    assert [late, early, right] == pytest.approx([0.25, 0.70711, 1.0], rel=1e-5)
    assert metrics.phm2012_score([50.0, 50.0, 50.0], [55.0, 45.0, 50.0]) == pytest.approx(0.65237, rel=1e-5)
    missed = np.arange(1.0, 100.0)
    of_late = metrics.phm2012_accuracy(np.full(99, 100.0), 100 + missed)
    of_early = metrics.phm2012_accuracy(np.full(99, 100.0), 100 - missed)
    assert (of_late < of_early).all() and (np.diff(of_late) < 0).all() and (np.diff(of_early) < 0).all()


def test_phm2012_is_the_formula_as_printed() -> None:
    rng = np.random.default_rng(0)
    true, predicted = rng.uniform(1, 100, 50), rng.uniform(0, 150, 50)
    for t, p, found in zip(true, predicted, metrics.phm2012_accuracy(true, predicted), strict=True):
        er = 100 * (t - p) / t
        assert found == pytest.approx(np.exp(-np.log(0.5) * er / 5) if er <= 0 else np.exp(np.log(0.5) * er / 20))
    assert metrics.phm2012_score(true, predicted) == pytest.approx(metrics.phm2012_accuracy(true, predicted).mean())


def test_a_missing_prediction_scores_nothing_and_the_end_is_left_out() -> None:
    assert metrics.phm2012_score([10.0, 10.0, 0.0], [10.0, np.nan, 3.0]) == pytest.approx(0.5)
    assert not metrics.within_alpha([10.0], [np.nan])[0]
    assert metrics.rmse([10.0, 20.0], [np.nan, 23.0]) == pytest.approx(3.0)
    assert np.isnan(metrics.rmse([1.0], [np.nan]))


def test_relative_accuracy() -> None:
    each = metrics.relative_accuracy(TRUE, [40.0, 15.0, 50.0, 10.0, 1.0])
    assert each[:4] == pytest.approx([1.0, 0.5, -0.5, 1.0]) and np.isnan(each[4])
    assert metrics.cumulative_relative_accuracy(TRUE, [40.0, 15.0, 50.0, 10.0, 1.0]) == pytest.approx(0.5)


def test_alpha_lambda_counts_from_the_first_prediction() -> None:
    predicted = np.array([np.nan, 30.0, 40.0, 11.0, 0.0])
    # From the second row on: half way to the end lies between the third and the fourth row.
    assert not metrics.alpha_lambda(TRUE, predicted, 0.5)
    assert metrics.alpha_lambda(TRUE, predicted, 0.7) and metrics.alpha_lambda(TRUE, predicted, 0.0)
    assert not metrics.alpha_lambda(TRUE, np.full(5, np.nan))


def test_the_horizon_begins_with_the_last_row_outside_the_bounds() -> None:
    predicted = [40.0, 60.0, 22.0, 8.0, 0.0]
    assert metrics.prognostic_horizon(TRUE, predicted, 40.0) == 20.0
    assert metrics.prognostic_horizon(TRUE, [90.0] * 5, 40.0) == 0.0


def test_bounds_are_those_of_the_source_unless_others_are_asked_for() -> None:
    """20 % of what remains for the cone, 10 % of the whole life for the horizon; each just met and just missed."""
    assert metrics.within_alpha([10.0, 10.0, 10.0], [12.0, 12.01, 7.99]).tolist() == [True, False, False]
    for at_half, hit in ((24.0, True), (24.1, False), (16.0, True), (15.9, False)):
        assert metrics.alpha_lambda(TRUE, [40.0, 30.0, at_half, 99.0, 0.0]) is hit
    assert metrics.prognostic_horizon(TRUE, [99.0, 34.0, 20.0, 10.0, 0.0], 40.0) == 30.0
    assert metrics.prognostic_horizon(TRUE, [99.0, 34.1, 20.0, 10.0, 0.0], 40.0) == 20.0


def test_coverage_counts_rows_that_have_an_interval() -> None:
    found = metrics.coverage(TRUE, [35, np.nan, 21, 0, 0], [45, np.nan, 30, 20, np.inf])
    assert found.share == pytest.approx(0.75) and found.rows == 4 and found.mean_width == np.inf


@pytest.mark.parametrize(("true", "predicted"), [([1.0, 2.0], [1.0]), ([-1.0], [1.0]), ([np.nan], [1.0])])
def test_impossible_rows_are_refused(true: list[float], predicted: list[float]) -> None:
    with pytest.raises(TwingapError, match="rows"):
        metrics.rmse(true, predicted)
