"""Broadband excitation by rough races, modulated by rotation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from twingap.effects import measurements
from twingap.effects._fault_effect import AROUND, point_contact_load
from twingap.effects._features import SHAPE
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.angle import cosine
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import log_uniform
from twingap.effects.machine import Machine
from twingap.effects.modes import LEAD, response_rms
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class DistributedRoughness(Effect):
    """A rough or worn race: broadband force that swells with rotation, without any discrete impact.

    Cyclostationary of second order at shaft rate (envelope line), with no first-order line. In every record, healthy or
    not. Needs a path: that of a finished waveform is its response to an impact, where that is known.
    """

    stage: ClassVar[Stage] = Stage.EXCITATION
    references: ClassVar[tuple[str, ...]] = (
        "Antoni & Randall 2003, A stochastic model for simulation and diagnostics of rolling element bearings with "
        "localized faults (extended faults)",
        RANDALL_ANTONI,
    )
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("coloured_noise", "second_resonance", "load_zone")
    deciding_measurement: ClassVar[str] = measurements.LONGER
    features: ClassVar[tuple[str, ...]] = SHAPE
    draw_weight: ClassVar[float] = 1.3

    level: float = parameter(
        0.7, unit="healthy rms", plausible=(0.1, 5.0), log=True,
        doc="rms of the response through the twin's own mode, before what else lies on its path",
    )  # fmt: skip
    depth: float = parameter(
        0.7, unit="", plausible=(0.1, 1.0), allowed=(0, 1), strength=True, doc="half the swing over a turn"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        if draft.excitation == "waveform":
            rough = self._through(draft.force_response(), draft, rng)
            draft.filters.append(lambda x: x + rough[-x.size :])
            return
        force = rng.standard_normal(draft.t.size)
        swell = self._swell(draft.turns + rng.random())
        rms = math.sqrt(1 + self.depth**2 / 2) * response_rms(draft.modes, draft.condition.fs_hz)
        swell *= self.level * draft.reference_rms / rms
        force *= swell
        draft.push(force, rng, abs(float(swell[0])))

    def _through(self, response: Array | None, draft: Draft, rng: np.random.Generator) -> Array:
        """[`LEAD` + samples] What a finished waveform's path makes of the force."""
        assert response is not None  # see `cannot_act_on`
        step = draft.shaft_hz / draft.condition.fs_hz
        before = draft.turns[0] - step * np.arange(LEAD + response.size - 1, 0, -1)
        swell = self._swell(np.concatenate((before, draft.turns)) + rng.random())
        made = fftconvolve(swell * rng.standard_normal(swell.size), response, mode="valid")
        rms = math.sqrt((1 + self.depth**2 / 2) * float(response @ response))
        return np.asarray(self.level * draft.reference_rms / rms * made)

    def _swell(self, turns: Array) -> Array:
        """[samples] Of mean square 1 + depth^2 / 2 over a turn."""
        return 1 + self.depth * cosine(turns)

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation == "waveform" and draft.force_response() is None:
            return "a finished waveform has no path that a force could pass through"
        return None

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float]:
        return {"level": log_uniform(rng, 0.3, 4.0), "depth": rng.uniform(0.25, 1.0)}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        return RoughLoadZone(**self.parameter_values(), extent=rng.uniform(0.3, 0.9))


@dataclass(frozen=True)
class RoughLoadZone(DistributedRoughness):
    """Roughness that excites in the load zone alone.

    Parameters
    ----------
    extent : float
        Loaded part of the diameter (Stribeck's epsilon).
    """

    extent: float = 0.5

    def _swell(self, turns: Array) -> Array:
        load, of_turn = (point_contact_load(at, self.extent) for at in (turns, AROUND))
        swing = (load - of_turn.mean()) / max(float(of_turn.std()), 1e-9)
        return np.asarray(1 + self.depth / math.sqrt(2) * swing)
