"""Localisation of a gap: bins in which records and twin differ, at a family-wise error rate, and the share of each.

Paired --deviation of record and of each replicate, per bin--> means over all records, and over those of each fault
       --deviation of few scalars--> contrasts between conditions (fault against the rest, trends over speed, ...)
all of them --exchange of record and replicate within conditions--> step-down max-T --> Places, with shares

Record and replicates are exchanged within each condition as in `two_sample_tests`: the null is exact when the twin
equals the machine, for any dependence between bins. Step-down (Westfall and Young, Resampling-based multiple testing,
1993) removes what is found, so that a large difference does not hide a small one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.stratification import NUMBERS, known_values, varies
from twingap.gap.distance.two_sample_tests import Choice, exchanges
from twingap.gap.report.model import Change, Place, Sign
from twingap.records import Array, Condition

Single = NDArray[np.float32]

ALPHA: Final = 0.05
"""Probability that any place is named when the twin equals the machine. A larger value names more places."""
_CLIP: Final = 4.0
"""Bound of standardised deviations. With a larger one, bins with rare outliers raise the threshold of all bins."""
_LEAST_SPREAD: Final = 0.03
"""Smallest spread of a bin (log units). With a smaller one, bins that hardly vary are found more easily."""
_FEWEST_EXCHANGES: Final = 1000
"""Smallest number of possible exchanges of a subset of records. With fewer, subsets cannot be significant and raise the
threshold of others."""
_ONE_SIDED: Final = 0.8
"""Part of a place's squared difference that must have one sign for the place to have it."""
_SAME: Final = 0.75
"""Ratio of what is left of a place to what was there, above which it is called the same, and below its inverse too."""
_LEAST_SHARE: Final = 0.01
"""Least share of the gap that is shown. A smaller value shows more places."""


@dataclass(frozen=True)
class Located:
    """Where a gap lies."""

    # Significant at the family-wise level, the largest share first. What shares leave of 1 lies in no such place.
    places: tuple[Place, ...]
    p_value: float  # p-value of no difference anywhere: the smallest adjusted one


def locate(pair: Paired, rng: np.random.Generator, draws: int = 999) -> Located:
    """Find the places in which records and twin differ.

    With m replicates of n records no p-value is below about (m + 1)^-n, nor below 1 / (1 + draws) with this number of
    random exchanges of record and replicates. A place names its `condition` where it was found for some faults only.
    Places of the domain "condition" name the conditions at which the gap in level, impulsiveness, band power or lines
    is larger.
    """
    choices = exchanges(pair.n, pair.m, draws, rng)
    deviations = _standardised(pair)
    condition = pair.real.columns("condition") if "condition" in pair.real.domains else slice(0, 0)
    plain = np.ones(deviations.shape[2], bool)
    plain[condition] = False

    # Too few records cannot be significant, and would only raise the threshold of others.
    fewest = math.ceil(math.log(_FEWEST_EXCHANGES) / math.log(pair.m + 1))
    subsets = _subsets(pair.conditions, fewest)
    per_bin = _subset_statistics(deviations[:, :, plain], choices, list(subsets.values()))
    contrasts = _contrasts(pair.conditions, fewest)
    scalars = _contrast_statistics(deviations[:, :, condition], choices, [c.weights for c in contrasts])

    family = np.concatenate((per_bin.reshape(len(choices), -1), scalars.reshape(len(choices), -1)), axis=1)
    if not family.shape[1]:
        return Located((), 1.0)
    p = adjusted(family)
    p_bins = np.ones((len(subsets), plain.size))
    p_bins[:, plain] = p[: per_bin[0].size].reshape(per_bin[0].shape)
    p_contrasts = p[per_bin[0].size :].reshape(scalars[0].shape)

    part = pair.real.weight * pair.over_strata(pair.squares())[0]
    found = _SignificantPlaces(pair, np.maximum(part, 0.0), p_bins, tuple(subsets), np.abs(per_bin[0]), plain)
    places = [*found.bins(), *found.conditions(contrasts, p_contrasts)]
    # Bins without a gap are below zero as often as above, so that the sum is an unbiased total.
    total = max(float(part.sum()), sum(place.share for place in places), 1e-300)
    shared = tuple(replace(place, share=place.share / total) for place in places)
    ordered = tuple(sorted(shared, key=lambda place: (-place.share, place.p_value)))
    return Located(ordered, float(p.min()))


def adjusted(statistics: Single) -> Array:
    """[hypotheses] Step-down max-T p-values, adjusted for all, at least 1 / (1 + draws).

    From statistics [1 + draws, hypotheses], the observed ones first; large values contradict the null.
    """
    order = np.argsort(-statistics[0], kind="stable")
    ranked = statistics[:, order]
    largest = np.maximum.accumulate(ranked[:, ::-1], axis=1)[:, ::-1]
    raw = np.mean(largest >= ranked[0] * (1 - 1e-5) - 1e-6, axis=0)
    out = np.empty(order.size)
    out[order] = np.maximum.accumulate(raw)
    return out


