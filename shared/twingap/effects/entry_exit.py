"""Two impacts per pass, at the entry and the exit of a defect of finite length."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from twingap.effects import measurements
from twingap.effects._fault_effect import FaultEffect
from twingap.effects._features import LEVELS_OF_IMPACTS
from twingap.effects.angle import at_angles
from twingap.effects.base import Effect, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.drawing import faults, log_uniform
from twingap.effects.machine import Machine
from twingap.effects.observations import Observations
from twingap.effects.registry import register

_LONGEST: Final = 0.42
"""Longest defects that are drawn, as a part of a pass: beyond half a pass, exit and next entry change roles."""
_SHORTEST: Final = 0.036
"""Arc of the shortest defects over that of the longest: 1.5 to 42 % of a pass."""
_DELAYS: Final = (0.06, 0.11, 0.17, 0.24, 0.32, 0.41)
"""Parts of a pass after the first impact at which a search tries the second one. More take more simulations."""
_SOFT: Final = np.linspace(-2.4, 2.4, 13)
"""Places, standard deviations, of the sharp impacts that make a soft one. More are smoother and slower."""


@register
@dataclass(frozen=True)
class EntryExit(FaultEffect):
    """A defect of finite length: one impact when a roller enters it and another when the roller leaves it.

    The second impact follows at a fixed angle, so that its delay decreases with speed: a comb of 1/delay in spectrum
    and cepstrum. The arc is on the race with the defect, or on the roller's surface for a ball defect. The contact
    model has edges of its own; its defect has a length parameter instead. A finished waveform whose background is not
    known is added at that delay, noise included.
    """

    references: ClassVar[tuple[str, ...]] = (
        "Sawalhi & Randall 2011, Vibration response of spalled rolling element bearings: observations, simulations and "
        "signal processing techniques to track the spall size",
    )
    group: ClassVar[str] = "impact statistics"
    look_alikes: ClassVar[tuple[str, ...]] = ("second_resonance", "sensor_rolloff", "slip_jitter")
    deciding_measurement: ClassVar[str] = measurements.LONGER
    features: ClassVar[tuple[str, ...]] = (
        *LEVELS_OF_IMPACTS, "impacts.second_impact_gain", "impacts.arc_*", "impacts.exit_ratio", "impacts.cycle_*",
        "impacts.timing_*", "impacts.jitter_sigma", "background.echo_*", "shape|faulty_*", "impulse_response|*",
        "impulse_response.*", "comb|*", "background.time_asymmetry", "background.band_*", "lines.fault_*",
        "change|*",
    )  # fmt: skip
    draw_weight: ClassVar[float] = 1.8
    inherent_in: ClassVar[tuple[str, ...]] = ("contact",)

    arc_deg: float = parameter(
        2.0, unit="deg", plausible=(0.5, 60.0), allowed=(0, 90.0), log=True, doc="length of the defect as an arc"
    )
    exit_ratio: float = parameter(
        1.0, unit="", plausible=(0.3, 5.0), allowed=(0, 100.0), log=True, strength=True,
        doc="strength of the exit impact over that of the entry impact",
    )  # fmt: skip
    turned: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), doc="whether the exit impact has the opposite sign"
    )

    @property
    def _second(self) -> float:
        """The second impact over the first."""
        return -self.exit_ratio if self.turned else self.exit_ratio

    def delay_turns(self, draft: Draft) -> float:
        """Shaft turns between entering and leaving."""
        cage = draft.bearing.ftf * draft.cage_speed_ratio
        # Turns of the one body over the other per turn of the shaft. A cage defect is taken to ride past the shaft.
        rates = {"outer": cage, "inner": 1 - cage, "ball": draft.fault_order / 2, "cage": 1 - cage}
        return self.arc_deg / 360 / rates[str(draft.condition.fault)]

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.turns = np.concatenate((impacts.turns, impacts.turns + self.delay_turns(draft)))
        impacts.amplitudes = np.concatenate((impacts.amplitudes, self._second * impacts.amplitudes))
        impacts.passes = np.tile(impacts.passes, 2)
        if impacts.delays is not None:
            impacts.delays = np.tile(impacts.delays, 2)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        # The existing impacts are the stronger of the two.
        turned, apart = -1 if self.turned else 1, self.delay_turns(draft)
        ratio, apart = (self.exit_ratio, apart) if self.exit_ratio <= 1 else (1 / self.exit_ratio, -apart)
        draft.x = draft.x + turned * ratio * at_angles(draft.x, draft.turns, draft.turns - apart)

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation == "rollers":
            return "the contact model's defect has an entry and an exit of its own: change its length instead"
        return super().cannot_act_on(draft)

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        """Arcs from a change of one impact's shape to nearly half a pass, on the race where there is one."""
        if not faults(machine):
            return None
        race, bearing = 360 / machine.bearing.n_rollers, machine.bearing
        longest = _LONGEST * (race if faults(machine) - {"ball"} else 180.0)
        # Arcs whose impacts fall within two samples at every speed show nowhere.
        seen = [
            2 * (180.0 if c.fault == "ball" else race) * bearing.fault_order(str(c.fault)) * c.speed_rpm / 60 / c.fs_hz
            for c in machine.conditions if c.fault != "healthy"
        ]  # fmt: skip
        shortest = max(min(seen), longest * _SHORTEST)
        arc_deg, turned = min(log_uniform(rng, shortest, longest), 80.0), bool(rng.random() < 0.4)
        return {"arc_deg": arc_deg, "exit_ratio": log_uniform(rng, 0.14, 7.0), "turned": turned}

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect:
        # Arcs in degrees differ between ball and race; their parts of a pass are more alike.
        part = self.arc_deg * machine.bearing.n_rollers / 360
        soft = math.exp(rng.uniform(math.log(0.02), math.log(0.2))) if rng.random() < 0.8 else 0.0
        pass_part = part if part < 0.5 and rng.random() < 0.6 else 0.0
        return SoftEntryExit(**self.parameter_values(), pass_part=pass_part, soft=soft)

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        pass_deg = 360 / seen.bearing.n_rollers
        read = ("comb|clear_arc_log", "comb|faint_arc_log", "impacts.arc_log|all.level")
        arcs = [seen.features[name] for name in read]
        part = seen.features["impacts.cycle_rise_part|all.level"]
        if part > 0:
            arcs += [math.log(part * pass_deg), math.log(part * 180)]
        for arc in (arc for arc in arcs if math.isfinite(arc)):
            for turned in (False, True):
                yield self.moved(arc_deg=math.exp(arc), exit_ratio=1.0, turned=turned)
        passes = [pass_deg] * bool(seen.faults - {"ball"}) + [180.0] * ("ball" in seen.faults)
        for arc_deg in [part * one for one in passes for part in _DELAYS]:
            for ratio in (0.5, 1.8):
                for turned in (False, True):
                    yield self.moved(arc_deg=arc_deg, exit_ratio=ratio, turned=turned)


@dataclass(frozen=True)
class SoftEntryExit(EntryExit):
    """Defects that last the same part of a pass on rollers and races, and whose fainter impact is soft.

    A roller rolls into a defect and is stopped by its end (Sawalhi & Randall 2011): one of the two impacts takes
    longer, and has less power at high frequencies.

    Parameters
    ----------
    pass_part : float
        Length of every defect as a part of one roller's pass; 0 is `arc_deg` for all.
    soft : float
        Standard deviation of the fainter impact over time, parts of the time between both; 0 is an impulse.
    """

    pass_part: float = 0.0
    soft: float = 0.0

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        if not self.soft:
            super().on_impacts(draft, impacts, rng)
            return
        delay = self.delay_turns(draft)
        sharp, soft = (0.0, delay) if self.exit_ratio <= 1 else (delay, 0.0)
        weight = np.exp(-0.5 * _SOFT**2)
        faint, loud = sorted((1.0, self.exit_ratio))
        turned = -1.0 if self.turned else 1.0
        places = np.concatenate(([sharp], soft + self.soft * delay * _SOFT))
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
