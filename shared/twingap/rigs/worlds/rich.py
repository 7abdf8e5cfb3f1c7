"""Rich machines: a structural path of many modes that is not of minimum phase, and records with many lines.

strength, levels, machine, layout --> parameters of transfer_path and line_spectrum; applied in recorder, disturbance

The path sums at least eight modes of either sign, of which some respond late, as parts farther from the bearing do.
Between points that are not collocated such sums have zeros outside the unit circle (Preumont, Vibration Control of
Active Structures, chapter on collocated and non-collocated control). The lines are those of a drive (pairs beside a
carrier that has no line itself: Holmes and Lipo, Pulse Width Modulation for Power Converters, 2003), of gears on other
shafts, and of the mains.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from twingap.rigs.worlds.base import OVERSAMPLING, Base, Mode, path_modes, response
from twingap.rigs.worlds.case import STRENGTHS
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.machine_levels import MachineLevels
from twingap.rigs.worlds.strength import Params, Setting

FEWEST_MODES, MOST_MODES = 8, 12
"""Modes of a path, with those of the base machine; more make its response less like that of one mode."""
FEWEST_ZEROS: Final = 4
"""Fewest zeros of a path outside the unit circle; more make paths differ more from those of minimum phase."""
FEWEST_LINES: Final = 64
"""Fewest lines; some may coincide with others or with the edge of the band at single speeds."""
FAINTEST_DB: Final = 13.0
"""Height of the faintest line over the noise of one record, dB; lower hides lines in single records."""


def zeros_outside(modes: tuple[Mode, ...], hertz: bool, fs_hz: float) -> int:
    """Number of zeros of a path outside the unit circle, on the fine grid; 0 for a path of minimum phase.

    By the argument principle: a stable response that begins at once turns by half a revolution between zero frequency
    and half the sampling rate for each zero outside. Acceleration is replaced by displacement, which has the same zeros
    but for the two at zero frequency.
    """
    fine_hz = OVERSAMPLING * fs_hz
    if hertz:
        modes = tuple(replace(m, gain=m.gain * (modes[0].frequency_hz / m.frequency_hz) ** 2) for m in modes)
    hz = np.linspace(0.0, fine_hz / 2, 2**15 + 1)
    # Displacement begins one step after the force.
    phase = np.unwrap(np.angle(response(modes, False, fs_hz, hz) * np.exp(2j * np.pi * hz / fine_hz)))
    return round(float(phase[0] - phase[-1]) / np.pi)


def _transfer_path(s: Setting) -> Params:
    base, count = s.base, int(s.rng.integers(FEWEST_MODES, MOST_MODES + 1))
    gains = ((0.1, 0.2), (0.2, 0.5), (0.5, 1.2))[s.strength]
    while True:
        found = [m.frequency_hz for m in base.modes]
        rows: list[tuple[float, float, float, float]] = []
        while len(found) < count:
            hz = base.fs_hz * s.log(0.04, 0.43)
            if all(abs(hz / other - 1) > 0.07 for other in found):
                found.append(hz)
                gain = s.log(*gains) * (-1.0 if s.coin(0.5) else 1.0)
                rows.append((hz, s.log(0.01, 0.04), gain, s.uniform(5e-5, 4e-4) if s.coin(0.5) else 0.0))
        names = ("frequencies_hz", "damping_ratios", "gains", "delays_s")
        p: Params = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
        p["zeros_outside"] = zeros_outside((*base.modes, *path_modes(p)), base.hertz, base.fs_hz)
        if p["zeros_outside"] >= FEWEST_ZEROS:
            return p


def _line_spectrum(s: Setting) -> Params:
    fs, shaft, fastest = s.base.fs_hz, s.shaft_hz, max(s.layout.speed_rpm) / 60
    apart_hz = 4 / s.levels.duration_s
    top_db = s.pick((16.0, 18.0), (21.0, 26.0), (28.0, 34.0))
    carrier = fs * s.uniform(0.12, 0.4)
    carriers = [carrier, 2 * carrier] if carrier < 0.2 * fs else [carrier]
    taken = list(carriers)  # no line lies at a carrier
    columns = ("orders", "order_amplitudes", "frequencies_hz", "amplitudes")
    p: Params = {name: [] for name in (*columns, "carriers_hz", "carrier_orders", "carrier_amplitudes")}

    def amplitude(hz: float, strongest: bool) -> float | None:
        """Amplitude of a line at this frequency at mean speed; None where there is a line already."""
        if any(abs(hz - other) < apart_hz for other in taken):
            return None
        taken.append(hz)
        return s.levels.tone(hz, top_db if strongest else s.uniform(FAINTEST_DB, top_db))

    for carrier in carriers:
        for order in (-6.0, -4.0, -2.0, 2.0, 4.0, 6.0):
            if (a := amplitude(carrier + order * shaft, abs(order) == 2)) is not None:
                _append(p, {"carriers_hz": carrier, "carrier_orders": order, "carrier_amplitudes": a})
    mains = (50.0 if s.coin(0.5) else 60.0) * (1 + s.uniform(-3e-4, 3e-4))
    for k in (1, 2, 3, 4, 5, 6, 7, 9, 12):
        if (a := amplitude(k * mains, k == 2)) is not None:
            _append(p, {"frequencies_hz": k * mains, "amplitudes": a})
    while len(taken) < FEWEST_LINES + len(carriers):
        # A gear on a shaft that turns at another speed.
        ratio, mesh = s.uniform(0.3, 3.0), s.log(8.0, 0.2 * fs / fastest)
        mesh = ratio * max(round(mesh / ratio), 3)
        for order in (k * mesh + side * ratio for k in (1, 2, 3, 4) for side in (0, -1, 1, -2, 2)):
            if order * fastest < 0.43 * fs and (a := amplitude(order * shaft, order == mesh)) is not None:
                _append(p, {"orders": order, "order_amplitudes": a})
    return p | {"lines": len(taken) - len(carriers)}


def _append(p: Params, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        p[name].append(float(value))


DRAWS: Final[Mapping[str, Callable[[Setting], Params]]] = {
    "transfer_path": _transfer_path,
    "line_spectrum": _line_spectrum,
}
"""Effect -> draw of its parameters, in internal units."""


def draw_rich(
    name: str, strength: str, levels: MachineLevels, base: Base, layout: Layout, rng: np.random.Generator
) -> Params:
    """Parameters of one effect of rich machines."""
    return DRAWS[name](Setting(STRENGTHS.index(strength), levels, base, layout, rng))
