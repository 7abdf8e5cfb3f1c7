"""Spread of the delays of a measured path.

twin with a path --some spreads, each simulated--> misfits --smallest, and beside it--> twin with that spread

Spectra show the gain of a path and not its phase. How far it spreads impacts shows in their kurtosis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from twingap.effects import Effect, TransferPath
from twingap.effects.by_state import ByState, by_state
from twingap.effects.transfer_path import delay_spread_s
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.free_spectra import PATH, Chain
from twingap.twins.simulator import Simulator

SPREADS_S: Final = (0.0, 0.001, 0.003, 0.009)
"""Spreads that are tried. More of them take a simulation of the trial records each."""
_BESIDE: Final = (0.6, 1.6)
"""Factors on the best of them that are tried in turn. Closer to 1, the spread is found more exactly."""
_CLEARLY: Final = 0.98
"""Factor on the misfit below which another spread replaces the present one. Closer to 1, chance decides more often."""


def with_delays(evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]) -> tuple[Simulator, Chain]:
    """The twin with that spread of its path's delays that brings it closest to the trial records; as given without a
    path."""
    best = tuple(effects)
    path = next((effect for effect in best if effect.name == PATH), None)
    if path is None:
        return simulator, best
    tried = {delay_spread_s(path): evidence.misfit(simulator, best)}

    def spread_by(spread_s: float) -> Chain:
        return tuple(_spread(effect, spread_s) if effect is path else effect for effect in effects)

    def nearest() -> float:
        return min(tried, key=lambda spread_s: tried[spread_s])

    for spread_s in SPREADS_S:
        if spread_s not in tried:
            tried[spread_s] = evidence.misfit(simulator, spread_by(spread_s))
    for spread_s in [factor * nearest() for factor in _BESIDE if nearest()]:
        tried[spread_s] = evidence.misfit(simulator, spread_by(spread_s))
    clearly = tried[nearest()] < _CLEARLY * tried[delay_spread_s(path)]
    return simulator, spread_by(nearest()) if clearly else best


def _spread(path: Effect, spread_s: float) -> Effect:
    """The path, in all its states, with another spread."""
    if isinstance(path, ByState):
        return by_state(_spread(path.base, spread_s), {state: _spread(own, spread_s) for state, own in path.states})
    assert isinstance(path, TransferPath)
    return replace(path, delay_spread_s=spread_s)
