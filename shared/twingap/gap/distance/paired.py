"""How far records and twin lie apart, in each view and overall, with the floor beside it.

Views of records --+
                   +--Paired--> differences [records, bins] --strata, slopes--> squares per bin, unbiased
Views of replicates+                                                             |
                                          standardised by the records' spread <--+--> per view --> overall, floor

The difference of a record is its view less the mean of its simulated replicates of the same condition. What of it is
the same in a stratum of conditions, and what goes straight with speed, load or time within all strata, is the gap: a
twin whose level is right in the middle and wrong at both ends of the speeds, or of the run, is not right. Its square is
that of estimated means and slopes less the variance that scatter about them leaves (one-way U-statistic; analysis of
covariance, Scheffe 1959, ch. 6), so noise between records adds nothing on average: two sets of one machine are at
distance 0 but for chance. The floor says how large chance is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.gap.distance.feature_vectors import Views
from twingap.gap.distance.stratification import about_trend, slopes, strata, witnesses
from twingap.gap.report.model import Domain
from twingap.records import Condition

Array = NDArray[np.float64]
Places = NDArray[np.int64]

_LARGEST_POOL = 512
_LEAST_LEFT: Final = 0.1
"""Part of a unit's scatter that means and slopes must leave for it to say anything of scatter."""
_ALIKE: Final = 4.0
"""Degrees of freedom that the spread of a kind's other bins is worth to one bin's, where records alone tell of it."""
_LEAST_SPREAD = 0.05
"""No bin's spread counts as less (log units): a bin that never varies would drown all others."""
_PLAIN: Final = 16.0
"""Square of four standard deviations: what is plain to anyone gets little plainer. By squares alone, one strong tone or
a converter's repeated samples would be all of the gap, and nothing else that is closed would count."""


@dataclass(frozen=True)
class Distance:
    """Gap between records and twin: standard deviations between records, root mean square over bins and views.

    Squares beyond four standard deviations count with their logarithm.

    Parameters
    ----------
    overall : float
        Root of the mean over views of the squared distances per view; a view's is the mean over its kinds of bins.
    views : Mapping, domain -> float
    floor : float
        What records measured against other records of the same machine show on average: the overall gap of a twin that
        lacks nothing.
    view_floors : Mapping, domain -> float
    """

    overall: float
    views: Mapping[Domain, float]
    floor: float
    view_floors: Mapping[Domain, float]


class Drawn(NamedTuple):
    """How often residuals of a pool stand for the units of a stratum.

    Parameters
    ----------
    signed : Array [draws, pool]
        Plus less minus.
    plain : Array [draws, pool]
        In all.
    tilted : Array [slopes, draws, pool]
        Plus less minus, each times its unit's place on a slope.
    """

    signed: Array
    plain: Array
    tilted: Array


