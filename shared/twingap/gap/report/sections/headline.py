"""The headline of the page: status, verdict in one sentence, key numbers, two-sample tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from twingap.gap.report.advice import contradictions, warnings
from twingap.gap.report.formats import closure, p_value
from twingap.gap.report.model import GapReport, Verdict
from twingap.gap.report.status import TITLES, meaning_of

_STATISTICS: Final[Mapping[str, str]] = {
    "AUC": "0.5 where a classifier cannot tell records from simulated ones, 1 where it always can",
    "MMD": "0 where both have the same distribution",
}
"""Statistic of a two-sample test -> what its values mean."""


@dataclass(frozen=True)
class Headline:
    """Content of `templates/headline.html`."""

    kind: str
    status: str
    title: str
    detail: str
    meaning: str
    records: str
    facts: Sequence[tuple[str, str]]
    warnings: Sequence[str]
    tests: Sequence[str]
    groups: str = ""


def headline(report: GapReport) -> Headline:
    """The headline of a report."""
    verdict, stated = report.verdict, report.provenance
    title, meaning = TITLES[verdict.status], meaning_of(report)
    facts = [("p-value of no gap", verdict.p_words.removeprefix("p ").removeprefix("= "))]
    if verdict.closure is not None:
        facts.append(("gap closed", closure(verdict.closure, verdict.closure_ci)))
    if report.closest.attribution:
        facts.append(("closest twin", closure(report.closest.closure, report.closest.closure_ci)))
    if (total := stated.get("n_records")) is not None:
        held_out = stated.get("n_held_out")
        facts.append(("records", f"{total}" + (f", evaluated on {held_out}" if held_out is not None else "")))
    tests = [f"{t.name}: {t.statistic:.4g}, {_p(t.p_value)}{_meaning(t.name)}" for t in report.tests]
    records = str(stated.get("records") or "records")
    meaning = " ".join(filter(None, (meaning, _closing(verdict))))
    groups = report.closest_sentence
    cautions = (*contradictions(report), *warnings(report))
    first, _, rest = report.sentence.partition(": ")
    # What is missing is the title; how much adding it closes and how sure that is follow in smaller type.
    main, detail = (f"{first}.", rest[:1].upper() + rest[1:]) if rest else (first, "")
    return Headline(verdict.status, title, main, detail, meaning, records, facts, cautions, tests, groups)


def _meaning(test: str) -> str:
    """What the values of a test's statistic mean."""
    return next((f" ({means})" for name, means in _STATISTICS.items() if name in test), "")


def _closing(verdict: Verdict) -> str:
    """Sentence on the closure: effects are named from the records, not from the closure."""
    if not verdict.effects:
        return ""
    if verdict.closure is None or verdict.closure_ci is None:
        return "They show in the records, but cannot be added to the simulated records."
    low, high = verdict.closure_ci
    if low > 0:
        return "They shrink the gap significantly."
    if high < 0:
        return "They show in the records, but at the values found they widen the gap: check the values."
    return "They show in the records; by how much they shrink the gap is uncertain."


def _p(value: float) -> str:
    """A p-value within a sentence."""
    shown = p_value(value)
    return f"p {shown}" if shown.startswith("≤") else f"p = {shown}"
