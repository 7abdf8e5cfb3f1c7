"""Tables of the availability study."""

import itertools
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import pandas as pd

from papers.framework import Rows, Work, as_table
from papers.paper2_digital_twin.availability.records import ALL, SPLITS, TITLES, Measured
from papers.paper2_digital_twin.methods.choose import Thresholds, choose
from twingap.adapt.evaluate import t_interval

METHODS: Final = ("twin network", "SVM", "SOM-MQE")
LEVEL: Final = 0.95
LEVELS: Final = ("mqe low", "mqe", "mqe high")  # of a recording's windows: their median and middle 80 %
MANY: Final = 10**6  # stands for all the labels that there are
AHEAD: Final = (("SVM", "twin network"), ("SOM-MQE", "twin network"), ("SOM-MQE", "SVM"))


def calls(work: Work) -> pd.DataFrame:
    """One row for each recording, method, number of labels, split and seed: what it was called, and what it is."""
    found = [
        (n.job, {split: {METHODS[0]: n.value[split]["rows"]} for split in SPLITS})
        for n in work["networks"] if n.job.kind == "grafted"
    ]  # fmt: skip
    found += [(r.job, r.value) for r in work["shallows"]]
    return pd.DataFrame([
        {
            "data": job.data, "split": split, "method": method, "records": int(count), "labels": row["labels"],
            "seed": job.seed, "recording": recording, "class": work["data"][job.data].labels[recording],
            "called": label,
        }
        for job, by_split in found
        for split in SPLITS
        for method, by_count in by_split[split].items()
        for count, row in by_count.items()
        for recording, label in row["calls"].items()
    ])  # fmt: skip


def by_seed(work: Work) -> pd.DataFrame:
    """Share of recordings called right, and its mean over classes, for each seed."""
    keys = ["data", "split", "method", "records", "seed"]
    called: pd.DataFrame = work["calls"]
    right = called.assign(right=called["class"] == called["called"])
    found = right.groupby(keys, sort=False).agg(
        labels=("labels", "min"), recordings=("right", "size"), accuracy=("right", "mean")
    )
    by_class = right.groupby([*keys, "class"])["right"].mean()
    return found.assign(balanced=by_class.groupby(keys).mean()).reset_index()


@as_table
def accuracy(work: Work) -> Rows:
    """Mean over seeds, by recording judged; `labels` is how many records of the scarcest fault there were indeed."""
    keys = ["data", "split", "method", "records"]
    for (data, split, method, records), part in by_seed(work).groupby(keys, sort=False):
        low, high = t_interval(list(part["accuracy"]), LEVEL)
        yield {
            "data": TITLES[str(data)], "split by": split, "method": method,
            "records a fault": "all" if records == ALL else str(records), "at hand": part["labels"].min(),
            "recordings": part["recordings"].max(), "seeds": len(part), "accuracy": part["accuracy"].mean(),
            "std": part["accuracy"].std(), "low": max(low, 0.0), "high": min(high, 1.0),
            "balanced accuracy": part["balanced"].mean(),
        }  # fmt: skip


@as_table
def crossings(work: Work) -> Rows:
    """From how many records on one method is at least as good as another in the mean over seeds (empty if it is lower
    with all), and ``better from``: with the 95 % interval of the paired difference above 0."""
    found = by_seed(work)
    for (data, split, about), (first, second) in itertools.product(_parts(work), AHEAD):
        here = found[(found["data"] == data.name) & (found["split"] == split)]
        wide = {
            m: here[here["method"] == m].pivot(index="seed", columns="records", values="accuracy")
            for m in (first, second)
        }
        steps = [c for c in (*work.options.counts, ALL) if c in wide[first] and c in wide[second]]
        gains = {c: (wide[first][c] - wide[second][c]).dropna().to_numpy(dtype=float) for c in steps}
        good = [c for i, c in enumerate(steps) if all(gains[later].mean() >= -1e-12 for later in steps[i:])]
        sure = [c for i, c in enumerate(steps) if all(_above(gains[later]) for later in steps[i:])]
        yield {
            **about, "method": first, "against": second,
            "at least as good from": _named(good), "better from": _named(sure),
            **{f"gain at {_named([c])}, points": 100 * gains[c].mean() for c in steps},
        }  # fmt: skip


