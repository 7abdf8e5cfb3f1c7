"""Study of live updating: errors of a twin that is kept up to date, against a frozen one.

virtual machine that drifts --> states, snapshots --> poor line --> frozen | laws alone | identification alone | live
            (rigs.drifting)                                                    |
                              spectrum of each snapshot, predicted before it is seen --> error, by arm and phase
virtual machine that does not drift --> live --> alarms per snapshot, against the stated rate

Used in: Paper 2, section 2 (figure 7: simple state signals update the model; results and collected data are compared).
The paper prints no number. The machine is virtual and so is every number here; it shares no code with the twin.
Run as part of the paper, or alone: python -m papers.paper2_digital_twin.live --out DIR
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

import twingap._compiled
import twingap.bearing
import twingap.effects
import twingap.rigs.drifting
import twingap.signal
import twingap.streams
import twingap.twins
from papers.paper2_digital_twin import live_study, live_twin
from papers.paper2_digital_twin.live_study import (
    CONFIG,
    DATA,
    LiveStudy,
    LiveStudyOptions,
    Scenario,
    read_live,
)
from papers.paper2_digital_twin.live_twin import LiveOptions, LiveTwin, Message, OrderOptions, Snapshot, StateMessage
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.bearing import BEARINGS
from twingap.provenance import digest_of_code
from twingap.rigs.drifting import Drifting, arrivals
from twingap.sweep import Result, sweep
from twingap.twins.contact_parameters import PRESETS

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]
ARMS: Final[dict[str, tuple[bool, bool]]] = {
    "frozen": (False, False),
    "laws alone": (True, False),
    "identification alone": (False, True),
    "live": (True, True),
}
"""Name -> whether it follows temperature, whether it is identified anew."""


def machine_of(job: Scenario) -> Drifting:
    """The machine of a scenario."""
    return Drifting(job.hours, job.drift, job.state_period_s, job.snapshot_period_s, job.snapshot_s, job.fs_hz)


def messages_of(job: Scenario, machine: Drifting) -> tuple[list[Message], list[Message]]:
    """What the machine's instruments send, in order; and the same as it arrives over the line."""
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
    _, which = arrivals(
        np.array([m.time_s for m in sent]), rng, delay_s=job.line.delay_s, late=job.line.late, late_s=job.line.late_s,
        lost=job.line.lost, repeated=job.line.repeated,
    )  # fmt: skip
    return sent, [sent[i] for i in which]


def live_through(job: Scenario) -> dict[str, Any]:
    """All twins live through the same run; what each made of every snapshot, what it changed and when."""
    machine = machine_of(job)
    sent, arrived = messages_of(job, machine)
    # The last vibration and what follows it are kept back, so that the twins can be asked for its spectrum first.
    last = max((m for m in arrived if isinstance(m, Snapshot)), key=lambda m: m.time_s)
    before = [m for m in arrived if m.time_s <= last.time_s and m is not last]
    after = [m for m in arrived if m.time_s > last.time_s or m is last]
    out: dict[str, Any] = {"arms": {}}
    for name in job.arms:
        follow, identify = ARMS[name]
        options = LiveOptions(follow_temperature=follow, reidentify=identify, rate=job.false_alarms)
        twin = LiveTwin(
            BEARINGS[job.bearing], PRESETS[job.preset], job.fs_hz, options=options,
            order=OrderOptions(lateness_s=job.lateness_s),
        )  # fmt: skip
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
            "predicted": predicted, "commissioning": options.commissioning,
        }  # fmt: skip
        band, chance = twin.band, 0.5 / float(np.sqrt(twin.band.averages(last.samples.size)))
    out |= {"f_hz": band.f_hz[band.inside], "measured": band.amplitude(last.samples), "chance": chance}
    course = machine.course(job.seed)
    out["course"] = {
        "time_s": course.time_s, "temperature_c": course.temperature_c, "stiffness": course.stiffness,
        "damping": course.damping, "clearance_um": course.clearance_um,
    }  # fmt: skip
    out["sent"] = len(sent)
    return out


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> LiveStudy:
    """Run the study; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path or None
        Not needed here: no public data set holds a machine with its temperature and its truth.
    seed : int
        First of the machines.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables, figures and the first machine's updates go there as well.
    progress : callable
    config : Path
    draw : bool
        Make the figures.
    """
    options = read_live(config)
    sizes = profile_of(options.profiles, profile, config)
    jobs = [_scenario(options, seed + i, 1.0, options.hours, tuple(ARMS)) for i in range(sizes.seeds)]
    still = [_scenario(options, seed + i, 0.0, sizes.steady_hours, ("live",)) for i in range(sizes.steady)]
    code = digest_of_code(
        sys.modules[__name__], live_study, live_twin, twingap.bearing, twingap.effects, twingap.rigs.drifting,
        twingap.signal, twingap._compiled, twingap.streams, twingap.twins,
    )  # fmt: skip
    given: dict[str, Any] = {
        "store": out / "results", "backend": backend, "address": address, "version": code,
        "on_result": Count("live updating", len(jobs) + len(still), progress),
    }  # fmt: skip
    drifting: list[Result[Scenario]] = sweep(live_through, jobs, **given)
    steady: list[Result[Scenario]] = sweep(live_through, still, **given)
    from papers.paper2_digital_twin import tables_live as tables

    study = LiveStudy(options, drifting, steady, tables.all_tables(options, drifting, steady))
    keep_tables(study.tables, out, log)
    if log is not None:
        log.metrics({f"error, {r['arm']}": r["error mean"] for r in study.tables["live-errors"].to_dict("records")
                     if r["phase"] == "after commissioning"})  # fmt: skip
    if draw:
        from papers.paper2_digital_twin import figures_live as figures

        keep_figures(figures.all_figures(study), out, log)
    return study


def _scenario(options: LiveStudyOptions, seed: int, drift: float, hours: float, arms: tuple[str, ...]) -> Scenario:
    return Scenario(
        seed, drift, hours, options.bearing, options.preset, options.snapshot_period_s, options.state_period_s,
        options.snapshot_s, options.fs_hz, options.lateness_s, options.false_alarms, options.poor_line, arms,
    )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "Live updating of paper 2's twin: tables and figures.",
        lambda study: {f"{name} ({DATA})": frame.head(30) for name, frame in study.tables.items()},
        arguments, takes=("seed",),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper2_digital_twin.live import main as run_main

    run_main()
