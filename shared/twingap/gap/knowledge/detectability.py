"""Which missing effects anyone could have seen: those that are found on most machines alike, at values alike.

values, context, what a detector said of machines it had not seen --forest of each effect--> chance of being found

Effects are drawn as far as records could show them, by rules that know one effect each; what hides a slip among few
strikes, or a band of noise under another, no rule knows. To learn from effects that left no trace is to learn that all
that cannot be seen may well be there: what is missing is told no better, and sets that hold the truth grow without end.
So what few of its like were found of is neither missing nor not. How plain an effect *looks* has no say: an effect that
was missed, among others of its kind that were found, stays missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST: Final = 0.35
"""Chance of being found below which an effect counts as invisible."""
_FEWEST: Final = 60
"""Machines with an effect below which nothing is said of it."""
_CONTEXT: Final = (
    "context|records", "context|healthy_share", "context|log_samples", "context|log_turns", "context|speeds",
    "context|span_s", "context|own_simulator", "events.strike_snr|all.level", "answer.clear|all.level",
)  # fmt: skip


@dataclass(frozen=True)
class Detectability:
    """How surely each effect is found, by its values and by what else there is.

    Parameters
    ----------
    effects : tuple of str
    places : Mapping[str, Array]
        Columns of an effect's values.
    context : Array
        Columns of features.
    forests : Mapping[str, RandomForestRegressor]
    """

    effects: tuple[str, ...]
    places: Mapping[str, NDArray[np.int64]]
    context: NDArray[np.int64]
    forests: Mapping[str, Any]

    def hidden(self, missing: Mask, values: Array, features: NDArray[Any]) -> Mask:
        """[examples, effects] Whether an effect is missing where hardly anyone would see it.

        Parameters
        ----------
        missing : Mask [examples, effects]
        values : Array [examples, parameters]
        features : Array [examples, features]
        """
        out = np.zeros(missing.shape, bool)
        for j, name in enumerate(self.effects):
            rows = np.flatnonzero(missing[:, j])
            if name in self.forests and rows.size:
                about = _about(values[rows][:, self.places[name]], features[rows][:, self.context], missing[rows])
                out[rows, j] = self.forests[name].predict(about) < LEAST
        return out


def _about(values: Array, context: NDArray[Any], missing: Mask) -> Array:
    """[examples, columns] What an effect's chance is worked out from; the others that are missing are counted."""
    return np.asarray(np.nan_to_num(np.column_stack([values, context, missing.sum(axis=1)]), nan=-9.0))


def learn_detectability(
    said: Mapping[str, Array], missing: Mask, values: Array, features: NDArray[Any], effects: Sequence[str],
    parameters: Sequence[tuple[str, str]], names: Sequence[str],
) -> tuple[Detectability, Mask]:  # fmt: skip
    """How surely effects are found, and which of the examples' are hidden, each judged by trees that had not seen it.

    Parameters
    ----------
    said : Mapping[str, Array]
        Log odds [examples] of each effect, by detectors that had not seen the machine.
    missing : Mask [examples, effects]
    values : Array [examples, parameters]
    features : Array [examples, features]
    effects, parameters, names : sequence
        Of the columns of `missing`, `values` and `features`.

    Returns
    -------
    Detectability, Mask [examples, effects]
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
        if name not in said or rows.size < _FEWEST or not places[name].size:
            continue
        about = _about(values[rows][:, places[name]], features[rows][:, context], missing[rows])
        chance = 1 / (1 + np.exp(-np.clip(said[name][rows], -30, 30)))
        forest = RandomForestRegressor(
            n_estimators=150, min_samples_leaf=6, max_features=0.5, oob_score=True, n_jobs=1, random_state=0
        )
        forests[name] = forest.fit(about, chance)
        hidden[rows, j] = forest.oob_prediction_ < LEAST
    return Detectability(tuple(effects), places, context, forests), hidden
