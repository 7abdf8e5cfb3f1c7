"""Two-sample tests between records and twin: classifier AUC and MMD, with exact null distributions.

Paired (records, m replicates each) --centred within each condition--> classifier, cross-validated by group --> AUC
                                                                   --> kernel --> MMD^2
null of both: within each condition one of the m replicates takes the record's place

If the twin equals the machine, a record and its m replicates of the same condition are exchangeable, so p-values of
(1 + #{null >= observed}) / (1 + draws) are valid at any number of records; two records with 19 replicates each can
still be significant. A calibrated twin is tested as calibrated: an error of calibration is a difference like any other.

Sources: Lopez-Paz and Oquab, Revisiting classifier two-sample tests, ICLR 2017, arXiv:1610.06545; Gretton et al., A
kernel two-sample test, JMLR 13 (2012) 723.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.distance.paired import Paired
from twingap.gap.report.model import TwoSampleTest
from twingap.records import Array, Condition

Choice = NDArray[np.int64]

AUC_TEST: Final = "classifier two-sample test (AUC)"
MMD_TEST: Final = "MMD^2"
MOST_RECORDS: Final = 200
_MOST_ROWS: Final = 500
"""Largest number of records, and of records and replicates together, in a test. More take quadratically longer and give
more power."""
_FOLDS: Final = 5
"""Folds of the classifier's cross-validation: more train on more records, and take longer."""
_RIDGE: Final = 0.1
"""Ridge over the mean variance of the classifier's inputs. A larger one suppresses noise and small differences."""


def classifier_test(pair: Paired, rng: np.random.Generator, draws: int = 999) -> tuple[TwoSampleTest, float]:
    """Classifier two-sample test: can a classifier distinguish held-out records from their replicates?

    The classifier is linear, by least squares with a ridge (Fisher's discriminant): its predictions are linear in the
    labels, so every permutation costs a matrix product instead of a training. It has weights for all records and more
    for each fault. Bins are standardised by the spread between replicates; domains have equal weight. The statistic is
    the mean over held-out records of the part of its replicates that score below it, 0.5 where nothing differs; the
    second value is its mean under the null, its floor. `draws` are random exchanges of record and replicates. More than
    200 records, or 500 records and replicates together, are thinned at random.
    """
    rows, kept = _rows(pair, rng)
    conditions = [pair.conditions[i] for i in kept]
    choices = exchanges(len(rows), rows.shape[1] - 1, draws, rng)
    auc = _within_auc(_scores(rows, conditions, choices, rng), choices).mean(axis=1)
    return _tested(AUC_TEST, auc)


def auc_of_records(pair: Paired, rng: np.random.Generator) -> tuple[Array, list[str | None]]:
    """AUC of each (kept) record within its own condition, and the records' groups: for a bootstrap."""
    rows, kept = _rows(pair, rng)
    conditions = [pair.conditions[i] for i in kept]
    real = np.zeros((1, len(rows)), dtype=np.int64)
    return _within_auc(_scores(rows, conditions, real, rng), real)[0], [c.group for c in conditions]


def mmd_test(pair: Paired, rng: np.random.Generator, draws: int = 999) -> tuple[TwoSampleTest, float]:
    """Maximum mean discrepancy, RBF kernel of median width, on feature vectors less their mean within each condition.

    Arguments and results as `classifier_test`. The statistic leaves out the products of a record with itself and with
    its own replicates, so that it is about 0 where nothing differs.
    """
    rows, _ = _rows(pair, rng)
    members, kernel = rows.shape[1], rbf(rows)
    choices = exchanges(len(rows), members - 1, draws, rng)
    return _tested(MMD_TEST, mmd_statistics(kernel, choices, members))


def mmd_kernel(pair: Paired, rng: np.random.Generator) -> tuple[Array, list[str | None]]:
    """[records, records] Kernel mean difference h(i, j) of which MMD^2 is the mean off the diagonal; and the groups."""
    rows, kept = _rows(pair, rng)
    n, members, _ = rows.shape
    z = np.full(members, -1 / (members - 1))
    z[0] = 1.0
    h = np.einsum("a,iajb,b->ij", z, rbf(rows).reshape(n, members, n, members), z)
    return h, [pair.conditions[i].group for i in kept]


def two_sample_tests(pair: Paired, rng: np.random.Generator, draws: int = 999) -> tuple[TwoSampleTest, ...]:
    """The classifier two-sample test and the MMD test."""
    return classifier_test(pair, rng, draws)[0], mmd_test(pair, rng, draws)[0]


def exchanges(n: int, m: int, draws: int, rng: np.random.Generator) -> Choice:
    """[1 + draws, n] Member that takes the place of each of n records: 0 is the record itself, 1..m its replicates.

    The first row is the observed one. All members are equally likely, the record included.
    """
    return np.concatenate((np.zeros((1, n), dtype=np.int64), rng.integers(0, m + 1, (draws, n))))


