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
WITHOUT, BEHIND, WITH = "#374151", "#c4c8d0", "#d55e00"
"""Dark grey, light grey, and the vermilion of Okabe and Ito."""


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
    """Draw a signature into a PNG file: without the effect above, with it below, in front of the other in grey."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 3, figsize=(10.5, 4.4), sharex="col", sharey="col")
    figure.subplots_adjust(left=0.075, right=0.99, bottom=0.115, top=0.985, wspace=0.26, hspace=0.12)
    panels = zip((_record_lines, _spectrum_lines, _envelope_lines), axes.T, strict=True)
    for lines, (above, below) in panels:
        x, without, with_it = lines(shown, below)
        above.plot(x, without, color=WITHOUT, linewidth=0.9)
        below.plot(x, without, color=BEHIND, linewidth=1.4)
        below.plot(x, with_it, color=WITH, linewidth=0.9)
    for row, label in zip(axes, ("without", "with"), strict=True):
        row[0].text(0.015, 0.97, label, transform=row[0].transAxes, va="top", fontsize=12, fontweight="bold")
        for one in row:
            one.spines[["top", "right"]].set_visible(False)
            one.tick_params(labelsize=10.5)
    figure.savefig(path, dpi=100)
    plt.close(figure)


Lines = tuple[Array, Array, Array]
"""Places on the axis, values without the effect, values with it."""


def _record_lines(shown: Signature, axes: Any) -> Lines:
    """Three shaft turns about where the effect changes the record most."""
    samples = round(3 * 60 / shown.condition.speed_rpm * FS_HZ)
    energy = np.convolve((shown.with_it - shown.without) ** 2, np.ones(samples), mode="valid")
    begin = int(energy.argmax())
    part = slice(begin, begin + samples)
    time_ms = 1000 * np.arange(samples) / FS_HZ
    axes.set_xlabel("time, ms", fontsize=11)
    axes.set_ylabel("vibration, healthy rms", fontsize=11, y=1.05)
    axes.set_xlim(0, time_ms[-1])
    return time_ms, shown.without[part], shown.with_it[part]


def _spectrum_lines(shown: Signature, axes: Any) -> Lines:
    """Amplitude spectra with lines of 1 Hz, in dB."""
    spectra = [averaged_spectrum(x, FS_HZ, segment_samples=int(FS_HZ)) for x in (shown.without, shown.with_it)]
    frequency = spectra[0].frequency
    kept = frequency >= 8
    without, with_it = (20 * np.log10(np.maximum(one.values[kept], 1e-5)) for one in spectra)
    axes.set_xscale("log")
    axes.set_xlim(8, FS_HZ / 2)
    axes.set_ylim(
        min(np.quantile(without, 0.05), np.quantile(with_it, 0.05)) - 6, max(without.max(), with_it.max()) + 4
    )
    axes.set_xlabel("frequency, Hz", fontsize=11)
    axes.set_ylabel("amplitude, dB", fontsize=11, y=1.05)
    return frequency[kept], without, with_it


def _envelope_lines(shown: Signature, axes: Any) -> Lines:
    """Spectra of the squared envelope, over multiples of shaft speed."""
    fault_order = BEARING.fault_order(str(shown.condition.fault))
    most = 3.4 * fault_order
    spectra = [squared_envelope_spectrum(x, FS_HZ) for x in (shown.without, shown.with_it)]
    orders = spectra[0].frequency / (shown.condition.speed_rpm / 60)
    kept = (orders > 0.15) & (orders <= most)
    for harmonic in (1, 2, 3):
        axes.axvline(harmonic * fault_order, color="#0072b2", linewidth=1, linestyle=":", zorder=0)
    axes.set_xlim(0, most)
    axes.set_ylim(0, 1.08 * max(one.values[kept].max() for one in spectra))
    axes.set_xlabel("envelope order, shaft speeds", fontsize=11)
    axes.set_ylabel("squared envelope", fontsize=11, y=1.05)
    return orders[kept], spectra[0].values[kept], spectra[1].values[kept]


def caption(shown: Signature, values: Mapping[str, Any]) -> str:
    """What a figure shows, in a sentence."""
    condition = shown.condition
    place = {"outer": "an outer-race", "inner": "an inner-race", "ball": "a ball"}[str(condition.fault)]
    about = f"{place} fault at {condition.speed_rpm:g} rpm"
    stated = ", ".join(f"`{name}` {_as_text(value)}" for name, value in values.items())
    return (
        f"One simulated record of {about}, without the effect (above; light grey below) and with it at its default "
        f"values ({stated}). Left: where it changes the record most. Middle: amplitude spectrum. Right: spectrum of "
        "the squared envelope; dotted lines are the first three multiples of the fault order."
    )


def _as_text(value: Any) -> str:
    """A value in words; a list as its numbers."""
    if isinstance(value, bool):
        return str(value).lower()
    return "(" + ", ".join(f"{one:g}" for one in value) + ")" if isinstance(value, tuple) else f"{value:g}"
