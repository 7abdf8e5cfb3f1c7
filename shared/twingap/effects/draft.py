"""The record while it is being made: what each stage of the chain reads and writes.

stage         owns
SHAFT         turns, cage_speed_ratio
EXCITATION    impacts, cage_lag, gain, force
PATH          modes, filters
DISTURBANCE   x (adds to it)
ACQUISITION   x (replaces it)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.records import Condition

Array = NDArray[np.float64]


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


@dataclass
class Impacts:
    """Impacts of rolling elements on a defect.

    Parameters
    ----------
    turns : Array [impacts]
        Shaft angle of each impact, in turns since the record's start; negative for impacts before it, whose ringing
        still reaches into the record. Excitation effects that move impacts move these.
    amplitudes : Array [impacts]
        Strength of each, in record units.
    passes : NDArray[int64] [impacts]
        Number of the roller pass that made it (several impacts may belong to one pass).
    """

    turns: Array
    amplitudes: Array
    passes: NDArray[np.int64]


@dataclass
class Draft:
    """One record under construction. Effects change it in place.

    Parameters
    ----------
    condition : Condition
        What is to be made: speed, fault, load, rate, length.
    bearing : Bearing
        Geometry of the bearing under test.
    reference_rms : float
        RMS of the twin's healthy vibration, in record units: the yardstick of disturbances and of the converter, the
        same for every record of a machine whatever its fault.
    t : Array [samples]
        Time, s.
    turns : Array [samples]
        Shaft angle in turns at each sample, increasing, from 0. Outside the record it goes on at `condition.speed_rpm`.
    cage_speed_ratio : float
        Cage speed over its kinematic value.
    excitation : {"impacts", "rollers", "waveform"}
        What the simulator lets an effect act on: a list of impacts (phenomenological), rollers that move through a
        loaded contact (dynamics), or nothing but a finished waveform (a foreign simulator).
    cage_lag : Array [samples] or None
        Random departure of the roller train from the cage's mean angle, in shaft turns ("rollers" only).
    impacts : Impacts or None
        None for healthy records, and for simulators that hand over a finished waveform.
    force : Array [samples] or None
        Broadband force that passes through the modes like the impacts do (structure noise, roughness).
    gain : Array [samples] or None
        Factor on a finished waveform that stands for modulated impacts (only simulators without impacts use it).
    modes : list[Mode]
        The path: structural modes in parallel.
    filters : list of callables, Array -> Array
        The path after the modes (mounting, sensor), applied in turn to x.
    x : Array [samples]
        The waveform. Before the path has acted it is empty, except for simulators that make it whole.
    """

    condition: Condition
    bearing: Bearing
    reference_rms: float
    t: Array
    turns: Array
    excitation: Literal["impacts", "rollers", "waveform"] = "impacts"
    cage_speed_ratio: float = 1.0
    cage_lag: Array | None = None
    impacts: Impacts | None = None
    force: Array | None = None
    gain: Array | None = None
    modes: list[Mode] = field(default_factory=list)
    filters: list[Callable[[Array], Array]] = field(default_factory=list)
    x: Array = field(default_factory=lambda: np.empty(0))

    @property
    def shaft_hz(self) -> float:
        """Mean shaft speed, turns per second."""
        return self.condition.speed_rpm / 60

    @property
    def fault_order(self) -> float:
        """Impacts per shaft turn of this record's fault, slip included."""
        return self.bearing.slipped(self.cage_speed_ratio)[self.condition.fault or "healthy"]

    def when(self, turns: Array) -> Array:
        """Times (s) at which the shaft passes the given angles (turns), within and beyond the record."""
        at = np.interp(turns, self.turns, self.t)
        at = np.where(turns < self.turns[0], self.t[0] + (turns - self.turns[0]) / self.shaft_hz, at)
        return np.where(turns > self.turns[-1], self.t[-1] + (turns - self.turns[-1]) / self.shaft_hz, at)