def p_value(statistics: Array) -> float:
    """(1 + #{null >= observed}) / (1 + draws), from statistics [1 + draws] of which the first is the observed."""
    return float(np.mean(statistics >= statistics[0] - 1e-9 * (1 + abs(statistics[0]))))


def rbf(rows: Array) -> Array:
    """[n members, n members] RBF kernel of rows [n, members, bins], of the median distance."""
    x = rows.reshape(-1, rows.shape[-1])
    square = (x**2).sum(axis=1)
    distance = np.maximum(square[:, None] + square - 2 * x @ x.T, 0.0)
    width = float(np.median(distance[np.triu_indices(len(x), 1)])) if len(x) > 1 else 1.0
    return np.asarray(np.exp(-distance / max(width, 1e-12)))


def mmd_statistics(kernel: Array, choices: Choice, members: int) -> Array:
    """[draws] MMD^2 for each choice of members as records."""
    draws, n = choices.shape
    signs = _labels(choices, members)
    flat = signs.reshape(draws, -1)
    total = np.einsum("dk,dk->d", flat @ kernel, flat)
    if n == 1:
        return np.asarray(total)
    blocks = kernel.reshape(n, members, n, members)[np.arange(n), :, np.arange(n), :]
    own = np.einsum("dna,nab,dnb->d", signs, blocks, signs)
    return np.asarray((total - own) / (n * (n - 1)))


def _labels(choices: Choice, members: int) -> Array:
    """[draws, records, members] 1 for the member that takes the record's place; all members of a record sum to 0."""
    labels = np.full((*choices.shape, members), -1 / (members - 1))
    np.put_along_axis(labels, choices[:, :, None], 1.0, axis=2)
    return labels


def _rows(pair: Paired, rng: np.random.Generator) -> tuple[Array, Choice]:
    """[records, members, bins] standardised, weighted, less the mean of each condition; and which records they are."""
    n, m = min(pair.n, MOST_RECORDS), pair.m
    m = min(m, max(_MOST_ROWS // n - 1, 1))
    kept = np.sort(rng.permutation(pair.n)[:n])
    # The scale is the spread within conditions over all members, the same for every exchange.
    rows = pair.stacked[kept][:, : m + 1]
    spread = np.sqrt(pair.stacked.var(axis=1, ddof=1).mean(axis=0))
    usual = np.median(spread[spread > 0]) if np.any(spread > 0) else 1.0
    rows = (rows - rows.mean(axis=1, keepdims=True)) / np.hypot(spread, 0.2 * usual)
    return np.asarray(rows * np.sqrt(pair.real.weight)), kept


def _scores(rows: Array, conditions: Sequence[Condition], choices: Choice, rng: np.random.Generator) -> Array:
    """[draws, records, members] Scores of every member by classifiers that were not trained on its fold.

    Records of a group are in one fold. A single group leaves nothing to train on: its members are scored by how far
    each stands out.
    """
    n, members, _ = rows.shape
    draws = len(choices)
    labels = _labels(choices, members)
    x = rows.reshape(n * members, -1)
    # Besides common weights, each fault has its own: a missing effect may have opposite signs.
    faults = np.repeat(np.array([c.fault or "" for c in conditions]), members)
    gram = x @ x.T * (1.0 + (faults[:, None] == faults))
    fold = np.repeat(_folds([c.group for c in conditions], rng), members)
    scores = np.zeros((n * members, draws))
    flat = labels.reshape(draws, -1)
    for f in np.unique(fold):
        test, train = fold == f, fold != f
        if not train.any():  # nothing to train on: its own squared norm
            scores[test] = np.diagonal(gram)[test, None]
            continue
        inner = gram[np.ix_(train, train)]
        ridge = _RIDGE * float(np.trace(inner)) / len(inner) + 1e-12
        weights = np.linalg.solve(inner + ridge * np.eye(len(inner)), flat[:, train].T)
        scores[test] = gram[np.ix_(test, train)] @ weights
    return np.asarray(scores.T.reshape(draws, n, members))


def _within_auc(scores: Array, choices: Choice) -> Array:
    """[draws, records] Part of a record's replicates that score below it, ties counting half."""
    chosen = np.take_along_axis(scores, choices[:, :, None], axis=2)
    below = np.asarray(scores < chosen, float).sum(axis=2)
    ties = np.asarray(scores == chosen, float).sum(axis=2) - 1.0
    return np.asarray((below + 0.5 * ties) / float(scores.shape[2] - 1))


def _folds(groups: Sequence[str | None], rng: np.random.Generator) -> Choice:
    """[records] Fold of each; groups stay together."""
    names = list(dict.fromkeys(groups))
    order = rng.permutation(len(names)) % max(min(_FOLDS, len(names)), 1)
    place = dict(zip(names, order, strict=True))
    return np.asarray([place[g] for g in groups], dtype=np.int64)


def _tested(name: str, statistics: Array) -> tuple[TwoSampleTest, float]:
    null = statistics[1:] if statistics.size > 1 else statistics
    return TwoSampleTest(name, float(statistics[0]), p_value(statistics)), float(null.mean())
