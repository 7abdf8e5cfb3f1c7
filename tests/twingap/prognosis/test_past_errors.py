"""What runs that ended say of intervals: factors that would have held, bounded, and intervals moved by them."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.prognosis.follow import Outcome, errors_of, prior_from
from twingap.prognosis.online import Estimate
from twingap.prognosis.past_errors import ROWS, errors, widened, widening
from twingap.prognosis.prior import LogNormal, Prior


def test_errors_are_at_most_one_exactly_where_the_interval_holds() -> None:
    rng = np.random.default_rng(0)
    predicted = np.exp(rng.normal(5, 1, 50))
    low, high = predicted * 0.5, predicted * 4.0
    true = np.exp(np.log(predicted) + rng.normal(0.3, 1, 50))
    found = errors(predicted, low, high, true, 0.0)
    np.testing.assert_array_equal(found <= 1, (low <= true) & (true <= high))
    # On either side the half width of that side.
    one = np.ones(1)
    assert errors(4 * one, 2 * one, 64 * one, 16 * one, 0.0) == pytest.approx(0.5)
    assert errors(4 * one, 2 * one, 64 * one, one, 0.0) == pytest.approx(2.0)
    assert errors(0 * one, 0 * one, 0 * one, one, 0.5) > 1e6  # nothing was said to remain, and something did
    assert errors(0 * one, 0 * one, 0 * one, 0 * one, 0.5) == 0


def test_many_rows_are_thinned_and_unknown_ones_left_out() -> None:
    row = np.linspace(1, 2, 1000)
    assert errors(row, row / 2, row * 2, row * 1.5, 0.0).size == ROWS
    gone = np.where(row < 1.5, np.nan, row)
    assert errors(gone, gone / 2, gone * 2, row * 1.5, 0.0).size == ROWS
    assert errors(gone[:9], gone[:9], gone[:9], row[:9], 0.0).size == 0


@pytest.mark.parametrize("off", [0.6, 1.0, 1.5, 2.5])
def test_the_factor_is_what_errors_of_many_runs_ask_for(off: float) -> None:
    """Errors are normal in logarithms and `off` times as large as intervals say."""
    rng = np.random.default_rng(1)
    runs = [np.abs(rng.normal(0, off / 1.645, ROWS)) for _ in range(40)]
    assert widening(runs) == pytest.approx(off, rel=0.08)
    # One run is pulled half the way to what simulated runs say.
    one = widening(runs[:1])
    assert min(off, 1) <= one <= max(off, 1) or one == pytest.approx(off, rel=0.15)


def test_the_factor_is_bounded_and_needs_runs() -> None:
    assert widening([]) == widening([(), ()]) == 1.0
    assert widening([np.full(ROWS, 1e300)] * 3) == 5.0
    assert widening([np.zeros(ROWS)] * 50) == 0.5
    # Each run weighs the same, however many rows it has.
    assert widening([(0.1,), (0.1,), (0.1,), (0.1,), np.full(ROWS, 3.0)]) == 3.0


def test_ends_move_in_logarithms_about_the_median() -> None:
    low, middle, high = widened((10.0, 100.0, 400.0), 2.0, 0.0)
    assert (low, middle, high) == pytest.approx((1.0, 100.0, 1600.0))
    assert widened((10.0, 100.0, 400.0), 1.0, 3.0) == pytest.approx((10.0, 100.0, 400.0))
    assert widened((0.0, 0.0, 0.0), 3.0, 0.5) == (0.0, 0.0, 0.0)
    prior = Prior(LogNormal(5.0, 1.0), None, 1.0, 2.0)
    assert prior.joined((10.0, 100.0, 400.0), 10.0, 10.0, 0.0) == pytest.approx((1.0, 100.0, 1600.0))


def test_a_run_that_ended_tells_how_far_off_it_was() -> None:
    lived = [0.0, 10.0, 20.0, 30.0, 40.0]
    said = [Estimate(False), *(Estimate(True, m, m / 2, m * 2) for m in (30.0, 5.0, 10.0, 0.0))]
    told = errors_of(said, lived)
    half = np.log(10.0 + 5) - np.log(5.0 + 5)
    # True: 30, 20, 10; half a row is 5 revolutions.
    assert told == pytest.approx((0.0, np.log(25 / 10) / half, 0.0))
    assert errors_of([Estimate(False)] * 5, lived) == ()
    outcomes = [Outcome(f"r{i}", 40.0, 30.0, 5.0, (3.0,) * 64) for i in range(4)]
    assert prior_from(outcomes).widening == 3.0
    assert prior_from([Outcome("t", 40.0, None, None)]).widening == 1.0
