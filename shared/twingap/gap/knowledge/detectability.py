"""Detectability of missing effects: the probability that an effect is found, given its values and the machine.

values, context, log odds of detectors on machines not trained on --random forest per effect--> detection probability

Effects are drawn at values that records should show, but each draw considers one effect alone: slip may be hidden by a
small number of impacts, or a noise band by another. Training on effects that leave no trace would make detectors
unspecific and confidence sets large. Undetectable effects therefore count neither as missing nor as absent. The
detection probability depends on values and context, not on the log odds of the same machine: an effect that was missed
although similar ones are found counts as missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array

Mask = NDArray[np.bool_]

LEAST: Final = 0.35
"""Detection probability below which an effect counts as undetectable. A larger value leaves more effects out of
training."""
_FEWEST: Final = 60
"""Smallest number of machines with an effect for which its detectability is learnt. Fewer make it less certain."""
_CONTEXT: Final = (
    "context|records", "context|healthy_share", "context|log_samples", "context|log_turns", "context|speeds",
    "context|span_s", "context|own_simulator", "impacts.snr|all.level", "impulse_response.clear|all.level",
)  # fmt: skip
"""Features that describe the records, whatever is missing."""


@dataclass(frozen=True)
class Detectability:
    """Detection probability of each effect, from its values, the records and the other missing effects."""

    effects: tuple[str, ...]
    places: Mapping[str, NDArray[np.int64]]  # columns of each effect's values
    context: NDArray[np.int64]  # [columns] columns of the features that describe the records
    forests: Mapping[str, Any]  # regression of the detection probability; none for an effect with too few machines

    def hidden(self, missing: Mask, values: Array, features: NDArray[Any]) -> Mask:
        """[examples, effects] Whether an effect is missing and undetectable.

        From `missing` [examples, effects], `values` [examples, parameters] and `features` [examples, features].
        """
        out = np.zeros(missing.shape, bool)
        for j, name in enumerate(self.effects):
            rows = np.flatnonzero(missing[:, j])
            if name in self.forests and rows.size:
                about = _inputs(values[rows][:, self.places[name]], features[rows][:, self.context], missing[rows])
                out[rows, j] = self.forests[name].predict(about) < LEAST
        return out


def _inputs(values: Array, context: NDArray[Any], missing: Mask) -> Array:
    """[examples, columns] Inputs of a forest: values, context and the number of missing effects."""
    return np.asarray(np.nan_to_num(np.column_stack([values, context, missing.sum(axis=1)]), nan=-9.0))


def learn_detectability(
    log_odds: Mapping[str, Array], missing: Mask, values: Array, features: NDArray[Any], effects: Sequence[str],
    parameters: Sequence[tuple[str, str]], names: Sequence[str],
) -> tuple[Detectability, Mask]:  # fmt: skip
    """Detectability, and the undetectable effects of the examples themselves, by out-of-bag prediction.

    `log_odds` [examples] of each effect are by detectors not trained on the machine; `effects`, `parameters` and
    `names` name the columns of `missing`, `values` and `features`, all [examples, columns].
    """
    from sklearn.ensemble import RandomForestRegressor

    context = np.array([names.index(name) for name in _CONTEXT if name in names], dtype=np.int64)
    places = {
        name: np.array([k for k, (effect, _) in enumerate(parameters) if effect == name], dtype=np.int64)
        for name in effects
    }
    forests: dict[str, Any] = {}
    hidden = np.zeros(missing.shape, bool)
    for j, name in enumerate(effects):
        rows = np.flatnonzero(missing[:, j])
        if name not in log_odds or rows.size < _FEWEST or not places[name].size:
            continue
        about = _inputs(values[rows][:, places[name]], features[rows][:, context], missing[rows])
        chance = 1 / (1 + np.exp(-np.clip(log_odds[name][rows], -30, 30)))
        forest = RandomForestRegressor(
            n_estimators=150, min_samples_leaf=6, max_features=0.5, oob_score=True, n_jobs=1, random_state=0
        )
        forests[name] = forest.fit(about, chance)
        hidden[rows, j] = forest.oob_prediction_ < LEAST
    return Detectability(tuple(effects), places, context, forests), hidden
