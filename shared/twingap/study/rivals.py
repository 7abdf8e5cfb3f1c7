"""What a reader would use instead of the diagnosis, on the same worlds and the same calibrated simulated records.

training worlds --plain statistics--> Examples --fit--> Rival
blind world     --plain statistics--> vector   --------> Rival.judge --> Found
                --per record--------> forest, measured or simulated? --importance--> Found (no training needed)

Each can say what it can say, and no more: which answers count as "outside the catalogue" is written at each rival.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.records import RecordSet
from twingap.study import statistics
from twingap.study.verdicts import Found

Array = NDArray[np.float64]

PERMUTATIONS: Final = 39
TREES: Final = 60

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
"""Beginning of a statistic's name -> the effect that a reader would blame when it tells measured from simulated most;
the first that fits. A second impact at the exit, distributed roughness, a gain over speed and growth move no single
statistic of single records of their own, so a reader of importances names none of them."""


def read_importance(statistic: str) -> str:
    """The effect that a reader would name for this statistic, by `READING`."""
    return next(effect for start, effect in READING if statistic.startswith(start))


def two_sample(ours: Array, theirs: Array, rng: np.random.Generator, permutations: int = PERMUTATIONS) -> Found:
    """Classifier two-sample test with a random forest, and the reading of its most important statistic.

    A gap is claimed at permutation p <= 0.05 of the out-of-bag area under the ROC curve. The effect named is that of
    the most important statistic by the fixed table `READING`; it names one at most and can never say "outside".

    Parameters
    ----------
    ours, theirs : Array [records, statistics]
    rng : numpy.random.Generator
    permutations : int

    References
    ----------
    D. Lopez-Paz, M. Oquab, Revisiting classifier two-sample tests, ICLR 2017, arXiv:1610.06545.
    """
    x = np.nan_to_num(np.concatenate((ours, theirs)), nan=0.0)
    label = np.repeat([1, 0], [len(ours), len(theirs)])
    # One number sows all forests, so that the observed one is exchangeable with those of permuted labels.
    sown = int(rng.integers(2**31))
    observed, importance = _forest(x, label, sown)
    null = [_forest(x, rng.permutation(label), sown)[0] for _ in range(permutations)]
    p = (1 + sum(value >= observed for value in null)) / (1 + permutations)
    if p > 0.05:
        return Found("no_gap", p_value=p)
    named = read_importance(statistics.names()[int(importance.argmax())])
    return Found("explained", (named,), p_value=p)


def _forest(x: Array, label: NDArray[np.int64], seed: int) -> tuple[float, Array]:
    from sklearn.ensemble import RandomForestClassifier

    # A third of the statistics at each split: with the usual root, one that tells alone is seldom looked at.
    forest = RandomForestClassifier(
        TREES, oob_score=True, max_features=0.3, min_samples_leaf=2, random_state=seed, n_jobs=1
    )
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # a record that no tree left out has no vote
        forest.fit(x, label)
    votes = np.nan_to_num(forest.oob_decision_function_[:, 1], nan=0.5)
    ahead = np.sign(votes[label == 1][:, None] - votes[label == 0][None]).mean()
    return float(ahead), np.asarray(forest.feature_importances_)


@dataclass(frozen=True)
class Examples:
    """Training worlds.

    Parameters
    ----------
    x : Array [worlds, statistics]
        From `statistics.of_world`; NaN allowed.
    present : NDArray[bool] [worlds, effects]
    effects : tuple of str
    """

    x: Array
    present: NDArray[np.bool_]
    effects: tuple[str, ...]


def examples(worlds: Iterable[tuple[RecordSet, RecordSet, frozenset[str]]], effects: Sequence[str]) -> Examples:
    """Examples from (measured, simulated, missing effects) as they come, one world in memory at a time."""
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
    """A method trained beforehand on examples.

    Attributes
    ----------
    name : str
    """

    name: ClassVar[str]

    def skip(self) -> str | None:
        """Why it cannot be run here, or None when it can."""
        return None

    @abstractmethod
    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Learn."""

    @abstractmethod
    def judge(self, x: Array) -> list[Found]:
        """What it says of worlds, x [worlds, statistics]."""


class Filled:
    """NaN -> median of training, then standardised and clipped at five standard deviations."""

    def __init__(self, x: Array) -> None:
        self.middle = np.array([np.median(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0 for c in x.T])
        filled = np.where(np.isfinite(x), x, self.middle)
        self.mean, self.std = filled.mean(axis=0), filled.std(axis=0) + 1e-9

    def __call__(self, x: Array) -> Array:
        """[worlds, statistics] Ready to learn from."""
        standard = (np.where(np.isfinite(x), x, self.middle) - self.mean) / self.std
        return np.asarray(np.clip(standard, -5, 5))


def named(probability: Array, effects: Sequence[str], threshold: float = 0.5) -> tuple[str, ...]:
    """Effects at or above the threshold, most probable first."""
    order = np.argsort(-probability, kind="stable")
    return tuple(effects[i] for i in order if probability[i] >= threshold)


class OneClassifier(Rival):
    """Extra-trees as one classifier: no effect, or one of the catalogue.

    Trained on the examples with at most one effect, classes weighted alike. It names the most probable class, whatever
    its probability; "outside" is read from a most probable class that is an effect of a probability below 0.5.
    """

    name = "extra-trees, one classifier"

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Learn from the examples of no or one effect."""
        from sklearn.ensemble import ExtraTreesClassifier

        few = examples.present.sum(axis=1) <= 1
        label = np.where(examples.present.any(axis=1), examples.present.argmax(axis=1), -1)[few]
        self.effects, self.fill = examples.effects, Filled(examples.x)
        self.model = ExtraTreesClassifier(
            500, class_weight="balanced", random_state=int(rng.integers(2**31)), min_samples_leaf=2
        )
        self.model.fit(self.fill(examples.x[few]), label)

    def judge(self, x: Array) -> list[Found]:
        """The most probable class."""
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
    """Extra-trees as one detector per effect, each firing at 0.5.

    Nothing fires: no gap. It can never say "outside".
    """

    name = "extra-trees, detector per effect"

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Learn one detector per effect; an effect of fewer than two examples has none."""
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
        """[worlds, effects]."""
        ready = self.fill(x)
        columns = [np.zeros(len(x)) if m is None else m.predict_proba(ready)[:, 1] for m in self.models]
        return np.stack(columns, axis=1)

    def judge(self, x: Array) -> list[Found]:
        """All effects whose detector fires."""
        found = []
        for p in self.probabilities(x):
            which = named(p, self.effects)
            by_effect = dict(zip(self.effects, p.tolist(), strict=True))
            found.append(Found("explained" if which else "no_gap", which, probability=by_effect))
        return found


def with_two_sample(detected: Sequence[Found], tested: Sequence[Found]) -> list[Found]:
    """Detectors that may also say "outside": where none fires, but the two-sample test sees a gap.

    The kindest reading of the two rivals together; it pays with the false alarms of both.
    """
    joined = []
    for one, test in zip(detected, tested, strict=True):
        strange = not one.effects and test.gap
        status = "unexplained" if strange else one.status
        joined.append(Found(status, one.effects, probability=one.probability, p_value=test.p_value))
    return joined


def as_row(found: Found) -> dict[str, Any]:
    """For study.json."""
    return {"status": found.status, "effects": list(found.effects), "p_value": found.p_value}
