"""Scores of a method: rates with exact intervals and targets, confusion matrix, reliability.

rows of one method --counted by kind, strength, effect, arm--> Score, Score, ...
                   --first named against true--> confusion;  --probability against truth--> reliability

A score is a line in `headline` where it has a target, else in `detailed`; tables and figures show both by name.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from twingap.gap.report.grouped_sets import group_of
from twingap.study.intervals import of_median, of_rate
from twingap.study.verdicts import CATALOGUED, KINDS, PLAIN, RICH, UNCATALOGUED, Row, of_kind

NOTHING: Final = "(none)"
"""Label of "no effect named" in confusion matrices."""
STATUSES: Final = ("no_gap", "explained", "partly_explained", "unexplained", "refused")
LEAST_CLOSURE: Final = 0.1
"""Fraction of the gap that the true effects must close for a ratio of closures to be computed; larger leaves out more
worlds."""
STRENGTHS: Final = ("weak", "medium", "strong")
_NOTHING: Final = frozenset(("none", "rich_none"))
"""Kinds of worlds whose twin lacks nothing."""
COMPARED: Final = (
    "false alarms", "first-named right", "first-named of the right group", "exact set", "precision", "recall",
    "outside recognised",
)  # fmt: skip
"""Scores that are defined for every method."""


@dataclass(frozen=True)
class Target:
    """Target of a score: a lower or an upper bound of its "value", or of the upper end of its interval ("high")."""

    bound: float
    at_least: bool = True
    of: str = "value"

    @property
    def words(self) -> str:
        """Text such as "at least 0.95"."""
        of = "upper bound " if self.of == "high" else ""
        return f"{of}{'at least' if self.at_least else 'at most'} {self.bound:g}"


@dataclass(frozen=True)
class Score:
    """One score of a method."""

    name: str
    among: str  # the worlds over which it is computed
    value: float
    low: float  # 95 % interval; NaN without data
    high: float
    n: int  # number of worlds, or of named and true effects for precision and recall
    k: int | None = None  # successes; None where the value is not a rate
    target: Target | None = None

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without target or data."""
        compared = self.high if self.target is not None and self.target.of == "high" else self.value
        if self.target is None or math.isnan(compared):
            return None
        return compared >= self.target.bound if self.target.at_least else compared <= self.target.bound

    @property
    def row(self) -> dict[str, Any]:
        """Row of tables and study.json."""
        numbers = {name: _finite(getattr(self, name)) for name in ("value", "low", "high")}
        target = None if self.target is None else self.target.words
        return {
            "score": self.name, "among": self.among, **numbers, "k": self.k, "n": self.n, "target": target,
            "met": self.met,
        }  # fmt: skip


def rate(name: str, among: str, hits: Iterable[bool], target: Target | None = None) -> Score:
    """Rate with its Clopper-Pearson interval."""
    seen = [bool(hit) for hit in hits]
    return counted(name, among, sum(seen), len(seen), target)


def counted(name: str, among: str, k: int, n: int, target: Target | None = None) -> Score:
    """Rate from counts, with its Clopper-Pearson interval."""
    return Score(name, among, k / n if n else math.nan, *of_rate(k, n), n, k, target)


def median(name: str, among: str, values: Iterable[float], target: Target | None = None) -> Score:
    """Median with its interval by order statistics."""
    kept = [v for v in values if math.isfinite(v)]
    return Score(name, among, float(np.median(kept)) if kept else math.nan, *of_median(kept), len(kept), None, target)


def mean(name: str, among: str, values: Iterable[float], target: Target | None = None) -> Score:
    """Mean with its interval by Student's t."""
    from scipy.stats import t

    kept = np.array([v for v in values if math.isfinite(v)])
    if kept.size == 0:
        return Score(name, among, math.nan, math.nan, math.nan, 0, None, target)
    half = float(t.ppf(0.975, kept.size - 1) * kept.std(ddof=1) / math.sqrt(kept.size)) if kept.size > 1 else math.inf
    return Score(name, among, float(kept.mean()), float(kept.mean()) - half, float(kept.mean()) + half, kept.size,
                 None, target)  # fmt: skip


def largest(name: str, among: str, values: Iterable[float], target: Target | None = None) -> Score:
    """Largest value, without an interval."""
    kept = [v for v in values if math.isfinite(v)]
    return Score(name, among, max(kept, default=math.nan), math.nan, math.nan, len(kept), None, target)


