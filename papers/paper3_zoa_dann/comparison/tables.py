"""Tables of the comparison, each made from the table of trials, so that the order of trials cannot matter.

``accuracy`` is that of the checkpoint chosen without target labels. ``oracle`` is that of the checkpoint that target
labels would have chosen, and stands in a column of its own since no method may claim it. ``strict`` counts windows of
bearings alone of which nothing was adapted to; the healthy bearing, of which there is one, is not among them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from papers.framework import Rows, Work, as_table
from papers.intervals import intervals, std
from papers.paper3_zoa_dann.comparison.jobs import Key, Options, TaskOutcome
from papers.paper3_zoa_dann.comparison.trial import ALL, ANALYST, OWN, noise_words
from papers.paper3_zoa_dann.inputs import options as frame
from papers.paper3_zoa_dann.significance import corrected, paired
from twingap.adapt import CRITERIA

ORDER: Final = ("balanced", "imbalanced", "scarce")
CLEAN: Final = noise_words(None)


def all_tables(work: Work) -> dict[str, pd.DataFrame]:
    return tables_of(work.options, frame.read_options(), work["outcomes"])


def metrics(work: Work) -> dict[str, float]:
    """Hours that all trials took, those from the store in the run that computed them; and how many there are."""
    seconds = [t.seconds for outcome in work["outcomes"] for t in outcome.trials]
    return {"comparison core hours": sum(seconds) / 3600, "comparison trials": len(seconds)}


def tables_of(options: Options, common: frame.Options, outcomes: Sequence[TaskOutcome]) -> dict[str, pd.DataFrame]:
    outcomes = sorted(outcomes, key=lambda outcome: outcome.task.name)
    runs, levels = trials(outcomes), common.judging.levels
    means = family_means(runs, options, levels)
    return {
        "comparison-trials": runs, "comparison-tasks": tasks(outcomes), "comparison-accuracy": by_task(runs, levels),
        "comparison-mean": means, "comparison-low-noise": at_noise(runs, options.low_noise_db, levels),
        "comparison-high-noise": at_noise(runs, options.high_noise_db, levels),
        "comparison-tests": tests(runs, options, levels), "comparison-selection": selection(runs),
        "comparison-published": published(means, options), "comparison-confusion": confusion(outcomes, options),
        "comparison-identification": identified(outcomes),
    }  # fmt: skip


def trials(outcomes: Sequence[TaskOutcome]) -> pd.DataFrame:
    """One row per trial, sorted; ``main`` is false for those that leave bearings out where their task does not."""
    rows = []
    for outcome in outcomes:
        for found in outcome.trials:
            job, value = found.job, found.value
            unseen = value["unseen"] or {}
            rows.append({
                "data": outcome.data, "family": outcome.task.family, "task": job.task, "available": job.available,
                "unseen": np.nan if job.unseen is None else job.unseen,
                "main": (job.unseen is None) == outcome.task.same_bearings, "noise": noise_words(job.snr_db),
                "snr_db": np.inf if job.snr_db is None else job.snr_db, "method": job.method, "seed": job.seed,
                "accuracy": value["accuracy"], "balanced": value["balanced_accuracy"],
                "oracle": value["oracle_accuracy"], "strict": unseen.get("accuracy", np.nan),
                "strict_oracle": unseen.get("oracle_accuracy", np.nan), "recordings_right": value["recordings_right"],
                "recordings": value["recordings"],
                "source_accuracy": np.nan if value["source_accuracy"] is None else value["source_accuracy"],
                **{f"by {name}": value["accuracy_by_criterion"].get(name, np.nan) for name in CRITERIA},
            })  # fmt: skip
    return _sorted(pd.DataFrame(rows))


def _sorted(runs: pd.DataFrame) -> pd.DataFrame:
    """In the order of tasks, states, noise (none first), methods, seeds; what is in no order comes last."""
    keys = runs.assign(main=~runs["main"], unseen=runs["unseen"].fillna(-1.0), snr_db=-runs["snr_db"])
    for name, order in (("available", ORDER), ("method", ALL)):
        keys[name] = keys[name].map({one: place for place, one in enumerate(order)}).fillna(len(order))
    by = ["task", "main", "available", "unseen", "snr_db", "method", "seed"]
    return runs.loc[keys.sort_values(by, kind="stable").index].reset_index(drop=True)


def _summary(values: Iterable[float], levels: Sequence[float]) -> dict[str, float]:
    """Mean, standard deviation, and Student's intervals over seeds, cut at 0 and 1."""
    held = [float(v) for v in values]
    return {"accuracy": float(np.mean(held)), "accuracy_std": std(held), **intervals(held, levels, 0.0, 1.0)}


