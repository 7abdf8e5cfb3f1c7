"""Study of live updating, its tables, and a figure of one machine's day."""

import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from papers.arrays import Array
from papers.figures import subplots
from papers.framework import Result, Rows, Step, Study, Work, as_input, as_table
from papers.paper2_digital_twin.live import jobs
from papers.paper2_digital_twin.live_twin.twin import WATCHED
from twingap.rigs.drifting import COOLED, REFILLED, WEARS

WHOLE = "after commissioning"
DRIFT = "under drift"  # from the beginning of the wear on, cooling included: the drift scenario of the target
LAW = "law"
ALARM = re.compile(rf"({'|'.join(WATCHED)}) drifts ")
"""How the reason of an update begins that an alarm led to, whatever came of it: with no better values it is "kept"."""


def metrics(work: Work) -> dict[str, float]:
    found = work.tables["live-errors"]
    return {f"error, {row['arm']}": row["error mean"] for row in found[found["phase"] == WHOLE].to_dict("records")}


def phase_of(time_s: Array, hours: float) -> list[str]:
    """What the machine goes through at these times, in words."""
    part = np.asarray(time_s) / (3600 * hours)
    words = np.full(part.size, "as commissioned", dtype=object)
    words[part >= WEARS[0]] = "wearing"
    words[part >= WEARS[1]] = "worn"
    for on, off in COOLED:
        words[(part >= on) & (part < off)] = "cooled"
    return [str(w) for w in words]


def by_phase(result: Result[jobs.Scenario], arm: str, what: str = "error") -> dict[str, float]:
    """Mean error of one machine's twin in each phase, commissioning left out."""
    value = result.value["arms"][arm]
    skip = int(value["commissioning"])
    time_s, error = (np.asarray(value["judged"][c])[skip:] for c in ("time_s", what))
    words = np.array(phase_of(time_s, result.job.hours))
    out = {phase: float(error[words == phase].mean()) for phase in dict.fromkeys(words)}
    out[DRIFT] = float(error[time_s >= WEARS[0] * 3600 * result.job.hours].mean())
    out[WHOLE] = float(error.mean())
    return out


@as_table
def errors(drifting: Sequence[Result[jobs.Scenario]]) -> Rows:
    """Relative error of the predicted amplitude spectrum by arm and phase, over machines; ``shape`` after scaling as a
    whole, ``chance`` that of a perfect twin, since a snapshot's own spectrum scatters."""
    for arm in drifting[0].value["arms"]:
        found = [by_phase(r, arm) for r in drifting]
        shapes = [by_phase(r, arm, "shape") for r in drifting]
        for phase in found[0]:
            each = np.array([f[phase] for f in found])
            yield {
                "arm": arm, "phase": phase, "machines": each.size, "error mean": each.mean(),
                "error std": each.std(ddof=1) if each.size > 1 else None, "error most": each.max(),
                "shape mean": float(np.mean([s[phase] for s in shapes])),
                "chance": float(drifting[0].value["chance"]),
            }  # fmt: skip


@as_table
def targets(options: jobs.Options, drifting: Sequence[Result[jobs.Scenario]]) -> Rows:
    """What was promised, and what each came to: the worst machine decides."""
    for phase in (DRIFT, WHOLE):
        for what in ("error", "shape"):
            ratio = [by_phase(r, "frozen", what)[phase] / by_phase(r, "live", what)[phase] for r in drifting]
            yield {
                "target": f"frozen over live, {what}, {phase}", "at least": options.halved,
                "median": float(np.median(ratio)), "worst machine": min(ratio),
                "met": bool(min(ratio) >= options.halved),
            }  # fmt: skip
    # Every identification, those included that kept the values; the first one is the commissioning.
    spent = np.array([s for r in drifting for s in [s for s, kind in _spent(r) if kind != LAW][1:]])
    if spent.size:
        yield {
            "target": f"{options.most_ms:g} ms over the cost of an update", "at least": 1.0,
            "median": options.most_ms / (1e3 * float(np.median(spent))),
            "worst machine": options.most_ms / (1e3 * float(spent.max())),
            "met": bool(1e3 * spent.max() <= options.most_ms),
        }  # fmt: skip


def false_alarms(options: jobs.Options, steady: Sequence[Result[jobs.Scenario]]) -> pd.DataFrame:
    """Alarms (also those that changed nothing) of twins whose machine does not drift, against the stated rate; 95 %
    interval of a Poisson count. ``held`` is false where alarms are more frequent than stated."""
    from scipy.stats import chi2

    alarms = snapshots = 0
    for r in steady:
        value = r.value["arms"]["live"]
        snapshots += len(value["judged"]["error"]) - int(value["commissioning"])
        alarms += sum(bool(ALARM.match(why)) for why in value["updates"].get("why", []))
    low = float(chi2.ppf(0.025, 2 * alarms)) / 2 if alarms else 0.0
    high = float(chi2.ppf(0.975, 2 * alarms + 2)) / 2
    return pd.DataFrame([{
        "machines": len(steady), "snapshots": snapshots, "alarms": alarms, "rate": alarms / snapshots,
        "low_95": low / snapshots, "high_95": high / snapshots, "stated": options.false_alarms,
        "held": bool(low / snapshots <= options.false_alarms),
    }])  # fmt: skip