@as_table
def choices(work: Work) -> Rows:
    """What `choose` says at each number of labels, with the thresholds measured here (better by more than luck)."""
    for name, data in work["data"].items():
        windows = max(a.value["healthy windows"] for a in work["alarms"] if a.job.data == name and not a.job.without)
        for split in SPLITS:
            limits = Thresholds(1, *(_sure_from(work, data, split, method) for method in METHODS[1:]))
            for count in (0, *work.options.counts, MANY):
                made = choose(count, windows, false_alarm=work.options.false_alarm, thresholds=limits)
                yield {
                    "data": TITLES[name], "labels of": "any recording" if split == SPLITS[0] else "other bearings",
                    "records a fault": "all" if count == MANY else str(count), "chosen": made.approach,
                    "alarm": made.alarm, "why": made.why.replace(str(MANY), "all"),
                }  # fmt: skip


def _sure_from(work: Work, data: Measured, split: str, method: str) -> int | None:
    """Number of labelled records from which a method is better than the network by more than luck."""
    crossed = work.tables["availability-crossings"]
    at = (crossed["data"] == TITLES[data.name]) & (crossed["split by"] == split)
    (found,) = crossed[at & (crossed["method"] == method) & (crossed["against"] == METHODS[0])]["better from"]
    return None if found == "" else MANY if found == "all" else int(found)


@as_table
def head(work: Work) -> Rows:
    """What labelled records change and what the network is still good for: the head with it and without."""
    for data, split, about in _parts(work):
        nets = [value[split]["rows"] for value in _nets(work, data)]
        for count in (*work.options.counts, ALL):
            own = [rows_of[str(count)] for rows_of in nets]
            yield {
                **about, "records a fault": _named([count]),
                "network and head": _right(data, [r["calls"] for r in own]),
                "head alone": _right(data, [r["without network"] for r in own]),
                "network alone": _right(data, [rows_of["0"]["calls"] for rows_of in nets]),
            }  # fmt: skip


@as_table
def selection(work: Work) -> Rows:
    """The network without a label: what other label-free criteria would have chosen, and the oracle."""
    for data, split, about in _parts(work):
        nets = [value[split] for value in _nets(work, data)]
        best = [max(n["checkpoints"], key=lambda called: _right(data, [called])) for n in nets]
        yield {
            **about, "chosen by": work.options.criterion,
            **{c: _right(data, [n["by criterion"][c] for n in nets]) for c in nets[0]["by criterion"]},
            "last checkpoint": _right(data, [n["checkpoints"][-1] for n in nets]), "oracle": _right(data, best),
        }  # fmt: skip


@as_table
def sources(work: Work) -> Rows:
    """What the named effects and the measured background are worth: the network without a label, by its source."""
    for name, data in work["data"].items():
        for kind in dict.fromkeys(n.job.kind for n in work["networks"]):
            seeds = {n.job.seed for n in work["networks"] if (n.job.data, n.job.kind) == (name, kind)}
            nets = [value[SPLITS[0]] for value in _nets(work, data, kind)]
            yield {
                "data": TITLES[name], "source": kind, "seeds": len(seeds),
                "accuracy": _right(data, [n["rows"]["0"]["calls"] for n in nets]),
                "on its own machines held out": np.mean([max(n["scores"]["source_accuracy"]) for n in nets]),
                "infomax": np.mean([max(n["scores"]["infomax"]) for n in nets]),
            }  # fmt: skip


@as_table
def recordings(work: Work) -> Rows:
    """Every recording: what the network without a label calls it, in how many of the seeds it is right."""
    called = work["calls"]
    zero = called[(called["records"] == 0) & (called["split"] == SPLITS[0])]
    for (name, recording), part in zero.groupby(["data", "recording"], sort=False):
        data = work["data"][str(name)]
        names = [data.classes[c] for c in part["called"]]
        yield {
            "data": TITLES[data.name], "recording": recording, "bearing": data.bearings[str(recording)],
            "speed, rpm": data.speeds_rpm[str(recording)], "class": data.classes[data.labels[str(recording)]],
            "seeds": len(part), "right": int((part["called"] == part["class"]).sum()),
            "called": max(set(names), key=names.count),
        }  # fmt: skip


def watched(work: Work) -> pd.DataFrame:
    """A row per map, seed and recording: what the healthy map says of its windows."""
    found = pd.DataFrame(
        {
            "set": data.name, "data": TITLES[data.name], "without": a.job.without, "seed": a.job.seed, "recording": r,
            "label": data.labels[r], "class": data.classes[data.labels[r]], "bearing": data.bearings[r],
            "size": data.sizes[r], "speed, rpm": data.speeds_rpm[r], **value, "threshold": a.value["threshold"],
            "healthy windows": a.value["healthy windows"], "held out": np.mean(list(a.value["held out"].values())),
        }
        for a in work["alarms"]
        for data in [work["data"][a.job.data]]
        for r, value in a.value["recordings"].items()
    )  # fmt: skip
    return found.assign(**{f"{level} over": found[level] / found["threshold"] for level in LEVELS})


