"""Structural modes, and their response to impacts and forces.

impacts (times, amplitudes) --+
                              +--> one complex recursion per mode --> x [samples]
force [samples] --------------+

A mode's response h(t) = exp(-zeta w t) sin(w_d t) is the imaginary part of exp(s t), s = -zeta w + j w_d, so a state z
that turns by p = exp(s / fs) from sample to sample carries all impacts so far. An impact between two samples
enters at the later one with the phase and decay that it has gathered by then: no impact is rounded to the grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-6
"""Part of its amplitude below which the ring-down of earlier impacts is left out. A smaller value is slower."""

PAST = 16
"""Normal numbers that describe a force's past: two for each of eight modes; any further mode starts at rest."""

_AT_ZEROS = 1e-9
"""Imaginary part of a pole below which samples do not show the mode. A larger value leaves more modes as they are."""

LEAD = 256
"""Samples computed before each record and cut off at the end, in which filters of the path settle."""


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

    def noise_gain(self, fs_hz: float) -> complex:
        """Part of a sample's force, taken to be white noise in continuous time, that enters the mode's state.

        With 1, each sample's force is one impact on the grid of samples, and its response has the aliases of all
        impacts in phase: up to 6 dB too much next to fs / 2 and too little below the mode. A force that acts all the
        time is many small impacts at any time. The mode then is an autoregressive moving average of orders (2, 1)
        (Pandit and Wu, Time Series and System Analysis with Applications, 1983, ch. 7), which this gain gives exactly.
        """
        pole = np.array(self.pole / fs_hz)
        (b0, b1), p = moving_average(pole), np.exp(pole)
        # With a pole at a multiple of half the rate, samples are at the response's zeros.
        return complex((p.real * b0 + b1) / p.imag, b0) if abs(p.imag) > _AT_ZEROS else 1.0

    @property
    def ring_down_s(self) -> float:
        """Time after which no more than `NEGLIGIBLE` of an impact is left, s."""
        return -math.log(NEGLIGIBLE) / (self.damping_ratio * 2 * math.pi * self.frequency_hz)


