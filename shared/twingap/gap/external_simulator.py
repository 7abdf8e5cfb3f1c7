"""External simulator: the user's own simulated records in place of a twin.

conditions --nearest in fault, unit, speed, load, time--> simulated record --rate, length, level--> record
           --resampling to another speed, effects on the finished waveform------------------> record

Effects of path, disturbance and acquisition are applied to the waveform, those of the shaft angle by resampling, and
those of the excitation to the part that exceeds healthy records. `can_add` gives the reason where this is impossible.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from twingap.bearing import Bearing
from twingap.effects import Effect, Stage, apply_to_waveform
from twingap.effects.angle import at_angles
from twingap.effects.background import Background
from twingap.effects.by_state import unit_of
from twingap.effects.force_response import force_response
from twingap.effects.impact_train import response_of
from twingap.errors import TwingapError
from twingap.identification.baseline import level_of_own
from twingap.records import Array, Condition, Record, RecordSet
from twingap.signal.record_transforms import Frame
from twingap.streams import Streams
from twingap.twins.simulator import streams_of, why_not

NEAR_SPEED: Final = 0.06
"""Log ratio of speeds up to which a simulated record keeps its own speed: features are relative to each record's
orders, and resampling would move resonances. A larger value resamples fewer records."""
_OTHER_SPEEDS: Final = 0.01
"""Median log ratio of speeds from which a note says so. A smaller value says so of chance."""
SAME_GAIN: Final = math.log(1.1)
"""Log ratio of levels below which records in the same unit count as of equal gain. A larger value matches fewer
levels."""
_OTHER_FAULT: Final = 1e6
"""Distance of a record of another fault; larger than all other distances."""
_OTHER_UNIT: Final = 10.0
"""Distance of a record of another unit (bearing, mounting); larger than those of speed, load and time."""
_TOO_SLOW: Final = 1e3
"""Distance of a record at a lower sampling rate than the real one: it is selected only where there is no other, and
then rejected."""
_AS_NEAR: Final = 0.01
"""Difference in distance up to which simulated records count as of the same condition. A larger value gives more
replicates, under less similar conditions."""
_MOST_REPLICATES: Final = 12
"""Largest number of replicates of a condition. A larger number takes longer and gives tests more power."""
_MOST_HEALTHY: Final = 5
"""Largest number of healthy records, nearest in speed, for the background of faulty ones. More reduce its noise, at
less similar speeds."""
_MOST_KEPT: Final = 96
"""Largest number of records whose background is cached. A larger number takes more memory and saves time."""
_MOST_RESPONSES: Final = 4
"""Largest number of records of each fault for the response to an impact. A larger number reduces its noise."""
_MOST_MEASURED: Final = 40
"""Largest number of records for the matching of levels. A larger number takes longer and reduces noise."""


class ExternalSimulator:
    """The user's own simulated records, adapted to the real conditions.

    Real records are those of the calibration: their level sets the gain. `reference_rms` is the RMS of the real
    machine's healthy vibration (`Frame.scale`): the amplitude scale of effects where no simulated record is healthy.
    `others` are conditions of further real records, not used in the calibration: simulated records are shared among
    all.

    Raises
    ------
    TwingapError
        When no simulated record has a fault of the real ones.
    """

    makes_waveforms = True  # its records are finished

    def __init__(
        self,
        sim: RecordSet,
        real: RecordSet,
        bearing: Bearing,
        reference_rms: float,
        *,
        others: Sequence[Condition] = (),
    ) -> None:
        self.sim, self.bearing = sim, bearing
        self.name = sim.name
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
        self._simulated_conditions = _SimulatedConditions(sim.conditions)
        self._backgrounds: dict[tuple[float, ...], Background | None] = {}
        self._known_background: dict[tuple[object, ...], NDArray[np.float32]] = {}
        self._responses: dict[float, Array | None] = {}
        self._force_responses: dict[float, Array | None] = {}
        notes: list[str] = []
        self.missing = frozenset(wanted - faults)
        self._first, self._alike = self._shared_out([*real.conditions, *others])
        # Factor on all simulated samples: 1 where units are equal and levels agree within 10 %, else estimated, and
        # estimated anew once effects are added.
        self.gain = self._calibrated(real, notes)
        self.level_free = self.gain != 1.0
        self._healthy_rms = self._of_healthy() or reference_rms / self.gain
        slow = [c for c in real.conditions if c.fault not in self.missing and c.fault is not None]
        off = [math.log(self.sim.conditions[self._ranked(c)[0]].speed_rpm / c.speed_rpm) for c in slow]
        if (farthest := max(map(abs, off), default=0.0)) > NEAR_SPEED:
            notes.append(
                f"simulated records were resampled over the shaft angle to the real speeds (by up to "
                f"{100 * farthest:.1f} %), by which their resonances move too"
            )
        elif off and abs(common := float(np.median(off))) > _OTHER_SPEEDS:
            notes.append(
                f"simulated records turn {100 * abs(common):.1f} % {'faster' if common > 0 else 'slower'} than the "
                "real ones: what a speed changes in strength no effect can make up for, so simulate at "
                f"{math.exp(-common):.4f} times their speed"
            )
        longest = {c.fault: 0.0 for c in sim.conditions}
        for c in sim.conditions:
            longest[c.fault] = max(longest[c.fault], c.n_samples / c.fs_hz)
        short = [c for c in slow if c.n_samples / c.fs_hz > 1.01 * longest[c.fault]]
        if short:
            notes.append(
                f"simulated records are shorter than {len(short)} of the real ones and are repeated to their length: "
                "repetition is a line at its rate and at multiples of it"
            )
        self.notes = tuple(notes)  # for the report, on what was matched

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """See `Simulator.simulate`. Replicates are different simulated records of a condition, as long as there are
        any."""
        out = []
        for condition in conditions:
            streams = streams_of(condition, streams_root, replicate)
            samples, speed_rpm = self._waveform(condition, streams, replicate)
            record = Record(replace(condition, speed_rpm=speed_rpm), samples)
            if effects:
                background = self._background_of(record, effects, (streams_root, replicate))
                responses = (partial(of, condition.fs_hz) for of in (self._response, self._force_response))
                record = apply_to_waveform(
                    effects, record, self.bearing, self.reference_rms, streams, background, *responses
                )
            out.append(record)
        return out

    @property
    def reference_rms(self) -> float:
        """RMS of the simulated healthy vibration at the current gain: the amplitude scale of effects."""
        return self._healthy_rms * self.gain

    def with_gain(self, gain: float) -> ExternalSimulator:
        """A copy with another gain."""
        own = copy.copy(self)
        own.gain = gain
        return own

    def can_add(self, name: str) -> str | None:
        """See `Simulator.can_add`."""
        rates = sorted({c.fs_hz for c in self.conditions})

        def known() -> Array | None:
            responses = [self._force_response(rate) for rate in rates]
            return None if any(response is None for response in responses) else responses[0]

        return why_not(name, self.conditions, self.bearing, self.reference_rms, "waveform", known)

    def _ranked(self, condition: Condition) -> list[int]:
        """Indices of the simulated records of this fault nearest to the condition, the nearest first."""
        if condition.fault is None:
            raise TwingapError(
                "the fault is unknown, so no simulated record matches it",
                where=f"record {condition.name!r}", mend="give its fault",
            )  # fmt: skip
        distances = self._simulated_conditions.distances(condition)
        nearest = float(distances.min())
        if nearest >= _OTHER_FAULT:
            raise TwingapError(
                f"no simulated record of fault {condition.fault!r}",
                where=f"record {condition.name!r}", mend="simulate it, or leave the real records of it out",
            )  # fmt: skip
        near = np.flatnonzero(distances <= nearest + _AS_NEAR)
        return [int(i) for i in near[np.argsort(distances[near], kind="stable")]]

    def replicates(self, conditions: Sequence[Condition]) -> int:
        """Number of independent simulated records of each condition, at least 1.

        With more replicates, records repeat. The same waveform, cut or shifted, is not independent, and tests that
        assume independence would give false alarms.
        """
        known = [c for c in conditions if c.name in self._alike]
        least = min((len(self._ranked(c)) // self._alike[c.name] for c in known), default=1)
        return min(max(least, 1), _MOST_REPLICATES)

    def _background_of(self, record: Record, effects: Sequence[Effect], draw: tuple[int, int]) -> Array | None:
        """Background of a record with a defect, its impacts removed; None where no effect needs it or no record is
        healthy.

        It does not depend on the values of effects, of which hundreds are tried, and is cached.
        """
        c = record.condition
        if c.fault in (None, "healthy") or not any(effect.stage is Stage.EXCITATION for effect in effects):
            return None
        background = self._background(c.fs_hz, c.speed_rpm)
        if background is None:
            return None
        key = c.name, c.fault, c.n_samples, c.fs_hz, c.speed_rpm, draw
        if key not in self._known_background:
            if len(self._known_background) >= _MOST_KEPT:
                self._known_background.pop(next(iter(self._known_background)))
            rate_hz = self.bearing.fault_order(str(c.fault)) * c.speed_rpm / 60
            x = np.asarray(record.samples / self.gain, float)
            impacts = background.impacts(x, np.arange(c.n_samples, dtype=float) * (rate_hz / c.fs_hz))
            self._known_background[key] = np.asarray(x - impacts, np.float32)
        return np.asarray(self.gain * self._known_background[key], float)

    def _background(self, fs_hz: float, speed_rpm: float) -> Background | None:
        """Background estimated from healthy records at similar speeds, without gain, at this rate; None without any."""
        made = self.sim.conditions
        healthy = [i for i, c in enumerate(made) if c.fault == "healthy" and c.fs_hz >= 0.999 * fs_hz]
        key = fs_hz, *sorted(healthy, key=lambda i: abs(math.log(made[i].speed_rpm / speed_rpm)))[:_MOST_HEALTHY]
        if key not in self._backgrounds:
            waveforms = []
            for place in key[1:]:
                try:
                    waveforms.append(self._at_rate(int(place), fs_hz))
                except TwingapError:  # no simple ratio of rates
                    continue
            self._backgrounds[key] = Background.of(waveforms)
        return self._backgrounds[key]

    def _response(self, fs_hz: float) -> Array | None:
        """Response to one impact at this rate, from some records of each fault; None if impacts do not stand out."""
        if fs_hz not in self._responses:
            faulty = self._some_of_each_state(fs_hz, healthy=False)
            passes = [fs_hz / (self.bearing.fault_order(str(c.fault)) * c.speed_rpm / 60) for c, _ in faulty]
            self._responses[fs_hz] = response_of([x for _, x in faulty], passes) if faulty else None
        return self._responses[fs_hz]

    def _force_response(self, fs_hz: float) -> Array | None:
        """The same, or a response of the same power where impacts do not stand out."""
        response = self._response(fs_hz)
        if response is None and fs_hz not in self._force_responses:
            healthy, faulty = (self._some_of_each_state(fs_hz, healthy=of) for of in (True, False))
            self._force_responses[fs_hz] = force_response([x for _, x in healthy], [x for _, x in faulty])
        return self._force_responses[fs_hz] if response is None else response

    def _some_of_each_state(self, fs_hz: float, *, healthy: bool) -> list[tuple[Condition, Array]]:
        """Some simulated records of healthy bearings, or of each fault, at this rate, without gain."""
        found: list[tuple[Condition, Array]] = []
        counts: dict[str, int] = {}
        for place, c in enumerate(self.sim.conditions):
            fault = c.fault or "healthy"
            if (fault == "healthy") != healthy or counts.get(fault, 0) == _MOST_RESPONSES or c.fs_hz < 0.999 * fs_hz:
                continue
            try:
                found.append((c, self._at_rate(place, fs_hz)))
            except TwingapError:  # no simple ratio of rates
                continue
            counts[fault] = counts.get(fault, 0) + 1
        return found

    def _of_healthy(self) -> float | None:
        """RMS of the simulated healthy records about their means, without gain; None without any."""
        places = [i for i, c in enumerate(self.sim.conditions) if c.fault == "healthy"][:_MOST_MEASURED]
        power = [float(self.sim[i].samples.var()) for i in places]
        return math.sqrt(float(np.mean(power))) if power and max(power) > 0 else None

    def _shared_out(self, conditions: Sequence[Condition]) -> tuple[dict[str, int], dict[str, int]]:
        """First simulated record of each real one, and the number of real ones that share its pool of equally near
        records.

        It is the record of the same name, else the least used of the pool, so that real records are compared with
        independent simulated ones.
        """
        first: dict[str, int] = {}
        taken = np.zeros(len(self.sim.conditions), int)
        pools: dict[str, list[int]] = {}
        for c in conditions:
            if c.name in first or c.fault is None or c.fault in self.missing:
                continue
            ranked = pools[c.name] = self._ranked(c)
            exact = [i for i in ranked if self.sim.conditions[i].name == c.name]
            first[c.name] = exact[0] if exact else min(ranked, key=lambda i: taken[i])
            taken[first[c.name]] += 1
        return first, {name: int(taken[pool].sum()) for name, pool in pools.items()}

    def _waveform(self, condition: Condition, streams: Streams, replicate: int) -> tuple[Array, float]:
        """Samples of a simulated record under this condition and their speed, the record's own where it is near."""
        ranked = self._ranked(condition)
        first = self._first.get(condition.name)
        turn = ranked.index(first) if first in ranked else 0
        turn += replicate * self._alike.get(condition.name, 1)
        place = ranked[turn % len(ranked)]
        made = self.sim.conditions[place]
        x = self._at_rate(place, condition.fs_hz)
        speed_rpm, stretch = made.speed_rpm, condition.speed_rpm / made.speed_rpm
        if abs(math.log(stretch)) > NEAR_SPEED:
            angle = np.arange(x.size, dtype=float)
            x = at_angles(x, angle, np.arange(0.0, x.size - 1, stretch))
            speed_rpm = condition.speed_rpm
        begin, spare = 0, x.size - condition.n_samples
        if spare > 0 and turn > 0:
            begin = int(streams("segment").integers(spare + 1))
        if spare >= 0:
            x = x[begin : begin + condition.n_samples]
        else:  # repeat the record: a seam does less harm than missing samples
            x = np.take(x, np.arange(condition.n_samples), mode="wrap")
        return (np.asarray(x * self.gain) if self.gain != 1 else np.array(x, dtype=float)), speed_rpm

    def _at_rate(self, place: int, fs_hz: float) -> Array:
        """Samples of a simulated record at this sampling rate, without gain."""
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
        ratio = Fraction(fs_hz / made.fs_hz).limit_denominator(1000)
        if abs(ratio * made.fs_hz / fs_hz - 1) > 1e-6:
            raise TwingapError(
                f"is sampled at {made.fs_hz:g} Hz, which no simple ratio brings to {fs_hz:g} Hz",
                where=f"simulated record {made.name!r}", mend=f"simulate at {fs_hz:g} Hz",
            )  # fmt: skip
        return np.asarray(resample_poly(x, ratio.numerator, ratio.denominator))

    def _calibrated(self, real: RecordSet, notes: list[str]) -> float:
        """Gain that matches simulated to real levels, by healthy records where both sets have them."""
        shared = [i for i, c in enumerate(real.conditions) if c.fault is not None and c.fault not in self.missing]
        healthy = [i for i in shared if real.conditions[i].fault == "healthy"]
        self.gain = 1.0
        used = real.take((healthy or shared)[:_MOST_MEASURED])
        same = real.unit == self.sim.unit and real.unit != ""
        gain = self._level_between_tones(used) if same else self._level(used)
        # A wrong sensitivity scales all records; healthy recordings alone may just be louder.
        faulty = [i for i in shared if i not in healthy][:_MOST_MEASURED] if healthy else []
        if same and (abs(math.log(gain)) < SAME_GAIN or (faulty and self._agrees(real.take(faulty)))):
            return 1.0
        of = "healthy records" if healthy else "all records, none of which is healthy"
        why = "" if same else f" (units: simulated {self.sim.unit!r}, real {real.unit!r})"
        notes.append(f"simulated samples were multiplied by {gain:.4g}, from the levels of {of}{why}")
        return gain

    def _agrees(self, real: RecordSet) -> bool:
        """Whether the simulated counterparts of these records are as loud as they are, without gain."""
        return abs(math.log(self._level(real))) < SAME_GAIN

    def _level(self, real: RecordSet) -> float:
        """Median ratio of the RMS of real records to that of simulated ones."""
        ratios = []
        for record in real:
            made, _ = self._waveform(record.condition, streams_of(record.condition, 0, 0), 0)
            ratios.append(0.5 * math.log(max(float(record.samples.var()), 1e-300) / max(float(made.var()), 1e-300)))
        return math.exp(float(np.median(ratios))) if ratios else 1.0

    def _level_between_tones(self, real: RecordSet) -> float:
        """Ratio of levels band by band, without tones: hum of the machine is no reason for a louder simulator."""
        if not len(real):
            return 1.0
        frame = Frame(self.bearing, (0.0, min(c.fs_hz for c in real.conditions) / 2), 1.0)

        def at(level: float, conditions: Sequence[Condition]) -> list[Record]:
            made = (self._waveform(c, streams_of(c, 0, 0), 0)[0] for c in conditions)
            return [Record(c, level * x) for c, x in zip(conditions, made, strict=True)]

        return level_of_own(at, list(real), frame)


