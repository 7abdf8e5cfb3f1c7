"""Subsynchronous line of a set of records: whether they share one, and whether the twin has it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from twingap.effects.observations import Observations

_SHARE: Final = 0.5
"""Part of the records of every state that have to show a line. A smaller value finds more, and cages of defects."""
_LEVEL: Final = 4.0
"""Least ln of its power over its floor. A smaller value finds fainter lines, and more by chance."""
_APART: Final = 0.015
"""Distance in orders from which two lines are different ones. A larger value takes a whirl for a loose part's line."""
_ERRORS: Final = 4.0
"""The same in standard errors of the order; the larger of both counts. A larger value does the same."""
_CAGE: Final = 0.04
"""Relative distance from the order of the cage within which a line of faulty records may be the cage's. A larger value
leaves out more lines where no record is healthy."""


class Line(NamedTuple):
    """A line below the shaft's order."""

    order: float
    error: float  # standard error of the order

    def is_at(self, order: float, error: float = 0.0) -> bool:
        """Whether the line may be at this order, of this standard error."""
        return abs(self.order - order) <= max(_APART, _ERRORS * math.hypot(self.error, error))


def shared_line(seen: Observations) -> Line | None:
    """The line below the shaft's order that most records of every state show, if any.

    Where no record is healthy, a line at the order of the cage is the bearing's own.
    """
    line = _line(seen, "", _SHARE, _LEVEL)
    if line is not None and not seen.features.get("context|healthy_share", 1.0) > 0:
        return None if abs(line.order / seen.bearing.ftf - 1) < _CAGE else line
    return line


def lacking_line(seen: Observations) -> Line | None:
    """The same where the twin, with what was added to it, does not have it."""
    line, theirs = shared_line(seen), _line(seen, ".diff", 0.5 * _SHARE, 0.5 * _LEVEL)
    if line is None or (theirs is not None and line.is_at(theirs.order, theirs.error)):
        return None
    return line


def _line(seen: Observations, suffix: str, share: float, level: float) -> Line | None:
    """Line of the records, or with the suffix ".diff" of the twin, where so many have it and it is so strong."""
    named = {}
    for part in ("order", "error", "share", "level"):
        value = seen.features.get(f"pooled|below_{part}", math.nan)
        named[part] = value - seen.features.get(f"pooled|below_{part}{suffix}", math.nan) if suffix else value
    if not (named["share"] >= share and named["level"] >= level):
        return None
    return Line(named["order"], named["error"])
