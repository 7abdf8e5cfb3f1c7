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
from twingap.prognosis.life_law import law_of, log_normal
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.past_errors import PastIntervals, pooled_widening, widening
from twingap.prognosis.prior import Prior
from twingap.records.table import read_table

WEIGHTS: Final = (0.5, 0.75, 1.0, 2.0, 4.0)
"""Weights of growth in `prognosis.prior` that are compared on ended runs. With one near 0, the end of a run that grows
unlike them would not be seen; without large ones, lives that tell nothing would outweigh growth."""
_SHARED: Final = 0.1
"""Fraction of shared records, relative to the shorter run, from which two runs count as the same."""
FEWEST_WITH_INTERVALS: Final = 3
"""Fewest runs with past intervals for which the weight of growth and the width of pooled intervals are chosen."""
_SHORTEST: Final = 1.0
_LONGEST: Final = 1e14
"""Bounds of a life in revolutions; values outside are input errors."""
LOAD_EXPONENT: Final = 3.0
"""Exponent p of ISO 281, life ~ load^-p: 3 for ball bearings. Roller bearings have 10/3, a difference of 8 % of life
where loads differ by a quarter."""


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
    load_n : float or None
        Load of the run, N; None where it is not known.
    """

    name: str
    life: float
    after_onset: float | None
    end_ratio: float | None
    past: PastIntervals | None = None
    fingerprints: frozenset[tuple[float, float]] = frozenset()
    load_n: float | None = None

    def at_load(self, load_n: float | None) -> Outcome:
        """The outcome with its revolutions as they would be at another load, by ISO 281.

        Revolutions stay as they are where one of the loads is not known or 0.
        """
        if not self.load_n or not load_n or self.load_n == load_n:
            return self
        factor = (self.load_n / load_n) ** LOAD_EXPONENT
        after = None if self.after_onset is None else factor * self.after_onset
        past = None if self.past is None else self.past.scaled(factor)
        return dataclasses.replace(self, life=factor * self.life, after_onset=after, past=past, load_n=load_n)

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
    load_n: float | None = None,
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
    load_n : float, optional
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
        past_intervals(estimates[:rows], lived[:rows], onset), fingerprints, load_n,
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


def prior_from(outcomes: Sequence[Outcome], load_n: float | None = None) -> Prior:
    """Prior of a run from ended runs of its kind.

    Parameters
    ----------
    outcomes : sequence of Outcome
        At least one. For runs without an anomaly only the life is used.
    load_n : float, optional
        Load of the run, N, to which lives at other loads are converted.

    Returns
    -------
    Prior
        Predictive laws of lives (see `life_law`), and the factor on the width of intervals by growth. Where
        `FEWEST_WITH_INTERVALS` runs have past intervals, each of them is pooled with the lives of the others: the
        weight of growth minimises the error of log remaining life, and the width of pooled intervals follows from
        what these runs needed (`past_errors.pooled_widening`).
    """
    prior = _laws(outcomes, load_n)
    if sum(own.past is not None for own in outcomes) < FEWEST_WITH_INTERVALS:
        return prior
    each = [
        (own.past, _laws([*outcomes[:place], *outcomes[place + 1 :]], own.load_n))
        for place, own in enumerate(outcomes) if own.past is not None
    ]  # fmt: skip

    def weighted(weight: float) -> list[tuple[PastIntervals, Prior]]:
        return [(past, dataclasses.replace(others, growth_weight=weight)) for past, others in each]

    def error(weight: float) -> float:
        found = [
            past.log_error(others.joined_rows(past.growth, past.lived, past.since_onset, past.per_row))
            for past, others in weighted(weight)
        ]
        return float(np.mean(found))

    best = min(WEIGHTS, key=error)
    pooled = [
        past.errors(others.joined_rows(past.growth, past.lived, past.since_onset, past.per_row))
        for past, others in weighted(best)
    ]
    return dataclasses.replace(prior, growth_weight=best, joined_widening=pooled_widening(pooled))


def _laws(ended: Sequence[Outcome], load_n: float | None) -> Prior:
    """Prior with the default weight of growth: laws of lives at a load, and widening of intervals by growth."""
    if not ended:
        raise TwingapError("no run has ended", where="prior", mend="give at least one run to failure")
    outcomes = [o.at_load(load_n) for o in ended]
    lives = [o.life for o in outcomes if o.life > 0]
    after = [o.after_onset for o in outcomes if o.after_onset]
    if not lives:
        raise TwingapError("no run has any revolutions", where="prior", mend="give runs with speed_rpm above 0")
    return Prior(
        law_of(lives),
        log_normal(after) if after else None,
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
    """Outcomes from a table with the columns record, life_revolutions, after_anomaly_revolutions, end_ratio, load_n.

    The last three may be empty or absent.
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
        ratio, load_n = row.number_in("end_ratio", positive=True), row.number_in("load_n", positive=True)
        found.append(Outcome(row.text("record", needed=True) or "", life, after, ratio, load_n=load_n))
    return found