def messages(drifting: Sequence[Result[jobs.Scenario]]) -> pd.DataFrame:
    """What became of the messages, summed over machines."""
    rows = [row for r in drifting for row in r.value["arms"]["live"]["messages"]]
    found = pd.DataFrame(rows, columns=["message", "case", "count"])
    return found.groupby(["message", "case"], as_index=False).sum()


@as_table
def cost(drifting: Sequence[Result[jobs.Scenario]]) -> Rows:
    """CPU time that updates took where they were run, by kind: it differs from run to run."""
    for kind in (LAW, "commissioning", "drift", "following", "kept"):
        spent = np.array([s for r in drifting for s, k in _spent(r) if k == kind])
        if spent.size:
            yield {
                "kind": kind, "updates": spent.size, "median ms": 1e3 * float(np.median(spent)),
                "90 % ms": 1e3 * float(np.quantile(spent, 0.9)), "most ms": 1e3 * float(spent.max()),
            }  # fmt: skip


def _spent(result: Result[jobs.Scenario]) -> list[tuple[float, str]]:
    """CPU seconds and kind of every update of the live twin."""
    found = result.value["arms"]["live"]["updates"]
    return list(zip(found.get("seconds", []), found.get("kind", []), strict=True))


LINES: Final = {
    "frozen": ("#444444", "-"),
    "laws alone": ("#E69F00", "--"),
    "identification alone": ("#0072B2", "-."),
    "live": ("#D55E00", "-"),
}
TRUTH: Final = "#009E73"


def day(first: Result[jobs.Scenario]) -> Figure:
    """The first machine's run: what it goes through, and how its twins keep up."""
    course, arms = first.value["course"], first.value["arms"]
    figure, panels = subplots((13, 9.5), 2, 2, sharex=True)
    hours = np.asarray(course["time_s"]) / 3600
    panels[0, 0].plot(hours, course["temperature_c"], color="#444444", lw=1.2)
    panels[0, 0].set(ylabel="outer ring (°C)", title="Temperature, as measured")
    for name, value in arms.items():
        colour, style = LINES[name]
        at = np.asarray(value["judged"]["time_s"]) / 3600
        panels[0, 1].plot(at, value["judged"]["error"], style, color=colour, lw=1.7, label=name)
    panels[0, 1].axhline(first.value["chance"], color="0.6", lw=1.2, ls=":", label="a perfect twin")
    panels[0, 1].set(ylabel="relative error of spectra", title="Each snapshot, predicted before it is seen")
    panels[0, 1].legend()
    _parameter(panels[1, 0], course, arms, "stiffness", "Contact stiffness")
    _parameter(panels[1, 1], course, arms, "damping", "Damping")
    for panel in panels.flat:
        panel.grid(color="0.9")
    for panel in panels[1]:
        panel.set_xlabel("time (h)")
    hours_of = first.job.hours
    wears = " to ".join(f"{part * hours_of:.1f}" for part in WEARS)
    figure.suptitle(
        f"A virtual machine that warms up, is cooled, wears ({wears} h), gets fresh oil ({REFILLED * hours_of:.1f} h)"
    )
    return figure


def _parameter(panel: Any, course: Any, arms: Any, name: str, title: str) -> None:
    """Relative to what each was at commissioning: the twin's absolute values stand for a simpler machine."""
    at = np.asarray(course["time_s"])
    begin = 0.0
    for arm in ("laws alone", "live"):
        found = arms[arm]["updates"]
        place = list(found["kind"]).index("commissioning")
        times, values = (np.asarray(found[column])[place:] for column in ("time_s", f"{name} to"))
        begin = times[0]
        colour, style = LINES[arm]
        panel.step(
            np.append(times, at[-1]) / 3600, np.append(values, values[-1]) / values[0], style, where="post",
            color=colour, lw=1.7, label=arm,
        )  # fmt: skip
    truth = np.asarray(course[name])
    reference = truth[int(np.searchsorted(at, begin))]
    panel.plot(at / 3600, truth / reference, color=TRUTH, lw=2.4, alpha=0.7, label="truth", zorder=1)
    panel.set(ylabel="over its value at commissioning", title=title)
    shown = (truth / reference)[at >= begin]
    panel.set_ylim(0.75 * shown.min(), 1.25 * shown.max())
    panel.legend()


STUDY = Study(
    name="live",
    title="live updating",
    data="virtual machine",
    named=True,
    options=jobs.Options,
    steps=(
        Step("drifting", jobs.live_through, jobs.drifting, as_input),
        Step("steady", jobs.live_through, jobs.steady, as_input),
    ),
    tables={
        "live-errors": lambda work: errors(work["drifting"]),
        "live-targets": lambda work: targets(work.options, work["drifting"]),
        "live-false-alarms": lambda work: false_alarms(work.options, work["steady"]),
        "live-messages": lambda work: messages(work["drifting"]),
        "live-cost": lambda work: cost(work["drifting"]),
    },
    metrics=metrics,
    figures={"live-drift": lambda work: day(work["drifting"][0])},
    headlines=("live-targets", "live-false-alarms"),
)
