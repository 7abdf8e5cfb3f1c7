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

Run as a part of the paper (``twingap run paper1 --profile full``), or alone:
``python -m papers.paper1_rul_varying_speed.femto --profile full --out DIR``; interrupted, it goes on where it was.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import twingap.prognosis
from papers.paper1_rul_varying_speed import methods, rivals
from papers.paper1_rul_varying_speed.methods import metrics
from papers.paper1_rul_varying_speed.methods.remaining_life import remaining_time_s
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.data import NotAtHandError, load
from twingap.data.root import data_root
from twingap.errors import TwingapError
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import Outcome, prior_from
from twingap.prognosis.past_errors import PastIntervals
from twingap.prognosis.prior import LEARNT, Prior
from twingap.provenance import digest_of_code, digest_of_path, digest_of_value
from twingap.signal import features as feature_module
from twingap.signal.features import time_features
from twingap.sweep import sweep

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]

SEEDS: Final = {"smoke": 1, "full": 3}
"""Of particle filter and forest, by profile: full takes a minute or two."""
FEWEST: Final = 3
"""Runs: what one is predicted with comes from two others at least."""
POOLED, ALONE = "twingap rul --prior", "twingap rul"
RIVALS: Final = ("exponential", "particle filter", "random forest")
METHODS: Final = (POOLED, ALONE, *RIVALS)
FEATURES: Final = ("peak_to_peak", "rms", "mean_abs", "kurtosis", "crest_factor", "shape_factor")
CUTS: Final = (0.615, 0.665, 0.748, 0.759, 0.798, 0.811, 0.815, 0.816, 0.866, 0.935, 0.940)
"""Shares of life after which the challenge cut its eleven test bearings (Nectoux et al. 2012)."""


@dataclass(frozen=True)
class Features:
    """Which bearing to take features of."""

    bearing: str


@dataclass(frozen=True)
class Prediction:
    """Which run is predicted by which method."""

    bearing: str
    method: str
    seed: int


@dataclass(frozen=True)
class Measured:
    """What is known of a run: its features and times.

    Parameters
    ----------
    features : Array [rows, len(FEATURES)]
    time_s, speed_rpm : Array [rows]
    """

    features: Array
    time_s: Array
    speed_rpm: Array

    @property
    def remaining_s(self) -> Array:
        """Time to the last snapshot [rows]: there the owner ended the run."""
        return np.asarray(self.time_s[-1] - self.time_s)


