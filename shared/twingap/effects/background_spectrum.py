"""Stationary background noise of any smooth spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import measurements
from twingap.effects._gains import check_places
from twingap.effects._shaped_noise import shaped_noise
from twingap.effects.base import Effect, Stage, parameter, profile
from twingap.effects.draft import Draft
from twingap.effects.registry import register


@register
@dataclass(frozen=True)
class BackgroundSpectrum(Effect):
    """Gaussian noise with a given power density, independent of the impacts: flow, gears, neighbouring machines.

    The density is given in dB over the squared healthy RMS per Hz at some frequencies, with straight lines between
    them and constant beyond. It may stand in place of the noises that a twin has of its own; a finished waveform keeps
    what it has.
    """

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    references: ClassVar[tuple[str, ...]] = (
        "Shinozuka & Deodatis 1991, Simulation of stochastic processes by spectral representation, "
        "doi:10.1115/1.3119501",
    )
    group: ClassVar[str] = "background"
    look_alikes: ClassVar[tuple[str, ...]] = ("coloured_noise", "transfer_path", "distributed_roughness")
    deciding_measurement: ClassVar[str] = measurements.BACKGROUND
    trained: ClassVar[bool] = False
    measured: ClassVar[bool] = True

    level: float = parameter(
        1.0, unit="", plausible=(0.05, 2.0), allowed=(0, 100.0), log=True, strength=True, searched=False,
        doc="factor on the amplitude",
    )  # fmt: skip
    replaced: float = parameter(
        0.0, unit="", plausible=(0.0, 1.0), allowed=(0, 1), fitted=False, searched=False,
        doc="part of the twin's own noise, in amplitude, that it replaces",
    )  # fmt: skip
    frequencies_hz: tuple[float, ...] = profile(
        (0.0, 1000.0, 4000.0, 10000.0), unit="Hz", doc="frequencies of the densities, increasing"
    )
    densities_db: tuple[float, ...] = profile(
        (-35.0, -35.0, -45.0, -55.0), unit="dB of squared healthy rms per Hz", allowed=(-300.0, 100.0),
        doc="power density at each frequency",
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        check_places(self, self.frequencies_hz, self.densities_db, "densities_db")

    @property
    def own_noise(self) -> float:
        return 1.0 - self.replaced

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        if self.frequencies_hz:
            noise = shaped_noise(draft.x.size, draft.condition.fs_hz, self.frequencies_hz, self.densities_db, rng)
            draft.x += self.level * draft.reference_rms * noise
