"""Fit of stiffness, damping and levels to snapshots by least squares on amplitude spectra.

The error is the one that paper 3 names for identification (section 2.2: root-mean-square error of spectra), relative to
the measured spectrum. A local search is enough where the twin has been right a short while ago; a few steps, each one
call of the kernel, make an update.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from papers.arrays import Array
from papers.paper2_digital_twin.live_twin.spectrum import Band, MachineState, Prediction, SpectrumModel
from twingap import TwingapError

BIN_CORRELATION: Final = 1.94
"""1 + 2 (4/9 + 1/36): by how much Hann's neighbouring bins, being correlated, raise the variance of a sum over bins."""
FURTHEST: Final = np.array([0.25, 0.7, 0.7, 1.5])
"""Longest step in the logarithms of stiffness, damping, force level and white noise."""
GAIN: Final = 1e-3  # least part by which a step has to lower the error for the fit to go on


@dataclass(frozen=True)
class Fit:
    theta: Array  # [4] logarithms of `spectrum.FREE`
    before: float  # before, after: relative error of the amplitude spectra, at the beginning and at the end
    after: float
    evaluations: int  # calls of the model
    predicted: list[Prediction]  # at `theta`, for each snapshot


def relative_error(measured: Sequence[Array], predicted: Sequence[Prediction]) -> float:
    """RMS difference of amplitude spectra over the RMS of the measured ones."""
    apart = sum(float(((m - p.amplitude) ** 2).sum()) for m, p in zip(measured, predicted, strict=True))
    return float(np.sqrt(apart / sum(float((m**2).sum()) for m in measured)))


def deviation(measured: Array, predicted: Prediction, averages: float) -> tuple[Array, Array]:
    """The least-squares step [4] in the logarithms of `FREE` from one snapshot, and the scatter that chance gives it:
    an averaged periodogram's root has the variance P / (4 averages)."""
    slopes = predicted.slopes
    inverse = np.linalg.pinv(slopes @ slopes.T, rcond=1e-10, hermitian=True)
    offset = inverse @ (slopes @ (measured - predicted.amplitude))
    weight = inverse @ slopes
    variance = BIN_CORRELATION / (4 * averages) * ((weight * predicted.amplitude) ** 2).sum(axis=1)
    return np.asarray(offset), np.sqrt(variance)


def refit(
    model: SpectrumModel, theta: Array, measured: Sequence[Array], states: Sequence[MachineState], band: Band, *,
    evaluations: int = 4, bounds: tuple[Array, Array] | None = None, rolling: Sequence[Array] | None = None,
    known: Sequence[Prediction | None] | None = None,
) -> Fit:  # fmt: skip
    """Fit the twin to snapshots (amplitude spectra [bins] and their states) from theta [4] on, with at most so many
    calls of the model; done when a step lowers the error by less than `GAIN`.

    `bounds` are of theta; `rolling` are PSDs of the rollers to be held (see `SpectrumModel.predict`); `known` is what
    has been predicted of each snapshot before, unless `rolling` is given.
    """
    low, high = bounds if bounds is not None else (np.full(4, -np.inf), np.full(4, np.inf))
    here = np.clip(theta, low, high)
    predicted = _first(model, here, states, band, rolling, known)
    before = error = relative_error(measured, predicted)
    spent, caution = 1, 1e-3
    while spent < evaluations:
        slopes = np.concatenate([p.slopes for p in predicted], axis=1)
        apart = np.concatenate([m - p.amplitude for m, p in zip(measured, predicted, strict=True)])
        step = _step(slopes, apart, caution, here, low, high)
        trial = np.clip(here + step, low, high)
        try:
            made = model.predict(trial, states, band, rolling=rolling, near=predicted)
        except TwingapError:  # parameters that no twin can have: nearer, then
            made = None
        spent += 1
        reached = np.inf if made is None else relative_error(measured, made)
        if made is None or not reached < error:
            caution = max(10 * caution, 1e-2)
            continue
        small = error - reached < GAIN * error
        here, predicted, error, caution = trial, made, reached, caution / 10
        if small:
            break
    return Fit(here, before, error, spent, predicted)


def _first(
    model: SpectrumModel, here: Array, states: Sequence[MachineState], band: Band, rolling: Sequence[Array] | None,
    known: Sequence[Prediction | None] | None,
) -> list[Prediction]:  # fmt: skip
    """Predictions where a fit begins; those known for this very point are taken as they are."""
    if rolling is not None or known is None:
        return model.predict(here, states, band, rolling=rolling)
    done = {i: p for i, p in enumerate(known) if p is not None and np.array_equal(p.theta, here)}
    left = [i for i in range(len(states)) if i not in done]
    if left:
        made = model.predict(here, [states[i] for i in left], band, near=[known[i] for i in left])
        done |= dict(zip(left, made, strict=True))
    return [done[i] for i in range(len(states))]


def _step(slopes: Array, apart: Array, caution: float, here: Array, low: Array, high: Array) -> Array:
    """A damped least-squares step [4]; what would leave its bounds stays, and the others are solved for without it."""
    normal, wanted = slopes @ slopes.T, slopes @ apart
    free = (here > low) & (here < high)
    free |= np.where(here <= low, wanted > 0, wanted < 0) & ~free
    step = np.zeros(here.size)
    if free.any():
        part = normal[np.ix_(free, free)]
        # A parameter that the spectrum hardly shows (noise far below the rest) must not run away: a floor on it.
        weight = np.maximum(np.diag(part), 1e-6 * np.trace(part))
        step[free] = np.linalg.solve(part + caution * np.diag(weight), wanted[free])
    return np.clip(step, -FURTHEST, FURTHEST)
