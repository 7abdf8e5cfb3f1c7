"""Draft: a record under construction, and the fields that each stage of the chain reads and writes.

stage         owns
SHAFT         turns, cage_speed_ratio
EXCITATION    impacts, cage_lag, gain, force
PATH          modes, filters, sensed_noise
DISTURBANCE   x (adds to it)
ACQUISITION   x (replaces it)

Which fields an effect can use depends on the simulator (`excitation`), and so does the code that applies them:

field              "impacts"                   "rollers"                          "waveform"
turns              angles of the impacts        the contact's shaft angle          x is resampled over the angle
cage_speed_ratio   fault_order                 the rollers' speed                 none: mean_slip refuses
cage_lag           none (impacts move)         cage angle = ftf ratio             x(turns - cage_lag)
                                               (turns - cage_lag)
gain               none (amplitudes change)    respond(): x = gain x + ...        x = gain x
background         none                        none                               x = impacts alone + background
force              respond(): through modes    respond(): ... + through modes     none: see impact_response
filters            respond(): x                respond(): x                       x
sensed_noise       white noise                 white noise                        none: x holds its noise already
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects.modes import LEAD, PAST, Mode
from twingap.records import Condition

Array = NDArray[np.float64]


@dataclass
class Impacts:
    """Impacts of rolling elements on a defect.

    Parameters
    ----------
    turns : Array [impacts]
        Shaft angle of each impact, in turns since the record's start; negative for impacts before it, whose ring-down
        reaches into the record. Weights by angle are functions of these, as q(iT) in eq. 1 of paper 1.
    amplitudes : Array [impacts]
        Strength of each, in record units.
    passes : NDArray[int64] [impacts]
        Number of the roller pass that made it (several impacts may belong to one pass).
    delays : Array [impacts] or None
        Random delay of each, in turns: tau_i of eq. 1. None for no delays.
    """

    turns: Array
    amplitudes: Array
    passes: NDArray[np.int64]
    delays: Array | None = None

    @property
    def delayed_turns(self) -> Array:
        """[impacts] Shaft angle of each impact with its delay, turns."""
        return self.turns if self.delays is None else self.turns + self.delays


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
        RMS of the twin's healthy vibration, in record units: the amplitude scale of disturbances and of the
        converter, the same for every record of a machine whatever its fault.
    t : Array [samples]
        Time, s.
    turns : Array [samples]
        Shaft angle in turns at each sample, increasing, from 0. Outside the record it goes on at `condition.speed_rpm`.
    cage_speed_ratio : float
        Cage speed over its kinematic value.
    spin_share : float
        Part of the cage's slip by which the order of a roller's defect moves: 1 where rollers keep rolling on the inner
        ring.
    excitation : {"impacts", "rollers", "waveform"}
        Object of effects on the excitation: a list of impacts (phenomenological), rollers that move through a loaded
        contact (dynamics), or a finished waveform (a foreign simulator).
    cage_lag : Array [samples] or None
        Random delay of the roller train ("rollers"), or of all the waveform ("waveform"), in shaft turns: what would
        have been at shaft angle `turns - cage_lag` is at `turns`. Add to it with `delay`.
    impacts : Impacts or None
        None for healthy records, and for finished waveforms.
    force : Array [LEAD + samples] or None
        Broadband force that passes through the modes like the impacts do (structure noise, roughness); it begins
        `modes.LEAD` samples before the record. Add to it with `push`.
    past : Array [`modes.PAST`] or None
        That force before the record, for `modal_response`: no record starts at rest.
    gain : Array [samples] or None
        Factor on the waveform that stands for modulated impacts, for simulators that have none ("rollers", "waveform").
        Multiply it with `modulate`.
    background : Array [samples] or None
        Finished waveforms, while effects on impacts act: the part that is not impacts; `x` holds the impacts alone.
        None where the two cannot be separated.
    modes : list[Mode]
        The path: structural modes in parallel. Empty for a finished waveform; "rollers" hold their linearised contact.
    filters : list of callables, Array -> Array
        The path after the modes (mounting, sensor), applied in turn to x and up to LEAD samples before it.
    sensed_noise : list of (float, callable Array -> Array)
        Part of the white noise's power that is vibration before a sensor, not noise of the chain behind it, and what
        that sensor makes of it.
    own_noise : float
        Factor on the noises that the twin has of its own; below 1 where an effect brings noise in their place.
    impact_response : callable
        Finished waveforms: the simulator's response to one impact, see `impact_train.response_of`; None where unknown.
    force_response : callable
        Finished waveforms: the same, or where impacts do not stand out a response of the same power, see
        `force_response.force_response`; None where unknown.
    x : Array [samples]
        The waveform. Before the path has acted it is empty, except for simulators that make all of it.
    """

    condition: Condition
    bearing: Bearing
    reference_rms: float
    t: Array
    turns: Array
    excitation: Literal["impacts", "rollers", "waveform"] = "impacts"
    cage_speed_ratio: float = 1.0
    spin_share: float = 1.0
    cage_lag: Array | None = None
    impacts: Impacts | None = None
    force: Array | None = None
    past: Array | None = None
    gain: Array | None = None
    background: Array | None = None
    modes: list[Mode] = field(default_factory=list)
    filters: list[Callable[[Array], Array]] = field(default_factory=list)
    sensed_noise: list[tuple[float, Callable[[Array], Array]]] = field(default_factory=list)
    own_noise: float = 1.0
    impact_response: Callable[[], Array | None] = lambda: None
    force_response: Callable[[], Array | None] = lambda: None
    x: Array = field(default_factory=lambda: np.empty(0))

    @property
    def faulty(self) -> bool:
        """Whether this record's bearing has a defect."""
        return self.condition.fault not in (None, "healthy")

    @property
    def shaft_hz(self) -> float:
        """Mean shaft speed, turns per second."""
        return self.condition.speed_rpm / 60

    @property
    def fault_order(self) -> float:
        """Impacts per shaft turn of this record's fault, slip included."""
        share = self.spin_share if self.condition.fault == "ball" else 1.0
        return self.bearing.slipped(1 - share * (1 - self.cage_speed_ratio))[self.condition.fault or "healthy"]

    def beyond_nyquist(self, frequency_hz: float) -> str | None:
        """Reason why a frequency cannot appear in this record, or None."""
        if frequency_hz < self.condition.fs_hz / 2:
            return None
        return (
            f"{frequency_hz:g} Hz lies above half the sampling rate of record {self.condition.name!r}, "
            f"{self.condition.fs_hz:g} Hz"
        )

    def modulate(self, factor: Array | float) -> None:
        """Multiply the gain of a waveform without impacts."""
        self.gain = (np.ones(self.t.size) if self.gain is None else self.gain) * factor

    def delay(self, turns: Array) -> None:
        """Delay the roller train or the waveform by so many shaft turns more, sample by sample."""
        self.cage_lag = turns if self.cage_lag is None else self.cage_lag + turns

    def push(self, force: Array, rng: np.random.Generator, rms_before: float) -> None:
        """Add a broadband force [samples] before the path, independent from sample to sample.

        `rms_before` is its RMS just before the record; `rng` draws its past.
        """
        past = rms_before * rng.standard_normal(PAST)
        force = np.concatenate((rms_before * rng.standard_normal(LEAD), force))
        self.force = force if self.force is None else self.force + force
        self.past = past if self.past is None else self.past + past

    def amplify_force(self, factor: float) -> None:
        """Multiply all broadband force so far, before the record and in it."""
        self.force = None if self.force is None else self.force * factor
        self.past = None if self.past is None else self.past * factor

    def when(self, turns: Array) -> Array:
        """Times (s) at which the shaft passes the given angles (turns), within and beyond the record."""
        at = np.interp(turns, self.turns, self.t)
        at = np.where(turns < self.turns[0], self.t[0] + (turns - self.turns[0]) / self.shaft_hz, at)
        return np.where(turns > self.turns[-1], self.t[-1] + (turns - self.turns[-1]) / self.shaft_hz, at)
