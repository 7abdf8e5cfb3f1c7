"""Random values of effects that are detectable in a machine's records."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects.machine import Machine

Array = NDArray[np.float64]

_DETECTABLE: Final = 93.0
"""Power of a tone over that of the noise, times the samples, from which it can be detected. Larger values draw louder
tones."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform between two ends."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def faults(machine: Machine) -> set[str]:
    """Faults of the machine's records, healthy ones left out."""
    return {str(c.fault) for c in machine.conditions} - {"healthy"}


def faintest_tone(machine: Machine) -> float:
    """Amplitude of a tone, healthy rms, that can just be detected in all records of the machine together."""
    samples = sum(c.n_samples for c in machine.conditions)
    return float(np.clip(math.sqrt(_DETECTABLE / samples), 0.012, 0.09))


def tone_level(rng: np.random.Generator, machine: Machine, most: float) -> float:
    """Amplitude of a tone, healthy rms: half of them near the limit of detection."""
    faintest = faintest_tone(machine)
    return log_uniform(rng, 0.8 * faintest, 5 * faintest) if rng.random() < 0.5 else log_uniform(rng, faintest, most)


def secondary_mode(
    rng: np.random.Generator, machine: Machine, place: tuple[float, float], damping: tuple[float, float]
) -> dict[str, float]:
    """`resonance_hz` and `damping_ratio` of the mode that impacts from another source excite: a mode on their path, or
    the machine's own.

    Parameters
    ----------
    rng : numpy.random.Generator
    machine : Machine
    place : (float, float)
        Range of the natural frequency, parts of the sampling rate.
    damping : (float, float)
        Range of the damping ratio.
    """
    own = machine.parameters
    if rng.random() < 0.4:
        return {"resonance_hz": own.resonance_hz, "damping_ratio": own.damping_ratio}
    return {
        "resonance_hz": machine.conditions[0].fs_hz * log_uniform(rng, *place),
        "damping_ratio": log_uniform(rng, *damping),
    }


def healthy_density(machine: Machine, f_hz: float, more: tuple[float, float, float] | None = None) -> float:
    """Power density of the machine's healthy vibration at a frequency, 1/Hz in units of its scale, with all modes.

    Parameters
    ----------
    machine : Machine
    f_hz : float
    more : (float, float, float), optional
        Natural frequency (Hz), damping ratio and gain of one more mode.
    """
    own, fs_hz = machine.parameters, machine.conditions[0].fs_hz
    grid = np.linspace(0, fs_hz / 2, 600)
    first = _response(grid, own.resonance_hz, own.damping_ratio, 1.0)
    force = own.structure_noise_rms**2 / float(np.mean(np.abs(first) ** 2) * fs_hz / 2)
    at = np.array([f_hz])
    total = _response(at, own.resonance_hz, own.damping_ratio, 1.0)
    for mode in machine.modes:
        total = total + _response(at, mode.frequency_hz, mode.damping_ratio, mode.gain)
    if more is not None:
        total = total + _response(at, *more)
    return float(np.abs(total[0]) ** 2 * force + own.white_noise_rms**2 / (fs_hz / 2))


def _response(at_hz: Array, mode_hz: float, damping: float, gain: float) -> NDArray[np.complex128]:
    w = 2 * np.pi * mode_hz
    return np.asarray(gain * w / (w**2 - (2 * np.pi * at_hz) ** 2 + 4j * np.pi * damping * w * at_hz))
