"""Parameters of effects outside the catalogue; none is equivalent to a catalogued effect.

sensor_asymmetry   the sensor saturates smoothly on one side: skewed samples, no clipping
echo               a second path with a fixed delay in s for all vibration, independent of the impacts
drifting_resonance natural frequencies vary within a record
gain_jumps         a loose connector: the channel switches between two gains
half_rectified     one half wave is attenuated
swelling_noise     background noise varies at a rate in Hz independent of rotation; impacts do not
squeal             bursts of a friction tone of varying frequency
two_state_impacts  impacts switch between two levels, each held for many passes
whirl              a broad line a little below half order (oil whirl)
amplitude_beat     the amplitude of the channel, noise included, varies at a rate in Hz
crossover          small values are suppressed smoothly (dead zone)
interleave         two interleaved converters of different gain: the spectrum is mirrored

strength, levels, machine --> parameters; applied in excitation, disturbance and recorder
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from twingap.rigs.worlds.base import Base
from twingap.rigs.worlds.case import UNCATALOGUED_STRENGTHS
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.machine_levels import MachineLevels
from twingap.rigs.worlds.strength import Params, Range, Setting


def _two(s: Setting, moderate: Range, strong: Range) -> float:
    return s.uniform(*(moderate, strong)[s.strength])


def _whirl(s: Setting) -> Params:
    order, width = s.uniform(0.41, 0.47), s.uniform(0.3, 0.9)
    # A wider line needs more power for the same height.
    amplitude = s.levels.tone(order * s.shaft_hz, _two(s, (22, 26), (34, 40))) * np.sqrt(1 + 2 * width)
    return {"order": order, "width_hz": width, "amplitude": float(amplitude), "second_ratio": s.uniform(0.1, 0.3)}


def _squeal(s: Setting) -> Params:
    return {
        "amplitude": s.levels.mean_rms * _two(s, (2.0, 3.0), (5.0, 9.0)),
        "frequency_hz": s.base.fs_hz * s.uniform(0.1, 0.36),
        "sweep_fraction": s.uniform(0.08, 0.25),
        "burst_s": s.uniform(0.03, 0.09),
        "bursts_per_s": s.uniform(1.0, 3.0),
    }


DRAWS: Final[Mapping[str, Callable[[Setting], Params]]] = {
    "sensor_asymmetry": lambda s: {"scale": s.levels.mean_rms * _two(s, (1.8, 2.6), (0.5, 0.8))},
    "echo": lambda s: {"delay_s": s.log(6, 60) / s.base.fs_hz, "ratio": _two(s, (0.35, 0.5), (0.7, 0.95))},
    "drifting_resonance": lambda s: {
        # Smaller variations than the mode's half-width would not be detectable.
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
    "crossover": lambda s: {"dead_zone": s.levels.quiet_rms * _two(s, (0.2, 0.35), (0.7, 1.1))},
    "interleave": lambda s: {"mismatch_fraction": _two(s, (0.25, 0.35), (0.6, 0.8))},
}
"""Effect -> draw of its parameters, in internal units."""


def draw_uncatalogued(
    name: str, strength: str, levels: MachineLevels, base: Base, layout: Layout, rng: np.random.Generator
) -> Params:
    """Parameters of one effect outside the catalogue."""
    return DRAWS[name](Setting(UNCATALOGUED_STRENGTHS.index(strength), levels, base, layout, rng))
