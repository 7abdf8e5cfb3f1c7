"""What shape the spectra of a set have: one mode and white noise, or that and something more.

mean smooth spectra, healthy and faulty together --fit each model--> how much better than the baseline, at which values

The baseline of the phenomenological twin has structure noise and impacts through one mode, and white noise. One more
mode, a roll-off of the sensor before the white noise, noise of a power law, or noise in a band each change the healthy
and the faulty spectrum in a way of their own: path effects act on impacts as on structure noise, disturbances add the
same to both. Strengths enter linearly and are solved for (non-negative least squares); places are searched on grids,
coarse to fine. Fitted alike to measured and to simulated records, so that what a simulator has besides one mode is no
difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.gap.signatures.pooled import Whitened
from twingap.gap.view import SMOOTH_SEGMENTS, Frame
from twingap.records import Condition

Array = NDArray[np.float64]
_Model = Callable[[Array], tuple[Array, Array | None]]
"""Places [candidates, places] -> power response of the path, and shape of what is added, both [candidates, bands]."""

BANDS: Final = 64
FINE: Final = 4
"""Points of a model per band: sharp modes are narrower than a band."""
_ROBUST: Final = 4.0
"""Standard deviations beyond which a band counts in proportion, no longer as the square."""
_LEAST_SIGMA: Final = 0.015
MODELS: Final = ("mode", "loss", "slope", "band")
NAMES: Final = (
    "base_cost", *(f"{m}_gain" for m in MODELS), *(f"{m}_lead" for m in MODELS), "best_cost",
    "base_fs", "base_damping", "mode_fs", "mode_damping", "mode_strength", "loss_corner", "loss_order", "loss_at_mode",
    "slope_level", "slope_power", "band_level", "band_low", "band_high",
)  # fmt: skip


class Outline(NamedTuple):
    """What is kept of a record's view for what is measured on a whole set."""

    condition: Condition
    frame: Frame
    fs_hz: float
    smooth: Array
    whitened: Whitened | None = None


class _Fit(NamedTuple):
    cost: float
    at: tuple[float, ...]
    weights: Array


def measure(spectra: Sequence[Outline]) -> dict[str, float]:
    """`NAMES` -> value for a set of records; NaN without records. Frequencies are logarithms of parts of the rate."""
    out = dict.fromkeys(NAMES, math.nan)
    curves = _Curves.of(spectra)
    if curves is None:
        return out
    base = curves.base()
    fits = {
        "mode": curves.one_more_mode(base), "loss": curves.loss(base), "slope": curves.slope(base),
        "band": curves.band(base),
    }  # fmt: skip
    gains = {name: math.log1p(max(base.cost - fit.cost, 0.0)) for name, fit in fits.items()}
    out["base_cost"] = math.log(base.cost / curves.count + 1e-3)
    out["best_cost"] = math.log(min(fit.cost for fit in fits.values()) / curves.count + 1e-3)
    for name, gain in gains.items():
        out[f"{name}_gain"] = gain
        out[f"{name}_lead"] = gain - max(g for n, g in gains.items() if n != name)
    out["base_fs"], out["base_damping"] = (math.log(v) for v in base.at)
    second, own, gain = fits["mode"].at[2:]
    out["mode_fs"], out["mode_damping"], out["mode_strength"] = math.log(second), math.log(own), math.log(gain)
    first, _, corner, order = fits["loss"].at
    out["loss_corner"], out["loss_order"] = math.log(corner), order
    out["loss_at_mode"] = math.log1p((first / corner) ** (2 * order))
    power = fits["slope"].at[2]
    out["slope_power"] = power
    out["slope_level"] = curves.level(fits["slope"].weights[3], _power_law(curves.f, np.array([power]))[0])
    low, high = fits["band"].at[2:]
    out["band_low"], out["band_high"] = math.log(low), math.log(high)
    out["band_level"] = curves.level(fits["band"].weights[3], ((curves.f >= low) & (curves.f <= high)).astype(float))
    return out


