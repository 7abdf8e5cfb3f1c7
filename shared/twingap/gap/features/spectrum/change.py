"""Spectral change: the single change of the simulated spectra that best gives the measured ones, by robust likelihood.

pairs of records, measured and simulated, same condition
    --mean log ratio with its error: noise of healthy records, all power of records with impacts-->
    levels and sampling alone | one more mode | noise in a band | noise of a power law | roll-off of the sensor
    | a mode in parallel --> gain of each change, its lead over the others, its values

A mode adds to the impacts' spectrum as it adds to the noise, each in its own proportion; in parallel with the existing
path, it also lowers the spectrum on one side of its peak. Noise adds the same power to both; a roll-off lowers both,
except for the white noise behind it. `path` models the spectra of each side by itself; here a simulator may have any
number of modes, since what both sides share cancels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from twingap.gap.features.impacts.parallel_mode import Path
from twingap.gap.features.impacts.response_sampling import continuous
from twingap.gap.features.spectrum.record_summary import RecordSummary, log_bands
from twingap.gap.features.spectrum.smooth_shape import mode_shape
from twingap.records import Array
from twingap.signal.record_transforms import mean_of_five

NOISE_BANDS: Final = 128
"""Bands of noise spectra: more resolve sharper changes, each with more noise."""
IMPACT_BANDS: Final = 64
"""Bands of `ImpactSpectrum.density`."""
BANDS: Final = NOISE_BANDS + IMPACT_BANDS
_LEAST_ERROR: Final = 0.04
"""Least error of a mean log ratio (0.17 dB), left by calibration: smaller, and small misfits count as changes."""
_ALONE: Final = 0.15
"""Error of a log ratio where one or two pairs of records cannot show it."""
_ROBUST: Final = 4.0
"""Errors beyond which a misfit counts linearly (Huber): larger, and single bands decide more."""
_TILT: Final = 2.5
"""Power of the frequency by which responses of acquisition chains differ near half the sampling rate."""

_SETTLED: Final = np.array([1e-6, 1e-6, 1 / 0.3**2, 1 / 0.008**2, 1 / 0.06**2, 1 / 0.7**2])
"""Precision of levels (noise, impacts), tilt, place of the spectrum (ln Hz), white noise, continuity of the response:
differences within these are left by calibration and count as no change."""
_OF_SAMPLING: Final = np.array([False, False, True, False, False, True])
"""Which of them describe how a response is sampled: tilt, and continuity."""
_CERTAIN: Final = 1e9
"""Precision of what is equal on both sides."""
_WHITE: Final = 0.95
"""Part of a spectrum's lowest density that is taken for white noise rather than the skirt of a mode."""

CHANGES: Final = ("mode", "band", "power_law", "rolloff")
NAMES: Final = (
    "base_cost", "tilt", "continuous", "tilt_gain",
    *(f"{c}_gain" for c in CHANGES), *(f"{c}_lead" for c in CHANGES), "best_cost",
    "mode_fs", "mode_damping", "mode_noise", "mode_impacts", "mode_balance",
    "band_low", "band_high", "band_level", "band_noise", "band_impacts",
    "power_law_exponent", "power_law_level", "power_law_noise",
    "rolloff_corner", "rolloff_order", "rolloff_impacts", "rolloff_noise",
    "parallel_gain", "parallel_lead", "parallel_over_mode", "parallel_cost", "parallel_fs", "parallel_damping",
    "parallel_strength", "parallel_noise", "parallel_impacts", "parallel_noise_low", "parallel_impacts_low",
)  # fmt: skip
"""Keys of `compare`."""


class _Best(NamedTuple):
    cost: float
    at: tuple[float, ...]
    curve: Array


