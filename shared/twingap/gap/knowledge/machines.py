"""Random machines for training: geometry, structure, operation, and small imperfections that metadata omit.

Parameters are drawn from wider ranges than those of any single test rig, so that models transfer to other machines.

rng --> geometry, rate, speeds, faults --> Machine(conditions, parameters, extra modes, small imperfections)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects import (
    ColouredNoise,
    Draft,
    Effect,
    ImpactScatter,
    LoadZone,
    MeanSlip,
    Mode,
    Quantisation,
    SlipJitter,
    SpeedFluctuation,
    SpeedGain,
)
from twingap.effects.drawing import log_uniform
from twingap.gap.features.impacts.response_sampling import continuous
from twingap.records import Condition
from twingap.streams import Streams
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin


@dataclass(frozen=True)
class Machine:
    """A machine with its true parameters, which records and metadata show only in part."""

    bearing: Bearing
    parameters: PhenomenologicalParameters
    conditions: tuple[Condition, ...]  # with true speeds
    nominal: tuple[Condition, ...]  # with the speeds of the metadata
    # Modes of the structure besides the first. A twin file has none, so such a machine is paired with simulated records
    # of an external simulator.
    modes: tuple[Mode, ...] = ()
    contact_s: float = 0.0  # duration of an impact's contact force, s; 0 is an impulse
    # Relative change of the response at half the sampling rate: sampling of a response differs between laboratories,
    # with an effect near that rate.
    tilt: float = 0.0
    # Sampling of the response: 1 for that of a structure to a force at any time, 0 for samples of its ring-down.
    continuous: float = 0.0
    imperfections: tuple[Effect, ...] = field(default=())  # effects too weak to be named

    def twin(self, effects: Sequence[Effect] = (), scale: float = 1.0) -> StructuredTwin:
        """Simulator of this machine with effects, its samples multiplied by `scale`."""
        names = {effect.name for effect in effects}
        small = tuple(effect for effect in self.imperfections if effect.name not in names)
        own = replace(self.parameters, scale=self.parameters.scale * scale)
        rms = self.healthy_rms * scale
        return self._structured(own, (*small, *effects), rms)

    @cached_property
    def healthy_rms(self) -> float:
        """RMS of the healthy vibration without effects, with all modes and any sampling: the amplitude scale of
        effects."""
        bare = self._structured(self.parameters, (), None)
        healthy = replace(self.conditions[0], fault="healthy", n_samples=1 << 14)
        (record,) = bare.make([healthy], [Streams(0, 0)])
        return float(record.samples.std())

    def _structured(
        self, parameters: PhenomenologicalParameters, effects: Sequence[Effect], rms: float | None
    ) -> StructuredTwin:
        """Twin with this machine's structure; `rms`, of its healthy vibration where known."""
        structure = self.modes, self.contact_s, self.tilt, self.continuous
        return StructuredTwin(self.bearing, parameters, effects, *structure, healthy_rms=rms)


class StructuredTwin(PhenomenologicalTwin):
    """The phenomenological twin with further modes and impacts of finite duration."""

    def __init__(
        self, bearing: Bearing, parameters: PhenomenologicalParameters, effects: Sequence[Effect],
        modes: Sequence[Mode], contact_s: float, tilt: float, continuous: float, healthy_rms: float | None = None,
    ) -> None:  # fmt: skip
        super().__init__(bearing, parameters, effects)
        self._healthy_rms = healthy_rms
        self.modes, self.contact_s, self.tilt, self.continuous = tuple(modes), contact_s, tilt, continuous

    @property
    def reference_rms(self) -> float:
        """RMS of the healthy vibration with all modes; that of the baseline where it is not given."""
        return super().reference_rms if self._healthy_rms is None else self._healthy_rms

    def excite(self, draft: Draft, streams: Streams) -> None:
        """Excitation of the baseline, through all modes."""
        super().excite(draft, streams)
        draft.modes.extend(self.modes)
        if self.tilt:
            draft.filters.append(lambda x: _tilted(x, self.tilt))
        if self.continuous:
            mode = self.parameters.resonance_hz / draft.condition.fs_hz
            draft.filters.append(lambda x: _continuous(x, mode, self.continuous))
        if self.contact_s > 0 and draft.impacts is not None:
            # Two impacts of half the strength, one contact duration apart: the force spectrum decreases as a cosine.
            later = self.contact_s * draft.shaft_hz
            impacts = draft.impacts
            impacts.turns = np.concatenate((impacts.turns, impacts.turns + later))
            impacts.amplitudes = np.tile(impacts.amplitudes / 2, 2)
            impacts.passes = np.tile(impacts.passes, 2)


