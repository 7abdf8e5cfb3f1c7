"""Effects on the excitation: when and how hard rollers strike, and what else drives the structure.

On impacts (phenomenological twin) they change angles and amplitudes. On rollers (contact twin) and on a finished
waveform there is no list of impacts: timing becomes a delay of roller train or waveform, strength a gain on the latter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects.angle import at_angles, cosine
from twingap.effects.background import passes_of
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft, Impacts
from twingap.effects.registry import register
from twingap.effects.ringing import response_rms

Array = NDArray[np.float64]

_RANDALL = "Randall & Antoni 2011, Rolling element bearing diagnostics - a tutorial, doi:10.1016/j.ymssp.2010.07.017"
_PAPER1 = "paper 1, Simulation-based remaining useful life prediction of rolling element bearings"
_MCFADDEN = (
    "McFadden & Smith 1984, Model for the vibration produced by a single point defect in a rolling element bearing"
)


_BEFORE: Final = 0.3
"""Part of a pass before the middle of a strike's energy in which nothing of it rings yet."""


class _FaultEffect(Effect):
    """What acts on the strikes of a defect, and so on nothing when the bearing is healthy."""

    stage: ClassVar[Stage] = Stage.EXCITATION

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        if draft.impacts is not None:
            self.on_impacts(draft, draft.impacts, rng)
        elif draft.faulty:
            self.on_waveform(draft, rng)

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        """Change the impacts."""

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        """Change delay and gain of rollers or of a finished waveform with a defect in it."""

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.condition.fault is None:
            return f"the fault of record {draft.condition.name!r} is unknown, so nobody can say when rollers strike"
        return None


def _by_pass(impacts: Impacts) -> tuple[NDArray[np.int64], int]:
    """Place of each impact's pass among the passes, and their number: impacts of one pass share their chances."""
    if impacts.passes.size == 0:
        return impacts.passes, 0
    places = impacts.passes - impacts.passes.min()
    return places, int(places.max()) + 1


def _passes_within(draft: Draft, rng: np.random.Generator) -> tuple[Array, bool]:
    """Angles of the passes in and around a record whose impacts nobody listed, and whether they are the strikes' own.

    Where the strikes of a finished waveform do not stand out, passes come at the stated rate and begin at random.
    """
    found = passes_of(draft.x, draft.turns * draft.fault_order) if draft.still is not None else None
    rate, begin = found or (1.0, -rng.random())
    order = rate * draft.fault_order
    return (np.arange(-2, math.ceil(draft.turns[-1] * order) + 2) + begin) / order, found is not None


@register
@dataclass(frozen=True)
class SlipJitter(_FaultEffect):
    """Impacts come at random angles about their places, or with random spacings that add up.

    Not accumulating (tau_i of eq. 1 of paper 1): sharp lines whose harmonic n falls as exp(-(2 pi n sigma)^2 / 2), and
    a raised floor. Accumulating (D'Elia & Cocconcelli's public code, random slip of the cage): lines broaden as n^2.

    On rollers the roller train is delayed by `sigma` roller spacings, on a finished waveform the waveform by `sigma`
    impact spacings; between passes the delay runs evenly, so the resonance of a waveform wavers by about `sigma`.
    """

    references: ClassVar[tuple[str, ...]] = (
        f"{_PAPER1}, eqs. 1 and 2",
        "Antoni 2007, Cyclic spectral analysis of rolling-element bearing signals: facts and fictions",
        "D'Elia & Cocconcelli, public code for simulated bearing signals (accumulating slip)",
    )
    sigma: float = parameter(
        0.02, unit="impact spacings", plausible=(0.002, 0.1), allowed=(0, 0.5), log=True, doc="std of the spacing"
    )
    accumulating: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), fitted=False, doc="spacings are random rather than places"
    )

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        places, count = _by_pass(impacts)
        late = self.sigma / draft.fault_order * self._lateness(count, rng)
        if self.accumulating:
            # A walk of the train itself: what weighs impacts by shaft angle has to see it.
            impacts.turns = impacts.turns + np.cumsum(late)[places]
        else:
            impacts.delays = late[places] if impacts.delays is None else impacts.delays + late[places]

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        at, known = _passes_within(draft, rng)
        late = self._lateness(at.size, rng)
        # Interpolating at a random place between two independent draws leaves 2/3 of the variance.
        late = np.cumsum(late) if self.accumulating else (1.0 if known else math.sqrt(1.5)) * late
        # A train that is late by one roller spacing is late by 1 / BPFO shaft turns, whatever the defect strikes at.
        order = draft.fault_order
        if draft.excitation == "rollers":
            order = draft.bearing.slipped(draft.cage_speed_ratio)["outer"]
        draft.delay(np.interp(draft.turns, at, self.sigma / order * late))

    def _lateness(self, count: int, rng: np.random.Generator) -> Array:
        """[count] Of variance 1."""
        return rng.standard_normal(count)


