"""Simulators that a diagnosis can question: the same conditions, the same chances, other effects.

conditions + effects --TwinSimulator--> the twin with those effects, streams by record and replicate --> records
                     --OwnSimulator---> the user's simulated records nearest in condition, brought to its rate and
                                        length, and to its speed where theirs is not near, effects on the
                                        finished waveform ---------------------------------------------> records

What a record draws depends on the root, the replicate, its condition's name and the purpose alone: records simulated
with and without an effect differ by that effect and by nothing else.
"""

from __future__ import annotations

import copy
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects import Draft, Effect, Stage, apply_to_waveform, catalogue, make_effect
from twingap.effects.angle import at_angles
from twingap.effects.ringing import LEAD
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.streams import Streams
from twingap.twins.base import Twin
from twingap.twins.twin_file import Model, TwinSpec, build_twin, register_model

Array = NDArray[np.float64]

NEAR_SPEED: Final = 0.06
"""Log ratio of speeds up to which a simulated record keeps its own: what is compared goes by each record's orders, and
resampling would move its resonances."""
SAME_GAIN: Final = math.log(1.1)
"""Log ratio of levels below which records in one unit are taken to be of one gain."""
_OTHER_FAULT = 1e6


class Simulator(Protocol):
    """What a diagnosis needs of whatever makes the simulated records.

    Attributes
    ----------
    name : str
        For people.
    has : tuple[str, ...]
        Effects that it models already.
    """

    name: str
    has: tuple[str, ...]

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """One record per condition, with these effects besides what it models already.

        Parameters
        ----------
        effects : tuple of Effect
            One that it has already is not added again.
        conditions : sequence of Condition
        streams_root : int
            Entropy of all chances: the same root gives the same chances whatever the effects.
        replicate : int
            Number of the repetition, from 0: each has chances of its own.
        """
        ...

    def can_add(self, name: str) -> str | None:
        """Why an effect cannot be added, None when it can."""
        ...


def streams_of(condition: Condition, streams_root: int, replicate: int) -> Streams:
    """The random streams of one record: they depend on its name, not on what else is simulated with it."""
    return Streams(streams_root, (replicate << 32) | zlib.crc32(condition.name.encode()))


def _why_not(name: str, draft: Draft) -> str | None:
    try:
        return make_effect(name).cannot_act_on(draft)
    except TwingapError as error:
        return error.what


class TwinSimulator:
    """A twin file's twin, with effects added to it.

    Parameters
    ----------
    spec : TwinSpec
        With all its parameters.
    bearing : Bearing, optional
        Of the records; the file's own when absent.
    unit : str
        Of the records.
    conditions : sequence of Condition, optional
        Those to be simulated, for `can_add` to ask about.

    Raises
    ------
    TwingapError
        For a twin that cannot be built.
    """

    def __init__(
        self,
        spec: TwinSpec,
        bearing: Bearing | None = None,
        unit: str = "m/s^2",
        conditions: Sequence[Condition] = (),
    ) -> None:
        self.spec, self.unit = spec, unit
        self.twin = build_twin(spec, bearing, unit)
        self.bearing = self.twin.bearing
        self.name = spec.model
        self.has = tuple(effect.name for effect in self.twin.effects)
        self.conditions = tuple(conditions)

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """See `Simulator.simulate`."""
        twin = self._with(effects)
        streams = [streams_of(c, streams_root, replicate) for c in conditions]
        out: list[Record] = []
        for begin in range(0, len(conditions), twin.batch):
            end = begin + twin.batch
            out += twin.make(conditions[begin:end], streams[begin:end])
        return out

    def _with(self, effects: tuple[Effect, ...]) -> Twin:
        more = [e for e in effects if e.name not in self.has]
        if not more:
            return self.twin
        twin = build_twin(self.spec, self.bearing, self.unit)
        return _chained(twin, (*twin.effects, *more))

    def can_add(self, name: str) -> str | None:
        """See `Simulator.can_add`."""
        if name in self.has:
            return "the twin already has it"
        if name in self.twin.inherent_effects:
            return "it follows from the twin's own physics"
        return _reason(name, self.conditions, self.bearing, self.twin.reference_rms, self.twin.excitation)


