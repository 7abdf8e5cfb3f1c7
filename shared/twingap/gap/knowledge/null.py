"""What machines without a gap look like, to rank others among: p-values of no gap at all.

scores of detectors, distance --of machines without a gap--> Null --rank of a new machine's rarest--> p-value
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

RECORDS: Final = "context|records"
"""Feature that says how many records were compared (its logarithm)."""
OWN: Final = "context|own_simulator"
"""Feature that says whether the simulator is the machine's own."""
MODELS: Final = "context|models"
"""Feature that says whether the twin has effects as given."""
BARE, OWN_SIMULATOR, WITH_EFFECTS = 0.0, 1.0, 2.0
"""What a machine is met through: the baseline twin, its own simulator, or a twin that has effects."""
DISTANCE: Final = "view|overall"
"""Feature that says how far records and twin lie apart, whatever the cause."""
HEALTHY: Final = "context|healthy_share"
"""Feature that says what part of the records is healthy."""

_NEAR_RECORDS: Final = 0.35
_FEWEST_NEAR: Final = 150.0
"""Machines, by weight, to rank among: of 60 the rarest is one in sixty, and of three scores none is rare then."""
_FEWEST_ALIKE: Final = 60
"""Machines of a kind below which those of a wider kind count too."""


def _told(features: NDArray[Any], names: tuple[str, ...], name: str, otherwise: float = 0.0) -> Array:
    """[examples] A feature of this name; `otherwise` where there is none."""
    rows = np.atleast_2d(features)
    return np.asarray(rows[:, names.index(name)] if name in names else np.full(len(rows), otherwise), float)


@dataclass(frozen=True)
class MachineScores:
    """What is known of machines that are to be told from those without a gap.

    Parameters
    ----------
    scores : Array [machines, scores]
        How surely detectors hear something.
    records : Array [machines]
        Log number of records that each is judged by.
    distance : Array [machines]
        Between records and twin, whatever detectors make of it; NaN where it is not known.
    kind : Array [machines]
        `BARE`, `OWN_SIMULATOR` (nothing had to be matched, and small distances mean more) or `WITH_EFFECTS` (which the
        machine may have in another form).
    quiet : Mask [machines]
        Whether some of their records are healthy: without any, noise has to be told from impacts, and calibration is
        further off.
    """

    scores: Array
    records: Array
    distance: Array
    kind: Array
    quiet: Mask

    @classmethod
    def of(cls, scores: Array, features: NDArray[Any], names: tuple[str, ...]) -> MachineScores:
        """Machines of these scores and features."""
        own, models = _told(features, names, OWN) > 0, _told(features, names, MODELS) > 0
        kind = np.select([own, models], [OWN_SIMULATOR, WITH_EFFECTS], BARE)
        quiet = _told(features, names, HEALTHY, 1.0) > 0
        return cls(scores, _told(features, names, RECORDS), _told(features, names, DISTANCE, np.nan), kind, quiet)

    def take(self, rows: Mask) -> MachineScores:
        """Some of the machines."""
        return MachineScores(
            self.scores[rows], self.records[rows], self.distance[rows], self.kind[rows], self.quiet[rows]
        )

    def __len__(self) -> int:
        return len(self.scores)


NO_MACHINES: Final = MachineScores(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool))


@dataclass(frozen=True)
class Null:
    """Machines without a gap.

    Few records look like a gap more often, so a score is ranked among machines with about as many: a machine counts
    the less the further its number lies off (a localised conformal p-value; Guan 2023, doi:10.1093/biomet/asac040).
    A twin is never quite the machine, its own simulator may be, what a twin models the machine may have otherwise, and
    without a healthy record calibration is further off: each kind is ranked among its like, so that none pays for
    another's unlikeness (Mondrian conformal prediction; Vovk, Gammerman and Shafer 2005, ch. 4.5).
    Of several scores the one that is rarest among these machines counts, and how rare it is, is ranked among how rare
    theirs are (minimum p: Westfall and Young, Resampling-based multiple testing, 1993). The distance is one of the
    scores, ranked among all machines of a kind, whatever their number of records: what no detector knows may still be
    far off.

    Parameters
    ----------
    machines : MachineScores
    """

    machines: MachineScores

    def p_value(self, judged: MachineScores) -> float:
        """Part of these machines, near ones above all, that look at least as much like a gap as this one does."""
        if not len(self.machines):
            return 1.0
        weight = self._weight(judged.records[0], self._alike(judged.kind[0], judged.quiet[0]))
        return _part(weight, self._rarest <= self._rarity(judged, 0))

    @cached_property
    def _rarest(self) -> Array:
        """[machines] How rare the rarest score of each of these machines is."""
        return np.array([self._rarity(self.machines, place) for place in range(len(self.machines))])

    def _rarity(self, of: MachineScores, place: int) -> float:
        alike = self._alike(of.kind[place], of.quiet[place])
        weight = self._weight(of.records[place], alike)
        rare = [_part(weight, self.machines.scores[:, k] >= score) for k, score in enumerate(of.scores[place])]
        if np.isfinite(of.distance[place]):
            rare.append(_part(alike, self.machines.distance >= of.distance[place]))
        return min(rare)

    def _alike(self, kind: float, quiet: bool) -> Array:
        """[machines] 1 for those met through a simulator of this kind, with healthy records or without as here; of a
        wider kind where these are few. Their own simulators are not calibrated."""
        kinds, own = self.machines.kind, self.machines.kind == OWN_SIMULATOR
        same = self.machines.quiet == quiet
        wider = (own,) if kind == OWN_SIMULATOR else (same & (kinds == kind), same & ~own, same, ~own)
        every = np.ones(len(kinds), bool)
        return np.asarray(next((alike for alike in wider if alike.sum() >= _FEWEST_ALIKE), every), float)

    def _weight(self, records: float, alike: Array) -> Array:
        """[machines] Of those alike the less, the further their number of records lies off."""
        known = self.machines.records
        at = float(np.clip(records, known.min(), known.max()))
        for near in (_NEAR_RECORDS, 2 * _NEAR_RECORDS):
            own = alike * np.exp(-0.5 * ((known - at) / near) ** 2)
            # Of a handful of machines no small p-value could come: then those further off count too.
            if own.sum() >= _FEWEST_NEAR:
                return np.asarray(own)
        return alike


def _part(weight: Array, extreme: Mask) -> float:
    return float((1 + weight[extreme].sum()) / (1 + weight.sum()))
