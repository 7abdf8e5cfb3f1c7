"""Tables of the degradation study."""

import itertools
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from papers.arrays import Array
from papers.framework import Rows, Work, as_table
from papers.paper2_digital_twin.degradation.candidates import Judged
from twingap.prognosis.degradation_models import MODELS
from twingap.prognosis.health_indicator import evaluate_candidates, offline_indicators, online_indicators
from twingap.prognosis.indicator_criteria import causal_trend

COMBINED = ("combined power 3", "combined power 5")
EXPONENTIALS = ("exponential", "exponential with offset")
MEASURED = ("monotonicity", "trendability", "robustness", "suitability", "sensitivity")
SCALINGS: Final[tuple[Literal["z", "range"], ...]] = ("z", "range")
ORDERS: Final[tuple[Literal["descending", "ascending"], ...]] = ("descending", "ascending")


def shown(work: Work) -> Judged:
    """The run of the paper's figures, or the first where it is not at hand."""
    found: list[Judged] = work["judged"]
    return next((j for j in found if j.run.name == work.options.paper_run), found[0])


@as_table
def runs(work: Work) -> Rows:
    """What was run on."""
    for j in work["judged"]:
        yield {
            "run": j.run.name, "source": j.run.source, "records": j.run.run.time_s.size,
            "silent": j.run.whole.time_s.size - j.run.run.time_s.size,
            "life h": float(j.run.run.time_s[-1]) / 3600, "healthy records": j.run.healthy_rows,
            "features": len(j.run.run.names), "stand-ins": ", ".join(j.run.stand_ins) or "none",
            "fusion features": sum(name.startswith("fusion ") for name in j.online.values),
        }  # fmt: skip


@as_table
def fusion9(work: Work) -> Rows:
    """Fusion feature 9 among the fusion features under each reading of how they are made; rank 1 is best. ``later
    better`` compares the mean sensitivity of 9 and on with that of 1 to 8."""
    for j in work["judged"]:
        r = j.run
        parts = [("left out", r.run)]
        if r.whole.time_s.size > r.run.time_s.size:
            parts.append(("kept", r.whole))
        readings = itertools.product(parts, ("whole run", "healthy start"), SCALINGS, ORDERS)
        for (silent, run), learnt, scaling, order in readings:
            if learnt == "whole run":
                made = offline_indicators(run, scaling=scaling, order=order)
            else:
                made = online_indicators(run, r.healthy_rows, scaling=scaling, order=order)
            yield {
                "run": r.name, "silent records": silent, "learnt from": learnt, "scaling": scaling, "order": order,
                **_nine(made, run.time_s, r.healthy_rows, r.trend_rows),
            }  # fmt: skip


def _nine(made: Any, time_s: Array, healthy_rows: int, trend_rows: int) -> dict[str, Any]:
    criteria = evaluate_candidates(made, time_s, healthy_rows=healthy_rows, window=trend_rows)
    fused = {name: c for name, c in criteria.items() if name.startswith("fusion ")}
    names = list(fused)
    out: dict[str, Any] = {"fusion features": len(names)}
    if "fusion 9" not in fused:
        return out
    share, at = made.fusion.variance / made.fusion.variance.sum(), names.index("fusion 9")
    out["variance share"] = float(share[at])
    sensitivity = np.array([c.sensitivity for c in fused.values()])
    for what in ("sensitivity", "suitability", "monotonicity", "trendability"):
        values = np.array([getattr(c, what) for c in fused.values()])
        out[f"{what} of 9"] = values[at]
        out[f"{what} rank"] = int((values > values[at]).sum()) + 1
        out[f"{what} best"] = names[int(values.argmax())]
    # Figure 16 of the paper compares 9 with 10 to 15 alone.
    out["sensitivity rank among 9 on"] = int((sensitivity[8:] > sensitivity[8]).sum()) + 1
    out["sensitivity 9 on"] = float(sensitivity[8:].mean())
    out["sensitivity 1 to 8"] = float(sensitivity[:8].mean())
    out["later better"] = bool(sensitivity[8:].mean() > sensitivity[:8].mean())
    out["number and sensitivity"] = float(spearmanr(np.arange(len(names)), sensitivity).statistic)
    return out


@as_table
def choice(work: Work) -> Rows:
    """The indicator chosen on other runs, beside the run's own best, RMS and fusion feature 9."""
    for j in work["judged"]:
        best = max(j.criteria, key=lambda name: j.criteria[name].suitability)
        for role, name in (("chosen on other runs", j.choice), ("best of this run", best), ("rms", "rms"),
                           ("fusion 9, healthy start", "fusion 9")):  # fmt: skip
            if name is None or name not in j.criteria:
                yield {"run": j.run.name, "role": role, "candidate": "there is none"}
                continue
            measured = {what: getattr(j.criteria[name], what) for what in MEASURED}
            yield {"run": j.run.name, "role": role, "candidate": name, **measured}