@as_table
def by_task(runs: pd.DataFrame, levels: Sequence[float]) -> Rows:
    """Accuracy by task, state of the target data and method, no noise added; the strict column from its own trials."""
    clean = runs[runs["noise"] == CLEAN]
    for (data, task, available, method), own in clean.groupby(["data", "task", "available", "method"], sort=False):
        main = own[own["main"]]
        if main.empty:
            continue
        strict = own["strict"].dropna()
        yield {
            "data": data, "task": task, "available": available, "method": method, "seeds": len(main),
            **_summary(main["accuracy"], levels), "oracle": main["oracle"].mean(), "strict": strict.mean(),
            "strict_std": std(list(strict)), "strict_seeds": len(strict), "strict_oracle": own["strict_oracle"].mean(),
            "recordings_right": main["recordings_right"].mean(), "recordings": int(main["recordings"].iloc[0]),
            "source_accuracy": main["source_accuracy"].mean(),
        }  # fmt: skip


@as_table
def family_means(runs: pd.DataFrame, options: Options, levels: Sequence[float]) -> Rows:
    """Means over the tasks of a data set, by method and noise, of all states of the target data and of balanced data
    alone; intervals over seeds of the mean over tasks. ``lead`` is over the best of the rivals by the same accuracies,
    in points."""
    main = runs[runs["main"]]
    parts = [("all", main[main["noise"] == CLEAN]), ("balanced", main[main["available"] == "balanced"])]
    for available, part in parts:
        for (family, noise), own in part.groupby(["family", "noise"], sort=False):
            means = {m: _by_seed(own[own["method"] == m], "accuracy") for m in ALL}
            rivals = [means[m].mean() for m in options.rivals if len(means[m])]
            for method, values in means.items():
                if not len(values):
                    continue
                here = own[own["method"] == method]
                lead = 100 * (values.mean() - max(rivals)) if rivals and method not in options.rivals else np.nan
                yield {
                    "data": ", ".join(dict.fromkeys(here["data"])), "family": family, "available": available,
                    "noise": noise, "method": method, "tasks": here["task"].nunique(), "seeds": len(values),
                    **_summary(values, levels), "oracle": _by_seed(here, "oracle").mean(),
                    "strict": _strict(runs, str(family), str(noise), method), "lead": lead,
                }  # fmt: skip


def _by_seed(own: pd.DataFrame, column: str) -> pd.Series[Any]:
    """Mean over tasks and states of each seed; seeds that lack some are left out, since tasks differ in difficulty."""
    if own.empty:
        return pd.Series(dtype=float)
    table = own.assign(cell=own["task"] + ", " + own["available"]).pivot_table(
        index="seed", columns="cell", values=column
    )
    return table.dropna().mean(axis=1)


def _strict(runs: pd.DataFrame, family: str, noise: str, method: str) -> float:
    """Mean over tasks of the strict column, balanced data."""
    wanted = (runs["family"] == family) & (runs["noise"] == noise) & (runs["method"] == method)
    own = runs[wanted & (runs["available"] == "balanced")].dropna(subset="strict")
    return float(own.groupby("task")["strict"].mean().mean()) if len(own) else float("nan")


