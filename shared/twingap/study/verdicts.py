"""Findings of a method on a virtual world, and the truth of it: the two sides that scores compare.

gap report of the diagnosis --found_in--+
output of a rival ----------------------+--> Found --+
                                                     +--> Row, one per world and method
Truth, unsealed --was_of--> Was ---------------------+
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from twingap.gap.report.grouped_sets import by_groups

CATALOGUED = ("single", "pair", "crowd")
UNCATALOGUED = ("outside", "outside_plus")
PLAIN = ("none", *CATALOGUED, *UNCATALOGUED)
RICH = ("path", "lines", "rich", "rich_none")
"""Kinds of worlds with many modes and lines. Scores keep them apart, so that those of the others are comparable between
studies with and without them."""
KINDS = (*PLAIN, *RICH)


@dataclass(frozen=True)
class Found:
    """Findings of a method on a world."""

    # no_gap, explained, partly_explained or unexplained, as in gap_report.schema.json; refused when there was no
    # diagnosis, which counts as no finding and is correct only where there is no gap.
    status: str
    effects: tuple[str, ...] = ()  # missing effects, strongest first
    confidence_set: tuple[tuple[str, ...], ...] | None = None  # None for a method without one
    # Effect -> probability that it is missing; empty for a method without probabilities.
    probability: Mapping[str, float] = field(default_factory=dict)
    p_value: float | None = None  # of the hypothesis of no gap
    # Effect -> parameter -> value, unit, ci; of the named effects.
    parameters: Mapping[str, Mapping[str, Mapping[str, Any]]] = field(default_factory=dict)
    closure: float | None = None  # closure of the verdict, dimensionless
    # Closure of the closest twin, with the effects of the verdict and all others that bring it closer; None where it
    # was not sought.
    closest: float | None = None
    # Gap over all domains before and after, and its floor, in standard deviations.
    gaps: tuple[float, float, float] | None = None
    runtime_s: float | None = None  # wall time
    peak_mb: float | None = None  # peak memory

    @property
    def first(self) -> str | None:
        """The effect named first."""
        return self.effects[0] if self.effects else None

    @property
    def gap(self) -> bool:
        """Whether a gap is claimed."""
        return self.status not in ("no_gap", "refused")

    @property
    def outside(self) -> bool:
        """Whether the method reports an effect outside the catalogue."""
        return self.status in ("unexplained", "partly_explained")

    @property
    def covers(self) -> tuple[frozenset[str], ...]:
        """Members of the confidence set, as sets."""
        return tuple(frozenset(s) for s in self.confidence_set or ())

    @property
    def groups(self) -> frozenset[frozenset[str]]:
        """The confidence set by groups, as the report lists it: groups of the effects of each line."""
        lines = by_groups(self.confidence_set, self.probability) if self.confidence_set else ()
        return frozenset(frozenset(choice.group for choice in line.choices) for line in lines)


@dataclass(frozen=True)
class Was:
    """Truth of a world."""

    case: str
    kind: str
    arm: str
    effects: tuple[str, ...] = ()  # catalogued effects
    # Strength of each effect, also of those outside the catalogue.
    strength: Mapping[str, str] = field(default_factory=dict)
    uncatalogued: tuple[str, ...] = ()  # effects outside the catalogue
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # effect -> parameter -> true value
    closure: float | None = None  # closure of the true effects at their true values
    # Gap between the machine without its effects and its own calibrated twin, in standard deviations.
    left: float | None = None

    @property
    def one_strength(self) -> str:
        """Strength of a world's only effect; "" where there are several or none."""
        names = (*self.effects, *self.uncatalogued)
        return str(self.strength.get(names[0], "")) if len(names) == 1 else ""


@dataclass(frozen=True)
class Row:
    """A world's truth and the findings of one method on it."""

    was: Was
    found: Found


def was_of(truth: Any, closure: float | None = None, left: float | None = None) -> Was:
    """The part of a truth of `twingap.rigs.worlds` that scores use."""
    return Was(
        case=truth.case,
        kind=truth.kind,
        arm=truth.arm,
        effects=tuple(truth.effects),
        strength=dict(truth.strength),
        uncatalogued=tuple(truth.uncatalogued),
        parameters={name: dict(values) for name, values in truth.parameters.items()},
        closure=closure,
        left=left,
    )


def found_in(report: Mapping[str, Any], runtime_s: float | None = None, peak_mb: float | None = None) -> Found:
    """Findings in a gap report.

    Parameters
    ----------
    report : Mapping
        Content of gap.json, as in gap_report.schema.json.
    runtime_s, peak_mb : float, optional
        Wall time, s, and peak memory, MB.
    """
    verdict = report["verdict"]
    named = tuple(verdict["effects"])
    return Found(
        status=verdict["status"],
        effects=named,
        confidence_set=tuple(tuple(effects) for effects in verdict["confidence_set"]),
        probability={c["effect"]: float(c["probability"]) for c in report["which"]},
        p_value=float(verdict["p_value"]),
        parameters={c["effect"]: c.get("parameters") or {} for c in report["which"] if c["effect"] in named},
        closure=_closure(report),
        closest=_closest(report),
        gaps=_gaps(report),
        runtime_s=runtime_s,
        peak_mb=peak_mb,
    )


def _gaps(report: Mapping[str, Any]) -> tuple[float, float, float] | None:
    """Before, after and floor of the first metric."""
    for metric in report["shrink"]["metrics"]:
        return float(metric["before"]), float(metric["after"]), float(metric["floor"])
    return None


def _closure(report: Mapping[str, Any]) -> float | None:
    """Closure of the verdict: as stated, or from the first metric; None where no effect was added."""
    if not report["verdict"]["effects"]:
        return None
    stated = report["verdict"].get("closure")
    if stated is not None:
        return float(stated)
    before, after, floor = _gaps(report) or (0.0, 0.0, 0.0)
    return (before - after) / (before - floor) if abs(before - floor) > 1e-12 else None


def _closest(report: Mapping[str, Any]) -> float | None:
    """Closure of the closest twin; 0 where there is no gap to close, None where the diagnosis was a quick one."""
    if report.get("provenance", {}).get("quick", True):
        return None
    return float((report.get("closest") or {}).get("closure", 0.0))


def of_kind(rows: Sequence[Row], *kinds: str) -> list[Row]:
    """The rows of worlds of these kinds."""
    return [row for row in rows if row.was.kind in kinds]
