"""Simulated fleets: healthy and faulty machines of one kind, with the disturbances of real plants.

TwinSpec --draw per fleet--> path, disturbances of all members --draw per member--> fault, its impacts, its wear
                                                                             |
                     classes in any proportion <-- records, one per member

Effects that a twin lacks are drawn from the catalogue, since unlabelled records do not show them (domain randomisation,
Tobin et al. 2017, arXiv:1703.06907): tones of shaft, drive and mains, coloured noise, a sensor's roll-off, a second
mode. Two properties of real faults are added that a periodic train of impacts lacks:

- the axis of rotation of a rolling element varies, so that its defect meets the races irregularly and with any strength
  (Smith & Randall 2015, DOI 10.1016/j.ymssp.2015.04.021, find no plain rolling-element signature in CWRU's records);
- a defect may cause roughness only: a higher level than that of a healthy machine, without lines.

A mode that the twin file states is varied as if it were unknown, since one identified mode may represent several.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from twingap.adapt.population import CLASSES, FREE_SPREAD, SPEED_SPREAD, TRIES, Population
from twingap.effects import EntryExit, effect_name
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.twins.base import Twin

HEALTHY_SHARES: Final = ((0.0, 0.12, 0.25, 0.5, 0.8, 1.0), (0.1, 0.25, 0.3, 0.2, 0.1, 0.05))
"""Fractions of healthy members, and their probabilities. The fraction in a real fleet is unknown."""
IMPACTS_SNR_DB: Final = (-12.0, 16.0)
"""Range of the power of impacts over that of healthy vibration: from undetectable to obvious."""
FAINT_DB: Final = -3.0
"""Level below which impacts always come with roughness, since the fault would be undetectable otherwise."""
ROUGH: Final = 0.6
"""Fraction of stronger faults with roughness."""
WANDERING: Final = 0.8
"""Fraction of defective rolling elements whose axis varies."""
LOUDNESS_SPREAD: Final = 0.15
LEVEL_SPREAD: Final = 0.2
PATH_SPREAD: Final = 0.02
"""Log standard deviations between members of a fleet: of all amplitudes, of a disturbance's level, of frequencies."""

Values = dict[str, float]
Common = tuple[dict[str, Any], dict[str, Values]]
"""Parameters and effects that the members of a fleet share."""
Draw = Callable[[np.random.Generator, float], Values]
"""Draw of an effect's parameters, given the sampling rate, Hz."""


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


DISTURBANCES: Final[tuple[tuple[str, float, Draw], ...]] = (
    (
        "shaft_harmonics", 0.6,
        lambda rng, fs: {f"level_{k}x": _log(rng, 0.05, 1.5 if k == 1 else 1.0) for k in (1, 2, 3)},
    ),
    ("coloured_noise", 0.4, lambda rng, fs: {"level": _log(rng, 0.2, 2.0), "slope": rng.uniform(-2.0, 2.0)}),
    ("sensor_rolloff", 0.3, lambda rng, fs: {"corner_hz": _log(rng, 0.15, 0.45) * fs}),
    (
        "drive_interference", 0.4,
        lambda rng, fs: {
            "level": _log(rng, 0.1, 1.5), "depth": rng.uniform(0.0, 0.8), "carrier_hz": _log(rng, 0.03, 0.4) * fs,
        },
    ),
    ("looseness", 0.3, lambda rng, fs: {"level": _log(rng, 0.05, 0.6)}),
    ("mains_interference", 0.3, lambda rng, fs: {"level": _log(rng, 0.05, 0.6)}),
)  # fmt: skip
"""Effects of all members of a fleet, the fraction of fleets that have them, and the draw of their values."""