@register
@dataclass(frozen=True)
class ImpactScatter(_FaultEffect):
    """Impacts have random, independent strengths of mean 1 (lognormal: none strikes backwards).

    Raises the floor of the envelope spectrum; its harmonics keep their width. On a finished waveform whose strikes
    stand out a gain of each; on rollers and other waveforms one that runs evenly from pass to pass, of the same
    variance at a pass.
    """

    references: ClassVar[tuple[str, ...]] = (f"{_PAPER1}, eqs. 1 and 2 (A_i)",)
    sigma: float = parameter(
        0.2, unit="", plausible=(0.02, 1.0), allowed=(0, 5.0), log=True, doc="std of the strength over its mean"
    )

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        places, count = _by_pass(impacts)
        impacts.amplitudes = impacts.amplitudes * self._strengths(count, self.sigma, rng)[places]

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        at, known = _passes_within(draft, rng)
        if known:  # the gain changes between two strikes, shortly before the later one, and is late where that is
            turns = draft.turns if draft.cage_lag is None else draft.turns - draft.cage_lag
            own = np.searchsorted(at - _BEFORE * (at[1] - at[0]), turns) - 1
            draft.modulate(self._strengths(at.size, self.sigma, rng)[own])
            return
        # The variance that interpolating leaves, as for jitter.
        draft.modulate(np.interp(draft.turns, at, self._strengths(at.size, math.sqrt(1.5) * self.sigma, rng)))

    @staticmethod
    def _strengths(count: int, sigma: float, rng: np.random.Generator) -> Array:
        spread = math.sqrt(math.log1p(sigma**2))
        return np.exp(spread * rng.standard_normal(count) - spread**2 / 2)


@register
@dataclass(frozen=True)
class LoadZone(_FaultEffect):
    """Impacts are weighted by the load where they strike, q = 1 + depth cos(angle); in a zone, by Stribeck's law.

    Loaded is `extent` of the diameter. All of it: the load goes as the cosine. With clearance it is less than half, and
    of the part of the load that a turn changes nothing is left beyond the zone: 1 - (1 - cos(angle)) / (2 extent), or
    nothing (without the exponent of the contact, 3/2 for balls: strikes need not go as the load does).

    A defect of the inner race turns through the load zone at shaft rate, one of a rolling element at cage rate; one of
    the standing outer race stays where it is, and a cage carries no load. Where the record finds the defect is random.
    On rollers it comes on top of the load that the contact model computes itself.
    """

    references: ClassVar[tuple[str, ...]] = (f"{_PAPER1}, eq. 1 (q)", _MCFADDEN)
    depth: float = parameter(
        0.3, unit="", plausible=(0.05, 1.0), allowed=(0, 1), doc="part of the load that a turn changes"
    )
    extent: float = parameter(
        1.0, unit="", plausible=(0.2, 1.0), allowed=(0.05, 1), doc="loaded part of the diameter (Stribeck's epsilon)"
    )

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.amplitudes = impacts.amplitudes * self._weight(draft, impacts.turns, rng)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.modulate(self._weight(draft, draft.turns, rng))

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array | float:
        rates = {"inner": 1.0, "ball": draft.bearing.ftf * draft.cage_speed_ratio}
        rate = rates.get(str(draft.condition.fault))
        if rate is None:
            return 1.0
        around = cosine(rate * turns + rng.random())
        if self.extent >= 1:
            return 1 + self.depth * around
        middle = 2 * self.extent - 1
        edge = math.acos(-middle)  # of the zone; the mean over a turn comes in closed form
        mean = (middle * edge + math.sin(edge)) / math.pi
        return 1 + self.depth * (np.maximum(middle + around, 0.0) / mean - 1)


