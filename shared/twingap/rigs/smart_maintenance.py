"""Virtual Smart Maintenance rig (surrogate): six simulated bearings run to failure at varying speed.

published: durations, onsets (table 3), profile, load, end at 15 g --+
seed --> bench (`life_bench`), growth of each spall (`spall`) -------+--> snapshots, one record each, made on access
                                                                     +--> truth(rig, seed), for scoring only

The real set (Flanders Make) is not public. This one has its layout and the columns of its reader
(`twingap.data.smart_maintenance`), not its numbers: no vibration was fitted. Published, in section 4.1 and table 3 of
paper 1 (Simulation-based remaining useful life prediction of rolling element bearings under varying operating
conditions): bearings, durations, times of the first anomaly, FAG 6205-C-TVH with an indented inner race, 9 kN, 1000 to
2000 rpm in steps of 100 rpm held for 60 s, 50 kHz, signals of 25,000 samples, end of life at 15 g peak to peak.

Assumptions, since the paper does not state these points:
- A snapshot is taken every 20 s, three per speed step; the last one ends the test.
- The profile is a sawtooth that drops from 2000 to 1000 rpm at once, every 11 min, for all bearings. Two of its drops,
  at 231 and 242 min, match the abrupt drops that the paper reports after A156's anomaly; with a periodic profile, drops
  after the anomalies of the other bearings can be predicted. Lives end at 1500 rpm or more. With a triangle, A148 and
  A150 would end at 1200 and 1300 rpm, minutes after higher speeds with stronger vibration.
- The spall begins to grow at the published times. These are times at which an anomaly was detected in peak to peak, so
  the first flakes break out within minutes and raise the level at 1500 rpm to 1.3 to 1.5 of the healthy one.
- An impact is a force pulse with the peak and duration of a Hertzian impact (`spall.impact`) on linear modes that do
  not act back. No equation of motion of the contact is integrated.
- Mounting, growth and noise are drawn until the last snapshot is the first to reach 15 g, so that durations are those
  of the paper.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.rigs.life_bench import LifeBench
from twingap.rigs.spall import Growth
from twingap.rigs.speed_profile import SpeedProfile
from twingap.streams import Streams

Array = NDArray[np.float64]

TITLE: Final = "virtual Smart Maintenance rig (surrogate)"
"""Label of all results of this rig."""
END_OF_LIFE_G: Final = 15.0
"""Peak to peak acceleration at the end of life, g."""
LOAD_N: Final = 9000.0
"""Radial load, N."""


class Run(NamedTuple):
    """Row of table 3: duration of the test and time of the first anomaly, min."""

    duration_min: float
    onset_min: float


RUNS: Final[Mapping[str, Run]] = MappingProxyType({
    "A148": Run(142.5, 112.6),
    "A150": Run(197.5, 169.1),
    "A153": Run(229.3, 207.8),
    "A154": Run(126.0, 98.8),
    "A155": Run(369.3, 348.6),
    "A156": Run(251.3, 224.0),
})  # fmt: skip

DIGEST: Final = "c88a0b2899c682ffddbb9a139e7e403abd0c0e4ddc7a4cb65a560e1e1e5944b8"
"""sha256 (`twingap.rigs.digest`) of A156 with seed 0, a snapshot of 0.1 s every 300 s."""
_MOUNTINGS = 50
"""Most mountings drawn for one life; more find a life for rarer seeds."""
_ATTEMPTS = 20
"""Most draws of growth and noise for one mounting; more keep a mounting longer before another is drawn."""


@dataclass(frozen=True)
class SmartMaintenanceRig:
    """Virtual Smart Maintenance rig.

    Parameters
    ----------
    interval_s : float
        Interval of snapshots, s. Another interval gives other lives, since each is settled by its own snapshots.
    duration_s : float
        Length of a snapshot, s; 0.5 s gives the paper's 25,000 samples.
    fs_hz : float
        Sampling rate, Hz.
    profile : {"sawtooth", "triangle", "constant"}
        See `SpeedProfile`; "constant" is 1500 rpm.
    bearings : tuple of str
        Bearings of `RUNS` to simulate; each is the same whichever others are included.
    """

    name = "virtual_smart_maintenance"
    title = TITLE
    interval_s: float = 20.0
    duration_s: float = 0.5
    fs_hz: float = 50_000.0
    profile: str = "sawtooth"
    bearings: tuple[str, ...] = tuple(RUNS)

    def __post_init__(self) -> None:
        where = f"rig {self.name}"
        for key, value, low, high in (
            ("interval_s", self.interval_s, 1.0, 600.0),
            ("duration_s", self.duration_s, 0.05, 10.0),
            ("fs_hz", self.fs_hz, 25_600.0, 200_000.0),
        ):
            if not low <= value <= high:
                raise TwingapError(f"{key} = {value:g}, between {low:g} and {high:g} expected", where=where)
        if self.duration_s > self.interval_s:
            raise TwingapError(
                f"duration_s = {self.duration_s:g} with interval_s = {self.interval_s:g}", where=where,
                mend="choose a duration shorter than the interval",
            )  # fmt: skip
        for bearing_id in self.bearings:
            if bearing_id not in RUNS:
                raise TwingapError(f"unknown bearing {bearing_id!r}", where=where, mend=f"use {', '.join(RUNS)}")
        if not self.bearings or len(set(self.bearings)) < len(self.bearings):
            raise TwingapError(f"bearings = {self.bearings!r}, one or more different ones expected", where=where)
        self.speeds  # noqa: B018 - raises for an unknown shape

    @property
    def speeds(self) -> SpeedProfile:
        """Profile of the set speed."""
        return SpeedProfile(self.profile)

    @property
    def n_samples(self) -> int:
        """Samples of each snapshot."""
        return round(self.duration_s * self.fs_hz)

    def times_s(self, bearing_id: str) -> Array:
        """Times of the snapshots [records], s since the start; the last is the end of life."""
        end_s = round(60 * RUNS[bearing_id].duration_min)
        count = int(end_s // self.interval_s) + 1
        return end_s - self.interval_s * np.arange(count - 1, -1, -1.0)

    def records(self, seed: int = 0) -> RecordSet:
        """All snapshots of all runs, each simulated on access; the first access to a run takes some seconds.

        `twingap.rigs.stored_records` stores them for later reading.

        Parameters
        ----------
        seed : int
            Selects bench, bearings and growth.

        Returns
        -------
        RecordSet
            Unit g. Columns as those of the real set's reader: `fault` is unknown along the run, `group` and bearing_id
            are the run's bearing, end_fault "inner", end_of_life_peak_to_peak_g. anomaly_s, in the real set the
            time found by the paper's method, is None here, since it would be the truth. See `truth`.
        """
        if seed < 0:
            raise TwingapError(f"seed = {seed}, an integer of at least 0 expected", where=f"rig {self.name}")
        places = tuple((run, k) for run in self.bearings for k in range(self.times_s(run).size))
        conditions = [c for run in self.bearings for c in self._conditions(run)]
        return RecordSet(self.name, "g", BEARINGS["6205"], conditions, _Simulated(self, seed, places))

    def _conditions(self, bearing_id: str) -> list[Condition]:
        times = self.times_s(bearing_id)
        return [
            Condition(
                name=f"{bearing_id}_{k + 1:05d}",
                speed_rpm=float(speed_rpm),
                fs_hz=self.fs_hz,
                n_samples=self.n_samples,
                load_n=LOAD_N,
                time_s=float(time_s),
                group=bearing_id,
                extra={
                    "bearing_id": bearing_id,
                    "end_fault": "inner",
                    "anomaly_s": None,
                    "end_of_life_peak_to_peak_g": END_OF_LIFE_G,
                },
            )
            for k, (time_s, speed_rpm) in enumerate(zip(times, self.speeds.speed_rpm(times), strict=True))
        ]


@dataclass(frozen=True)
class RunTruth:
    """Truth of a run, for scoring only.

    Parameters
    ----------
    bearing_id : str
    onset_s, end_of_life_s : float
        Onset of the spall and end of the test, s.
    time_s : Array [records]
        Times of the snapshots, s.
    spall_mm : Array [records]
        Length of the spall, mm; 0 until the onset.
    remaining_turns, remaining_time_s : Array [records]
        Turns of the shaft, and time, s, until the end at the actual speeds.
    """

    bearing_id: str
    onset_s: float
    end_of_life_s: float
    time_s: Array
    spall_mm: Array
    remaining_turns: Array
    remaining_time_s: Array

    @property
    def damage(self) -> Array:
        """Length relative to that at the end [records], 0 to 1."""
        return np.asarray(self.spall_mm / self.spall_mm[-1])


def truth(rig: SmartMaintenanceRig, seed: int = 0) -> dict[str, RunTruth]:
    """Truth of each run, by bearing.

    Parameters
    ----------
    rig : SmartMaintenanceRig
    seed : int
        The rig and the seed of the records.
    """
    found = {}
    for bearing_id in rig.bearings:
        life = _life(rig, seed, bearing_id)
        end_s = float(life.time_s[-1])
        turns = rig.speeds.turns(life.time_s)
        found[bearing_id] = RunTruth(
            bearing_id, 60 * RUNS[bearing_id].onset_min, end_s, life.time_s.copy(), life.spall_mm.copy(),
            turns[-1] - turns, end_s - life.time_s,
        )  # fmt: skip
    return found


@dataclass(frozen=True)
class _Simulated:
    """Loader of the samples of record i, as a class, so that it can be pickled for worker processes."""

    rig: SmartMaintenanceRig
    seed: int
    places: tuple[tuple[str, int], ...]

    def __call__(self, index: int) -> Array:
        bearing_id, k = self.places[index]
        return _life(self.rig, self.seed, bearing_id).snapshot(k)


@dataclass(frozen=True)
class _Life:
    """Bench, growth and noise of one run, from which any of its snapshots can be simulated.

    Parameters
    ----------
    bench : LifeBench
    streams : Streams
        Random streams of this bearing; every snapshot has its own purpose.
    drawn : str
        Label of the draw of growth and of noise after the onset.
    time_s, true_rpm, wear, spall_mm : Array [records]
        Time, s; true speed, rpm; relative level of the rolling noise; length of the spall, mm.
    """

    bench: LifeBench
    streams: Streams
    drawn: str
    n_samples: int
    fs_hz: float
    time_s: Array
    true_rpm: Array
    wear: Array
    spall_mm: Array

    def snapshot(self, k: int, spall_mm: float | None = None) -> Array:
        """Samples [samples] of snapshot k, g, with the spall length of the run or a given one, mm."""
        length = float(self.spall_mm[k]) if spall_mm is None else spall_mm
        drawn = self.drawn if length > 0 else "healthy"
        return self.bench.record(
            float(self.true_rpm[k]), LOAD_N, length, self.n_samples, self.fs_hz,
            self.streams(f"snapshot {k} {drawn}"), wear=float(self.wear[k]),
        )  # fmt: skip


@lru_cache(maxsize=16)
def _bench(seed: int) -> LifeBench:
    return LifeBench.draw(Streams(seed, 0)("bench"), BEARINGS["6205"])


@lru_cache(maxsize=32)
def _life(rig: SmartMaintenanceRig, seed: int, bearing_id: str) -> _Life:
    """Mounting, growth and noise of a run in which the last snapshot is the first to reach 15 g."""
    for mounting in range(_MOUNTINGS):
        life = _settled(rig, seed, bearing_id, mounting)
        if life is not None:
            return life
    raise TwingapError(
        f"no simulated life of {bearing_id} ends at the published time",
        where=f"rig {rig.name}",
        mend="use another seed",
    )


def _settled(rig: SmartMaintenanceRig, seed: int, bearing_id: str, mounting: int) -> _Life | None:
    """Run with this mounting; None when no draw of growth and noise ends at the published time."""
    streams = Streams(seed, 1 + list(RUNS).index(bearing_id))
    bench = _bench(seed).mounted(streams(f"mounting {mounting}"))
    flake = streams(f"flake {mounting}")
    flake_mm = bench.length_for_ratio(float(flake.uniform(1.3, 1.5)), flake)
    time_s = rig.times_s(bearing_id)
    turns = rig.speeds.turns(time_s) - rig.speeds.turns(60 * RUNS[bearing_id].onset_min)
    life = _Life(
        bench, streams, f"{mounting}", rig.n_samples, rig.fs_hz, time_s,
        # The drive holds its set speed to a few parts in ten thousand.
        true_rpm=rig.speeds.speed_rpm(time_s) * (1 + 4e-4 * streams("speed").standard_normal(time_s.size)),
        wear=_wear(time_s, rig.interval_s, streams("wear")), spall_mm=np.zeros(time_s.size),
    )  # fmt: skip
    earlier = np.flatnonzero(turns > 0)[-2::-1]  # from the end, where too high a level is most likely
    for attempt in range(_ATTEMPTS):
        drawn = f"{mounting}, {attempt}"
        growth = Growth.draw(streams(f"growth {drawn}"), float(turns[-1]), flake_mm)
        end_mm = _length_at_the_end(replace(life, drawn=drawn))
        if end_mm < 2 * flake_mm:
            return None
        found = replace(life, drawn=drawn, spall_mm=growth.length_mm(turns, end_mm))
        if all(np.ptp(found.snapshot(int(k))) < END_OF_LIFE_G for k in earlier):
            return found
    return None


def _wear(time_s: Array, interval_s: float, rng: np.random.Generator) -> Array:
    """Relative level of the rolling noise over a run [records]: run-in of new surfaces, varying temperature."""
    stay = float(np.exp(-interval_s / 900.0))
    steps = np.sqrt(1 - stay**2) * rng.standard_normal(time_s.size)
    wander, _ = signal.lfilter([1.0], [1.0, -stay], steps, zi=np.array([stay * rng.standard_normal()]))
    return np.asarray((1 + 0.04 * np.exp(-time_s / 240.0)) * np.exp(0.015 * wander))


def _length_at_the_end(life: _Life) -> float:
    """Length of the spall, mm, at which the last snapshot just exceeds the end-of-life level."""
    last = life.time_s.size - 1
    low, high = 0.1, 20.0
    length = 2.0
    for _ in range(40):
        reached = float(np.ptp(life.snapshot(last, length)))
        if END_OF_LIFE_G <= reached < 1.01 * END_OF_LIFE_G:
            return length
        low, high = (length, high) if reached < END_OF_LIFE_G else (low, length)
        # Impacts grow with about the power 1.2 of the length; the next guess is kept within the known bounds.
        guess = length * float(1.005 * END_OF_LIFE_G / reached) ** (1 / 1.2)
        length = guess if low < guess < high else float(np.sqrt(low * high))
    return high
