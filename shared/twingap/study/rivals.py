"""Rival methods to the diagnosis, on the same worlds and the same calibrated simulated records.

training worlds --plain statistics--> Examples --fit--> Rival
blind world     --plain statistics--> vector   --------> Rival.predict --> Found
                --per record--------> forest, measured or simulated? --importance--> Found (no training needed)

Each rival's docstring states which of its outputs counts as "outside the catalogue". To add one, derive it from `Rival`
and name it in `runner.default_rivals`.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import Array, RecordSet
from twingap.study import statistics
from twingap.study.verdicts import Found

PERMUTATIONS: Final = 39
"""Permutations of the two-sample test; fewer than 19 can never reach p = 0.05, more give a finer p-value."""
TREES: Final = 60
"""Trees of each forest; more make the area under the ROC curve less noisy and are slower."""

READING: Final[tuple[tuple[str, str], ...]] = (
    ("log_rms_spread", "impulsive_noise"),
    ("kurtosis_spread", "impulsive_noise"),
    ("log_rms", "coloured_noise"),
    ("kurtosis", "impulsive_noise"),
    ("skewness", "impulsive_noise"),
    ("crest_factor", "impulsive_noise"),
    ("quantile_0.999", "clipping"),
    ("quantile_0.99", "clipping"),
    ("quantile", "impact_scatter"),
    ("repeats", "dropout"),
    ("at_extremes", "clipping"),
    ("levels", "quantisation"),
    ("band", "second_resonance"),
    ("spectral_slope", "sensor_rolloff"),
    ("spectral_flatness", "coloured_noise"),
    ("spectral_centroid", "sensor_rolloff"),
    ("order_0.5", "looseness"),
    ("order_1.5", "looseness"),
    ("order", "shaft_harmonics"),
    ("integer_orders", "gear_mesh"),
    ("line_50_hz", "mains_interference"),
    ("line_60_hz", "mains_interference"),
    ("strongest_line", "drive_interference"),
    ("ball_pass_line", "waviness"),
    ("envelope_fault", "slip_jitter"),
    ("envelope_decay", "slip_jitter"),
    ("envelope_shift", "mean_slip"),
    ("envelope_width", "speed_fluctuation"),
    ("envelope_shaft", "load_zone"),
    ("envelope_cage", "cage_modulation"),
    ("envelope_foreign", "foreign_bearing"),
    ("envelope_floor", "impact_scatter"),
)
"""Prefix of a statistic's name -> the effect inferred when that statistic best separates measured from simulated
records; the first match counts. Entry-exit impacts, distributed roughness, a gain over speed and growth change no
statistic of single records that is specific to them, so they are never inferred."""


def read_importance(statistic: str) -> str:
    """The effect inferred from this statistic by `READING`."""
    return next(effect for start, effect in READING if statistic.startswith(start))


def two_sample(ours: Array, theirs: Array, rng: np.random.Generator, permutations: int = PERMUTATIONS) -> Found:
    """Classifier two-sample test with a random forest, with the effect inferred from its most important statistic.

    A gap is claimed at permutation p <= 0.05 of the out-of-bag area under the ROC curve. The effect of the most
    important statistic in the table `READING` is named: one at most, and never "outside the catalogue". Measured and
    simulated records are [records, statistics].

    References
    ----------
    D. Lopez-Paz, M. Oquab, Revisiting classifier two-sample tests, ICLR 2017, arXiv:1610.06545.
    """
    x = np.nan_to_num(np.concatenate((ours, theirs)), nan=0.0)
    label = np.repeat([1, 0], [len(ours), len(theirs)])
    # One seed for all forests, so that the observed statistic is exchangeable with those of permuted labels.
    forest_seed = int(rng.integers(2**31))
    observed, importance = _forest(x, label, forest_seed)
    null = [_forest(x, rng.permutation(label), forest_seed)[0] for _ in range(permutations)]
    p = (1 + sum(value >= observed for value in null)) / (1 + permutations)
    if p > 0.05:
        return Found("no_gap", p_value=p)
    named = read_importance(statistics.names()[int(importance.argmax())])
    return Found("explained", (named,), p_value=p)


def _forest(x: Array, label: NDArray[np.int64], seed: int) -> tuple[float, Array]:
    from sklearn.ensemble import RandomForestClassifier

    # A third of the statistics per split: with the usual square root, a single informative one is seldom a candidate.
    forest = RandomForestClassifier(
        TREES, oob_score=True, max_features=0.3, min_samples_leaf=2, random_state=seed, n_jobs=1
    )
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # a record that is in-bag in all trees has no out-of-bag vote
        forest.fit(x, label)
    votes = np.nan_to_num(forest.oob_decision_function_[:, 1], nan=0.5)
    ahead = np.sign(votes[label == 1][:, None] - votes[label == 0][None]).mean()
    return float(ahead), np.asarray(forest.feature_importances_)


@dataclass(frozen=True)
class Examples:
    """Training examples, one per world: x [worlds, statistics] from `statistics.of_world`, and whether each effect is
    missing from the twin, present [worlds, effects]."""

    x: Array
    present: NDArray[np.bool_]
    effects: tuple[str, ...]


def examples(worlds: Iterable[tuple[RecordSet, RecordSet, frozenset[str]]], effects: Sequence[str]) -> Examples:
    """Examples from (measured, simulated, missing effects), with one world in memory at a time."""
    rows, labels = [], []
    for real, simulated, missing in worlds:
        rows.append(statistics.of_world(real, simulated))
        labels.append([effect in missing for effect in effects])
    return Examples(
        np.array(rows).reshape(len(rows), len(statistics.world_names())),
        np.array(labels, bool).reshape(len(rows), len(effects)),
        tuple(effects),
    )


class Rival(ABC):
    """A method that is trained on examples; its name is that in tables."""

    name: ClassVar[str]

    def skip(self) -> str | None:
        """Reason why it cannot run in this environment; None when it can."""
        return None

    @abstractmethod
    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Train on examples."""

    @abstractmethod
    def predict(self, x: Array) -> list[Found]:
        """Findings on worlds, x [worlds, statistics]."""


