"""A list of discrete lines, fixed in Hz, in shaft orders, or at orders about a fixed carrier."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._references import RANDALL_BOOK
from twingap.effects.angle import at_angles, cosine
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

    Some are fixed in Hz, some in multiples of shaft speed, and those of a drive at multiples of shaft speed about a
    fixed carrier. Each has an amplitude; `scatter_db` is by how much the amplitudes vary between records. Phases are
    random. Lines at or above half the sampling rate are left out.
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
    carriers_hz: tuple[float, ...] = profile((), unit="Hz", doc="carriers about which lines turn with the shaft")
    carrier_orders: tuple[float, ...] = profile(
        (), unit="shaft orders", allowed=(-1e4, 1e4), doc="distance of each of these lines from its carrier"
    )
    carrier_amplitudes: tuple[float, ...] = profile((), unit="healthy rms", doc="amplitude of each")

    def __post_init__(self) -> None:
        super().__post_init__()
        for places, values in (
            (self.frequencies_hz, self.amplitudes),
            (self.orders, self.order_amplitudes),
            (self.carrier_orders, self.carrier_amplitudes),
        ):
            if len(places) != len(values):
                raise TwingapError(
                    f"{len(places)} lines and {len(values)} amplitudes, as many expected", where=f"effect {self.name}"
                )
        if len(self.carriers_hz) != len(self.carrier_orders):
            raise TwingapError(
                f"{len(self.carrier_orders)} lines and {len(self.carriers_hz)} carriers, as many expected",
                where=f"effect {self.name}",
            )

    @property
    def places(self) -> tuple[Array, Array]:
        """[lines], [lines] Of every line, the part of its frequency that is fixed, Hz, and that in shaft orders."""
        hz, orders, carriers = (np.array(of, float) for of in (self.frequencies_hz, self.orders, self.carriers_hz))
        fixed = np.concatenate((hz, np.zeros(orders.size), carriers))
        return fixed, np.concatenate((np.zeros(hz.size), orders, np.array(self.carrier_orders, float)))

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        fixed, turning = self.places
        amplitudes = np.array((*self.amplitudes, *self.order_amplitudes, *self.carrier_amplitudes), float)
        if not amplitudes.size:
            return
        amplitudes *= self.level * draft.reference_rms
        amplitudes *= np.exp(_NEPERS_PER_DB * self.scatter_db * rng.standard_normal(amplitudes.size))
        weights = amplitudes * np.exp(2j * np.pi * rng.random(amplitudes.size))
        weights = np.where(fixed + turning * draft.shaft_hz < draft.condition.fs_hz / 2, weights, 0)
        step_hz, only_hz, only_orders = 1 / draft.condition.fs_hz, turning == 0, (fixed == 0) & (turning != 0)
        draft.x += _even(fixed[only_hz] * step_hz, weights[only_hz], draft.x.size)
        if only_orders.any():
            draft.x += _in_orders(turning[only_orders], weights[only_orders], draft.turns)
        for place in np.flatnonzero(~only_hz & ~only_orders):
            phases = np.angle(weights[place]) / (2 * np.pi)
            angle = fixed[place] * draft.t + turning[place] * draft.turns + phases
            draft.x += np.abs(weights[place]) * cosine(angle)


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
