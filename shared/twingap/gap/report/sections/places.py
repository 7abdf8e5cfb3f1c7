"""The table of places that the sections on the gap and on its rest share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from twingap.gap.distance.domains import DOMAIN
from twingap.gap.report.advice import condition_words, place_words
from twingap.gap.report.formats import p_value
from twingap.gap.report.model import Place
from twingap.gap.report.sections.parts import Table

_SHOWN: Final = 12
"""Places that are listed at once."""


def places_table(places: Sequence[Place]) -> Table:
    """One row for each place, numbered as on the figures."""
    rows = [
        (
            str(i),
            DOMAIN[p.domain].label,
            "–"
            if p.domain == "condition" and p.lo is None and p.hi is None
            else place_words(replace(p, condition=None)),
            condition_words(p.condition) or "all",
            f"{100 * p.share:.0f} %",
            p_value(p.p_value),
        )
        for i, p in enumerate(places, 1)
    ]
    return Table(("#", "domain", "place", "conditions", "share", "p (adjusted)"), rows, _SHOWN, "places")