@dataclass(frozen=True)
class Fleets:
    """Distribution of simulated fleets.

    Parameters
    ----------
    population : Population
        Distribution of single machines: the twin, its bearing, conditions and lengths of the real records.
    members : int
        Recordings in a fleet.
    classes : sequence of str
        Classes of the members, "healthy" first.
    disturbances : sequence of (name, fraction, draw)
        Effects that all members have, see `DISTURBANCES`.

    Raises
    ------
    TwingapError
        For a fleet without members.
    """

    population: Population
    members: int
    classes: Sequence[str] = CLASSES
    disturbances: Sequence[tuple[str, float, Draw]] = DISTURBANCES

    def __post_init__(self) -> None:
        if self.members < 1:
            raise TwingapError(f"members = {self.members}, at least 1 expected", where="Fleets")
        if len(self.classes) < 2 or self.classes[0] != "healthy":
            raise TwingapError("classes begin with 'healthy' and name a fault", where="Fleets")

    def fleet(self, number: int, rng: np.random.Generator) -> RecordSet:
        """Records of a random fleet at one operating point, one for each member; each is its own group.

        Parameters
        ----------
        number : int
            Number of the fleet, part of names and groups.
        rng : numpy.random.Generator
        """
        population = self.population
        like = population.conditions[int(rng.integers(len(population.conditions)))]
        healthy = float(rng.choice(HEALTHY_SHARES[0], p=HEALTHY_SHARES[1]))
        for attempt in range(TRIES):
            common = self._common(like.fs_hz, rng)
            try:
                made = [self._member(like, common, f"{number}-{i}", healthy, rng) for i in range(self.members)]
            except TwingapError:  # for instance a mode above half the sampling rate: another fleet is drawn
                if attempt == TRIES - 1:
                    raise
                continue
            if all(np.isfinite(r.samples).all() and np.ptp(r.samples) > 0 for r in made):
                break
        else:
            raise TwingapError("the twin gives no finite vibration", where=f"record {like.name!r}")
        return RecordSet.from_records("simulated fleet", population.unit, population.bearing, made)

    def _common(self, fs_hz: float, rng: np.random.Generator) -> Common:
        values = self.population.drawn_values(rng, FREE_SPREAD) | self._open(fs_hz, rng)
        effects = {name: draw(rng, fs_hz) for name, share, draw in self.disturbances if rng.random() < share}
        effects["second_resonance"] = {
            "frequency_hz": fs_hz * _log(rng, 0.05, 0.45),
            "damping_ratio": _log(rng, 0.01, 0.1),
            "gain": _log(rng, 0.1, 3.0),
        }
        return values, effects

    def _open(self, fs_hz: float, rng: np.random.Generator) -> dict[str, Any]:
        """Random path parameters of the phenomenological twin that its file does not state."""
        if self.population.spec.model != "phenomenological":
            return {}
        known, share = self.population.known, rng.uniform(0.0, 1.0)
        drawn = {
            "resonance_hz": fs_hz * _log(rng, 0.07, 0.45),
            "damping_ratio": _log(rng, 0.01, 0.12),
            "structure_noise_rms": math.sqrt(share),
            "white_noise_rms": math.sqrt(1.0 - share),
        }
        if known & {"structure_noise_rms", "white_noise_rms"}:
            known |= {"structure_noise_rms", "white_noise_rms"}
        return {name: value for name, value in drawn.items() if name not in known}

    def _member(self, like: Condition, common: Common, name: str, healthy: float, rng: np.random.Generator) -> Record:
        fault = "healthy" if rng.random() < healthy else str(rng.choice(np.array(self.classes[1:])))
        condition = dataclasses.replace(
            like,
            name=name,
            group=name,
            fault=fault,
            n_samples=min(like.n_samples, self.population.longest_samples),
            speed_rpm=like.speed_rpm * (1 + SPEED_SPREAD * rng.uniform(-1, 1)),
            extra={},
        )
        return self._twin(condition, common, rng).simulate([condition], rng)[0]

    def _twin(self, condition: Condition, common: Common, rng: np.random.Generator) -> Twin:
        shared, disturbances = common
        fault = str(condition.fault)
        snr_db = float(rng.uniform(*IMPACTS_SNR_DB))
        values = dict(shared)
        if "resonance_hz" in values:
            values["resonance_hz"] *= _factor(PATH_SPREAD, rng)
        values |= self.population.impact_levels(values, condition, snr_db)
        effects: dict[str, Values] = {}
        for name, drawn in disturbances.items():
            effects[name] = {k: v * (_factor(LEVEL_SPREAD, rng) if _is_level(k) else 1.0) for k, v in drawn.items()}
        effects["second_resonance"]["frequency_hz"] *= _factor(PATH_SPREAD, rng)
        wandering = fault == "ball" and rng.random() < WANDERING
        effects |= {
            "slip_jitter": {"sigma": _log(rng, 0.01, 0.3) if wandering else rng.uniform(0.0, 0.02)},
            "impact_scatter": {"sigma": rng.uniform(0.2, 1.5) if wandering else rng.uniform(0.0, 0.5)},
            "load_zone": {"depth": rng.uniform(0.0, 1.0)},
        }
        if rng.random() < 0.25:
            effects["mean_slip"] = {"slip": rng.uniform(-0.01, 0.02)}
        if fault == "healthy":
            if rng.random() < 0.2:
                effects["distributed_roughness"] = _roughness(0.05, 0.3, rng)
        else:
            if rng.random() < ROUGH or snr_db < FAINT_DB:
                effects["distributed_roughness"] = _roughness(0.4, 4.0, rng)
            if rng.random() < 0.25:
                effects["cage_modulation"] = {"depth": rng.uniform(0.0, 0.8)}
            if rng.random() < 0.2:
                effects[effect_name(EntryExit)] = {}
        loudness = _factor(LOUDNESS_SPREAD, rng)
        return self.population.twin(values, effects, loudness)


def _roughness(low: float, high: float, rng: np.random.Generator) -> Values:
    return {"level": _log(rng, low, high), "depth": rng.uniform(0.1, 0.6)}


def _is_level(name: str) -> bool:
    return name.startswith("level") or name == "gain"


def _factor(spread: float, rng: np.random.Generator) -> float:
    return float(np.exp(spread * rng.standard_normal()))
