"""Parameters of catalogued effects for a given strength on a given machine.

strength, levels, machine, layout --> parameters in physical units

weak: just detectable by a careful analyst with all 24 records; medium: clear; strong: obvious. The strength of tones is
the height of their lines over the noise of one record; that of effects on impacts is a depth, larger where impacts are
faint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from twingap.rigs.worlds.base import Base, Mode, detectable_ratio, response_power
from twingap.rigs.worlds.case import ENTRY_EXIT, STRENGTHS
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.machine_levels import MachineLevels
from twingap.rigs.worlds.motion import fault_order

Params = dict[str, Any]
Range = tuple[float, float]

_SUPPRESSED: Final = 1 / 3
"""Part of the drives whose carrier has no line."""


@dataclass(frozen=True)
class Setting:
    """Input of the draws of parameters.

    Parameters
    ----------
    strength : int
        0 weak, 1 medium, 2 strong.
    levels : MachineLevels
    base : Base
    layout : Layout
    rng : numpy.random.Generator
        Random generator of this effect.
    """

    strength: int
    levels: MachineLevels
    base: Base
    layout: Layout
    rng: np.random.Generator

    def pick(self, weak: Range, medium: Range, strong: Range) -> float:
        """Log-uniform draw from the range of the strength."""
        low, high = np.log((weak, medium, strong)[self.strength])
        return float(np.exp(self.rng.uniform(low, high)))

    def log(self, low: float, high: float) -> float:
        """Log-uniform draw."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def uniform(self, low: float, high: float) -> float:
        """Uniform draw."""
        return float(self.rng.uniform(low, high))

    def coin(self, chance: float) -> bool:
        """True with this probability."""
        return bool(self.rng.random() < chance)

    @property
    def deeper(self) -> float:
        """Factor on the depth of weak and medium effects on impacts, larger where impacts are faint."""
        return 1.0 if self.strength == 2 else float(np.clip(self.levels.faintest**-0.5, 1.0, 1.8))

    def line_db(self) -> float:
        """Height of a tonal effect's strongest line over the noise of one record, dB."""
        return self.pick((5.0, 8.0), (17.0, 22.0), (32.0, 40.0))

    def raised(self) -> float:
        """Added power spectral density relative to that without the effect."""
        return float(10 ** (self.pick((1.2, 2.0), (4.5, 7.0), (11.0, 16.0)) / 10) - 1)

    @property
    def shaft_hz(self) -> float:
        """Mean shaft speed, Hz."""
        return self.layout.mean_rpm / 60


def _speed_fluctuation(s: Setting) -> Params:
    # Width of the fourth ball-pass harmonic in lines of one record.
    smear = s.pick((1.5, 2.5), (5.0, 9.0), (15.0, 28.0))
    fourth_hz = 4 * s.layout.bearing.bpfo * s.shaft_hz
    rms = float(np.clip(smear / fourth_hz / s.levels.duration_s, 5e-4, 0.05))
    return {"rms_fraction": rms, "rate_hz": s.log(0.7, 4.0), "swing_share": s.uniform(0.1, 0.9)}


def _mean_slip(s: Setting) -> Params:
    change = s.pick((0.006, 0.01), (0.013, 0.022), (0.03, 0.05))
    return {"cage_speed_change": -change if s.coin(0.7) else change}


def _slip_jitter(s: Setting) -> Params:
    if s.coin(0.5):
        return {"std_fraction": s.pick((0.004, 0.007), (0.011, 0.018), (0.028, 0.045)), "accumulates": True}
    return {"std_fraction": s.pick((0.010, 0.016), (0.025, 0.04), (0.06, 0.1)), "accumulates": False}


def _impact_scatter(s: Setting) -> Params:
    spread = s.deeper * s.pick((0.15, 0.22), (0.38, 0.55), (0.9, 1.3))
    return {"std_fraction": spread, "shape": "lognormal" if s.coin(0.6) else "gamma"}


def _load_zone(s: Setting) -> Params:
    depth = min(1.0, s.deeper * s.pick((0.16, 0.25), (0.45, 0.6), (0.85, 1.0)))
    return {"depth_fraction": depth, "extent_fraction": s.uniform(0.3, 0.85)}


def _cage_modulation(s: Setting) -> Params:
    depth = min(1.0, s.deeper * s.pick((0.12, 0.18), (0.3, 0.42), (0.65, 0.95)))
    second = s.uniform(0.1, 0.5) if s.coin(0.5) else 0.0
    return {"depth_fraction": depth, "second_share": second, "second_phase_rad": s.uniform(0, 2 * np.pi)}


