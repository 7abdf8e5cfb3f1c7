"""How structural modes answer impacts and forces, exactly and in one pass.

impacts (times, amplitudes) --+
                              +--> one complex recursion per mode --> x [samples]
force [samples] --------------+

A mode's response h(t) = exp(-zeta w t) sin(w_d t) is the imaginary part of exp(s t), s = -zeta w + j w_d, so a state z
that turns by p = exp(s / fs) from sample to sample carries all that has struck so far. An impact between two samples
enters at the later one with the phase and decay that it has gathered by then: no impact is rounded to the grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-6
"""Part of its amplitude below which ringing from before a record is left out."""


@dataclass(frozen=True)
class Mode:
    """One damped structural mode, h(t) = gain exp(-zeta w t) sin(sqrt(1 - zeta^2) w t).

    Parameters
    ----------
    frequency_hz : float
        Natural frequency w / (2 pi), Hz.
    damping_ratio : float
        zeta, dimensionless, between 0 and 1.
    gain : float
        Amplitude of its response to a unit impact.
    """

    frequency_hz: float
    damping_ratio: float
    gain: float = 1.0

    @property
    def pole(self) -> complex:
        """s = -zeta w + j sqrt(1 - zeta^2) w, rad/s."""
        w = 2 * math.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, math.sqrt(1 - self.damping_ratio**2) * w)

    @property
    def ringing_s(self) -> float:
        """Time after which no more than `NEGLIGIBLE` of an impact is left, s."""
        return -math.log(NEGLIGIBLE) / (self.damping_ratio * 2 * math.pi * self.frequency_hz)


def ring(
    modes: Sequence[Mode],
    fs_hz: float,
    n_samples: int,
    times_s: Array | None = None,
    amplitudes: Array | None = None,
    force: Array | None = None,
) -> Array:
    """The sum of the modes' responses to impacts and to a force.

    Parameters
    ----------
    modes : sequence of Mode
        In parallel.
    fs_hz : float
        Sampling rate, Hz.
    n_samples : int
    times_s, amplitudes : Array [impacts], optional
        Impacts in any order, at any times: earlier ones ring into the record, later ones are left out. An impact of
        amplitude A adds A h(t - t_i), whatever the sampling rate.
    force : Array [samples], optional
        One impact per sample. The response is the steady one, as if the force repeated with the record's length, so
        that no record starts at rest.

    Returns
    -------
    Array [samples]
    """
    x = np.zeros(n_samples)
    hits = times_s is not None and amplitudes is not None and times_s.size > 0
    if not hits and force is None:
        return x
    none = np.empty(0)
    times = np.ascontiguousarray(times_s) if hits and times_s is not None else none
    strengths = np.ascontiguousarray(amplitudes) if hits and amplitudes is not None else none
    pushed = none if force is None else np.ascontiguousarray(force)
    for mode in modes:
        _add_mode(x, mode.pole, mode.gain, fs_hz, times, strengths, pushed)
    return x


def response_rms(modes: Sequence[Mode], fs_hz: float) -> float:
    """RMS of the modes' summed response to a force of unit white noise (independent samples of variance 1).

    The closed form of sqrt(sum_n h(n / fs)^2), so that a wanted RMS after the path can be turned into one before it.
    """
    return _response_rms(tuple(modes), fs_hz)


@lru_cache(maxsize=256)
def _response_rms(modes: tuple[Mode, ...], fs_hz: float) -> float:
    turns = [np.exp(mode.pole / fs_hz) for mode in modes]
    power = sum(
        a.gain * b.gain * 0.5 * float(np.real(1 / (1 - p * np.conj(q)) - 1 / (1 - p * q)))
        for a, p in zip(modes, turns, strict=True)
        for b, q in zip(modes, turns, strict=True)
    )
    return math.sqrt(max(power, 0.0))


@njit(cache=True, nogil=True)
def _add_mode(x, pole, gain, fs_hz, times, amplitudes, force):  # type: ignore[no-untyped-def]  # pragma: no cover
    n = x.size
    turn = np.exp(pole / fs_hz)
    p, q = turn.real, turn.imag
    re, im = np.zeros(n), np.zeros(n)
    for i in range(times.size):
        at = math.ceil(times[i] * fs_hz)
        if at >= n:
            continue
        at = max(at, 0)
        late = at / fs_hz - times[i]
        if pole.real * late < -60.0:
            continue
        struck = amplitudes[i] * np.exp(pole * late)
        re[at] += struck.real
        im[at] += struck.imag
    a, b = 0.0, 0.0
    if force.size > 0:
        # Only as much of the force's end as still rings: exp(-40) is beyond rounding.
        tail = int(min(float(n), math.ceil(-40.0 * fs_hz / pole.real)))
        for i in range(n - tail, n):
            a, b = p * a - q * b + force[i], p * b + q * a
        steady = complex(a, b) / (1.0 - np.exp(pole * (n / fs_hz)))
        a, b = steady.real, steady.imag
        for i in range(n):
            re[i] += force[i]
    for i in range(n):
        a, b = p * a - q * b + re[i], p * b + q * a + im[i]
        x[i] += gain * b
