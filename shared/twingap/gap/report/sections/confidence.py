"""Section "What the data do not distinguish": the confidence set."""

from __future__ import annotations

from typing import Final

from twingap.gap.report.grouped_sets import by_groups
from twingap.gap.report.model import GapReport, count_words, listed
from twingap.gap.report.sections.parts import Figures, Items, Section

_TITLE: Final = "What the data do not distinguish"
_SHOWN: Final = 8
"""Explanations that are listed at once."""


def section(report: GapReport, figures: Figures) -> Section | None:
    """The explanations that cannot be ruled out, most probable first."""
    sets = report.verdict.confidence_set
    if not sets:
        return None
    none = "no missing effect at all"
    if report.verdict.status != "no_gap":  # there is a gap, hence something is missing
        none = "no effect of the catalogue, but something outside it"
    words = [listed(effects) if effects else none for effects in sets]
    if len(sets) == 1:
        return Section(_TITLE, f"One explanation is left: {words[0]}. Every other one is ruled out at 90 %.")
    text = f"{count_words(len(sets)).capitalize()} explanations cannot be ruled out, most probable first; "
    text += "the true one is among them nine times of ten, effects too faint for records like these not counted. "
    if sure := [effect for effect in sets[0] if all(effect in s for s in sets)]:
        text += f"All of them hold {listed(sure)}. "
    grouped = by_groups(sets, {c.effect: c.probability for c in report.candidates})
    if len(grouped) == len(sets):  # each has groups of its own
        return Section(_TITLE, text, (Items(words, ordered=True, shown=_SHOWN, more="less probable ones"),))
    text += f"They come down to {count_words(len(grouped))}, effects that mimic each other taken together and "
    text += "hardly probable ones left out:"
    by_group = ["; ".join(map(str, one.choices)) or none for one in grouped]
    short = Items(by_group, ordered=True, shown=_SHOWN, more="less probable ones")
    return Section(_TITLE, text, (short, Items(words, ordered=True, shown=0, more="explanations one by one")))