class _Curves:
    """Mean log spectra of healthy and of faulty records, and how well bands are known."""

    def __init__(self, healthy: Array | None, faulty: Array | None, sigma: tuple[float, float]) -> None:
        self.f = (np.arange(FINE * BANDS) + 0.5) / (2 * FINE * BANDS)
        self.kinds = [k for k, curve in enumerate((healthy, faulty)) if curve is not None]
        curves = [c for c in (healthy, faulty) if c is not None]
        self.curves = np.exp(np.array(curves))
        self.sigma = np.array([sigma[k] for k in self.kinds])
        self.count = self.curves.size

    @classmethod
    def of(cls, spectra: Sequence[Outline]) -> _Curves | None:
        """From the records of a set, in units of its yardstick; None without any."""
        logs: dict[bool, list[Array]] = {True: [], False: []}
        for one in spectra:
            unit = one.fs_hz / max(one.frame.scale, 1e-300) ** 2
            bands = np.log(np.maximum(one.smooth * unit, 1e-30)).reshape(BANDS, SMOOTH_SEGMENTS // BANDS).mean(axis=1)
            logs[one.condition.fault == "healthy"].append(bands)
        if not logs[True] and not logs[False]:
            return None
        if logs[True]:  # impacts are lines, which smooth spectra leave out unevenly: healthy records tell more
            logs[False] = []
        means, sigmas = [], []
        for own in (logs[True], logs[False]):
            means.append(np.mean(own, axis=0) if own else None)
            # Levels differ between records of several faults; the shape of each is what counts.
            about = [o - o.mean() for o in own]
            spread = float(np.median(np.std(about, axis=0, ddof=1))) if len(own) > 2 else 0.12
            sigmas.append(math.hypot(max(spread, 0.03) / math.sqrt(max(len(own), 1)), _LEAST_SIGMA))
        return cls(means[0], means[1], (sigmas[0], sigmas[1]))

    def level(self, weight: float, shape: Array) -> float:
        """Log RMS of what was added, over the yardstick."""
        return 0.5 * math.log(max(float(weight) * float(shape.mean()) / 2, 1e-8))

    def base(self) -> _Fit:
        """One mode and white noise."""
        f1, damping = np.meshgrid(np.geomspace(0.01, 0.49, 56), np.geomspace(0.004, 0.4, 9), indexing="ij")
        fit = self._best(np.stack([f1.ravel(), damping.ravel()], axis=1), self._plain)
        return self._finer(fit, (0.03, 0.25), self._plain)

    def one_more_mode(self, base: _Fit) -> _Fit:
        """Another mode in parallel; either may be the one that the baseline took."""
        f2, own, gain = np.meshgrid(
            np.geomspace(0.012, 0.485, 44), (0.012, 0.03, 0.08), (0.15, 0.5, 1.5, 5.0), indexing="ij"
        )  # fmt: skip
        rows = np.stack([np.full(f2.size, base.at[0]), np.full(f2.size, base.at[1])], axis=1)
        more = np.stack([f2.ravel(), own.ravel(), gain.ravel()], axis=1)
        fit = self._best(np.concatenate((rows, more), axis=1), self._two)
        return self._finer(fit, (0.02, 0.25, 0.04, 0.4, 0.5), self._two)

    def loss(self, base: _Fit) -> _Fit:
        """A Butterworth loss after the mode, before the white noise."""
        f1, damping, corner, order = np.meshgrid(
            base.at[0] * np.array([0.97, 1.0, 1.06, 1.15, 1.3]), base.at[1] * np.array([0.5, 0.75, 1.0]),
            np.geomspace(0.015, 0.6, 22), (1.0, 2.0, 4.0, 6.0), indexing="ij",
        )  # fmt: skip
        rows = np.stack([a.ravel() for a in (np.minimum(f1, 0.49), damping, corner, order)], axis=1)
        return self._finer(self._best(rows, self._rolled), (0.02, 0.15, 0.12, 0.0), self._rolled)

    def slope(self, base: _Fit) -> _Fit:
        """Noise whose power falls or rises with frequency."""
        f1, damping, power = np.meshgrid(
            base.at[0] * np.array([0.96, 1.0, 1.04]), base.at[1] * np.array([0.5, 0.75, 1.0, 1.3]),
            (-1.5, -0.8, 0.5, 0.8, 1.2, 1.7, 2.3, 3.0), indexing="ij",
        )  # fmt: skip
        rows = np.stack([np.minimum(f1, 0.49).ravel(), damping.ravel(), power.ravel()], axis=1)
        return self._finer(self._best(rows, self._sloped), (0.015, 0.15, 0.0), self._sloped)

    def band(self, base: _Fit) -> _Fit:
        """Flat noise between two frequencies."""
        edges = (np.maximum(np.arange(0, BANDS, 2), 0.5) / (2 * BANDS)).tolist()
        pairs = [
            (low, low + width / (2 * BANDS)) for low in edges for width in (2, 4, 8, 14, 20) if low + width / 128 <= 0.5
        ]
        rows = [(base.at[0], d, low, high) for low, high in pairs for d in (base.at[1], 0.6 * base.at[1])]
        return self._best(np.array(rows), self._banded)

    def _plain(self, at: Array) -> tuple[Array, Array | None]:
        return np.abs(_response(self.f, at[:, :1], at[:, 1:2])) ** 2, None

    def _two(self, at: Array) -> tuple[Array, Array | None]:
        both = _response(self.f, at[:, :1], at[:, 1:2]) + at[:, 4:5] * _response(self.f, at[:, 2:3], at[:, 3:4])
        return np.abs(both) ** 2, None

    def _rolled(self, at: Array) -> tuple[Array, Array | None]:
        own = np.abs(_response(self.f, at[:, :1], at[:, 1:2])) ** 2
        return own / (1 + (self.f / at[:, 2:3]) ** (2 * at[:, 3:4])), None

    def _sloped(self, at: Array) -> tuple[Array, Array | None]:
        return self._plain(at)[0], _power_law(self.f, at[:, 2])

    def _banded(self, at: Array) -> tuple[Array, Array | None]:
        inside = (self.f >= at[:, 2:3]) & (self.f <= at[:, 3:4])
        return self._plain(at)[0], inside.astype(float)

    def _finer(self, fit: _Fit, steps: tuple[float, ...], model: _Model) -> _Fit:
        """The fit with each place moved by smaller and smaller factors while that helps."""
        for shrink in (1.0, 0.4, 0.15):
            for _ in range(3):
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

    def _best(self, at: Array, model: _Model) -> _Fit:
        at = at.copy()
        at[:, 0] = np.minimum(at[:, 0], 0.49)
        through, added = model(at)
        through = through / np.maximum(through.mean(axis=1, keepdims=True), 1e-300)
        through = _log_means(through)
        added = None if added is None else _log_means(np.maximum(added, 1e-12))
        zero, one = np.zeros_like(through), np.ones_like(through)
        columns = []  # structure noise, impacts, white noise, what is added: each [candidates, curves, bands]
        columns.append(np.stack([through] * len(self.kinds), axis=1))
        columns.append(np.stack([zero if k == 0 else through for k in self.kinds], axis=1))
        columns.append(np.stack([one] * len(self.kinds), axis=1))
        if added is not None:
            columns.append(np.stack([added] * len(self.kinds), axis=1))
        basis = np.stack(columns, axis=-1) / (self.curves * self.sigma[:, None])[None, :, :, None]
        basis = basis.reshape(len(at), -1, len(columns))
        target = np.repeat(1 / self.sigma, BANDS)
        weights = _non_negative(np.einsum("cbi,cbj->cij", basis, basis), np.einsum("cbi,b->ci", basis, target))
        made = np.einsum("cbi,ci->cb", basis, weights) / target
        # A ratio of spectra is judged by its logarithm, as likely to be twice as half.
        off = np.log(np.clip(made, 0.05, 20.0)) * target
        far = np.abs(off)
        cost = np.where(far < _ROBUST, far**2, 2 * _ROBUST * far - _ROBUST**2).sum(axis=1)
        place = int(np.argmin(cost))
        return _Fit(float(cost[place]), tuple(float(v) for v in at[place]), weights[place])


def _log_means(fine: Array) -> Array:
    """[candidates, bands] Geometric means within bands, as those of the records are."""
    return np.asarray(np.exp(np.log(np.maximum(fine, 1e-12)).reshape(len(fine), BANDS, FINE).mean(axis=2)))


def _response(f: Array, place: Array, damping: Array) -> NDArray[np.complex128]:
    """[candidates, bands] Of a sampled mode exp(-zeta w t) sin(w_d t), at parts f of the sampling rate."""
    w = 2 * np.pi * place
    damping = np.minimum(damping, 0.95)
    decay, turn = np.exp(-damping * w), w * np.sqrt(1 - damping**2)
    z = np.exp(-2j * np.pi * f)
    return np.asarray(decay * np.sin(turn) * z / (1 - 2 * decay * np.cos(turn) * z + decay**2 * z**2))


def _power_law(f: Array, power: Array) -> Array:
    """[candidates, bands] f^-power, its mean 1."""
    law = f[None, :] ** -power[:, None]
    return np.asarray(law / law.mean(axis=1, keepdims=True))


def _non_negative(gram: Array, right: Array) -> Array:
    """[candidates, n] Non-negative least squares of many small problems at once, by coordinate descent."""
    out = np.zeros_like(right)
    for _ in range(60):
        for i in range(right.shape[1]):
            rest = right[:, i] - np.einsum("cj,cj->c", gram[:, i], out) + gram[:, i, i] * out[:, i]
            out[:, i] = np.maximum(rest / np.maximum(gram[:, i, i], 1e-300), 0.0)
    return out
