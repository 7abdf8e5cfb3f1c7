"""Identification study: stiffness and damping by the zebra algorithm and by others, and their use for adaptation.

CWRU recordings (inner, outer, ball) --first half--> search: optimiser x seed x setting --> convergence
                                                              |
                                       median run of ZOA, DE; the paper's values; the presets
                                                              v
                          second half <--compare-- records simulated with each --> PRD, RMSE, MMD; figures
simulated machines, 10 dB SNR --> identify --> how far off, how often within the intervals

Used in: Paper 3, sections 2.2 and 2.3, DOI 10.1177/10775463261462852. Run as part of the paper, or alone:
python -m papers.paper3_zoa_dann.identification --profile full --out DIR
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import twingap.identification
import twingap.twins
from papers.paper3_zoa_dann import agreement as agreement_module
from papers.paper3_zoa_dann import identification_study
from papers.paper3_zoa_dann.agreement import agreement
from papers.paper3_zoa_dann.identification_study import (
    CONFIG,
    WORDS,
    Comparison,
    Recovery,
    Search,
    Study,
    StudyOptions,
    read_study,
)
from papers.studies import command
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification import identify
from twingap.identification.contact import BOUNDS
from twingap.identification.contact_bottom import NOTHING
from twingap.identification.contact_objective import SpectrumObjective, states_of
from twingap.identification.optimise import OPTIMISERS, Traced
from twingap.provenance import digest_of_code
from twingap.records import Condition, Record, RecordSet
from twingap.sweep import Result, sweep
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import PRESETS, ContactParameters
from twingap.twins.twin_file import TwinSpec

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]


def objective_of(fault: str, setting: str, fit: RecordSet) -> SpectrumObjective:
    """How far the twin of a setting is from the recording with this fault; the same for all optimisers and seeds."""
    records = fit.select(lambda c: c.fault == fault)
    assert records.bearing is not None
    states = states_of(records, [])
    starts = np.random.default_rng(0).random((sum(len(s.conditions) for s in states), 3))
    return SpectrumObjective(ContactTwin(records.bearing, PRESETS[setting], unit=records.unit), states, starts, {})


def search(job: Search, fit: RecordSet) -> dict[str, Any]:
    """Run an optimiser: least cost after each evaluation, and where it was."""
    traced = Traced(objective_of(job.fault, job.setting, fit))
    bounds = np.log([BOUNDS["stiffness"], BOUNDS["damping"]])
    best = OPTIMISERS[job.optimiser](traced, bounds, np.random.default_rng([job.seed, 11]), job.evaluations)
    return {"best": traced.best, "stiffness": float(np.exp(best[0])), "damping": float(np.exp(best[1]))}


def compare(job: Comparison, fit: RecordSet, judge: RecordSet) -> dict[str, Any]:
    """Levels from the first half of the recording; metrics and an excerpt from the second.

    Two readings of the twin: with the noises whose levels were fitted, and the contact alone, as the paper has it.
    """
    objective = objective_of(job.fault, job.setting, fit)
    own = replace(objective.twin.parameters, stiffness=job.stiffness, damping=job.damping)
    (parts,) = objective.components([own])
    if parts is None:
        raise TwingapError("cannot be simulated at this sampling rate", where=f"K = {job.stiffness:g}")
    cost, powers = objective.match(parts)
    # Where the fit leaves nothing to the contact, noise alone through its mode is what was identified.
    scale = float(np.sqrt(max(powers[0], NOTHING * powers.sum())))
    structure, white = (float(v) / scale for v in np.sqrt(powers[1:]))
    (measured,) = judge.select(lambda c: c.fault == job.fault)
    out: dict[str, Any] = {"cost": cost, "contact share": float(_share(parts, powers))}
    for name, noise in (("with noises", (structure, white)), ("contact alone", (0.0, 0.0))):
        made = replace(own, scale=scale, structure_noise_rms=noise[0], white_noise_rms=noise[1])
        twin = ContactTwin(objective.twin.bearing, made, unit=judge.unit)
        (simulated,) = twin.simulate([measured.condition], np.random.default_rng(1))
        for metric, value in agreement(measured.samples, simulated.samples, job.window_samples).items():
            out[f"{name}: {metric}"] = value
        if name == "with noises":
            out["simulated"] = simulated.samples.astype(np.float32)
    return out


def recover(job: Recovery) -> dict[str, Any]:
    """Make a machine, add white noise, identify; relative errors, and whether the 90 % intervals hold."""
    rng = np.random.default_rng([job.seed, 13])
    k, c = (float(np.exp(rng.uniform(*np.log(bounds)))) for bounds in (job.stiffness, job.damping))
    own = ContactParameters(k, c, scale=0.1, structure_noise_rms=0.0, white_noise_rms=0.0)
    condition = Condition(job.fault, 1797.0, 12000.0, round(12000 * job.duration_s), job.fault)
    (quiet,) = ContactTwin(BEARINGS["6205"], own, unit="g").simulate([condition], rng)
    noise = rng.standard_normal(condition.n_samples) * quiet.samples.std() * 10 ** (-job.snr_db / 20)
    records = RecordSet.from_records("machine", "g", BEARINGS["6205"], [Record(condition, quiet.samples + noise)])
    found = identify(records, TwinSpec("contact"), seed=rng).estimates
    out: dict[str, Any] = {}
    for name, true in (("stiffness", k), ("damping", c)):
        estimate = found[name]
        out[name] = estimate.value / true - 1
        held = estimate.interval
        out[f"{name} inside"] = None if held is None else bool(held[0] <= true <= held[1])
    return out


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> Study:
    """Run the study; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without CWRU records the virtual rig is taken, and every table says so.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figures go there as well.
    progress : callable
    config : Path
    draw : bool
        Make the figures.
    """
    options = read_study(config)
    if profile not in options.profiles:
        known = ", ".join(options.profiles)
        raise TwingapError(f"unknown profile {profile!r}", where=config, mend=f"use one of {known}")
    sizes = options.profiles[profile]
    data, (fit, judge) = recordings(options, root)
    assert fit.bearing is not None
    code = digest_of_code(
        sys.modules[__name__], identification_study, agreement_module, twingap.identification, twingap.twins
    )
    searches = [
        Search(fault, setting, optimiser, seed, sizes.evaluations)
        for fault in options.faults
        for setting in options.settings
        for optimiser in OPTIMISERS
        for seed in range(sizes.seeds)
    ]
    machines = [
        Recovery(
            fault, seed, options.snr_db, options.machine_stiffness, options.machine_damping, options.machine_duration_s
        )
        for fault in options.faults
        for seed in range(sizes.machines)
    ]
    pairs = len(options.faults) * sum(len(_values(options, setting)) + 2 for setting in options.settings)
    done, total = 0, len(searches) + pairs + len(machines)

    def step(_: Result[Any]) -> None:
        nonlocal done
        done += 1
        progress("identification", done, total)

    swept = functools.partial(
        sweep, store=out / "results", backend=backend, address=address, version=code, on_result=step
    )
    found: list[Result[Search]] = swept(functools.partial(search, fit=fit), searches, data={"fit": fit.digest})
    comparisons = list(_comparisons(options, found))
    compared: list[Result[Comparison]] = swept(
        functools.partial(compare, fit=fit, judge=judge), comparisons, data={"fit": fit.digest, "judge": judge.digest}
    )
    recovered: list[Result[Recovery]] = swept(recover, machines)
    from papers.paper3_zoa_dann import tables_identification as tables

    made = tables.all_tables(options, data, found, compared, recovered)
    study = Study(data, options, found, compared, recovered, made, fit.bearing)
    for name, frame in made.items():
        tables.write(frame, out / "tables" / name, data)
        if log is not None:
            log.table(name, frame)
    if draw:
        from papers.paper3_zoa_dann import figures_identification as figures

        for name, figure in figures.all_figures(study, judge):
            figures.write(figure, out / "figures" / f"{name}.png")
            if log is not None:
                log.figure(name, figure)
    return study


def recordings(options: StudyOptions, root: Path | None) -> tuple[str, tuple[RecordSet, RecordSet]]:
    """One recording per fault, cut into the half that is fitted and the half that is judged on."""
    from twingap import data
    from twingap.rigs import make_rig

    try:
        records, title = data.load("cwru", root), "CWRU"
    except data.NotAtHandError:
        if root is not None:  # who names data wants those used
            raise
        records, title = make_rig("virtual_cwru", duration_s=4.0).records(0), "virtual rig, not CWRU"
    halves: tuple[list[Record], list[Record]] = ([], [])
    for fault in options.faults:
        wanted = (fault, options.load_hp, options.fault_size_inch)
        places = [
            i
            for i, c in enumerate(records.conditions)
            if (c.fault, c.extra["load_hp"], c.extra["fault_size_inch"]) == wanted
        ]
        if not places:
            raise TwingapError(
                f"no {fault} recording of {options.fault_size_inch:g} in at {options.load_hp} hp", where=title
            )
        record = records[places[0]]
        half = record.samples.size // 2
        for number, part in enumerate(halves):
            condition = replace(record.condition, n_samples=half)
            part.append(Record(condition, record.samples[number * half : (number + 1) * half].copy()))
    first, second = (RecordSet.from_records(records.name, records.unit, records.bearing, part) for part in halves)
    return title, (first, second)


def _values(options: StudyOptions, setting: str) -> dict[str, tuple[float, float]]:
    """Stiffness and damping that are not identified, by name."""
    empirical, printed = (options.empirical[0], options.empirical[1]), (options.printed[0], options.printed[1])
    if setting == "paper":
        return {"empirical": empirical, "paper preset": printed}
    preset = PRESETS[setting]
    return {f"{setting} preset": (preset.stiffness, preset.damping)}


def _comparisons(options: StudyOptions, found: Sequence[Result[Search]]) -> list[Comparison]:
    """The values given, and of ZOA and differential evolution the run of median cost: neither luck nor bad luck."""
    out = []
    for fault in options.faults:
        for setting in options.settings:
            values = _values(options, setting)
            for optimiser in ("zoa", "differential-evolution"):
                runs = [
                    r.value
                    for r in found
                    if (r.job.fault, r.job.setting, r.job.optimiser) == (fault, setting, optimiser)
                ]
                middle = sorted(runs, key=lambda v: float(v["best"][-1]))[(len(runs) - 1) // 2]
                values[f"identified, {WORDS[optimiser]}"] = (middle["stiffness"], middle["damping"])
            out += [Comparison(fault, setting, name, k, c, options.window_samples) for name, (k, c) in values.items()]
    return out


def _share(parts: Sequence[Array], powers: Array) -> float:
    """Part of the fitted power that is the contact's vibration rather than noise."""
    weighed = np.sum([powers * part.sum(axis=1) for part in parts], axis=0)
    return float(weighed[0] / weighed.sum())


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "Identification of paper 3's twin: tables and figures.",
        lambda study: {f"{name} ({study.data})": frame for name, frame in study.tables.items()},
        arguments, takes=("root",),
    )  # fmt: skip


if __name__ == "__main__":
    # Workers look functions up by module, and this one is called __main__ here.
    from papers.paper3_zoa_dann.identification import main as start

    start()
