"""What runs that ended say of intervals: factors that would have held, bounded, and intervals moved by them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twingap.prognosis.estimate import Estimate
from twingap.prognosis.life_law import LogNormal
from twingap.prognosis.outcomes import Outcome, past_intervals, prior_from
from twingap.prognosis.past_errors import ROWS, PastIntervals, errors, pooled_widening, widening
from twingap.prognosis.prior import Prior


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


def test_pooled_intervals_are_narrowed_where_every_run_allows_it_and_widened_where_most_need_it() -> None:
    rng = np.random.default_rng(2)
    small = [np.abs(rng.normal(0, 0.5 / 1.645, ROWS)) for _ in range(5)]
    least = max(np.quantile(own, 0.9) for own in small)
    assert widening(small) < 1 and pooled_widening(small) == pytest.approx(np.sqrt(max(least, 0.5)))
    one_missed = [*small[:4], np.where(np.arange(ROWS) < ROWS // 8, 1.2, 0.2)]
    assert widening(one_missed) < 1
    assert pooled_widening(one_missed) == 1, "one of five of which an eighth of the rows was not covered forbids it"
    large = [3.0 * own for own in small]
    assert pooled_widening(large) == widening(large) > 1
    assert pooled_widening([np.zeros(ROWS)] * 5) == pytest.approx(np.sqrt(0.5))


def test_ends_move_in_logarithms_about_the_median() -> None:
    narrow, wide = (
        np.log(Prior(LogNormal(5.0, 1.0), None, 1.0, 1.0, factor).joined((10.0, 100.0, 400.0), 10.0, 10.0, 0.0))
        for factor in (1.0, 2.0)
    )
    assert wide - wide[1] == pytest.approx(2 * (narrow - narrow[1])) and wide[1] == pytest.approx(narrow[1])


def test_a_run_that_ended_tells_how_far_off_it_was() -> None:
    lived = [0.0, 10.0, 20.0, 30.0, 40.0]
    said = [Estimate(False), *(Estimate(True, m, m / 2, m * 2) for m in (30.0, 5.0, 10.0, 0.0))]
    told = past_intervals(said, lived, 5.0)
    assert told is not None and told.per_row == 10.0
    np.testing.assert_array_equal(told.lived, [10.0, 20.0, 30.0])
    np.testing.assert_array_equal(told.since_onset, [5.0, 15.0, 25.0])
    np.testing.assert_array_equal(told.left, [30.0, 20.0, 10.0])
    half = np.log(10.0 + 5) - np.log(5.0 + 5)
    # Half a row is 5 revolutions.
    assert told.errors() == pytest.approx((0.0, np.log(25 / 10) / half, 0.0))
    assert told.log_error(told.growth) == pytest.approx(np.log(25 / 10) / 3)
    assert past_intervals([Estimate(False)] * 5, lived, 5.0) is None
    assert prior_from([Outcome("t", 40.0, None, None)]).widening == 1.0
    long = replace(told, growth=np.ones((500, 3)), lived=np.ones(500), since_onset=np.ones(500), left=np.ones(500))
    assert long.thinned().growth.shape == (ROWS, 3)


def test_an_anomaly_that_passed_tells_nothing() -> None:
    """Of two the last one counts; with none left at the end there is nothing to tell, and no NaN either."""
    said = [Estimate(False), Estimate(True, 9.0, 5.0, 15.0), Estimate(False), *(Estimate(True, 20.0, 10.0, 30.0),) * 2]
    lived = [0.0, 10.0, 20.0, 30.0, 40.0]
    told = past_intervals(said, lived, 25.0)
    assert told is not None
    np.testing.assert_array_equal(told.lived, [30.0])
    np.testing.assert_array_equal(told.since_onset, [5.0])
    assert past_intervals(said, lived, float("nan")) is None


def _ended(rng: np.random.Generator, spread: float, off: float, rows: int = 16) -> Outcome:
    """A run whose log life has this deviation, and whose growth errs by `off` where its intervals say 0.5."""
    life = 1000 * np.exp(spread * rng.normal())
    lived = np.linspace(0.1, 0.9, rows) * life
    left = life - lived
    middle = left * np.exp(off * (np.sqrt(0.7) * rng.normal() + np.sqrt(0.3) * rng.normal(size=rows)))
    growth = middle[:, None] * np.exp(1.645 * 0.5 * np.array([-1, 0, 1]))
    return Outcome("run", life, None, None, PastIntervals(growth, lived, lived, left, 1.0))


@pytest.mark.parametrize(("spread", "off", "weights"), [(0.1, 0.7, (0.0, 0.5)), (1.5, 0.3, (0.9, 4.0))])
def test_runs_that_ended_choose_what_told_more(spread: float, off: float, weights: tuple[float, float]) -> None:
    """Lives where they agree and growth errs; growth where it is right and lives differ."""
    rng = np.random.default_rng(3)
    chosen = [prior_from([_ended(rng, spread, off) for _ in range(5)]).growth_weight for _ in range(15)]
    assert weights[0] <= np.median(chosen) <= weights[1]


def test_joined_intervals_hold_what_they_say_where_both_sources_are_right() -> None:
    """The product of two independent sources is surer than either."""
    rng = np.random.default_rng(4)
    shares, widths = [], []
    for _ in range(20):
        own, *others = (_ended(rng, 0.3, 0.5) for _ in range(6))
        prior, told = prior_from(others), own.past
        assert told is not None
        both = prior.joined_rows(told.growth, told.lived, told.lived, told.per_row)
        lives = np.array([prior.before(float(u)) for u in told.lived])
        shares.append(np.mean((both[:, 0] <= told.left) & (told.left <= both[:, 2])))
        widths.append([np.median(np.log(ends[:, 2] / ends[:, 0])) for ends in (both, told.growth, lives)])
    assert 0.85 <= np.mean(shares) <= 0.97
    pooled, growth, alone = np.mean(widths, axis=0)
    assert pooled < growth and pooled < alone


def test_a_run_is_judged_by_what_the_others_say_and_not_by_its_own_life() -> None:
    """Of three runs the other two are too few to learn more than lives: that is what each is joined with."""
    rng = np.random.default_rng(6)
    for spread in (0.1, 0.7, 1.5):
        ended = [_ended(rng, spread, 0.7) for _ in range(3)]
        found, told_errors = prior_from(ended), []
        for place, own in enumerate(ended):
            assert own.past is not None
            others = replace(prior_from([*ended[:place], *ended[place + 1 :]]), growth_weight=found.growth_weight)
            said = others.joined_rows(own.past.growth, own.past.lived, own.past.since_onset, own.past.per_row)
            told_errors.append(own.past.errors(said))
        assert found.joined_widening == pytest.approx(pooled_widening(told_errors))


def test_fewer_than_three_runs_with_estimates_choose_nothing() -> None:
    rng = np.random.default_rng(5)
    runs = [_ended(rng, 0.1, 0.7) for _ in range(3)]
    table = [Outcome(f"t{place}", 900.0, None, None) for place in range(4)]
    few, enough = prior_from(runs[:2] + table), prior_from(runs + table)
    assert (few.growth_weight, few.joined_widening) == (0.75, 1.0)
    assert enough.growth_weight < 0.75
