"""A whole run followed row by row, and what it teaches about runs to come.

Run --OnlineLife, one record in memory--> Followed: an estimate a row, notes;  Followed, ... --> Prior
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from twingap.errors import TwingapError
from twingap.prognosis.online import Estimate, LifeOptions, OnlineLife
from twingap.prognosis.past_errors import Array, Told, widening
from twingap.prognosis.prior import LogNormal, Prior
from twingap.prognosis.run_records import Run, RunRow
from twingap.records.table import read_table

COLUMNS: Final = (
    "record", "anomaly", "remaining_revolutions", "remaining_time_s", "remaining_time_s_lo", "remaining_time_s_hi",
)  # fmt: skip
WEIGHTS: Final = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)
"""Of growth in `prognosis.prior`, among which runs that ended choose."""
_NEARLY: Final = 0.9
"""Share of the length of the healthy records that a shorter one may have: a tenth less lowers peak to peak of noise by
less than 2 %."""
_OUTLIER: Final = 0.5
"""Share of their median length below which a healthy record does not set how much is taken of all."""
_SHARED: Final = 0.1
"""Share of the records of the shorter of two runs that makes them the same one."""
FEWEST_TOLD: Final = 3
"""Runs with estimates of their own that it takes to choose, and to say how wide joined intervals have to be."""
_SHORTEST: Final = 1.0
_LONGEST: Final = 1e14
"""Revolutions: a million rpm for two centuries."""
_IMPULSIVE: Final = 6.0
_USUAL_SPREAD: Final = 0.7
"""Standard deviation of log life over bearings of one kind, taken for as much as two runs would say: a Weibull life of
slope 1.5 (rolling bearings: 1.1 to 1.5) has 0.85, one of slope 2 has 0.64."""


@dataclass(frozen=True)
class Outcome:
    """What a run that has ended says about others.

    Parameters
    ----------
    name : str
    life : float
        Revolutions from first to last row.
    after_onset : float or None
        From the onset of the anomaly; None when none was found.
    end_ratio : float or None
        Amplitude at the end over the healthy one.
    told : Told or None
        Its own estimates after the alarm, made without other runs.
    signs : frozenset
        Of its records, by which they are known again; see `run_records.Amplitude`. Empty when the run is a row of a
        table.
    """

    name: str
    life: float
    after_onset: float | None
    end_ratio: float | None
    told: Told | None = None
    signs: frozenset[tuple[float, float]] = frozenset()

    def same_as(self, other: Outcome) -> bool:
        """Whether both are of one run, or of parts of it that overlap."""
        if self.signs and other.signs:
            shared = len(self.signs & other.signs)
            return shared >= _SHARED * min(len(self.signs), len(other.signs))
        return self.name == other.name and bool(np.isclose(self.life, other.life, rtol=1e-3, atol=0))


@dataclass(frozen=True)
class Followed:
    """A run with its estimates.

    Parameters
    ----------
    run : Run
    estimates : tuple of Estimate
        One a row.
    notes : tuple of str
    outcome : Outcome
        Should the last row be the end of life.
    alarm, onset : str or None
        Records at which the anomaly was known, and began.
    """

    run: Run
    estimates: tuple[Estimate, ...]
    notes: tuple[str, ...]
    outcome: Outcome
    alarm: str | None
    onset: str | None

    def rows(self) -> list[dict[str, Any]]:
        """Rows of rul.csv; None for an empty cell."""
        return [_row(row, e) for row, e in zip(self.run.rows, self.estimates, strict=True)]


def follow(
    run: Run,
    options: LifeOptions | None = None,
    prior: Prior | None = None,
    *,
    report: Callable[[Iterable[RunRow]], Iterable[RunRow]] = iter,
) -> Followed:
    """Estimate remaining life after every row of a run, each from the rows up to it.

    Parameters
    ----------
    run : Run
    options : LifeOptions, optional
    prior : Prior, optional
    report : callable
        Wraps the rows as they are taken, to show progress.

    Raises
    ------
    TwingapError
        Naming the run: when its healthy rows do not scatter at all, or lie above the limit already.

    Notes
    -----
    Peak to peak grows with a record's length. Where lengths differ it is that of the first samples of every record, as
    many as the shortest healthy one has: an average over stretches would scatter less in longer records, and be no
    measure for shorter ones. Only healthy rows say how many, so that no row depends on later ones.
    """
    life = OnlineLife(options, prior)
    taken = _taken(run, life.options.healthy_rows)
    estimates: list[Estimate] = []
    lived: list[float] = []
    skipped: list[str] = []
    short: list[str] = []
    kurtosis: list[float] = []
    signs: set[tuple[float, float]] = set()
    usable = timeless = 0
    for row in report(run.rows):
        try:
            amplitude = row.amplitude(taken)
        except TwingapError as error:
            skipped.append(str(error))
            height, shape = float("nan"), float("nan")
        else:
            height, shape = amplitude.peak_to_peak, amplitude.kurtosis
            if (sign := amplitude.sign(run.unit)) is not None:
                signs.add(sign)
            if row.speed_rpm > 0 and not height > 0:
                skipped.append(f"record {row.name!r} does not vibrate at all")
            elif row.speed_rpm > 0 and row.channel and taken and row.channel.n_samples < _NEARLY * taken:
                short.append(row.name)
                height, shape = float("nan"), float("nan")
        if len(kurtosis) < life.options.healthy_rows and np.isfinite(shape):
            kurtosis.append(shape)
        usable += row.speed_rpm > 0 and height > 0
        try:
            estimates.append(life.update(row.time_s, row.speed_rpm, height))
        except TwingapError as error:
            raise TwingapError(error.what, where=f"run {run.name!r}, {error.where}", mend=error.mend) from error
        lived.append(life.revolutions)
        timeless += life.timeless
    left_out = skipped[0] + (f", and {len(skipped) - 1} more" if len(skipped) > 1 else "") if skipped else None
    if left_out and not usable:
        raise TwingapError(f"no record can be used: {left_out}", where=f"run {run.name!r}")
    notes = [*run.notes, *_shortened(life.notes)]
    lengths = {row.channel.n_samples for row in run.rows if row.channel is not None and row.speed_rpm > 0}
    if taken is not None and len(lengths) > 1:
        notes.append(
            f"records have {min(lengths)} to {max(lengths)} samples, and peak to peak grows with length: it is that of "
            f"the first {taken} of each, as many as the shortest healthy record has"
        )
    if short:
        them = f"record {short[0]!r} has" if len(short) == 1 else f"{len(short)} records, the first {short[0]!r}, have"
        notes.append(
            f"{them} too few samples to be compared with healthy ones: left out, and no anomaly can be seen there"
        )
    if timeless:
        notes.append(
            f"by time_s nothing has turned since the anomaly began in {timeless} rows: growth says nothing of what "
            "remains there"
        )
    if left_out:
        notes.append(f"left out, with the estimate carried on from the row before: {left_out}")
    if kurtosis and float(np.median(kurtosis)) > _IMPULSIVE:
        notes.append(
            f"the first rows are impulsive (kurtosis {np.median(kurtosis):.1f}; Gaussian noise has 3): the bearing may "
            "not have been healthy at the start, and amplitude is relative to what it was then"
        )
    if life.alarm_row is None:
        notes.append(_why_none(life, usable))
    if life.end_row is not None:
        notes.append(f"end of life is reached at record {run.rows[life.end_row].name!r}: nothing remains from there on")
    outcome = Outcome(
        run.name, life.revolutions,
        None if life.onset_row is None else max(life.revolutions - life.revolutions_at_onset, 0.0),
        None if not np.isfinite(life.level) else float(np.exp(life.level)),
        told_of(estimates, lived, life.revolutions_at_onset), frozenset(signs),
    )  # fmt: skip
    names = [None if place is None else run.rows[place].name for place in (life.alarm_row, life.onset_row)]
    return Followed(run, tuple(estimates), tuple(notes), outcome, names[0], names[1])


def _taken(run: Run, healthy_rows: int) -> int | None:
    """How many samples of every record peak to peak is taken of; None for a run without records.

    By the lengths of the first records of the running machine, before the last of which nothing is judged. One that is
    cut off by far does not count.
    """
    lengths = [row.channel.n_samples for row in run.rows if row.channel is not None and row.speed_rpm > 0]
    healthy = np.array(lengths[:healthy_rows])
    return int(healthy[healthy >= _OUTLIER * np.median(healthy)].min()) if healthy.size else None


def refuse_repeats(ended: Sequence[tuple[str, Outcome]], run: Outcome | None = None) -> None:
    """Refuse runs that are given twice, or that are the run itself: it would be told its own future.

    Parameters
    ----------
    ended : sequence of (str, Outcome)
        Where each was read from, and what it says.
    run : Outcome, optional
        The run that is asked about.

    Raises
    ------
    TwingapError
    """
    for place, (where, outcome) in enumerate(ended):
        if run is not None and outcome.same_as(run):
            raise TwingapError(
                f"run {outcome.name!r} is the run that is asked about, which would answer from its own future",
                where=where, mend="leave it out of --prior",
            )  # fmt: skip
        for before, other in ended[:place]:
            if outcome.same_as(other):
                raise TwingapError(
                    f"run {outcome.name!r} is given already by {before}, and would count twice",
                    where=where, mend="give each run to --prior once",
                )  # fmt: skip


def prior_from(outcomes: Sequence[Outcome]) -> Prior:
    """What runs that ended say of the next one of their kind.

    Parameters
    ----------
    outcomes : sequence of Outcome
        At least one. Runs without an anomaly tell their life alone.

    Returns
    -------
    Prior
        Log-normal laws, with the spread of one more draw: sqrt(1 + 1/n) of their standard deviation; and how much
        wider intervals of growth should have been. Where `FEWEST_TOLD` runs tell of their own estimates, each of them
        is joined with what the others say: the weight of growth is that of the least error of log life, and intervals
        are made as wide as these should have been.
    """
    prior = _laws(outcomes)
    if sum(own.told is not None for own in outcomes) < FEWEST_TOLD:
        return prior
    each = [
        (own.told, _laws([*outcomes[:place], *outcomes[place + 1 :]]))
        for place, own in enumerate(outcomes) if own.told is not None
    ]  # fmt: skip

    def joined(weight: float) -> list[tuple[Told, Array]]:
        return [(told, _joined(told, dataclasses.replace(others, growth_weight=weight))) for told, others in each]

    by_weight = {weight: joined(weight) for weight in WEIGHTS}
    best = min(WEIGHTS, key=lambda weight: float(np.mean([told.log_error(said) for told, said in by_weight[weight]])))
    wider = widening([told.errors(said) for told, said in by_weight[best]])
    return dataclasses.replace(prior, growth_weight=best, joined_widening=wider)


def _joined(told: Told, prior: Prior) -> Array:
    """Intervals [rows, 3] of a run that ended, joined with what other runs say."""
    rows = zip(told.growth, told.lived, told.since_onset, strict=True)
    said = [
        prior.joined((float(a), float(b), float(c)), lived, since, told.per_row) for (a, b, c), lived, since in rows
    ]
    return np.array(said)


def _laws(outcomes: Sequence[Outcome]) -> Prior:
    """What runs say one by one: lives, and intervals of growth."""
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
        widening=widening([o.told.errors() for o in outcomes if o.told is not None]),
    )


def told_of(estimates: Sequence[Estimate], lived: Sequence[float], at_onset: float) -> Told | None:
    """What a run that has ended tells of its own estimates, from the rows of its anomaly, but for the last one.

    Parameters
    ----------
    estimates : sequence of Estimate [rows]
        Made without other runs.
    lived : sequence of float [rows]
        Revolutions since the first row.
    at_onset : float
        Of them, at the onset of the anomaly.

    Returns
    -------
    Told or None
        None where nothing was estimated.
    """
    rows = [row for row, e in enumerate(estimates[:-1]) if e.anomaly and np.isfinite(e.revolutions)]
    if not rows:
        return None
    said = [estimates[row].closed() for row in rows]
    turns = np.array([lived[row] for row in rows])
    growth = np.array([(e.revolutions_lo, e.revolutions, e.revolutions_hi) for e in said])
    per_row = lived[-1] / (len(lived) - 1)
    return Told(growth, turns, np.maximum(turns - at_onset, 0.0), lived[-1] - turns, per_row).thinned()


def usual_end(outcomes: Sequence[Outcome]) -> float | None:
    """Median amplitude ratio at which runs ended that had an anomaly; None when none says."""
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


def _row(row: RunRow, e: Estimate) -> dict[str, Any]:
    values = (e.revolutions, *e.time_s())
    cells = [float(v) if np.isfinite(v) else None for v in values]
    return dict(zip(COLUMNS, (row.name, int(e.anomaly), *cells), strict=True))


def _shortened(notes: Sequence[str], kept: int = 3) -> list[str]:
    """The first notes of each kind (by their first words), and how many more of it there are."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(" ".join(note.split()[:2]), []).append(note)
    out = []
    for alike in kinds.values():
        more = len(alike) - kept
        out += alike[:kept] if more > 1 else alike  # a line that says "1 more" is no shorter than that one
        out += [f"and {more} more such notes"] if more > 1 else []
    return out


def _why_none(life: OnlineLife, usable: int) -> str:
    if life.judged:
        why = "amplitude does not stay above its healthy scatter"
        if life.above:
            last = "the last row lies" if life.above == 1 else f"the last {life.above} rows lie"
            why = f"{last} above the healthy scatter, {life.together} together make one"
        return f"no anomaly: {why}; remaining life is left empty" + (
            "" if life.prior is None else " but for what other runs say"
        )
    return (
        f"{usable} {'row' if usable == 1 else 'rows'} of the running machine that can be used are too few to tell an "
        f"anomaly: the first {life.options.healthy_rows} of them count as healthy (--healthy-rows)"
    )