def right_first(row: Row) -> bool:
    """Whether the effect named first is one of the true ones."""
    return row.found.first in row.was.effects


def right_group(row: Row) -> bool:
    """Whether the effect named first is of the group of a true one, such as a drive's lines of a list of lines."""
    from twingap.effects import catalogue

    group = {name: effect.group for name, effect in catalogue().items()}
    return row.found.first in group and group[row.found.first] in {group[name] for name in row.was.effects}


def exact(row: Row) -> bool:
    """Whether the effects named are exactly the true ones."""
    return set(row.found.effects) == set(row.was.effects)


def covered(row: Row) -> bool:
    """Whether the confidence set contains the true set."""
    return frozenset(row.was.effects) in row.found.covers


def group_covered(row: Row) -> bool:
    """Whether the confidence set by groups contains the groups of the true set."""
    return frozenset(map(group_of, row.was.effects)) in row.found.groups


def headline(rows: Sequence[Row]) -> list[Score]:
    """Scores with targets, in the order of the tables."""
    none, single = of_kind(rows, "none"), of_kind(rows, "single")
    clear = [r for r in single if r.was.one_strength in ("medium", "strong")]
    weak = [r for r in single if r.was.one_strength == "weak"]
    pairs, crowds, outside = of_kind(rows, "pair"), of_kind(rows, "crowd"), of_kind(rows, *UNCATALOGUED)
    false = rate("false alarms", "none", (r.found.gap for r in none), Target(0.05, at_least=False))
    with_set = [r for r in clear if r.found.confidence_set is not None]
    several = [r for r in of_kind(rows, *CATALOGUED) if r.found.confidence_set is not None]
    known = of_kind(rows, *CATALOGUED)
    size = lambda r: float(len(r.found.covers))  # noqa: E731
    groups = lambda r: float(len(r.found.groups))  # noqa: E731
    rich = _headline_of_rich(rows) if of_kind(rows, *RICH) else []
    closest = [r for r in known if r.found.closest is not None]
    return [
        false,
        Score("false alarms, upper bound", "none", false.high, false.low, false.high, false.n, false.k,
              Target(0.09, at_least=False, of="high")),
        rate("first-named right", "single, medium or strong", map(right_first, clear), Target(0.95)),
        rate("first-named right", "single, weak", map(right_first, weak), Target(0.75)),
        rate("confidence set covers", "single, medium or strong", map(covered, with_set), Target(0.90)),
        mean("size of confidence set", "single, medium or strong", map(size, with_set), Target(2.0, at_least=False)),
        rate("confidence set covers", "single, pair, crowd", map(covered, several), Target(0.90)),
        mean("size of confidence set", "single, pair, crowd", map(size, several), Target(2.0, at_least=False)),
        rate("confidence set by groups covers", "single, pair, crowd", map(group_covered, several), Target(0.90)),
        mean("size of confidence set by groups", "single, pair, crowd", map(groups, several),
             Target(4.0, at_least=False)),
        rate("exact set", "pair", map(exact, pairs), Target(0.70)),
        precision(crowds, "crowd", Target(0.90)),
        recall(crowds, "crowd", Target(0.75)),
        rate("outside recognised", "outside, outside_plus", (r.found.outside for r in outside), Target(0.80)),
        *statuses_told_apart(known, outside),
        median("closure over true closure", "single, pair, crowd", map(closure_ratio, known), Target(0.90)),
        median("closure over what the twin can close", "single, pair, crowd", map(closable_ratio, known), Target(0.90)),
        *([median("closest twin's closure over true closure", "single, pair, crowd", map(closest_ratio, closest),
                  Target(0.85))] if closest else []),
        largest("runtime, s", "all", (_or_nan(r.found.runtime_s) for r in rows), Target(60.0, at_least=False)),
        largest("peak memory, MB", "all", (_or_nan(r.found.peak_mb) for r in rows), Target(2048.0, at_least=False)),
        *rich,
    ]  # fmt: skip