def _standardised(pair: Paired) -> Single:
    """[records, members, bins] Deviation of each member from the mean of the others, in robust standard deviations.

    The spread is taken over all members alike, so that exchanging them changes nothing.
    """
    stacked = pair.stacked
    m = pair.m
    deviations = ((m + 1) * stacked - stacked.sum(axis=1, keepdims=True)) / m
    flat = np.abs(deviations).reshape(-1, deviations.shape[2])
    if m == 1:  # the deviations of record and replicate are equal but for sign
        spread = np.sqrt((flat**2).mean(axis=0))
    else:  # a quantile that the record itself, one of m + 1, does not reach
        level = min(0.8, 1 - 1.5 / (m + 1))
        spread = np.quantile(flat, level, axis=0) / norm.ppf(0.5 + level / 2)
    for domain in pair.real.domains:
        columns = pair.real.columns(domain)
        kinds, part = np.array(pair.real.axes[domain].kind), spread[columns]
        usual = np.array([np.median(part[kinds == kind]) for kind in kinds])
        spread[columns] = np.hypot(part, 0.2 * usual)
    scaled = deviations / np.maximum(spread, _LEAST_SPREAD)
    return np.asarray(np.clip(scaled, -_CLIP, _CLIP), dtype=np.float32)


def _subsets(conditions: Sequence[Condition], fewest: int) -> dict[str | None, NDArray[np.int64]]:
    """All records (None), and those of each fault where there are several faults of enough records."""
    faults = np.array([c.fault or "" for c in conditions])
    names = list(dict.fromkeys(faults))
    out: dict[str | None, NDArray[np.int64]] = {None: np.arange(len(conditions))}
    by_fault = {str(f): np.flatnonzero(faults == f) for f in names} if len(names) > 1 else {}
    return out | {f: places for f, places in by_fault.items() if len(places) >= fewest}