def _two_impacts(s: Setting) -> Params:
    # The spectrum has notches 1/delay apart; some must be below the resonance at every speed.
    rate = max(fault_order(s.layout.bearing, f, 1.0) for f in s.layout.faults or ("outer",))
    least = 2.5 / s.base.modes[0].frequency_hz * rate * max(s.layout.speed_rpm) / 60
    delay = s.uniform(min(max(least, 0.06), 0.3), 0.38)
    ratio = min(1.0, s.deeper * s.pick((0.15, 0.22), (0.4, 0.55), (0.8, 1.0)))
    bearing = s.layout.bearing
    race_mm = bearing.pitch_diameter_mm + bearing.roller_diameter_mm * np.cos(np.radians(bearing.contact_angle_deg))
    return {
        "delay_fraction": delay,
        "entry_ratio": -ratio if s.coin(0.35) else ratio,
        "entry_length_ratio": s.uniform(1.0, 2.0),
        "outer_race_length_mm": float(delay * np.pi * race_mm / bearing.n_rollers),
    }


def _distributed_roughness(s: Setting) -> Params:
    first = s.base.modes[0].frequency_hz
    beside = 2 * s.base.white_rms**2 / s.base.fs_hz
    there = s.levels.at(first)
    share = s.pick((0.3, 0.45), (0.8, 1.3), (3.0, 6.0))
    through = max(there - beside, 0.1 * there)  # part of the peak that is due to the noise force
    return {
        "rms_over_structure": float(np.sqrt(share * there / through)),
        "depth_fraction": s.uniform(0.6, 1.0),
        "second_share": s.uniform(0.0, 0.4),
        "correlation_s": 0.0,
    }


def _speed_gain(s: Setting) -> Params:
    span = np.log10(max(s.layout.speed_rpm) / min(s.layout.speed_rpm))
    change_db = s.pick((2.2, 3.2), (5.0, 7.0), (10.0, 14.0))
    exponent = float(min(change_db / 20 / max(span, 0.05), 4.5))
    return {"exponent": -exponent if s.coin(0.2) else exponent, "reference_rpm": s.layout.mean_rpm}


def _damage_growth(s: Setting) -> Params:
    return {"growth_db": s.pick((2.5, 3.5), (6.0, 8.5), (13.0, 19.0)), "shape_exponent": s.log(0.7, 2.5)}


def _second_resonance(s: Setting) -> Params:
    fs, modes = s.base.fs_hz, s.base.modes
    damping = s.log(0.012, 0.06)
    while True:
        hz = fs * s.log(0.05, 0.43)
        # Separate from every other mode, by a fraction of its frequency and by both half-widths.
        if all(abs(hz - m.frequency_hz) > max(0.2 * m.frequency_hz, 2 * m.damping_ratio * m.frequency_hz)
               + 2 * damping * hz for m in modes):  # fmt: skip
            break
    sign = -1.0 if s.coin(0.5) else 1.0
    near = hz * (1 + damping * np.linspace(-0.5, 0.5, 9))
    white = 2 * s.base.white_rms**2 / fs
    there = s.levels.at(hz)
    raised = 1 + s.raised()
    before = response_power(modes, s.base.hertz, fs, near)
    # Power of the force, from the response of the first mode: mean over the mode's width.
    first = modes[0]
    wide = first.frequency_hz * (1 + first.damping_ratio * np.linspace(-1, 1, 15))
    seen = np.mean([s.levels.at(f) for f in wide]) - white
    drive = max(float(seen), 1e-12) / float(response_power(modes, s.base.hertz, fs, wide).mean())

    def level(gain: float) -> float:
        after = response_power((*modes, Mode(hz, damping, sign * gain)), s.base.hertz, fs, near)
        return float(1 + drive * np.mean(after - before) / there)

    low, high = 1e-4, 1e3  # out of phase with a strong first mode, the level may fall before it rises
    while high / low > 1.001:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if level(middle) < raised else (low, middle)
    return {"frequency_hz": hz, "damping_ratio": damping, "gain": sign * high}


def _sensor_rolloff(s: Setting) -> Params:
    fs, poles = s.base.fs_hz, 2 if s.coin(0.4) else 1
    loss = s.pick((1.5, 2.3), (4.5, 7.0), (11.0, 18.0))
    # Butterworth through the bilinear transform: (tan(pi f/fs) / tan(pi fc/fs))^(2 poles) = 10^(loss/10) - 1.
    corner = fs / np.pi * np.arctan(np.tan(0.35 * np.pi) / (10 ** (loss / 10) - 1) ** (0.5 / poles))
    return {"corner_hz": float(corner), "poles": poles, "loss_db_at_0.35_fs": loss}


