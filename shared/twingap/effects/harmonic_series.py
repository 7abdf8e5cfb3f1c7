"""Harmonics of a line: the base of hums, gears, wavy races and loose parts."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from twingap.effects.base import Effect, profile
from twingap.effects.draft import Draft

Array = NDArray[np.float64]

_FUNDAMENTAL: Final = 0.3
"""Amplitude of the first harmonic, over the level so far, from which it is the level."""


class MeasuredLines(Effect):
    """Base of effects that are lines at multiples of a frequency, of amplitudes that records show."""

    spaced_by_shaft: ClassVar[bool] = False
    """Whether lines one order apart accompany each harmonic."""
    turns: ClassVar[bool] = True
    """Whether its frequencies are multiples of the shaft's: then they vary with the speed, and are as uncertain."""
    most_harmonics: ClassVar[int]
    """Largest number of harmonics that are measured. A larger one measures weaker ones and takes longer."""

    @property
    @abstractmethod
    def levels(self) -> Array:
        """[harmonics] Amplitude of each, healthy rms."""

    @abstractmethod
    def at_levels(self, levels: Array) -> Self:
        """The effect with other amplitudes [harmonics], healthy rms, of which one at least is positive."""

    @abstractmethod
    def base_hz(self, draft: Draft) -> float:
        """Frequency of the first harmonic at the mean speed of a draft, Hz."""

    def lower(self) -> Iterator[Self]:
        """The same lines as higher harmonics of other series, whose first one may not stand out. None by default."""
        yield from ()


@dataclass(frozen=True)
class HarmonicSeries(MeasuredLines):
    """Base of effects that are harmonics of a line whose amplitudes decay regularly, or are as measured.

    Parameters
    ----------
    amplitudes : tuple of float
        Amplitude of each harmonic over `level`, in place of a regular decay; empty for that decay.
    """

    regular: ClassVar[frozenset[str]]
    """Parameters of the regular decay."""

    amplitudes: tuple[float, ...] = profile(
        (), unit="of level", doc="amplitude of each harmonic, where measured; in place of a regular decay"
    )

    @property
    def levels(self) -> Array:
        """[harmonics] Amplitude of each, healthy rms."""
        level: float = self.level  # type: ignore[attr-defined]  # a parameter of every series
        return level * np.array(self.amplitudes) if self.amplitudes else self.regular_levels

    def at_levels(self, levels: Array) -> Self:
        """See `MeasuredLines.at_levels`: amplitudes are relative to a first harmonic that is not far below `level`."""
        level: float = self.level  # type: ignore[attr-defined]
        amplitudes = levels[: int(np.flatnonzero(levels)[-1]) + 1] / level
        if amplitudes[0] > _FUNDAMENTAL:
            level, amplitudes = level * float(amplitudes[0]), amplitudes / amplitudes[0]
        return replace(self, level=level, amplitudes=tuple(float(f"{a:.6g}") for a in amplitudes))  # type: ignore[call-arg]

    @property
    @abstractmethod
    def regular_levels(self) -> Array:
        """[harmonics] Amplitude of each with a regular decay, healthy rms."""

    @property
    def idle_parameters(self) -> frozenset[str]:
        return self.regular if self.amplitudes else frozenset()

    @property
    def measured_parameters(self) -> frozenset[str]:
        return frozenset({"level"}) if self.amplitudes else frozenset()
