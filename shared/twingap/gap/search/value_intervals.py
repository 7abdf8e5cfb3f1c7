"""Intervals of the values of named effects, shortened to where the twin is not much farther from the records.

interval of the estimate --each end simulated--> misfit up to `FARTHER` times that of the fitted value: the end stays
                                                 else: bisected towards the fitted value

Intervals are those of estimates from features, before values are fitted to the machine's own records. Where the
records determine a value, as the place of a mode, a twin at the ends of the interval is far from them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from twingap.effects import Effect
from twingap.errors import TwingapError
from twingap.gap.search.effect_search import Estimated, Explanation
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.parameter_scale import to_number, to_value

FARTHER: Final = 2.0
"""Misfit over that of the fitted values from which a value is ruled out. A smaller value gives shorter intervals, which
hold the true value less often."""
_STEPS: Final = 4
"""Bisections of an end that is ruled out. More give shorter intervals and take a simulation each."""


def with_shorter_intervals(evidence: Evidence, found: Explanation) -> Explanation:
    """The explanation with intervals of the named effects that leave out what the records rule out.

    Other values stay as fitted while one is moved, so that a value for which others can compensate keeps its interval
    only in part; `FARTHER` allows for that.
    """
    if not found.gap or not found.after.effects:
        return found
    least = evidence.misfit(found.after.simulator, found.after.effects)
    at = {effect.name: effect for effect in found.after.effects}
    effects = tuple(
        _shortened(evidence, found, one, at[one.effect.name], FARTHER * least) if one.effect.name in at else one
        for one in found.effects
    )
    return replace(found, effects=effects)


def _shortened(evidence: Evidence, found: Explanation, one: Estimated, effect: Effect, limit: float) -> Estimated:
    """An effect with shorter intervals."""
    integers = {field.name for field in effect.parameters() if field.type in ("int", int, "bool", bool)}

    def ruled_out(parameter: str, number: float) -> bool:
        try:
            moved = effect.moved(**{parameter: to_value(effect.name, parameter, number, evidence.setting)})
            chain = tuple(moved if other.name == effect.name else other for other in found.after.effects)
            if not evidence.fits(moved):
                return False
            return evidence.misfit(evidence.with_values(found.after.simulator, chain), chain) > limit
        except TwingapError:  # invalid beside the other values
            return False

    intervals = dict(one.intervals)
    for parameter, ends in one.intervals.items():
        if parameter in integers:
            continue
        fitted = to_number(effect, parameter, evidence.setting)
        bounds = []
        for end in ends:
            try:
                out = to_number(effect.moved(**{parameter: end}), parameter, evidence.setting)
            except TwingapError:
                bounds.append(end)
                continue
            if out != fitted and ruled_out(parameter, out):
                inside = fitted
                for _ in range(_STEPS):
                    middle = 0.5 * (inside + out)
                    inside, out = (inside, middle) if ruled_out(parameter, middle) else (middle, out)
                end = to_value(effect.name, parameter, out, evidence.setting)
            bounds.append(end)
        intervals[parameter] = (bounds[0], bounds[1])
    return replace(one, intervals=intervals)
