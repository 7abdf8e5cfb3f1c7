"""Figures of the study of live updating: one machine's day."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from papers.figures import subplots
from papers.framework import Work
from papers.paper2_digital_twin.live.jobs import Scenario
from twingap.rigs.drifting import REFILLED, WEARS
from twingap.sweep import Result

LINES: Final = {
    "frozen": ("#444444", "-"),
    "laws alone": ("#E69F00", "--"),
    "identification alone": ("#0072B2", "-."),
    "live": ("#D55E00", "-"),
}
TRUTH: Final = "#009E73"


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "live-drift", day(work["drifting"][0])


def day(first: Result[Scenario]) -> Figure:
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
