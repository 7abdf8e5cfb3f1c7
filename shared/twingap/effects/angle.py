"""Waveforms as functions of shaft angle: reading them at other angles, and building them from harmonics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

Array = NDArray[np.float64]


def at_angles(x: Array, turns: Array, wanted: Array) -> Array:
    """A waveform read at other shaft angles.

    Parameters
    ----------
    x : Array [samples]
        The waveform, sampled evenly in time.
    turns : Array [samples]
        Shaft angle at each sample, increasing.
    wanted : Array [any]
        Angles to read at, turns. The waveform is mirrored beyond its ends.

    Returns
    -------
    Array [any]
        By quintic splines, which keep what lies below about two thirds of half the sampling rate.
    """
    places = np.interp(wanted, turns, np.arange(x.size, dtype=float))
    return np.asarray(map_coordinates(x, places[None], order=5, mode="mirror"))


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
    if not len(amplitudes):
        return np.zeros(turns.size)
    z = np.exp(2j * np.pi * turns)
    total = amplitudes[-1] * z
    for amplitude in reversed(amplitudes[:-1]):  # Horner: one complex product per harmonic
        total += amplitude
        total *= z
    return np.ascontiguousarray(total.real)
