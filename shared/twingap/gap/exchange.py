"""Whether a simulator of the user's own differs from the machine by more than one recording does from the next.

pairs: a record, and what is simulated for it --all of a group change sides, or none--> features --> scores
rank of the scores as they are among those --> p-value

Machines that the null was learnt from have recordings that are alike but for chance. Real ones were mounted anew, wear
on, have defects of several sizes: one half of them against the other looks like a gap to whoever has not seen that.
Without a gap a record and the one simulated for it might change sides, whatever recordings are like; nothing else is
assumed (randomisation test, groups of random sign flips: Hemerik and Goeman 2018, doi:10.1007/s11749-017-0571-1). It
sees less than the learnt null does: what half of the records have as well is no news. So it is asked of gaps that no
single effect explains for sure.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap import comparison, whole
from twingap.gap.comparison import Measured
from twingap.gap.training.null import DISTANCE
from twingap.gap.views import Grid

if TYPE_CHECKING:
    from twingap.gap.evidence import Evidence
    from twingap.gap.training.learn import Learnt
    from twingap.records import Condition

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

EXCHANGES: Final = 79
"""Of three scores the rarest counts: with fewer draws no p-value of 0.05 could come."""
_FIRST: Final = 19
"""After so many it is looked whether more can change anything."""
_HOPELESS: Final = 0.4
"""P-value among the first from which one of 0.05 hardly comes any more."""
FEWEST_GROUPS: Final = 6
"""Of fewer groups no more than 32 exchanges can be told apart."""


def exchange_p(evidence: Evidence, learnt: Learnt, draws: int = EXCHANGES) -> float | None:
    """P-value of no difference beyond that between recordings.

    Parameters
    ----------
    evidence : Evidence
        Of a simulator of the user's own: it has a record for each of the machine's.
    learnt : Learnt
    draws : int
        Random exchanges, each about a fifth of a second for two dozen records.

    Returns
    -------
    float or None
        None where the records are of fewer than `FEWEST_GROUPS` groups.
    """
    real = evidence.parts
    groups = list(dict.fromkeys(_group(c) for part in real for c in part.conditions))
    if len(groups) < FEWEST_GROUPS:
        return None
    simulator = evidence.against().simulator
    made = tuple(
        comparison.measure(
            evidence.simulated(simulator, (), part.conditions, number),
            evidence.frame,
            Grid.of(part.conditions, evidence.frame.bearing),
        )
        for number, part in enumerate(real)
    )
    rng = np.random.default_rng([evidence.root, len(groups)])
    scores = [_scores(evidence, learnt, real, made)]
    for draw in range(draws):
        turned = dict(zip(groups, rng.random(len(groups)) < 0.5, strict=True))
        swaps = [np.array([turned[_group(c)] for c in part.conditions]) for part in real]
        sides = [(_mixed(a, b, s), _mixed(b, a, s)) for a, b, s in zip(real, made, swaps, strict=True)]
        ours, theirs = zip(*sides, strict=True)
        scores.append(_scores(evidence, learnt, ours, theirs))
        if draw + 1 == _FIRST and (so_far := _rank(np.array(scores))) >= _HOPELESS:
            return so_far
    return _rank(np.array(scores))


def _group(condition: Condition) -> str:
    return condition.group or condition.name


def _mixed(own: Measured, other: Measured, swap: Mask) -> Measured:
    """The records of the one side, where not swapped, and of the other."""
    outlines = tuple(theirs if s else ours for ours, theirs, s in zip(own.outlines, other.outlines, swap, strict=True))
    values = {
        domain: np.where(swap[:, None], other.views.values[domain], ours) for domain, ours in own.views.values.items()
    }
    return Measured(np.where(swap[:, None], other.values, own.values), outlines, replace(own.views, values=values))


def _scores(
    evidence: Evidence, learnt: Learnt, real: tuple[Measured, ...], made: tuple[Measured, ...]
) -> tuple[float, float, float]:
    """How much like a gap: by the learnt null, by all detectors together, by the distance. Parts: fit, held out."""
    ours, theirs = (evidence.together(*(part.outlines for part in side)) for side in (real, made))
    of_whole = whole.compare(ours, theirs, whole.levels(ours, theirs))
    features = comparison.compare(
        real[1], made[1], evidence.calibrated.speeds, of_whole, own=True, models=bool(evidence.modelled)
    )
    odds = learnt.log_odds(features)[0]
    asked = [odd for name, odd in zip(learnt.effects, odds, strict=True) if name not in evidence.modelled]
    distance = features[learnt.features.index(DISTANCE)]
    return -learnt.p_value(features, evidence.modelled), float(np.logaddexp(0, asked).sum()), float(distance)


def _rank(scores: Array) -> float:
    """Part of all draws, the first among them, whose rarest score is as rare as the first one's."""
    rarity = (scores[None] >= scores[:, None]).mean(axis=1)
    least = rarity.min(axis=1)
    return float((least <= least[0]).mean())
