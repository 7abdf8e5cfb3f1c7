"""Named effects that close the gap only together: without any of them the others widen it."""

from __future__ import annotations

from twingap.gap.report.model import GapReport, listed


def only_together(report: GapReport) -> str:
    """One sentence where each of the named effects, left out, leaves a larger gap than no effect does, and all of them
    close it; else empty.

    Of two effects, leaving one out adds the other alone.
    """
    named = [c for c in report.candidates if c.effect in report.verdict.effects]
    if len(named) < 2 or not report.metrics or any(c.acts is not None for c in named):
        return ""
    gap = report.metrics[0]
    # Candidates are measured with fewer simulated records than the verdict: within its interval they are no larger.
    largest = gap.before if gap.ci_before is None else gap.ci_before[1]
    if gap.ci_after[1] >= gap.before or any(c.gap_before <= largest for c in named):
        return ""
    names = listed(c.effect for c in named)
    alone = "either of them alone widens it" if len(named) == 2 else "without any one of them the others widen it"
    return (
        f"{names[:1].upper()}{names[1:]} close the gap only together, from {gap.before:.3g} to {gap.after:.3g}: "
        f"{alone}, to {min(c.gap_before for c in named):.3g} or more."
    )
