"""fleet.html: a fleet as one page, one row per machine, sorted and filtered without a server.

Fleet --rows of text, chart--> Jinja2 template --> page; it needs no other file but the reports to which it links
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final
from urllib.parse import quote

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from twingap.fleet.summary import NOT_DIAGNOSED, Fleet, Machine, SharedEffect
from twingap.gap.report.formats import name, percent
from twingap.gap.report.status import TITLES as STATUS_TITLES

TITLES: Final = {**STATUS_TITLES, NOT_DIAGNOSED: "Not diagnosed"}
_NUMBERED: Final = 5
"""Machines that the chart numbers."""
_MOVED, _WORTH = 0.05, 0.3
"""Smallest change of a probability by the fleet, and smallest probability, that are shown. Smaller ones show more."""
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 460, 400, 52, 14, 14, 52


@dataclass(frozen=True)
class Row:
    """A machine as text."""

    machine: Machine
    rank: str
    link: str
    title: str
    effects: Sequence[str]
    gap: str
    closes: Sequence[str]
    with_fleet: Sequence[str]
    difference: str


@dataclass(frozen=True)
class Point:
    """A machine in the chart."""

    x: float
    y: float
    status: str
    link: str
    label: str
    rank: str


@dataclass(frozen=True)
class Chart:
    """Gap of each machine before and after its named effects are added, as multiples of its floor."""

    points: Sequence[Point]
    x_ticks: Sequence[tuple[float, str]]
    y_ticks: Sequence[tuple[float, str]]
    diagonal: tuple[float, float, float, float]
    width: int = _WIDTH
    height: int = _HEIGHT
    left: int = _LEFT
    right: int = _WIDTH - _RIGHT
    top: int = _TOP
    bottom: int = _HEIGHT - _BOTTOM


def page(fleet: Fleet) -> str:
    """The page."""
    diagnosed = fleet.diagnosed
    closures = [machine.closure for machine in diagnosed if machine.closure is not None]
    facts = [("record sets", str(len(fleet.machines)))]
    if closures:
        facts.append(("gap closed, median", percent(sorted(closures)[len(closures) // 2])))
    return (
        templates()
        .get_template("fleet.html")
        .render(
            fleet=fleet,
            title=_title(fleet),
            lead=_lead(fleet),
            facts=facts,
            statuses=[(status, TITLES[status], count) for status, count in fleet.statuses.items() if count],
            rows=[_row(i, machine) for i, machine in enumerate(fleet.machines, 1)],
            groups=[
                (row.group, percent(row.share), f"{row.machines} of {row.of}")
                for row in fleet.groups
                if round(100 * row.share)
            ],
            effects=[_effect(row) for row in fleet.effects if row.named or (row.prevalence or 0) > 0.2],
            chart=_chart(diagnosed),
            about={name(key): value for key, value in fleet.about.items()},
        )
    )


@cache
def templates() -> Environment:
    """The templates, which escape what they show; the style is that of the report of a diagnosis."""
    loader = ChoiceLoader([PackageLoader("twingap.fleet"), PackageLoader("twingap.gap.report")])
    return Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)


def link(path: str, file: str = "report.html") -> str:
    """Relative address of a machine's report."""
    return quote(f"{path}/{file}")


def _title(fleet: Fleet) -> str:
    total = len(fleet.diagnosed)
    differ = total - fleet.statuses["no_gap"]
    if not differ:
        return f"{_machines(total)} cannot be distinguished from the twin."
    return f"The twin differs from {differ} of {_machines(total)}."


def _lead(fleet: Fleet) -> str:
    """Sentence on the effect that most machines share."""
    if not fleet.effects or not fleet.effects[0].named:
        return "No effect is named for any of them."
    if fleet.effects[0].named == 1 < len(fleet.diagnosed):
        return "No effect is named for more than one of them."
    first = fleet.effects[0]
    text = f"Named most often as missing from the twin: {name(first.effect)}, for {first.named} of {first.of}"
    return f"{text} (90 % interval {percent(first.rate_ci[0])} to {percent(first.rate_ci[1])})."


def _machines(count: int) -> str:
    return f"{count} machine{'s' * (count != 1)}"


def _row(rank: int, machine: Machine) -> Row:
    own, given = machine.probability, machine.with_fleet
    moved = [n for n in given if abs(given[n] - own[n]) >= _MOVED and max(given[n], own[n]) >= _WORTH]
    closes = [] if machine.closure is None else [percent(machine.closure, machine.closure_ci)]
    if machine.closest is not None:
        closes.append(f"closest twin {percent(machine.closest)}")
    return Row(
        machine,
        str(rank) if machine.diagnosed else "",
        link(machine.path) if machine.diagnosed else "",
        TITLES[machine.status],
        [f"{name(n)} {percent(own[n])}" for n in machine.effects],
        _gap(machine),
        closes,
        [f"{name(n)} {percent(own[n])} → {percent(given[n])}" for n in sorted(moved, key=lambda n: -given[n])],
        "" if machine.difference is None else f"{machine.difference:.1f}",
    )


def _gap(machine: Machine) -> str:
    gap, after = machine.gap, machine.gap_after
    if gap is None or after is None:
        return ""
    return f"{gap:.2g}\u00a0→\u00a0{after:.2g}" if machine.effects else f"{gap:.2g}"


def _effect(row: SharedEffect) -> dict[str, str | float]:
    rate = row.named / row.of
    return {
        "effect": row.effect,
        "name": name(row.effect),
        "named": f"{row.named} of {row.of}",
        "interval": f"{percent(row.rate_ci[0])} to {percent(row.rate_ci[1])}",
        "prevalence": "" if row.prevalence is None else percent(row.prevalence, row.prevalence_ci),
        "low": 100 * row.rate_ci[0],
        "width": 100 * (row.rate_ci[1] - row.rate_ci[0]),
        "at": 100 * rate,
    }


def _chart(machines: Sequence[Machine]) -> Chart | None:
    """Scatter on logarithmic axes; nothing without gaps."""
    held = [(rank, m, m.gap, m.gap_after) for rank, m in enumerate(machines, 1)]
    known = [(rank, m, x, y) for rank, m, x, y in held if x and y and x > 0 and y > 0]
    if not known:
        return None
    values = [v for _, _, x, y in known for v in (x, y)]
    low, high = min(0.7, *values) / 1.1, max(2.0, *values) * 1.15
    span = math.log(high / low)
    across, up = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM

    def x_of(value: float) -> float:
        return round(_LEFT + across * math.log(value / low) / span, 1)

    def y_of(value: float) -> float:
        return round(_TOP + up * (1 - math.log(value / low) / span), 1)

    ticks = [v for v in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if low <= v <= high]
    return Chart(
        # Machines of high rank are drawn last, above the others.
        [
            Point(
                x_of(x), y_of(y), m.status, link(m.path), f"{m.path}: {TITLES[m.status]}, {x:.2g} → {y:.2g}",
                str(rank) if rank <= _NUMBERED else "",
            )
            for rank, m, x, y in reversed(known)
        ],
        [(x_of(v), f"{v:g}") for v in ticks],
        [(y_of(v), f"{v:g}") for v in ticks],
        (x_of(low), y_of(low), x_of(high), y_of(high)),
    )  # fmt: skip