def _falling(s: Setting, hz: list[float], snr_db: float, first_is_strongest: bool) -> list[float]:
    """Amplitudes of lines at these frequencies, the strongest at `snr_db`, others up to 12 dB below."""
    below = s.rng.uniform(2.0, 12.0, len(hz))
    below[0 if first_is_strongest else int(s.rng.integers(0, len(hz)))] = 0.0
    return [s.levels.tone(f, snr_db - b) for f, b in zip(hz, below, strict=True)]


def _shaft_harmonics(s: Setting) -> Params:
    return {"amplitudes": _falling(s, [s.shaft_hz * k for k in (1, 2, 3)], s.line_db(), s.coin(0.6))}


def _looseness(s: Setting) -> Params:
    count, snr_db = 2 * int(s.rng.integers(3, 7)), s.line_db()
    amplitudes = _falling(s, [s.shaft_hz * 0.5 * (k + 1) for k in range(count)], snr_db, False)
    # Detectability depends on the strongest half order.
    half = int(2 * s.rng.integers(0, 3))
    amplitudes[half] = s.levels.tone(s.shaft_hz * 0.5 * (half + 1), snr_db)
    return {"amplitudes": amplitudes}


def _mains_interference(s: Setting) -> Params:
    mains = (50.0 if s.coin(0.5) else 60.0) * (1 + s.uniform(-3e-4, 3e-4))
    harmonics = ((1, 2, 3), (1, 3, 5), (1, 2, 3, 4, 5), (2, 4, 6), (1,))[int(s.rng.integers(0, 5))]
    amplitudes = _falling(s, [mains * k for k in harmonics], s.line_db(), s.coin(0.6))
    return {"mains_hz": mains, "harmonics": list(harmonics), "amplitudes": amplitudes}


def _drive_interference(s: Setting) -> Params:
    carrier = s.log(0.1, 0.38) * s.base.fs_hz
    sides = [s.uniform(0.4, 1.0)] + ([s.uniform(0.15, 0.4)] if s.coin(0.6) else [])
    amplitude = s.levels.tone(carrier, s.line_db()) / max(1.0, sides[0] * 1.2)
    pairs = int(s.rng.integers(1, 5))
    p: Params = {"carrier_hz": carrier, "amplitude": amplitude, "sideband_ratios": sides, "pole_pairs": pairs}
    if s.coin(_SUPPRESSED):
        # Modulated by sines, line to line, a carrier has no line itself, and the first pair is the strongest.
        first = amplitude * max(1.0, sides[0] * 1.2) / sides[0]
        p |= {"amplitude": first, "suppressed": True, "pole_pairs": 2 * (1 + pairs % 3)}
    return p


def _gear_mesh(s: Setting) -> Params:
    highest = 0.3 * s.base.fs_hz / max(s.layout.speed_rpm) * 60
    teeth = int(s.rng.integers(13, max(15, int(min(61, highest)))))
    harmonics = [k for k in (1, 2, 3) if k * teeth < 1.3 * highest] or [1]
    amplitudes = _falling(s, [k * teeth * s.shaft_hz for k in harmonics], s.line_db(), s.coin(0.7))
    sides = [s.uniform(0.25, 0.7)] + ([s.uniform(0.1, 0.3)] if s.coin(0.5) else [])
    return {"teeth": teeth, "amplitudes": amplitudes, "sideband_ratios": sides}


def _foreign_bearing(s: Setting) -> Params:
    bearing = s.layout.bearing
    own = [bearing.bpfo, bearing.bpfi, 2 * bearing.bsf]
    taken = [h * o + side for o in own for h in (1, 2) for side in (-1.0, 0.0, 1.0)] + [o / 2 for o in own]
    while True:
        order = s.log(2.3, 11.0)
        # Its second harmonic must not coincide with those of the bearing under test either.
        clear = all(abs(h * order - t) > 0.035 * h * order for h in (1, 2) for t in taken)
        if clear and all(abs(h * order - round(h * order)) > 0.06 for h in (1, 2)):
            break
    line_db = s.pick((8.0, 11.0), (18.0, 22.0), (28.0, 36.0))
    ratio = min(detectable_ratio(s.base, order * s.shaft_hz, line_db, s.levels.duration_s), 8.0)
    impulse = ratio * s.levels.quiet_rms / np.sqrt(s.levels.impact_energy * order * s.shaft_hz / s.base.fs_hz)
    return {"order": order, "impulse": float(impulse), "slip_fraction": s.uniform(0.0, 0.004), "rms_over_quiet": ratio}


