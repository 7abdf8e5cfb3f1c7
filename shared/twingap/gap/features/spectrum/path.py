"""Models of the mean spectra of a set: one mode and white noise, alone or with one further component.

noise of healthy records, all power of records with impacts --fit each model--> gain over the baseline, values

The baseline of the phenomenological twin has structure noise and impacts through one mode, and white noise. One more
mode, a roll-off of the sensor before all or part of the white noise, noise of a power law, or noise in a band each
change the healthy and the faulty spectrum in their own way: path effects act on impacts as on structure noise,
disturbances add the same to both. Strengths are linear (non-negative least squares); places are searched on grids,
coarse to fine. Measured and simulated records are fitted alike, so that modes which a simulator has besides its first
are no difference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit
from twingap.effects.modes import moving_average
from twingap.effects.observations import ModePair
from twingap.gap.features.spectrum.record_summary import RecordSummary, log_bands
from twingap.records import Array

BANDS: Final = 64
"""Bands that spectra are fitted in: more resolve sharper modes, each with more noise."""
FINE: Final = 4
"""Points of a model per band: sharp modes are narrower than a band."""
_ROBUST: Final = 4.0
"""Standard deviations beyond which a misfit counts linearly (Huber): larger, and single bands decide more."""
_LEAST_SIGMA: Final = 0.015
_LEAST_SIGMA_IMPACTS: Final = 0.05
"""Least relative errors of a band; larger with impacts, as windows one impact rate wide smear sharp modes. Smaller:
narrow misfits decide."""
_SECONDS: Final = np.geomspace(0.012, 0.485, 26)
_STRENGTHS: Final = np.array([0.25, 0.8, 2.5])
"""Places (parts of the sampling rate) and strengths (over the first) of a second mode that `two_modes` tries."""
MODELS: Final = ("mode", "rolloff", "slope", "band")
NAMES: Final = (
    "base_cost", *(f"{m}_gain" for m in MODELS), *(f"{m}_lead" for m in MODELS), "best_cost",
    "base_fs", "base_damping", "mode_fs", "mode_damping", "mode_strength", "mode_opposed",
    "rolloff_corner", "rolloff_order", "rolloff_at_mode", "rolloff_noise", "slope_level", "slope_power", "band_level",
    "band_low", "band_high",
)  # fmt: skip


class _Fit(NamedTuple):
    cost: float
    at: tuple[float, ...]
    weights: Array


def measure(spectra: Sequence[RecordSummary]) -> dict[str, float]:
    """`NAMES` -> value of a set of records; NaN without records. Frequencies are logarithms of parts of the rate."""
    out = dict.fromkeys(NAMES, math.nan)
    curves = _Curves.of(spectra)
    if curves is None:
        return out
    base = curves.base()
    along, against = curves.one_more_mode(base, 1.0), curves.one_more_mode(base, -1.0)
    fits = {
        "mode": min(along, against, key=lambda fit: fit.cost), "rolloff": curves.rolloff(base),
        "slope": curves.slope(base), "band": curves.band(base),
    }  # fmt: skip
    gains = {name: math.log1p(max(base.cost - fit.cost, 0.0)) for name, fit in fits.items()}
    out["base_cost"] = math.log(base.cost / curves.count + 1e-3)
    out["best_cost"] = math.log(min(fit.cost for fit in fits.values()) / curves.count + 1e-3)
    for name, gain in gains.items():
        out[f"{name}_gain"] = gain
        out[f"{name}_lead"] = gain - max(g for n, g in gains.items() if n != name)
    out["base_fs"], out["base_damping"] = (math.log(v) for v in base.at)
    second, own, gain = fits["mode"].at[2:]
    out["mode_fs"], out["mode_damping"], out["mode_strength"] = math.log(second), math.log(own), math.log(abs(gain))
    out["mode_opposed"] = math.log((along.cost + curves.count) / (against.cost + curves.count))
    first, _, corner, order = fits["rolloff"].at
    out["rolloff_corner"], out["rolloff_order"] = math.log(corner), order
    out["rolloff_at_mode"] = math.log1p((first / corner) ** (2 * order))
    _, _, behind, before = fits["rolloff"].weights
    out["rolloff_noise"] = float(before / max(behind + before, 1e-300))
    power = fits["slope"].at[2]
    out["slope_power"] = power
    out["slope_level"] = curves.level(fits["slope"].weights[3], _power_law(curves.f, power))
    low, high = fits["band"].at[2:]
    out["band_low"], out["band_high"] = math.log(low), math.log(high)
    out["band_level"] = curves.level(fits["band"].weights[3], ((curves.f >= low) & (curves.f <= high)).astype(float))
    return out


def two_modes(spectra: Sequence[RecordSummary], fs_hz: float) -> list[ModePair]:
    """Best pair of modes in phase and best pair in opposition, at this sampling rate, the better first; [] without
    records.

    More thorough than `measure`, and slower.
    """
    curves = _Curves.of(spectra)
    if curves is None:
        return []
    found = sorted((curves.two_modes(sign) for sign in (1.0, -1.0)), key=lambda fit: fit.cost)
    return [ModePair((fit.at[0] * fs_hz, fit.at[2] * fs_hz), (fit.at[1], fit.at[3]), fit.at[4]) for fit in found]


class _Curves:
    """Mean log spectra: of the noise of healthy records, and of all power of records with impacts."""

    def __init__(self, curves: list[Array], sigma: list[float], kinds: list[bool]) -> None:
        self.f = (np.arange(BANDS) + 0.5) / (2 * BANDS)
        self.with_impacts = np.array(kinds)
        self.curves = np.exp(np.array(curves))
        self.sigma = np.array(sigma)
        self.count = self.curves.size

    @classmethod
    def of(cls, spectra: Sequence[RecordSummary]) -> _Curves | None:
        """From the records of a set, over scale^2; None without any."""
        healthy: list[Array] = []
        impacts: list[Array] = []
        others: list[Array] = []
        for one in spectra:
            (healthy if one.condition.fault == "healthy" else others).append(log_bands(one, BANDS))
            if one.impact_spectrum is not None:
                impacts.append(np.log(np.maximum(one.impact_spectrum.density, 1e-30)))
        # Without healthy records, what lies between the lines of the others is noise too.
        kept = [(own, kind) for own, kind in ((healthy or others, False), (impacts, True)) if own]
        if not kept:
            return None
        curves, sigmas = [], []
        for own, kind in kept:
            # Power adds: records with impacts of unlike strength average to one path driven by their mean power.
            curves.append(np.log(np.mean(np.exp(own), axis=0)) if kind else np.mean(own, axis=0))
            # Levels differ between records of several faults: only the shape is compared.
            about = [o - o.mean() for o in own]
            spread = float(np.median(np.std(about, axis=0, ddof=1))) if len(own) > 2 else 0.12
            least = _LEAST_SIGMA_IMPACTS if kind else _LEAST_SIGMA
            sigmas.append(math.hypot(max(spread, 0.03) / math.sqrt(max(len(own), 1)), least))
        return cls(curves, sigmas, [kind for _, kind in kept])

    def level(self, weight: float, shape: Array) -> float:
        """Log RMS of the added noise, over scale."""
        return 0.5 * math.log(max(float(weight) * float(shape.mean()) / 2, 1e-8))

    def base(self) -> _Fit:
        """One mode and white noise."""
        f1, damping = np.meshgrid(np.geomspace(0.01, 0.49, 56), np.geomspace(0.004, 0.4, 9), indexing="ij")
        fit = self._best(np.stack([f1.ravel(), damping.ravel()], axis=1), _PLAIN)
        return self._finer(fit, (0.03, 0.25), _PLAIN)

    def one_more_mode(self, base: _Fit, sign: float) -> _Fit:
        """Another mode in parallel, in phase with the first or in opposition; either may be the baseline's."""
        gains = sign * np.array([0.15, 0.5, 1.5, 5.0])
        f2, own, gain = np.meshgrid(np.geomspace(0.012, 0.485, 44), (0.012, 0.03, 0.08), gains, indexing="ij")
        rows = np.stack([np.full(f2.size, base.at[0]), np.full(f2.size, base.at[1])], axis=1)
        more = np.stack([f2.ravel(), own.ravel(), gain.ravel()], axis=1)
        fit = self._best(np.concatenate((rows, more), axis=1), _TWO)
        return self._finer(fit, (0.02, 0.25, 0.04, 0.4, 0.5), _TWO)

    def two_modes(self, sign: float) -> _Fit:
        """The same from several first modes: one mode fitted to two may lie between them."""
        base = self.base()
        firsts = [base.at, *((f, d) for f in self.peaks() for d in (0.025, 0.07))]
        more = np.stack(np.meshgrid(_SECONDS, (0.02, 0.07), sign * _STRENGTHS, indexing="ij"), axis=-1).reshape(-1, 3)
        rows = np.concatenate([np.hstack((np.tile(first, (len(more), 1)), more)) for first in firsts])
        return self._finer(self._best(rows, _TWO), (0.03, 0.3, 0.03, 0.3, 0.4), _TWO, rounds=12)

    def peaks(self) -> list[float]:
        """Where the two highest peaks of the first spectrum lie, parts of the rate."""
        smooth = np.convolve(np.pad(np.log(self.curves[0]), 1, mode="edge"), (0.25, 0.5, 0.25), "valid")
        places = np.flatnonzero((smooth[1:-1] > smooth[:-2]) & (smooth[1:-1] >= smooth[2:])) + 1
        return [float(self.f[i]) for i in places[np.argsort(-smooth[places], kind="stable")[:2]]]

    def rolloff(self, base: _Fit) -> _Fit:
        """A Butterworth roll-off after the mode, before all of the white noise or a part of it."""
        f1, damping, corner, order = np.meshgrid(
            base.at[0] * np.array([1.0, 1.07, 1.25]), base.at[1] * np.array([0.6, 1.0]),
            np.geomspace(0.015, 0.6, 22), (1.0, 2.0, 4.0, 6.0), indexing="ij",
        )  # fmt: skip
        rows = np.stack([a.ravel() for a in (np.minimum(f1, 0.49), damping, corner, order)], axis=1)
        return self._finer(self._best(rows, _ROLLED), (0.02, 0.15, 0.12, 0.0), _ROLLED)

    def slope(self, base: _Fit) -> _Fit:
        """Noise whose power falls or rises with frequency."""
        f1, damping, power = np.meshgrid(
            base.at[0] * np.array([0.96, 1.0, 1.04]), base.at[1] * np.array([0.5, 0.75, 1.0, 1.3]),
            (-1.5, -0.8, 0.5, 0.8, 1.2, 1.7, 2.3, 3.0), indexing="ij",
        )  # fmt: skip
        rows = np.stack([np.minimum(f1, 0.49).ravel(), damping.ravel(), power.ravel()], axis=1)
        return self._finer(self._best(rows, _SLOPED), (0.015, 0.15, 0.0), _SLOPED)

    def band(self, base: _Fit) -> _Fit:
        """Flat noise between two frequencies."""
        edges = (np.maximum(np.arange(0, BANDS, 2), 0.5) / (2 * BANDS)).tolist()
        pairs = [
            (low, low + width / (2 * BANDS)) for low in edges for width in (2, 4, 8, 14, 20) if low + width / 128 <= 0.5
        ]
        rows = [(base.at[0], d, low, high) for low, high in pairs for d in (base.at[1], 0.6 * base.at[1])]
        return self._best(np.array(rows), _BANDED)

    def _finer(self, fit: _Fit, steps: tuple[float, ...], model: int, rounds: int = 3) -> _Fit:
        """The fit refined by moving each place by smaller and smaller factors."""
        for shrink in (1.0, 0.4, 0.15):
            for _ in range(rounds):
                moves = [fit.at]
                for j, step in enumerate(steps):
                    for sign in (1, -1):
                        moved = list(fit.at)
                        moved[j] *= math.exp(sign * step * shrink)
                        moves.append(tuple(moved))
                better = self._best(np.array(moves), model)
                if better.cost > 0.999 * fit.cost:
                    break
                fit = better
        return fit

    def _best(self, at: Array, model: int) -> _Fit:
        at = np.array(at, dtype=float)
        at[:, 0] = np.minimum(at[:, 0], 0.49)
        modes, added = self._shapes(at, model)
        basis = np.zeros((len(at), 4, self.count))
        scale = 1 / (self.curves * self.sigma[:, None])
        of_record = basis.reshape(len(at), 4, *self.curves.shape)
        of_record[:, 0] = modes[:, None] * scale
        of_record[:, 1] = of_record[:, 0] * self.with_impacts[:, None]
        of_record[:, 2] = scale
        of_record[:, 3] = added[:, None] * scale
        sigma = np.repeat(self.sigma, BANDS)
        weights = np.zeros((len(at), 4))
        _non_negative(basis @ basis.transpose(0, 2, 1), basis @ (1 / sigma), weights)
        # Ratios of spectra are compared by their logarithms: twice is as likely as half.
        made = (weights[:, None] @ basis)[:, 0] * sigma
        off = np.abs(np.log(np.clip(made, 0.05, 20.0))) / sigma
        costs = np.where(off < _ROBUST, off * off, 2 * _ROBUST * off - _ROBUST * _ROBUST).sum(axis=1)
        # Rounded: of candidates that are alike (what is added has no weight) the first is taken.
        costs = np.round(costs, 10)
        place = int(np.argmin(costs))
        return _Fit(float(costs[place]), tuple(float(v) for v in at[place]), weights[place])

    def _shapes(self, at: Array, model: int) -> tuple[Array, Array]:
        """[candidates, bands] Power of the modes, its mean 1, and power of what is added (0 for nothing).

        What is added to a mode with a roll-off is white noise that has passed it.
        """
        response = _response(at[:, 0], at[:, 1])
        if model == _TWO:
            response = response + at[:, 4, None] * _response(at[:, 2], at[:, 3])
        power = response.real**2 + response.imag**2
        added = np.zeros((len(at), BANDS))
        if model == _ROLLED:
            kept = 1 / (1 + (_FINE_F / at[:, 2, None]) ** (2 * at[:, 3, None]))
            power *= kept
            added = kept.reshape(-1, BANDS, FINE).mean(axis=2)
        elif model == _SLOPED:
            added = np.array([_power_law(self.f, power_of) for power_of in at[:, 2]])
        elif model == _BANDED:
            bands, edges = np.arange(BANDS), 2 * BANDS * at[:, 2:4, None]
            added = np.maximum(np.minimum(edges[:, 1], bands + 1) - np.maximum(edges[:, 0], bands), 0.0)
        # Geometric means within bands, as those of the records are.
        modes = np.sqrt(np.sqrt((power + 1e-30).reshape(-1, BANDS, FINE).prod(axis=2)))
        return modes / power.mean(axis=1, keepdims=True), added


