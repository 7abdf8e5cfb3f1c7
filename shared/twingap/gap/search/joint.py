"""Values of many effects and of the baseline, fitted together by an evolution strategy.

values in steps of their errors --SepCMA: candidates--> simulated with common random numbers --misfit--> new candidates

With a dozen effects, values compensate for each other, and steps of single values stop in narrow valleys. Separable
CMA-ES (Ros & Hansen 2008, doi:10.1007/978-3-540-87700-4_30) needs few evaluations for many values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from cmaes import SepCMA

from twingap.effects import Effect
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.optimise import ValueSearch
from twingap.gap.search.parameter_prior import Key
from twingap.twins.simulator import Simulator, TwinSimulator

_SIGMA: Final = 1.0
"""First standard deviation of candidates, in steps. A larger value reaches farther and settles later."""
_PENALTY: Final = 10.0
"""Misfit of values with which no record can be simulated, times that of the start."""


def fitted_together(
    evidence: Evidence,
    simulator: Simulator,
    effects: Sequence[Effect],
    trials: int,
    progress: Callable[[float], None] = lambda part: None,
) -> tuple[Simulator, tuple[Effect, ...], float]:
    """The twin at the values that a joint search finds closest to the trial records, and its misfit.

    The search begins at the values of `effects` and takes at most `trials` simulations; where nothing is closer, the
    given ones are returned.
    """
    search = ValueSearch(evidence, simulator, tuple(effects), trials, {}, 0.0)
    search.gather_effects(effects, {})
    if isinstance(simulator, TwinSimulator):
        search.gather_baseline(simulator)
    search.gather_level()
    search.priors.clear()
    begin = search.initial_objective()
    keys = list(search.at)
    if len(keys) < 2:  # a single value is for a line search
        return simulator, tuple(effects), begin
    start, step = dict(search.at), search.step
    strategy = SepCMA(mean=np.zeros(len(keys)), sigma=_SIGMA, seed=evidence.root % 2**31)
    best, least = start, begin

    def values(place: np.ndarray) -> dict[Key, float]:
        out: dict[Key, float] = {}
        for key, steps in zip(keys, place, strict=True):
            value = start[key] + step[key] * float(steps)
            low, high = search.ends.get(key, (-math.inf, math.inf))
            value = min(max(value, min(low, start[key])), max(high, start[key]))
            out[key] = round(value) if key in search.integers else value
        return out

    while search.left > 0:
        found = []
        for _ in range(strategy.population_size):
            place = strategy.ask()
            at = values(place)
            misfit = min(search.misfit_at(at), _PENALTY * begin)
            found.append((place, misfit))
            if misfit < least:
                least, best = misfit, at
        if search.left > 0:
            strategy.tell(found)
        progress(1 - search.left / trials)
        if strategy.should_stop():
            break
    built = search.built(best)
    if built is None or least >= begin:
        return simulator, tuple(effects), begin
    return *built, least