def compare(
    real: Sequence[RecordSummary], simulated: Sequence[RecordSummary], same_sampling: bool = False
) -> dict[str, float]:
    """`NAMES` -> value of fits of single changes of the simulated spectra to the measured ones; NaN without pairs.

    Summaries are of the same conditions, in the same order; with `same_sampling` the response is sampled alike on both
    sides, as where the user's simulator is of this machine.

    `base_cost`: log misfit per band with levels and sampling alone; `best_cost`: with the best change; `tilt`,
    `continuous`: difference in the sampling of the response. Gains are ln(1 + reduction of the misfit), leads a gain
    less that of the best rival. Frequencies are logarithms of parts of the sampling rate, heights natural logarithms of
    a power ratio. `_noise` and `_impacts`: change of the noise spectrum, and of the spectrum of records with impacts.
    """
    out = dict.fromkeys(NAMES, math.nan)
    pairs = _Pairs.of(real, simulated, same_sampling)
    if pairs is None:
        return out
    (level, _), (base, at) = pairs.settled(tilted=False), pairs.settled(tilted=True)
    found = {"mode": pairs.mode(), "band": pairs.band(), "power_law": pairs.power_law(), "rolloff": pairs.rolloff()}
    gains = {name: math.log1p(max(base - best.cost, 0.0)) for name, best in found.items()}
    out["base_cost"] = math.log(base / pairs.count + 1e-3)
    out["tilt"], out["continuous"] = (float(value) for value in at[_OF_SAMPLING])
    out["tilt_gain"] = math.log1p(max(level - base, 0.0))
    for name, gain in gains.items():
        out[f"{name}_gain"] = gain
        out[f"{name}_lead"] = gain - max(g for n, g in gains.items() if n != name)
    out["best_cost"] = math.log(min(best.cost for best in found.values()) / pairs.count + 1e-3)
    place, damping, noise, impacts = found["mode"].at
    out["mode_fs"], out["mode_damping"] = math.log(place), math.log(damping)
    out["mode_noise"], out["mode_impacts"] = _each(np.max, found["mode"].curve)
    out["mode_balance"] = pairs.proportion(noise, impacts)
    low, high, level_of = found["band"].at
    out["band_low"], out["band_high"] = math.log(max(low, 1e-3)), math.log(high)
    out["band_level"] = 0.5 * math.log(max(level_of * (high - low), 1e-8))
    out["band_noise"], out["band_impacts"] = _each(np.max, found["band"].curve)
    out["power_law_exponent"], level_of = found["power_law"].at
    out["power_law_level"] = 0.5 * math.log(max(level_of, 1e-8))
    out["power_law_noise"], _ = _each(np.max, found["power_law"].curve)
    out["rolloff_corner"], out["rolloff_order"] = math.log(found["rolloff"].at[0]), found["rolloff"].at[1]
    out["rolloff_noise"], out["rolloff_impacts"] = _each(np.min, found["rolloff"].curve)
    parallel = pairs.parallel()
    gain = math.log1p(max(base - parallel.cost, 0.0))
    out["parallel_gain"] = gain
    out["parallel_lead"] = gain - max(g for name, g in gains.items() if name != "mode")
    out["parallel_over_mode"] = gain - gains["mode"]
    out["parallel_cost"] = math.log(parallel.cost / pairs.count + 1e-3)
    place, damping, out["parallel_strength"] = parallel.at
    out["parallel_fs"], out["parallel_damping"] = math.log(place), math.log(damping)
    out["parallel_noise"], out["parallel_impacts"] = _each(np.max, parallel.curve)
    out["parallel_noise_low"], out["parallel_impacts_low"] = _each(np.min, parallel.curve)
    return {name: value if math.isfinite(value) else math.nan for name, value in out.items()}


def _each(extreme: Callable[[Array], float], curve: Array) -> tuple[float, float]:
    """Extreme of the noise spectrum's part of a curve, and of that of records with impacts."""
    return float(extreme(curve[:NOISE_BANDS])), float(extreme(curve[NOISE_BANDS:]))


_SIDES: Final = (slice(0, NOISE_BANDS), slice(NOISE_BANDS, BANDS))
_PARALLEL: Final = tuple(sign * level for sign in (1.0, -1.0) for level in (0.05, 0.2, 0.6, 1.8, 6.0, 20.0, 80.0))
"""Levels of a mode in parallel that are tried first, power over that of the path; negative against it."""


