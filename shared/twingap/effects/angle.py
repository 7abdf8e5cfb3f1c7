"""Waveforms as functions of shaft angle: interpolation at other angles, and synthesis from harmonics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import map_coordinates

from twingap._compiled import njit

Array = NDArray[np.float64]

_SPARE = 128
"""Samples mirrored at either end, since a transform is periodic. Fewer give larger errors at the ends."""


def at_angles(x: Array, turns: Array, wanted: Array) -> Array:
    """A waveform read at other shaft angles.

    Parameters
    ----------
    x : Array [samples]
        The waveform, sampled evenly in time.
    turns : Array [samples]
        Shaft angle at each sample, increasing.
    wanted : Array [any]
        Angles to read at, turns. Beyond its ends the waveform keeps the value that it has there.

    Returns
    -------
    Array [any]
        Quintic splines over twice as many samples: without upsampling they are accurate up to a third of the rate.
    """
    places = np.interp(wanted, turns, np.arange(x.size, dtype=float))
    length = next_fast_len(x.size + 2 * _SPARE, real=True)
    padded = np.pad(x, (_SPARE, length - x.size - _SPARE), mode="reflect")
    spectrum = rfft(padded)
    if length % 2 == 0:
        spectrum[-1] *= 0.5  # the line at half the old rate stands for two at the new one
    finer = irfft(spectrum, 2 * length) * 2
    return np.asarray(map_coordinates(finer, 2 * (places[None] + _SPARE), order=5, mode="mirror"))


def harmonics(turns: Array, amplitudes: Sequence[complex]) -> Array:
    """The real part of sum_k a_k exp(2 pi j k turns), k = 1, 2, ...

    Parameters
    ----------
    turns : Array [samples]
        Phase of the first harmonic, in turns.
    amplitudes : sequence of complex
        a_k, from k = 1 on; the angle of each is its phase.

    Returns
    -------
    Array [samples]
    """
    weights = np.asarray(amplitudes, dtype=complex)
    total = np.zeros(turns.size)
    if weights.size:
        space = np.empty((4, min(BLOCK, turns.size)))
        _add_harmonics(total, turns, weights.real.copy(), weights.imag.copy(), *space)
    return total


def cosine(turns: Array) -> Array:
    """cos(2 pi turns), to rounding."""
    return harmonics(turns, [1.0])


BLOCK = 256  # samples at a time: their sines and cosines stay in the fastest cache


@njit()
def _add_harmonics(total, turns, real, imag, c, s, p, q):  # type: ignore[no-untyped-def]  # pragma: no cover
    # Angles in turns reduce exactly, so a short polynomial does; a library makes sine and cosine apart, and slower.
    for begin in range(0, turns.size, BLOCK):
        n = turns.size - begin
        if n > BLOCK:
            n = BLOCK
        for i in range(n):
            turn = turns[begin + i]
            # A quarter of the angle, at most pi / 4: its sine and 1 - cosine by Taylor, then doubled twice.
            a = (turn - math.floor(turn + 0.5)) * (0.5 * math.pi)
            b = a * a
            sine = a * (1 + b * (-1 / 6 + b * (1 / 120 + b * (-1 / 5040 + b * (1 / 362880 + b * (-1 / 39916800 + b * (
                1 / 6227020800 - b / 1307674368000)))))))  # fmt: skip
            verse = b * (0.5 + b * (-1 / 24 + b * (1 / 720 + b * (-1 / 40320 + b * (1 / 3628800 + b * (
                -1 / 479001600 + b * (1 / 87178291200 - b / 20922789888000)))))))  # fmt: skip
            # 1 - cosine rather than cosine, which loses digits near 0.
            sine, verse = 2 * sine * (1 - verse), 2 * sine * sine
            s[i], c[i] = 2 * sine * (1 - verse), 1 - 2 * sine * sine
            p[i], q[i] = 0.0, 0.0
        for k in range(real.size - 1, -1, -1):  # Horner: one complex product per harmonic
            x, y = real[k], imag[k]
            for i in range(n):
                u, v = p[i] + x, q[i] + y
                p[i], q[i] = u * c[i] - v * s[i], u * s[i] + v * c[i]
        for i in range(n):
            total[begin + i] += p[i]
