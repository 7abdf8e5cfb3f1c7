"""Measures of the gap before and after effects are added: distances, classifier AUC, MMD and classification accuracy.

records, replicates before and after --> overall gap, gap in each domain, AUC, MMD^2, accuracy --> Metrics

To add a measure, write a function of both comparisons that returns a `Metric`, and call it in `closure_metrics`, last,
since all draw from one stream of random numbers. Reports show it by its name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.distance.closure import paired, percentile_interval
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.two_sample_tests import (
    AUC_TEST,
    MMD_TEST,
    auc_of_records,
    classifier_test,
    mmd_kernel,
    mmd_test,
)
from twingap.gap.report.model import Interval, Metric, TwoSampleTest
from twingap.records import Array

TrainingSet = tuple[FeatureVectors, Sequence[str]]
"""Simulated records and their faults."""
TrainingSets = tuple[TrainingSet | None, TrainingSet | None]
"""Those of the twin before and after."""

_AUC: Final = "AUC of a classifier, records against twin"
_MMD: Final = "MMD^2 between records and twin"
_MEASURES: Final[Mapping[str, str]] = {AUC_TEST: _AUC, MMD_TEST: _MMD}
"""Two-sample test -> measure of the same statistic."""
_DRAWS: Final = 400
"""Draws of each bootstrap: more make intervals more precise, and take longer."""
_FOLDS: Final = 5
"""Folds in which a classifier is trained on other real records: more train on more, and take longer."""
_MOST_TRAINING: Final = 2000
"""Largest number of simulated records to train a classifier on. More take longer and hardly raise its accuracy."""
_MOST_EVALUATED: Final = 1000
"""Largest number of real records to evaluate it on. More take longer and reduce the noise."""
_TREES: Final = 40
"""Trees of the classifier. More take longer and make its accuracy depend less on its random numbers."""


def closure_metrics(
    real: FeatureVectors,
    before: Sequence[FeatureVectors],
    after: Sequence[FeatureVectors],
    rng: np.random.Generator,
    *,
    more: TrainingSets = (None, None),
    floors: tuple[float, Mapping[DomainName, float]] | None = None,
    scale: Array | None = None,
) -> tuple[Metric, ...]:
    """The gap before and after, in several measures, from held-out records and replicates of the twin before and after.

    The overall gap, which closures refer to; the gap in each domain; the AUC of the classifier two-sample test; MMD^2;
    and, with at least two known faults of two records or more each, the accuracy on the records of a classifier trained
    on the twin alone. `more` are further simulated records to train it on, where those of the held-out conditions are
    few. `floors` are those of the comparison after, from `Paired.floor`, drawn anew when None; `scale` [bins] as in
    `paired`.
    """
    pairs = paired(real, before, after, scale)
    floor, of_domains = pairs[1].floor(rng) if floors is None else floors
    signs = pairs[0].draw_residuals(rng, _DRAWS)
    (b, domains_b), (a, domains_a) = (p.over_domains(p.squares()) for p in pairs)
    (db, drawn_b), (da, drawn_a) = (p.over_domains(p.resampled(signs)) for p in pairs)
    gaps = [("overall gap", b, a, floor, db, da)]
    gaps += [(f"gap in {d}", domains_b[d], domains_a[d], of_domains[d], drawn_b[d], drawn_a[d]) for d in real.domains]
    out = []
    for name, *ends, least, before_draws, after_draws in gaps:
        vb, va = (float(end[0]) for end in ends)
        ci_a, ci_b = percentile_interval(after_draws, va), percentile_interval(before_draws, vb)
        out.append(Metric(name, vb, va, least, ci_a, ci_b, "standard deviations"))
    return (*out, _auc(pairs, rng), _mmd(pairs, rng), *_accuracy(pairs, rng, more))


def with_statistics(tests: Iterable[TwoSampleTest], metrics: Iterable[Metric]) -> tuple[TwoSampleTest, ...]:
    """Two-sample tests with the statistics of the twin before as in the measures, so that a report states one of each.

    P-values are of all replicates of the twin; measures have as many before as after, which are fewer.
    """
    before = {metric.metric: metric.before for metric in metrics}
    return tuple(replace(test, statistic=before.get(_MEASURES[test.name], test.statistic)) for test in tests)


def accuracy_on_records(
    sims: Sequence[FeatureVectors],
    real: FeatureVectors,
    faults: Sequence[str],
    rng: np.random.Generator,
    more: TrainingSet | None = None,
) -> NDArray[np.bool_]:
    """[records] Whether a classifier trained on simulated records alone names each real record's fault.

    `faults` [records] label the records of `sims` [replicates] and score those of `real`; `more` are further simulated
    records to train on.
    """
    x = np.concatenate([sim.matrix for sim in sims])
    y = np.tile(np.asarray(faults), len(sims))
    if more is not None:
        x, y = np.concatenate((x, more[0].matrix)), np.concatenate((y, np.asarray(more[1])))
    kept = rng.permutation(len(x))[:_MOST_TRAINING]
    return _right(x[kept], y[kept], real.matrix, np.asarray(faults), rng)


def accuracy_between_records(
    real: FeatureVectors, faults: Sequence[str], groups: Sequence[str | None], rng: np.random.Generator
) -> NDArray[np.bool_]:
    """[records] The same for a classifier trained on other real records, of other groups where each fault has several.

    A fault of a single group cannot be learned from another group: then windows of one recording are on both sides, and
    the accuracy is optimistic.
    """
    y = np.asarray(faults)
    by_fault = {f: {g for g, own in zip(groups, y, strict=True) if own == f} for f in np.unique(y)}
    names = list(groups) if all(len(g) > 1 for g in by_fault.values()) else [str(i) for i in range(len(y))]
    fold = np.zeros(len(y), dtype=int)
    for f in np.unique(y):  # each fault spread over the folds
        own = list(dict.fromkeys(n for n, fault in zip(names, y, strict=True) if fault == f))
        place = {name: i % _FOLDS for i, name in enumerate(own[k] for k in rng.permutation(len(own)))}
        for i in np.flatnonzero(y == f):
            fold[i] = place[names[i]]
    right = np.zeros(len(y), bool)
    for k in np.unique(fold):
        test = fold == k
        if np.unique(y[~test]).size > 1:
            right[test] = _right(real.matrix[~test], y[~test], real.matrix[test], y[test], rng)
        else:
            right[test] = y[test] == (y[~test][0] if (~test).any() else None)
    return right


def _auc(pairs: tuple[Paired, Paired], rng: np.random.Generator) -> Metric:
    # The same random numbers for both, so that equal twins have equal values.
    seed = int(rng.integers(2**63))
    (b, groups_b), (a, groups_a) = (auc_of_records(p, np.random.default_rng(seed)) for p in pairs)
    _, floor = classifier_test(pairs[1], rng, draws=99)
    ci_a, ci_b = _mean_interval(a, groups_a, rng), _mean_interval(b, groups_b, rng)
    return Metric(_AUC, float(b.mean()), float(a.mean()), floor, ci_a, ci_b)


def _mmd(pairs: tuple[Paired, Paired], rng: np.random.Generator) -> Metric:
    values, intervals = [], []
    for p in pairs:
        h, groups = mmd_kernel(p, rng)
        units = list(_members(groups))
        table = np.array([[h[np.ix_(i, j)].mean() for j in units] for i in units])
        k = len(units)
        if k == 1:
            values.append(float(table[0, 0]))
            intervals.append((values[-1], values[-1]))
            continue
        weights = np.concatenate((np.ones((1, k)), rng.multinomial(k, np.full(k, 1 / k), _DRAWS)))
        own = weights**2 @ np.diagonal(table)
        off = weights.sum(axis=1) ** 2 - (weights**2).sum(axis=1)
        means = (np.einsum("dk,kl,dl->d", weights, table, weights) - own) / np.maximum(off, 1e-12)
        values.append(float(means[0]))
        intervals.append(percentile_interval(means[1:][off[1:] > 0], values[-1]))
    _, floor = mmd_test(pairs[1], rng, draws=99)
    return Metric(_MMD, values[0], values[1], floor, intervals[1], intervals[0])


def _accuracy(pairs: tuple[Paired, Paired], rng: np.random.Generator, more: TrainingSets) -> Iterator[Metric]:
    faults = [c.fault for c in pairs[0].conditions]
    known = [int(i) for i in np.sort(rng.permutation(len(faults))[:_MOST_EVALUATED]) if faults[i] is not None]
    of_each = Counter(str(faults[i]) for i in known)
    if len(of_each) < 2 or min(of_each.values()) < 2:  # nothing to train on for a class of one record
        return
    labels, groups = [str(faults[i]) for i in known], [pairs[0].conditions[i].group for i in known]
    real = pairs[0].real.take(known)
    # The same random numbers for both, so that differences are not due to the trees.
    seed = int(rng.integers(2**63))
    named = (
        accuracy_on_records([s.take(known) for s in p.sims], real, labels, np.random.default_rng(seed), further)
        for p, further in zip(pairs, more, strict=True)
    )
    b, a = (right.astype(float) for right in named)
    among = accuracy_between_records(real, labels, groups, rng)
    ci_a, ci_b = _mean_interval(a, groups, rng), _mean_interval(b, groups, rng)
    name = "accuracy on the records of a classifier trained on the twin (higher is better)"
    yield Metric(name, float(b.mean()), float(a.mean()), float(among.mean()), ci_a, ci_b, higher_is_better=True)


def _right(
    x: Array, y: NDArray[np.str_], test: Array, truth: NDArray[np.str_], rng: np.random.Generator
) -> NDArray[np.bool_]:
    from sklearn.ensemble import ExtraTreesClassifier  # a slow import

    trees = ExtraTreesClassifier(_TREES, max_features="sqrt", random_state=int(rng.integers(2**31)), n_jobs=1)
    return np.asarray(trees.fit(x, y).predict(test) == truth)


def _members(groups: Sequence[str | None]) -> Iterator[list[int]]:
    """Places of the records of each group."""
    for name in dict.fromkeys(groups):
        yield [i for i, g in enumerate(groups) if g == name]


def _mean_interval(values: Array, groups: Sequence[str | None], rng: np.random.Generator) -> Interval:
    """90 % interval of the mean of values [records], groups drawn together."""
    units = list(_members(groups))
    sums, counts = (np.array([f(values[i]) for i in units], float) for f in (np.sum, np.size))
    weights = rng.multinomial(len(units), np.full(len(units), 1 / len(units)), _DRAWS)
    return percentile_interval((weights @ sums) / (weights @ counts), float(values.mean()))