def _chained(twin: Twin, effects: tuple[Effect, ...]) -> Twin:
    """The same twin with another chain; it is nobody else's, so it may be changed."""
    from twingap.effects import in_order

    twin.effects = in_order(effects)
    return twin


def _reason(
    name: str,
    conditions: Sequence[Condition],
    bearing: Bearing,
    reference_rms: float,
    excitation: Literal["impacts", "rollers", "waveform"],
) -> str | None:
    """Why an effect cannot act on any record of these conditions, None when it can act on one.

    What its default parameters forbid on single conditions (a carrier above half the rate), other parameters may allow;
    so only reasons that do not go with the rate count.
    """
    if name not in catalogue():
        return f"unknown effect {name!r}"
    asked = conditions or (Condition("any", 1800.0, 1e6, 64, "inner"),)
    reasons = set()
    for fault in dict.fromkeys(c.fault for c in asked):
        condition = Condition("any", 1800.0, 1e6, 64, fault)
        t = np.arange(64) / condition.fs_hz
        draft = Draft(condition, bearing, reference_rms, t, t * 30.0, excitation=excitation)
        reason = _why_not(name, draft)
        if reason is None:
            return None
        reasons.add(reason)
    return min(reasons)


# ----------------------------------------------------------------------------------------- the user's simulated records


