"""Outcomes of runs that have ended, and the prior for other runs that they give.

a run followed to its end --outcome_of--> Outcome;  a table of lives --read_outcomes--> Outcomes --prior_from--> Prior
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
"""Weights of growth in `prognosis.prior` that are tried on runs that have ended."""
_SHARED: Final = 0.1
"""Share of the records of the shorter of two runs that makes them the same one."""
FEWEST_WITH_INTERVALS: Final = 3
"""Fewest runs with past intervals by which the weight of growth and the width of joined intervals are chosen."""
_SHORTEST: Final = 1.0
_LONGEST: Final = 1e14
"""Revolutions: a million rpm for two centuries."""
_USUAL_SPREAD: Final = 0.7
"""Standard deviation of log life over bearings of one kind, with the weight of two runs: a Weibull life of
slope 1.5 (rolling bearings: 1.1 to 1.5) has 0.85, one of slope 2 has 0.64."""


@dataclass(frozen=True)
class Outcome:
    """Life and past estimates of a run that has ended.

    Parameters
    ----------
    name : str
    life : float
        Revolutions from the first row to the end.
    after_onset : float or None
        From the onset of the anomaly; None when none was found.
    end_ratio : float or None
        Amplitude at the end over the healthy one.
    past : PastIntervals or None
        Its own estimates after the alarm, made without other runs.
    signs : frozenset
        Of its records, by which they are recognised; see `run_records.Amplitude`. Empty when the run is a row of a
        table.
    """

    name: str
    life: float
    after_onset: float | None
    end_ratio: float | None
    past: PastIntervals | None = None
    signs: frozenset[tuple[float, float]] = frozenset()

    def same_as(self, other: Outcome) -> bool:
        """Whether both are of one run, or of parts of it that overlap."""
        if self.signs and other.signs:
            shared = len(self.signs & other.signs)
            return shared >= _SHARED * min(len(self.signs), len(other.signs))
        return self.name == other.name and bool(np.isclose(self.life, other.life, rtol=1e-3, atol=0))


def outcome_of(
    name: str,
    life: OnlineLife,
    estimates: Sequence[Estimate],
    lived: Sequence[float],
    signs: frozenset[tuple[float, float]] = frozenset(),
) -> Outcome:
    """Outcome of a run.

    Parameters
    ----------
    name : str
    life : OnlineLife
        As it is after the last row.
    estimates : sequence of Estimate [rows]
        Made without other runs.
    lived : sequence of float [rows]
        Revolutions since the first row.
    signs : frozenset, optional
        See `Outcome`.

    Notes
    -----
    A life ends where a limit in absolute amplitude was reached, however long the run was recorded beyond it. An end by
    ratio is a rule of thumb, which the machine's owner did not keep to: there the last row is the end.
    """
    at_limit = life.options.limit is not None and life.end_row is not None
    rows = life.end_row + 1 if at_limit and life.end_row is not None else len(lived)
    begun = life.revolutions_at_onset
    level = life.end_level if at_limit else life.level
    return Outcome(
        name, lived[rows - 1],
        None if life.onset_row is None else max(lived[rows - 1] - begun, 0.0),
        float(np.exp(level)) if np.isfinite(level) else None,
        past_intervals(estimates[:rows], lived[:rows], begun), signs,
    )  # fmt: skip


def refuse_repeats(ended: Sequence[tuple[str, Outcome]], run: Outcome | None = None) -> None:
    """Refuse runs that are given twice, and the run itself, whose future is to be predicted.

    Parameters
    ----------
    ended : sequence of (str, Outcome)
        Where each was read from, and its outcome.
    run : Outcome, optional
        The run whose remaining life is estimated.

    Raises
    ------
    TwingapError
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
                    f"run {outcome.name!r} is given already by {before}, and would count twice",
                    where=where, mend="give each run to --prior once",
                )  # fmt: skip


def prior_from(outcomes: Sequence[Outcome]) -> Prior:
    """Prior of a run from others of its kind that have ended.

    Parameters
    ----------
    outcomes : sequence of Outcome
        At least one. Of runs without an anomaly only the life is used.

    Returns
    -------
    Prior
        Log-normal laws, with the spread of one more draw: sqrt(1 + 1/n) of their standard deviation; and how much
        wider intervals of growth should have been. Where `FEWEST_WITH_INTERVALS` runs have past intervals, each of
        them is joined with the estimate from the others: the weight of growth is that of the least error of log life,
        and intervals are made as wide as these should have been.
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
    """Intervals [rows, 3] of a run that has ended, joined with the prior of other runs."""
    rows = zip(past.growth, past.lived, past.since_onset, strict=True)
    return np.array(
        [prior.joined((float(a), float(b), float(c)), lived, since, past.per_row) for (a, b, c), lived, since in rows]
    )


def _laws(outcomes: Sequence[Outcome]) -> Prior:
    """Prior with default weight of growth: laws of lives, widening of growth's intervals."""
    if not outcomes:
        raise TwingapError("no run has ended", where="prior", mend="give at least one run to failure")
    lives = [o.life for o in outcomes if o.life > 0]
    after = [o.after_onset for o in outcomes if o.after_onset]
    if not lives:
        raise TwingapError("no run has turned at all", where="prior", mend="give runs with speed_rpm above 0")
    life = _log_normal(lives)
    return Prior(
        life,
        _log_normal(after) if after else None,
        widening=widening([o.past.errors() for o in outcomes if o.past is not None]),
    )


def past_intervals(estimates: Sequence[Estimate], lived: Sequence[float], at_onset: float) -> PastIntervals | None:
    """Past intervals of a run that has ended, from the onset of its anomaly to the row before the last.

    Parameters
    ----------
    estimates : sequence of Estimate [rows]
        Made without other runs.
    lived : sequence of float [rows]
        Revolutions since the first row.
    at_onset : float
        Of them, at the onset of the anomaly; NaN where no anomaly was left at the end. Rows before it are left out.

    Returns
    -------
    PastIntervals or None
        None where nothing was estimated.
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
            raise TwingapError(f"{life:g} revolutions are no life", where=row.where("life_revolutions"), mend=mend)
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