def _tilted(x: NDArray[np.float64], tilt: float) -> NDArray[np.float64]:
    """x with amplitudes multiplied by 1 + tilt at half the sampling rate and almost unchanged below a fifth of it."""
    spectrum = scipy.fft.rfft(x)
    spectrum *= 1 + tilt * np.linspace(0, 1, spectrum.size) ** 2.5
    return np.asarray(scipy.fft.irfft(spectrum, x.size))


def _continuous(x: NDArray[np.float64], mode: float, part: float) -> NDArray[np.float64]:
    """x, samples of the ring-down of a mode (part of the sampling rate), as the response of a continuous structure."""
    spectrum = scipy.fft.rfft(x)
    spectrum *= np.exp(0.5 * part * continuous(scipy.fft.rfftfreq(x.size), mode))
    return np.asarray(scipy.fft.irfft(spectrum, x.size))


_OF_FASTEST = 2.5
"""Smallest ratio of a structure's mode to the largest impact rate, where the sampling rate allows. A larger value
draws modes in a narrower band."""


def draw_machine(rng: np.random.Generator, own_simulator: bool, most_records: int = 40) -> Machine:
    """A random machine: with `own_simulator` of any structure, else of one that the baseline can represent."""
    bearing = draw_bearing(rng)
    fs_hz = log_uniform(rng, 6000, 52000)
    if rng.random() < 0.7:
        fs_hz = float(rng.choice([8000, 10000, 12000, 12800, 16000, 20000, 24000, 25600, 32000, 48000, 51200]))
    true, nominal = draw_conditions(rng, fs_hz, most_records)
    fastest_hz = max(c.speed_rpm for c in true) / 60 * bearing.bpfi
    # Low modes relative to the sampling rate are common: recorders are fast, structures are heavy.
    first_hz = max(fs_hz * log_uniform(rng, 0.035, 0.42), min(_OF_FASTEST * fastest_hz, 0.3 * fs_hz))
    sharpness = log_uniform(rng, 0.006, 0.12)
    structure = rng.uniform(0.25, 0.97)
    strength = log_uniform(rng, 1.8, 25)

    def unlike() -> float:
        """Random factor of one fault's impacts."""
        return float(np.exp(0.35 * rng.standard_normal()))

    parameters = PhenomenologicalParameters(
        resonance_hz=first_hz,
        damping_ratio=sharpness,
        impact_amplitude={fault: strength * unlike() for fault in ("inner", "outer", "ball")},
        structure_noise_rms=structure,
        white_noise_rms=math.sqrt(1 - structure**2),
        scale=log_uniform(rng, 0.01, 30),
    )
    modes: tuple[Mode, ...] = ()
    contact_s = 0.0
    if own_simulator:
        modes = tuple(
            Mode(fs_hz * rng.uniform(0.03, 0.45), log_uniform(rng, 0.01, 0.12), g)
            for g in np.exp(rng.uniform(np.log(0.15), np.log(1.5), rng.integers(0, 4)))
        )
        contact_s = rng.uniform(0, 0.45) / first_hz if rng.random() < 0.5 else 0.0
    elif rng.random() < 0.3:  # short enough to be modelled as an impulse
        contact_s = rng.uniform(0, 0.1) / first_hz
    tilt = rng.uniform(-0.35, 0.45) if rng.random() < 0.6 else 0.0
    part = rng.uniform(0.0, 1.2) if not own_simulator and rng.random() < 0.5 else 0.0
    return Machine(bearing, parameters, true, nominal, modes, contact_s, tilt, part, _imperfections(rng, fs_hz))


