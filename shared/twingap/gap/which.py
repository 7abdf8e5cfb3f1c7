"""Which effects the twin lacks: proposed by what was learnt, checked by adding them and looking again.

features --detectors--> effects that seem missing --estimators--> values --add, recalibrate, simulate--> look again
   ^                                                                                                        |
   +------------------- more seem missing? one left out: is it missed? something left over? ----------------+

Every decision reads the held-out part; values are estimated from the fit part.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Effect, catalogue
from twingap.gap.evidence import Compared, Evidence
from twingap.gap.training.learn import Learnt
from twingap.gap.training.parameters import coordinates, to_effect, to_number, to_value

Array = NDArray[np.float64]
Report = Callable[[str, float], None]

ROUNDS: Final = 3
ALPHA: Final = 0.03
"""Level at which a gap is called one, a little below the 5 % that it promises on machines nobody has seen."""
ALPHA_REST: Final = 0.06
MOST_EFFECTS: Final = 7
_UNCERTAIN: Final = 0.015


@dataclass(frozen=True)
class Estimated:
    """An effect at the values that the records suggest.

    Parameters
    ----------
    effect : Effect
    intervals : Mapping[str, (float, float)]
        90 % intervals of its parameters, in their units.
    """

    effect: Effect
    intervals: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Explanation:
    """What a search found.

    Parameters
    ----------
    p_value : float
        Of no gap at all.
    gap : bool
        Whether a gap was called.
    effects : tuple of Estimated
        Named as missing, most certain first.
    probability : Mapping[str, float]
        Of every catalogued effect.
    confidence_set : tuple of tuple of str
        Sets of effects that the data cannot tell apart, most probable first.
    rest_p : float
        Of nothing left over once the effects are added.
    before, after : Compared
        The twin as given, and with the named effects (those that it can have).
    cannot : Mapping[str, str]
        Effects that the simulator cannot have, and why.
    """

    p_value: float
    gap: bool
    effects: tuple[Estimated, ...]
    probability: Mapping[str, float]
    confidence_set: tuple[tuple[str, ...], ...]
    rest_p: float
    before: Compared
    after: Compared
    cannot: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the named effects."""
        return tuple(found.effect.name for found in self.effects)


def explain(evidence: Evidence, learnt: Learnt, report: Report) -> Explanation:
    """Search for the effects that the twin lacks.

    Parameters
    ----------
    evidence : Evidence
    learnt : Learnt
    report : callable
        Told of progress.
    """
    cannot = {n: why for n in catalogue() if (why := evidence.can_add(n)) is not None}
    already = set(evidence.modelled)
    report("the twin as given", 0.0)
    before = evidence.against()
    first = _odds(learnt, before.held_out, already)
    p_value = learnt.p_value(before.held_out)
    limit = {name: learnt.thresholds.get(name, 0.0) for name in first}
    chosen = [name for name in _strongest(first) if first[name] > limit[name]][:MOST_EFFECTS]
    values = {name: estimate(name, before.fit, evidence, learnt) for name in chosen}
    after, odds = before, first
    for turn in range(ROUNDS):
        report("effects added", 0.2 + 0.2 * turn)
        added = [values[name].effect for name in chosen if name not in cannot]
        after = evidence.against(added)
        odds = _odds(learnt, after.held_out, already)
        more = [n for n in _strongest(odds) if n not in values and odds[n] > limit[n] + 0.7 * (turn > 0)]
        # What was thrown out once stays out, or the search would go in circles.
        more = more[: MOST_EFFECTS - len(chosen)]
        if more:
            values |= {name: estimate(name, after.fit, evidence, learnt) for name in more}
            chosen += more
            continue
        missed = _missed(chosen, values, cannot, evidence, learnt, already)
        kept = [name for name in chosen if missed.get(name, first[name]) > limit[name] - 0.5]
        if kept == chosen:
            break
        chosen = kept
    else:
        missed = _missed(chosen, values, cannot, evidence, learnt, already)
        added = [values[name].effect for name in chosen if name not in cannot]
        after = evidence.against(added)
        odds = _odds(learnt, after.held_out, already)
    report("confidence", 0.9)
    certain = {name: missed.get(name, first[name]) for name in chosen}
    final = {name: certain.get(name, min(odds[name], first[name] + 2.0)) for name in first}
    probability = {name: _probability(value) for name, value in final.items()} | dict.fromkeys(already, 0.0)
    gap = p_value <= ALPHA
    rest_p = learnt.rest_p(after.held_out) if chosen else p_value
    ordered = sorted(chosen, key=lambda name: -(certain[name] + first[name]))
    sets = confidence_set(probability, learnt.set_level)
    if not gap:
        ordered, sets = [], _with(sets, ())
    return Explanation(
        p_value, gap, tuple(values[name] for name in ordered), probability, sets, rest_p, before, after, cannot
    )


