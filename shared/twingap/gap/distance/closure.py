"""How far the gap shrinks when effects are added to the twin: closure with intervals, in several measures.

records, replicates before, replicates after --Paired, one yardstick--> distances, AUC, MMD^2, accuracy --> Metrics
                                             --bootstrap over groups, before and after together--> intervals

Coverage of the 90 % interval of the closure, measured on 150 simulated worlds each (40 Gaussian bins of which 8 differ
by 3 standard deviations before, 10 replicates; a part of it is run in `tests/twingap/gap/test_shrink.py`):

records (strata)   8 (4)   24 (4)   true gap left, of 3
                   1.00    0.99     0 (the truth taken as closure 1: down to the floor)
                   1.00    0.98     1
                   0.99    0.96     2

It errs on the wide side; so it does with one replicate, as of finished records (8 to 24 records, 60 worlds each: 0.92
to 1.00). Intervals of the gaps before and after are given the yardstick, the records' own spread: they
leave out its uncertainty (2 to 8 % here), which cancels in the closure, and so cover less where a gap is large (the
gap before in 0.61 to 0.85 of these worlds, the gap after in 0.83 to 1).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.distance.feature_vectors import Views
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.two_sample_tests import auc_of_records, classifier_test, mmd_kernel, mmd_test
from twingap.gap.report.model import Curve, Domain, Interval, Metric
from twingap.records import Condition

Array = NDArray[np.float64]
Lessons = tuple[tuple[Views, Sequence[str]] | None, tuple[Views, Sequence[str]] | None]
"""Simulated records and their faults, of the twin before and after."""

_LESSONLESS: Final[Lessons] = (None, None)
LEVEL: Final = 0.9
_MOST_TRAINING: Final = 2000
_MOST_JUDGED: Final = 1000
CLOSURE_BOUNDS: Final = (-10.0, 2.0)
"""Closures beyond are no more informative than these; they come from gaps that are hardly there."""


@dataclass(frozen=True)
class Closure:
    """What adding something to the twin did to the gap.

    Parameters
    ----------
    before, after, floor : float
        Overall gap without and with it, and between records and records.
    closure : float
        (before - after) / (before - floor), no less than -10, no more than 2; 0 where there was nothing to close.
    ci : (float, float)
        90 % interval.
    before_ci, after_ci : (float, float)
        90 % intervals of the gaps themselves.
    """

    before: float
    after: float
    floor: float
    closure: float
    ci: Interval
    before_ci: Interval
    after_ci: Interval


def closure(before: float, after: float, floor: float) -> float:
    """(before - after) / (before - floor): 1 when the gap is down to the floor, negative when it grew.

    A gap that was at its floor already had nothing to close: 0. Bounded to -10 .. 2.
    """
    return float(_closures(np.array([before]), np.array([after]), floor)[0])


def gap_closure(
    real: Views,
    before: Sequence[Views],
    after: Sequence[Views],
    rng: np.random.Generator,
    conditions: Sequence[Condition] | None = None,
    draws: int = 400,
) -> Closure:
    """Closure of the overall gap on held-out records, with intervals.

    Parameters
    ----------
    real : Views
        Records that nothing was fitted to.
    before, after : sequence of Views [replicates]
        The twin without and with what was added. The floor is that of the twin after.
    rng : numpy.random.Generator
    conditions : sequence of Condition, optional
    draws : int
        Of the bootstrap.
    """
    pairs = paired(real, before, after, conditions)
    floor, _ = pairs[1].floor(rng)
    return closure_interval(*pairs, floor, rng, draws)


def paired(
    real: Views, before: Sequence[Views], after: Sequence[Views], conditions: Sequence[Condition] | None = None
) -> tuple[Paired, Paired]:
    """Both comparisons, standardised by one and the same spread: the smaller of the two."""
    first, second = Paired(real, before, conditions), Paired(real, after, conditions)
    scale = np.minimum(first.scale, second.scale)
    return Paired(real, before, conditions, scale), Paired(real, after, conditions, scale)


def closure_interval(
    before: Paired, after: Paired, floor: float, rng: np.random.Generator, draws: int = 400
) -> Closure:
    """Closure from two comparisons of the same records; residuals of groups are drawn anew, for both alike."""
    (b,), (a,) = before.over_views(before.squares())[0], after.over_views(after.squares())[0]
    signs = before.draw_residuals(rng, draws)
    drawn_b, drawn_a = (p.over_views(p.resampled(signs))[0] for p in (before, after))
    value = closure(float(b), float(a), floor)
    return Closure(
        float(b), float(a), floor, value,
        _around(_closures(drawn_b, drawn_a, floor), value), _around(drawn_b, float(b)), _around(drawn_a, float(a)),
    )  # fmt: skip


def shrink_metrics(
    real: Views,
    before: Sequence[Views],
    after: Sequence[Views],
    rng: np.random.Generator,
    conditions: Sequence[Condition] | None = None,
    draws: int = 400,
    *,
    more: Lessons | None = None,
    floors: tuple[float, Mapping[Domain, float]] | None = None,
) -> tuple[Metric, ...]:
    """The gap before and after, in several measures; the first is the overall gap, of which closures speak.

    Parameters
    ----------
    real : Views
        Held-out records.
    before, after : sequence of Views [replicates]
    rng : numpy.random.Generator
    conditions : sequence of Condition, optional
        With the records' faults where they are known; those of `real` when None.
    draws : int
        Of each bootstrap.
    more : Lessons, optional
        Further simulated records to train on, where those of the held-out conditions are few.
    floors : (float, Mapping), optional
        Of the comparison after, overall and by view, as `Paired.floor` draws them; drawn anew when None.

    Returns
    -------
    tuple of Metric
        Overall gap, gap per view, AUC of the classifier two-sample test, MMD^2, and, with at least two known faults of
        two records or more each, the accuracy on the records of a classifier trained on the twin alone.
    """
    pairs = paired(real, before, after, conditions)
    floor, of_views = pairs[1].floor(rng) if floors is None else floors
    signs = pairs[0].draw_residuals(rng, draws)
    (b, views_b), (a, views_a) = (p.over_views(p.squares()) for p in pairs)
    (db, drawn_b), (da, drawn_a) = (p.over_views(p.resampled(signs)) for p in pairs)
    unit = "standard deviations"
    out = [Metric("overall gap", b[0], a[0], floor, _around(da, a[0]), _around(db, b[0]), unit)]
    for domain in real.domains:
        vb, va = float(views_b[domain][0]), float(views_a[domain][0])
        ci_a, ci_b = _around(drawn_a[domain], va), _around(drawn_b[domain], vb)
        out.append(Metric(f"gap in {domain}", vb, va, of_views[domain], ci_a, ci_b, unit))
    out = [_plain(metric) for metric in out]
    return (*out, _auc(pairs, rng, draws), _mmd(pairs, rng, draws), *_accuracy(pairs, rng, draws, more))


def accuracy_on_records(
    sims: Sequence[Views],
    real: Views,
    faults: Sequence[str],
    rng: np.random.Generator,
    more: tuple[Views, Sequence[str]] | None = None,
) -> NDArray[np.bool_]:
    """[records] Whether a classifier trained on simulated records alone names each real record's fault.

    Parameters
    ----------
    sims : sequence of Views [replicates]
        Record i of each is simulated under fault i of `faults`.
    real : Views
    faults : sequence of str [records]
        Used to label the simulated records, and to score the real ones.
    rng : numpy.random.Generator
    more : (Views, sequence of str), optional
        Further simulated records to train on, and their faults.
    """
    x = np.concatenate([sim.matrix for sim in sims])
    y = np.tile(np.asarray(faults), len(sims))
    if more is not None:
        x, y = np.concatenate((x, more[0].matrix)), np.concatenate((y, np.asarray(more[1])))
    kept = rng.permutation(len(x))[:_MOST_TRAINING]
    return _right(x[kept], y[kept], real.matrix, np.asarray(faults), rng)


def accuracy_between_records(
    real: Views, faults: Sequence[str], groups: Sequence[str | None], rng: np.random.Generator, folds: int = 5
) -> NDArray[np.bool_]:
    """[records] The same, trained on the other real records: of other groups, where each fault has several.

    A fault of a single group cannot be learnt from another one; then windows of one recording are on both sides, and
    the figure flatters.
    """
    y = np.asarray(faults)
    by_fault = {f: {g for g, own in zip(groups, y, strict=True) if own == f} for f in np.unique(y)}
    names = list(groups) if all(len(g) > 1 for g in by_fault.values()) else [str(i) for i in range(len(y))]
    fold = np.zeros(len(y), dtype=int)
    for f in np.unique(y):  # each fault spread over the folds
        own = list(dict.fromkeys(n for n, fault in zip(names, y, strict=True) if fault == f))
        place = {name: i % folds for i, name in enumerate(own[k] for k in rng.permutation(len(own)))}
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


def curves(
    real: Views,
    before: Sequence[Views],
    after: Sequence[Views] | None = None,
    conditions: Sequence[Condition] | None = None,
) -> Mapping[str, Curve]:
    """Lines for figures: medians over records, with the stretch in which 90 % of them lie.

    Returns
    -------
    Mapping, name -> Curve
        "spectrum", "lines", "envelope", "order", "amplitude", "time", and "condition" (RMS by fault or speed).
    """
    pair = Paired(real, before, conditions)
    per_decibel = 10 / np.log(10)
    wanted: tuple[tuple[str, Domain, str, str, str, str, float], ...] = (
        ("spectrum", "frequency", "level", "Hz", "dB", "Spectrum between its lines", per_decibel),
        ("lines", "frequency", "lines", "Hz", "dB over the floor", "Lines of the spectrum", per_decibel),
        ("envelope", "envelope_order", "lines", "shaft orders", "dB over the floor", "Envelope spectrum", per_decibel),
        ("order", "order", "lines", "shaft orders", "dB over the floor", "Order spectrum", per_decibel),
        ("amplitude", "amplitude", "shape", "quantile", "dB of rms", "Amplitudes |x|", 2 * per_decibel),
        ("time", "time", "level", "s", "dB of the record's rms", "Level within the record", 2 * per_decibel),
    )
    out = {}
    for name, domain, kind, x_unit, y_unit, title, factor in wanted:
        if domain not in real.domains:
            continue
        axis = real.axes[domain]
        chosen = np.flatnonzero(np.array(axis.kind) == kind)
        x = tuple(float(v) for v in (axis.lo[chosen] + axis.hi[chosen])[: chosen.size] / 2)
        values = partial(_columns, domain=domain, columns=chosen, factor=factor)
        out[name] = _curve(x, x_unit, y_unit, title, domain, values, real, before, after)
    if "condition" in real.domains:
        labels = tuple(_label([pair.conditions[i] for i in places]) for places in pair.strata)

        def by_stratum(v: Views) -> Array:
            rms = v.values["condition"][:, 0] * 2 * per_decibel
            longest = max(len(p) for p in pair.strata)
            table = np.full((longest, len(pair.strata)), np.nan)
            for k, places in enumerate(pair.strata):
                table[: len(places), k] = rms[places]
            return table

        title, unit = "Level by condition", "dB of healthy rms"
        out["condition"] = _curve(labels, "condition", unit, title, "condition", by_stratum, real, before, after)
    return out


def _columns(views: Views, domain: Domain, columns: NDArray[np.int64], factor: float) -> Array:
    return views.values[domain][:, columns] * factor


def _curve(
    x: tuple[float, ...] | tuple[str, ...],
    x_unit: str,
    y_unit: str,
    title: str,
    domain: Domain,
    values: Callable[[Views], Array],
    real: Views,
    before: Sequence[Views],
    after: Sequence[Views] | None,
) -> Curve:
    sets = {"real": values(real), "before": np.concatenate([values(v) for v in before])}
    if after is not None:
        sets["after"] = np.concatenate([values(v) for v in after])
    middle = {name: tuple(np.nanmedian(v, axis=0).tolist()) for name, v in sets.items()}
    bands = {
        name: (tuple(np.nanquantile(v, 0.05, axis=0).tolist()), tuple(np.nanquantile(v, 0.95, axis=0).tolist()))
        for name, v in sets.items()
    }
    return Curve(x, x_unit, middle["real"], middle["before"], middle.get("after"), y_unit, title, domain, bands)


def _label(conditions: Sequence[Condition]) -> str:
    faults = dict.fromkeys(c.fault or "unknown fault" for c in conditions)
    speeds = [c.speed_rpm for c in conditions]
    low, high = min(speeds), max(speeds)
    speed = f"{low:.0f}" if high - low < 0.01 * high else f"{low:.0f} to {high:.0f}"
    loads = [c.load_n for c in conditions if c.load_n is not None]
    load = "" if not loads or len(loads) < len(speeds) else f", {min(loads):g} to {max(loads):g} N"
    return f"{'/'.join(faults)}, {speed} rpm{load}"


def _auc(pairs: tuple[Paired, Paired], rng: np.random.Generator, draws: int) -> Metric:
    # The same lots for both, as in `_accuracy`: where nothing was added, nothing differs.
    lots = int(rng.integers(2**63))
    (b, groups_b), (a, groups_a) = (auc_of_records(p, np.random.default_rng(lots)) for p in pairs)
    floor = classifier_test(pairs[1], rng, draws=99).null_mean
    name = "AUC of a classifier, records against twin"
    ci_a, ci_b = _mean_interval(a, groups_a, rng, draws), _mean_interval(b, groups_b, rng, draws)
    return Metric(name, float(b.mean()), float(a.mean()), floor, ci_a, ci_b)


def _mmd(pairs: tuple[Paired, Paired], rng: np.random.Generator, draws: int) -> Metric:
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
        weights = np.concatenate((np.ones((1, k)), rng.multinomial(k, np.full(k, 1 / k), draws)))
        own = weights**2 @ np.diagonal(table)
        off = weights.sum(axis=1) ** 2 - (weights**2).sum(axis=1)
        means = (np.einsum("dk,kl,dl->d", weights, table, weights) - own) / np.maximum(off, 1e-12)
        values.append(float(means[0]))
        intervals.append(_around(means[1:][off[1:] > 0], values[-1]))
    floor = mmd_test(pairs[1], rng, draws=99).null_mean
    return Metric("MMD^2 between records and twin", values[0], values[1], floor, intervals[1], intervals[0])


def _accuracy(
    pairs: tuple[Paired, Paired], rng: np.random.Generator, draws: int, more: Lessons | None
) -> Iterator[Metric]:
    faults = [c.fault for c in pairs[0].conditions]
    known = [int(i) for i in np.sort(rng.permutation(len(faults))[:_MOST_JUDGED]) if faults[i] is not None]
    of_each = Counter(str(faults[i]) for i in known)
    if len(of_each) < 2 or min(of_each.values()) < 2:  # of one record nothing is learnt that another could be told by
        return
    labels, groups = [str(faults[i]) for i in known], [pairs[0].conditions[i].group for i in known]
    real = pairs[0].real.take(known)
    # The same lots for both: a difference between them is the records', not the trees'.
    lots = int(rng.integers(2**63))
    b, a = (
        accuracy_on_records([s.take(known) for s in p.sims], real, labels, np.random.default_rng(lots), further).astype(
            float
        )
        for p, further in zip(pairs, _LESSONLESS if more is None else more, strict=True)
    )
    among = accuracy_between_records(real, labels, groups, rng)
    ci_a, ci_b = _mean_interval(a, groups, rng, draws), _mean_interval(b, groups, rng, draws)
    name = "accuracy on the records of a classifier trained on the twin (higher is better)"
    yield Metric(name, float(b.mean()), float(a.mean()), float(among.mean()), ci_a, ci_b, higher_is_better=True)


def _right(
    x: Array, y: NDArray[np.str_], test: Array, truth: NDArray[np.str_], rng: np.random.Generator
) -> NDArray[np.bool_]:
    from sklearn.ensemble import ExtraTreesClassifier  # a second that the command line need not wait

    trees = ExtraTreesClassifier(120, max_features="sqrt", random_state=int(rng.integers(2**31)), n_jobs=1)
    return np.asarray(trees.fit(x, y).predict(test) == truth)


def _members(groups: Sequence[str | None]) -> Iterator[list[int]]:
    """Places of the records of each group."""
    for name in dict.fromkeys(groups):
        yield [i for i, g in enumerate(groups) if g == name]


def _mean_interval(values: Array, groups: Sequence[str | None], rng: np.random.Generator, draws: int) -> Interval:
    """90 % interval of the mean of values [records], groups drawn together."""
    units = list(_members(groups))
    sums, counts = (np.array([f(values[i]) for i in units], float) for f in (np.sum, np.size))
    weights = rng.multinomial(len(units), np.full(len(units), 1 / len(units)), draws)
    return _around((weights @ sums) / (weights @ counts), float(values.mean()))


def _closures(before: Array, after: Array, floor: float) -> Array:
    """[draws] Closures, bounded; 0 where `before` does not exceed its floor."""
    open_gap = before - floor
    there = open_gap > 1e-9 * max(abs(floor), 1e-9)
    ratio = (before - after) / np.where(there, open_gap, 1.0)
    return np.clip(np.where(there, ratio, 0.0), *CLOSURE_BOUNDS)


def _around(drawn: Array, value: float) -> Interval:
    """Percentile interval that holds the estimate itself."""
    if not drawn.size:
        return value, value
    low, high = np.quantile(drawn, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2])
    return min(float(low), value), max(float(high), value)


def _plain(metric: Metric) -> Metric:
    return Metric(
        metric.metric, float(metric.before), float(metric.after), metric.floor,
        metric.ci_after, metric.ci_before, metric.unit,
    )  # fmt: skip
