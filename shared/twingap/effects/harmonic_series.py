"""Harmonics of a line: the base of hums, gears, wavy races and loose parts."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twingap.effects.base import Effect, profile
from twingap.effects.draft import Draft

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HarmonicSeries(Effect):
    """Base of effects that are harmonics of a line whose amplitudes decay regularly, or are as measured.

    Parameters
    ----------
    amplitudes : tuple of float
        Amplitude of each harmonic over `level`, in place of a regular decay; empty for that decay.
    """

    spaced_by_shaft: ClassVar[bool] = False
    """Whether lines one order apart accompany each harmonic."""
    most_harmonics: ClassVar[int]
    """Largest number of harmonics that are measured. A larger one measures weaker ones and takes longer."""
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

    @abstractmethod
    def base_hz(self, draft: Draft) -> float:
        """Frequency of the first harmonic at the mean speed of a draft, Hz."""
