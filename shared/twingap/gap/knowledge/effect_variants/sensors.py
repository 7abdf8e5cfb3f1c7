"""Mountings, sensors and converters, as machines have them otherwise than the catalogue."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects import Draft, Effect, acquisition, path
from twingap.gap.knowledge.effect_variants.maker import Maker
from twingap.gap.knowledge.machines import Machine

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class SensorRolloff(path.SensorRolloff):
    """As many equal real poles as the order says (glue, cables, wax), 3 dB down at the same corner."""

    def _response(self, n: int, fs_hz: float) -> Array:
        pole_hz = self.corner_hz / math.sqrt(2 ** (1 / self.order) - 1)
        return np.asarray((1 + 1j * scipy.fft.rfftfreq(n, 1 / fs_hz) / pole_hz) ** -self.order)


@dataclass(frozen=True)
class Clipping(acquisition.Clipping):
    """Rails that do not lie alike about zero.

    Parameters
    ----------
    lower : float
        Lower rail over the upper.
    """

    lower: float = 1.0

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """Clips."""
        rail = self.rail * draft.reference_rms
        draft.x = np.clip(draft.x, -self.lower * rail, rail)


@dataclass(frozen=True)
class Quantisation(acquisition.Quantisation):
    """A converter without a zero of its own: samples lie halfway between multiples of its step."""

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """Rounds."""
        step = self.step * draft.reference_rms
        draft.x = (np.floor(draft.x / step) + 0.5) * step


@dataclass(frozen=True)
class Dropout(acquisition.Dropout):
    """Gaps that are filled with zeros."""

    def _filled(self, x: Array, missing: Mask) -> Array:
        return np.where(missing, 0.0, x)


def _real_poles(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return SensorRolloff(**values)


def _aside(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return Clipping(**values, lower=rng.uniform(0.6, 1.5))


def _without_zero(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return Quantisation(**values)


def _zeros(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return Dropout(**values)


OTHERWISE: Final[Mapping[str, Maker]] = {
    "sensor_rolloff": _real_poles, "clipping": _aside, "quantisation": _without_zero, "dropout": _zeros,
}  # fmt: skip
