"""Observations of records and twin, for closed-form estimates of an effect's values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing

Array = NDArray[np.float64]


class ModePair(NamedTuple):
    """Two modes in parallel that explain the spectra of the records.

    Parameters
    ----------
    frequencies_hz, dampings : (float, float)
        Natural frequency (Hz) and damping ratio of each.
    gain : float
        The second's response to an impact over the first's; negative where it moves against it.
    """

    frequencies_hz: tuple[float, float]
    dampings: tuple[float, float]
    gain: float


@dataclass(frozen=True)
class HealthySpectrum:
    """Mean power density of the healthy records, without tones, and densities of the twin.

    Parameters
    ----------
    density : Array [bands]
        1/Hz in squared units, in bands of equal width from 0 to half the sampling rate.
    fs_hz : float
        Sampling rate.
    centres_hz : tuple of float
        Candidate frequencies of the twin's own mode; empty for finished waveforms, which have no parameters.
    mode : callable
        Natural frequency (Hz) and damping ratio -> density [bands] of unit variance behind this mode.
    twin : callable
        Density [bands] of the given twin; calling it runs a simulation.
    """

    density: Array
    fs_hz: float
    centres_hz: tuple[float, ...]
    mode: Callable[[float, float], Array]
    twin: Callable[[], Array]

    @property
    def places(self) -> Array:
        """[bands] Middle of each band, parts of the sampling rate."""
        return np.asarray((np.arange(self.density.size) + 0.5) / (2 * self.density.size))


class SpectrumRatio(NamedTuple):
    """Spectra of the records over those of the given twin, averaged over the states.

    Parameters
    ----------
    middles_hz : Array [bands]
    log_ratio : Array [bands]
        Logarithm of the ratio of powers.
    """

    middles_hz: Array
    log_ratio: Array


@dataclass(frozen=True)
class Observations:
    """Observations of the records for initial values of an effect.

    Parameters
    ----------
    features : Mapping[str, float]
        All features of the comparison by name; NaN where one could not be computed.
    held_out : Mapping[str, float]
        The same of the held-out records against the twin as given: for places of lines, which no fit moves.
    bearing : Bearing
    faults : frozenset of str
        Faults of the records, healthy ones left out.
    fs_hz : float
        Highest sampling rate.
    begin_s, span_s : float
        Begin and length of the run; length 1 where there is none.
    speed_rpm : float
        Median speed.
    own_mode : (float, float) or None
        Natural frequency (Hz) and damping ratio of the twin's own mode; None where it has none.
    healthy : callable
        Spectrum of the healthy records; None without any.
    mode_pairs : callable
        Pairs of modes that explain all spectra, the best first.
    spectrum_ratio : callable
        Spectra of the records over those of the given twin; calling it runs a simulation.
    """

    features: Mapping[str, float]
    held_out: Mapping[str, float]
    bearing: Bearing
    faults: frozenset[str]
    fs_hz: float
    begin_s: float
    span_s: float
    speed_rpm: float
    own_mode: tuple[float, float] | None
    healthy: Callable[[], HealthySpectrum | None]
    mode_pairs: Callable[[], Sequence[ModePair]]
    spectrum_ratio: Callable[[], SpectrumRatio]