@register
@dataclass(frozen=True)
class CageModulation(_FaultEffect):
    """All impacts swell and fade once per cage turn, whatever the fault (rollers of unequal size, a worn pocket)."""

    references: ClassVar[tuple[str, ...]] = (_RANDALL,)
    depth: float = parameter(
        0.3, unit="", plausible=(0.05, 1.0), allowed=(0, 1), doc="half the swing of the strength over its mean"
    )

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.amplitudes = impacts.amplitudes * self._weight(draft, impacts.turns, rng)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.modulate(self._weight(draft, draft.turns, rng))

    def _weight(self, draft: Draft, turns: Array, rng: np.random.Generator) -> Array:
        rate = draft.bearing.ftf * draft.cage_speed_ratio
        return 1 + self.depth * cosine(rate * turns + rng.random())


@register
@dataclass(frozen=True)
class EntryExit(_FaultEffect):
    """A defect of finite length: a roller strikes when it enters and again when it leaves.

    The second strike follows at a fixed angle, by which its delay scales with speed: a comb of 1/delay in spectrum and
    cepstrum. The arc lies on the race that is struck, or on the roller's own surface for a ball defect. A contact model
    has edges of its own, so its defect is given another length there instead. A finished waveform whose background is
    not known is repeated whole, its noise too, at that delay.
    """

    references: ClassVar[tuple[str, ...]] = (
        "Sawalhi & Randall 2011, Vibration response of spalled rolling element bearings: observations, simulations and "
        "signal processing techniques to track the spall size",
    )
    arc_deg: float = parameter(
        2.0, unit="deg", plausible=(0.5, 60.0), allowed=(0, 90.0), log=True, doc="length of the defect as an arc"
    )
    exit_ratio: float = parameter(
        1.0, unit="", plausible=(0.3, 5.0), allowed=(0, 100.0), log=True, doc="strength of leaving over entering"
    )
    turned: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), doc="leaving strikes the other way than entering"
    )

    @property
    def _second(self) -> float:
        """The second strike over the first."""
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
        # What strikes already is the stronger of the two: nobody meant it to be the fainter.
        turned, apart = -1 if self.turned else 1, self.delay_turns(draft)
        ratio, apart = (self.exit_ratio, apart) if self.exit_ratio <= 1 else (1 / self.exit_ratio, -apart)
        draft.x = draft.x + turned * ratio * at_angles(draft.x, draft.turns, draft.turns - apart)

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation == "rollers":
            return "the contact model's defect has an entry and an exit of its own: give it another length instead"
        return super().cannot_act_on(draft)


