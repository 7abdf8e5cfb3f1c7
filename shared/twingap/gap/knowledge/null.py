"""Null distribution: scores of machines without a gap, from which p-values of no gap are computed.

scores of detectors, distance --of machines without a gap--> Null --rank of a new machine's rarest score--> p-value
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array

Mask = NDArray[np.bool_]

RECORDS: Final = "context|records"
"""Feature: logarithm of the number of records compared."""
OWN: Final = "context|own_simulator"
"""Feature: whether the simulator is the user's own."""
MODELS: Final = "context|has_effects"
"""Feature: whether the given twin has effects."""
BARE, OWN_SIMULATOR, WITH_EFFECTS = 0.0, 1.0, 2.0
"""Kinds of simulator: the baseline twin, the user's own simulator, a twin with effects."""
DISTANCE: Final = "distance|all_domains"
"""Feature: distance between records and twin over all domains, whatever its cause."""
HEALTHY: Final = "context|healthy_share"
"""Feature: part of the records that is healthy."""

_NEAR_RECORDS: Final = 0.35
"""Kernel width, in the logarithm of the number of records. A larger value adds machines with less similar numbers."""
_FEWEST_NEAR: Final = 150.0
"""Smallest sum of weights of a null distribution. A larger value allows smaller p-values, from machines with less
similar numbers of records."""
_FEWEST_ALIKE: Final = 60
"""Smallest number of machines of a kind; with fewer, machines of other kinds are added. A larger value adds them
more often."""


def _feature(features: NDArray[Any], names: tuple[str, ...], name: str, otherwise: float = 0.0) -> Array:
    """[examples] Feature of this name; `otherwise` where it does not exist."""
    rows = np.atleast_2d(features)
    return np.asarray(rows[:, names.index(name)] if name in names else np.full(len(rows), otherwise), float)


@dataclass(frozen=True)
class MachineScores:
    """Scores and properties of machines that the null distribution uses."""

    scores: Array  # [machines, scores] log odds of a gap, one column per statistic
    records: Array  # [machines] logarithm of the number of records
    distance: Array  # [machines] distance between records and twin; NaN where it is unknown
    # [machines] `BARE`, `OWN_SIMULATOR` (no calibrated parameters, therefore smaller distances) or `WITH_EFFECTS` (of
    # which the machine may have a variant).
    kind: Array
    # [machines] Whether some records are healthy: without any, the calibration has to separate noise from impacts and
    # is less accurate.
    with_healthy: Mask

    @classmethod
    def of(cls, scores: Array, features: NDArray[Any], names: tuple[str, ...]) -> MachineScores:
        """Scores of machines, with their properties read from features [machines, features]."""
        own, models = _feature(features, names, OWN) > 0, _feature(features, names, MODELS) > 0
        kind = np.select([own, models], [OWN_SIMULATOR, WITH_EFFECTS], BARE)
        with_healthy = _feature(features, names, HEALTHY, 1.0) > 0
        return cls(
            scores, _feature(features, names, RECORDS), _feature(features, names, DISTANCE, np.nan), kind, with_healthy
        )

    def take(self, rows: Mask) -> MachineScores:
        """A subset of the machines."""
        return MachineScores(**{name: values[rows] for name, values in vars(self).items()})

    def __len__(self) -> int:
        return len(self.scores)


NO_MACHINES: Final = MachineScores(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool))
"""Empty null distribution, with p-value 1 for every machine."""


@dataclass(frozen=True)
class Null:
    """Null distribution of scores of machines without a gap.

    - With few records, large scores are more frequent. A score is ranked among machines with weights that decrease with
      the difference in the number of records (localised conformal p-value; Guan 2023, doi:10.1093/biomet/asac040).
    - Scores also depend on the kind of simulator and on the presence of healthy records. Each machine is ranked within
      its class (Mondrian conformal prediction; Vovk, Gammerman and Shafer 2005, ch. 4.5).
    - The statistic is the smallest p-value over all scores, ranked among those of the machines without a gap (minimum
      p: Westfall and Young, Resampling-based multiple testing, 1993).
    - The distance is one of the scores, ranked among all machines of a class whatever their number of records. It
      detects gaps that no detector was trained on.
    """

    machines: MachineScores

    def p_value(self, machine: MachineScores) -> float:
        """P-value of the first of these machines: weighted part of the null machines that are at least as extreme."""
        if not len(self.machines):
            return 1.0
        weight = self._weight(machine.records[0], self._alike(machine.kind[0], machine.with_healthy[0]))
        return _part(weight, self._rarest <= self._rarity(machine, 0))

    def smallest(self, machine: MachineScores) -> float:
        """Smallest p-value that the first of these machines can have."""
        weight = self._weight(machine.records[0], self._alike(machine.kind[0], machine.with_healthy[0]))
        return float(1 / (1 + weight.sum()))

    @cached_property
    def _rarest(self) -> Array:
        """[machines] Smallest p-value over the scores of each null machine."""
        return np.array([self._rarity(self.machines, place) for place in range(len(self.machines))])

    def _rarity(self, of: MachineScores, place: int) -> float:
        """Smallest p-value over the scores of one machine."""
        alike = self._alike(of.kind[place], of.with_healthy[place])
        weight = self._weight(of.records[place], alike)
        rare = [_part(weight, self.machines.scores[:, k] >= score) for k, score in enumerate(of.scores[place])]
        if np.isfinite(of.distance[place]):
            rare.append(_part(alike, self.machines.distance >= of.distance[place]))
        return min(rare)

    def _alike(self, kind: float, with_healthy: bool) -> Array:
        """[machines] 1 for null machines of the same class (kind of simulator, presence of healthy records), else 0.
        Wider classes are used where this one is small; calibration does not apply to the user's own simulators."""
        kinds, own = self.machines.kind, self.machines.kind == OWN_SIMULATOR
        same = self.machines.with_healthy == with_healthy
        wider = (own,) if kind == OWN_SIMULATOR else (same & (kinds == kind), same & ~own, same, ~own)
        every = np.ones(len(kinds), bool)
        return np.asarray(next((alike for alike in wider if alike.sum() >= _FEWEST_ALIKE), every), float)

    def _weight(self, records: float, alike: Array) -> Array:
        """[machines] Weight of each null machine, decreasing with the difference in the log number of records."""
        known = self.machines.records
        at = float(np.clip(records, known.min(), known.max()))
        for near in (_NEAR_RECORDS, 2 * _NEAR_RECORDS):
            own = alike * np.exp(-0.5 * ((known - at) / near) ** 2)
            # Few machines allow no small p-value: widen the kernel.
            if own.sum() >= _FEWEST_NEAR:
                return np.asarray(own)
        return alike


def _part(weight: Array, extreme: Mask) -> float:
    """Weighted part of the null machines that are extreme, the tested machine included."""
    return float((1 + weight[extreme].sum()) / (1 + weight.sum()))
