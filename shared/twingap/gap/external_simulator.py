"""External simulator: the user's own simulated records in place of a twin.

conditions --nearest in fault, speed, load, time--> simulated record --rate, length, level--> record
           --its speed where theirs is not near, effects on the finished waveform-----------> record

Effects act where they can on a finished waveform (path, disturbance, acquisition, by resampling over the shaft angle,
and on the part that exceeds healthy records), and say where they cannot.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from twingap.bearing import Bearing
from twingap.effects import Effect, Stage, apply_to_waveform
from twingap.effects.angle import at_angles
from twingap.effects.background import Background
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.streams import Streams
from twingap.twins.simulator import streams_of, why_not

Array = NDArray[np.float64]

NEAR_SPEED: Final = 0.06
"""Log ratio of speeds up to which a simulated record keeps its own: features follow each record's orders, and
resampling would move its resonances."""
SAME_GAIN: Final = math.log(1.1)
"""Log ratio of levels below which records in the same unit count as of equal gain."""
_OTHER_FAULT: Final = 1e6
"""Distance of a record of another fault: larger than all others."""
_TOO_SLOW: Final = 1e3
"""Distance of a record at a lower sampling rate than the real one's: chosen where there is no other, and then
refused."""
_AS_NEAR: Final = 0.01
"""Difference of distances within which simulated records count as of one condition."""
_MOST_REPLICATES: Final = 12
"""Replicates of a condition: more are slower and sharpen tests."""
_MOST_QUIET: Final = 5
"""Healthy records, nearest in speed, that the background of faulty ones is estimated from."""
_MOST_KEPT: Final = 96
"""Records whose background is cached: more take memory and save time."""
_MOST_MEASURED: Final = 40
"""Records that levels are measured on."""


class ExternalSimulator:
    """The user's own simulated records, brought to the real conditions as far as possible.

    Parameters
    ----------
    sim : RecordSet
        The simulated records.
    real : RecordSet
        Real records that calibrate: their level sets the gain.
    bearing : Bearing
    reference_rms : float
        RMS of the real machine's healthy vibration (`Frame.scale`): the amplitude scale of effects where no simulated
        record is healthy.
    name : str, optional
    others : sequence of Condition
        Conditions of further real records, which are not calibrated on: simulated records are shared out among all.

    Attributes
    ----------
    gain : float
        Factor on all simulated samples: 1 where units are the same and levels within a tenth.
    level_free : bool
        Whether that factor was estimated: then it is estimated anew once effects are added.
    notes : tuple[str, ...]
        What was matched, and how, for the report.

    Raises
    ------
    TwingapError
        When no simulated record is of a fault that the real ones have.
    """

    def __init__(
        self,
        sim: RecordSet,
        real: RecordSet,
        bearing: Bearing,
        reference_rms: float,
        *,
        name: str | None = None,
        others: Sequence[Condition] = (),
    ) -> None:
        self.sim, self.bearing = sim, bearing
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
        self._made = _Made(sim.conditions)
        self._quiet: dict[tuple[float, ...], Background | None] = {}
        self._known_background: dict[tuple[object, ...], NDArray[np.float32]] = {}
        notes: list[str] = []
        self.missing = frozenset(wanted - faults)
        self._first, self._alike = self._shared_out([*real.conditions, *others])
        self.gain = self._calibrated(real, notes)
        self.level_free = self.gain != 1.0
        self._healthy_rms = self._of_healthy() or reference_rms / self.gain
        slow = [c for c in real.conditions if c.fault not in self.missing and c.fault is not None]
        off = [abs(math.log(self.sim.conditions[self._ranked(c)[0]].speed_rpm / c.speed_rpm)) for c in slow]
        if off and max(off) > NEAR_SPEED:
            notes.append(
                f"simulated records were resampled over the shaft angle to the real speeds (by up to "
                f"{100 * max(off):.1f} %), by which their resonances move too"
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
        self.notes = tuple(notes)

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """See `Simulator.simulate`. Replicates are other simulated records of the condition, as far as there are."""
        out = []
        for condition in conditions:
            streams = streams_of(condition, streams_root, replicate)
            samples, speed_rpm = self._waveform(condition, streams, replicate)
            record = Record(replace(condition, speed_rpm=speed_rpm), samples)
            if effects:
                background = self._background_of(record, effects, (streams_root, replicate))
                record = apply_to_waveform(effects, record, self.bearing, self.reference_rms, streams, background)
            out.append(record)
        return out

    @property
    def reference_rms(self) -> float:
        """RMS of the simulated healthy vibration at the present level: the amplitude scale of effects, as of a
        twin's."""
        return self._healthy_rms * self.gain

    def with_gain(self, gain: float) -> ExternalSimulator:
        """The same records, times another factor."""
        own = copy.copy(self)
        own.gain = gain
        return own

    def can_add(self, name: str) -> str | None:
        """See `Simulator.can_add`."""
        return why_not(name, self.conditions, self.bearing, self.reference_rms, "waveform")

    def _ranked(self, condition: Condition) -> list[int]:
        """Simulated records of this fault that are nearest to the condition, nearest first."""
        if condition.fault is None:
            raise TwingapError(
                "the fault is unknown, so no simulated record matches it",
                where=f"record {condition.name!r}", mend="give its fault",
            )  # fmt: skip
        distances = self._made.distances(condition)
        nearest = float(distances.min())
        if nearest >= _OTHER_FAULT:
            raise TwingapError(
                f"no simulated record of fault {condition.fault!r}",
                where=f"record {condition.name!r}", mend="simulate it, or leave the real records of it out",
            )  # fmt: skip
        near = np.flatnonzero(distances <= nearest + _AS_NEAR)
        return [int(i) for i in near[np.argsort(distances[near], kind="stable")]]

    def replicates(self, conditions: Sequence[Condition]) -> int:
        """How many simulated records each of these has to itself, at least 1.

        Beyond that number records repeat. Cut or shifted, the same waveform is not independent: comparisons that take
        it as such find differences where there are none.
        """
        known = [c for c in conditions if c.name in self._alike]
        least = min((len(self._ranked(c)) // self._alike[c.name] for c in known), default=1)
        return min(max(least, 1), _MOST_REPLICATES)

    def _background_of(self, record: Record, effects: Sequence[Effect], draw: tuple[int, int]) -> Array | None:
        """Background of a record with a defect, its impacts taken out; None where no effect needs it or no record is
        healthy.

        The same for all values of effects, of which hundreds are tried: the last ones are cached.
        """
        c = record.condition
        if c.fault in (None, "healthy") or not any(effect.stage is Stage.EXCITATION for effect in effects):
            return None
        quiet = self._background(c.fs_hz, c.speed_rpm)
        if quiet is None:
            return None
        key = c.name, c.fault, c.n_samples, c.fs_hz, c.speed_rpm, draw
        if key not in self._known_background:
            if len(self._known_background) >= _MOST_KEPT:
                self._known_background.pop(next(iter(self._known_background)))
            rate_hz = self.bearing.fault_order(str(c.fault)) * c.speed_rpm / 60
            x = np.asarray(record.samples / self.gain, float)
            impacts = quiet.impacts(x, np.arange(c.n_samples, dtype=float) * (rate_hz / c.fs_hz))
            self._known_background[key] = np.asarray(x - impacts, np.float32)
        return np.asarray(self.gain * self._known_background[key], float)

    def _background(self, fs_hz: float, speed_rpm: float) -> Background | None:
        """Background from healthy records of about this speed, unscaled, at this rate; None without any."""
        made = self.sim.conditions
        quiet = [i for i, c in enumerate(made) if c.fault == "healthy" and c.fs_hz >= 0.999 * fs_hz]
        key = fs_hz, *sorted(quiet, key=lambda i: abs(math.log(made[i].speed_rpm / speed_rpm)))[:_MOST_QUIET]
        if key not in self._quiet:
            waveforms = []
            for place in key[1:]:
                try:
                    waveforms.append(self._at_rate(int(place), fs_hz))
                except TwingapError:  # no simple ratio of rates
                    continue
            self._quiet[key] = Background.of(waveforms)
        return self._quiet[key]

    def _of_healthy(self) -> float | None:
        """RMS of simulated healthy records about their means, unscaled; None without any."""
        places = [i for i, c in enumerate(self.sim.conditions) if c.fault == "healthy"][:_MOST_MEASURED]
        power = [float(self.sim[i].samples.var()) for i in places]
        return math.sqrt(float(np.mean(power))) if power and max(power) > 0 else None

    def _shared_out(self, conditions: Sequence[Condition]) -> tuple[dict[str, int], dict[str, int]]:
        """First simulated record of each real one, and the number of real ones that share the equally near records.

        The record of the same name, else of the equally near ones the least used: two real records should be compared
        with independent ones.
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
        """One simulated record under this condition, and its speed: its own where that is near."""
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
        else:  # repeated: a seam is better than missing samples
            x = np.take(x, np.arange(condition.n_samples), mode="wrap")
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
        for i in (healthy or shared)[:_MOST_MEASURED]:
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


class _Made:
    """Conditions of the simulated records, side by side; NaN where load or time is unknown."""

    def __init__(self, conditions: Sequence[Condition]) -> None:
        self.fault = np.array([c.fault or "" for c in conditions])
        self.speed_rpm = np.array([c.speed_rpm for c in conditions], float)
        self.fs_hz = np.array([c.fs_hz for c in conditions], float)
        self.load_n = np.array([c.load_n or math.nan for c in conditions], float)
        self.time_s = np.array([math.nan if c.time_s is None else c.time_s for c in conditions], float)
        known = self.time_s[np.isfinite(self.time_s)]
        self.span_s = float(np.ptp(known)) if known.size else 0.0

    def distances(self, real: Condition) -> Array:
        """[simulated records] 1 for a doubling of the speed or for the whole run, 0.3 for a doubling of the load."""
        out = np.where(self.fault == (real.fault or ""), 0.0, _OTHER_FAULT)
        out += np.where(self.fs_hz < 0.999 * real.fs_hz, _TOO_SLOW, 0.0)
        out += np.abs(np.log2(self.speed_rpm / real.speed_rpm))
        if real.load_n:
            out += np.nan_to_num(0.3 * np.abs(np.log2(self.load_n / real.load_n)))
        if real.time_s is not None and self.span_s > 0:
            out += np.nan_to_num(np.abs(self.time_s - real.time_s) / self.span_s)
        return np.asarray(out)