def statuses_told_apart(known: Sequence[Row], outside: Sequence[Row]) -> list[Score]:
    """How well the status tells worlds of catalogued effects alone from those with others, of worlds called a gap."""

    def explained(row: Row) -> bool:
        return row.found.status == "explained"

    named, gaps = [r for r in known if r.found.gap and exact(r)], [r for r in known if r.found.gap]
    inside = rate("explained", "single, pair, crowd, called a gap", map(explained, gaps))
    beyond = rate("not explained", "outside, outside_plus, called a gap",
                  (not explained(r) for r in outside if r.found.gap))  # fmt: skip
    value = (inside.value + beyond.value) / 2
    half = 0.98 * math.sqrt(sum(s.value * (1 - s.value) / s.n if s.n else math.nan for s in (inside, beyond)))
    return [
        rate("explained", "single, pair, crowd, named exactly", map(explained, named), Target(0.80)),
        inside, beyond,
        Score("balanced accuracy of the status", "single to crowd, outside", value, value - half, value + half,
              inside.n + beyond.n, None, Target(0.85)),
    ]  # fmt: skip


def _headline_of_rich(rows: Sequence[Row]) -> list[Score]:
    """Scores of the worlds of rich machines."""
    rich, one = of_kind(rows, "rich"), of_kind(rows, "path", "lines")
    return [
        rate("false alarms", "rich_none", (r.found.gap for r in of_kind(rows, "rich_none"))),
        *(rate("first-named right", kind, map(right_first, of_kind(rows, kind))) for kind in ("path", "lines")),
        *(rate("first-named of the right group", k, map(right_group, of_kind(rows, k))) for k in ("path", "lines")),
        rate("exact set", "rich", map(exact, rich)),
        precision(rich, "rich"),
        recall(rich, "rich"),
        median("closure over true closure", "path, lines, rich", map(closure_ratio, [*one, *rich])),
    ]


def detailed(rows: Sequence[Row]) -> list[Score]:
    """Every rate by kind, strength, arm and effect, without targets."""
    out: list[Score] = []
    for label, part in _parts(rows):
        kinds = {r.was.kind for r in part}
        known = of_kind(part, *CATALOGUED, "path", "lines", "rich")
        if nothing := of_kind(part, *_NOTHING):
            out.append(rate("false alarms", label, (r.found.gap for r in nothing)))
        if kinds - _NOTHING:
            out.append(rate("detected", label, (r.found.gap for r in part if r.was.kind not in _NOTHING)))
        if known:
            out += [
                rate("first-named right", label, map(right_first, known)),
                rate("exact set", label, map(exact, known)),
                precision(known, label),
                recall(known, label),
                median("closure over true closure", label, map(closure_ratio, known)),
                median("closure over what the twin can close", label, map(closable_ratio, known)),
            ]
        with_set = [r for r in part if r.found.confidence_set is not None and r.was.kind not in UNCATALOGUED]
        if with_set:
            out.append(rate("confidence set covers", label, map(covered, with_set)))
            out.append(mean("size of confidence set", label, (float(len(r.found.covers)) for r in with_set)))
        if outside := of_kind(part, *UNCATALOGUED):
            out.append(rate("outside recognised", label, (r.found.outside for r in outside)))
        if plus := of_kind(part, "outside_plus"):
            out += [precision(plus, f"{label}: outside_plus"), recall(plus, f"{label}: outside_plus")]
    out.append(median("runtime, s", "all", (_or_nan(r.found.runtime_s) for r in rows)))
    return out


