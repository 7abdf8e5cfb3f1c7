"""Outcomes of ended runs, and the prior for other runs derived from them.

run followed to its end --outcome_of--> Outcome;  table of lives --read_outcomes--> Outcomes --prior_from--> Prior
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from twingap.errors import TwingapError
from twingap.prognosis.estimate import Estimate
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.past_errors import Array, PastIntervals, widening
from twingap.prognosis.prior import LogNormal, Prior
from twingap.records.table import read_table

WEIGHTS: Final = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)
"""Weights of growth in `prognosis.prior` that are compared on ended runs."""
_SHARED: Final = 0.1
"""Fraction of shared records, relative to the shorter run, from which two runs count as the same."""
FEWEST_WITH_INTERVALS: Final = 3
"""Fewest runs with past intervals for which the weight of growth and the width of joined intervals are chosen."""
_SHORTEST: Final = 1.0
_LONGEST: Final = 1e14
"""Bounds of a life in revolutions; values outside are input errors."""
_USUAL_SPREAD: Final = 0.7
"""Prior standard deviation of log life over bearings of one kind, with the weight of two runs. A Weibull life of slope
1.5 (rolling bearings: 1.1 to 1.5) has 0.85, one of slope 2 has 0.64. Larger gives wider priors from few runs."""


@dataclass(frozen=True)
class Outcome:
    """Life and past estimates of an ended run.

    Parameters
    ----------
    name : str
    life : float
        Revolutions from the first row to the end.
    after_onset : float or None
        Revolutions from the onset of the anomaly to the end; None without an anomaly.
    end_ratio : float or None
        Amplitude at the end relative to the healthy one.
    past : PastIntervals or None
        Its estimates after the alarm, made without other runs.
    fingerprints : frozenset
        Fingerprints of its records, by which repeated runs are detected; see `run_records.Amplitude`. Empty when the
        run is a row of a table.
    """

    name: str
    life: float
    after_onset: float | None
    end_ratio: float | None
    past: PastIntervals | None = None
    fingerprints: frozenset[tuple[float, float]] = frozenset()

    def same_as(self, other: Outcome) -> bool:
        """Whether both are of the same run, or of overlapping parts of it."""
        if self.fingerprints and other.fingerprints:
            shared = len(self.fingerprints & other.fingerprints)
            return shared >= _SHARED * min(len(self.fingerprints), len(other.fingerprints))
        return self.name == other.name and bool(np.isclose(self.life, other.life, rtol=1e-3, atol=0))


def outcome_of(
    name: str,
    life: OnlineLife,
    estimates: Sequence[Estimate],
    lived: Sequence[float],
    fingerprints: frozenset[tuple[float, float]] = frozenset(),
) -> Outcome:
    """Outcome of a run.

    Parameters
    ----------
    name : str
    life : OnlineLife
        Estimator after the last row.
    estimates : sequence of Estimate [rows]
        Estimates made without other runs.
    lived : sequence of float [rows]
        Revolutions since the first row.
    fingerprints : frozenset, optional
        See `Outcome`.

    Notes
    -----
    With an absolute limit, life ends where it was reached, even if the run was recorded beyond it. With an end by
    ratio, which is a rule of thumb, the last row is the end.
    """
    at_limit = life.options.limit is not None and life.end_row is not None
    rows = life.end_row + 1 if at_limit and life.end_row is not None else len(lived)
    onset = life.revolutions_at_onset
    level = life.end_level if at_limit else life.level
    return Outcome(
        name, lived[rows - 1],
        None if life.onset_row is None else max(lived[rows - 1] - onset, 0.0),
        float(np.exp(level)) if np.isfinite(level) else None,
        past_intervals(estimates[:rows], lived[:rows], onset), fingerprints,
    )  # fmt: skip


def refuse_repeats(ended: Sequence[tuple[str, Outcome]], run: Outcome | None = None) -> None:
    """Refuse runs that are given twice, and the run whose remaining life is estimated.

    Parameters
    ----------
    ended : sequence of (str, Outcome)
        Source and outcome of each run.
    run : Outcome, optional
        The run whose remaining life is estimated.

    Raises
    ------
    TwingapError
        When a run is repeated.
    """
    for place, (where, outcome) in enumerate(ended):
        if run is not None and outcome.same_as(run):
            raise TwingapError(
                f"run {outcome.name!r} is the one whose remaining life is estimated: its end would enter the estimate",
                where=where, mend="leave it out of --prior",
            )  # fmt: skip
        for before, other in ended[:place]:
            if outcome.same_as(other):
                raise TwingapError(
                    f"run {outcome.name!r} is already given by {before} and would count twice",
                    where=where, mend="give each run to --prior once",
                )  # fmt: skip


def prior_from(outcomes: Sequence[Outcome]) -> Prior:
    """Prior of a run from ended runs of its kind.

    Parameters
    ----------
    outcomes : sequence of Outcome
        At least one. For runs without an anomaly only the life is used.

    Returns
    -------
    Prior
        Log-normal predictive laws (standard deviation times sqrt(1 + 1/n)), and the factor on the width of intervals by
        growth. Where `FEWEST_WITH_INTERVALS` runs have past intervals, each of them is joined with the estimate from
        the others: the weight of growth minimises the error of log life, and the width of joined intervals is that
        which these runs needed.
    """
    prior = _laws(outcomes)
    if sum(own.past is not None for own in outcomes) < FEWEST_WITH_INTERVALS:
        return prior
    each = [
        (own.past, _laws([*outcomes[:place], *outcomes[place + 1 :]]))
        for place, own in enumerate(outcomes) if own.past is not None
    ]  # fmt: skip

    def joined(weight: float) -> list[tuple[PastIntervals, Array]]:
        return [(past, _joined(past, dataclasses.replace(others, growth_weight=weight))) for past, others in each]

    by_weight = {weight: joined(weight) for weight in WEIGHTS}
    best = min(WEIGHTS, key=lambda weight: float(np.mean([past.log_error(both) for past, both in by_weight[weight]])))
    wider = widening([past.errors(both) for past, both in by_weight[best]])
    return dataclasses.replace(prior, growth_weight=best, joined_widening=wider)


def _joined(past: PastIntervals, prior: Prior) -> Array:
    """Intervals [rows, 3] of an ended run, joined with the prior of other runs."""
    rows = zip(past.growth, past.lived, past.since_onset, strict=True)
    return np.array(
        [prior.joined((float(a), float(b), float(c)), lived, since, past.per_row) for (a, b, c), lived, since in rows]
    )


def _laws(outcomes: Sequence[Outcome]) -> Prior:
    """Prior with the default weight of growth: laws of lives, and widening of intervals by growth."""
    if not outcomes:
        raise TwingapError("no run has ended", where="prior", mend="give at least one run to failure")
    lives = [o.life for o in outcomes if o.life > 0]
    after = [o.after_onset for o in outcomes if o.after_onset]
    if not lives:
        raise TwingapError("no run has any revolutions", where="prior", mend="give runs with speed_rpm above 0")
    life = _log_normal(lives)
    return Prior(
        life,
        _log_normal(after) if after else None,
        widening=widening([o.past.errors() for o in outcomes if o.past is not None]),
    )


def past_intervals(estimates: Sequence[Estimate], lived: Sequence[float], at_onset: float) -> PastIntervals | None:
    """Past intervals of an ended run, from the onset of its anomaly to the last row but one.

    Parameters
    ----------
    estimates : sequence of Estimate [rows]
        Estimates made without other runs.
    lived : sequence of float [rows]
        Revolutions since the first row.
    at_onset : float
        Revolutions at the onset of the anomaly; NaN where no anomaly was left at the end. Rows before it are ignored.

    Returns
    -------
    PastIntervals or None
        None without estimates.
    """
    rows = [
        row for row, e in enumerate(estimates[:-1])
        if e.anomaly and np.isfinite(e.revolutions) and lived[row] >= at_onset
    ]  # fmt: skip
    if not rows:
        return None
    closed = [estimates[row].closed() for row in rows]
    turns = np.array([lived[row] for row in rows])
    growth = np.array([(e.revolutions_lo, e.revolutions, e.revolutions_hi) for e in closed])
    per_row = lived[-1] / (len(lived) - 1)
    return PastIntervals(growth, turns, turns - at_onset, lived[-1] - turns, per_row).thinned()


def usual_end(outcomes: Sequence[Outcome]) -> float | None:
    """Median amplitude ratio at the end of the runs that had an anomaly; None without such runs."""
    ends = [o.end_ratio for o in outcomes if o.after_onset and o.end_ratio and o.end_ratio > 1]
    return float(np.exp(np.median(np.log(ends)))) if ends else None


def read_outcomes(path: str | os.PathLike[str]) -> list[Outcome]:
    """Outcomes from a table with the columns record, life_revolutions, after_anomaly_revolutions, end_ratio.

    The last two may be empty or absent.
    """
    found = []
    for row in read_table(Path(path), ("record", "life_revolutions")):
        life = row.number_in("life_revolutions", needed=True, positive=True)
        assert life is not None
        after = row.number_in("after_anomaly_revolutions", positive=True)
        if not _SHORTEST <= life <= _LONGEST:
            mend = "give revolutions from the first record to the last"
            raise TwingapError(
                f"life of {life:g} revolutions, {_SHORTEST:g} to {_LONGEST:g} expected",
                where=row.where("life_revolutions"),
                mend=mend,
            )
        if after is not None and after > life * (1 + 1e-9):
            raise TwingapError(
                f"{after:g} revolutions after the anomaly of {life:g} in all",
                where=row.where("after_anomaly_revolutions"),
            )
        found.append(
            Outcome(row.text("record", needed=True) or "", life, after, row.number_in("end_ratio", positive=True))
        )
    return found


def _log_normal(values: Sequence[float]) -> LogNormal:
    return LogNormal(*_mean_std(values))


def _mean_std(values: Sequence[float]) -> tuple[float, float]:
    logs = np.log(values)
    squares = float(np.sum((logs - logs.mean()) ** 2)) + 2 * _USUAL_SPREAD**2
    return float(logs.mean()), float(np.sqrt(squares / (logs.size + 1) * (1 + 1 / logs.size)))