def unseen(work: Work) -> pd.DataFrame:
    """Means over seeds by recording, of maps that have not seen it: of a healthy one, the map of the others."""
    found = watched(work)
    found = found[found["without"] == found["recording"].where(found["class"] == "healthy", "")]
    about = ["set", "data", "label", "class", "bearing", "size", "speed, rpm", "recording"]
    measured = [*LEVELS, "share", *(f"{level} over" for level in LEVELS)]
    return found.groupby(about, sort=False, dropna=False)[measured].mean().reset_index()


@as_table
def alarms(work: Work) -> Rows:
    """Detection by recording; healthy recordings are judged by maps that did not see them."""
    for (data, without), own in watched(work).groupby(["data", "without"], sort=False):
        faults, kept = own[own["class"] != "healthy"], own[own["recording"] == without]
        yield {
            "data": data, "healthy kept out": without or "none", "healthy windows": own["healthy windows"].iloc[0],
            "seeds": own["seed"].nunique(), "threshold, MQE": own["threshold"].mean(),
            "faulty recordings": faults["recording"].nunique(), "detected": faults["alarm"].mean(),
            "fewest of a recording's windows": faults["share"].min(),
            "least MQE of a fault over threshold": faults["mqe over"].min(),
            "alarms in healthy windows not seen": kept["share"].mean() if without else own["held out"].mean(),
            "healthy recording alarms": kept["alarm"].astype(float).mean(),
        }  # fmt: skip


def severity(work: Work) -> pd.DataFrame:
    """MQE of every recording, median of its windows, mean over seeds; of a healthy one by the map of the others, whose
    threshold is another: `over threshold` is what compares."""
    names = {
        "mqe": "MQE", "mqe low": "MQE, 10 %", "mqe high": "MQE, 90 %", "mqe over": "over threshold",
        "share": "windows in alarm",
    }  # fmt: skip
    about = ["data", "class", "bearing", "size", "speed, rpm", "recording"]
    found = unseen(work)[[*about, *names]].rename(columns=names)
    return found.sort_values(["data", "class", "size", "recording"], ignore_index=True)


@as_table
def size(work: Work) -> Rows:
    """Does MQE rise with the size of a defect? By fault and place in the order of speeds, and where it does not."""
    table = work.tables["availability-severity"]
    for (data, fault), part in table[table["class"] != "healthy"].groupby(["data", "class"], sort=False):
        means = part.groupby("size")["MQE"].mean()
        sizes, values = list(means.index), list(means)
        falls = [f"{a:g} to {b:g}" for a, b, x, y in zip(sizes, sizes[1:], values, values[1:], strict=False) if y <= x]
        yield {
            "data": data, "class": fault, "sizes": " < ".join(f"{s:g}" for s in sizes),
            "MQE": ", ".join(f"{v:.1f}" for v in values), "rises": not falls,
            "falls from": "; ".join(falls) or "nowhere",
        }  # fmt: skip


def checks(work: Work) -> pd.DataFrame:
    """False alarms of simulated healthy machines, in recordings that neither trained nor calibrated."""
    values = [c.value for c in work["checks"]]
    machines = np.array([v["share"] for v in values])
    recordings = sum(v["recordings"] for v in values)
    half = 1.96 * machines.std(ddof=1) / np.sqrt(len(machines)) if len(machines) > 1 else np.nan
    return pd.DataFrame([{
        "data": "simulated machines", "machines": len(values), "recordings": recordings,
        "windows": sum(v["windows"] for v in values), "stated": work.options.false_alarm,
        "false alarms, windows": machines.mean(), "+- (95 %, over machines)": half,
        "false alarms, recordings": sum(v["alarms"] for v in values) / recordings,
    }])  # fmt: skip


def _parts(work: Work) -> Iterator[tuple[Measured, str, dict[str, str]]]:
    """Every set and split, and the columns that name them."""
    for name, data in work["data"].items():
        for split in SPLITS:
            yield data, split, {"data": TITLES[name], "split by": split}


def _nets(work: Work, data: Measured, kind: str = "grafted") -> list[dict[str, Any]]:
    return [n.value for n in work["networks"] if (n.job.data, n.job.kind) == (data.name, kind)]


def _named(counts: list[int]) -> str:
    return "" if not counts else "all" if counts[0] == ALL else str(counts[0])


def _above(gain: Any) -> bool:
    if np.ptp(gain) == 0:
        return bool(gain[0] > 0)
    return t_interval(list(gain), LEVEL)[0] > 0


def _right(data: Measured, each: list[dict[str, int]]) -> float:
    """Share of all recordings judged, over folds and seeds."""
    return float(np.mean([data.labels[r] == c for called in each for r, c in called.items()]))
