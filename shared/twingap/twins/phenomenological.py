"""The phenomenological twin: impacts through one damped mode, and two noises.

fault order -> impact angles -> (effects) -> impact times ------+
                                                                +--> mode(s) --> x --> + white noise
structure noise: white force ----------------> (effects) -------+

The baseline (no effects) is that of the record-set specification: impacts strictly periodic in shaft angle, of equal
amplitude, through h(t) = exp(-zeta w t) sin(sqrt(1 - zeta^2) w t); healthy records have the two noises only. Eq. 1 of
paper 1 (Simulation-based remaining useful life prediction of rolling element bearings under varying operating
conditions) is one chain of effects over it, `paper1_chain`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from twingap.bearing import FAULTS, Bearing
from twingap.effects import (
    DamageGrowth,
    Draft,
    Effect,
    Impacts,
    ImpactScatter,
    LoadZone,
    Mode,
    SlipJitter,
    SpeedGain,
)
from twingap.effects.modes import LEAD, modal_response, response_rms
from twingap.errors import TwingapError
from twingap.streams import Streams
from twingap.twins.base import Twin

LONGEST_RINGING_S = 0.3
"""Time before a record from which impacts are simulated, s, for the response of modes that effects add."""


@dataclass(frozen=True)
class PhenomenologicalParameters:
    """The free parameters of the phenomenological twin.

    Amplitudes and noise levels are multiples of `scale`, so that one number calibrates the twin to another sensor or
    unit. That leaves one of them free; the convention that removes it is structure_noise_rms^2 + white_noise_rms^2 = 1,
    which the defaults meet and identification keeps: then `scale` is the RMS of healthy vibration. Values that break
    the convention still simulate, with a healthy RMS of scale sqrt(structure_noise_rms^2 + white_noise_rms^2).

    Parameters
    ----------
    resonance_hz : float
        Natural frequency w / (2 pi) of the mode, Hz.
    damping_ratio : float
        zeta, between 0 and 1 (exclusive).
    impact_amplitude : dict[str, float]
        Fault -> A, the factor of h in the response A h(t) to one impact, in multiples of `scale`. The same at every
        sampling rate. A fault that is absent cannot be simulated.
    structure_noise_rms : float
        RMS of the white force's response, that is after the mode, in multiples of `scale`.
    white_noise_rms : float
        RMS of the white noise, in multiples of `scale`.
    scale : float
        Unit of all amplitudes, in the unit of the records.

    Raises
    ------
    TwingapError
        For a value that no machine can have.
    """

    resonance_hz: float = 3400.0
    damping_ratio: float = 0.05
    impact_amplitude: dict[str, float] = field(
        default_factory=lambda: {"inner": 8.0, "outer": 8.0, "ball": 5.0, "cage": 5.0}
    )
    structure_noise_rms: float = 0.8
    white_noise_rms: float = 0.6
    scale: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "impact_amplitude", dict(self.impact_amplitude))
        for fault in self.impact_amplitude:
            if fault not in FAULTS or fault == "healthy":
                raise TwingapError(
                    f"impact_amplitude for unknown fault {fault!r}",
                    where="parameters",
                    mend=f"use {', '.join(FAULTS[1:])}",
                )
        positive = {"resonance_hz": self.resonance_hz, "damping_ratio": self.damping_ratio, "scale": self.scale}
        levels = {"structure_noise_rms": self.structure_noise_rms, "white_noise_rms": self.white_noise_rms}
        levels |= {f"impact_amplitude.{fault}": value for fault, value in self.impact_amplitude.items()}
        for name, value in (positive | levels).items():
            if not math.isfinite(value) or value < 0 or (name in positive and value == 0):
                wanted = "a positive number" if name in positive else "a number of at least 0"
                raise TwingapError(f"{name} = {value!r}, {wanted} expected", where="parameters")
        if self.damping_ratio >= 1:
            raise TwingapError(f"damping_ratio = {self.damping_ratio!r}, below 1 expected", where="parameters")
        if self.structure_noise_rms == self.white_noise_rms == 0:
            raise TwingapError(
                "both noises are 0",
                where="parameters",
                mend="give one a small level, since effects are relative to healthy vibration",
            )

    @property
    def mode(self) -> Mode:
        """Mode of the baseline, for impacts in units of `scale`."""
        return Mode(self.resonance_hz, self.damping_ratio)

    @property
    def reference_rms(self) -> float:
        """RMS of healthy vibration, in the unit of the records."""
        return self.scale * math.hypot(self.structure_noise_rms, self.white_noise_rms)


class PhenomenologicalTwin(Twin):
    """Impacts through one damped mode, plus structure noise and white noise.

    Parameters
    ----------
    bearing : Bearing
        Geometry of the bearing under test.
    parameters : PhenomenologicalParameters
    effects : iterable of Effect
        What is modelled beyond the baseline.
    unit : str
        Unit of the samples.

    Notes
    -----
    Random streams of a record: "impact_phase" (the first impact's angle), "structure_noise", "white_noise", and one for
    each effect by its name.
    """

    model: ClassVar[str] = "phenomenological"

    def __init__(
        self,
        bearing: Bearing,
        parameters: PhenomenologicalParameters | None = None,
        effects: Iterable[Effect] = (),
        unit: str = "m/s^2",
    ) -> None:
        super().__init__(bearing, effects, unit)
        self.parameters = parameters or PhenomenologicalParameters()

    @property
    def reference_rms(self) -> float:
        """RMS of healthy vibration, in `unit`."""
        return self.parameters.reference_rms

    @property
    def white_noise_rms(self) -> float:
        """RMS of the measuring chain's white noise, in `unit`."""
        return self.parameters.scale * self.parameters.white_noise_rms

    def excite(self, draft: Draft, streams: Streams) -> None:
        """Set the impacts and draw the force of the structure noise."""
        own, condition = self.parameters, draft.condition
        where = f"record {condition.name!r}"
        if condition.fault is None:
            raise TwingapError("the fault is unknown, so nothing can be simulated", where=where, mend="give its fault")
        if own.resonance_hz >= condition.fs_hz / 2:
            raise TwingapError(
                f"the resonance at {own.resonance_hz:g} Hz lies above half the sampling rate of {condition.fs_hz:g} Hz",
                where=where, mend="raise fs_hz or lower resonance_hz",
            )  # fmt: skip
        draft.modes.append(own.mode)
        if own.structure_noise_rms * draft.own_noise > 0:
            force, rng = streams.normal("structure_noise", condition.n_samples)
            rms = draft.own_noise * own.scale * own.structure_noise_rms / response_rms(draft.modes, condition.fs_hz)
            draft.push(rms * force, rng, rms)
        if draft.faulty:
            if condition.fault not in own.impact_amplitude:
                raise TwingapError(
                    f"no impact amplitude for fault {condition.fault!r}",
                    where=where, mend=f"add impact_amplitude.{condition.fault} to the twin's parameters",
                )  # fmt: skip
            amplitude = own.scale * own.impact_amplitude[condition.fault]
            draft.impacts = periodic_impacts(draft, amplitude, streams("impact_phase").random())

    def respond(self, drafts: Sequence[Draft]) -> None:
        """Response of the modes to impacts and force, then filters."""
        for draft in drafts:
            condition, impacts = draft.condition, draft.impacts
            times = amplitudes = None
            if impacts is not None:
                times, amplitudes = draft.when(impacts.delayed_turns) + LEAD / condition.fs_hz, impacts.amplitudes
            x = modal_response(
                draft.modes, condition.fs_hz, LEAD + condition.n_samples, times, amplitudes, draft.force, draft.past
            )
            for act in draft.filters:
                x = act(x)
            draft.x = x[LEAD:]


def paper1_chain(
    rate_per_s: float = 1e-3, onset_s: float = 0.0, reference_speed_rpm: float = 1000.0
) -> tuple[Effect, ...]:
    """Effects of eq. 1 of paper 1 on the baseline: x_k(t) = S(k) D(k) sum_i h(t - i T - tau_i) q(i T) A_i + n(t).

    Where the paper gives no value, usual published ones: q = 1 + 0.3 cos at shaft rate, impacts late by 2 % of their
    spacing (not accumulating), strengths scattered by 10 %. n(t) is the baseline's noise.

    Parameters
    ----------
    rate_per_s : float
        a of eq. 12, per second of `time_s`.
    onset_s : float
        Time of K_anomaly in eq. 12.
    reference_speed_rpm : float
        Speed at which S = 1; eq. 10 with c constant. The slowest of the paper's test is the default.

    Returns
    -------
    tuple of Effect
        S, D, tau, q, A.
    """
    return (
        SpeedGain(exponent=1.0, reference_speed_rpm=reference_speed_rpm),
        DamageGrowth(rate_per_s=rate_per_s, onset_s=onset_s),
        SlipJitter(sigma=0.02),
        LoadZone(depth=0.3),
        ImpactScatter(sigma=0.1),
    )


def periodic_impacts(draft: Draft, amplitude: float, phase: float) -> Impacts:
    """Equal impacts, strictly periodic in shaft angle at the record's fault order.

    Parameters
    ----------
    draft : Draft
    amplitude : float
        Of each, in record units.
    phase : float
        Angle of the first impact in the record, in spacings, between 0 and 1.

    Returns
    -------
    Impacts
        From long enough before the record for all ringing to be there, to a few beyond its end, so that effects which
        move impacts (accumulating jitter, as its walk grows with the square root of their number) do not run out.
    """
    order = draft.fault_order
    if order <= 0:
        raise TwingapError(
            f"fault {draft.condition.fault!r} has impacts at order {order:g} with this slip",
            where=f"record {draft.condition.name!r}", mend="let the cage slip less",
        )  # fmt: skip
    lead_s = max([LONGEST_RINGING_S, *(mode.ring_down_s for mode in draft.modes)])
    inside = math.ceil(draft.turns[-1] * order)
    before = math.ceil(lead_s * draft.shaft_hz * order) + 2
    after = 4 + math.ceil(2 * math.sqrt(before + inside))
    passes = np.arange(-before, inside + after, dtype=np.int64)
    return Impacts((passes + phase) / order, np.full(passes.size, amplitude), passes)
