"""Effects of my machine."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import Draft, Effect, Stage, parameter, register


@register
@dataclass(frozen=True)
class SoftKnee(Effect):
    """A sensor that compresses large samples."""

    stage: ClassVar[Stage] = Stage.ACQUISITION

    knee: float = parameter(5.0, unit="healthy rms", plausible=(0.5, 20.0), allowed=(0.01, 1e6), log=True, doc="bend")

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        bend = self.knee * draft.reference_rms
        draft.x = bend * np.tanh(draft.x / bend)
