"""One more structural mode on the path."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import SHAPE
from twingap.effects._filtering import fast_length, filtered
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import healthy_density, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.modes import Mode
from twingap.effects.observations import Observations
from twingap.effects.registry import register

Array = NDArray[np.float64]

_DAMPINGS: Final = (0.02, 0.06)
_GAINS: Final = (0.1, 0.4, 1.6)
"""Trial values of a search, all combinations, in phase with the first mode and in opposition. More are slower."""
_APART: Final = 0.2
"""Log ratio of both frequencies below which two modes cannot be distinguished. A larger value draws fewer."""


@register
@dataclass(frozen=True)
class SecondResonance(Effect):
    """A second structural mode: a peak that stays at its frequency whatever the speed.

    Impacts, rollers' contacts and broadband forces pass through both modes in parallel. Where the sensor is not at the
    point of the force, a mode may have the opposite sign: the two then cancel on the other sides of their peaks. A
    finished waveform has passed a path already: its spectrum around the frequency is raised by up to 1 + gain.
    """

    stage: ClassVar[Stage] = Stage.PATH
    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "path"
    look_alikes: ClassVar[tuple[str, ...]] = ("sensor_rolloff", "coloured_noise", "distributed_roughness")
    deciding_measurement: ClassVar[str] = measurements.HAMMER
    features: ClassVar[tuple[str, ...]] = SHAPE
    draw_weight: ClassVar[float] = 1.8

    frequency_hz: float = parameter(
        1600.0, unit="Hz", plausible=(300.0, 20000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency"
    )
    damping_ratio: float = parameter(
        0.04, unit="", plausible=(0.01, 0.2), allowed=(1e-4, 0.99), log=True, doc="damping ratio zeta"
    )
    gain: float = parameter(
        0.6, unit="", plausible=(0.1, 5.0), log=True, strength=True,
        doc="its response to an impact over that of the first mode",
    )  # fmt: skip
    opposed: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), doc="whether it moves the sensor against the first mode"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        gain = -self.gain if self.opposed else self.gain
        if draft.excitation != "waveform":
            draft.modes.append(Mode(self.frequency_hz, self.damping_ratio, gain))
            return
        fs_hz, band = draft.condition.fs_hz, (self.frequency_hz, self.damping_ratio, gain)
        draft.filters.append(lambda x: filtered(x, _raised(fast_length(x.size), fs_hz, *band)))

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist(self.frequency_hz)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        first, fs_hz = machine.parameters.resonance_hz, machine.conditions[0].fs_hz
        second, damping = log_uniform(rng, 0.02, 0.46) * fs_hz, log_uniform(rng, 0.01, 0.15)
        if abs(np.log(second / first)) < _APART:
            return None
        wanted, opposed = 10 ** (rng.uniform(1.0, 14.0) / 10), bool(rng.random() < 0.5)
        for gain in np.geomspace(0.02, 8.0, 72):  # the least that raises the healthy spectrum there by as much
            more = (second, damping, -float(gain) if opposed else float(gain))
            if healthy_density(machine, second, more) > wanted * healthy_density(machine, second):
                return {"frequency_hz": second, "damping_ratio": damping, "gain": float(gain), "opposed": opposed}
        return None

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        for opposed in (False, True):
            for damping in _DAMPINGS:
                for gain in _GAINS:
                    yield dataclasses.replace(self, opposed=opposed, damping_ratio=damping, gain=gain)

    def spectral_values(self, seen: Observations) -> Sequence[Effect]:
        """The second modes that explain the spectra best, in phase and in opposition; either may be the twin's."""
        return [
            self.moved(frequency_hz=place_hz, damping_ratio=damping, gain=abs(gain), opposed=gain < 0)
            for pair in (seen.mode_pairs() if seen.own_mode is not None else ())
            for place_hz, damping, gain in zip(
                pair.frequencies_hz, pair.dampings, (1 / pair.gain, pair.gain), strict=True
            )
        ]


@lru_cache(maxsize=16)
def _raised(n: int, fs_hz: float, centre_hz: float, damping_ratio: float, gain: float) -> Array:
    """1 + gain times a resonance of unit height, at the frequencies of a real transform of n samples."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    band = 2j * damping_ratio * f * centre_hz
    return np.asarray(1 + gain * band / (centre_hz**2 - f**2 + band))