@as_table
def fits(work: Work) -> Rows:
    """Fits to whole runs: errors, and information criteria as differences to the best model of the indicator."""
    for job, values in ((r.job, r.value) for r in work["analyses"]):
        least = {name: min(v[name] for v in values.values()) for name in ("aicc", "bic", "aicc ar1", "bic ar1")}
        for model, v in values.items():
            yield {
                "run": job.run, "indicator": job.indicator, "model": model, "formula": MODELS[model].formula,
                "parameters": MODELS[model].parameters, "R2": v["r2"], "rmse": v["rmse"],
                "median |residual|": v["mae"], "robust: median |residual|": v["robust mae"],
                **{f"{name} above best": v[name] - least[name] for name in least},
                "residual memory": v["memory"], "memory refitted": v["memory ar1"],
                "exponents": ", ".join(f"{e:.3g}" for e in v["exponents"]), "at a bound": v["at bound"],
            }  # fmt: skip


@as_table
def error_rows(work: Work) -> Rows:
    """Errors on records after each tenth of life, also over the range that the indicator's trend runs through."""
    ranges = {
        (j.run.name, name): float(np.ptp(causal_trend(x, j.run.trend_rows)))
        for j in work["judged"] for name, x in j.series.items()
    }  # fmt: skip
    for job, values in ((r.job, r.value) for r in work["analyses"]):
        reach = ranges[job.run, job.indicator]
        for model, v in values.items():
            for fit, key in (("squares", "errors"), ("robust", "robust errors")):
                for share, rest, following, n in v[key]:
                    yield {
                        "run": job.run, "indicator": job.indicator, "model": model, "fit": fit, "share of life": share,
                        "records": n, "rmse rest": rest, "rmse next tenth": following,
                        "rest / range": rest / reach, "next / range": following / reach,
                    }  # fmt: skip


def error_summary(work: Work) -> pd.DataFrame:
    """Medians over tenths; the mean would be that of the one tenth whose extrapolation explodes."""
    keys = ["run", "indicator", "model", "fit"]
    grouped = work.tables["degradation-errors"].groupby(keys, sort=False)[["rest / range", "next / range"]]
    return grouped.median().add_suffix(", median").join(grouped.max().add_suffix(", worst")).reset_index()


@as_table
def pairs(work: Work) -> Rows:
    """Combined power against exponential, model by model; below 1 the combined power's error is lower."""
    errors = work.tables["degradation-errors"]
    for (run, indicator, fit), here in errors.groupby(["run", "indicator", "fit"], sort=False):
        for combined, exponential in itertools.product(COMBINED, EXPONENTIALS):
            row: dict[str, Any] = {
                "run": run, "indicator": indicator, "fit": fit, "combined": combined, "exponential": exponential,
            }  # fmt: skip
            for what in ("rest", "next"):
                wide = here.pivot(index="share of life", columns="model", values=f"{what} / range")
                common = wide.reindex(columns=[combined, exponential]).dropna()
                one, other = common[combined], common[exponential]
                row[f"{what}: combined median"] = one.median()
                row[f"{what}: exponential median"] = other.median()
                row[f"{what}: ratio of medians"] = one.median() / other.median()
                row[f"{what}: tenths lower"] = f"{int((one < other).sum())} of {len(common)}"
            yield row


@as_table
def out_of_sample(work: Work) -> Rows:
    """The claim under every reading: each of two combined powers against each of two exponentials, both errors, plain
    and robust fits, every indicator. ``holds``: lower on the paper's run and on at least four FEMTO runs."""
    keys, paper_run = ["indicator", "fit", "combined", "exponential"], shown(work).run.name
    for names, here in work.tables["degradation-pairs"].groupby(keys, sort=False):
        for what, words in (("rest", "all later records"), ("next", "next tenth")):
            ratio = here.set_index("run")[f"{what}: ratio of medians"].astype(float)
            femto = ratio[[r for r in ratio.index if str(r).startswith("FEMTO")]]
            own = float(ratio.get(paper_run, np.nan))
            lower = int((femto < 1).sum())
            yield {
                **dict(zip(keys, names, strict=True)), "error on": words, f"ratio on {paper_run}": own,
                "FEMTO runs lower": lower, "FEMTO runs": len(femto), "FEMTO median ratio": femto.median(),
                "all runs lower": int((ratio < 1).sum()), "runs": len(ratio), "holds": own < 1 and lower >= 4,
            }  # fmt: skip


