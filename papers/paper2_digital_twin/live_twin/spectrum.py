"""Amplitude spectrum of the contact twin in a given state of the machine, and its slopes.

stiffness, damping at T_ref --laws, T--> contact parameters --> rolling: kernel, 16 lanes ---> PSD --+
force level, speed ----------------------> white force --> linearised contact mode ----------> PSD --+--> amplitude
white noise --------------------------------------------------------------------------------> flat --+

One group of the kernel is sixteen trajectories for the price of one: three snapshots, each with the four shifted
parameter points that derivatives need. Close to a point where these have been integrated they are carried over, and a
group holds sixteen snapshots. The parts with noise are closed forms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from papers.arrays import Array
from papers.paper2_digital_twin.live_twin.laws import Laws
from twingap import Bearing, Condition, TwingapError
from twingap.effects import Mode
from twingap.effects.modes import response_rms
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_dynamics import Job, accelerations
from twingap.twins.contact_parameters import DEFECTS, ContactParameters

FREE: Final = ("stiffness", "damping", "force_level", "white_noise")
"""What is identified anew; the model works with their logarithms. The first three are watched for drift."""
STEP: Final = 0.02  # of the central differences, in the logarithms of stiffness and damping
NEAR: Final = np.array([0.01, 0.05])
"""How far stiffness and damping (logarithms) may move before the rollers' part is differentiated anew. Slopes carried
so far differ from fresh ones by up to a sixth (defective 6205 at 1800 rpm): a step of a fit hardly turns."""
RESOLUTION_HZ: Final = 12.0
"""Aimed distance of two bins: a third of the half width of a mode of 2 % damping at 2 kHz."""
REFERENCE_RPM: Final = 1800.0  # speed at which `force_level` holds
SEGMENTS: Final = 1.5  # length of a simulated trajectory, in segments: two that overlap by half
QUIET: Final = 0.05
"""Rollers that make less than this part of the power in the band are not integrated again while a fit goes on."""


@dataclass(frozen=True)
class MachineState:
    time_s: float
    temperature_c: float
    speed_rpm: float
    load_n: float
    fault: str = "healthy"


@dataclass(frozen=True)
class Band:
    fs_hz: float
    segment: int  # samples per segment of the spectra
    lowest_hz: float  # below lie shaft harmonics and the mounting's modes, which the twin does not have

    @classmethod
    def of(cls, fs_hz: float, lowest_hz: float) -> Band:
        """The band at this sampling rate: up to 0.42 fs, where filters begin to roll off."""
        return cls(fs_hz, 2 ** max(6, round(math.log2(fs_hz / RESOLUTION_HZ))), lowest_hz)

    @cached_property
    def f_hz(self) -> Array:
        return np.asarray(np.fft.rfftfreq(self.segment, 1 / self.fs_hz))

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        return (self.f_hz >= self.lowest_hz) & (self.f_hz <= 0.42 * self.fs_hz)

    @cached_property
    def delay(self) -> NDArray[np.complex128]:
        """1 / z of the bins that are compared [bins]."""
        return np.asarray(np.exp(-2j * np.pi * self.f_hz[self.inside] / self.fs_hz))

    def averages(self, samples: int) -> float:
        """Independent averages behind a spectrum of so many samples, half overlapping Hann segments (Welch 1967)."""
        k = max(1, (samples - self.segment) // (self.segment // 2) + 1)
        return float(k / (1 + 2 * (k - 1) / k / 36))

    def amplitude(self, samples: Array) -> Array:
        """Root of the PSD in the band [bins]."""
        centred = samples - samples.mean()
        return np.asarray(np.sqrt(welch(centred, self.fs_hz, nperseg=self.segment, detrend=False)[1][self.inside]))


@dataclass(frozen=True)
class Prediction:
    """An amplitude spectrum and its derivatives."""

    amplitude: Array  # [bins] root of the PSD, record unit per root Hz
    slopes: Array  # [4, bins] by the logarithms of `FREE`
    rolling: Array  # [bins] PSD of rollers passing and striking, which is in `amplitude` too
    theta: Array  # [4] logarithms of `FREE` for which it holds
    # [4, bins] what is added to `rolling` when stiffness rises or falls by `STEP`, then damping; None where it was held
    shifted: Array | None
    shifted_at: Array  # [2] logarithms of stiffness and damping where `shifted` was integrated

    @property
    def quiet(self) -> bool:
        """Whether the rollers make too little of the power to matter."""
        return float(self.rolling.sum()) < QUIET * float((self.amplitude**2).sum())

    def serves(self, theta: Array) -> bool:
        """Whether `shifted` is good enough at this point."""
        return self.shifted is not None and bool((np.abs(theta[:2] - self.shifted_at) <= NEAR).all())


class SpectrumModel:
    """Spectra of the contact twin over states and parameters, of which `parameters` give what is not free and the
    clearance at the reference temperature; `follow`: whether clearance and damping follow temperature."""

    def __init__(self, bearing: Bearing, parameters: ContactParameters, laws: Laws, *, follow: bool) -> None:
        self.bearing, self.parameters, self.laws, self.follow = bearing, parameters, laws, follow

    def start(self, state: MachineState, fs_hz: float) -> Array:
        """ln of `FREE` that reproduce the parameters' own noise levels in this state, of a running machine [4]."""
        own = self.parameters
        theta = np.log([own.stiffness, own.damping, 1.0, max(own.scale * own.white_noise_rms, 1e-12)])
        unit = self.at(theta, state, fs_hz).structure_noise_rms
        theta[2] = math.log(max(own.structure_noise_rms, 1e-9) / unit)
        return theta

    def at(self, theta: Array, state: MachineState, fs_hz: float) -> ContactParameters:
        """The twin's parameters in this state, by the laws."""
        made = self._contact(theta, state)
        mode = ContactTwin(self.bearing, made).contact_mode(state.load_n)
        level, white = (float(v) for v in np.exp(theta[2:]))
        structure = level * self._push(mode, state, fs_hz) * response_rms([mode], fs_hz) / made.scale
        return replace(made, structure_noise_rms=structure, white_noise_rms=white / made.scale)

    def _contact(self, theta: Array, state: MachineState) -> ContactParameters:
        """The same without the levels of noise, which the contact's motion does not depend on."""
        stiffness, damping = (float(v) for v in np.exp(theta[:2]))
        own, laws = self.parameters, self.laws
        clearance = own.clearance_um
        if self.follow:
            damping *= laws.damping_factor(state.temperature_c)
            clearance += laws.clearance_change_um(self.bearing, state.temperature_c)
        return replace(own, stiffness=stiffness, damping=damping, clearance_um=clearance, load_n=state.load_n)

    def predict(
        self, theta: Array, states: Sequence[MachineState], band: Band, *, slopes: bool = True,
        rolling: Sequence[Array] | None = None, near: Sequence[Prediction | None] | None = None,
    ) -> list[Prediction]:  # fmt: skip
        """Amplitude spectra at theta [4] in these states, all integrated at once, with derivatives if wanted
        (`slopes`).

        `rolling` are PSDs of the rollers [bins] from a point nearby, to be held; where a prediction in `near` is
        `NEAR`, the rollers' part is integrated at `theta` alone and how it turns with stiffness and damping carried
        over. Raises `TwingapError` when the twin cannot be simulated at these parameters.
        """
        # Without slopes the middle alone; with them stiffness and damping are shifted both ways.
        shifts = np.zeros((5 if slopes else 1, 4))
        if slopes:
            shifts[1, 0], shifts[2, 0], shifts[3, 1], shifts[4, 1] = STEP, -STEP, STEP, -STEP
        made = [[self._contact(theta + shift, state) for shift in shifts] for state in states]
        kept = [None if p is None or not p.serves(theta) else p for p in near or [None] * len(states)]
        if rolling is None:
            # What another point lends is not integrated: the middle alone.
            wanted = [own[:1] if p is not None else own for own, p in zip(made, kept, strict=True)]
            passing = self._rolling(wanted, states, band)
        else:
            passing = [[known] for known in rolling]
        out = []
        for own, parts, state, lent in zip(made, passing, states, kept, strict=True):
            noise = self._noise(own, theta, state, band)
            white = 2 * float(np.exp(2 * theta[3])) / band.fs_hz
            amplitude = np.sqrt(parts[0] + noise[0] + white)
            turn, shifted, at = np.zeros((4, amplitude.size)), None, theta[:2]
            if slopes:
                if rolling is None and lent is not None:
                    shifted, at = lent.shifted, lent.shifted_at
                elif rolling is None:
                    shifted = np.array(parts[1:]) - parts[0]
                around = parts[0] if shifted is None else np.maximum(parts[0] + shifted, 0.0)
                root = np.sqrt(around + noise[1:] + white)
                turn[:2] = (root[::2] - root[1::2]) / (2 * STEP)
                turn[2], turn[3] = noise[0] / amplitude, white / amplitude  # d sqrt(P) / d ln a = a^2 part / sqrt(P)
            out.append(Prediction(amplitude, turn, parts[0], theta, shifted, at))
        return out

    def _push(self, mode: Mode, state: MachineState, fs_hz: float) -> float:
        """RMS of the white force's samples for a level of 1: density G^(1/2) on the mass makes an acceleration that
        rings with w G^(1/2); white samples of RMS s have the density s^2 2 / fs. Nothing pushes a machine at
        standstill."""
        if not state.speed_rpm > 0:
            return 0.0
        speed = (state.speed_rpm / REFERENCE_RPM) ** self.laws.speed_power
        return float(2 * math.pi * mode.frequency_hz * speed / math.sqrt(2 * fs_hz))

    def _noise(self, made: Sequence[ContactParameters], theta: Array, state: MachineState, band: Band) -> Array:
        """PSD of the structure noise in the band [points, bins]: |H|^2 of the sampled mode at each point."""
        modes = [ContactTwin(self.bearing, own).contact_mode(state.load_n) for own in made]
        pole = np.exp(np.array([mode.pole for mode in modes])[:, None] / band.fs_hz)
        gain = np.array([mode.gain for mode in modes])[:, None]
        h = gain * pole.imag * band.delay / (1 - 2 * pole.real * band.delay + np.abs(pole) ** 2 * band.delay**2)
        push = float(np.exp(theta[2])) * np.array([self._push(mode, state, band.fs_hz) for mode in modes])[:, None]
        return np.asarray(2 / band.fs_hz * push**2 * np.abs(h) ** 2)

    def _rolling(
        self, made: Sequence[Sequence[ContactParameters]], states: Sequence[MachineState], band: Band
    ) -> list[list[Array]]:
        """PSDs of rollers passing and striking, from trajectories that start at the same angles for all points."""
        count = round(SEGMENTS * band.segment)
        jobs = []
        for own, state in zip(made, states, strict=True):
            if state.fault not in ("healthy", *DEFECTS):
                raise TwingapError(f"no contact model for fault {state.fault!r}", where="live twin")
            condition = Condition("live", state.speed_rpm, band.fs_hz, count, state.fault, state.load_n)
            turns = np.arange(count, dtype=np.float64) * (state.speed_rpm / 60 / band.fs_hz)
            # The golden ratio spreads the starting angles of snapshots without any randomness.
            start = (0.618034 * round(state.time_s)) % 1.0
            jobs += [Job(self.bearing, each, condition, turns, starts=(start, start, start)) for each in own]
        steps = [job.oversampling() for job in jobs]
        if min(steps) < max(steps):
            # Points on both sides of a rung of the ladder would share no group, and differences between them would hold
            # the integrator's error: the finest step serves all.
            jobs = [replace(job, parameters=replace(job.parameters, oversampling=max(steps))) for job in jobs]
        scales = [each.scale for own in made for each in own]
        x = np.array([scale * path[lead:] for scale, (path, lead) in zip(scales, accelerations(jobs), strict=True)])
        psd = welch(x - x.mean(axis=1, keepdims=True), band.fs_hz, nperseg=band.segment, detrend=False)[1]
        rows = iter(psd[:, band.inside])
        return [[next(rows) for _ in own] for own in made]
