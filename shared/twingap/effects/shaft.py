"""Effects on the shaft angle: how shaft and cage turn within a record."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.registry import register

Array = NDArray[np.float64]


@register
@dataclass(frozen=True)
class SpeedFluctuation(Effect):
    """The shaft's speed varies within a record; its mean over the record stays `speed_rpm`.

    The relative speed is a smooth random process: twelve cosines of random frequency below `bandwidth_hz` and random
    phase. All that follows the angle smears in the spectrum, more at higher orders, and stands sharp again after order
    tracking. Acts on impacts and rollers through the angle; a finished waveform is resampled over the angle, by which
    its resonances move a little too (by the speed's own per cent). `level` is the process's: about its own mean a short
    record varies less, since its slow waves do not turn in it (0.7 of `level` in half a second at 2 Hz).
    """

    stage: ClassVar[Stage] = Stage.SHAFT
    references: ClassVar[tuple[str, ...]] = (
        "Randall & Antoni 2011, Rolling element bearing diagnostics - a tutorial, doi:10.1016/j.ymssp.2010.07.017",
    )
    level: float = parameter(
        0.01, unit="", plausible=(0.001, 0.05), allowed=(0, 0.3), log=True, doc="rms of the relative speed variation"
    )
    bandwidth_hz: float = parameter(
        2.0, unit="Hz", plausible=(0.5, 10.0), allowed=(0.01, 1000.0), log=True, doc="fastest variation of the speed"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        n, wander = draft.t.size, self._wander(rng)
        if n < 2:
            return
        # Sixteen knots per fastest cycle are as good as every sample, and far fewer.
        span = draft.t[-1] - draft.t[0]
        knots = np.linspace(0.0, span, min(n, 2 + math.ceil(16 * self.bandwidth_hz * span)))
        # Three sigma bound the speed away from standstill at the largest level allowed.
        relative = np.interp(draft.t, knots, 1 + self.level * np.clip(wander(knots), -3, 3))
        travelled = np.concatenate(([0.0], np.cumsum(0.5 * (relative[1:] + relative[:-1]))))
        draft.turns = draft.turns[0] + travelled * ((draft.turns[-1] - draft.turns[0]) / travelled[-1])

    def _wander(self, rng: np.random.Generator) -> Callable[[Array], Array]:
        """How far the speed departs from its mean over time, s; of variance 1."""
        count = 12
        frequencies = self.bandwidth_hz * rng.uniform(0.05, 1.0, count)
        phases = 2 * np.pi * rng.random(count)

        def over(t: Array) -> Array:
            waves = np.cos(2 * np.pi * frequencies[:, None] * t + phases[:, None])
            return np.asarray(np.sqrt(2 / count) * waves.sum(axis=0))

        return over


@register
@dataclass(frozen=True)
class MeanSlip(Effect):
    """The cage runs slower (or, from a changed contact angle, faster) than its kinematic speed.

    BPFO moves one way and BPFI the other, their sum stays Z; see `Bearing.slipped`. Lines stay sharp. What a roller's
    spin does is not settled by the cage: it may keep rolling on the inner ring, roll on the outer one, or slide.
    """

    stage: ClassVar[Stage] = Stage.SHAFT
    references: ClassVar[tuple[str, ...]] = (
        "Randall & Antoni 2011, Rolling element bearing diagnostics - a tutorial, doi:10.1016/j.ymssp.2010.07.017",
    )
    slip: float = parameter(
        0.01,
        unit="",
        plausible=(-0.03, 0.03),
        allowed=(-0.2, 0.2),
        doc="part by which the cage lags its kinematic speed",
    )
    of_rollers: float = parameter(
        1.0,
        unit="",
        plausible=(-1.5, 1.0),
        allowed=(-3.0, 3.0),
        doc="part of the slip by which a roller's spin moves; 1 rolls on the inner ring, as all contact dynamics do",
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.cage_speed_ratio *= 1 - self.slip
        # Contact dynamics settle a roller's spin themselves.
        draft.spin_share = 1.0 if draft.excitation == "rollers" else self.of_rollers

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation == "waveform":
            return "a finished waveform no longer tells what turns with the cage from what turns with the shaft"
        return None
