"""A converter that repeats samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import measurements
from twingap.effects._references import IEEE_1057
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.registry import register


@register
@dataclass(frozen=True)
class SampleHold(Effect):
    """A converter, or its driver, that delivers each sample several times: runs of equal samples."""

    stage: ClassVar[Stage] = Stage.ACQUISITION
    references: ClassVar[tuple[str, ...]] = (IEEE_1057,)
    group: ClassVar[str] = "acquisition"
    look_alikes: ClassVar[tuple[str, ...]] = ("dropout", "quantisation", "sensor_rolloff")
    deciding_measurement: ClassVar[str] = measurements.CHAIN
    trained: ClassVar[bool] = False

    repeats: int = parameter(
        2, unit="samples", plausible=(2, 8), allowed=(1, 1000), exact=True, doc="how often each sample is delivered"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        begin = int(rng.integers(self.repeats))
        places = np.arange(draft.x.size)
        draft.x = draft.x[np.maximum((places + begin) // self.repeats * self.repeats - begin, 0)]
