"""Study of the virtual rig's lives: every run followed row by row, judged, and means over bearings."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from papers.arrays import Array
from papers.extra.rig_lives import jobs
from papers.framework import Step, Study
from papers.paper1_rul_varying_speed.methods import metrics
from twingap.prognosis import Estimate, LifeOptions, OnlineLife
from twingap.prognosis.outcomes import Outcome, outcome_of, prior_from
from twingap.prognosis.prior import LEARNT, Prior
from twingap.rigs.smart_maintenance import END_OF_LIFE_G, RUNS, TITLE

MEASURED: Final = (
    "rmse_min", "relative_accuracy", "alpha_lambda_half", "within_20", "horizon_min", "phm2012_after_alarm", "coverage",
    "width",
)  # fmt: skip
LATENESS: Final = ("onset_late_percent", "alarm_late_percent")
"""Of the run's length, after the rig's own onset; negative where before it."""
ALPHA: Final = 0.2
"""Half width of the cone of relative error; the horizon's band is half of it, of the whole life."""
ALONE, TOGETHER = "twingap rul", "twingap rul --prior"


@dataclass(frozen=True)
class Taken:
    """A run with its estimates."""

    estimates: tuple[Estimate, ...]
    lived: Array  # [rows] revolutions since the first row
    life: OnlineLife  # as it was after the last row
    alarm: tuple[int, int] | None  # rows of the first alarm's onset and of that alarm, also of one that was taken back

    def outcome(self, name: str) -> Outcome:
        """What it says of others, now that it has ended."""
        return outcome_of(name, self.life, self.estimates, self.lived.tolist())


def take(run: dict[str, Any], prior: Prior | None = None) -> Taken:
    """A run row by row, each estimate from the rows up to it."""
    life, estimates, lived = OnlineLife(LifeOptions(limit=END_OF_LIFE_G), prior), [], []
    alarm = None
    for row in zip(run["time_s"], run["speed_rpm"], run["peak_to_peak_g"], strict=True):
        estimates.append(life.update(*(float(v) for v in row)))
        lived.append(life.revolutions)
        if alarm is None and life.onset_row is not None and life.alarm_row is not None:
            alarm = life.onset_row, life.alarm_row
    return Taken(tuple(estimates), np.array(lived), life, alarm)


def lateness(alarm: tuple[int, int] | None, time_s: Array, onset_s: float) -> dict[str, float]:
    """How long after the true onset the first anomaly is dated, and known, in percent of the run; NaN without one."""
    rows = (None, None) if alarm is None else alarm
    late = [np.nan if row is None else 100 * (float(time_s[row]) - onset_s) / float(time_s[-1]) for row in rows]
    return dict(zip(LATENESS, late, strict=True))


def judge(taken: Taken) -> dict[str, float]:
    """Errors in minutes at each row's speed, prognostic metrics and coverage, after the alarm; alpha-lambda at half of
    the revolutions that remained at the first estimate."""
    told = [(e, taken.lived[-1] - at) for e, at in zip(taken.estimates[:-1], taken.lived[:-1], strict=True)]
    told = [(e, left) for e, left in told if e.anomaly and np.isfinite(e.revolutions)]
    if not told:
        return {"rows": 0, **dict.fromkeys(MEASURED, np.nan)}
    remaining, predicted = np.array([left for _, left in told]), np.array([e.revolutions for e, _ in told])
    true = remaining / np.array([e.speed_rpm for e, _ in told])
    middle, low, high = (np.array([e.time_s()[k] / 60 for e, _ in told]) for k in range(3))
    inside = metrics.coverage(true, low, high)
    whole = float(taken.lived[-1] / np.mean([e.speed_rpm for e, _ in told]))
    found = (
        metrics.rmse(true, middle), metrics.cumulative_relative_accuracy(true, middle),
        float(metrics.alpha_lambda(remaining, predicted, 0.5, ALPHA)),
        float(metrics.within_alpha(remaining, predicted, ALPHA).mean()),
        metrics.prognostic_horizon(true, middle, whole, ALPHA / 2), metrics.phm2012_score(true, middle),
        inside.share, inside.mean_width / float(np.mean(true)),
    )  # fmt: skip
    return {"rows": len(told), **dict(zip(MEASURED, found, strict=True))}


def table(runs: dict[tuple[int, str], dict[str, Any]]) -> pd.DataFrame:
    """A row per bench, bearing and method; width over the mean of what remained."""
    alone = {key: take(run) for key, run in runs.items()}
    rows = []
    for (seed, bearing), run in runs.items():
        others = [
            own.outcome(name) for (bench, name), own in alone.items() if bench == seed and name != bearing
        ]  # of the same bench: another is another machine
        prior = prior_from(others)
        about = {"bench": seed, "bearing": bearing}
        learnt = {what: getattr(prior, what) for what in LEARNT}
        for method, taken, told in (
            (ALONE, alone[seed, bearing], dict.fromkeys(LEARNT, 1.0)), (TOGETHER, take(run, prior), learnt),
        ):  # fmt: skip
            late = lateness(taken.alarm, run["time_s"], 60 * RUNS[bearing].onset_min)
            rows.append({**about, "method": method, **judge(taken), **late, **told})
    return pd.DataFrame(rows).assign(data=TITLE)


def means(every: pd.DataFrame) -> pd.DataFrame:
    """Mean over bearings, by bench and method; the least coverage, the first and the last alarms after the onset."""
    by = every.groupby(["bench", "method"], sort=False)
    columns = by[[*MEASURED, *LEARNT]].mean()
    onset, alarm = (by[what] for what in LATENESS)
    return columns.assign(
        least_coverage=by["coverage"].min(), latest_onset_percent=onset.max(), latest_alarm_percent=alarm.max(),
        earliest_onset_percent=onset.min(), earliest_alarm_percent=alarm.min(), bearings=by.size(), data=TITLE,
    ).reset_index()  # fmt: skip


STUDY = Study(
    name="rig_lives",
    title="remaining life of the virtual rig's runs",
    data=TITLE,
    options=jobs.Options,
    steps=(Step("runs", jobs.amplitudes, jobs.jobs, words=lambda job: f"bench {job.seed}, {job.bearing}"),),
    tables={
        "rig_lives": lambda work: table({(r.job.seed, r.job.bearing): r.value for r in work["runs"]}),
        "rig_lives_means": lambda work: means(work.tables["rig_lives"]),
    },
    headlines=("rig_lives", "rig_lives_means"),
)
