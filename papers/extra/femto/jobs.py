"""Remaining life of the six FEMTO learning bearings: the online estimator beside its rivals.

snapshots --features (kept)--> amplitude [rows] --leave one bearing out--> predictions of five methods --> tables

What other runs say of life comes from the five other bearings, as do the weight that this is given and how wide
intervals have to be, as in `twingap rul --prior`; the forest is trained on them. Life ends at ten times the healthy
amplitude for all, the default: the owner ends a run when vibration passes 20 g, but these ended at 5 to 49 g.

**These are development numbers, not blind ones.** About seven variants of the method were scored on these six runs
while it was made, and three things were written after a look at them, which hold for all users: an amplitude that falls
while a bearing runs in is learnt again, an anomaly may pass, and runs with a plateau are among those that intervals are
calibrated on. Leaving a bearing out keeps its own end from its prediction, and does not undo that choice; on runs that
nobody has looked at, expect less.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from papers.arrays import Array
from papers.extra.femto import rivals
from papers.framework import Inputs, Work
from papers.paper1_rul_varying_speed.methods.run import remaining_time_s
from twingap import TwingapError
from twingap.data import NotAtHandError, data_root, load
from twingap.prognosis import OnlineLife, Outcome, Prior, prior_from
from twingap.prognosis.past_errors import PastIntervals
from twingap.provenance import digest_of_path
from twingap.signal.features import time_features

FEWEST: Final = 3  # runs: what one is predicted with comes from two others at least
POOLED, ALONE = "twingap rul --prior", "twingap rul"
RIVALS: Final = ("exponential", "particle filter", "random forest")
METHODS: Final = (POOLED, ALONE, *RIVALS)
FEATURES: Final = ("peak_to_peak", "rms", "mean_abs", "kurtosis", "crest_factor", "shape_factor")
CUTS: Final = (0.615, 0.665, 0.748, 0.759, 0.798, 0.811, 0.815, 0.816, 0.866, 0.935, 0.940)
"""Shares of life after which the challenge cut its eleven test bearings (Nectoux et al. 2012)."""


@dataclass(frozen=True)
class Size:
    bearings: tuple[str, ...]
    seeds: int


@dataclass(frozen=True)
class Options:
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Features:
    bearing: str


@dataclass(frozen=True)
class Prediction:
    bearing: str
    method: str
    seed: int


@dataclass(frozen=True)
class Measured:
    """What is known of a run: its features and times."""

    features: Array  # [rows, len(FEATURES)]
    time_s: Array  # [rows]
    speed_rpm: Array  # [rows]
    load_n: float | None = None


def take_features(job: Features, *, root: str | Path | None) -> dict[str, Any]:
    """Features of every snapshot of a run, one snapshot in memory at a time."""
    records = load("femto", root).select(lambda c: c.group == job.bearing)
    rows = [time_features(record.samples).select(FEATURES).values for record in records]
    return {
        "features": np.array(rows), "time_s": np.array([c.time_s for c in records.conditions], float),
        "speed_rpm": np.array([c.speed_rpm for c in records.conditions]), "load_n": records.conditions[0].load_n,
    }  # fmt: skip


def followed(run: Measured, life: OnlineLife) -> OnlineLife:
    """A run taken to its end without asking for estimates."""
    for time_s, speed, row in zip(run.time_s, run.speed_rpm, run.features, strict=True):
        life.take(float(time_s), float(speed), float(row[0]))
    return life


def outcome(name: str, run: Measured, alone: dict[str, Any] | None = None) -> Outcome:
    """What a run that ended says of others; of intervals, where its own predictions by growth alone are given."""
    life = followed(run, OnlineLife())
    after = None if life.onset_row is None else life.revolutions - life.revolutions_at_onset
    told = None
    if alone is not None and alone["alarm"] is not None:
        rows, turns = slice(alone["alarm"], run.time_s.size - 1), revolutions(run)
        growth = np.column_stack([np.asarray(alone[k], float) for k in ("low", "predicted", "high")])
        growth = growth[rows] * run.speed_rpm[rows, None] / 60
        lived = turns[rows]
        per_row = float(turns[-1] / (turns.size - 1))
        told = PastIntervals(growth, lived, lived - turns[alone["onset"]], turns[-1] - lived, per_row).thinned()
    return Outcome(name, life.revolutions, after, float(np.exp(life.level)), told, load_n=run.load_n)


def predict(job: Prediction, *, runs: dict[str, Measured]) -> dict[str, Any]:
    """Remaining time at every snapshot of a run, without its own end: rows of `alarm` and `onset` (None without),
    anomalies taken back (`passed`), `predicted`, `low` and `high` in s [rows]."""
    run = runs[job.bearing]
    others = {name: other for name, other in runs.items() if name != job.bearing}
    prior = prior_from([outcome(name, other) for name, other in others.items()], run.load_n)
    alone = followed(run, OnlineLife())
    passed = sum("has passed" in note for note in alone.notes)
    if job.method == ALONE:
        life = OnlineLife()
        rows = zip(run.time_s, run.speed_rpm, run.features[:, 0], strict=True)
        # Lower ends as growth gives them, also for a run without a healthy start, where `twingap rul` leaves them open.
        estimates = [life.update(float(t), float(s), float(p)).closed().time_s() for t, s, p in rows]
        predicted, low, high = np.array(estimates).T
    else:
        if job.method == "random forest":
            train = [(_inputs(other), revolutions(other)[-1] - revolutions(other)) for other in others.values()]
            told = rivals.random_forest(train, _inputs(run), job.seed)
        else:
            told = _by_growth(job, run, alone, prior)
        predicted, low, high = (remaining_time_s(v, run.speed_rpm) for v in told)
    return {
        "alarm": alone.alarm_row, "onset": alone.onset_row, "passed": passed, "predicted": predicted, "low": low,
        "high": high,
    }  # fmt: skip


def _by_growth(job: Prediction, run: Measured, alone: OnlineLife, prior: Prior) -> tuple[Array, Array, Array]:
    """A rival that follows amplitude from the onset on; before the alarm, what is left of a usual life."""
    predicted = np.maximum(np.exp(prior.life.mean) - revolutions(run), 0.0)
    low, high = np.full((2, predicted.size), np.nan)
    rows, turns, logs = alone.amplitudes
    if alone.onset_row is not None and alone.alarm_row is not None:
        first = int(np.searchsorted(rows, alone.onset_row))
        usual = prior.after_onset or prior.life
        growth = rivals.Growth(
            turns[first:] - turns[first], logs[first:], alone.scatter,
            int(np.searchsorted(rows[first:], alone.alarm_row)), alone.end_level, float(np.exp(usual.mean)),
        )  # fmt: skip
        if job.method == "exponential":
            found = rivals.exponential_extrapolation(growth)
            bounds = np.full((2, found.size), np.nan)
        else:
            found, *ends = rivals.particle_filter(growth, np.random.default_rng([job.seed, 7]))
            bounds = np.array(ends)
        given = np.isfinite(found)
        places = rows[first:][given]
        predicted[places], low[places], high[places] = found[given], bounds[0][given], bounds[1][given]
    return predicted, low, high


def revolutions(run: Measured) -> Array:
    turns = (run.speed_rpm[1:] + run.speed_rpm[:-1]) / 2 * np.diff(run.time_s) / 60
    return np.concatenate(([0.0], np.cumsum(turns)))


def _inputs(run: Measured) -> Array:
    return rivals.causal_features(run.features, revolutions(run))


def at_hand(root: Path | None = None, fewest: int = FEWEST) -> bool:
    """Whether the data root holds FEMTO's runs, as many as it takes to leave one out."""
    try:
        return len(load("femto", root).groups) >= fewest
    except NotAtHandError:
        return False


def bearings(work: Work) -> list[Features]:
    return at_least(work.size.bearings or load("femto", work.root).groups, FEWEST)


def at_least(names: Sequence[str], fewest: int) -> list[Features]:
    """A job for each run; raises `TwingapError` for fewer runs."""
    if len(names) < fewest:
        raise TwingapError(f"{len(names)} FEMTO runs at hand, {fewest} or more needed", mend="see `twingap data list`")
    return [Features(name) for name in names]


def files(work: Work) -> Inputs:
    """Where the snapshots lie, and the digest of all of them."""
    return {"root": (work.root, digest_of_path(data_root(work.root) / "femto"))}


def predictions(work: Work) -> Iterator[Prediction]:
    """Every run by every method, those that draw lots with several seeds."""
    for name in work["runs"]:
        for method in (ALONE, *RIVALS):
            drawn = method in ("particle filter", "random forest")
            for seed in range(work.seed, work.seed + (work.size.seeds if drawn else 1)):
                yield Prediction(name, method, seed)
