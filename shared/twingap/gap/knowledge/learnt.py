"""Models of the diagnosis: detectors of effects, estimators of values, and scores of machines without a gap."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.knowledge.detectability import Detectability
from twingap.gap.knowledge.detectors import Ensemble, Estimator
from twingap.gap.knowledge.null import NO_MACHINES, MachineScores, Null
from twingap.gap.knowledge.score_calibration import ScoreCalibration
from twingap.records import Array

NAMED_FROM: Final = 0.75
"""Probability from which an effect is named, where no score calibration was learnt. A larger value names fewer
effects."""
NO_DETECTOR: Final = -6.0
"""Log odds of an effect without a detector, or of one that the twin has."""


@dataclass
class Learnt:
    """All models of the diagnosis."""

    effects: tuple[str, ...]  # effects that were trained on, in the order of the detectors' columns
    detectors: Mapping[str, Ensemble]  # detectors of missing effects; none for an effect with too few examples
    estimators: Mapping[tuple[str, str], Estimator]
    any_gap: Ensemble  # detector of a gap of any cause
    null: Null  # null distribution: scores of machines whose twin lacks nothing
    features: tuple[str, ...]  # names of the features that detectors and estimators use, in their order
    about: dict[str, Any]  # provenance of the training
    thresholds: Mapping[str, float] = field(default_factory=dict)  # log odds from which an effect is tried
    set_level: float = 0.9  # joint probability of confidence sets where there is no `calibration`
    # Null distribution of twins to which all missing effects have been added.
    null_rest: Null = field(default_factory=lambda: Null(NO_MACHINES))
    # [columns] Columns of features that `any_gap` uses besides the detectors.
    general: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    # Probabilities of effects from outcomes of a search; None where there were too few searches.
    calibration: ScoreCalibration | None = None
    # Detectability of effects. Used in training only, and not stored in files.
    detectability: Detectability | None = None
    # Effects whose definition differs from the one trained on; no model is applied to them.
    outdated: frozenset[str] = frozenset()

    @property
    def errors(self) -> dict[tuple[str, str], float]:
        """(effect, parameter) -> bound on nine of ten errors, on the scale of `parameter_scale`."""
        return {key: estimator.error for key, estimator in self.estimators.items()}

    @property
    def named_from(self) -> float:
        """Probability from which an effect is named."""
        return NAMED_FROM if self.calibration is None else self.calibration.named_from

    def covers(self, effect: str) -> bool:
        """Whether this effect, with its current definition, was trained on."""
        return effect in self.effects and effect not in self.outdated

    def log_odds(self, features: NDArray[Any], *, later: bool = False) -> Array:
        """[examples, effects] Log odds that each effect is missing, from features [examples, features].

        `NO_DETECTOR` for effects without a detector; `later` states that effects have been added to the twin.
        """
        rows = np.atleast_2d(features)
        out = np.full((len(rows), len(self.effects)), NO_DETECTOR)
        for j, name in enumerate(self.effects):
            if name in self.detectors:
                out[:, j] = self.detectors[name].score(rows, later=later)
        return out

    def p_value(self, features: NDArray[Any], modelled: Collection[str] = ()) -> float:
        """P-value of no gap from features [features]; effects of the given twin, `modelled`, cannot be missing."""
        return self._rank(features, self.null, modelled, later=False)

    def p_floor(self, features: NDArray[Any]) -> float:
        """Smallest p-value of no gap that the machines without a gap allow for these features."""
        rows = np.atleast_2d(features)
        if not len(self.null.machines):
            return 1.0
        return self.null.smallest(MachineScores.of(np.zeros((1, 2)), rows, self.features))

    def rest_p(self, features: NDArray[Any], has: Collection[str] = ()) -> float:
        """P-value of no rest from features [features]; `has` are the effects of the twin, as given or added."""
        return self._rank(features, self.null_rest, has, later=True)

    def _rank(self, features: NDArray[Any], null: Null, has: Collection[str], *, later: bool) -> float:
        """P-value of a machine under a null distribution; effects in `has` cannot be missing."""
        rows = np.atleast_2d(features)
        odds = self.log_odds(rows, later=later)
        odds[:, [name in has for name in self.effects]] = NO_DETECTOR
        any_gap = self.any_gap.score(any_gap_inputs(odds, rows[:, self.general]), later=later)
        scores = np.stack([any_gap, any_effect(odds)], axis=1)
        return null.p_value(MachineScores.of(scores, features, self.features))


def any_gap_inputs(log_odds: Array, general: NDArray[Any]) -> Array:
    """[examples, effects + 3 + columns] Inputs of the detector of any gap: log odds [examples, effects], the three
    highest of them, and general features [examples, columns]."""
    return np.concatenate((log_odds, np.sort(log_odds, axis=1)[:, -3:], general), axis=1)


def any_effect(log_odds: Array) -> Array:
    """[examples] Log odds that at least one effect is missing, with effects [examples, effects] independent."""
    return np.asarray(np.log1p(np.exp(np.clip(log_odds, -30, 30))).sum(axis=1))
