"""Base of effects on the impacts of a defect: healthy records, passes of rollers, simulators without impacts.

On impacts (phenomenological twin) they change angles and amplitudes. On rollers (contact twin) and on a finished
waveform there is no list of impacts: timing becomes a delay of roller train or waveform, strength a gain on the latter.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects.angle import cosine
from twingap.effects.background import passes_of
from twingap.effects.base import Effect, Stage
from twingap.effects.draft import Draft, Impacts

Array = NDArray[np.float64]


class FaultEffect(Effect):
    """Base of effects that act on the impacts of a defect and leave healthy records unchanged."""

    stage: ClassVar[Stage] = Stage.EXCITATION

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        if draft.impacts is not None:
            self.on_impacts(draft, draft.impacts, rng)
        elif draft.faulty:
            self.on_waveform(draft, rng)

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        """Change the impacts."""

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        """Change delay and gain of rollers or of a finished waveform with a defect in it."""

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.condition.fault is None:
            return f"the fault of record {draft.condition.name!r} is unknown, so the times of its impacts are unknown"
        return None


def by_pass(impacts: Impacts) -> tuple[NDArray[np.int64], int]:
    """Index of each impact's pass, and the number of passes: impacts of one pass share their random numbers."""
    if impacts.passes.size == 0:
        return impacts.passes, 0
    places = impacts.passes - impacts.passes.min()
    return places, int(places.max()) + 1


def passes_within(draft: Draft, rng: np.random.Generator) -> tuple[Array, bool]:
    """Angles of the roller passes in and around a finished waveform, and whether they were measured on its impacts.

    Where the impacts do not stand out, passes have the stated rate and a random phase.
    """
    found = passes_of(draft.x, draft.turns * draft.fault_order) if draft.background is not None else None
    rate, begin = found or (1.0, -rng.random())
    order = rate * draft.fault_order
    return (np.arange(-2, math.ceil(draft.turns[-1] * order) + 2) + begin) / order, found is not None


AROUND = np.arange(720) / 720
"""Angles over one turn, turns."""


def point_contact_load(turns: Array, extent: float) -> Array:
    """Load over the angle (Stribeck's distribution with Hertz's exponent for point contacts); its maximum is 1."""
    return np.asarray(np.maximum(1 - (1 - cosine(turns)) / (2 * extent), 0.0) ** 1.5)
