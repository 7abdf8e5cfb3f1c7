"""Figures of effects: record, spectrum and envelope spectrum of one machine, with and without the effect."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap import BEARINGS, Condition
from twingap.effects import Effect
from twingap.signal import averaged_spectrum, squared_envelope_spectrum
from twingap.twins import PhenomenologicalTwin

Array = NDArray[np.float64]

BEARING: Final = BEARINGS["6205"]
FS_HZ: Final = 12000.0
SECONDS: Final = 2.0
CONDITIONS: Final = tuple(
    Condition(fault, speed_rpm, FS_HZ, int(SECONDS * FS_HZ), fault, time_s=time_s)
    for speed_rpm, time_s in ((1500.0, 0.0), (2400.0, 700.0))
    for fault in ("outer", "inner", "ball")
)
"""Conditions that a figure may show, the simplest first."""
VISIBLE: Final = 0.05
"""Root-mean-square change of the record, relative to its own, from which a condition shows the effect."""
WITHOUT, WITH = "#6b7280", "#d55e00"
"""Grey and the vermilion of Okabe and Ito, which colour-blind readers tell apart by lightness too."""


@dataclasses.dataclass(frozen=True)
class Signature:
    """One record of one machine, without and with an effect.

    Parameters
    ----------
    effect : Effect
    condition : Condition
    without, with_it : Array [samples]
        In multiples of the RMS of the machine's healthy vibration.
    """

    effect: Effect
    condition: Condition
    without: Array
    with_it: Array

    @property
    def change(self) -> float:
        """RMS of the difference over the RMS of the record without it."""
        return float(np.std(self.with_it - self.without) / np.std(self.without))


def signature(kind: type[Effect]) -> Signature:
    """The effect at its default values, on the first condition that shows it."""
    found = []
    effect = kind()
    for condition in CONDITIONS:
        found.append(Signature(effect, condition, _record((), condition), _record((effect,), condition)))
        if found[-1].change >= VISIBLE:
            return found[-1]
    return max(found, key=lambda one: one.change)


def _record(effects: tuple[Effect, ...], condition: Condition) -> Array:
    twin = PhenomenologicalTwin(BEARING, effects=effects)
    (record,) = twin.simulate([condition], np.random.default_rng(0))
    return np.asarray(record.samples / twin.reference_rms)


def draw(shown: Signature, path: Path) -> None:
    """Draw a signature into a PNG file."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(10.5, 2.9), layout="constrained")
    _record_panel(axes[0], shown)
    _spectrum_panel(axes[1], shown)
    _envelope_panel(axes[2], shown)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, frameon=False, fontsize=11)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _both(axes: Any, x: Array, without: Array, with_it: Array) -> None:
    axes.plot(x, with_it, color=WITH, linewidth=1.1, label="with it")
    axes.plot(x, without, color=WITHOUT, linewidth=0.9, alpha=0.85, label="without")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=10)


def _record_panel(axes: Any, shown: Signature) -> None:
    """Three shaft turns about where the effect changes the record most."""
    samples = round(3 * 60 / shown.condition.speed_rpm * FS_HZ)
    energy = np.convolve((shown.with_it - shown.without) ** 2, np.ones(samples), mode="valid")
    begin = int(energy.argmax())
    part = slice(begin, begin + samples)
    time_ms = 1000 * np.arange(samples) / FS_HZ
    _both(axes, time_ms, shown.without[part], shown.with_it[part])
    axes.set_xlabel("time, ms", fontsize=11)
    axes.set_ylabel("vibration, healthy rms", fontsize=11)
    axes.set_xlim(0, time_ms[-1])


def _spectrum_panel(axes: Any, shown: Signature) -> None:
    without, with_it = (
        averaged_spectrum(x, FS_HZ, segment_samples=int(FS_HZ)) for x in (shown.without, shown.with_it)
    )
    kept = without.frequency >= 8
    levels = [20 * np.log10(np.maximum(one.values[kept], 1e-5)) for one in (without, with_it)]
    _both(axes, without.frequency[kept], *levels)
    axes.set_xscale("log")
    axes.set_xlim(8, FS_HZ / 2)
    low = min(float(np.quantile(level, 0.05)) for level in levels)
    axes.set_ylim(low - 6, max(float(level.max()) for level in levels) + 4)
    axes.set_xlabel("frequency, Hz", fontsize=11)
    axes.set_ylabel("amplitude, dB", fontsize=11)


def _envelope_panel(axes: Any, shown: Signature) -> None:
    shaft_hz = shown.condition.speed_rpm / 60
    fault_order = BEARING.fault_order(str(shown.condition.fault))
    most = 3.4 * fault_order
    without, with_it = (squared_envelope_spectrum(x, FS_HZ) for x in (shown.without, shown.with_it))
    orders = without.frequency / shaft_hz
    kept = (orders > 0.15) & (orders <= most)
    _both(axes, orders[kept], without.values[kept], with_it.values[kept])
    for harmonic in (1, 2, 3):
        axes.axvline(harmonic * fault_order, color="#0072b2", linewidth=0.8, linestyle=":", zorder=0)
    axes.set_xlim(0, most)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("envelope order, turns$^{-1}$", fontsize=11)
    axes.set_ylabel("squared envelope", fontsize=11)


def caption(shown: Signature, values: Mapping[str, Any]) -> str:
    """What a figure shows, in a sentence."""
    condition = shown.condition
    about = f"a {condition.fault} fault at {condition.speed_rpm:g} rpm"
    stated = ", ".join(f"`{name}` {value:g}" for name, value in values.items())
    return (
        f"The same simulated record of {about} without (grey) and with the effect (orange), at its default values "
        f"({stated}). Left: where it changes the record most. Middle: amplitude spectrum. Right: spectrum of the "
        "squared envelope; dotted lines are the first three multiples of the fault order."
    )