def estimate(name: str, features: Array, evidence: Evidence, learnt: Learnt) -> Estimated:
    """An effect's values from the features of the fit part, with 90 % intervals."""
    setting = evidence.setting
    default = catalogue()[name]()
    numbers, intervals = {}, {}
    for effect, parameter in coordinates():
        if effect != name:
            continue
        found = learnt.estimators.get((name, parameter))
        if found is None:
            numbers[parameter] = to_number(default, parameter, setting)
            continue
        number = float(found.estimate(features[None, :])[0])
        numbers[parameter] = number
        ends = [to_value(name, parameter, number + sign * found.error, setting) for sign in (-1, 1)]
        intervals[parameter] = (min(ends), max(ends))
    return Estimated(to_effect(name, numbers, setting), intervals)


def confidence_set(probability: Mapping[str, float], level: float) -> tuple[tuple[str, ...], ...]:
    """The most probable sets of effects that together reach `level`, effects taken one by one as independent.

    Parameters
    ----------
    probability : Mapping[str, float]
        That each effect is missing.
    level : float
        Raised above 90 % by as much as machines not learnt from asked for.
    """
    sure = [name for name, p in probability.items() if p >= 1 - _UNCERTAIN]
    open_ = sorted(
        (name for name, p in probability.items() if _UNCERTAIN < p < 1 - _UNCERTAIN),
        key=lambda name: abs(probability[name] - 0.5),
    )[:9]
    sure += [name for name, p in probability.items() if 0.5 <= p < 1 - _UNCERTAIN and name not in open_]
    weighed = []
    for picks in itertools.product((False, True), repeat=len(open_)):
        weight = math.prod(probability[n] if pick else 1 - probability[n] for n, pick in zip(open_, picks, strict=True))
        weighed.append((weight, [n for n, pick in zip(open_, picks, strict=True) if pick]))
    weighed.sort(key=lambda item: -item[0])
    out, reached = [], 0.0
    for weight, names in weighed:
        out.append(tuple(sorted((*sure, *names), key=lambda n: -probability[n])))
        reached += weight
        if reached >= level:
            break
    return tuple(out)


def _missed(
    chosen: Sequence[str], values: Mapping[str, Estimated], cannot: Mapping[str, str], evidence: Evidence,
    learnt: Learnt, already: set[str],
) -> dict[str, float]:  # fmt: skip
    """Log odds of each chosen effect when all others are in the twin and it alone is not."""
    out = {}
    for name in chosen:
        others = [values[n].effect for n in chosen if n != name and n not in cannot]
        out[name] = _odds(learnt, evidence.against(others).held_out, already)[name]
    return out


def _odds(learnt: Learnt, features: Array, already: set[str]) -> dict[str, float]:
    """Log odds that the twin lacks each effect; what it has already cannot be missing."""
    found = learnt.log_odds(features)[0]
    return {name: float(value) for name, value in zip(learnt.effects, found, strict=True) if name not in already}


def _strongest(odds: Mapping[str, float]) -> list[str]:
    return sorted(odds, key=lambda name: -odds[name])


def _probability(log_odds: float) -> float:
    return 1 / (1 + math.exp(-max(min(log_odds, 30.0), -30.0)))


def _with(sets: tuple[tuple[str, ...], ...], one: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """The sets with this one among them, first."""
    return (one, *(s for s in sets if s != one))
