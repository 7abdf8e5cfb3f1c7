"""A list of discrete lines, fixed in Hz or in shaft orders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._references import RANDALL_BOOK
from twingap.effects.angle import at_angles
from twingap.effects.base import Effect, Stage, parameter, profile
from twingap.effects.draft import Draft
from twingap.effects.registry import register
from twingap.errors import TwingapError

Array = NDArray[np.float64]

_BLOCK: Final = 256
"""Samples over which the phase of a line is one factor of a product. Any value gives the same samples."""
_EVEN_TURNS: Final = 1e-7
"""Largest deviation from even angles, in turns, that is neglected: a thousandth of a degree at the 100th order."""
_NEPERS_PER_DB: Final = np.log(10) / 20


@register
@dataclass(frozen=True)
class LineSpectrum(Effect):
    """Discrete lines of other sources: mains, drives, meshing gears, other bearings, whatever they are.

    Some are fixed in Hz, some in multiples of shaft speed. Each has an amplitude; `scatter_db` is by how much the
    amplitudes vary between records. Phases are random. Lines at or above half the sampling rate are left out.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (f"{RANDALL_BOOK}, ch. 2 and 3",)
    group: ClassVar[str] = "lines"
    look_alikes: ClassVar[tuple[str, ...]] = (
        "mains_interference", "drive_interference", "gear_mesh", "looseness", "shaft_harmonics", "waviness",
        "foreign_bearing",
    )  # fmt: skip
    deciding_measurement: ClassVar[str] = measurements.OTHER_SPEED
    trained: ClassVar[bool] = False
    measured: ClassVar[bool] = True

    level: float = parameter(
        1.0, unit="", plausible=(0.05, 2.0), allowed=(0, 100.0), log=True, strength=True, searched=False,
        doc="factor on all amplitudes",
    )  # fmt: skip
    scatter_db: float = parameter(
        0.0, unit="dB", plausible=(0.0, 6.0), allowed=(0, 40.0), searched=False,
        doc="standard deviation of a line's level over records",
    )  # fmt: skip
    frequencies_hz: tuple[float, ...] = profile((120.0, 1330.0), unit="Hz", doc="lines fixed in Hz")
    amplitudes: tuple[float, ...] = profile((0.3, 0.2), unit="healthy rms", doc="amplitude of each")
    orders: tuple[float, ...] = profile((7.0, 21.0), unit="shaft orders", doc="lines at multiples of shaft speed")
    order_amplitudes: tuple[float, ...] = profile((0.3, 0.2), unit="healthy rms", doc="amplitude of each")

    def __post_init__(self) -> None:
        super().__post_init__()
        for places, values in ((self.frequencies_hz, self.amplitudes), (self.orders, self.order_amplitudes)):
            if len(places) != len(values):
                raise TwingapError(
                    f"{len(places)} lines and {len(values)} amplitudes, as many expected", where=f"effect {self.name}"
                )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        hz, orders = np.array(self.frequencies_hz), np.array(self.orders)
        amplitudes = np.array((*self.amplitudes, *self.order_amplitudes)) * (self.level * draft.reference_rms)
        if not amplitudes.size:
            return
        amplitudes *= np.exp(_NEPERS_PER_DB * self.scatter_db * rng.standard_normal(amplitudes.size))
        weights = amplitudes * np.exp(2j * np.pi * rng.random(amplitudes.size))
        below = np.concatenate((hz, orders * draft.shaft_hz)) < draft.condition.fs_hz / 2
        weights = np.where(below, weights, 0)
        step_hz = 1 / draft.condition.fs_hz
        draft.x += _even(hz * step_hz, weights[: hz.size], draft.x.size)
        if orders.size:
            draft.x += _in_orders(orders, weights[hz.size :], draft.turns)


def _in_orders(orders: Array, weights: NDArray[np.complex128], turns: Array) -> Array:
    """[n] Sum of lines at multiples of the shaft angle: made at even angles, read at the angles of the samples."""
    even = turns[0] + (turns[-1] - turns[0]) / max(turns.size - 1, 1) * np.arange(turns.size)
    step = float(even[1] - even[0]) if turns.size > 1 else 0.0
    x = _even(orders * step, weights * np.exp(2j * np.pi * orders * turns[0]), turns.size)
    return x if np.abs(turns - even).max() < _EVEN_TURNS else at_angles(x, even, turns)


def _even(cycles: Array, weights: NDArray[np.complex128], n: int) -> Array:
    """[n] Sum of lines that advance by so many cycles a sample: a product of coarse and fine phases."""
    if not cycles.size:
        return np.zeros(n)
    blocks = np.arange(-(-n // _BLOCK))
    coarse = weights[:, None] * np.exp(2j * np.pi * cycles[:, None] * (_BLOCK * blocks))
    fine = np.exp(2j * np.pi * cycles[:, None] * np.arange(_BLOCK))
    return np.asarray((coarse.real.T @ fine.real - coarse.imag.T @ fine.imag).ravel()[:n])