def _coloured_noise(s: Setting) -> Params:
    fs, raised = s.base.fs_hz, s.raised()
    if s.coin(0.6):
        centre = fs * s.log(0.04, 0.38)
        p: Params = {"shape": "band", "centre_hz": centre, "bandwidth_hz": centre * s.uniform(0.2, 0.5)}
        p["bandwidth_hz"] = min(p["bandwidth_hz"], 2 * (0.48 * fs - centre))
        at = centre
    else:
        p = {"shape": "slope", "corner_hz": fs * s.log(0.008, 0.06), "poles": int(s.rng.integers(1, 3))}
        at = 0.5 * p["corner_hz"]
    p["white_equivalent_rms"] = float(np.sqrt(raised * s.levels.at(at) * fs / 2))
    return p


def _impulsive_noise(s: Setting) -> Params:
    level = (s.levels.quiet_rms, s.levels.mean_rms, s.levels.mean_rms)[s.strength]
    peak = level * s.pick((6.0, 8.0), (11.0, 16.0), (24.0, 45.0))
    rate = s.pick((0.6, 1.5), (1.0, 4.0), (2.0, 8.0))
    if s.coin(0.6):
        return {"through_structure": True, "rate_per_s": rate, "impulse": peak / s.levels.impact_peak, "peak": peak}
    fs = s.base.fs_hz
    ring = {"ring_hz": s.uniform(0.02, 0.3) * fs, "decay_s": s.log(1.5, 15) / fs}
    return {"through_structure": False, "rate_per_s": rate, "peak": peak, **ring}


def _waviness(s: Setting) -> Params:
    race = "outer" if s.coin(0.6) else "inner"
    order = fault_order(s.layout.bearing, race, 1.0)
    count = int(s.rng.integers(2, 5))
    hz = [order * k * s.shaft_hz for k in range(1, count + 1)]
    return {"race": race, "amplitudes": _falling(s, hz, s.line_db(), s.coin(0.6))}


def _clipping(s: Setting) -> Params:
    part = s.pick((2e-4, 6e-4), (4e-3, 1.2e-2), (0.04, 0.09))
    middle = s.uniform(-0.03, 0.03) * s.levels.quiet_rms  # offset of the amplifier
    rail = float(np.quantile(np.abs(s.levels.values - middle), 1 - part))
    g = s.base.gain
    return {"low": (middle - rail) * g, "high": (middle + rail) * g, "part_aimed_at": part}


def _quantisation(s: Setting) -> Params:
    return {"step": s.pick((0.05, 0.1), (0.25, 0.5), (0.9, 1.8)) * s.levels.quiet_rms * s.base.gain}


def _dropout(s: Setting) -> Params:
    return {
        "stretches_per_s": s.pick((0.3, 0.6), (1.0, 2.5), (4.0, 8.0)),
        "length_s": s.pick((0.0015, 0.003), (0.004, 0.008), (0.01, 0.025)),
        "fill": "hold" if s.coin(0.5) else "zero",
    }


DRAWS: Final[Mapping[str, Callable[[Setting], Params]]] = {
    "speed_fluctuation": _speed_fluctuation, "mean_slip": _mean_slip, "slip_jitter": _slip_jitter,
    "impact_scatter": _impact_scatter, "load_zone": _load_zone, "cage_modulation": _cage_modulation,
    ENTRY_EXIT: _two_impacts, "distributed_roughness": _distributed_roughness, "speed_gain": _speed_gain,
    "damage_growth": _damage_growth, "second_resonance": _second_resonance, "sensor_rolloff": _sensor_rolloff,
    "shaft_harmonics": _shaft_harmonics, "looseness": _looseness, "mains_interference": _mains_interference,
    "drive_interference": _drive_interference, "gear_mesh": _gear_mesh, "foreign_bearing": _foreign_bearing,
    "coloured_noise": _coloured_noise, "impulsive_noise": _impulsive_noise, "waviness": _waviness,
    "clipping": _clipping, "quantisation": _quantisation, "dropout": _dropout,
}  # fmt: skip
"""Effect -> draw of its parameters, in internal units except for the converter's, which are in the record's unit."""

LAST: Final = ("clipping", "quantisation", "dropout")
"""Effects of the converter, drawn last since their parameters depend on all others."""


def draw_effect(
    name: str, strength: str, levels: MachineLevels, base: Base, layout: Layout, rng: np.random.Generator
) -> Params:
    """Parameters of one catalogued effect."""
    return DRAWS[name](Setting(STRENGTHS.index(strength), levels, base, layout, rng))
