"""The table of places that the sections on the gap and on its rest share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from twingap.gap.distance.domains import DOMAIN
from twingap.gap.report.advice import condition_words, place_words
from twingap.gap.report.formats import p_value
from twingap.gap.report.model import Place
from twingap.gap.report.sections.parts import Table

_SHOWN: Final = 12
"""Places that are listed at once."""
_SIGNS: Final[Mapping[str, str]] = {"records_higher": "records", "twin_higher": "twin", "shape": "parts of each"}


def places_table(places: Sequence[Place]) -> Table:
    """One row for each place, numbered as on the figures."""
    rows = []
    for i, p in enumerate(places, 1):
        everywhere = p.domain == "condition" and p.lo is None and p.hi is None
        where = "–" if everywhere else place_words(replace(p, condition=None))
        share, significance = f"{100 * p.share:.0f} %", p_value(p.p_value)
        conditions, sign = condition_words(p.condition) or "all", _SIGNS.get(p.sign or "", "–")
        rows.append((str(i), DOMAIN[p.domain].label, where, conditions, sign, share, significance, p.after or "–"))
    head = ("#", "domain", "place", "conditions", "more in", "share", "p (adjusted)", "with the effects")
    keep = len(head) - (not any(p.after for p in places))
    return Table(head[:keep], [row[:keep] for row in rows], _SHOWN, "places")
