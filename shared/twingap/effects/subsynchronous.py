"""Subsynchronous line of a set of records: whether they share one, whether the twin has it, what it cannot be."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from twingap.effects.observations import Observations

_SHARE: Final = 0.5
"""Part of the records of every state that have to show a line. A smaller value finds more, and cages of defects."""
_LEVEL: Final = 4.0
"""Least ln of its power over that of noise. A smaller value finds fainter lines, and more by chance."""
_APART: Final = 0.015
"""Distance in orders from which two lines are different ones, if it exceeds the error of the order."""
_ERRORS: Final = 4.0
"""The same in standard errors of the order."""


class Line(NamedTuple):
    """A line below the shaft's order."""

    order: float
    error: float  # standard error of the order

    def is_at(self, order: float) -> bool:
        """Whether the line may be at this order."""
        return abs(self.order - order) <= max(_APART, _ERRORS * self.error)


def shared_line(seen: Observations) -> Line | None:
    """The line below the shaft's order that the records of every state show, if any."""
    return _line(seen, "", _SHARE, _LEVEL)


def lacking_line(seen: Observations) -> Line | None:
    """The same where the twin, with what was added to it, does not have it."""
    line, theirs = shared_line(seen), _line(seen, ".diff", 0.5 * _SHARE, 0.5 * _LEVEL)
    if line is None or (theirs is not None and line.is_at(theirs.order)):
        return None
    return line


def _line(seen: Observations, twin: str, share: float, level: float) -> Line | None:
    """Line of the records, or with `twin` that of the twin, if it is in this share of records and this strong."""
    named = {}
    for part in ("order", "error", "share", "level"):
        value = seen.features.get(f"pooled|below_{part}", math.nan)
        named[part] = value - seen.features.get(f"pooled|below_{part}{twin}", math.nan) if twin else value
    if not (named["share"] >= share and named["level"] >= level):
        return None
    return Line(named["order"], named["error"])