def _power_law(f: Array, power: float) -> Array:
    """[bands] f^-power, its mean 1."""
    law = f**-power
    return np.asarray(law / law.mean())


_PLAIN, _TWO, _ROLLED, _SLOPED, _BANDED = range(5)
"""Models: one mode and white noise; with another mode, a roll-off, a power law, a band of noise."""
_FINE_F: Final = (np.arange(FINE * BANDS) + 0.5) / (2 * FINE * BANDS)
_DELAY: Final = np.exp(-2j * math.pi * _FINE_F)


def _response(place: Array, damping: Array) -> NDArray[np.complex128]:
    """[candidates, frequencies] Samples of modes exp(-zeta w t) sin(w_d t) under a force that always acts."""
    w, damping = 2 * math.pi * place[:, None], np.minimum(damping, 0.95)[:, None]
    pole = w * (-damping + 1j * np.sqrt(1 - damping * damping))
    (now, before), decay = moving_average(pole), np.exp(pole.real)
    below = 1 - (2 * decay * np.cos(pole.imag)) * _DELAY + decay**2 * _DELAY**2
    return np.asarray((now + before * _DELAY) / below)


@njit()
def _non_negative(gram, right, weights):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Non-negative least squares of each candidate, by coordinate descent, into `weights` [candidates, 4], zeros."""
    for c in range(gram.shape[0]):
        for _ in range(60):
            moved = False
            for i in range(4):
                if gram[c, i, i] > 0:
                    rest = right[c, i] + gram[c, i, i] * weights[c, i]
                    for j in range(4):
                        rest -= gram[c, i, j] * weights[c, j]
                    own = rest / gram[c, i, i] if rest > 0 else 0.0
                    moved |= abs(own - weights[c, i]) > 1e-14 * own
                    weights[c, i] = own
            if not moved:
                break
