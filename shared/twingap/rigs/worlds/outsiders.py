"""Effects that the catalogue does not know, and that are not equivalent to one it knows: their parameters.

sensor_asymmetry   the sensor softens on one side: skewed, no rails
echo               a second path, fixed delay in s for all that vibrates (not tied to the strikes)
drifting_resonance natural frequencies swing within a record
gain_jumps         a loose connector: the whole channel switches between two gains
half_rectified     one half wave passes weakened
swelling_noise     background swells at a rate in Hz tied to no rotation; strikes stay as they are
squeal             bursts of friction tone that sweep
two_state_impacts  strikes switch between two levels, each held for many passes
whirl              a broad line a little below half order (oil whirl)
amplitude_beat     the whole channel, noise included, beats at a rate in Hz
crossover          small values vanish smoothly (dead zone)
interleave         two converters of different gain take turns: the spectrum is mirrored

strength, yardstick, machine --> parameters; applied in excitation, disturbance and recorder
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from twingap.rigs.worlds.base import Base
from twingap.rigs.worlds.case import OUTSIDER_STRENGTHS
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.strength import Params, Range, Setting
from twingap.rigs.worlds.yardstick import Yardstick


def _two(s: Setting, moderate: Range, strong: Range) -> float:
    return s.uniform(*(moderate, strong)[s.strength])


def _whirl(s: Setting) -> Params:
    order, width = s.uniform(0.41, 0.47), s.uniform(0.3, 0.9)
    # A line of some width needs more power to stand as high.
    amplitude = s.yard.tone(order * s.shaft_hz, _two(s, (22, 26), (34, 40))) * np.sqrt(1 + 2 * width)
    return {"order": order, "width_hz": width, "amplitude": float(amplitude), "second_ratio": s.uniform(0.1, 0.3)}


def _squeal(s: Setting) -> Params:
    return {
        "amplitude": s.yard.mean_rms * _two(s, (2.0, 3.0), (5.0, 9.0)),
        "frequency_hz": s.base.fs_hz * s.uniform(0.1, 0.36),
        "sweep_fraction": s.uniform(0.08, 0.25),
        "burst_s": s.uniform(0.03, 0.09),
        "bursts_per_s": s.uniform(1.0, 3.0),
    }


DRAWS: Final[Mapping[str, Callable[[Setting], Params]]] = {
    "sensor_asymmetry": lambda s: {"scale": s.yard.mean_rms * _two(s, (1.8, 2.6), (0.5, 0.8))},
    "echo": lambda s: {"delay_s": s.log(6, 60) / s.base.fs_hz, "ratio": _two(s, (0.35, 0.5), (0.7, 0.95))},
    "drifting_resonance": lambda s: {
        # Beyond the mode's own half-width, which would hide it.
        "swing_fraction": s.base.modes[0].damping_ratio + _two(s, (0.04, 0.07), (0.1, 0.16)),
        "rate_hz": s.log(0.5, 3.0),
    },
    "gain_jumps": lambda s: {"low_fraction": _two(s, (0.5, 0.65), (0.15, 0.3)), "rate_per_s": s.log(1.5, 8.0)},
    "half_rectified": lambda s: {"passed_fraction": _two(s, (0.5, 0.65), (0.1, 0.25))},
    "swelling_noise": lambda s: {"depth_fraction": _two(s, (0.5, 0.65), (0.9, 1.0)), "rate_hz": s.log(1.7, 40.0)},
    "squeal": _squeal,
    "two_state_impacts": lambda s: {"low_fraction": _two(s, (0.35, 0.5), (0.05, 0.15)), "rate_per_s": s.log(3.0, 9.0)},
    "whirl": _whirl,
    "amplitude_beat": lambda s: {"depth_fraction": _two(s, (0.3, 0.4), (0.7, 0.9)), "rate_hz": s.log(1.7, 14.0)},
    "crossover": lambda s: {"dead_zone": s.yard.quiet_rms * _two(s, (0.2, 0.35), (0.7, 1.1))},
    "interleave": lambda s: {"mismatch_fraction": _two(s, (0.25, 0.35), (0.6, 0.8))},
}
"""Outsider -> draw of its parameters, in internal units."""


def draw_outsider(
    name: str, strength: str, yard: Yardstick, base: Base, layout: Layout, rng: np.random.Generator
) -> Params:
    """Parameters of one outsider."""
    return DRAWS[name](Setting(OUTSIDER_STRENGTHS.index(strength), yard, base, layout, rng))