class _Pairs:
    """Mean log ratio of measured and simulated spectra, its error, and the simulated spectra themselves."""

    def __init__(self, ratio: Array, error: Array, base: Array, same_sampling: bool) -> None:
        self.ratio, self.error, self.base = ratio, error, base
        self.open = np.append(_SETTLED[:-1], _CERTAIN if same_sampling else _SETTLED[-1])
        self.known = error < np.inf
        self.count = int(self.known.sum())
        self.f = np.concatenate([(np.arange(n) + 0.5) / (2 * n) for n in (NOISE_BANDS, IMPACT_BANDS)])
        weight = np.where(self.known, 1 / error, 0.0)
        noise = np.arange(BANDS) < NOISE_BANDS
        self.white = np.repeat([np.quantile(base[side], 0.03) for side in _SIDES], (NOISE_BANDS, IMPACT_BANDS))
        log = np.log(base)
        slope = np.concatenate([np.gradient(log[side], np.log(self.f[side])) for side in (noise, ~noise)])
        behind = np.minimum(self.white / base, 1.0)
        sampling = np.stack([(2 * self.f) ** _TILT, continuous(self.f, self._mode())]) * (1 - _WHITE * behind)
        basis = np.stack([noise, ~noise, sampling[0], -slope, self.white / base, sampling[1]]).astype(float)
        self.weight, self.basis = weight, basis * weight

    @classmethod
    def of(
        cls, real: Sequence[RecordSummary], simulated: Sequence[RecordSummary], same_sampling: bool
    ) -> _Pairs | None:
        """None when the sets are no pairs, or hold neither healthy records nor records with impacts."""
        if len(real) != len(simulated):
            return None
        healthy = any(o.condition.fault == "healthy" for o in real)
        noise, impacts = [], []
        for ours, theirs in zip(real, simulated, strict=True):
            # Without healthy records, what lies between the lines of the others is noise too.
            if not healthy or ours.condition.fault == "healthy":
                noise.append((log_bands(ours, NOISE_BANDS), log_bands(theirs, NOISE_BANDS)))
            if ours.impact_spectrum is not None and theirs.impact_spectrum is not None:
                impacts.append((_log(ours.impact_spectrum.density), _log(theirs.impact_spectrum.density)))
        if not noise and not impacts:
            return None
        parts = [_mean(noise, NOISE_BANDS), _mean(impacts, IMPACT_BANDS)]
        ratio, error, base = (np.concatenate(column) for column in zip(*parts, strict=True))
        return cls(ratio, error, base, same_sampling)

    def _mode(self) -> float:
        """Where the simulated spectrum is strongest, part of the sampling rate."""
        noise = slice(0, NOISE_BANDS) if self.known[:NOISE_BANDS].any() else slice(NOISE_BANDS, BANDS)
        return float(np.clip(self.f[noise][np.argmax(self.base[noise])], 0.01, 0.49))

    def settled(self, *, tilted: bool) -> tuple[float, Array]:
        """Misfit with levels and small errors of calibration (with `tilted`, sampling too) fitted, and [basis] the
        values."""
        settled = self.open if tilted else np.where(_OF_SAMPLING, _CERTAIN, self.open)
        costs, best = _costs(np.zeros((1, BANDS)), self.ratio * self.weight, self.weight, self.basis, settled)
        return float(costs[0]), best[0]

    def mode(self) -> _Best:
        """One more mode: heights over the noise and over the impacts' spectrum, each by itself."""
        best = self._mode_at(np.geomspace(0.012, 0.49, 72), (0.01, 0.022, 0.05, 0.11))
        place, damping = best.at[:2]
        return min(best, self._mode_at(
            place * np.exp(np.linspace(-0.04, 0.04, 9)), tuple(damping * np.array([0.7, 1.0, 1.4]))
        ), key=lambda b: b.cost)  # fmt: skip

    def _mode_at(self, places: Array, dampings: Sequence[float]) -> _Best:
        grid = [(f0, d) for d in dampings for f0 in np.minimum(places, 0.495)]
        f0, d = np.array(grid).T[:, :, None]
        shape = np.maximum(mode_shape(self.f, f0, d), 1e-6)
        sizes = np.zeros((len(grid), 2))
        curves = np.zeros((len(grid), BANDS))
        for column, side in enumerate(_SIDES):
            if not self.known[side].any():
                continue
            about = self.ratio[side] - np.median(self.ratio[side][self.known[side]])
            own = shape[:, side] / self.base[side]
            sizes[:, column] = _size(own, about, self.weight[side])
            curves[:, side] = np.log1p(sizes[:, column, None] * own)
        place, cost = self._least(curves)
        return _Best(cost, (*grid[place], *sizes[place]), curves[place])

    def parallel(self) -> _Best:
        """One more mode in parallel with the path: frequency, damping, signed gain."""
        path = Path(
            [self.base[side] for side in _SIDES], [_WHITE * float(self.white[side][0]) for side in _SIDES],
            [bool(self.known[side].any()) for side in _SIDES],
        )  # fmt: skip
        best, level = self._parallel_at(path, np.geomspace(0.012, 0.49, 36), (0.015, 0.04, 0.11), _PARALLEL)
        for part in (1.0, 0.4):
            place, damping, _ = best.at
            places = np.minimum(place * np.exp(part * np.linspace(-0.05, 0.05, 7)), 0.495)
            dampings = [damping * math.exp(part * by) for by in (-0.4, 0.0, 0.4)]
            levels = [level * math.exp(part * by) for by in (-0.7, -0.3, 0.0, 0.3, 0.7)]
            finer = self._parallel_at(path, places, dampings, levels)
            best, level = min((best, level), finer, key=lambda found: found[0].cost)
        return best

    def _parallel_at(
        self, path: Path, places: Array, dampings: Sequence[float], levels: Sequence[float]
    ) -> tuple[_Best, float]:
        curves, values, candidate_levels = path.curves(places, dampings, levels)
        place, cost = self._least(curves)
        return _Best(cost, values[place], curves[place]), candidate_levels[place]

    def band(self) -> _Best:
        """Flat noise between two frequencies, the same power on both."""
        unit = 1 / (2 * IMPACT_BANDS)
        lows = np.arange(0, IMPACT_BANDS, 2) * unit
        best = self._band_at(
            [(low, low + w * unit) for low in lows for w in (2, 4, 7, 12, 20) if low + w * unit < 0.51]
        )
        for step in (unit, 0.5 * unit, 0.25 * unit):
            low, high = best.at[:2]
            moves = [(low + i * step, high + j * step) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            better = self._band_at([(a, b) for a, b in moves if a >= 0 and b - a >= unit])
            best = min(best, better, key=lambda found: found.cost)
        return best

    def _band_at(self, grid: Sequence[tuple[float, float]]) -> _Best:
        low, high = np.array(grid).T[:, :, None]
        half = np.where(np.arange(BANDS) < NOISE_BANDS, 0.25 / NOISE_BANDS, 0.25 / IMPACT_BANDS)
        inside = np.minimum(self.f + half, high) - np.maximum(self.f - half, low)
        return self._added(np.clip(inside / (2 * half), 1e-9, 1.0), grid)

    def power_law(self) -> _Best:
        """Noise of a power law, the same power on both."""
        powers = (-1.0, 0.4, 0.7, 1.0, 1.4, 1.8, 2.3, 3.0)
        return self._added(self.f ** -np.array(powers)[:, None], [(p,) for p in powers])

    def _added(self, shape: Array, grid: Sequence[tuple[float, ...]]) -> _Best:
        about = self.ratio.copy()
        noise = np.arange(BANDS) < NOISE_BANDS
        for side in (noise, ~noise):
            if (side & self.known).any():
                about[side] -= np.quantile(about[side & self.known], 0.3)
        own = shape / self.base
        size = _size(own, about, self.weight)
        curves = np.log1p(size[:, None] * own)
        place, cost = self._least(curves)
        mean = float(shape[place, :NOISE_BANDS].mean()) if len(grid[place]) == 1 else 1.0
        return _Best(cost, (*grid[place], float(size[place]) * mean), curves[place])

    def rolloff(self) -> _Best:
        """A Butterworth roll-off before the white noise."""
        grid = [
            (corner, float(order), white)
            for corner in np.geomspace(0.015, 0.9, 44) for order in (1, 2, 3, 5) for white in (0.0, 0.6, 0.95)
        ]  # fmt: skip
        corner, order, white = np.array(grid).T[:, :, None]
        kept = 1 / (1 + (self.f / corner) ** (2 * order))
        floor = np.minimum(white * self.white, self.base)
        curves = np.log((kept * (self.base - floor) + floor) / self.base)
        place, cost = self._least(curves)
        return _Best(cost, grid[place], curves[place])

    def _least(self, curves: Array) -> tuple[int, float]:
        costs, _ = _costs(curves, self.ratio * self.weight, self.weight, self.basis, self.open)
        place = int(np.argmin(costs))
        return place, float(costs[place])

    def proportion(self, noise: float, impacts: float) -> float:
        """ln of a mode's strength with impacts over that in noise, relative to the ratio of the spectra's maxima."""
        if not self.known[:NOISE_BANDS].any() or not self.known[NOISE_BANDS:].any():
            return math.nan
        others = float(self.base[NOISE_BANDS:].max() / self.base[:NOISE_BANDS].max())
        return math.log((impacts + 1e-6) / (noise + 1e-6) / max(others, 1e-9))


def _log(density: Array) -> Array:
    return np.asarray(np.log(np.maximum(density, 1e-30)))


def _mean(pairs: Sequence[tuple[Array, Array]], bands: int) -> tuple[Array, Array, Array]:
    """Mean log ratio, its error (infinite where nothing is known), and the mean simulated spectrum."""
    if not pairs:
        return np.zeros(bands), np.full(bands, np.inf), np.ones(bands)
    ours, theirs = (np.array(side) for side in zip(*pairs, strict=True))
    ratio = ours - theirs
    mean = ratio.mean(axis=0)
    # Levels differ from record to record: the error of a band is its scatter about its record's own level.
    about = ratio - np.median(ratio, axis=1, keepdims=True)
    variance = mean_of_five(about.var(axis=0, ddof=1)) if len(pairs) > 2 else np.full(bands, _ALONE**2)
    error = np.sqrt(variance / len(pairs) + _LEAST_ERROR**2)
    return mean, error, np.mean(np.exp(theirs), axis=0)


def _size(own: Array, about: Array, weight: Array) -> Array:
    """[candidates] Non-negative s that brings ln(1 + s own) nearest to `about`, by Gauss-Newton on ln s."""
    top = np.argmax(np.where(weight > 0, own, 0.0), axis=1)  # start: where the candidate is strongest
    strongest = own[np.arange(len(own)), top]
    s = np.maximum(np.expm1(np.clip(about[top], 0.02, 12.0)), 1e-3) / strongest
    for _ in range(8):
        x = s[:, None] * own
        slope = x / (1 + x)  # by ln s
        off = about - np.log1p(x)
        pull = weight**2 * slope / np.maximum(np.abs(off) * weight / _ROBUST, 1.0)
        step = (pull * off).sum(axis=1) / ((pull * slope).sum(axis=1) + 1e-9)
        s = np.maximum(s * np.exp(np.clip(step, -1.5, 1.5)), 1e-6 / strongest)
    return np.asarray(s)


def _costs(curves: Array, target: Array, weight: Array, basis: Array, settled: Array) -> tuple[Array, Array]:
    """[candidates] Robust misfit with the basis fitted, and [candidates, basis] its weights."""
    k = len(basis)
    products = (basis[:, None] * basis).reshape(k * k, -1)
    off = target - curves * weight
    robust = np.ones_like(off)
    for _ in range(4):
        gram = (robust @ products.T).reshape(-1, k, k) + np.diag(settled)
        found = np.linalg.solve(gram, ((robust * off) @ basis.T)[:, :, None])[:, :, 0]
        size = np.abs(off - found @ basis)
        robust = _ROBUST / np.maximum(size, _ROBUST)
    misfit = np.where(size <= _ROBUST, size * size, _ROBUST * (2 * size - _ROBUST))
    # Rounded: of candidates that are alike (bands that reach beyond the spectrum) the first is taken.
    return np.round(found**2 @ settled + misfit.sum(axis=1), 10), np.asarray(found, float)
