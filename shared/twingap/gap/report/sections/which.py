"""Section "Which effect is missing": every candidate, the verdict's effects marked."""

from __future__ import annotations

from typing import Final

from twingap.effects import catalogue
from twingap.gap.report.advice import only_together
from twingap.gap.report.formats import closure, name, parameters, undetermined
from twingap.gap.report.model import REFERENCE, Candidate, GapReport, listed
from twingap.gap.report.sections.parts import Cell, Figures, Line, Section, Table, figure

_SHOWN: Final = 6
"""Candidates that are listed at once, besides the verdict's."""


def section(report: GapReport, figures: Figures) -> Section | None:
    """The candidates as a figure and a table; the verdict's effects and the most probable others are shown at once."""
    if not report.candidates:
        return None
    named = [c for c in report.candidates if c.effect in report.verdict.effects]
    first = [c for i, c in enumerate(report.candidates) if c in named or i < _SHOWN]
    others = [c for c in report.candidates if c not in first]
    columns = ("closes (90 % interval)", "gap before → after", "fitted parameters (90 % interval)")
    rows = [_row(c, report) for c in (*first, *others)]
    text = (
        "Every effect of the catalogue that the twin does not have yet: probability that the machine has it, and the "
        "part of the gap that it closes on records not used to fit it, beside the verdict's other effects."
    )
    return Section(
        "Which effect is missing",
        " ".join(filter(None, (text, "◆ marks the verdict." * bool(report.verdict.effects), only_together(report)))),
        (*figure(figures, "closures"), Table(("effect", "probability", *columns), rows, len(first), "candidates")),
    )


def _row(candidate: Candidate, report: GapReport) -> tuple[Cell, ...]:
    remark = f"Cannot be added to this simulator: {candidate.acts}." if candidate.acts else ""
    named = report.verdict.effects
    if not remark and set(candidate.fitted_with) != set(named) - {candidate.effect}:
        remark = f"Fitted together with {listed(candidate.fitted_with)}."
    own = report.provenance.get("own_effects", {})
    if candidate.effect in own and candidate.effect not in named and not candidate.acts:
        remark = f"An effect of your own, fitted and tested: held-out records do not confirm it. {remark}".strip()
    effect = [
        Line(name(candidate.effect) + " ◆" * (candidate.effect in named), "strong"),
        Line(_about(candidate.effect), "small"),
        Line(remark, "remark"),
    ]
    # Without a gap, closures mean nothing.
    measured = not candidate.acts and report.verdict.status != "no_gap"
    told = measured and not undetermined(candidate.closure_ci)
    return (
        [line for line in effect if line.text],
        f"{100 * candidate.probability:.0f} %",
        closure(candidate.closure, candidate.closure_ci) if measured else "–",
        f"{candidate.gap_before:.3g} → {candidate.gap_after:.3g}" if told else "–",
        parameters(candidate.parameters, report.calibration.get(REFERENCE)) or "–",
    )


def _about(effect: str) -> str:
    """The first line of the effect's docstring."""
    known = catalogue().get(effect)
    return ((known.__doc__ if known is not None else None) or "").strip().partition("\n")[0].replace("`", "")
