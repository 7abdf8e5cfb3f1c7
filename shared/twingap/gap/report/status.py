"""Status of a verdict: its titles, and why it is what it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from twingap.gap.report.model import GapReport

AT_FLOOR: Final = 0.9
"""Closure from which a gap is explained, whatever remains. A larger value leaves more gaps partly explained."""
MOST: Final = 0.7
"""Closure that the upper end of its interval has to reach for a gap without a significant rest to be explained. A
larger value leaves more gaps partly explained whose effects are right and whose values are not."""
LEAST_CEILING: Final = 0.5
"""Closure by real records below which they are no measure of what a twin can close: they differ as much as the twin."""
TITLES: Final[Mapping[str, str]] = {
    "no_gap": "No gap",
    "explained": "Gap explained",
    "partly_explained": "Gap partly explained",
    "unexplained": "Gap unexplained",
}


def meaning_of(report: GapReport) -> str:
    """What the status of a verdict means, with the reason that holds for this one."""
    verdict, replayed = report.verdict, report.closest.ceiling.same_unit
    if verdict.status == "no_gap":
        return "No gap beyond chance was found."
    if verdict.status == "unexplained":
        return "There is a significant gap, and no effect of the catalogue is certain enough to be named."
    left = "no more of the gap is left than values that are a little off leave"
    if verdict.status == "partly_explained":
        much = verdict.closure_ci is None or verdict.closure_ci[1] < MOST
        left = (
            f"at least {100 * (1 - MOST):.0f} % of the gap is left"
            if much
            else "more is left than values that are a little off leave"
        )
        return f"Once the named effects are added, {left}."
    if verdict.closure is not None and verdict.closure >= AT_FLOOR:
        left = "at most a tenth of the gap is left"
    elif verdict.closure is not None and replayed is not None and verdict.closure >= replayed >= LEAST_CEILING:
        left = "no more of the gap is left than real records in place of the twin leave"
    elif verdict.closure_ci is not None and verdict.closure_ci[1] < MOST:
        left = "the test for a rest finds none, and effects as faint as these hardly change the distance"
    return f"Nothing points to a further effect: once the named ones are added, {left}."
