"""One trial: a method trained at one seed and one noise level, and evaluated.

source (labelled) ----------------+--> fit --> judge on all windows, and on those of unseen bearings alone
adapt (no labels) --noise at SNR--+              ^
evaluate (labelled) --noise at SNR---------------+

The analyst's rule goes through the same door, as a method that learns nothing; so does the project's own, whose trees
learn from simulated fleets of the phenomenological twin and compare each judged recording with those adapted to.
"""

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from papers.embedding import embed
from papers.paper3_zoa_dann.comparison.task_files import Material
from papers.paper3_zoa_dann.job import spread
from papers.paper3_zoa_dann.source import Recipe, simulate
from papers.paper3_zoa_dann.yardsticks import analyst
from twingap import Condition
from twingap import adapt as adaptation
from twingap.adapt import METHODS, Fitted, Fleets, Judged, ModeInputs, Population, Training, Windows, joined, judge
from twingap.adapt.order_forest import MOST_MEMBERS, OrderForest, examples, train_forest
from twingap.twins.twin_file import TwinSpec

ANALYST: Final = "Analyst's rule"
OWN: Final = "Orders (ours)"
CLOSED: Final = {f"{name}, gap closed": name for name in ("Non-DA", "Proposed")}
"""Methods of the paper on a twin that has the effects named by the gap diagnosis."""
ALL: Final = (*METHODS, *CLOSED, OWN, ANALYST)
"""Every method by name, in the order of tables: the paper's nine, two of them with the gap closed, the project's own
(trees on fault orders and levels, as `twingap classify`), then the yardstick."""
FLEETS_PER_BEARING: Final = 5
"""Simulated fleets for each virtual bearing and class of the networks: they have eight members, and cost far less."""
FINEST: Final = 1000.0  # noise levels are told apart to a thousandth of a decibel


@dataclass(frozen=True)
class Trial:
    task: str
    available: str  # state of the unlabelled data: "balanced", "imbalanced" or "scarce"
    unseen: float | None  # size whose bearings are left out of adaptation
    method: str  # one of `ALL`
    seed: int
    snr_db: float | None  # of the noise added to all target windows; None = none
    training: Training
    inputs: ModeInputs
    criterion: str  # by which a checkpoint is chosen
    held_out: float  # share of virtual bearings kept for source validation
    false_alarm: float  # of the analyst's rule
    recipe: Recipe  # of the simulated windows
    embedded: int = 0  # windows per domain to embed by t-SNE; 0 for none

    @property
    def words(self) -> str:
        """The trial in words: unique within a profile."""
        left_out = "" if self.unseen is None else f", without {self.unseen:g}"
        return f"{self.task}, {self.available}{left_out}, {noise_words(self.snr_db)}, {self.method}, seed {self.seed}"


def noise_words(snr_db: float | None) -> str:
    return "no noise added" if snr_db is None else f"{snr_db:g} dB"


def noisy(windows: Windows, trial: Trial, stream: int) -> Windows:
    """The windows of recordings with white noise at the trial's SNR: the same noise for every method.

    The SNR is that of the variance of a recording (its windows without their means) over that of the noise: one level a
    recording. Overlapping windows get noises of their own, so they would not do for adaptation and judging at once.
    """
    if trial.snr_db is None:
        return windows
    level = round((trial.snr_db + 1000.0) * FINEST)
    centred = windows.samples - windows.samples.mean(axis=1, keepdims=True)
    sd = np.empty(len(windows))
    for group in np.unique(windows.group):
        chosen = windows.group == group
        sd[chosen] = np.sqrt(np.mean(centred[chosen] ** 2))
    noise = np.random.default_rng([trial.seed, stream, level]).standard_normal(windows.samples.shape)
    noise *= (sd * 10 ** (-trial.snr_db / 20))[:, None]
    return dataclasses.replace(windows, samples=windows.samples + noise)


