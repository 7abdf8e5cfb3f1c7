"""Surrogate effects: effects that reduce the rest, whether or not the machine has them.

twin with the verdict's effects --try every other effect at several values--> the best few --optimise values--+
        ^                                                                                                     |
        +-------------------- add the best one, while the distance of the fit part decreases -----------------+

Real machines differ from a twin in ways that no effect of the catalogue describes. An effect can then act as a
surrogate for another cause: `impact_scatter` for a varying load, a noise band for unmodelled modes. Surrogates are
therefore not part of the verdict. Their closure is measured on held-out records, as for any effect.
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
from twingap.gap.search.evidence import Compared, Evidence
from twingap.gap.search.initial_values import observations
from twingap.gap.search.optimise import Optimised, optimise, validation_distance
from twingap.gap.search.parameter_prior import Key, Prior
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

MOST: Final = 5
"""Largest number of surrogate effects. Each costs one round of the search."""
WORTH: Final = 0.98
"""Factor on the distance of the fit part that a surrogate has to reach. Closer to 1, more are added for a smaller
gain."""
_FINALISTS: Final = 3
"""Effects of each round whose values are optimised. A larger number finds better surrogates and takes longer."""
_KEPT: Final = 12
"""Best effects of a round that are tried in the next one. A smaller number is faster and may miss some."""
_TRIES: Final = 2
"""Trials of a round, as a multiple of those of one search for values. A smaller number may end the search early."""


@dataclass(frozen=True)
class ClosestTwin:
    """The twin with surrogate effects.

    Parameters
    ----------
    compared : Compared
        Comparison of the records with this twin, the verdict's effects included.
    added : tuple of str
        Names of the surrogate effects, in the order in which they were added.
    """

    compared: Compared
    added: tuple[str, ...]


def surrogate_effects(
    evidence: Evidence, found: Explanation, learnt: Learnt, progress: Progress = lambda what, part: None
) -> ClosestTwin | None:
    """Surrogate effects, added one by one to the verdict's, that bring the twin closest to the fit part.

    Parameters
    ----------
    evidence : Evidence
    found : Explanation
        Result of the search; its effects are kept.
    learnt : Learnt
        Estimators that give the initial values.
    progress : callable
        Called with a description of the current step and the completed part, 0 to 1.

    Returns
    -------
    ClosestTwin or None
        None where no effect brings the twin closer.
    """
    priors = {key: one for value in found.effects for key, one in value.priors.items()}
    now, added = found.after, tuple[str, ...]()
    left = validation_distance(evidence, now.simulator, now.effects)
    names = [n for n in catalogue() if n not in {*evidence.modelled, *found.cannot, *found.names}]
    while names and len(added) < MOST:
        progress(f"surrogate effects: {', '.join(added) or 'none yet'}", len(added) / MOST)
        ranked = _ranked(evidence, now, names, learnt)
        if not ranked:
            break
        moved = [
            (name, _optimised(evidence, now, effect, learnt.errors, priors)) for name, effect in ranked[:_FINALISTS]
        ]
        tried = [(validation_distance(evidence, one.simulator, one.effects), name, one) for name, one in moved]
        least, name, one = min(tried, key=lambda row: row[0])
        if least >= WORTH * left:
            break
        again = optimise(evidence, one.simulator, one.effects, learnt.errors, passes=1, priors=priors)
        closer = validation_distance(evidence, again.simulator, again.effects)
        one, left = (again, closer) if closer < least else (one, least)
        now, added = Compared(evidence, one.effects, one.simulator), (*added, name)
        names = [other for other, _ in ranked[:_KEPT] if other != name]
    return ClosestTwin(now, added) if added else None


def closest_spec(compared: Compared) -> TwinSpec | None:
    """Twin file of a twin with these effects and values.

    Returns
    -------
    TwinSpec or None
        None for a simulator without a twin file.
    """
    if not isinstance(compared.simulator, TwinSimulator):
        return None
    spec = compared.simulator.spec
    names = dict.fromkeys((*spec.effects, *(effect.name for effect in compared.effects)))
    values = {**spec.parameters, **{effect.name: effect.parameter_values() for effect in compared.effects}}
    return replace(spec, effects=tuple(names), parameters=values)


def _optimised(
    evidence: Evidence, now: Compared, effect: Effect, errors: Mapping[Key, float], priors: Mapping[Key, Prior]
) -> Optimised:
    """The twin with one more effect, its values optimised together with the twin's own."""
    return optimise(
        evidence, now.simulator, (*now.effects, effect), errors, moved=[effect.name], passes=1, priors=priors
    )


def _ranked(evidence: Evidence, now: Compared, names: Sequence[str], learnt: Learnt) -> list[tuple[str, Effect]]:
    """Effects, each at its best values, in order of increasing misfit.

    All effects are tried at one value before any is tried at a second: with large records or a contact twin the number
    of trials is small.
    """
    features = now.fit
    values = (list(_values(name, features, evidence, learnt)) for name in names)
    in_turn = (effect for turn in zip_longest(*values) for effect in turn if effect is not None)
    best: dict[str, tuple[float, Effect]] = {}
    for effect in islice(filter(evidence.fits, in_turn), _TRIES * evidence.trials):
        try:
            misfit = evidence.misfit(now.simulator, (*now.effects, effect))
        except TwingapError:  # at these values the effect cannot act on one of the records
            continue
        if effect.name not in best or misfit < best[effect.name][0]:
            best[effect.name] = misfit, effect
    return [(name, effect) for name, (_, effect) in sorted(best.items(), key=lambda row: row[1][0])]


def _values(name: str, features: Array, evidence: Evidence, learnt: Learnt) -> Iterator[Effect]:
    """Candidate values of an effect, the most probable first."""
    given = estimate(name, features, evidence, learnt).effect
    seen = observations(evidence, features)
    yield given
    yield from given.spectral_values(seen)
    yield from given.weaker()
    yield from given.initial_values(seen)