def at_noise(runs: pd.DataFrame, snr_db: float, levels: Sequence[float]) -> pd.DataFrame:
    """Accuracy by task and method at one noise level, balanced data; loss against the same seeds without noise."""
    rows = []
    main = runs[runs["main"] & (runs["available"] == "balanced")]
    for (data, task, method), own in main.groupby(["data", "task", "method"], sort=False):
        noisy = own[own["snr_db"] == snr_db].set_index("seed")
        if noisy.empty:
            continue
        quiet = own[own["noise"] == CLEAN].set_index("seed")["accuracy"].reindex(noisy.index)
        rows.append({
            "data": data, "task": task, "noise": noise_words(snr_db), "method": method, "seeds": len(noisy),
            **_summary(noisy["accuracy"], levels), "oracle": noisy["oracle"].mean(),
            "loss": 100 * (quiet - noisy["accuracy"]).mean(),
        })  # fmt: skip
    columns = ["data", "task", "noise", "method", "seeds", "accuracy", "accuracy_std", "oracle", "loss"]
    return pd.DataFrame(rows) if rows else pd.DataFrame(columns=columns)


@as_table
def tests(runs: pd.DataFrame, options: Options, levels: Sequence[float]) -> Rows:
    """Each reference against every other method: differences paired by task and seed (means over states), exact sign
    flips, Holm over the methods that one reference meets on one data set and noise level; interval over seeds of the
    mean over tasks."""
    main = runs[runs["main"]]
    for (family, noise), own in main.groupby(["family", "noise"], sort=False):
        pairs = own.pivot_table(index=["task", "seed"], columns="method", values="accuracy")
        for reference in options.references:
            if reference not in pairs:
                continue
            found = []
            for method in ALL:
                if method == reference or method not in pairs:
                    continue
                difference, columns = paired(pairs[reference], pairs[method], "lead")
                seeds = difference.unstack("task").dropna().mean(axis=1)
                found.append({
                    "data": ", ".join(dict.fromkeys(own["data"])), "family": family, "noise": noise,
                    "reference": reference, "method": method, **columns,
                    **intervals([100 * float(v) for v in seeds], levels, name="lead_"),
                })  # fmt: skip
            yield from corrected(found)


def selection(runs: pd.DataFrame) -> pd.DataFrame:
    """Accuracy by the label-free criterion that chose the checkpoint, mean over seeds; the oracle beside them."""
    names = [f"by {name}" for name in CRITERIA]
    own = runs[runs["main"] & runs[names].notna().any(axis=1)]
    table = own.groupby(["data", "task", "available", "noise", "method"], sort=False)[[*names, "oracle"]].mean()
    return table.reset_index().rename(columns={"oracle": "oracle (target labels)"})


@as_table
def published(means: pd.DataFrame, options: Options) -> Rows:
    """The paper's figures beside ours, per cent and points; the yardstick in a row of its own."""
    high = noise_words(options.high_noise_db)
    words = {OWN: "the project's own method", ANALYST: "the analyst's rule"}
    for family, theirs in sorted(options.published.items()):
        own = means[means["family"] == family]

        def ours(method: str, noise: str, column: str, own: pd.DataFrame = own) -> float:
            # With noise there is balanced data alone.
            available = "all" if noise == CLEAN else "balanced"
            which = (own["method"] == method) & (own["noise"] == noise) & (own["available"] == available)
            return float(own.loc[which, column].iloc[0]) if which.any() else float("nan")

        if own.empty:
            continue
        data = own["data"].iloc[0]
        for column, method, noise, paper in (
            ("accuracy", "Proposed", CLEAN, theirs.mean), ("accuracy", "Non-DA", CLEAN, np.nan),
            ("accuracy", "Non-DA, gap closed", CLEAN, np.nan), ("accuracy", "Proposed, gap closed", CLEAN, np.nan),
            ("accuracy", OWN, CLEAN, theirs.mean), ("lead", OWN, CLEAN, theirs.lead),
            ("accuracy", ANALYST, CLEAN, np.nan), ("lead", "Proposed", CLEAN, theirs.lead),
            ("accuracy", "Proposed", high, np.nan), ("accuracy", ANALYST, high, np.nan),
            ("lead", "Proposed", high, theirs.lead_high_noise), ("accuracy", OWN, high, np.nan),
            ("lead", OWN, high, theirs.lead_high_noise),
        ):  # fmt: skip
            of = f"{column} of {words.get(method, method)}{' over the best rival' if column == 'lead' else ''}"
            what = of if noise == CLEAN else f"{of}, {high}"
            scale = 1.0 if column == "lead" else 100.0
            row = {"data": data, "figure": what, "paper": paper, "ours": scale * ours(method, noise, column)}
            if column == "accuracy":
                row["ours, oracle"] = 100 * ours(method, noise, "oracle")
                row["ours, strict"] = 100 * ours(method, noise, "strict")
            yield row