def by_effect(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Detection, first-named and exact set of single effects, and recall among several, by effect and strength."""
    table = []
    for effect in sorted({e for r in rows for e in r.was.effects}):
        for strength in STRENGTHS:
            alone = [r for r in of_kind(rows, "single", "path", "lines")
                     if r.was.effects == (effect,) and r.was.one_strength == strength]  # fmt: skip
            company = [r for r in of_kind(rows, "pair", "crowd", "outside_plus")
                       if effect in r.was.effects and r.was.strength.get(effect) == strength]  # fmt: skip
            measures: dict[str, list[bool]] = {
                "detected": [r.found.gap for r in alone],
                "first-named right": [right_first(r) for r in alone],
                "exact set": [exact(r) for r in alone],
                "found in company": [effect in r.found.effects for r in company],
            }
            scores = [rate(name, f"{effect}, {strength}", hits) for name, hits in measures.items() if hits]
            table += [{"effect": effect, "strength": strength, **score.row} for score in scores]
    return table


def by_uncatalogued(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Recognition rate of each effect outside the catalogue, and the statuses given."""
    table = []
    for name in sorted({o for r in rows for o in r.was.uncatalogued}):
        own = [r for r in rows if name in r.was.uncatalogued]
        score = rate("outside recognised", name, (r.found.outside for r in own))
        named = [e for r in own for e in r.found.effects if e not in r.was.effects]
        table.append({"effect": name, **score.row, "effects named instead": _tally(named)})
    return table


def precision(rows: Sequence[Row], among: str, target: Target | None = None) -> Score:
    """Fraction of the named effects that are true, over all worlds together (micro average)."""
    named = [effect in row.was.effects for row in rows for effect in set(row.found.effects)]
    return rate("precision", among, named, target)


def recall(rows: Sequence[Row], among: str, target: Target | None = None) -> Score:
    """Fraction of the true effects that are named, over all worlds together (micro average)."""
    return rate("recall", among, [e in row.found.effects for row in rows for e in set(row.was.effects)], target)


def closure_ratio(row: Row) -> float:
    """Closure of the verdict over that of the true effects; 0 where the verdict adds no effect.

    Both are capped at 1, since a gap below the floor is chance. NaN where the true effects close less than
    `LEAST_CLOSURE` of the gap, and where a closure is missing.
    """
    if row.was.closure is None or row.was.closure < LEAST_CLOSURE:
        return math.nan
    if not row.found.effects:
        return 0.0
    return math.nan if row.found.closure is None else min(row.found.closure, 1.0) / min(row.was.closure, 1.0)


def closest_ratio(row: Row) -> float:
    """Closure of the closest twin over that of the true effects, as `closure_ratio`."""
    if row.was.closure is None or row.was.closure < LEAST_CLOSURE or row.found.closest is None:
        return math.nan
    return min(row.found.closest, 1.0) / min(row.was.closure, 1.0)


def closable_ratio(row: Row) -> float:
    """Fraction closed of the closable gap: from the initial gap down to that of the machine without effects.

    NaN where that is less than `LEAST_CLOSURE` of the gap, or unknown.
    """
    if row.was.left is None or row.found.gaps is None:
        return math.nan
    before, after, floor = row.found.gaps
    closable = before - max(row.was.left, floor)
    if closable < LEAST_CLOSURE * before or closable <= 0:
        return math.nan
    return min((before - after) / closable, 1.0) if row.found.effects else 0.0


def statuses(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Counts of each status by kind of world."""
    return [
        {"kind": kind, "worlds": len(part), **{s: sum(r.found.status == s for r in part) for s in STATUSES}}
        for kind in KINDS
        if (part := of_kind(rows, kind))
    ]


def confusion(rows: Sequence[Row], effects: Sequence[str]) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """[effects, effects + 1] Worlds with one effect: true effect against first named; last column: none named."""
    counts = np.zeros((len(effects), len(effects) + 1), np.int64)
    place = {name: i for i, name in enumerate(effects)}
    for row in of_kind(rows, "single"):
        first = row.found.first
        counts[place[row.was.effects[0]], len(effects) if first is None else place.get(first, len(effects))] += 1
    return counts


def reliability(rows: Sequence[Row], bins: int = 10) -> list[dict[str, Any]]:
    """Observed frequency of effects by bins of predicted probability, for worlds without uncatalogued effects.

    Intervals treat effects as independent.
    """
    pairs = [(p, e in r.was.effects) for r in rows if not r.was.uncatalogued for e, p in r.found.probability.items()]
    edges = np.linspace(0, 1, bins + 1)
    table = []
    for lo, hi in itertools.pairwise(edges):
        inside = [(p, true) for p, true in pairs if lo <= p < hi or (hi == 1.0 and p == 1.0)]
        if inside:
            score = rate("reliability", f"{lo:.1f} to {hi:.1f}", (true for _, true in inside))
            table.append({"lo": float(lo), "hi": float(hi), "mean_probability": float(np.mean([p for p, _ in inside])),
                          "value": score.value, "low": score.low, "high": score.high, "k": score.k,
                          "n": score.n})  # fmt: skip
    return table


def _parts(rows: Sequence[Row]) -> Iterable[tuple[str, list[Row]]]:
    """Labelled subsets of the rows: all but the rich kinds, by kind, by kind and strength, by kind and arm."""
    yield "all", of_kind(rows, *PLAIN)
    for kind in KINDS:
        own = of_kind(rows, kind)
        if own:
            yield kind, own
        for label, of in _CUTS.items():
            for value in dict.fromkeys(of(r) for r in own):
                if value:
                    yield f"{kind}, {label}{value}", [r for r in own if of(r) == value]


_CUTS: Mapping[str, Callable[[Row], str]] = {"": lambda r: r.was.one_strength, "arm ": lambda r: r.was.arm}


def _tally(names: Sequence[str]) -> dict[str, int]:
    counts = {name: names.count(name) for name in set(names)}
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
