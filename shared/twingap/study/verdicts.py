"""What a method says of a world, and what the world was: the two sides that scores compare.

gap report of the diagnosis --found_in--+
answers of a rival ---------------------+--> Found --+
                                                     +--> Row, one per world and method
Truth, unsealed --was_of--> Was ---------------------+
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

CATALOGUED = ("single", "pair", "crowd")
STRANGE = ("outside", "outside_plus")
KINDS = ("none", *CATALOGUED, *STRANGE)


@dataclass(frozen=True)
class Found:
    """What a method says.

    Parameters
    ----------
    status : str
        no_gap, explained, partly_explained or unexplained, as in gap_report.schema.json; refused when there was no
        answer, which finds nothing and is right about nothing but the absence of a gap.
    effects : tuple of str
        Found missing, strongest first.
    confidence_set : tuple of tuple of str, or None
        None for a method that gives none.
    probability : Mapping[str, float]
        Effect -> probability that it is missing; empty for a method that gives none.
    p_value : float or None
        Of no gap.
    parameters : Mapping[str, Mapping[str, Mapping[str, Any]]]
        Effect -> parameter -> value, unit, ci; of the effects named.
    closure : float or None
        Of the verdict.
    gaps : (float, float, float) or None
        Overall gap before and after, and its floor.
    runtime_s, peak_mb : float or None
        Of this answer.
    """

    status: str
    effects: tuple[str, ...] = ()
    confidence_set: tuple[tuple[str, ...], ...] | None = None
    probability: Mapping[str, float] = field(default_factory=dict)
    p_value: float | None = None
    parameters: Mapping[str, Mapping[str, Mapping[str, Any]]] = field(default_factory=dict)
    closure: float | None = None
    gaps: tuple[float, float, float] | None = None
    runtime_s: float | None = None
    peak_mb: float | None = None

    @property
    def first(self) -> str | None:
        """The effect named first."""
        return self.effects[0] if self.effects else None

    @property
    def gap(self) -> bool:
        """Whether a gap is claimed."""
        return self.status not in ("no_gap", "refused")

    @property
    def strange(self) -> bool:
        """Whether it is said that something is there which the named effects do not explain."""
        return self.status in ("unexplained", "partly_explained")

    @property
    def covers(self) -> tuple[frozenset[str], ...]:
        """The confidence set, as sets."""
        return tuple(frozenset(s) for s in self.confidence_set or ())


@dataclass(frozen=True)
class Was:
    """What a world was.

    Parameters
    ----------
    case, kind, arm : str
    effects : tuple of str
        Catalogued ones.
    strength : Mapping[str, str]
        Of each effect and outsider.
    outsiders : tuple of str
    parameters : Mapping[str, Mapping[str, Any]]
    closure : float or None
        Of the true effects with their true parameters.
    left : float or None
        Gap between the machine without its effects and its own twin.
    """

    case: str
    kind: str
    arm: str
    effects: tuple[str, ...] = ()
    strength: Mapping[str, str] = field(default_factory=dict)
    outsiders: tuple[str, ...] = ()
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    closure: float | None = None
    left: float | None = None

    @property
    def one_strength(self) -> str:
        """Strength of a world's only effect; "" where there are several or none."""
        names = (*self.effects, *self.outsiders)
        return str(self.strength.get(names[0], "")) if len(names) == 1 else ""


@dataclass(frozen=True)
class Row:
    """A world and what a method said of it."""

    was: Was
    found: Found


def was_of(truth: Any, closure: float | None = None, left: float | None = None) -> Was:
    """The part of a `twingap.rigs.worlds` truth that scores compare with."""
    return Was(
        case=truth.case,
        kind=truth.kind,
        arm=truth.arm,
        effects=tuple(truth.effects),
        strength=dict(truth.strength),
        outsiders=tuple(truth.outsiders),
        parameters={name: dict(values) for name, values in truth.parameters.items()},
        closure=closure,
        left=left,
    )


def found_in(report: Mapping[str, Any], runtime_s: float | None = None, peak_mb: float | None = None) -> Found:
    """What a report (content of gap.json) says.

    Parameters
    ----------
    report : Mapping
        As gap_report.schema.json has it.
    runtime_s, peak_mb : float, optional
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
        gaps=next(
            ((float(m["before"]), float(m["after"]), float(m["floor"])) for m in report["shrink"]["metrics"]), None
        ),
        runtime_s=runtime_s,
        peak_mb=peak_mb,
    )


def _gaps(report: Mapping[str, Any]) -> tuple[float, float, float] | None:
    """The first metric: before, after, floor."""
    for metric in report["shrink"]["metrics"]:
        return float(metric["before"]), float(metric["after"]), float(metric["floor"])
    return None


def _closure(report: Mapping[str, Any]) -> float | None:
    """Closure of the verdict: as it says, or by the first metric; None where nothing was added."""
    if not report["verdict"]["effects"]:
        return None
    said = report["verdict"].get("closure")
    if said is not None:
        return float(said)
    before, after, floor = _gaps(report) or (0.0, 0.0, 0.0)
    return (before - after) / (before - floor) if abs(before - floor) > 1e-12 else None


def of_kind(rows: Sequence[Row], *kinds: str) -> list[Row]:
    """The rows of worlds of these kinds."""
    return [row for row in rows if row.was.kind in kinds]
