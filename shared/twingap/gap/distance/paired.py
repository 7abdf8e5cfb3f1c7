"""Distance between records and their simulated replicates, in each domain and overall, and what chance leaves of it.

FeatureVectors of records --+
                            +--Paired--> differences [records, bins] --strata, slopes--> squares per bin, unbiased
FeatureVectors of replicates+                                                                |
                                     standardised by the spread between records <--+--> per domain --> overall, floor

The difference of a record is its vector less the mean of its replicates of the same condition. The gap is the part of
the differences that is common to a stratum of conditions, or linear in speed, load or time within all strata. Its
square is that of estimated means and slopes less the variance that scatter adds to them (one-way U-statistic; analysis
of covariance, Scheffe 1959, ch. 6), so that noise between records adds nothing on average: two sets of records of one
machine are at distance 0 on average. The floor is the mean distance that chance leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from twingap.errors import TwingapError
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.stratification import Places, detrended, independent_units, slopes, strata
from twingap.records import Array

_LARGEST_POOL: Final = 512
"""Largest number of residuals that a bootstrap draws from. More are slower and hardly change intervals."""
_LEAST_LEFT: Final = 0.1
"""Smallest part of a unit's scatter, beside means and slopes, for its residual to enter the pool. A smaller value
admits residuals that are scaled up more."""
_ALIKE: Final = 4.0
"""Weight, in degrees of freedom, of a kind's median spread in each of its bins where there is one replicate. A larger
value makes spreads more equal."""
_LEAST_SPREAD: Final = 0.05
"""Smallest spread of a bin (log units). Without it, a bin that never varies would dominate all others."""
_LARGE: Final = 16.0
"""Square, in variances, beyond which squares grow logarithmically. With a larger one, a single strong tone or repeated
samples can make up all of the gap."""


class Drawn(NamedTuple):
    """Counts of the draws of each residual of a pool for the units of a stratum.

    `signed` [draws, pool] are those with positive sign less those with negative sign, `plain` all; `tilted` [slopes,
    draws, pool] is as `signed`, each draw times its unit's place on a slope.
    """

    signed: Array
    plain: Array
    tilted: Array


class Paired:
    """Records paired with their simulated replicates.

    Each of the replicates `sims` holds one record per real record, in the same order and of the same condition, from
    its own random numbers. `scale` [bins] is the spread for the standardisation, from another `Paired` of the same
    records, so that distances before and after are comparable; None for its own.

    Raises
    ------
    TwingapError
        Without replicates, or when they do not match the records.
    """

    def __init__(self, real: FeatureVectors, sims: Sequence[FeatureVectors], scale: Array | None = None) -> None:
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
        self.conditions = real.conditions
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
        return tuple(np.stack([self.difference[unit].mean(axis=0) for unit in own]) for own in self._units)

    @cached_property
    def _units(self) -> tuple[list[Places], ...]:
        """Per stratum, places of the records of each of its units."""
        return tuple(
            [places[unit] for unit in independent_units([self.conditions[i] for i in places])] for places in self.strata
        )

    @cached_property
    def scale(self) -> Array:
        """[bins] Spread between records under equal conditions, real and simulated pooled, never less than 0.05.

        A fifth of the median spread of a bin's kind is added in squares, so that a bin with little spread by chance
        does not dominate; with one replicate, the kind's spread counts as `_ALIKE` more records.
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
        square = np.sum([np.sum(rest**2, axis=0) for rest in detrended(rows, tilts)[0]], axis=0)
        return np.asarray(square / max(free, 1) / (1 + 1 / self.m)), free

    @cached_property
    def _by_own_scatter(self) -> Array | float:
        """[bins] Factor on the noise where the scale is estimated from the records' own scatter.

        A bin whose scatter is small by chance is divided by a small scale: its mean grows, but the subtracted noise is
        small by the same chance. The mean square over an estimated variance of nu degrees of freedom exceeds that over
        the true one by nu / (nu - 2) (F distribution); this is its first order for a partly pooled variance.
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

        In the domain "condition", the common part of all strata is removed: other domains show it, and it is not
        specific to a condition. [1, strata, bins], zero on average where nothing differs.
        """
        return self._contrasted(self._squares, self._trend[1])

    @cached_property
    def tilts(self) -> tuple[Array, ...]:
        """Per stratum [units, slopes]: see `slopes`."""
        return slopes([[[self.conditions[i] for i in unit] for unit in own] for own in self._units])

    @cached_property
    def _count(self) -> int:
        """Number of all units."""
        return sum(len(own) for own in self._units)

    @cached_property
    def _fitted(self) -> tuple[list[Array], list[Array], Array]:
        """Units, standardised; what is left of them beside their stratum's mean and slopes; slopes [slopes, bins]."""
        units = [u / self.scale for u in self.units]
        return units, *detrended(units, self.tilts)

    @cached_property
    def _variances(self) -> list[Array]:
        """Per stratum [bins]: variance of one unit; what slopes take from its own scatter is replaced by that of all
        strata."""
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
        """Distance with the noise of the records' means left in: a smooth function of the parameters of the replicates.

        The objective of fitted values, where the unbiased `squares` may be negative. With more than one replicate the
        noise of simulations is taken out: otherwise values that reduce it, such as many small impulses instead of a few
        large ones, seem closer.
        """
        steepness, noises = self._fitted[2], self._simulated_variances
        trend = (steepness**2).sum(axis=0, keepdims=True) / self._count
        for tilt, noise in zip(self.tilts, noises, strict=True):
            trend = trend - float(np.sum(tilt**2)) * noise / self._count
        parts = [
            (mean**2 - noise / len(own), mean)
            for (_, mean), noise, own in zip(self._squares, noises, self._units, strict=True)
        ]
        # Where noise is overestimated by chance, the rest would be negative, and attract the fit.
        means = np.maximum(self.over_strata(self._contrasted(parts, trend)), 0.0)
        return float(self._of_domains(means)[0][0])

    @cached_property
    def _simulated_variances(self) -> list[Array]:
        """Per stratum [bins]: variance of a unit's mean over replicates, estimated from the replicates; 0 for one."""
        if self.m < 2:
            return [np.zeros(self.scale.size)] * len(self.strata)
        of_record = self.stacked[:, 1:].var(axis=1, ddof=1) / self.m / self.scale**2
        return [np.mean([of_record[unit].sum(axis=0) / len(unit) ** 2 for unit in own], axis=0) for own in self._units]

    def residuals(self) -> Array:
        """[strata + slopes, bins] Standardised means and slopes: `misfit` is the root of their squares, tempered, less
        what simulations scatter by.

        In the domain "condition", without the common part of all strata.
        """
        means = np.stack([mean[0] for _, mean in self._squares])
        if "condition" in self.real.domains:
            own = self.real.columns("condition")
            means[:, own] -= self.stratum_weight @ means[:, own]
        parts = np.sqrt(self.stratum_weight)[:, None] * means, self._fitted[2] / np.sqrt(self._count)
        return np.concatenate(parts)

    def counts(self) -> Array:
        """[bins] Derivative of the squared misfit by a bin's square."""
        squares = (self.residuals() ** 2).sum(axis=0)
        return np.asarray(self.real.weight * np.minimum(1, _LARGE / np.maximum(squares, 1e-12)))

    def resampled(self, drawn: Sequence[Drawn]) -> Array:
        """[draws, strata, bins] Bootstrap of the squares: their values for other records of the same machine.

        Each unit becomes its stratum's mean and trend plus a random residual of random sign, drawn from the residuals
        of all strata, since a stratum has few units. The bias from the noise of means and slopes is removed. `drawn`,
        from `draw_residuals`, is one and the same for two comparisons of the same records, so that intervals of what
        changed between them do not count the records' noise twice.
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
        """[draws, bins] Change of the mean square of these slopes by newly drawn residuals; 0 on average."""
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
        """Random draws of residuals of the pool for each stratum."""
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
            known = left > _LEAST_LEFT  # a unit on which a slope depends alone shows no scatter
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
        """[draws, bins] Mean of `squares` [draws, strata, bins], large ones compressed (see `_LARGE`)."""
        return compressed(np.einsum("dsb,s->db", squares, self.stratum_weight))

    def over_domains(self, squares: Array) -> tuple[Array, dict[DomainName, Array]]:
        """Distances overall and per domain from `squares` [draws, strata, bins]; each [draws]."""
        return self._of_domains(self.over_strata(squares))

    def _of_domains(self, means: Array) -> tuple[Array, dict[DomainName, Array]]:
        """The same from means over strata [draws, bins]."""
        domains = {d: means[:, self.real.columns(d)] @ self.real.axes[d].weight for d in self.real.domains}
        overall = np.mean(list(domains.values()), axis=0)
        return _root(overall), {d: _root(v) for d, v in domains.items()}

    def floor(self, rng: np.random.Generator, splits: int = 100) -> tuple[float, dict[DomainName, float]]:
        """Floor: mean distance between records of one machine, overall and per domain, at this number of records.

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
        overall, domains = self.over_domains(self._contrasted(kept, self._trend_moved(drawn, level)))
        return float(overall.mean()), {d: float(v.mean()) for d, v in domains.items()}


def compressed(squares: Array) -> Array:
    """Squares that grow with the logarithm beyond `_LARGE`, on either side of zero."""
    size = np.abs(squares)
    return np.where(size > _LARGE, np.sign(squares) * _LARGE * (1 + np.log(np.maximum(size, _LARGE) / _LARGE)), squares)


def _root(square: Array) -> Array:
    return np.sqrt(np.maximum(square, 0.0))