def take_features(job: Features, *, root: str | Path | None) -> dict[str, Any]:
    """Features of every snapshot of a run, one snapshot in memory at a time."""
    records = load("femto", root).select(lambda c: c.group == job.bearing)
    rows = [time_features(record.samples).select(FEATURES).values for record in records]
    return {
        "features": np.array(rows), "time_s": np.array([c.time_s for c in records.conditions], float),
        "speed_rpm": np.array([c.speed_rpm for c in records.conditions]),
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
        rows, turns = slice(alone["alarm"], run.time_s.size - 1), _revolutions(run)
        growth = np.column_stack([np.asarray(alone[k], float) for k in ("low", "predicted", "high")])
        growth = growth[rows] * run.speed_rpm[rows, None] / 60
        lived = turns[rows]
        per_row = float(turns[-1] / (turns.size - 1))
        told = PastIntervals(growth, lived, lived - turns[alone["onset"]], turns[-1] - lived, per_row).thinned()
    return Outcome(name, life.revolutions, after, float(np.exp(life.level)), told)


def predict(job: Prediction, *, runs: dict[str, Measured]) -> dict[str, Any]:
    """Remaining time at every snapshot of a run, without its own end.

    Returns
    -------
    dict
        `alarm`, `onset` (rows; None without), `passed` (anomalies taken back), and `predicted`, `low`, `high` in s
        [rows].
    """
    run = runs[job.bearing]
    others = {name: other for name, other in runs.items() if name != job.bearing}
    prior = prior_from([outcome(name, other) for name, other in others.items()])
    alone = followed(run, OnlineLife())
    passed = sum("has passed" in note for note in alone.notes)
    if job.method == ALONE:
        life = OnlineLife()
        rows = zip(run.time_s, run.speed_rpm, run.features[:, 0], strict=True)
        # Lower ends as growth gives them, also for a run without a healthy start, where `twingap rul` leaves them open.
        estimates = [life.update(float(t), float(s), float(p)).closed().time_s() for t, s, p in rows]
        predicted, low, high = np.array(estimates).T
    elif job.method == "random forest":
        train = [(_inputs(other), _revolutions(other)[-1] - _revolutions(other)) for other in others.values()]
        predicted, low, high = rivals.random_forest(train, _inputs(run), job.seed)
        predicted, low, high = (remaining_time_s(v, run.speed_rpm) for v in (predicted, low, high))
    else:
        predicted, low, high = _by_growth(job, run, alone, prior)
    return {
        "alarm": alone.alarm_row,
        "onset": alone.onset_row,
        "passed": passed,
        "predicted": predicted,
        "low": low,
        "high": high,
    }


def _by_growth(job: Prediction, run: Measured, alone: OnlineLife, prior: Prior) -> tuple[Array, Array, Array]:
    """A rival that follows amplitude from the onset on; before the alarm, what is left of a usual life."""
    left = np.maximum(np.exp(prior.life.mean) - _revolutions(run), 0.0)
    predicted, low, high = left.copy(), np.full(left.size, np.nan), np.full(left.size, np.nan)
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
    return tuple(remaining_time_s(v, run.speed_rpm) for v in (predicted, low, high))  # type: ignore[return-value]


def _revolutions(run: Measured) -> Array:
    turns = (run.speed_rpm[1:] + run.speed_rpm[:-1]) / 2 * np.diff(run.time_s) / 60
    return np.concatenate(([0.0], np.cumsum(turns)))


def _inputs(run: Measured) -> Array:
    return rivals.causal_features(run.features, _revolutions(run))


def pooled(bearing: str, runs: dict[str, Measured], alone: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Growth alone pooled with what other runs say: at the weight that the other bearings choose among themselves, with
    intervals as wide as those of the others should have been.

    Parameters
    ----------
    bearing : str
        Left out: neither its life nor its predictions enter weight or width.
    runs : dict
    alone : dict
        `predict` of each bearing by growth alone.
    """
    prior = prior_from([outcome(name, run, alone[name]) for name, run in runs.items() if name != bearing])
    return _pool(runs[bearing], alone[bearing], prior) | {what: getattr(prior, what) for what in LEARNT}


def _pool(run: Measured, found: dict[str, Any], prior: Prior) -> dict[str, Any]:
    turns, onset = _revolutions(run), found["onset"]
    columns = np.column_stack([np.asarray(found[k], float) for k in ("low", "predicted", "high")])
    per_time = run.speed_rpm / 60
    for row in range(turns.size):
        if np.isfinite(columns[row, 1]) and onset is not None:
            a, b, c = (float(v) for v in columns[row] * per_time[row])
            if c > 0:  # after the end level is reached, nothing remains
                per_row = turns[-1] / (turns.size - 1)
                columns[row] = prior.joined((a, b, c), turns[row], turns[row] - turns[onset], per_row)
                columns[row] /= per_time[row]
        else:
            columns[row] = np.array(prior.before(turns[row])) / per_time[row]
    return found | {"low": columns[:, 0], "predicted": columns[:, 1], "high": columns[:, 2]}


def judge(run: Measured, found: dict[str, Any]) -> dict[str, float]:
    """All metrics of one prediction: after the alarm, and at the challenge's cuts."""
    true, predicted = run.remaining_s, np.asarray(found["predicted"], float)
    low, high = np.asarray(found["low"], float), np.asarray(found["high"], float)
    after = slice(found["alarm"], true.size - 1) if found["alarm"] is not None else slice(0, 0)
    t, p = true[after], predicted[after]
    cuts = [round(share * (true.size - 1)) for share in CUTS]
    inside = metrics.coverage(t, low[after], high[after])
    return {
        "rows": t.size, "rmse_s": metrics.rmse(t, p),
        "relative_accuracy": metrics.cumulative_relative_accuracy(t, p),
        "alpha_lambda_half": float(metrics.alpha_lambda(t, p, 0.5, 0.2)),
        "within_20": float(metrics.within_alpha(t, p, 0.2).mean()) if t.size else float("nan"),
        "horizon_s": metrics.prognostic_horizon(t, p, float(true[0]), 0.1) if t.size else float("nan"),
        "phm2012_after_alarm": metrics.phm2012_score(t, p),
        "phm2012_at_cuts": metrics.phm2012_score(true[cuts], predicted[cuts]),
        "coverage": inside.share, "width_s": inside.mean_width,
    }  # fmt: skip


def table(runs: dict[str, Measured], results: Sequence[tuple[Prediction, dict[str, Any]]]) -> pd.DataFrame:
    """A row per bearing and method; of several seeds, the mean, and how far their RMSE scatters."""
    rows = [
        {"bearing": job.bearing, "method": job.method, "seed": job.seed, "alarm_row": value["alarm"],
         "passed": value["passed"], **{what: value.get(what, np.nan) for what in LEARNT},
         **judge(runs[job.bearing], value)}
        for job, value in results
    ]  # fmt: skip
    by = ["bearing", "method"]
    every = pd.DataFrame(rows)
    every["bearing"] = pd.Categorical(every["bearing"], list(runs))
    every["method"] = pd.Categorical(every["method"], METHODS)
    grouped = every.drop(columns="seed").groupby(by, sort=True, observed=True, as_index=False)
    found = grouped.mean()
    return found.assign(seeds=grouped.size()["size"], rmse_std_s=grouped["rmse_s"].std(ddof=1)["rmse_s"])


def wins(every: pd.DataFrame) -> pd.DataFrame:
    """Bearings on which the estimator is at least as good as rivals, per metric.

    Returns
    -------
    DataFrame
        Against the best rival of each bearing, a yardstick that knows the end; against the one that is best on average,
        which a reader would take instead; and against each rival throughout.
    """
    better = {
        "rmse_s": min, "relative_accuracy": max, "alpha_lambda_half": max, "within_20": max, "horizon_s": max,
        "phm2012_after_alarm": max, "phm2012_at_cuts": max,
    }  # fmt: skip
    rows = []
    plain = every.astype({"bearing": str, "method": str})
    for metric, best in better.items():
        values = plain.pivot(index="bearing", columns="method", values=metric)
        sign = -1 if best is min else 1
        rivals = values[list(RIVALS)]
        chosen = str((sign * rivals.mean()).idxmax())
        against = {
            "best of each bearing": rivals.agg(best, axis=1), f"best on average: {chosen}": rivals[chosen],
            **{name: rivals[name] for name in RIVALS},
        }  # fmt: skip
        for method in (POOLED, ALONE):
            for name, rival in against.items():
                good = sign * values[method] >= sign * rival
                rows.append(
                    {"metric": metric, "method": method, "against": name, "bearings_won": int(good.sum()),
                     "of": len(good), "which": " ".join(good.index[good])}
                )  # fmt: skip
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Femto:
    """What came out.

    Parameters
    ----------
    tables : dict of str to DataFrame
        femto (by bearing and method), femto_wins (who wins where).
    computed : int
        Predictions that ran now; the others came from the store.
    """

    tables: dict[str, pd.DataFrame]
    computed: int


def at_hand(root: Path | None = None) -> bool:
    """Whether the data root holds FEMTO's runs, as many as it takes to leave one out."""
    try:
        return len(load("femto", root).groups) >= FEWEST
    except NotAtHandError:
        return False


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    draw: bool = True,
    bearings: Sequence[str] = (),
) -> Femto:
    """Predict what is missing; tables, figure.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path, optional
        Data root.
    seed : int
        First of the seeds of the particle filter and the forest.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figures go there as well.
    progress : callable
    draw : bool
        Make the figure.
    bearings : sequence of str
        Which runs; all at hand when empty.

    Raises
    ------
    TwingapError
        When fewer than three runs are at hand.
    """
    seeds = profile_of(SEEDS, profile, Path(__file__))
    names = tuple(bearings) or load("femto", root).groups
    if len(names) < FEWEST:
        raise TwingapError(f"{len(names)} FEMTO runs at hand, {FEWEST} or more needed", mend="see `twingap data list`")
    digest = digest_of_path(data_root(root) / "femto")
    given: dict[str, Any] = {"store": out / "results", "backend": backend, "address": address}
    taken = sweep(
        partial(take_features, root=root), [Features(name) for name in names], data={"femto": digest},
        version=digest_of_code(feature_module), on_result=Count("features", len(names), progress), **given,
    )  # fmt: skip
    runs = {
        r.job.bearing: Measured(*(np.asarray(r.value[k], float) for k in ("features", "time_s", "speed_rpm")))
        for r in taken
    }
    jobs = [
        Prediction(name, method, one)
        for name in names
        for method in (ALONE, *RIVALS)
        for one in range(seed, seed + (seeds if method in ("particle filter", "random forest") else 1))
    ]
    results = sweep(
        partial(predict, runs=runs), jobs, data={"features": digest_of_value([r.key for r in taken])},
        version=digest_of_code(twingap.prognosis, methods, rivals, sys.modules[__name__]),
        on_result=Count("predictions", len(jobs), progress), **given,
    )  # fmt: skip
    alone = {r.job.bearing: r.value for r in results if r.job.method == ALONE}
    found = [(Prediction(name, POOLED, 0), pooled(name, runs, alone)) for name in names]
    every = table(runs, found + [(r.job, r.value) for r in results])
    made = {"femto": every, "femto_wins": wins(every)}
    keep_tables(made, out, log, "FEMTO")
    if draw:
        from papers.paper1_rul_varying_speed.femto_figures import errors

        keep_figures([("femto", errors(every))], out, log)
    return Femto(made, sum(bool(r.why) for r in taken) + sum(bool(r.why) for r in results))


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "Remaining life of the FEMTO learning bearings: tables and a figure.", lambda study: study.tables,
        arguments, takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper1_rul_varying_speed.femto import main as run_main

    run_main()