class Paired:
    """Records and their simulated replicates, side by side.

    Parameters
    ----------
    real : Views
    sims : sequence of Views [m replicates]
        Each holds one record per real record, in the same order and of the same condition, from its own random numbers.
    conditions : sequence of Condition, optional
        Of the records; those of `real` when None.
    scale : Array [bins], optional
        Spread to standardise by, from another `Paired` of the same records: distances before and after are then
        measured with one yardstick. None = its own.

    Raises
    ------
    TwingapError
        Without replicates, or when they do not match the records.
    """

    def __init__(
        self,
        real: Views,
        sims: Sequence[Views],
        conditions: Sequence[Condition] | None = None,
        scale: Array | None = None,
    ) -> None:
        if not sims:
            raise TwingapError("no simulated records to compare with", where="distance")
        for sim in sims:
            if sim.matrix.shape != real.matrix.shape or sim.domains != real.domains:
                raise TwingapError(
                    f"{len(sim)} simulated records of {sim.matrix.shape[1]} bins against {len(real)} records of "
                    f"{real.matrix.shape[1]}",
                    where="distance", mend="simulate every record's condition, and measure both on one grid",
                )  # fmt: skip
        self.real, self.sims = real, tuple(sims)
        self.conditions = tuple(conditions or real.conditions)
        self.n, self.m = len(real), len(sims)
        self._scale = scale

    @cached_property
    def stacked(self) -> Array:
        """[records, 1 + replicates, bins] The record first."""
        return np.stack([self.real.matrix, *(sim.matrix for sim in self.sims)], axis=1)

    @cached_property
    def difference(self) -> Array:
        """[records, bins] Record less the mean of its replicates."""
        return np.asarray(self.real.matrix - np.mean([sim.matrix for sim in self.sims], axis=0))

    @cached_property
    def strata(self) -> tuple[Places, ...]:
        """Places of the records of each stratum of conditions. See `strata`."""
        return strata(self.conditions)

    @cached_property
    def units(self) -> tuple[Array, ...]:
        """Per stratum [units, bins]: means of the differences of its units' records."""
        return tuple(np.stack([self.difference[unit].mean(axis=0) for unit in own]) for own in self._witnesses)

    @cached_property
    def _witnesses(self) -> tuple[list[Places], ...]:
        """Per stratum, places of the records of each of its units."""
        return tuple(
            [places[unit] for unit in witnesses([self.conditions[i] for i in places])] for places in self.strata
        )

    @cached_property
    def scale(self) -> Array:
        """[bins] Spread between records under equal conditions, real and simulated pooled, never less than 0.05.

        A fifth of the median spread of a bin's kind is added in squares, lest a bin that is quiet by chance counts
        most; where records alone tell of spread, the kind's counts as some more records.
        """
        if self._scale is not None:
            return self._scale
        own, free = self._spread
        weight = 0.5 * free / (free + 4) if self.m > 1 else float(free > 0)
        if self.m > 1:
            replicates = self.stacked[:, 1:]
            between = replicates.var(axis=1, ddof=1).mean(axis=0)
            own = weight * own + (1 - weight) * between
        elif not free:
            own = np.ones_like(own)
        for domain in self.real.domains:
            columns = self.real.columns(domain)
            part, kinds = own[columns], np.array(self.real.axes[domain].kind)
            usual = np.empty_like(part)
            for kind in np.unique(kinds):
                usual[kinds == kind] = np.median(part[kinds == kind])
            if self.m == 1:
                part = (free * part + _ALIKE * usual) / (free + _ALIKE)
            own[columns] = part + 0.04 * usual
        return np.asarray(np.sqrt(np.maximum(own, _LEAST_SPREAD**2)))

    @cached_property
    def _spread(self) -> tuple[Array, int]:
        """[bins] Variance of a record under equal conditions, as differences show it, and its degrees of freedom."""
        rows: list[Array] = [self.difference[p] for p in self.strata]
        tilts = slopes([[[self.conditions[i]] for i in p] for p in self.strata])
        free = sum(len(d) - 1 for d in rows) - tilts[0].shape[1]
        square = np.sum([np.sum(rest**2, axis=0) for rest in about_trend(rows, tilts)[0]], axis=0)
        return np.asarray(square / max(free, 1) / (1 + 1 / self.m)), free

    @cached_property
    def _by_own_scatter(self) -> Array | float:
        """[bins] By how much noise counts more where the scale is of the records' own scatter.

        A bin that scatters little by chance is standardised by little: its mean counts for more, and the noise that is
        taken out of it does not, since it is small by the same chance. The mean square over an estimated variance of
        nu degrees of freedom exceeds that over the true one by nu / (nu - 2) (F distribution); here the first order of
        the same for a variance that is partly a kind's.
        """
        if self.m > 1:
            return 1.0
        own, free = self._spread
        return np.asarray(1 + 2 / max(free + _ALIKE - 2, 1) * np.minimum(own / self.scale**2, 1))

    @cached_property
    def noise(self) -> Array:
        """[bins] Variance of one record's difference that simulated spread alone explains; 0 with one replicate."""
        if self.m < 2:
            return np.zeros(self.difference.shape[1])
        return np.asarray(self.stacked[:, 1:].var(axis=1, ddof=1).mean(axis=0) * (1 + 1 / self.m))

    def squares(self) -> Array:
        """Unbiased squared gap of each bin in each stratum, standardised.

        In the condition view, of which the strata are the bins proper, what all strata have in common is taken out: it
        is seen by the other views, and would not say where.

        Returns
        -------
        Array [1, strata, bins]
            May be negative; zero on average where nothing differs.
        """
        return self._contrasted(self._squares, self._trend[1])

    @cached_property
    def tilts(self) -> tuple[Array, ...]:
        """Per stratum [units, slopes]: see `slopes`."""
        return slopes([[[self.conditions[i] for i in unit] for unit in own] for own in self._witnesses])

    @cached_property
    def _count(self) -> int:
        """Of all units."""
        return sum(len(own) for own in self._witnesses)

    @cached_property
    def _fitted(self) -> tuple[list[Array], list[Array], Array]:
        """Units, standardised; what is left of them beside their stratum's mean and slopes; slopes [slopes, bins]."""
        units = [u / self.scale for u in self.units]
        return units, *about_trend(units, self.tilts)

    @cached_property
    def _variances(self) -> list[Array]:
        """[bins] of one unit, per stratum: what its own scatter does not know for the slopes, all strata's says."""
        _, rests, steepness = self._fitted
        squares = [np.sum(rest**2, axis=0) for rest in rests]
        free = sum(len(rest) - 1 for rest in rests) - len(steepness)
        pooled = np.sum(squares, axis=0) / max(free, 1)
        lost = [float(np.sum(tilt**2)) for tilt in self.tilts]
        more = self._by_own_scatter
        return [
            more * (square + loss * pooled) / (len(rest) - 1) if len(rest) > 1 else self.noise / self.scale**2
            for square, loss, rest in zip(squares, lost, rests, strict=True)
        ]

    @cached_property
    def _squares(self) -> tuple[tuple[Array, Array], ...]:
        """Per stratum, unbiased square of the mean difference, and that mean; both [1, bins]."""
        means = [u.mean(axis=0, keepdims=True) for u in self._fitted[0]]
        return tuple(
            (mean**2 - variance / len(units), mean)
            for mean, variance, units in zip(means, self._variances, self._fitted[0], strict=True)
        )

    @cached_property
    def _trend(self) -> tuple[Array, Array]:
        """Slopes [slopes, bins], and their mean square over units, unbiased [1, bins]."""
        steepness = self._fitted[2]
        noise = sum(
            (tilt.T**2).sum(axis=1)[:, None] * variance
            for tilt, variance in zip(self.tilts, self._variances, strict=True)
        )
        return steepness, np.asarray((steepness**2 - noise).sum(axis=0, keepdims=True) / self._count)

    def misfit(self) -> float:
        """Distance with the noise of the records' means left in: smooth in whatever makes the replicates.

        For fitting values: what is taken out of `squares` may leave nothing, or nothing to go by. With more than one
        replicate the noise of simulations is taken out, since values that make it small would come nearer by that
        alone: many small knocks for a few large ones, strikes that hardly scatter.
        """
        steepness, noises = self._fitted[2], self._simulated_variances
        trend = (steepness**2).sum(axis=0, keepdims=True) / self._count
        for tilt, noise in zip(self.tilts, noises, strict=True):
            trend = trend - float(np.sum(tilt**2)) * noise / self._count
        parts = [
            (mean**2 - noise / len(own), mean)
            for (_, mean), noise, own in zip(self._squares, noises, self._witnesses, strict=True)
        ]
        # Where noise by chance seems larger than it is, less than nothing would be left, and values be sought for that.
        means = np.maximum(self.over_strata(self._contrasted(parts, trend)), 0.0)
        return float(self._of_views(means)[0][0])

    @cached_property
    def _simulated_variances(self) -> list[Array]:
        """[bins] of a unit's mean over replicates, per stratum, as the replicates show it; 0 of one replicate."""
        if self.m < 2:
            return [np.zeros(self.scale.size)] * len(self.strata)
        of_record = self.stacked[:, 1:].var(axis=1, ddof=1) / self.m / self.scale**2
        return [
            np.mean([of_record[unit].sum(axis=0) / len(unit) ** 2 for unit in own], axis=0) for own in self._witnesses
        ]

    def residuals(self) -> Array:
        """[strata + slopes, bins] Standardised means and slopes: `misfit` is the root of their squares, tempered, less
        what simulations scatter by.

        Of the condition view what strata do not have in common, as everywhere.
        """
        means = np.stack([mean[0] for _, mean in self._squares])
        if "condition" in self.real.domains:
            own = self.real.columns("condition")
            means[:, own] -= self.stratum_weight @ means[:, own]
        parts = np.sqrt(self.stratum_weight)[:, None] * means, self._fitted[2] / np.sqrt(self._count)
        return np.concatenate(parts)

    def counts(self) -> Array:
        """[bins] How much a little more of a bin's square adds to that of the misfit, as it stands."""
        squares = (self.residuals() ** 2).sum(axis=0)
        return np.asarray(self.real.weight * np.minimum(1, _PLAIN / np.maximum(squares, 1e-12)))

    def resampled(self, drawn: Sequence[Drawn]) -> Array:
        """Squares as they might have come out with other records of the same machine.

        Each unit becomes its stratum's mean and trend plus a random residual of random sign, drawn from the residuals
        of all strata: few units in a stratum would not do to draw from. The bias that the noise of means and slopes
        adds is taken out.

        Parameters
        ----------
        drawn : sequence of Drawn
            From `draw_residuals`; one and the same for two comparisons of the same records, so that intervals of what
            changed between them do not count the records' noise twice.

        Returns
        -------
        Array [draws, strata, bins]
        """
        pool, parts = self._residuals, []
        steepness, trend = self._trend
        for (square, mean), units, lots in zip(self._squares, self.units, drawn, strict=True):
            k = len(units)
            if not len(pool):
                parts.append((np.repeat(square, len(lots.signed), axis=0), np.repeat(mean, len(lots.signed), axis=0)))
                continue
            moved = lots.signed @ pool / k
            means = mean + moved
            if k == 1:
                spread = (pool**2).mean(axis=0)
                parts.append((means**2 - spread - mean**2 + square, means))
                continue
            own = lots.plain @ pool**2 / k + mean**2 + 2 * mean * moved
            parts.append(((k * means**2 - own) / (k - 1) - mean**2 + square, means))
        return self._contrasted(parts, trend + self._trend_moved(drawn, steepness))

    def _trend_moved(self, drawn: Sequence[Drawn], steepness: Array) -> Array:
        """[draws, bins] By how much residuals drawn anew move the mean square of these slopes; 0 on average."""
        pool = self._residuals
        out = np.zeros((len(drawn[0].signed), self.scale.size))
        if not len(pool):
            return out
        noise = (pool**2).mean(axis=0)
        for slope, steep in enumerate(steepness):
            moved = np.sum([lots.tilted[slope] for lots in drawn], axis=0) @ pool
            out += (moved * (moved + 2 * steep) - noise) / self._count
        return out

    def draw_residuals(self, rng: np.random.Generator, draws: int) -> list[Drawn]:
        """How often each residual of the pool is drawn, per stratum."""
        size, out = max(len(self._residuals), 1), []
        for units, tilt in zip(self.units, self.tilts, strict=True):
            at = rng.integers(0, size, (draws, len(units))) + size * np.arange(draws)[:, None]
            signs = rng.choice([-1.0, 1.0], at.shape)

            def counted(weights: Array, at: Places = at) -> Array:
                return np.asarray(np.bincount(at.ravel(), weights.ravel(), draws * size).reshape(draws, size))

            out.append(
                Drawn(counted(signs), counted(np.ones(at.shape)), np.array([counted(signs * t) for t in tilt.T]))
            )
        return out

    @cached_property
    def _residuals(self) -> Array:
        """[pool, bins] Units about their stratum's mean and trend, standardised, at full variance; or replicates."""
        kept = []
        for rest, tilt in zip(self._fitted[1], self.tilts, strict=True):
            left = 1 - 1 / len(rest) - (tilt**2).sum(axis=1)
            known = left > _LEAST_LEFT  # a unit that a slope passes through says nothing of scatter
            kept.append(rest[known] / np.sqrt(left[known])[:, None])
        pool = np.concatenate(kept)
        if not len(pool) and self.m > 1:
            replicates = self.stacked[:, 1:]
            inner = (replicates - replicates.mean(axis=1, keepdims=True)) * np.sqrt((self.m + 1) / (self.m - 1))
            pool = inner.reshape(-1, inner.shape[2]) / self.scale
        return pool[:: max(len(pool) // _LARGEST_POOL, 1)]

    def _contrasted(self, parts: Sequence[tuple[Array, Array]], trend: Array) -> Array:
        """[draws, strata, bins] From squares and means of each stratum, and the squared slopes, all [draws, bins]."""
        squares, means = (np.stack(side, axis=1) for side in zip(*parts, strict=True))
        if "condition" in self.real.domains:
            own, w = self.real.columns("condition"), self.stratum_weight[:, None]
            s, m = squares[..., own], means[..., own]
            common = (w * m).sum(axis=1) ** 2 - (w**2 * (m**2 - s)).sum(axis=1)
            squares[..., own] = s - common[:, None] if len(parts) > 1 else 0.0
        return np.asarray(squares + trend[:, None])

    @cached_property
    def stratum_weight(self) -> Array:
        """[strata] Part of the records in each."""
        return np.array([len(p) for p in self.strata]) / self.n

    def over_strata(self, squares: Array) -> Array:
        """[draws, bins] Mean of `squares` [draws, strata, bins], what is plain anyway tempered."""
        return _tempered(np.einsum("dsb,s->db", squares, self.stratum_weight))

    def over_views(self, squares: Array) -> tuple[Array, dict[Domain, Array]]:
        """Overall and per-view distances from `squares` [draws, strata, bins]; each [draws]."""
        return self._of_views(self.over_strata(squares))

    def _of_views(self, means: Array) -> tuple[Array, dict[Domain, Array]]:
        """The same from means over strata [draws, bins]."""
        views = {d: means[:, self.real.columns(d)] @ self.real.axes[d].weight for d in self.real.domains}
        overall = np.mean(list(views.values()), axis=0)
        return _root(overall), {d: _root(v) for d, v in views.items()}

    def distance(self, rng: np.random.Generator, splits: int = 100) -> Distance:
        """The gap, and its floor from random splits of the records.

        Parameters
        ----------
        rng : numpy.random.Generator
        splits : int
        """
        overall, views = self.over_views(self.squares())
        floor, floors = self.floor(rng, splits)
        return Distance(float(overall[0]), {d: float(v[0]) for d, v in views.items()}, floor, floors)

    def floor(self, rng: np.random.Generator, splits: int = 100) -> tuple[float, dict[Domain, float]]:
        """Records against records, overall and per view, at the number of records in hand.

        Differences of units about their stratum's mean are drawn from all strata, with random signs: the mean of such a
        draw is half the difference of two random halves of the records, whose noise is that of all records against a
        twin.
        """
        pool, kept = self._residuals, []
        if not len(pool):
            return 0.0, dict.fromkeys(self.real.domains, 0.0)
        drawn = self.draw_residuals(rng, splits)
        for units, lots in zip(self.units, drawn, strict=True):
            k = len(units)
            means = lots.signed @ pool / k
            noise = lots.plain @ pool**2 / k if k > 1 else np.mean(pool**2, axis=0)
            kept.append(((k * means**2 - noise) / (k - 1) if k > 1 else means**2 - noise, means))
        level = np.zeros_like(self._trend[0])
        overall, views = self.over_views(self._contrasted(kept, self._trend_moved(drawn, level)))
        return float(overall.mean()), {d: float(v.mean()) for d, v in views.items()}


def gap_distance(
    real: Views,
    sims: Sequence[Views],
    rng: np.random.Generator,
    conditions: Sequence[Condition] | None = None,
    scale: Array | None = None,
) -> Distance:
    """Gap between records and twin, with floors. Arguments as `Paired` and `Paired.distance`."""
    return Paired(real, sims, conditions, scale).distance(rng)


def _tempered(squares: Array) -> Array:
    """Squares that grow with the logarithm beyond `_PLAIN`, on either side of zero."""
    size = np.abs(squares)
    return np.where(size > _PLAIN, np.sign(squares) * _PLAIN * (1 + np.log(np.maximum(size, _PLAIN) / _PLAIN)), squares)


def _root(square: Array) -> Array:
    return np.sqrt(np.maximum(square, 0.0))
