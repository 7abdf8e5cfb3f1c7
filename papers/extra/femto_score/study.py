"""Study of the challenge's score: by method and bearing, means, bounds, indicators, and its own test bearings."""

from typing import Any

import numpy as np
import pandas as pd

from papers.extra.femto.jobs import at_hand, files
from papers.extra.femto_score import jobs
from papers.framework import Rows, Step, Study, Work, as_table
from papers.paper1_rul_varying_speed.methods.metrics import phm2012_accuracy
from twingap.prognosis.outcomes import LOAD_EXPONENT

SCORES = ("score", "score_best_point", "score_band_known")
SNAPSHOT_S = 10.0
CONDITIONS = {"1": (1800.0, 4000.0), "2": (1650.0, 4200.0), "3": (1500.0, 5000.0)}
"""Speed, rpm, and load, N, by the first digit of a bearing's name."""


def scored(run: jobs.Run, cuts: list[int], value: dict[str, Any], band: tuple[float, float]) -> dict[str, Any]:
    """Scores of one prediction over the cuts of a run: as predicted, at the best point, with the band of cuts known."""
    law, point = np.asarray(value["quantiles"], float), np.asarray(value["point"], float)
    lived = np.array(cuts) * run.life / run.last
    left = run.life - lived
    best = np.array([jobs.best_point(lives) for lives in law])
    inside = [jobs.within(lives, u, band) for lives, u in zip(law, lived, strict=True)]
    told = np.array([jobs.best_point(lives) for lives in inside])
    each, found = phm2012_accuracy(left, point), {}
    for what, laws in (("", list(law)), ("_band_known", inside)):
        ends = np.array([np.quantile(q, (0.05, 0.95)) for q in laws])
        sure = not (law[:, -1] > law[:, 0]).any()
        found[f"covered{what}"] = np.nan if sure else np.mean((ends[:, 0] <= left) & (left <= ends[:, 1]))
        found[f"width{what}"] = np.nan if sure else np.median((ends[:, 1] - ends[:, 0]) / left)
    return {
        "score": each.mean(), "score_std": each.std(ddof=1), "score_best_point": phm2012_accuracy(left, best).mean(),
        "score_band_known": phm2012_accuracy(left, told).mean(), "no_number": float(np.mean(~np.isfinite(point))),
        **found,
    }  # fmt: skip


def by_bearing(work: Work) -> pd.DataFrame:
    """A row per method and bearing; means over seeds."""
    rows = [
        {"method": r.job.method, "bearing": r.job.bearing, "indicator": r.value["indicator"],
         **scored(work["runs"][r.job.bearing], work["cuts"][r.job.bearing], r.value, work.options.band)}
        for r in work["predict"]
    ]  # fmt: skip
    every = pd.DataFrame(rows)
    every["method"] = pd.Categorical(every["method"], jobs.METHODS)
    return every.groupby(["method", "bearing", "indicator"], observed=True, as_index=False).mean()


def means(every: pd.DataFrame) -> pd.DataFrame:
    """Means over bearings, and the standard deviation of the score between bearings."""
    grouped = every.drop(columns=["bearing", "indicator", "score_std"]).groupby("method", observed=True, sort=True)
    found = grouped.mean().reset_index()
    for column in SCORES:
        found[f"{column}_std"] = grouped[column].std(ddof=1).to_numpy()
    return found


def bounds(work: Work) -> pd.DataFrame:
    """What predictions that know more than they could would score: means over bearings and cuts."""
    runs, cuts, rng = work["runs"], work["cuts"], np.random.default_rng(work.seed)
    left = {n: (run.last - np.array(cuts[n])) * run.step_s for n, run in runs.items()}
    lived = {n: np.array(cuts[n]) * run.step_s for n, run in runs.items()}

    def mean(predict: Any) -> float:
        return float(np.mean([phm2012_accuracy(left[n], predict(n)).mean() for n in runs]))

    tried = np.arange(400.0, 30000.0, 100.0)
    rows = [
        {"prediction": "best constant remaining life (hindsight)",
         "score": max(mean(lambda n, v=v: np.full(left[n].size, v)) for v in tried)},
        {"prediction": "best constant life (hindsight)",
         "score": max(mean(lambda n, v=v: np.maximum(v - lived[n], 0)) for v in tried)},
        {"prediction": "best constant share of the life so far (hindsight)",
         "score": max(mean(lambda n, v=v: v * lived[n]) for v in np.linspace(0.02, 1, 99))},
    ]  # fmt: skip
    for std in (0.02, 0.05, 0.1, 0.2, 0.3):

        def known(name: str, std: float = std) -> Any:
            life = runs[name].life_s
            found = []
            for u in lived[name]:
                said = life * np.exp(std * rng.normal())
                drawn = said * np.exp(std * rng.normal(size=200))
                found.append(jobs.best_point(jobs.within(drawn - u, u, work.options.band)))
            return np.array(found)

        rows.append({"prediction": f"life known to {100 * std:g} %, band of cuts known", "score": mean(known)})
    logs = {n: np.log(run.life) for n, run in runs.items()}
    scaled = {n: logs[n] + LOAD_EXPONENT * np.log(run.load_n) for n, run in runs.items()}
    for what, values in (("log life", logs), ("log life at equal load", scaled)):
        std = float(np.std(list(values.values()), ddof=1))
        rows.append({"prediction": f"(standard deviation of {what} between runs)", "score": std})
    return pd.DataFrame(rows)


