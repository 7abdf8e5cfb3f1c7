"""Tones, noise and strikes from elsewhere, as machines have them otherwise than the catalogue."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.effects import Draft, Effect, disturbance
from twingap.effects.angle import cosine
from twingap.gap.knowledge.effect_variants.maker import Maker
from twingap.gap.knowledge.machines import Machine

Array = NDArray[np.float64]

_UNEVEN: Final = 0.7
"""Standard deviation of the logarithm of what harmonics are off a geometric row by."""
_HUM: Final = 0.5
"""Part of the uneven hums that are of rectifiers and transformers: twice the mains frequency and its multiples."""
_FACTORS: Final = 64


@dataclass(frozen=True)
class _Uneven(Effect):
    """Harmonics in no geometric row: each has its own factor. Forces of what turns may grow with speed.

    Parameters
    ----------
    factors : tuple of float
    rise : float
        Power of the speed that all follow: 2 for an unbalance.
    reference_rpm : float
        Speed at which they are as the values say.
    """

    factors: tuple[float, ...] = (1.0,)
    rise: float = 0.0
    reference_rpm: float = 1800.0

    @property
    def levels(self) -> Array:
        """[harmonics] Amplitude of each, healthy rms."""
        own: Array = super().levels  # type: ignore[misc]  # of the effect that stands behind this class
        return np.asarray(own * np.resize(np.array(self.factors), own.size))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """As the effect that stands behind this class, times the gain of this speed."""
        before, draft.x = draft.x, np.zeros_like(draft.x)
        super().apply(draft, rng)  # type: ignore[safe-super]
        draft.x = before + (draft.condition.speed_rpm / self.reference_rpm) ** self.rise * draft.x


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


@dataclass(frozen=True)
class ShaftHarmonics(_Uneven, disturbance.ShaftHarmonics):
    """Forces of unbalance and misalignment, which grow with speed."""


_TONES: Final[Mapping[str, type[Any]]] = {
    "mains_interference": MainsInterference, "gear_mesh": GearMesh, "waviness": Waviness, "looseness": Looseness,
    "shaft_harmonics": ShaftHarmonics,
}  # fmt: skip


@dataclass(frozen=True)
class DriveInterference(disturbance.DriveInterference):
    """A carrier whose phase swings, or with two pairs of side lines, rather than one that swells as a cosine.

    Parameters
    ----------
    second : float
        Side lines of the second pair over those of the first; 0 is a carrier whose phase swings.
    """

    second: float = 0.0

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """Adds it."""
        carrier, side = self.carrier_hz * draft.t + rng.random(), self.sideband_order * draft.turns + rng.random()
        if self.second:
            wave = cosine(carrier) * (1 + self.depth * (cosine(side) + self.second * cosine(2 * side + rng.random())))
        else:
            wave = cosine(carrier + self.depth / (2 * np.pi) * cosine(side))
        draft.x += self.level * draft.reference_rms * wave


@dataclass(frozen=True)
class ForeignBearing(disturbance.ForeignBearing):
    """A neighbour whose rollers slip and pass through its own load zone.

    Parameters
    ----------
    jitter : float
        Of strikes about their places, spacings.
    depth : float
        Half the swing of strengths over a turn of the shaft.
    """

    jitter: float = 0.0
    depth: float = 0.0

    def _strikes(self, turns: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        strengths = 1 + self.depth * cosine(turns + rng.random())
        return turns + self.jitter / self.order * rng.standard_normal(turns.size), strengths


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
class ImpulsiveNoise(disturbance.ImpulsiveNoise):
    """Knocks that have a part of their strength in common, or all from one side.

    Parameters
    ----------
    even : float
        Part of the strength that all have.
    one_sided : bool
    """

    even: float = 0.0
    one_sided: bool = False

    def _strengths(self, count: int, rng: np.random.Generator) -> Array:
        own = super()._strengths(count, rng)
        sides = np.ones(count) if self.one_sided else np.sign(own)
        return np.asarray((self.even + (1 - self.even) * np.abs(own)) * sides)


def _uneven(name: str) -> Maker:
    def make(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
        factors = np.exp(_UNEVEN * rng.standard_normal(_FACTORS))
        more: dict[str, float] = {}
        if name == "mains_interference":
            if rng.random() < _HUM:
                factors[0::2] *= 0.03
                factors[1] = max(factors[1], 1.0)
                values = {**values, "n_harmonics": max(int(values["n_harmonics"]), 2)}
        elif rng.random() < 0.5:
            middle = float(np.median([c.speed_rpm for c in machine.conditions]))
            more = {"rise": rng.uniform(0.5, 2.0), "reference_rpm": middle}
        return _TONES[name](**values, factors=tuple(factors.tolist()), **more)  # type: ignore[no-any-return]

    return make


def _drive(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    second = 0.0 if rng.random() < 0.5 or values["depth"] > 1.2 else rng.uniform(0.2, 0.7)
    return DriveInterference(**values, second=second)


def _neighbour(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return ForeignBearing(**values, jitter=0.02 * rng.random(), depth=rng.uniform(0, 0.8))


def _poles(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect | None:
    return ColouredNoise(**values) if values["slope"] >= 0.6 else None


def _knocks(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return ImpulsiveNoise(**values, even=rng.uniform(0.2, 0.9), one_sided=bool(rng.random() < 0.4))


OTHERWISE: Final[Mapping[str, Maker]] = {
    **{name: _uneven(name) for name in _TONES},
    "drive_interference": _drive, "foreign_bearing": _neighbour, "coloured_noise": _poles, "impulsive_noise": _knocks,
}  # fmt: skip