def run_trial(trial: Trial, material: Material, device: str = "auto", modes: Path | None = None) -> dict[str, Any]:
    """Train, choose a checkpoint without target labels, judge: `twingap.adapt.Judged.plain` of all windows, the same of
    ``unseen`` bearings (or None), ``history``, ``source_accuracy``, embedding if asked for. `device` and `modes` (a
    folder of modes that other trials have decomposed) are no part of the key."""
    evaluate = noisy(material.evaluate, trial, 4)
    if trial.method == ANALYST:
        recipe = trial.recipe
        calls = analyst(evaluate, recipe.bearing, recipe.classes, trial.false_alarm, "impulsive")
        return _unchosen(calls, evaluate, material)
    adapt = noisy(material.adapt, trial, 3).unlabelled()
    if trial.method == OWN:
        return _by_orders(trial, evaluate, adapt, material)
    source = simulate(trial.recipe)
    classes = trial.recipe.classes
    inputs = dataclasses.replace(trial.inputs, cache=modes)
    fitted = adaptation.fit(
        CLOSED.get(trial.method, trial.method), source, adapt, trial.seed, n_classes=len(classes),
        settings=trial.training, inputs=inputs, held_out=trial.held_out, criterion=trial.criterion, device=device,
    )  # fmt: skip
    # Only from here on are target labels looked at.
    result = judge(fitted, evaluate).plain()
    seen = material.unseen
    result["unseen"] = _short(judge(fitted, evaluate.take(seen))) if seen.any() else None
    result["history"] = [
        {name: None if math.isnan(value) else value for name, value in row.items()} for row in fitted.history
    ]
    result["source_accuracy"] = fitted.source_accuracy[fitted.place] if fitted.source_accuracy else None
    result["device"] = fitted.trained.device if fitted.trained else "cpu"
    if trial.embedded and fitted.trained is not None:
        result |= _embedding(trial, fitted, source, evaluate)
    return result


def _by_orders(trial: Trial, evaluate: Windows, adapt: Windows, material: Material) -> dict[str, Any]:
    """The project's own method on the same windows."""
    forest = _forest(trial.recipe, trial.seed)
    told = np.zeros((len(evaluate), len(trial.recipe.classes)))
    for group in dict.fromkeys(evaluate.group):
        # One recording at a time, beside those that were at hand before it: none sees the others that are judged.
        at = np.flatnonzero(evaluate.group == group)
        beside = joined([adapt, evaluate.take(at).unlabelled()])
        told[at] = forest.probabilities(beside)[len(adapt) :]
    return _unchosen(told, evaluate, material)


@lru_cache(maxsize=4)
def _forest(recipe: Recipe, seed: int) -> OrderForest:
    """Trees that have seen fleets at the speeds to be judged."""
    rng, count = np.random.default_rng([recipe.seed, seed, 60]), recipe.bearings_per_class * FLEETS_PER_BEARING
    shown = examples(fleets(recipe), max(2, count), recipe.window_samples, 2, rng)
    return train_forest(shown, recipe.bearing, len(recipe.classes), seed)


def fleets(recipe: Recipe) -> Fleets:
    """Fleets at the speeds to be judged; path and noise are open, nothing is identified."""
    length = 2 * recipe.window_samples
    conditions = tuple(Condition(f"{speed:g}", speed, recipe.fs_hz, length) for speed in recipe.speeds_rpm)
    population = Population(TwinSpec("phenomenological"), recipe.bearing, "", conditions, frozenset(), length)
    return Fleets(population, MOST_MEMBERS, recipe.classes)


def _unchosen(told: Any, evaluate: Windows, material: Material) -> dict[str, Any]:
    """The result of a method that has no checkpoints to choose from."""
    assert evaluate.labels is not None

    def judged(chosen: Any) -> Judged:
        part = evaluate.take(chosen)
        assert part.labels is not None
        found = adaptation.score(told[chosen], part.labels, part.group)
        return Judged(found, told[chosen], (found.accuracy,), {}, found.accuracy)

    seen = material.unseen
    return {
        **judged(np.ones(len(evaluate), dtype=bool)).plain(), "unseen": _short(judged(seen)) if seen.any() else None,
        "history": [], "source_accuracy": None, "device": "cpu",
    }  # fmt: skip


def _short(judged: Judged) -> dict[str, Any]:
    whole = judged.plain()
    return {name: whole[name] for name in ("accuracy", "oracle_accuracy", "recordings_right", "recordings")}


def _embedding(trial: Trial, fitted: Fitted, source: Windows, evaluate: Windows) -> dict[str, Any]:
    """t-SNE of simulated windows that were held out from training and of measured ones."""
    # As `fit` splits them.
    _, held = adaptation.split_by_group(source, trial.held_out, np.random.default_rng([trial.seed, 2]))
    shown = [part.take(spread(len(part), trial.embedded)) for part in (held, evaluate)]
    features = np.concatenate([fitted.embed(part) for part in shown]).astype(np.float32)
    labels = joined(shown).labels
    assert labels is not None
    of_target = np.arange(len(features)) >= len(shown[0])
    return {
        "embedding": embed(features, trial.seed), "embedding_labels": labels, "embedding_is_target": of_target,
    }  # fmt: skip