class _SimulatedConditions:
    """Conditions of the simulated records as arrays; NaN where load or time is unknown."""

    def __init__(self, conditions: Sequence[Condition]) -> None:
        self.fault = np.array([c.fault or "" for c in conditions])
        self.unit = np.array([unit_of(c) for c in conditions])
        self.speed_rpm = np.array([c.speed_rpm for c in conditions], float)
        self.fs_hz = np.array([c.fs_hz for c in conditions], float)
        self.load_n = np.array([c.load_n or math.nan for c in conditions], float)
        self.time_s = np.array([math.nan if c.time_s is None else c.time_s for c in conditions], float)
        known = self.time_s[np.isfinite(self.time_s)]
        self.span_s = float(np.ptp(known)) if known.size else 0.0

    def distances(self, real: Condition) -> Array:
        """[simulated records] Distance to a real condition: 1 per doubling of speed or per whole run, 0.3 per
        doubling of load; more than these for another unit."""
        out = np.where(self.fault == (real.fault or ""), 0.0, _OTHER_FAULT)
        out += np.where(self.unit == unit_of(real), 0.0, _OTHER_UNIT)
        out += np.where(self.fs_hz < 0.999 * real.fs_hz, _TOO_SLOW, 0.0)
        out += np.abs(np.log2(self.speed_rpm / real.speed_rpm))
        if real.load_n:
            out += np.nan_to_num(0.3 * np.abs(np.log2(self.load_n / real.load_n)))
        if real.time_s is not None and self.span_s > 0:
            out += np.nan_to_num(np.abs(self.time_s - real.time_s) / self.span_s)
        return np.asarray(out)
