"""How shafts, cages and rollers of machines turn and strike otherwise than the catalogue has it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Draft, Effect, excitation, shaft
from twingap.effects.angle import cosine
from twingap.effects.draft import Impacts
from twingap.gap.knowledge.effect_variants.maker import Maker
from twingap.gap.knowledge.machines import Machine

Array = NDArray[np.float64]

_AROUND: Final = np.arange(720) / 720
_PUSH: Final = np.linspace(-2.4, 2.4, 13)
"""Standard deviations about its middle at which a push is made of blows."""


@dataclass(frozen=True)
class SpeedFluctuation(shaft.SpeedFluctuation):
    """A governor that hunts while the shaft runs up or down: one wave and a ramp.

    Parameters
    ----------
    ramp : float
        Part of the variance that the ramp has.
    """

    ramp: float = 0.0

    def _wander(self, rng: np.random.Generator) -> Callable[[Array], Array]:
        hz, phase, sign = self.bandwidth_hz * rng.uniform(0.2, 1.0), 2 * np.pi * rng.random(), rng.choice((-1.0, 1.0))

        def over(t: Array) -> Array:
            wave = math.sqrt(2 * (1 - self.ramp)) * np.cos(2 * np.pi * hz * t + phase)
            return np.asarray(wave + sign * math.sqrt(3 * self.ramp) * np.linspace(-1, 1, t.size))

        return over


@dataclass(frozen=True)
class SlipJitter(excitation.SlipJitter):
    """Spacings that are evenly spread, or seldom far off, rather than normal.

    Parameters
    ----------
    even : bool
    """

    even: bool = True

    def _lateness(self, count: int, rng: np.random.Generator) -> Array:
        return rng.uniform(-1, 1, count) * math.sqrt(3) if self.even else rng.laplace(size=count) / math.sqrt(2)


@dataclass(frozen=True)
class ImpactScatter(excitation.ImpactScatter):
    """Strengths of a gamma distribution: many weak ones, few strong ones."""

    @staticmethod
    def _strengths(count: int, sigma: float, rng: np.random.Generator) -> Array:
        return rng.gamma(1 / sigma**2, sigma**2, count)


@dataclass(frozen=True)
class LoadZone(excitation.LoadZone):
    """Strikes that follow the load of point contacts in its zone (Stribeck's distribution with Hertz's exponent)."""

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array | float:
        rates = {"inner": 1.0, "ball": draft.bearing.ftf * draft.cage_speed_ratio}
        rate = rates.get(str(draft.condition.fault))
        if rate is None:
            return 1.0
        load, mean = (_stribeck(at, self.extent) for at in (rate * turns + rng.random(), _AROUND))
        return np.asarray(1 + self.depth * (load / mean.mean() - 1))


def _stribeck(turns: Array, extent: float) -> Array:
    return np.asarray(np.maximum(1 - (1 - cosine(turns)) / (2 * extent), 0.0) ** 1.5)


@dataclass(frozen=True)
class CageModulation(excitation.CageModulation):
    """One roller larger than the rest: strikes swell in a short part of the cage's turn.

    Parameters
    ----------
    sharp : float
        Concentration of the swelling (von Mises).
    """

    sharp: float = 1.0

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array:
        rate = draft.bearing.ftf * draft.cage_speed_ratio
        bump, low = np.exp(self.sharp * (cosine(rate * turns + rng.random()) - 1)), math.exp(-2 * self.sharp)
        return np.asarray(1 + self.depth * (2 * (bump - low) / (1 - low) - 1))


@dataclass(frozen=True)
class EntryExit(excitation.EntryExit):
    """Defects that take as much of a pass on a roller as on a race, and whose fainter strike is a push.

    A roller rolls into a defect and is stopped by its end (Sawalhi & Randall 2011): one of the two takes longer, and
    has less at high frequencies.

    Parameters
    ----------
    pass_part : float
        Length of every defect as a part of one roller's pass; 0 is `arc_deg` for all.
    soft : float
        Standard deviation of the fainter strike over time, parts of the time between both; 0 is a blow.
    """

    pass_part: float = 0.0
    soft: float = 0.0

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        if not self.soft:
            super().on_impacts(draft, impacts, rng)
            return
        delay = self.delay_turns(draft)
        blow, push = (0.0, delay) if self.exit_ratio <= 1 else (delay, 0.0)
        weight = np.exp(-0.5 * _PUSH**2)
        faint, loud = sorted((1.0, self.exit_ratio))
        turned = -1.0 if self.turned else 1.0
        places = np.concatenate(([blow], push + self.soft * delay * _PUSH))
        heights = np.concatenate(([loud], turned * faint * weight / weight.sum()))
        turns, amplitudes, copies = impacts.turns, impacts.amplitudes, places.size
        impacts.turns = (places[:, None] + turns).ravel()
        impacts.amplitudes = (heights[:, None] * amplitudes).ravel()
        impacts.passes = np.tile(impacts.passes, copies)
        if impacts.delays is not None:
            impacts.delays = np.tile(impacts.delays, copies)

    def delay_turns(self, draft: Draft) -> float:
        """Shaft turns between entering and leaving."""
        return self.pass_part / draft.fault_order if self.pass_part else super().delay_turns(draft)


@dataclass(frozen=True)
class DistributedRoughness(excitation.DistributedRoughness):
    """Roughness that is felt in the load zone alone.

    Parameters
    ----------
    extent : float
        See `LoadZone`.
    """

    extent: float = 0.5

    def _swell(self, turns: Array) -> Array:
        load, of_turn = (_stribeck(at, self.extent) for at in (turns, _AROUND))
        swing = (load - of_turn.mean()) / max(float(of_turn.std()), 1e-9)
        return np.asarray(1 + self.depth / math.sqrt(2) * swing)


@dataclass(frozen=True)
class SpeedGain(excitation.SpeedGain):
    """A gain that no power of the speed describes: it bends.

    Parameters
    ----------
    bend : float
        Of the logarithm of the gain over the squared logarithm of the speed.
    """

    bend: float = 0.0

    def gain(self, speed_rpm: float) -> float:
        """S at this speed."""
        log = math.log(speed_rpm / self.reference_speed_rpm)
        return math.exp(self.exponent * log + self.bend * min(log * log, 1.0))


@dataclass(frozen=True)
class DamageGrowth(excitation.DamageGrowth):
    """Damage that grows with a power of time, to the same end.

    Parameters
    ----------
    until_s : float
        End of the run.
    power : float
    """

    until_s: float = 0.0
    power: float = 1.0

    def growth(self, draft: Draft) -> float:
        """D of this record."""
        span = self.until_s - self.onset_s
        if draft.condition.time_s is None or span <= 0:
            return 1.0
        done = max(draft.condition.time_s - self.onset_s, 0.0) / span
        return float(1 + math.expm1(min(self.rate_per_s * span, 50.0)) * done**self.power)


def _wave_and_ramp(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return SpeedFluctuation(**values, ramp=rng.uniform(0, 1) if rng.random() < 0.6 else 0.0)


def _own_spacings(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return SlipJitter(**values, even=bool(rng.random() < 0.5))


def _gamma(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return ImpactScatter(**values)


def _zone(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return LoadZone(**{**values, "extent": min(values["extent"], rng.uniform(0.25, 0.8))})


def _one_roller(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return CageModulation(**values, sharp=math.exp(rng.uniform(math.log(0.5), math.log(8))))


def _of_a_pass(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    # Of one length in degrees a ball's is short beside a race's: what is alike is rather how long passes take.
    part = values["arc_deg"] * machine.bearing.n_rollers / 360
    soft = math.exp(rng.uniform(math.log(0.02), math.log(0.2))) if rng.random() < 0.8 else 0.0
    return EntryExit(**values, pass_part=part if part < 0.5 and rng.random() < 0.6 else 0.0, soft=soft)


def _rough_zone(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return DistributedRoughness(**values, extent=rng.uniform(0.3, 0.9))


def _bent(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect:
    return SpeedGain(**values, bend=values["exponent"] * rng.normal(0, 0.5))


def _grown(values: dict[str, Any], machine: Machine, rng: np.random.Generator) -> Effect | None:
    times = [c.time_s for c in machine.conditions if c.time_s is not None]
    if not times or max(times) <= values["onset_s"]:
        return None
    return DamageGrowth(**values, until_s=max(times), power=float(rng.choice([0.5, 1.0, 2.0, 4.0])))


OTHERWISE: Final[Mapping[str, Maker]] = {
    "speed_fluctuation": _wave_and_ramp, "slip_jitter": _own_spacings,
    "impact_scatter": _gamma, "load_zone": _zone, "cage_modulation": _one_roller, "entry_exit": _of_a_pass,
    "distributed_roughness": _rough_zone, "speed_gain": _bent, "damage_growth": _grown,
}  # fmt: skip