@as_table
def indicators(work: Work) -> Rows:
    """Whether indicators rise before the end: rank correlation with life over the band of cuts, and the first alarm."""
    from scipy.stats import spearmanr

    low, high = work.options.band
    for (name, indicator), value in work["grown"].items():
        series = work["runs"][name].indicators[:, jobs.INDICATORS.index(indicator)]
        part = np.log(series[int(low * len(series)) : int(high * len(series))])
        smooth = pd.Series(part).rolling(10).median().dropna().to_numpy()
        alarm = None if value["alarm"] is None else value["alarm"] / (len(series) - 1)
        yield {
            "bearing": name, "indicator": indicator,
            "rank_correlation": spearmanr(smooth, np.arange(smooth.size))[0],
            "rise": float(np.median(part[-len(part) // 10 :]) - np.median(part[: len(part) // 10])), "alarm_at": alarm,
        }  # fmt: skip


def lives(work: Work) -> pd.DataFrame:
    """Score of methods that need no vibration on all bearings of published life: by the protocol of the challenge, and
    of each of the seventeen from the sixteen others at twelve cuts in the band."""
    band, known = work.options.band, {}
    for name, (_, end) in work.options.test.items():
        rpm, load_n = CONDITIONS[name[len("Bearing")]]
        known[name] = (end * SNAPSHOT_S * rpm / 60, load_n)
    learning = {name: (run.life, run.load_n) for name, run in work["runs"].items()}
    every, twelve = learning | known, np.linspace(band[0], band[1], 12)
    asked: list[tuple[str, str, Any, dict[str, Any]]] = [
        ("challenge", name, [cut / end], learning) for name, (cut, end) in work.options.test.items()
    ]
    asked += [("each from 16 others", n, twelve, {m: v for m, v in every.items() if m != n}) for n in every]
    rows = []
    for protocol, name, cuts, others in asked:
        life, load_n = every[name]
        for method in (jobs.LIVES, jobs.UNLOADED, jobs.CONSTANT, jobs.SHARE):
            law = jobs.law_by(method, others.values(), load_n)
            for cut in cuts:
                lived, left = cut * life, (1 - cut) * life
                values = np.array(law.remaining(lived, jobs.SHARES))
                if method == jobs.SHARE:
                    values = np.full(len(jobs.SHARES), lived * jobs.best_share([(1 - at) / at for at in twelve]))
                said = [np.median(values), jobs.best_point(values), jobs.best_point(jobs.within(values, lived, band))]
                low, high = np.quantile(values, (0.05, 0.95))
                rows.append(
                    {"protocol": protocol, "method": method, "bearing": name, "covered": low <= left <= high,
                     **dict(zip(SCORES, phm2012_accuracy(np.full(3, left), np.array(said)), strict=True))}
                )  # fmt: skip
    by = ["protocol", "method"]
    return pd.DataFrame(rows).groupby([*by, "bearing"], sort=False).mean().groupby(by, sort=False).mean().reset_index()


STUDY = Study(
    name="femto_score",
    title="score of the PHM 2012 challenge on the FEMTO learning bearings",
    data="FEMTO",
    options=jobs.Options,
    at_hand=lambda root: at_hand(root, 6),
    steps=(
        Step("measure", jobs.measure, jobs.bearings, files),
        Step("runs", jobs.measured),
        Step("cuts", jobs.cuts_of),
        Step("follow", jobs.follow, jobs.growths, lambda work: {"runs": work.keyed("runs", "measure")}),
        Step("grown", lambda work: {(r.job.bearing, r.job.indicator): r.value for r in work["follow"]}),
        Step("predict", jobs.predict, jobs.predictions, jobs.of_growth),
    ),
    tables={
        "femto_score_bearings": by_bearing,
        "femto_score": lambda work: means(work.tables["femto_score_bearings"]),
        "femto_score_bounds": bounds,
        "femto_score_indicators": indicators,
        "femto_score_lives": lives,
    },
    headlines=("femto_score", "femto_score_bounds", "femto_score_lives"),
)
