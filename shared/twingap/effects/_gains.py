"""Gains and densities given at some frequencies: their check, and the causal filter that has such gains."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects.base import Effect
from twingap.errors import TwingapError

MOST_PLACES: Final = 512
"""Largest number of frequencies of a response."""
_ALIKE_DB: Final = 0.5
"""Difference that a shortened list may make, dB. A larger value gives shorter lists."""


def check_places(effect: Effect, places: tuple[float, ...], values: tuple[float, ...], name: str) -> None:
    """Raise an error unless there is one value at each of few enough, increasing places."""
    where = f"effect {effect.name}"
    if len(places) != len(values):
        raise TwingapError(f"{len(places)} frequencies and {len(values)} {name}, as many expected", where=where)
    if len(places) > MOST_PLACES:
        raise TwingapError(f"{len(places)} frequencies, at most {MOST_PLACES} expected", where=where)
    if any(later <= earlier for earlier, later in itertools.pairwise(places)):
        raise TwingapError("frequencies do not increase", where=where, mend="sort them, each once")


def few_places(places: tuple[float, ...], values: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A few of these places between which straight lines are within `_ALIKE_DB` of all values, and their values."""
    if len(places) < 3:
        return places, values
    x, y = np.array(places), np.array(values)
    kept = [0, len(places) - 1]
    while len(kept) < len(places):
        off = np.abs(np.interp(x, x[kept], y[kept]) - y)
        if off.max() <= _ALIKE_DB:
            break
        kept = sorted({*kept, int(np.argmax(off))})
    return tuple(float(f"{f:.4g}") for f in x[kept]), tuple(float(v) for v in y[kept].round(1))


@lru_cache(maxsize=32)
def minimum_phase(
    n: int, fs_hz: float, frequencies_hz: tuple[float, ...], gains_db: tuple[float, ...], depth: float = 1.0
) -> NDArray[np.complex128]:
    """[n // 2 + 1] Response of minimum phase with these gains, at the frequencies of a real transform of n samples."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    log_gain = depth * math.log(10) / 20 * np.interp(f, frequencies_hz, gains_db)
    cepstrum = scipy.fft.irfft(log_gain, n)
    # The causal part twice: the imaginary part of its transform is the phase that belongs to the gain.
    cepstrum[1 : (n + 1) // 2] *= 2
    cepstrum[n // 2 + 1 :] = 0
    return np.asarray(np.exp(scipy.fft.rfft(cepstrum)))