def draw_bearing(rng: np.random.Generator) -> Bearing:
    """A random geometry of a rolling bearing."""
    rollers = int(rng.integers(6, 20))
    ratio = rng.uniform(0.4, 0.95) * math.sin(math.pi / rollers)
    angle = rng.uniform(5, 35) if rng.random() < 0.35 else 0.0
    return Bearing("drawn", rollers, 60 * min(ratio, 0.4), 60.0, angle)


def draw_conditions(
    rng: np.random.Generator, fs_hz: float, most_records: int
) -> tuple[tuple[Condition, ...], tuple[Condition, ...]]:
    """True and nominal conditions of the records of a random machine."""
    count = int(np.clip(np.exp(rng.uniform(np.log(5), np.log(1.6 * most_records))), 5, most_records))
    duration = float(rng.choice([0.3, 0.5, 0.8, 1.0, 1.0, 1.5]))
    n = int(np.clip(duration * fs_hz, 3000, 16000))  # longer records add little information at a proportional cost
    middle = np.exp(rng.uniform(np.log(500), np.log(4200)))
    if rng.random() < 0.25:
        speeds = np.full(count, middle)
    elif rng.random() < 0.6:
        speeds = rng.choice(middle * np.exp(rng.uniform(-0.5, 0.5, rng.integers(2, 6))), count)
    else:
        speeds = middle * np.exp(rng.uniform(-0.4, 0.4, count))
    # At a low speed a record still covers a few revolutions, as it must for a diagnosis.
    speeds = np.clip(speeds, 60 * 6 * fs_hz / n, 60 * 0.012 * fs_hz)
    kinds = ["healthy", "outer", "inner", "ball"]
    if rng.random() < 0.15:
        kinds = ["healthy", str(rng.choice(kinds[1:]))]
    elif rng.random() < 0.17:
        kinds = kinds[1:]
        if rng.random() < 0.6:  # records of the failed bearing only
            kinds = [str(kind) for kind in rng.permutation(kinds)[: rng.integers(1, 3)]]
    elif rng.random() < 0.06:
        kinds = kinds[:1]
    order = [kinds[i % len(kinds)] for i in range(count)]
    run = rng.random() < 0.5
    span = log_uniform(rng, 60, 3e6)
    times = np.linspace(0, span, count) if rng.random() < 0.5 else np.sort(rng.uniform(0, span, count))
    if run:
        order = [order[i] for i in rng.permutation(count)]
    # Nominal speeds deviate by several per cent under load; a reading varies from record to record.
    common = 1 + (0.02 * rng.standard_normal() if rng.random() < 0.45 else 0.0)
    single = log_uniform(rng, 0.001, 0.02) * rng.standard_normal(count) * (rng.random() < 0.45)
    true = tuple(
        Condition(f"r{i}", float(speeds[i]), fs_hz, n, order[i], None, float(times[i]) if run else None)
        for i in range(count)
    )
    wrong = np.clip(common + single, 0.95, 1.05)
    nominal = tuple(replace(c, speed_rpm=c.speed_rpm / float(w)) for c, w in zip(true, wrong, strict=True))
    return true, nominal


def _imperfections(rng: np.random.Generator, fs_hz: float) -> tuple[Effect, ...]:
    """Departures from the baseline that every machine has, each too weak to be named."""
    small = (  # probability and effect; rolling elements are never spaced quite evenly
        (0.3, SlipJitter(sigma=0.002 * rng.random(), accumulating=bool(rng.random() < 0.5))),
        (0.15, ImpactScatter(sigma=0.03 * rng.random())),
        (0.15, LoadZone(depth=0.03 * rng.random())),
        (0.15, SpeedFluctuation(level=0.0003 * rng.random(), bandwidth_hz=2.0)),
        (0.15, MeanSlip(slip=0.0006 * rng.standard_normal())),
        (0.15, Quantisation(step=0.002 * rng.random() + 1e-5)),
        (0.15, ColouredNoise(level=0.03 * rng.random(), slope=1.0, low_hz=10.0, high_hz=fs_hz * 0.5)),
        (0.15, SpeedGain(exponent=0.03 * rng.standard_normal(), reference_speed_rpm=1500.0)),
    )
    return tuple(effect for chance, effect in small if rng.random() < chance)