@as_table
def criteria_summary(work: Work) -> Rows:
    """In how many runs each model is the best by each criterion, and the better combined power beats the better
    exponential."""
    for indicator, here in work.tables["degradation-fits"].groupby("indicator", sort=False):
        for name in ("aicc", "bic", "aicc ar1", "bic ar1"):
            table = here.pivot_table(index="run", columns="model", values=f"{name} above best", sort=False)
            table = table[[m for m in MODELS if m in table]]
            combined, exponential = table[list(COMBINED)].min(axis=1), table[list(EXPONENTIALS)].min(axis=1)
            best = table.idxmin(axis=1)
            yield {
                "indicator": indicator, "criterion": name, "runs": len(table),
                "combined below exponential": int((combined < exponential).sum()),
                "three parameters: combined below exponential": int(
                    (table["combined power 3"] < table["exponential with offset"]).sum()),
                **{f"best: {m}": int((best == m).sum()) for m in MODELS},
            }  # fmt: skip


@as_table
def life_rows(work: Work) -> Rows:
    """Remaining life that each model would have predicted at each tenth, as shares of the whole life."""
    hours = {j.run.name: float(j.run.run.time_s[-1]) / 3600 for j in work["judged"]}
    for job, values in ((r.job, r.value) for r in work["analyses"]):
        for model, v in values.items():
            for source, found in v["lives"].items():
                for share, true, life, low, high, never in found:
                    reached = life is not None
                    inside = (low is not None and low <= true) and (high is None or true <= high)
                    yield {
                        "run": job.run, "indicator": job.indicator, "model": model, "limit": source,
                        "share of life": share, "true": true, "predicted": life, "low": low, "high": high,
                        "true h": true * hours[job.run], "predicted h": life * hours[job.run] if reached else None,
                        "reached": reached, "inside": inside, "bounded": high is not None, "curves never": never,
                    }  # fmt: skip


@as_table
def life_summary(work: Work) -> Rows:
    """Over runs and tenths: how far off, how often there is an answer at all, how often the interval holds."""
    keys = ["indicator", "limit", "model"]
    for (indicator, limit, model), here in work.tables["degradation-lives"].groupby(keys, sort=False):
        off = (here["predicted"].astype(float) - here["true"]).abs().fillna(np.inf)
        late = here["share of life"] >= 0.7 - 1e-9
        yield {
            "indicator": indicator, "limit": limit, "model": model, "predictions": len(here),
            "median error / life": _or_none(off.median()),
            "median error / life, from 0.7 on": _or_none(off[late].median()),
            "within 20 % of life": (off <= 0.2).mean(), "no end foreseen": 1 - here["reached"].mean(),
            "interval holds": here["inside"].mean(), "interval bounded": here["bounded"].mean(),
            "too late by more than 20 % or never": ((here["predicted"].astype(float).fillna(np.inf) - here["true"])
                                                     > 0.2).mean(),
        }  # fmt: skip


@as_table
def coverage(work: Work) -> Rows:
    """How often intervals of remaining life hold on simulated runs, with the right model and with a wrong one."""
    for r in work["coverage"]:
        yield {
            "made with": r.job.truth, "fitted": r.job.model, "memory of noise": r.job.memory,
            "share of life": r.job.share, "runs": r.job.runs, "stated": r.job.level, "holds": r.value["inside"],
            "interval bounded": r.value["bounded"], "median width / life": _or_none(r.value["width"], 1e3),
            "median error / life": _or_none(r.value["error"], 1e3), "data": "simulated",
        }  # fmt: skip


@as_table
def known_law(work: Work) -> Rows:
    """In which share of simulated runs of known law the claim's first model is preferred to its second."""
    for r in work["known law"]:
        yield {
            "made with": r.job.truth, "memory of noise": r.job.memory, "runs": r.job.runs,
            "preferred": r.job.pair[0], "to": r.job.pair[1], "by BIC with AR(1) residuals": r.value["criterion"],
            "by error on all later records": r.value["error"], "ratio of median errors": r.value["ratio"],
            "data": "simulated",
        }  # fmt: skip


