"""An update of the live twin against identifying the contact twin anew from the same snapshots."""

from __future__ import annotations

import copy
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.harness import Measurement, Target, in_turn, ratio
from papers.paper2_digital_twin.live_twin.messages import Snapshot, StateMessage
from papers.paper2_digital_twin.live_twin.refit import relative_error
from papers.paper2_digital_twin.live_twin.spectrum import Band, MachineState
from papers.paper2_digital_twin.live_twin.twin import LiveOptions, LiveTwin
from twingap.bearing import BEARINGS
from twingap.identification import identify
from twingap.records import Condition, Record, RecordSet
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import ContactParameters
from twingap.twins.twin_file import TwinSpec

FS_HZ, SECONDS, WINDOW = 12000.0, 1.0, LiveOptions().window
NEW = ContactParameters(stiffness=8e9, damping=450.0, edge=1.0)
WORN = replace(NEW, stiffness=7.6e9, damping=520.0)
"""What has happened: a twentieth of the stiffness lost, some damping gained."""
STATE = MachineState(0.0, 40.0, 1800.0, 500.0)
MOST_S = 0.1


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Cost and quality of both on the same snapshots, for a healthy and (not when quick) a defective bearing."""
    rows, targets, notes = [], [], []
    for fault in ("healthy",) if quick else ("healthy", "outer", "inner", "ball"):
        before, after = _snapshots(NEW, 12, fault, seed), _snapshots(WORN, 2 * WINDOW, fault, seed + 1)
        fitted, judged = after[:WINDOW], after[WINDOW:]
        twin, commissioning = LiveTwin(BEARINGS["6205"], NEW, FS_HZ), LiveOptions().commissioning
        for place, record in enumerate([*before[:commissioning], *fitted[:-1]]):
            _tell(twin, place, record, fault)
        spent: list[float] = []
        records = RecordSet.from_records("window", "m/s^2", BEARINGS["6205"], fitted)
        spec = TwinSpec("contact", parameters={"scale": 1.0})
        updated = copy.deepcopy(twin)
        _tell(updated, commissioning + WINDOW, fitted[-1], fault)
        live = _update(twin, commissioning + WINDOW, fitted[-1], fault, spent)
        seconds = in_turn({"live": live, "anew": _identify(spec, records, seed)}, 2 if quick else 3)
        errors = {"frozen": _error(NEW, judged, fault), "live": _error(updated.parameters, judged, fault)}
        found = identify(records, spec, seed=seed).estimates
        value = {name: estimate.value for name, estimate in found.items()}
        again = replace(
            NEW, stiffness=value["stiffness"], damping=value["damping"],
            structure_noise_rms=value["structure_noise_rms"], white_noise_rms=value["white_noise_rms"],
        )  # fmt: skip
        errors["anew"] = _error(again, judged, fault)
        times = ratio(seconds["anew"], seconds["live"])
        for name, error in errors.items():
            taken = seconds.get(name)
            rows.append({
                "bearing": fault, "twin": {"live": "live, updated", "anew": "identified anew"}.get(name, name),
                "ms": "" if taken is None else f"{1e3 * statistics.median(taken):.1f}",
                "error on other snapshots": f"{error:.3f}",
            })  # fmt: skip
        cpu = statistics.median(spent)
        targets += [
            Target(f"times faster than identifying anew, {fault}", times, 10.0),
            Target(f"{1e3 * MOST_S:g} ms over the CPU time of an update, {fault}", MOST_S / cpu, 1.0),
            Target(f"error identified anew over error updated, {fault}", errors["anew"] / errors["live"], 0.9),
        ]
        slowest, clock, count = _costliest(fault, 2 if quick else 8, seed)
        rows.append({
            "bearing": fault, "twin": f"costliest of {count} updates on machines that wear, CPU (clock) time",
            "ms": f"{1e3 * slowest:.1f} ({1e3 * clock:.1f})", "error on other snapshots": "",
        })  # fmt: skip
        targets.append(
            Target(f"{1e3 * MOST_S:g} ms over the CPU time of the costliest update, {fault}", MOST_S / slowest, 1.0)
        )
    notes.append(
        "An update fits stiffness, damping, force level and white noise to the snapshots since the drift began, from "
        f"where the twin stands; identifying anew searches the whole range with {336} evaluations and gives intervals."
    )
    notes.append(f"A perfect twin's error would be {0.5 / np.sqrt(Band.of(FS_HZ, 500.0).averages(round(FS_HZ))):.3f}.")
    return Measurement(f"updates on {WINDOW} snapshots of {SECONDS:g} s at {FS_HZ:g} Hz", rows, targets, notes)


def _snapshots(own: ContactParameters, count: int, fault: str, seed: int) -> list[Record]:
    n = round(SECONDS * FS_HZ)
    conditions = [Condition(f"{i}", STATE.speed_rpm, FS_HZ, n, fault, STATE.load_n) for i in range(count)]
    return list(ContactTwin(BEARINGS["6205"], own).simulate(conditions, np.random.default_rng(seed)))


def _tell(twin: LiveTwin, place: int, record: Record, fault: str) -> None:
    twin.receive(StateMessage(600.0 * place, STATE.temperature_c, STATE.speed_rpm, STATE.load_n))
    twin.receive(Snapshot(600.0 * place, record.samples, FS_HZ, fault))
    twin.flush()


def _update(twin: LiveTwin, place: int, record: Record, fault: str, spent: list[float]) -> Callable[[], object]:
    """The last snapshot of the window arrives at a copy of the twin; CPU seconds of all that follows are noted."""

    def call() -> object:
        own = copy.deepcopy(twin)
        started = time.process_time()
        _tell(own, place, record, fault)
        spent.append(time.process_time() - started)
        return own

    return call


def _costliest(fault: str, machines: int, seed: int) -> tuple[float, float, int]:
    """CPU and clock seconds of the costliest updates, and their number.

    Machines lose a quarter or 7 % of their stiffness at once and some damping; speed and load differ from snapshot to
    snapshot, so that nothing found for one state serves another.
    """
    spent: list[float] = []
    clock: list[float] = []
    healthy, worn = 12, 14
    for machine in range(machines):
        rng = np.random.default_rng([seed, 41, machine])
        after = replace(
            NEW, stiffness=NEW.stiffness * (0.93 if machine % 2 else 0.75), damping=NEW.damping * rng.uniform(0.7, 1.4)
        )
        rpm = STATE.speed_rpm * (1 + 0.02 * rng.standard_normal(healthy + worn))
        load = STATE.load_n * (1 + 0.05 * rng.standard_normal(healthy + worn))
        at = [
            Condition(f"{i}", float(r), FS_HZ, round(SECONDS * FS_HZ), fault, float(n))
            for i, (r, n) in enumerate(zip(rpm, load, strict=True))
        ]
        records = [
            *ContactTwin(BEARINGS["6205"], NEW).simulate(at[:healthy], rng),
            *ContactTwin(BEARINGS["6205"], after).simulate(at[healthy:], rng),
        ]
        twin = LiveTwin(BEARINGS["6205"], NEW, FS_HZ)
        for place, (record, condition) in enumerate(zip(records, at, strict=True)):
            twin.receive(StateMessage(600.0 * place, STATE.temperature_c, condition.speed_rpm, condition.load_n))
            twin.receive(Snapshot(600.0 * place, record.samples, FS_HZ, fault))
            began, started = time.perf_counter(), time.process_time()
            done = twin.flush()
            if any(update.kind != "commissioning" for update in done):
                spent.append(time.process_time() - started)
                clock.append(time.perf_counter() - began)
    return max(spent), max(clock), len(spent)


def _identify(spec: TwinSpec, records: RecordSet, seed: int) -> Callable[[], object]:
    return lambda: identify(records, spec, seed=seed)


def _error(own: ContactParameters, judged: list[Record], fault: str) -> float:
    """Relative error of the amplitude spectra of snapshots that neither was fitted to."""
    from papers.paper2_digital_twin.live_twin.laws import Laws
    from papers.paper2_digital_twin.live_twin.spectrum import SpectrumModel

    model, band = SpectrumModel(BEARINGS["6205"], own, Laws(), follow=False), Band.of(FS_HZ, 500.0)
    states = [replace(STATE, time_s=float(i), fault=fault) for i in range(len(judged))]
    predicted = model.predict(model.start(STATE, FS_HZ), states, band, slopes=False)
    return relative_error([band.amplitude(r.samples) for r in judged], predicted)
