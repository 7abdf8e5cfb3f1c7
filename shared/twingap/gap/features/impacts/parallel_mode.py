"""Change of noise and impact spectra by one more structural mode, in parallel with a path known from its spectra.

simulated spectrum less its white noise --least phase--> response of the path, complex
    --one more mode g H2 added--> |1 + g H2 / H|^2 on what has passed the path, white noise left alone

Two modes that move a sensor together or against each other raise the spectrum at one place and lower it at another,
which added noise does not; and they change structure noise and impacts by the same factor. The phase is the minimum
phase of the spectrum's magnitude (Oppenheim and Schafer, Discrete-Time Signal Processing, 2010, ch. 12): exact for one
mode, approximate near the peaks of several.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects.modes import moving_average
from twingap.records import Array

Complex = NDArray[np.complex128]
Values = tuple[float, float, float]

_WITHIN: Final = 4
"""Frequencies per band at which a mode is computed: sharp modes are narrower than a band."""
_LEAST_PASSED: Final = 0.02
"""Least part of a band's power that is taken to have passed the path: below white noise the path is not known."""
_CANCELLED: Final = 1e-3
"""Least factor of two modes that cancel: averaged over a band they never cancel fully."""


class Path:
    """Effect of one more mode on spectra of noise and of records with impacts.

    Each spectrum [bands] is from 0 to half the sampling rate; `white` is the power density of the white noise in it,
    and `known` whether there are such records.
    """

    def __init__(self, spectra: Sequence[Array], white: Sequence[float], known: Sequence[bool]) -> None:
        passed, inverse = [], []
        for power, floor, there in zip(spectra, white, known, strict=True):
            part = np.clip(1 - floor / power, _LEAST_PASSED, 1.0)
            response = least_phase(part * power)
            # Forces of noise and impacts differ, but gains are of responses: both are scaled to the same maximum.
            loudest = math.sqrt(float((part * np.abs(response) ** 2).max())) if there else 1.0
            passed.append(part)
            inverse.append(loudest / response)
        self.passed, self.inverse = np.concatenate(passed), np.concatenate(inverse)
        self.known = np.repeat(known, [power.size for power in spectra])
        self.f = np.concatenate([_frequencies(power.size) for power in spectra])

    def curves(
        self, places: Array, dampings: Sequence[float], levels: Sequence[float]
    ) -> tuple[Array, list[Values], list[float]]:
        """[candidates, bands] ln of the power with the mode over that without; frequency (part of the rate), damping
        ratio and signed gain of each candidate; and its level.

        `levels`: power that the mode would add by itself to that of the path, where it adds most; negative where it
        moves the sensor against the path.
        """
        place, damping = (a.ravel() for a in np.meshgrid(places, np.asarray(dampings, float), indexing="ij"))
        relative = mode_response(self.f, place[:, None, None], damping[:, None, None]) * self.inverse[:, None]
        along, alone = relative.real.mean(axis=2), (relative.real**2 + relative.imag**2).mean(axis=2)
        most = (self.passed * alone)[:, self.known].max(axis=1)
        wanted = np.asarray(levels, float)
        gain = np.copysign(np.sqrt(np.abs(wanted) / most[:, None]), wanted)
        factor = np.maximum(1 + gain[:, :, None] * (2 * along[:, None] + gain[:, :, None] * alone[:, None]), _CANCELLED)
        curves = np.log(self.passed * (factor - 1) + 1).reshape(-1, self.passed.size)
        modes = zip(place.tolist(), damping.tolist(), gain.tolist(), strict=True)
        values = [(at, width, one) for at, width, gains in modes for one in gains]
        return curves, values, wanted.tolist() * place.size


def mode_response(f: Array, place: Array | float, damping: Array | float) -> Complex:
    """Minimum-phase response of a mode, sampled, about 1 at its peak; frequencies are parts of the sampling rate."""
    pole = 2 * math.pi * place * (-damping + 1j * np.sqrt(1 - np.asarray(damping) ** 2))
    (now, before), turn = moving_average(np.asarray(pole)), np.exp(-2j * np.pi * f)
    decay, angle = np.exp(pole.real), pole.imag
    size = (1 - decay) * np.abs(1 - decay * np.exp(-2j * angle)) / np.abs(now + before * np.exp(-1j * angle))
    return np.asarray(size * (now + before * turn) / (1 - 2 * decay * np.cos(angle) * turn + decay**2 * turn**2))


def least_phase(power: Array) -> Complex:
    """Minimum-phase response with this power [bands], at the middle of each band from 0 to half the rate."""
    to_cepstrum, to_phase = _transforms(power.size)
    log = 0.5 * np.log(power)
    return np.asarray(np.exp(log - 1j * (to_phase @ (to_cepstrum @ log))))


@cache
def _transforms(bands: int) -> tuple[Array, Array]:
    """[quefrencies, bands] Cosines that make twice a cepstrum, and [bands, quefrencies] sines that make its phase."""
    w, lag = (np.arange(bands) + 0.5) * np.pi / bands, np.arange(1, bands)
    return np.cos(np.outer(lag, w)) * (2 / bands), np.sin(np.outer(w, lag))


@cache
def _frequencies(bands: int) -> Array:
    """[bands, within] Parts of the sampling rate."""
    return (np.arange(bands * _WITHIN) + 0.5).reshape(bands, _WITHIN) / (2 * bands * _WITHIN)