def claims(work: Work) -> pd.DataFrame:
    """The paper's statements and the issue's, beside what was found. Verdicts follow from the numbers in the row."""
    options, own_run, tables = work.options, shown(work).run.name, work.tables
    primary, rival = options.primary
    found, nine, pair = tables["degradation-fits"], tables["degradation-fusion9"], tables["degradation-pairs"]
    rows: list[dict[str, Any]] = []

    def claim(statement: str, where: str, found: str, holds: bool) -> None:
        verdict = "confirmed" if holds else "not confirmed"
        rows.append({"claim": statement, "where": where, "found": found, "verdict": verdict})

    models = (*EXPONENTIALS, *COMBINED)
    for name in shown(work).series:
        here = found[(found["run"] == own_run) & (found["indicator"] == name)].set_index("model")
        r2, delta = here["R2"], here["bic ar1 above best"]
        # Poor and satisfactory are no numbers: a half and nine tenths of the variance are this study's.
        satisfactory = max(r2[list(EXPONENTIALS)]) < 0.5 and max(r2[list(COMBINED)]) >= 0.9
        claim(
            "the exponential fit is poor, the combined power fit is satisfactory",
            f"{own_run}, {name}, R2 of whole run", "; ".join(f"{m} {r2[m]:.3f}" for m in models), satisfactory,
        )  # fmt: skip
        claim(
            "combined power is preferred to exponential", f"{own_run}, {name}, BIC with AR(1) residuals",
            "; ".join(f"{m} +{delta[m]:.1f}" for m in models),
            min(delta[list(COMBINED)]) < min(delta[list(EXPONENTIALS)]),
        )  # fmt: skip
    for row in tables["degradation-criteria"].to_dict("records"):
        if row["criterion"] == "bic ar1" and row["runs"] > 1:
            better = row["combined below exponential"]
            claim(
                "combined power is preferred to exponential", f"all runs, {row['indicator']}, BIC with AR(1) residuals",
                f"in {better} of {row['runs']} runs", better > row["runs"] / 2,
            )  # fmt: skip
    for family in dict.fromkeys(j.run.family for j in work["judged"]):
        there = {j.run.name for j in work["judged"] if j.run.family == family}
        # Where no run has nine features, the table lacks these columns.
        ranked = ("sensitivity rank", "sensitivity rank among 9 on", "variance share", "later better")
        part = nine[nine["run"].isin(there)].reindex(columns=[*dict.fromkeys((*nine.columns, *ranked))])
        part = part[part["sensitivity rank"].notna()]
        count, several = len(part), f"{family}, all readings of all runs that have nine"
        rank = f", median rank {part['sensitivity rank'].median():.0f}" if count else ""
        for among, column, median in (("", ranked[0], rank), (" of 9 to 15", ranked[1], "")):
            first = int((part[column] == 1).sum())
            said = f"first in {first} of {count} readings{median}"
            claim(f"fusion feature 9 is the most sensitive{among}", several, said, 0 < count == first)
        for learnt in ("whole run", "healthy start"):
            own = part[(part["learnt from"] == learnt) & (part["order"] == "descending")]
            share, better = own["variance share"].mean(), int(own["later better"].sum())
            claim(
                "fusion features 9 to 15 are those of low variance, and the better ones",
                f"{family}, {learnt}, ordered by falling variance",
                f"9 has {100 * share:.2g} % of the variance; 9 to 15 more sensitive in "
                f"{better} of {len(own)} readings", 0 < len(own) == better,
            )  # fmt: skip
        later = int(part["later better"].sum())
        claim(
            "fusion features 9 to 15 outperform 1 to 8", f"{family}, mean sensitivity, all readings",
            f"in {later} of {count} readings", 0 < count == later,
        )  # fmt: skip
    for name in dict.fromkeys(pair["indicator"]):
        here = pair[(pair["indicator"] == name) & (pair["fit"] == "squares")]
        here = here[(here["combined"] == primary) & (here["exponential"] == rival)].set_index("run")
        ratio = here[f"{options.error}: ratio of medians"].astype(float)
        femto = ratio[[r for r in ratio.index if r.startswith("FEMTO")]]
        own = ratio.get(own_run)
        lower = int((femto < 1).sum())
        claim(
            f"out-of-sample error of {primary} below {rival} on {own_run} and at least 4 of 6 FEMTO runs",
            f"{name}, ratio of median errors on {'all later records' if options.error == 'rest' else 'the next tenth'}",
            f"{own_run} {'no such indicator' if own is None else f'{own:.3f}'}; {lower} of {len(femto)} FEMTO runs",
            own is not None and own < 1 and lower >= 4,
        )  # fmt: skip
    # The same comparison where the law is known: it should prefer the true model in nine runs of ten.
    for truth, right in ((primary, True), (rival, False)):
        for row in tables["degradation-known-law"].to_dict("records"):
            if row["made with"] != truth:
                continue
            shares = [row["by BIC with AR(1) residuals"], row["by error on all later records"]]
            claim(
                f"{primary} is {'' if right else 'not '}preferred to {rival} where runs are made with {truth}",
                f"simulated, memory of noise {row['memory of noise']:g}, {row['runs']} runs",
                f"preferred by BIC with AR(1) residuals in {shares[0]:.0%}, by error on all later records in "
                f"{shares[1]:.0%}", all((share if right else 1 - share) >= 0.9 for share in shares),
            )  # fmt: skip
    return pd.DataFrame(rows)


def _or_none(value: float, most: float = np.inf) -> float | None:
    return float(value) if np.isfinite(value) and value < most else None
