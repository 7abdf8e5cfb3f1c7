"""Speed of a life test over time: a periodic sequence of steps, and the turns of the shaft.

time since the start [s] --> set speed [rpm] --integral--> turns of the shaft
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError

Array = NDArray[np.float64]
SHAPES: Final = ("sawtooth", "triangle", "constant")


@dataclass(frozen=True)
class SpeedProfile:
    """A periodic stepwise profile.

    Parameters
    ----------
    shape : {"sawtooth", "triangle", "constant"}
        "sawtooth" rises from low to high and drops back at once, "triangle" descends by the same steps, "constant" is
        midway between low and high.
    low_rpm, high_rpm, step_rpm : float
    hold_s : float
        Duration of each step, s.
    """

    shape: str = "sawtooth"
    low_rpm: float = 1000.0
    high_rpm: float = 2000.0
    step_rpm: float = 100.0
    hold_s: float = 60.0

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise TwingapError(
                f"unknown shape {self.shape!r}", where="speed profile", mend=f"use one of {', '.join(SHAPES)}"
            )

    @property
    def steps_rpm(self) -> Array:
        """The speeds of one period [steps], in order."""
        if self.shape == "constant":
            return np.array([(self.low_rpm + self.high_rpm) / 2])
        rising = np.arange(self.low_rpm, self.high_rpm + self.step_rpm / 2, self.step_rpm)
        return np.concatenate([rising, rising[-2:0:-1]]) if self.shape == "triangle" else rising

    def speed_rpm(self, time_s: ArrayLike) -> Array:
        """Set speed at times [...], s since the start, at least 0; at a change, the new speed."""
        steps = self.steps_rpm
        # Rounded to milliseconds, so that a time computed as 7560.0000001 - 1e-7 belongs to the step that begins there.
        elapsed_ms = np.round(np.asarray(time_s, float) * 1e3).astype(np.int64)
        return np.asarray(steps[elapsed_ms // round(self.hold_s * 1e3) % steps.size])

    def turns(self, time_s: ArrayLike) -> Array:
        """Turns of the shaft since the start, at times [...], s."""
        time = np.asarray(time_s, float)
        edges = np.arange(int(np.max(time, initial=0.0) // self.hold_s) + 2) * self.hold_s
        turned = np.concatenate([[0.0], np.cumsum(self.speed_rpm(edges[:-1]) / 60 * self.hold_s)])
        return np.asarray(np.interp(time, edges, turned))