@as_table
def confusion(outcomes: Sequence[TaskOutcome], options: Options) -> Rows:
    """Windows by true and called class, balanced data, summed over seeds: without noise and at the high level."""
    for outcome in outcomes:
        classes = outcome.task.classes
        for snr_db in (None, options.high_noise_db):
            for method in ALL:
                counts = confusion_counts(outcome, method, snr_db)
                if counts is None:
                    continue
                for true, line in zip(classes, counts, strict=True):
                    yield {
                        "data": outcome.data, "task": outcome.task.name, "noise": noise_words(snr_db),
                        "method": method, "true": true,
                        **{f"called {name}": int(n) for name, n in zip(classes, line, strict=True)},
                    }  # fmt: skip


def confusion_counts(outcome: TaskOutcome, method: str, snr_db: float | None) -> Any | None:
    """Counts [true, called] of one method, summed over seeds; None where nothing was run."""
    found = [
        t.value["confusion"]
        for t in outcome.trials
        if (t.job.method, t.job.available, t.job.snr_db) == (method, "balanced", snr_db)
        and (t.job.unseen is None) == outcome.task.same_bearings
    ]
    return np.sum(found, axis=0) if found else None


@as_table
def tasks(outcomes: Sequence[TaskOutcome]) -> Rows:
    """What each task adapts to and is judged on: recordings, bearings, windows by class."""
    for outcome in outcomes:
        for (available, unseen), own in sorted(outcome.materials.items(), key=_cell):
            counts = outcome.task.available[available]
            labels = own.evaluate.labels
            assert labels is not None
            judged = np.bincount(labels, minlength=len(outcome.task.classes))
            row: dict[str, Any] = {
                "data": outcome.data, "task": outcome.task.name, "title": outcome.task.title, "available": available,
                "unseen": np.nan if unseen is None else unseen,
                "recordings adapted to": len(set(own.adapt.group)), "bearings adapted to": len(own.adapted),
                "recordings judged": len(set(own.evaluate.group)), "bearings judged": len(set(own.bearing)),
                "majority": float(judged.max() / judged.sum()),
            }  # fmt: skip
            row |= {f"adapt {name}": counts[name] for name in outcome.task.classes}
            row |= {f"judge {name}": int(n) for name, n in zip(outcome.task.classes, judged, strict=True)}
            yield row


def identified(outcomes: Sequence[TaskOutcome]) -> pd.DataFrame:
    """What was identified from the unlabelled windows of each cell."""
    return pd.DataFrame([
        {
            "data": outcome.data, "task": outcome.task.name, "available": available,
            "unseen": np.nan if unseen is None else unseen, **values,
        }
        for outcome in outcomes
        for (available, unseen), values in sorted(outcome.identified.items(), key=_cell)
    ])  # fmt: skip


def _cell(item: tuple[Key, Any]) -> tuple[int, float]:
    """Place of a cell: states in their order, all bearings first."""
    (available, unseen), _ = item
    return ORDER.index(available) if available in ORDER else len(ORDER), -1.0 if unseen is None else unseen