class OwnSimulator:
    """Records of a simulator of the user's own, as far as they can be brought to the real conditions.

    Parameters
    ----------
    sim : RecordSet
        Simulated by whatever.
    real : RecordSet
        The real records that calibrate: their conditions are what is asked for, their level sets the gain.
    bearing : Bearing
    reference_rms : float
        RMS of the real machine's healthy vibration (`Frame.scale`): the yardstick of effects.

    Attributes
    ----------
    gain : float
        Factor on all simulated samples: 1 where units are the same and levels within a tenth.
    level_free : bool
        Whether that factor had to be found: then it is found anew once effects are added.
    notes : tuple[str, ...]
        What was matched, and how, for people.

    Raises
    ------
    TwingapError
        When no simulated record is of a fault that the real ones have, or nothing of a known fault is there.
    """

    def __init__(
        self, sim: RecordSet, real: RecordSet, bearing: Bearing, reference_rms: float, *, name: str | None = None
    ) -> None:
        self.sim, self.bearing, self.reference_rms = sim, bearing, reference_rms
        self.name = name or sim.name
        self.has: tuple[str, ...] = ()
        self.conditions = real.conditions
        faults = {c.fault for c in sim.conditions if c.fault is not None}
        wanted = {c.fault for c in real.conditions if c.fault is not None}
        if not faults & wanted:
            raise TwingapError(
                f"no record of {', '.join(sorted(wanted)) or 'a known fault'}",
                where=f"simulated record set {sim.name!r}",
                mend="simulate the faults that the real records have, and name them in column fault",
            )
        self._turn = _turns(real.conditions)
        notes = []
        if missing := sorted(wanted - faults):
            notes.append(f"no simulated record of {', '.join(missing)}: real records of it are left aside")
        self.missing = frozenset(wanted - faults)
        self.gain = self._calibrated(real, notes)
        self.level_free = self.gain != 1.0
        slow = [c for c in real.conditions if c.fault not in self.missing and c.fault is not None]
        off = [abs(math.log(self.sim.conditions[self._ranked(c)[0]].speed_rpm / c.speed_rpm)) for c in slow]
        if off and max(off) > NEAR_SPEED:
            notes.append(
                f"simulated records were resampled over the shaft angle to the real speeds (by up to "
                f"{100 * max(off):.1f} %), by which their resonances move too"
            )
        self.notes = tuple(notes)

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """See `Simulator.simulate`. Replicates are other simulated records of the condition, then shifted ones."""
        out = []
        for condition in conditions:
            streams = streams_of(condition, streams_root, replicate)
            samples, speed_rpm = self._waveform(condition, streams, replicate)
            record = Record(replace(condition, speed_rpm=speed_rpm), samples)
            if effects:
                record = apply_to_waveform(effects, record, self.bearing, self.reference_rms, streams)
            out.append(record)
        return out

    def with_gain(self, gain: float) -> OwnSimulator:
        """The same records, times another factor."""
        own = copy.copy(self)
        own.gain = gain
        return own

    def can_add(self, name: str) -> str | None:
        """See `Simulator.can_add`."""
        return _reason(name, self.conditions, self.bearing, self.reference_rms, "waveform")

    def _ranked(self, condition: Condition) -> list[int]:
        """Simulated records of this fault that are as near to the condition as any, nearest first."""
        if condition.fault is None:
            raise TwingapError(
                "the fault is unknown, so no simulated record matches it",
                where=f"record {condition.name!r}", mend="give its fault",
            )  # fmt: skip
        distances = [(self._distance(c, condition), i) for i, c in enumerate(self.sim.conditions)]
        nearest, _ = min(distances)
        if nearest >= _OTHER_FAULT:
            raise TwingapError(
                f"no simulated record of fault {condition.fault!r}",
                where=f"record {condition.name!r}", mend="simulate it, or leave the real records of it out",
            )  # fmt: skip
        return [i for distance, i in sorted(distances) if distance <= nearest + 0.01]

    def _distance(self, made: Condition, real: Condition) -> float:
        """How far two conditions lie apart: one unit is a doubling of the speed, of the load, or the whole run."""
        distance = 0.0 if made.fault == real.fault else _OTHER_FAULT
        distance += abs(math.log2(made.speed_rpm / real.speed_rpm))
        if made.load_n and real.load_n:
            distance += 0.3 * abs(math.log2(made.load_n / real.load_n))
        if made.time_s is not None and real.time_s is not None:
            times = [c.time_s for c in self.sim.conditions if c.time_s is not None]
            span = max(times) - min(times)
            distance += abs(made.time_s - real.time_s) / span if span > 0 else 0.0
        return distance

    def _waveform(self, condition: Condition, streams: Streams, replicate: int) -> tuple[Array, float]:
        """One simulated record under this condition, and its speed: its own where that is near."""
        ranked = self._ranked(condition)
        exact = [i for i in ranked if self.sim.conditions[i].name == condition.name]
        # Real records of one condition get different simulated ones, as far as there are any.
        turn = ranked.index(exact[0]) if exact else self._turn.get(condition.name, 0)
        turn += replicate
        place = ranked[turn % len(ranked)]
        again = turn >= len(ranked) or (not exact and self._turn.get(condition.name, 0) >= len(ranked))
        made = self.sim.conditions[place]
        x = self._at_rate(place, condition.fs_hz)
        speed_rpm, stretch = made.speed_rpm, condition.speed_rpm / made.speed_rpm
        if abs(math.log(stretch)) > NEAR_SPEED:
            angle = np.arange(x.size, dtype=float)
            x = at_angles(x, angle, np.arange(0.0, x.size - 1, stretch))
            speed_rpm = condition.speed_rpm
        begin = 0
        if again or x.size > condition.n_samples:
            spare = x.size - condition.n_samples
            rng = streams("segment")
            if spare > 0 and (again or turn > 0):
                begin = int(rng.integers(spare + 1))
            elif again:
                begin = int(rng.integers(x.size))
        if begin + condition.n_samples <= x.size:
            x = x[begin : begin + condition.n_samples]
        else:  # round the record: a seam is the lesser evil beside a gap
            x = np.take(x, np.arange(begin, begin + condition.n_samples), mode="wrap")
        return (np.asarray(x * self.gain) if self.gain != 1 else np.array(x, dtype=float)), speed_rpm

    def _at_rate(self, place: int, fs_hz: float) -> Array:
        """A simulated record at the wanted sampling rate."""
        made = self.sim.conditions[place]
        x = np.asarray(self.sim[place].samples, float)
        if math.isclose(made.fs_hz, fs_hz, rel_tol=1e-9):
            return x
        if made.fs_hz < 0.999 * fs_hz:
            raise TwingapError(
                f"is sampled at {made.fs_hz:g} Hz, real records at {fs_hz:g} Hz: what lies between half of the two "
                "rates cannot be compared",
                where=f"simulated record {made.name!r}",
                mend=f"simulate at {fs_hz:g} Hz or above, or bring the real records to {made.fs_hz:g} Hz",
            )
        from fractions import Fraction

        from scipy.signal import resample_poly

        ratio = Fraction(fs_hz / made.fs_hz).limit_denominator(1000)
        if abs(ratio * made.fs_hz / fs_hz - 1) > 1e-6:
            raise TwingapError(
                f"is sampled at {made.fs_hz:g} Hz, which no simple ratio brings to {fs_hz:g} Hz",
                where=f"simulated record {made.name!r}", mend=f"simulate at {fs_hz:g} Hz",
            )  # fmt: skip
        return np.asarray(resample_poly(x, ratio.numerator, ratio.denominator))

    def _calibrated(self, real: RecordSet, notes: list[str]) -> float:
        """One factor that brings simulated levels to real ones, from healthy records where both have them."""
        shared = [i for i, c in enumerate(real.conditions) if c.fault is not None and c.fault not in self.missing]
        healthy = [i for i in shared if real.conditions[i].fault == "healthy"]
        self.gain = 1.0
        ratios = []
        for i in (healthy or shared)[:40]:
            condition = real.conditions[i]
            made, _ = self._waveform(condition, streams_of(condition, 0, 0), 0)
            ratios.append(0.5 * math.log(max(float(real[i].samples.var()), 1e-300) / max(float(made.var()), 1e-300)))
        log_gain = float(np.median(ratios)) if ratios else 0.0
        same = real.unit == self.sim.unit and real.unit != ""
        if same and abs(log_gain) < SAME_GAIN:
            return 1.0
        gain = math.exp(log_gain)
        of = "healthy records" if healthy else "all records, none of which is healthy"
        why = "" if same else f" (units: simulated {self.sim.unit!r}, real {real.unit!r})"
        notes.append(f"simulated samples were multiplied by {gain:.4g}, from the levels of {of}{why}")
        return gain


