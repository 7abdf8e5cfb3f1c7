"""Training of detectors, estimators and null distributions on examples.

examples (features, missing effects, values) --training--> detector of each effect, estimator of each value
                                             --out-of-fold scores--> detector of any gap, null, thresholds
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.gap.knowledge.detectability import Detectability, learn_detectability
from twingap.gap.knowledge.detectors import Ensemble, Estimator, Mask, Table, learn_classifier, learn_estimator
from twingap.gap.knowledge.effect_features import columns
from twingap.gap.knowledge.learnt import NO_DETECTOR, Learnt, any_effect, any_gap_inputs
from twingap.gap.knowledge.null import MachineScores, Null
from twingap.records import Array


@dataclass
class Examples:
    """Simulated gaps as arrays."""

    features: NDArray[np.float32]  # [examples, features] comparison on the held-out part
    missing: Mask  # [examples, effects]
    # [examples, effects] Effects of the given twin; not missing, though a machine may have a variant of them.
    modelled: Mask
    outside: Mask  # [examples] whether the machine has an effect outside the catalogue
    machine: NDArray[np.int64]  # [examples] number of the machine; a machine is in one fold only
    first: Mask  # [examples] True for the twin as given; False where effects have been added to it
    values: Array  # [examples, parameters] values of the missing effects, NaN otherwise
    fit_features: NDArray[np.float32]  # [examples, features] comparison on the fit part

    def __len__(self) -> int:
        return len(self.features)


PRECISION: Final = 0.75
"""Out-of-fold precision that the threshold of a detector has to reach. A larger value tries fewer effects."""
COVERAGE: Final = 0.93
"""Part of the out-of-fold machines whose confidence set contains the truth: 90 % with a margin for machines unlike
those trained on. A larger value gives larger sets."""

MOST: Final = 0.93
"""Largest joint probability of confidence sets. A larger value allows larger sets."""


def _limit(score: Array, label: Mask) -> float:
    """Threshold of a detector: the smallest log odds near 0 at which its precision is sufficient."""
    for limit in np.arange(-1.0, 0.51, 0.25):
        named = score > limit
        if named.sum() >= 10 and label[named].mean() >= PRECISION:
            return float(limit)
    return 0.5


def _level(scores: Array, missing: Mask) -> float:
    """Joint probability at which the most probable sets of effects contain the truth with frequency `COVERAGE`."""
    needed = []
    for own, truth in zip(scores, missing, strict=True):
        p = 1 / (1 + np.exp(-np.clip(own, -30, 30)))
        open_ = np.argsort(-np.minimum(p, 1 - p))[:8]
        closed = np.setdiff1d(np.arange(p.size), open_)
        if ((p[closed] > 0.5) != truth[closed]).any():
            needed.append(1.0)
            continue
        picks = (np.arange(2**open_.size)[:, None] >> np.arange(open_.size)) & 1
        weights = np.where(picks, p[open_], 1 - p[open_]).prod(axis=1)
        of_truth = np.where(truth[open_], p[open_], 1 - p[open_]).prod()
        # The truth is in the confidence set once all more probable sets are.
        needed.append(float(weights[weights > of_truth].sum() + 1e-9))
    return float(np.clip(np.quantile(needed, COVERAGE), 0.7, MOST))


def general_columns(names: tuple[str, ...]) -> NDArray[np.int64]:
    """Columns of features that show a gap whatever its cause: distances, and features that no effect should change."""
    patterns = (
        "context|*", "background.segment_*", "background.spectral_drift|*", "background.*asymmetry|*",
        "background.*skewness|*", "background.level_coupling|*", "background.echo_*", "background.modulation_*",
        "background.rest_rms|*", "background.kurtosis_log|*", "lines.free_count_log|*", "lines.tonal_share|*",
        "background.white_kurtosis_log|*", "shape|*_rms", "shape|*_rest_share", "path|*_cost*", "path|*_gain*",
        "change|base_cost", "change|*_gain", "change|best_cost", "distance|*", "context|own_simulator",
        "pooled|modulation_fixed*", "pooled|turning*", "pooled|fixed*", "pooled|carrier*",
        "impacts.snr|*", "background.rms_log|spread", "background.white_level|spread",
    )  # fmt: skip
    wanted, of_sets = (".diff", ".z", "|spread"), ("context|", "shape|", "path|", "change|", "distance|", "pooled|")
    general = (
        any(fnmatchcase(n, p) for p in patterns) and (n.endswith(wanted) or n.startswith(of_sets)) for n in names
    )
    return np.flatnonzero(list(general))


def _on_one_thread(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call on one thread: the other cores are used by parallel calls."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        return function(*arguments)


def learn(examples: Examples, effects: tuple[str, ...], parameters: tuple[tuple[str, str], ...],
          names: tuple[str, ...], progress: Callable[[str, float], None]) -> Learnt:  # fmt: skip
    """All models of the diagnosis, trained on the examples.

    `effects` name the columns of `examples.missing`, `parameters` (effect, parameter) those of `examples.values`,
    `names` the features.

    Raises
    ------
    TwingapError
        For too few machines with or without a gap. An effect that too few machines have gets no detector.
    """
    import joblib

    # Both parts of a machine's records are examples; scores are those of the held-out part, as in a diagnosis.
    table = Table(np.concatenate((examples.features, examples.fit_features)))
    machine, missing = np.tile(examples.machine, 2), np.tile(examples.missing, (2, 1))
    first = np.tile(examples.first, 2)
    here = np.arange(len(examples))
    allowed = [columns(name, names) for name in effects]
    # Models of one label each are small: parallel processes are faster than threads within one.
    parallel = joblib.Parallel(n_jobs=-1, return_as="generator")

    # An effect that the twin has cannot be missing, but resembles a missing one in features of the records alone: such
    # examples are left out.
    has = np.tile(_in_twin(examples), (2, 1))

    def trained(counted: Mask, begin: float) -> dict[str, Ensemble]:
        """Detectors of all effects, trained on the examples of each effect in `counted` [examples, effects]."""
        found = parallel(
            joblib.delayed(_on_one_thread)(
                learn_classifier, table, missing[:, j], machine, allowed[j], first, counted[:, j]
            )
            for j in range(len(effects))
        )
        out = {}
        for done, (name, detector) in enumerate(zip(effects, found, strict=True)):
            progress(f"detector of {name}", begin + 0.3 * done / len(effects))
            if detector is not None:
                out[name] = detector
        return out

    # First with all effects, to learn their detectability; then without the undetectable ones.
    log_odds = {name: detector.out_of_fold[here] for name, detector in trained(~has, 0.0).items()}
    detectability, hidden = _hidden(examples, log_odds, effects, parameters, names)
    counted = ~np.tile(hidden, (2, 1)) & ~has
    detectors = trained(counted, 0.3)
    plain = examples.values.copy()
    for j, (name, _) in enumerate(parameters):
        plain[hidden[:, effects.index(name)], j] = np.nan
    early, values = table.take(first), np.tile(plain, (2, 1))[first]
    estimators: dict[tuple[str, str], Estimator] = {}
    made = parallel(
        joblib.delayed(_on_one_thread)(
            learn_estimator, early, values[:, j], machine[first], allowed[effects.index(parameter[0])]
        )
        for j, parameter in enumerate(parameters)
    )
    for done, (parameter, estimator) in enumerate(zip(parameters, made, strict=True)):
        progress(f"values of {parameter[0]}", 0.6 + 0.3 * done / len(parameters))
        if estimator is not None:
            estimators[parameter] = estimator
    progress("detector of any gap", 0.9)
    scores = np.full((len(machine), len(effects)), NO_DETECTOR)
    for j, name in enumerate(effects):
        if name in detectors:
            scores[:, j] = detectors[name].out_of_fold
            detectors[name].out_of_fold = detectors[name].out_of_fold[here]
    has_gap = examples.missing.any(axis=1) | examples.outside
    general = general_columns(names)
    odds = np.where(has, NO_DETECTOR, scores)
    any_gap_table = Table(any_gap_inputs(odds, table.values[:, general]).astype(np.float32))
    open_ = ~has_gap | examples.outside | (examples.missing & ~hidden).any(axis=1)
    any_gap = learn_classifier(
        any_gap_table, np.tile(has_gap, 2), machine, range(any_gap_table.values.shape[1]), first, np.tile(open_, 2)
    )
    if any_gap is None:
        raise TwingapError(
            f"{len(np.unique(examples.machine[has_gap]))} machines with a gap and "
            f"{len(np.unique(examples.machine[~has_gap]))} without one are too few to learn from",
            where="training", mend="train on 100 machines or more; thousands are needed for good detectors",
        )  # fmt: skip
    any_gap.out_of_fold = any_gap.out_of_fold[here]
    scores = scores[here]
    scored = MachineScores.of(np.stack([any_gap.out_of_fold, any_effect(odds[here])], axis=1), examples.features, names)
    null, rest = (Null(scored.take(rows)) for rows in (~has_gap & examples.first, ~has_gap & ~examples.first))
    limits = {
        name: _limit(scores[counted[here, j], j], examples.missing[counted[here, j], j])
        for j, name in enumerate(effects)
    }
    known = examples.first & ~examples.outside & ~hidden.any(axis=1)
    level = _level(scores[known], examples.missing[known])
    return Learnt(
        effects, detectors, estimators, any_gap, null, names, {}, limits, level, rest, general,
        detectability=detectability,
    )  # fmt: skip


def _in_twin(examples: Examples) -> Mask:
    """[examples, effects] Effects of the twin, as given or added."""
    begun = dict(zip(examples.machine[examples.first].tolist(), examples.missing[examples.first], strict=True))
    nothing = np.zeros(examples.missing.shape[1], bool)
    lacked = np.array([begun.get(number, nothing) for number in examples.machine.tolist()])
    return examples.modelled | (lacked.reshape(examples.missing.shape) & ~examples.missing)


def _hidden(
    examples: Examples, log_odds: Mapping[str, Array], effects: tuple[str, ...],
    parameters: tuple[tuple[str, str], ...], names: tuple[str, ...],
) -> tuple[Detectability, Mask]:  # fmt: skip
    """Detectability, and the undetectable effects [examples, effects] of each machine, whatever its twin was given."""
    rows = np.flatnonzero(examples.first)
    detectability, own = learn_detectability(
        {name: odds[rows] for name, odds in log_odds.items()}, examples.missing[rows], examples.values[rows],
        examples.features[rows], effects, parameters, names,
    )  # fmt: skip
    of_machine = dict(zip(examples.machine[rows].tolist(), own, strict=True))
    nothing = np.zeros(len(effects), bool)
    hidden = np.array([of_machine.get(number, nothing) for number in examples.machine.tolist()])
    return detectability, hidden.reshape(examples.missing.shape) & examples.missing