class Filled:
    """Preprocessing: NaN -> training median, then standardised and clipped at five standard deviations."""

    def __init__(self, x: Array) -> None:
        self.middle = np.array([np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0 for c in x.T])
        filled = np.where(np.isfinite(x), x, self.middle)
        self.mean, self.std = filled.mean(axis=0), filled.std(axis=0) + 1e-9

    def __call__(self, x: Array) -> Array:
        """[worlds, statistics] Preprocessed statistics."""
        standard = (np.where(np.isfinite(x), x, self.middle) - self.mean) / self.std
        return np.asarray(np.clip(standard, -5, 5))


def named(probability: Array, effects: Sequence[str]) -> tuple[str, ...]:
    """Effects of probability 0.5 or more, in descending order."""
    order = np.argsort(-probability, kind="stable")
    return tuple(effects[i] for i in order if probability[i] >= 0.5)


class OneClassifier(Rival):
    """Extra-trees as a single multi-class classifier: no effect, or one effect of the catalogue.

    Trained on the examples with at most one effect, with balanced class weights. It names the most probable class,
    independent of its probability. A most probable effect of probability below 0.5 counts as "outside the catalogue".
    """

    name = "extra-trees, one classifier"

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Train on the examples with no or one effect."""
        from sklearn.ensemble import ExtraTreesClassifier

        few = examples.present.sum(axis=1) <= 1
        label = np.where(examples.present.any(axis=1), examples.present.argmax(axis=1), -1)[few]
        self.effects, self.fill = examples.effects, Filled(examples.x)
        self.model = ExtraTreesClassifier(
            500, class_weight="balanced", random_state=int(rng.integers(2**31)), min_samples_leaf=2
        )
        self.model.fit(self.fill(examples.x[few]), label)

    def predict(self, x: Array) -> list[Found]:
        """The most probable class of each world."""
        found = []
        for p in self.model.predict_proba(self.fill(x)):
            top = int(self.model.classes_[p.argmax()])
            by_effect = {self.effects[c]: float(v) for c, v in zip(self.model.classes_, p, strict=True) if c >= 0}
            if top < 0:
                found.append(Found("no_gap", probability=by_effect))
            else:
                status = "explained" if p.max() >= 0.5 else "unexplained"
                found.append(Found(status, (self.effects[top],), probability=by_effect))
        return found


class Detectors(Rival):
    """Extra-trees as one detector per effect, each with threshold 0.5.

    No detection means no gap; "outside the catalogue" is never reported.
    """

    name = "extra-trees, detector per effect"

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Train one detector per effect; an effect with fewer than two examples gets none."""
        from sklearn.ensemble import ExtraTreesClassifier

        self.effects, self.fill = examples.effects, Filled(examples.x)
        x, self.models = self.fill(examples.x), []
        for present in examples.present.T:
            seed = int(rng.integers(2**31))
            learnable = 2 <= present.sum() <= len(present) - 2
            model = ExtraTreesClassifier(
                300, class_weight="balanced_subsample", bootstrap=True, max_features=0.3, min_samples_leaf=2,
                random_state=seed,
            )  # fmt: skip
            self.models.append(model.fit(x, present) if learnable else None)

    def probabilities(self, x: Array) -> Array:
        """[worlds, effects] Probability of each effect."""
        ready = self.fill(x)
        columns = [np.zeros(len(x)) if m is None else m.predict_proba(ready)[:, 1] for m in self.models]
        return np.stack(columns, axis=1)

    def predict(self, x: Array) -> list[Found]:
        """All effects whose probability reaches the threshold."""
        found = []
        for p in self.probabilities(x):
            which = named(p, self.effects)
            by_effect = dict(zip(self.effects, p.tolist(), strict=True))
            found.append(Found("explained" if which else "no_gap", which, probability=by_effect))
        return found


def with_two_sample(detected: Sequence[Found], tested: Sequence[Found]) -> list[Found]:
    """Detectors combined with the two-sample test: "outside" where no effect is detected but the test finds a gap.

    This is the combination most favourable to the two rivals; it has the false alarms of both.
    """
    joined = []
    for one, test in zip(detected, tested, strict=True):
        outside = not one.effects and test.gap
        status = "unexplained" if outside else one.status
        joined.append(Found(status, one.effects, probability=one.probability, p_value=test.p_value))
    return joined


def as_row(found: Found) -> dict[str, Any]:
    """Row of study.json."""
    return {"status": found.status, "effects": list(found.effects), "p_value": found.p_value}