def _turns(conditions: Sequence[Condition]) -> dict[str, int]:
    """Place of each record among those of like condition."""
    seen: dict[tuple[str | None, int], int] = {}
    out = {}
    for c in conditions:
        key = c.fault, round(math.log2(c.speed_rpm) / 0.01)
        out[c.name] = seen.get(key, 0)
        seen[key] = out[c.name] + 1
    return out


# ------------------------------------------------------------------------------------------------- a function as a twin

Function = Callable[[list[Condition], np.random.Generator], Sequence[Array]]
"""Conditions and chances -> one array of samples per condition."""


@dataclass(frozen=True)
class CallableParameters:
    """What a twin file can say about a function registered as a twin.

    Parameters
    ----------
    scale : float
        Factor on all that it makes, positive; calibration brings it to the records.
    healthy_rms : float
        RMS of its healthy vibration before that factor, positive: the yardstick of effects.
    """

    scale: float = 1.0
    healthy_rms: float = 1.0

    def __post_init__(self) -> None:
        for name, value in (("scale", self.scale), ("healthy_rms", self.healthy_rms)):
            if not (math.isfinite(value) and value > 0):
                raise TwingapError(f"{name} = {value!r}, a positive number expected", where="parameters")


class CallableTwin(Twin):
    """A function as a twin: effects act on the waveforms that it makes, as on any finished waveform."""

    model: ClassVar[str] = "callable"
    excitation: ClassVar[Literal["impacts", "rollers", "waveform"]] = "waveform"

    def __init__(
        self,
        function: Function,
        bearing: Bearing,
        parameters: CallableParameters,
        effects: Sequence[Effect],
        unit: str,
        inherent: frozenset[str] = frozenset(),
    ) -> None:
        super().__init__(bearing, effects, unit)
        self.function, self.parameters = function, parameters
        self.inherent_effects = inherent  # type: ignore[misc]  # what this function models is its own

    @property
    def reference_rms(self) -> float:
        """RMS of the healthy vibration, in `unit`."""
        return self.parameters.scale * self.parameters.healthy_rms

    @property
    def white_noise_rms(self) -> float:
        """None is added to what the function makes."""
        return 0.0

    def excite(self, draft: Draft, streams: Streams) -> None:
        """Ask the function for the waveform."""
        condition = draft.condition
        made = self.function([condition], streams("simulator"))
        where = f"model {self.model!r}, record {condition.name!r}"
        try:
            x = np.array(made[0], dtype=float)
        except (TypeError, ValueError, IndexError, KeyError) as error:
            raise TwingapError(
                "the function gave no array of numbers per condition", where=where, mend="return a list of arrays"
            ) from error
        if x.shape != (condition.n_samples,) or not np.isfinite(x).all():
            raise TwingapError(
                f"the function gave samples of shape {x.shape}, ({condition.n_samples},) finite ones expected",
                where=where, mend="make condition.n_samples samples at condition.fs_hz",
            )  # fmt: skip
        draft.x = self.parameters.scale * x

    def respond(self, drafts: Sequence[Draft]) -> None:
        """Delay, gain and filters on the waveform, as `effects.apply_to_waveform` has them."""
        for draft in drafts:
            evenly = draft.t * draft.shaft_hz
            if any(e.stage == Stage.SHAFT for e in self.effects) and not np.array_equal(draft.turns, evenly):
                draft.x = at_angles(draft.x, evenly, draft.turns)
            if draft.cage_lag is not None:
                draft.x = at_angles(draft.x, draft.turns, draft.turns - draft.cage_lag)
            if draft.gain is not None:
                draft.x = draft.x * draft.gain
            if draft.filters:
                x = np.pad(draft.x, (LEAD, 0), mode="reflect")
                for act in draft.filters:
                    x = act(x)
                draft.x = x[LEAD:].copy()


