"""Study of live updating: errors of a twin that is kept up to date, against a frozen one.

virtual machine that drifts --> states, snapshots --> poor line --> frozen | laws alone | identification alone | live
            (rigs.drifting)                                                    |
                              spectrum of each snapshot, predicted before it is seen --> error, by arm and phase
virtual machine that does not drift --> live --> alarms per snapshot, against the stated rate

Used in: Paper 2, section 2 (figure 7: simple state signals update the model; results and collected data are compared).
The paper prints no number. The machine is virtual and so is every number here; it shares no code with the twin.
"""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from papers.framework import Work
from papers.options import expect
from papers.paper2_digital_twin.live_twin.messages import Message, OrderOptions, Snapshot, StateMessage
from papers.paper2_digital_twin.live_twin.twin import LiveOptions, LiveTwin
from twingap import BEARINGS
from twingap.rigs.drifting import Drifting, arrivals
from twingap.twins.contact_parameters import PRESETS

ARMS: Final[dict[str, tuple[bool, bool]]] = {
    "frozen": (False, False),
    "laws alone": (True, False),
    "identification alone": (False, True),
    "live": (True, True),
}
"""Name -> whether it follows temperature, whether it is identified anew."""


@dataclass(frozen=True)
class Line:
    """How messages arrive; see `twingap.rigs.drifting.arrivals`; explained in config.toml."""

    delay_s: float
    late: float
    late_s: float
    lost: float
    repeated: float


@dataclass(frozen=True)
class Size:
    seeds: int
    steady: int
    steady_hours: float


@dataclass(frozen=True)
class Options:
    bearing: str
    preset: Literal["physical", "paper"]
    hours: float
    snapshot_period_s: float
    state_period_s: float
    snapshot_s: float
    fs_hz: float
    lateness_s: float
    false_alarms: float
    halved: float
    most_ms: float
    poor_line: Line
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        expect(self.bearing, BEARINGS, "bearing")


@dataclass(frozen=True)
class Scenario:
    """One machine."""

    seed: int
    drift: float
    hours: float
    arms: tuple[str, ...]


def drifting(work: Work) -> Iterator[Scenario]:
    """Machines that drift, every arm on each."""
    for seed in range(work.seed, work.seed + work.size.seeds):
        yield Scenario(seed, 1.0, work.options.hours, tuple(ARMS))


def steady(work: Work) -> Iterator[Scenario]:
    """Machines that do not, on which every alarm is a false one."""
    for seed in range(work.seed, work.seed + work.size.steady):
        yield Scenario(seed, 0.0, work.size.steady_hours, ("live",))


def machine_of(job: Scenario, options: Options) -> Drifting:
    periods = options.state_period_s, options.snapshot_period_s
    return Drifting(job.hours, job.drift, *periods, options.snapshot_s, options.fs_hz)


def messages_of(job: Scenario, machine: Drifting, line: Line) -> list[Message]:
    """What the machine's instruments send, as it arrives over the line."""
    course, rng = machine.course(job.seed), np.random.default_rng([job.seed, 17])
    signals = zip(course.time_s, course.temperature_c, course.speed_rpm, course.load_n, strict=True)
    states: list[Message] = [
        StateMessage(float(at), float(temperature), float(rpm), float(load), i)
        for i, (at, temperature, rpm, load) in enumerate(signals)
    ]
    snapshots: list[Message] = [
        Snapshot(float(r.condition.time_s or 0.0), r.samples, r.condition.fs_hz, number=i)
        for i, r in enumerate(machine.records(job.seed))
    ]
    sent = sorted([*states, *snapshots], key=lambda m: (m.time_s, isinstance(m, Snapshot)))
    _, which = arrivals(np.array([m.time_s for m in sent]), rng, **dataclasses.asdict(line))
    return [sent[i] for i in which]


def live_through(job: Scenario, options: Options) -> dict[str, Any]:
    """All twins live through the same run; what each made of every snapshot, what it changed and when."""
    machine = machine_of(job, options)
    arrived = messages_of(job, machine, options.poor_line)
    # The last vibration and what follows it are kept back, so that the twins can be asked for its spectrum first.
    last = max((m for m in arrived if isinstance(m, Snapshot)), key=lambda m: m.time_s)
    before = [m for m in arrived if m.time_s <= last.time_s and m is not last]
    after = [m for m in arrived if m.time_s > last.time_s or m is last]
    out: dict[str, Any] = {"arms": {}}
    for name in job.arms:
        follow, identify = ARMS[name]
        own = LiveOptions(follow_temperature=follow, reidentify=identify, rate=options.false_alarms)
        order = OrderOptions(lateness_s=options.lateness_s)
        twin = LiveTwin(BEARINGS[options.bearing], PRESETS[options.preset], options.fs_hz, options=own, order=order)
        for message in before:
            twin.receive(message)
        twin.flush()
        assert twin.state is not None
        predicted = twin.predict(twin.state)
        for message in sorted(after, key=lambda m: m.time_s):
            twin.receive(message)
        twin.flush()
        judged, updates = twin.journal.judged(), twin.journal.frame()
        out["arms"][name] = {
            "judged": {c: judged[c].tolist() for c in ("time_s", "error", "shape")},
            "updates": {c: updates[c].tolist() for c in updates} if len(updates) else {},
            "messages": [[kind, case, n] for (kind, case), n in sorted(twin.journal.counts.items())],
            "predicted": predicted, "commissioning": own.commissioning,
        }  # fmt: skip
        band, chance = twin.band, 0.5 / float(np.sqrt(twin.band.averages(last.samples.size)))
    course = machine.course(job.seed)
    drifts = ("time_s", "temperature_c", "stiffness", "damping")
    return out | {
        "measured": band.amplitude(last.samples), "chance": chance, "course": {c: getattr(course, c) for c in drifts},
    }  # fmt: skip
