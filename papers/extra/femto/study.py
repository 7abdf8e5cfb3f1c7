"""Study of FEMTO's runs, and its tables: errors by method and bearing, and who is at least as good where."""

from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.extra.femto import jobs
from papers.figures import rule, subplots
from papers.framework import Rows, Step, Study, Work, as_table
from papers.paper1_rul_varying_speed.methods import metrics
from twingap.prognosis.outcomes import prior_from
from twingap.prognosis.prior import LEARNT


def pooled(bearing: str, runs: dict[str, jobs.Measured], alone: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """`predict` by growth alone of a bearing, pooled with what other runs say; weight and width of intervals are those
    that the other bearings choose among themselves."""
    run, found = runs[bearing], alone[bearing]
    others = [jobs.outcome(name, other, alone[name]) for name, other in runs.items() if name != bearing]
    prior = prior_from(others, run.load_n)
    turns, onset = jobs.revolutions(run), found["onset"]
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
    told = {"low": columns[:, 0], "predicted": columns[:, 1], "high": columns[:, 2]}
    return found | told | {what: getattr(prior, what) for what in LEARNT}


def judge(run: jobs.Measured, found: dict[str, Any]) -> dict[str, float]:
    """All metrics of one prediction: after the alarm, and at the challenge's cuts."""
    # The owner ended the run at the last snapshot.
    true, predicted = run.time_s[-1] - run.time_s, np.asarray(found["predicted"], float)
    low, high = np.asarray(found["low"], float), np.asarray(found["high"], float)
    after = slice(found["alarm"], true.size - 1) if found["alarm"] is not None else slice(0, 0)
    t, p = true[after], predicted[after]
    cuts = [round(share * (true.size - 1)) for share in jobs.CUTS]
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


def table(work: Work) -> pd.DataFrame:
    """A row per bearing and method; of several seeds, the mean, and how far their RMSE scatters."""
    runs, found = work["runs"], [(r.job, r.value) for r in work["predictions"]]
    alone = {job.bearing: value for job, value in found if job.method == jobs.ALONE}
    found += [(jobs.Prediction(name, jobs.POOLED, 0), pooled(name, runs, alone)) for name in runs]
    every = pd.DataFrame(
        {"bearing": job.bearing, "method": job.method, "alarm_row": value["alarm"], "passed": value["passed"],
         **{what: value.get(what, np.nan) for what in LEARNT}, **judge(runs[job.bearing], value)}
        for job, value in found
    )  # fmt: skip
    every["bearing"] = pd.Categorical(every["bearing"], list(runs))
    every["method"] = pd.Categorical(every["method"], jobs.METHODS)
    grouped = every.groupby(["bearing", "method"], sort=True, observed=True, as_index=False)
    return grouped.mean().assign(seeds=grouped.size()["size"], rmse_std_s=grouped["rmse_s"].std(ddof=1)["rmse_s"])


@as_table
def wins(every: pd.DataFrame) -> Rows:
    """Bearings on which the estimator is at least as good as rivals, per metric: as the best of each bearing
    (hindsight), as the one that is best on average, and as each rival throughout."""
    higher = (
        "relative_accuracy", "alpha_lambda_half", "within_20", "horizon_s", "phm2012_after_alarm", "phm2012_at_cuts",
    )  # fmt: skip
    plain = every.astype({"bearing": str, "method": str})
    for metric in ("rmse_s", *higher):
        values = plain.pivot(index="bearing", columns="method", values=metric)
        sign, best = (1, "max") if metric in higher else (-1, "min")
        rivals = values[list(jobs.RIVALS)]
        chosen = str((sign * rivals.mean()).idxmax())
        against = {
            "best of each bearing": rivals.agg(best, axis=1), f"best on average: {chosen}": rivals[chosen],
            **{name: rivals[name] for name in jobs.RIVALS},
        }  # fmt: skip
        for method in (jobs.POOLED, jobs.ALONE):
            for name, rival in against.items():
                good = sign * values[method] >= sign * rival
                yield {
                    "metric": metric, "method": method, "against": name, "bearings_won": int(good.sum()),
                    "of": len(good), "which": " ".join(good.index[good]),
                }  # fmt: skip


STYLES: Final = {
    "twingap rul --prior": ("#0072B2", "o"),
    "twingap rul": ("#56B4E9", "s"),
    "exponential": ("#E69F00", "^"),
    "particle filter": ("#CC79A7", "D"),
    "random forest": ("#009E73", "v"),
}
"""Method -> colour and marker, which tells them apart without colours."""


def errors(every: pd.DataFrame) -> Figure:
    """RMSE after the alarm of each method on each bearing."""
    figure, axes = subplots((9.5, 4.4))
    bearings = list(dict.fromkeys(every["bearing"]))
    for place, (method, (colour, marker)) in enumerate(STYLES.items()):
        own = every[every["method"] == method].set_index("bearing")["rmse_s"].reindex(bearings)
        x = [i + 0.13 * (place - 2) for i in range(len(bearings))]
        axes.plot(x, own / 60, marker, color=colour, markersize=8, label=method)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xticks(range(len(bearings)), bearings)
    axes.set_ylabel("RMSE of remaining time\nafter the alarm (min)")
    axes.set_title("FEMTO learning bearings (runs used in development)")
    rule(axes, "y")
    figure.legend(loc="outside lower center", ncols=5)
    return figure


STUDY = Study(
    name="femto",
    title="remaining life of the FEMTO learning bearings",
    data="FEMTO",
    options=jobs.Options,
    at_hand=jobs.at_hand,
    steps=(
        Step("features", jobs.take_features, jobs.bearings, jobs.files),
        Step("runs", lambda work: {r.job.bearing: jobs.Measured(**r.value) for r in work["features"]}),
        Step("predictions", jobs.predict, jobs.predictions, lambda work: {"runs": work.keyed("runs", "features")}),
    ),
    tables={"femto": table, "femto_wins": lambda work: wins(work.tables["femto"])},
    figures={"femto": lambda work: errors(work.tables["femto"])},
    letters=(12, 10),
    headlines=("femto", "femto_wins"),
)