def register_callable(name: str, function: Function, *, has: Sequence[str] = ()) -> Model:
    """Make a function a twin that twin files can name: ``[twin] model = "name"``.

    Parameters
    ----------
    name : str
    function : callable
        ``function(conditions, rng) -> arrays``: the samples of each condition, drawn from `rng` alone. It is asked for
        one record at a time, each with a generator of its own.
    has : sequence of str
        Effects that it models already.

    Returns
    -------
    Model

    Raises
    ------
    TwingapError
        For a name that twingap's own models have, or no function.
    """
    if name in ("phenomenological", "contact"):
        raise TwingapError(
            f"{name!r} is a model of twingap's own", where="register_callable", mend="choose another name"
        )
    if not callable(function):
        raise TwingapError(f"{function!r} found, a function expected", where="register_callable")
    inherent = frozenset(has)
    if unknown := sorted(inherent - catalogue().keys()):
        raise TwingapError(f"unknown effect {unknown[0]!r}", where="register_callable: has")
    kind = type(f"Callable_{zlib.crc32(name.encode()):08x}", (CallableTwin,), {"model": name})

    def build(parameters: Any, bearing: Bearing, effects: tuple[Effect, ...], unit: str) -> Twin:
        twin: Twin = kind(function, bearing, parameters, effects, unit, inherent)
        return twin

    return register_model(Model(name, CallableParameters, build, _NO_PRESETS))


_NO_PRESETS: Mapping[str, Any] = {}