def modal_response(
    modes: Sequence[Mode],
    fs_hz: float,
    n_samples: int,
    times_s: Array | None = None,
    amplitudes: Array | None = None,
    force: Array | None = None,
    past: Array | None = None,
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
        Impacts in any order and at any times, also before the record; later ones are left out. An impact of
        amplitude A adds A h(t - t_i), whatever the sampling rate.
    force : Array [samples], optional
        One impact per sample.
    past : Array [`PAST`], optional
        Independent normal numbers of the standard deviation that the force, taken to be white, had before the record.
        They set the modes' states at its start as that force would have left them, so that the response is stationary
        from the first sample on. Without them the modes are at rest but for earlier impacts.

    Returns
    -------
    Array [samples]
    """
    x = np.zeros(n_samples)
    hits = times_s is not None and amplitudes is not None and times_s.size > 0
    if not hits and force is None and past is None:
        return x
    none = np.empty(0)
    times = np.ascontiguousarray(times_s) if hits and times_s is not None else none
    strengths = np.ascontiguousarray(amplitudes) if hits and amplitudes is not None else none
    pushed = none if force is None else np.ascontiguousarray(force)
    begin = np.zeros(2 * len(modes))
    if past is not None:
        root = _state_root(tuple(modes[: past.size // 2]), fs_hz)
        begin[: len(root)] = root @ past[: len(root)]
    for place, mode in enumerate(modes):
        buffers, pole, state = np.zeros((2, n_samples)), mode.pole, begin[2 * place : 2 * place + 2]
        k = mode.noise_gain(fs_hz)
        _add_mode(
            x, *buffers, pole.real, pole.imag, mode.gain, fs_hz, times, strengths, pushed, k.real, k.imag,
            *state.tolist(),
        )  # fmt: skip
    return x


def response_rms(modes: Sequence[Mode], fs_hz: float) -> float:
    """RMS of the modes' summed response to a force of unit white noise (independent samples of variance 1).

    The closed form of sqrt(sum_n h(n / fs)^2), so that a wanted RMS after the path can be turned into one before it.
    """
    return _response_rms(tuple(modes), fs_hz)


def moving_average(s: NDArray[np.complex128]) -> tuple[Array, Array]:
    """Weights b0 and b1 of a white force's sample and the one before in the response of a mode of pole s per sample.

    x_n - 2 Re p x_(n-1) + |p|^2 x_(n-2) = b0 f_n + b1 f_(n-1), p = exp(s), of a force that always acts; b0 > |b1|.
    """
    back = -np.exp(s).conj()
    # xi, what a sample's noise leaves in the state: E |xi|^2 and E xi^2. The left side is Im xi_n - Im(p* xi_(n-1)).
    mixed, plain = np.expm1(2 * s.real) / (2 * s.real), np.expm1(2 * s) / (2 * s)
    own = 0.5 * (mixed * (1 + np.abs(back) ** 2) - (plain * (1 + back**2)).real)
    next_ = 0.5 * (back.conj() * mixed - back * plain).real
    plus, minus = (np.sqrt(np.maximum(own + sign * 2 * next_, 0.0)) for sign in (1, -1))
    return (plus + minus) / 2, (plus - minus) / 2


@lru_cache(maxsize=256)
def _response_rms(modes: tuple[Mode, ...], fs_hz: float) -> float:
    gains = np.array([mode.gain for mode in modes])
    apart = _state_covariance(modes, fs_hz)[1::2, 1::2]
    return math.sqrt(max(float(gains @ apart @ gains), 0.0))


def _state_covariance(modes: tuple[Mode, ...], fs_hz: float) -> Array:
    """Covariance of the modes' states (re, im, re, im, ...) under unit white noise, which has always acted on them.

    From z_n = p z_(n-1) + k f_n, with k the `Mode.noise_gain`, follow E[z_i z_j*] = k_i k_j* / (1 - p_i p_j*) and
    E[z_i z_j] = k_i k_j / (1 - p_i p_j).
    """
    s = np.array([mode.pole for mode in modes]) / fs_hz
    k = np.array([mode.noise_gain(fs_hz) for mode in modes])
    # expm1 rather than 1 - exp: a sharp mode's pole lies close to the unit circle.
    mixed, plain = (-k[:, None] * gain / np.expm1(s[:, None] + other) for other, gain in ((s.conj(), k.conj()), (s, k)))
    out = np.empty((2 * s.size, 2 * s.size))
    out[::2, ::2], out[1::2, 1::2] = (mixed + plain).real / 2, (mixed - plain).real / 2
    out[::2, 1::2], out[1::2, ::2] = (plain - mixed).imag / 2, (plain + mixed).imag / 2
    return out


@lru_cache(maxsize=256)
def _state_root(modes: tuple[Mode, ...], fs_hz: float) -> Array:
    """Lower triangle L with L L^T the states' covariance: the first mode's state never depends on those after it."""
    covariance = _state_covariance(modes, fs_hz)
    # Equal modes have equal states: a trace of the diagonal keeps the root defined.
    return np.asarray(np.linalg.cholesky(covariance + 1e-10 * np.diag(np.diag(covariance))))


@njit()
def _add_mode(x, re, im, decay, turn, gain, fs_hz, times, amplitudes, force, kr, ki, a, b):  # type: ignore[no-untyped-def]  # pragma: no cover
    # `re` and `im` are zeros; the pole is decay + j turn, per second; a + j b is the state before the first sample.
    n = x.size
    size = math.exp(decay / fs_hz)
    p, q = size * math.cos(turn / fs_hz), size * math.sin(turn / fs_hz)
    for i in range(times.size):
        at = math.ceil(times[i] * fs_hz)
        if at >= n:
            continue
        if at < 0:
            at = 0
        late = at / fs_hz - times[i]
        if decay * late < -60.0:
            continue
        size = math.exp(decay * late)
        re[at] += amplitudes[i] * (size * math.cos(turn * late))
        im[at] += amplitudes[i] * (size * math.sin(turn * late))
    for i in range(force.size):
        re[i] += kr * force[i]
        im[i] += ki * force[i]
    for i in range(n):
        a, b = p * a - q * b + re[i], p * b + q * a + im[i]
        x[i] += gain * b
