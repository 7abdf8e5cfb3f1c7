"""The closest twin: effects that bring the twin closer to the records, whether or not the machine has them.

twin with the verdict's effects --try every other effect at several values--> the closest few --optimise values--+
        ^                                                                                                        |
        +---------------------- add the best one, as long as the distance of the fit part shrinks ---------------+

Real machines differ from a twin in much that no effect of the catalogue describes. Effects then stand in for something
else: `impact_scatter` for a load that varies, a noise band for unmodelled modes. So stand-ins are no part of the
verdict. What they close is measured on held-out records, as for any effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, zip_longest
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Effect, catalogue
from twingap.errors import TwingapError
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.search.effect_search import Explanation, estimate
from twingap.gap.search.evidence import Compared, Evidence, values_of
from twingap.gap.search.initial_values import observations
from twingap.gap.search.optimise import Nearest, bring_nearest, left_over
from twingap.gap.search.parameter_prior import Key, Said
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

MOST: Final = 5
"""Largest number of stand-ins. Each costs a round of the search."""
WORTH: Final = 0.98
"""Factor on the distance of the fit part that a stand-in has to reach. Closer to 1, more are added for less."""
_FINALISTS: Final = 3
"""Effects of each round whose values are optimised. More find better ones, and take longer."""
_KEPT: Final = 12
"""Best effects of one round that are tried in the next. Fewer are faster, and may miss some."""
_TRIES: Final = 2
"""Values that a round tries, as a multiple of what one search for values may. Fewer may end the search early."""


@dataclass(frozen=True)
class ClosestTwin:
    """The twin with stand-ins.

    Parameters
    ----------
    compared : Compared
        The records against it, with all effects.
    added : tuple of str
        Effects beyond the verdict's, in the order in which they were added.
    """

    compared: Compared
    added: tuple[str, ...]


def stand_ins(
    evidence: Evidence, found: Explanation, learnt: Learnt, progress: Progress = lambda what, part: None
) -> ClosestTwin | None:
    """Add effects to the verdict's, one after the other, that bring the twin closest to the fit part.

    Parameters
    ----------
    evidence : Evidence
    found : Explanation
    learnt : Learnt
        Gives values to begin at.
    progress : callable
        Called with what is done and the part that is done.

    Returns
    -------
    ClosestTwin or None
        None where nothing brings the twin closer.
    """
    said = {key: one for value in found.effects for key, one in value.said.items()}
    now, added = found.after, tuple[str, ...]()
    left = left_over(evidence, now.simulator, now.effects)
    names = [n for n in catalogue() if n not in {*evidence.modelled, *found.cannot, *found.names}]
    while names and len(added) < MOST:
        progress(f"stand-ins: {', '.join(added) or 'none yet'}", len(added) / MOST)
        ranked = _ranked(evidence, now, names, learnt)
        if not ranked:
            break
        moved = [(name, _moved(evidence, now, effect, learnt.errors, said)) for name, effect in ranked[:_FINALISTS]]
        tried = [(left_over(evidence, one.simulator, one.effects), name, one) for name, one in moved]
        least, name, one = min(tried, key=lambda row: row[0])
        if least >= WORTH * left:
            break
        again = bring_nearest(evidence, one.simulator, one.effects, learnt.errors, passes=1, said=said)
        closer = left_over(evidence, again.simulator, again.effects)
        one, left = (again, closer) if closer < least else (one, least)
        now, added = Compared(evidence, one.effects, one.simulator), (*added, name)
        names = [other for other, _ in ranked[:_KEPT] if other != name]
    return ClosestTwin(now, added) if added else None


def closest_spec(compared: Compared) -> TwinSpec | None:
    """The twin file of a twin with these effects at these values; None for a simulator that has no such file."""
    if not isinstance(compared.simulator, TwinSimulator):
        return None
    spec = compared.simulator.spec
    names = dict.fromkeys((*spec.effects, *(effect.name for effect in compared.effects)))
    values = {**spec.parameters, **{effect.name: values_of(effect) for effect in compared.effects}}
    return replace(spec, effects=tuple(names), parameters=values)


def _moved(
    evidence: Evidence, now: Compared, effect: Effect, errors: Mapping[Key, float], said: Mapping[Key, Said]
) -> Nearest:
    """One more effect, its values optimised together with the twin's own."""
    return bring_nearest(
        evidence, now.simulator, (*now.effects, effect), errors, moved=[effect.name], passes=1, said=said
    )


def _ranked(evidence: Evidence, now: Compared, names: Sequence[str], learnt: Learnt) -> list[tuple[str, Effect]]:
    """Each effect at its best values, the closest effect first.

    All are tried at one value before any is at two: large records or a contact twin leave time for no more.
    """
    features = now.fit
    values = (list(_values(name, features, evidence, learnt)) for name in names)
    in_turn = (effect for turn in zip_longest(*values) for effect in turn if effect is not None)
    best: dict[str, tuple[float, Effect]] = {}
    for effect in islice(filter(evidence.fits, in_turn), _TRIES * evidence.trials):
        try:
            misfit = evidence.misfit(now.simulator, (*now.effects, effect))
        except TwingapError:  # at these values it cannot act on one of the records
            continue
        if effect.name not in best or misfit < best[effect.name][0]:
            best[effect.name] = misfit, effect
    return [(name, effect) for name, (_, effect) in sorted(best.items(), key=lambda row: row[1][0])]


def _values(name: str, features: Array, evidence: Evidence, learnt: Learnt) -> Iterator[Effect]:
    """Values that an effect may have, the more probable first."""
    given = estimate(name, features, evidence, learnt).effect
    seen = observations(evidence, features)
    yield given
    yield from given.spectral_values(seen)
    yield from given.weaker()
    yield from given.initial_values(seen)