@register
@dataclass(frozen=True)
class DistributedRoughness(Effect):
    """A rough or worn race: broadband force that swells with rotation, without any discrete impact.

    Cyclostationary of second order at shaft rate (envelope line), with no first-order line. In every record, healthy or
    not. Needs a path: a finished waveform has none.
    """

    stage: ClassVar[Stage] = Stage.EXCITATION
    references: ClassVar[tuple[str, ...]] = (
        "Antoni & Randall 2003, A stochastic model for simulation and diagnostics of rolling element bearings with "
        "localized faults (extended faults)",
        _RANDALL,
    )
    level: float = parameter(
        0.7, unit="healthy rms", plausible=(0.1, 5.0), log=True,
        doc="rms of the response through the twin's own mode, before what else lies on its path",
    )  # fmt: skip
    depth: float = parameter(0.7, unit="", plausible=(0.1, 1.0), allowed=(0, 1), doc="half the swing over a turn")

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        force = rng.standard_normal(draft.t.size)
        swell = self._swell(draft.turns + rng.random())
        rms = math.sqrt(1 + self.depth**2 / 2) * response_rms(draft.modes, draft.condition.fs_hz)
        swell *= self.level * draft.reference_rms / rms
        force *= swell
        draft.push(force, rng, abs(float(swell[0])))

    def _swell(self, turns: Array) -> Array:
        """[samples] Of mean square 1 + depth^2 / 2 over a turn."""
        return 1 + self.depth * cosine(turns)

    def cannot_act_on(self, draft: Draft) -> str | None:
        if draft.excitation == "waveform":
            return "a finished waveform has no path that a force could pass through"
        return None


@register
@dataclass(frozen=True)
class SpeedGain(Effect):
    """All excitation is stronger or weaker with speed, S = (speed / reference)^exponent, at the record's mean speed.

    Eq. 10 of paper 1 with c constant is exponent 1. The shape of a record stays. White noise of the measuring chain and
    disturbances do not change. What a bearing without a defect does may depend on speed less than strikes do.
    """

    stage: ClassVar[Stage] = Stage.EXCITATION
    references: ClassVar[tuple[str, ...]] = (f"{_PAPER1}, eqs. 1 and 10",)
    exponent: float = parameter(
        1.0, unit="", plausible=(-1.0, 3.0), allowed=(-10, 10), doc="power of the speed; 0 is no influence"
    )
    on_noise: float = parameter(
        1.0, unit="", plausible=(0.0, 1.0), allowed=(0, 1), doc="structure noise follows by this part of the exponent"
    )
    reference_speed_rpm: float = parameter(
        1800.0, unit="rpm", plausible=(100.0, 10000.0), allowed=(1e-3, 1e7), log=True, fitted=False,
        doc="speed at which the gain is 1",
    )  # fmt: skip

    def gain(self, speed_rpm: float) -> float:
        """S at this speed."""
        return float((speed_rpm / self.reference_speed_rpm) ** self.exponent)

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        gain = self.gain(draft.condition.speed_rpm)
        on_noise = gain**self.on_noise
        if draft.impacts is not None:
            draft.impacts.amplitudes = draft.impacts.amplitudes * gain
        draft.amplify_force(on_noise)
        if draft.excitation != "impacts":
            draft.modulate(gain if draft.faulty else on_noise)
        if draft.still is not None:
            draft.still = draft.still * on_noise


@register
@dataclass(frozen=True)
class DamageGrowth(_FaultEffect):
    """Impacts grow along a run, D = exp(rate (time_s - onset)); 1 before the onset.

    Records without `time_s` are not part of a run, and do not change.
    """

    references: ClassVar[tuple[str, ...]] = (f"{_PAPER1}, eqs. 1 and 12",)
    rate_per_s: float = parameter(
        1e-3, unit="1/s", plausible=(1e-6, 1e-2), allowed=(-1.0, 1.0), log=True, doc="relative growth per second"
    )
    onset_s: float = parameter(
        0.0, unit="s", plausible=(0.0, 1e6), allowed=(-1e12, 1e12), doc="time_s from which the amplitude grows"
    )

    def growth(self, draft: Draft) -> float:
        """D of this record."""
        if draft.condition.time_s is None:
            return 1.0
        # exp(50) is beyond any sensor; it only keeps numbers finite.
        return math.exp(min(self.rate_per_s * max(draft.condition.time_s - self.onset_s, 0.0), 50.0))

    def on_impacts(self, draft: Draft, impacts: Impacts, rng: np.random.Generator) -> None:
        impacts.amplitudes = impacts.amplitudes * self.growth(draft)

    def on_waveform(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.modulate(self.growth(draft))