def _subset_statistics(deviations: Single, choices: Choice, subsets: Sequence[NDArray[np.int64]]) -> Single:
    """[draws, subsets, bins] |sum| / sqrt(count) of the deviations of the members chosen as record."""
    members, bins = deviations.shape[1:]
    sums = np.zeros((len(choices), len(subsets), bins), dtype=np.float32)
    # The sum over all is that over the faults, unless some fault has too few records for a subset of its own.
    parted = sum(len(p) for p in subsets[1:]) == len(subsets[0])
    own = list(subsets[1:] if parted else subsets)
    first = len(subsets) - len(own)
    block = max(4096 // members, 1)
    for s, places in enumerate(own):
        for start in range(0, len(places), block):
            part = places[start : start + block]
            chosen = np.zeros((len(choices), len(part), members), dtype=np.float32)
            np.put_along_axis(chosen, choices[:, part, None], np.float32(1), axis=2)
            sums[:, first + s] += chosen.reshape(len(choices), -1) @ deviations[part].reshape(-1, bins)
    if first:
        sums[:, 0] = sums[:, 1:].sum(axis=1)
    counts = np.sqrt(np.array([len(p) for p in subsets], dtype=np.float32))
    return np.asarray(np.abs(sums) / counts[:, None], dtype=np.float32)


@dataclass(frozen=True)
class _Contrast:
    """A comparison between conditions: weights [records] that sum to 0, its variable and fault."""

    variable: str
    weights: Array
    fault: str | None


def _contrasts(conditions: Sequence[Condition], fewest: int) -> list[_Contrast]:
    """Each fault against the rest; trends over speed, load and time, within faults and in each."""
    faults = np.array([c.fault or "" for c in conditions])
    names = list(dict.fromkeys(faults))
    out = []
    for name in names if len(names) > 1 else []:
        inside = faults == name
        out.append(_Contrast("fault", np.where(inside, 1 / inside.sum(), -1 / (~inside).sum()), str(name)))
    for variable in NUMBERS:
        values = known_values([[c] for c in conditions], variable)
        if values is None or not varies(values):
            continue
        weights = values - values.mean()
        for name in names:
            weights[faults == name] = values[faults == name] - values[faults == name].mean()
        out.append(_Contrast(variable, weights, None))
        for name in names if len(names) > 1 else []:
            own = np.where(faults == name, weights, 0.0)
            # A trend through two records is none.
            if np.count_nonzero(own) >= max(fewest, 3):
                out.append(_Contrast(variable, own, str(name)))
    return [c for c in out if np.abs(c.weights).max() > 1e-9]


def _contrast_statistics(deviations: Single, choices: Choice, weights: Sequence[Array]) -> Single:
    """[draws, contrasts, scalars] |weighted sum| over the root of the sum of squared weights."""
    n, _, scalars = deviations.shape
    out = np.zeros((len(choices), len(weights), scalars), dtype=np.float32)
    if not weights or not scalars:
        return out
    table = np.stack([w / np.sqrt(np.sum(w**2)) for w in weights]).astype(np.float32)
    for start in range(0, len(choices), 100):
        some = choices[start : start + 100]
        out[start : start + 100] = np.einsum("cn,dns->dcs", table, deviations[np.arange(n), some])
    return np.abs(out)


class _SignificantPlaces:
    """Significant bins and contrasts as places, whose `share` is still in units of the squared gap."""

    def __init__(
        self,
        pair: Paired,
        part: Array,
        p_bins: Array,
        subsets: tuple[str | None, ...],
        statistic: Single,
        plain: NDArray[np.bool_],
    ) -> None:
        self.pair, self.part, self.p, self.subsets = pair, part, p_bins, subsets
        self.statistic = np.zeros(p_bins.shape)
        self.statistic[:, plain] = statistic

    def bins(self) -> list[Place]:
        """One place for each run of significant bins of a kind; equal stretches of a domain are one place."""
        out: dict[tuple[Any, ...], Place] = {}
        for domain in self.pair.real.domains:
            if domain == "condition":
                continue
            axis, first = self.pair.real.axes[domain], self.pair.real.columns(domain).start
            significant = np.asarray(self.p[:, first : first + len(axis.kind)].min(axis=0) <= ALPHA)
            for run in _runs(significant, axis.kind):
                lo, hi = float(axis.lo[run[0]]), float(axis.hi[run[-1]])
                if domain == "time" and len(run) > 1 and (lo, hi) == (axis.lo[0], axis.hi.max()):
                    place = self._place(domain, None, None, "", first + run)  # at no time in particular
                else:
                    place = self._place(domain, lo, hi, axis.unit, first + run)
                key = (domain, place.lo, place.hi, str(place.condition))
                out[key] = _joined(place, out[key]) if key in out else place
        return list(out.values())

    def _place(
        self, domain: DomainName, lo: float | None, hi: float | None, unit: str, columns: NDArray[np.int64]
    ) -> Place:
        share, p_value = float(self.part[columns].sum()), float(self.p[:, columns].min())
        condition = self._only_some_faults(columns)
        return Place(domain, lo, hi, unit, share, p_value, condition, _sign(self._differences(columns, condition)))

    def _differences(self, columns: NDArray[np.int64], condition: Mapping[str, Any] | None) -> Array:
        """[bins] Mean over records of record less replicates, over the faults of the condition."""
        difference = self.pair.difference[:, columns]
        if condition is not None:
            faults = condition["fault"] if isinstance(condition["fault"], list) else [condition["fault"]]
            difference = difference[[c.fault in faults for c in self.pair.conditions]]
        return np.asarray(difference.mean(axis=0))

    def _only_some_faults(self, columns: NDArray[np.int64]) -> Mapping[str, Any] | None:
        """Faults for which a place was found, where no other fault shows it."""
        if len(self.subsets) < 2:
            return None
        with_it = [
            fault for k, fault in enumerate(self.subsets) if fault is not None and (self.p[k, columns] <= ALPHA).any()
        ]
        without = [k for k, fault in enumerate(self.subsets) if fault is not None and fault not in with_it]
        if not with_it or not without or self.statistic[without][:, columns].max() > 2.5:
            return None
        return {"fault": with_it[0] if len(with_it) == 1 else with_it}

    def conditions(self, contrasts: Sequence[_Contrast], p: Array) -> list[Place]:
        """The clearest significant contrast of each variable; a scalar's part is divided between them evenly."""
        best: dict[str, int] = {}
        for k in np.argsort(p.min(axis=1, initial=1.0), kind="stable"):
            if p[k].min(initial=1.0) <= ALPHA:
                best.setdefault(contrasts[k].variable, int(k))
        if not best:
            return []
        columns = self.pair.real.columns("condition")
        significant = p[list(best.values())] <= ALPHA
        parts = (significant / np.maximum(significant.sum(axis=0), 1)) @ self.part[columns]
        return [
            Place("condition", None, None, "", float(part), float(p[k].min()), self._named(contrasts[k], p[k]))
            for part, k in zip(parts, best.values(), strict=True)
        ]

    def _named(self, contrast: _Contrast, p: Array) -> Mapping[str, Any]:
        """The side of a contrast on which the gap of its clearest scalar is larger."""
        column = self.pair.real.columns("condition").start + int(p.argmin())
        gap = self.pair.difference[:, column]
        faults = np.array([c.fault or "" for c in self.pair.conditions])
        if contrast.variable == "fault":
            own = faults == contrast.fault
            if abs(gap[own].mean()) >= abs(gap[~own].mean()):
                return {"fault": contrast.fault or None}
            others = list(dict.fromkeys(map(str, faults[~own])))  # the gap spares this one fault
            return {"fault": others if len(others) > 1 else others[0]}
        inside = np.flatnonzero((faults == contrast.fault) if contrast.fault is not None else np.ones(gap.size, bool))
        values = np.array([getattr(c, contrast.variable) for c in self.pair.conditions], float)
        low = inside[values[inside] <= np.median(values[inside])]
        high = inside[values[inside] > np.median(values[inside])]
        if not high.size:  # more than half share the largest value
            high, low = low[values[low] == values[low].max()], low[values[low] < values[low].max()]
        side = high if not low.size or abs(gap[high].mean()) >= abs(gap[low].mean()) else low
        named: dict[str, Any] = {contrast.variable: [float(values[side].min()), float(values[side].max())]}
        return named if contrast.fault in (None, "") else named | {"fault": contrast.fault}


def _sign(differences: Array) -> Sign:
    """Which has more, from differences [bins]; squares decide, so that small ones of the other sign do not count."""
    squares = differences**2
    higher = float(squares[differences > 0].sum() / max(squares.sum(), 1e-300))
    return "records_higher" if higher > _ONE_SIDED else "twin_higher" if higher < 1 - _ONE_SIDED else "shape"


def presentable(places: Iterable[Place]) -> tuple[Place, ...]:
    """Places for a reader, the largest share first: overlapping ones of a domain, sign and condition as one, those of
    shares below `_LEAST_SHARE` left out."""
    merged: list[Place] = []
    for place in sorted(places, key=lambda p: (p.lo is not None, p.lo)):
        for i, known in enumerate(merged):
            if _overlap(known, place) and (known.sign, known.condition) == (place.sign, place.condition):
                hi = None if known.hi is None or place.hi is None else max(known.hi, place.hi)
                merged[i] = replace(_joined(known, place), hi=hi)
                break
        else:
            merged.append(place)
    return tuple(sorted((p for p in merged if p.share >= _LEAST_SHARE), key=lambda p: (-p.share, p.p_value)))


def followed(places: Sequence[Place], rest: Sequence[Place], before: Paired, after: Paired) -> tuple[Place, ...]:
    """The places of the gap before, each with what happened to it when effects were added to the twin.

    `rest` are the places of the gap after; `before` and `after` are the comparisons that they were found in.
    """
    parts = [pair.real.weight * pair.over_strata(pair.squares())[0] for pair in (before, after)]
    out = []
    for place in places:
        columns = _bins_of(place, before)
        b, a = (float(np.maximum(part[columns], 0.0).sum()) for part in parts)
        change: Change = "smaller" if a < _SAME * b else "same" if a * _SAME <= b else "larger"
        if change == "smaller" and not any(_overlap(place, other) for other in rest):
            change = "gone"
        out.append(replace(place, after=change) if place.domain != "condition" else place)
    return tuple(out)


def new_ones(rest: Sequence[Place], places: Sequence[Place]) -> tuple[Place, ...]:
    """The places of a rest; those that the twin with the effects made are "new": none was there, or of another sign."""
    return tuple(
        replace(place, after="new")
        if place.domain != "condition" and not any(_overlap(place, p) and p.sign == place.sign for p in places)
        else place
        for place in rest
    )


def _bins_of(place: Place, pair: Paired) -> NDArray[np.int64]:
    """Columns of a place."""
    axis, first = pair.real.axes[place.domain], pair.real.columns(place.domain).start
    lo, hi = (math.inf * side if end is None else end for end, side in ((place.lo, -1), (place.hi, 1)))
    return np.asarray(first + np.flatnonzero((axis.lo >= lo - 1e-9) & (axis.hi <= hi + 1e-9)))


def _overlap(one: Place, other: Place) -> bool:
    """Whether two places share a stretch of one domain; neighbours that only touch do not."""
    if one.domain != other.domain or one.domain == "condition":
        return False
    if one.lo is None or other.lo is None or one.hi is None or other.hi is None:
        return one.lo == other.lo and one.hi == other.hi
    return one.lo < other.hi and other.lo < one.hi


def _joined(place: Place, other: Place) -> Place:
    """The place with the share and significance of both."""
    return replace(place, share=place.share + other.share, p_value=min(place.p_value, other.p_value))


def _runs(significant: NDArray[np.bool_], kinds: Sequence[str]) -> list[NDArray[np.int64]]:
    """Places of neighbouring significant bins of one kind."""
    out: list[list[int]] = []
    for i in map(int, np.flatnonzero(significant)):
        if out and out[-1][-1] == i - 1 and kinds[i] == kinds[i - 1]:
            out[-1].append(i)
        else:
            out.append([i])
    return [np.array(run) for run in out]
