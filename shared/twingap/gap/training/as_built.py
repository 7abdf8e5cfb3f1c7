"""Effects as a machine has them: nature is not bound to how the catalogue makes one.

effect of the catalogue --at random--> the same effect, made otherwise, at the same values

What is learnt from machines that have effects exactly as the twin would add them fails on machines that do not. Every
class here bears the name of what it stands for, since effects are known by the names of their classes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.effects import Draft, Effect, disturbance, excitation
from twingap.gap.training.machines import Machine

Array = NDArray[np.float64]

CHANCE: Final = 0.4
"""Part of the machines that have an effect otherwise than the catalogue makes it."""
_UNEVEN: Final = 0.7
"""Standard deviation of the logarithm of what harmonics are off a geometric row by."""
_HUM: Final = 0.5
"""Part of the uneven hums that are of rectifiers and transformers: twice the mains frequency and its multiples."""
_FACTORS: Final = 64


@dataclass(frozen=True)
class EntryExit(excitation.EntryExit):
    """Defects that take as much of a pass on a roller as on a race.

    Parameters
    ----------
    pass_part : float
        Length of every defect as a part of one roller's pass; 0 is `arc_deg` for all.
    """

    pass_part: float = 0.0

    def delay_turns(self, draft: Draft) -> float:
        """Shaft turns between entering and leaving."""
        return self.pass_part / draft.fault_order if self.pass_part else super().delay_turns(draft)


@dataclass(frozen=True)
class ColouredNoise(disturbance.ColouredNoise):
    """Noise that has passed a low-pass of one or two poles: flat, then falling, in no power law."""

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """White noise through as many poles as the slope is nearest to, its corner near where the band begins."""
        poles = 1 if self.slope < 1.5 else 2
        b, a = signal.butter(poles, min(4 * self.low_hz, 0.4 * draft.condition.fs_hz), fs=draft.condition.fs_hz)
        begin = math.ceil(draft.condition.fs_hz / self.low_hz)
        noise = signal.lfilter(b, a, rng.standard_normal(begin + draft.x.size))[begin:]
        draft.x += self.level * draft.reference_rms * noise / max(float(noise.std()), 1e-300)


@dataclass(frozen=True)
class _Uneven(Effect):
    """Harmonics in no geometric row: each has its own factor."""

    factors: tuple[float, ...] = (1.0,)

    @property
    def levels(self) -> Array:
        """[harmonics] Amplitude of each, healthy rms."""
        own: Array = super().levels  # type: ignore[misc]  # of the effect that stands behind this class
        return np.asarray(own * np.resize(np.array(self.factors), own.size))


@dataclass(frozen=True)
class MainsInterference(_Uneven, disturbance.MainsInterference):
    """Hum whose harmonics are what the supply makes them."""


@dataclass(frozen=True)
class GearMesh(_Uneven, disturbance.GearMesh):
    """A mesh whose harmonics are what its teeth make them."""


@dataclass(frozen=True)
class Waviness(_Uneven, disturbance.Waviness):
    """Races whose waves are what grinding made them."""


@dataclass(frozen=True)
class Looseness(_Uneven, disturbance.Looseness):
    """Half orders that resonances on their way raise and lower."""


_TONES: Final[Mapping[str, type[Any]]] = {
    "mains_interference": MainsInterference, "gear_mesh": GearMesh, "waviness": Waviness, "looseness": Looseness,
}  # fmt: skip


_OTHERWISE: Final = (*_TONES, "coloured_noise", "entry_exit")


def as_built(effect: Effect, machine: Machine, rng: np.random.Generator) -> Effect:
    """The effect as one machine has it.

    Parameters
    ----------
    effect : Effect
        Of the catalogue.
    machine : Machine
    rng : numpy.random.Generator
    """
    if effect.name not in _OTHERWISE or rng.random() >= CHANCE:
        return effect
    values: dict[str, Any] = {f.name: getattr(effect, f.name) for f in dataclasses.fields(effect)}  # type: ignore[arg-type]
    if isinstance(effect, excitation.EntryExit):
        # Of one length in degrees a ball's is short beside a race's: what is alike is rather how long passes take.
        part = effect.arc_deg * machine.bearing.n_rollers / 360
        return EntryExit(**values, pass_part=part if part < 0.5 else 0.0)
    if isinstance(effect, disturbance.ColouredNoise):
        return ColouredNoise(**values) if effect.slope >= 0.6 else effect
    factors = np.exp(_UNEVEN * rng.standard_normal(_FACTORS))
    if effect.name == "mains_interference" and rng.random() < _HUM:
        factors[0::2] *= 0.03
        factors[1] = max(factors[1], 1.0)
        values["n_harmonics"] = max(int(values["n_harmonics"]), 2)
    return _TONES[effect.name](**values, factors=tuple(factors.tolist()))  # type: ignore[no-any-return]
