"""Identification study: stiffness and damping by the zebra algorithm and by others, and their use for adaptation.

CWRU recordings (inner, outer, ball) --first half--> search: optimiser x seed x setting --> convergence
                                                              |
                                       median run of ZOA, DE; the paper's values; the presets
                                                              v
                          second half <--compare-- records simulated with each --> PRD, RMSE, MMD; figures
simulated machines, 10 dB SNR --> identify --> how far off, how often within the intervals

Used in: Paper 3, sections 2.2 and 2.3, DOI 10.1177/10775463261462852.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from papers.arrays import Array
from papers.framework import Inputs, Work, as_input
from papers.options import expect
from papers.paper3_zoa_dann.identification.agreement import agreement
from twingap import BEARINGS, Condition, Record, RecordSet, TwingapError, data, identify
from twingap.identification.contact import BOUNDS
from twingap.identification.contact_bottom import NOTHING
from twingap.identification.contact_objective import SpectrumObjective, states_of
from twingap.identification.optimise import OPTIMISERS, Traced
from twingap.rigs import make_rig
from twingap.twins import ContactTwin, TwinSpec
from twingap.twins.contact_parameters import PRESETS, ContactParameters

WORDS: Final = {
    "zoa": "ZOA, R = 0.1",
    "zoa-ports": "ZOA, R = 0.01",
    "differential-evolution": "differential evolution",
    "random": "random search",
}


@dataclass(frozen=True)
class Size:
    seeds: int
    evaluations: int
    machines: int


@dataclass(frozen=True)
class Options:
    fault_size_inch: float
    load_hp: int
    faults: tuple[str, ...]
    settings: tuple[Literal["physical", "paper"], ...]
    empirical: tuple[float, float]
    printed: tuple[float, float]
    published_drops: tuple[float, ...]
    window_samples: int
    snr_db: float
    machine_stiffness: tuple[float, ...]
    machine_damping: tuple[float, ...]
    machine_duration_s: float
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        for setting, fault in itertools.product(self.settings, self.faults):
            expect(fault, PRESETS[setting].defect_depth_um, "faults")


@dataclass(frozen=True)
class Search:
    """One run of one optimiser on one recording."""

    fault: str
    setting: str
    optimiser: str
    seed: int
    evaluations: int


@dataclass(frozen=True)
class Comparison:
    """One pair of stiffness and damping, simulated and compared."""

    fault: str
    setting: str
    twin: str
    stiffness: float
    damping: float


@dataclass(frozen=True)
class Recovery:
    """One simulated machine whose parameters are sought again."""

    fault: str
    seed: int


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


def compare(job: Comparison, fit: RecordSet, judge: RecordSet, options: Options) -> dict[str, Any]:
    """Levels from the first half of the recording; metrics and an excerpt from the second, with the noises that were
    fitted, and of the contact alone, as the paper has it."""
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
        for metric, value in agreement(measured.samples, simulated.samples, options.window_samples).items():
            out[f"{name}: {metric}"] = value
        if name == "with noises":
            out["simulated"] = simulated.samples.astype(np.float32)
    return out


def recover(job: Recovery, options: Options) -> dict[str, Any]:
    """Make a machine, add white noise, identify; relative errors, and whether the 90 % intervals hold."""
    rng = np.random.default_rng([job.seed, 13])
    drawn = (options.machine_stiffness, options.machine_damping)
    k, c = (float(np.exp(rng.uniform(*np.log(bounds)))) for bounds in drawn)
    own = ContactParameters(k, c, scale=0.1, structure_noise_rms=0.0, white_noise_rms=0.0)
    condition = Condition(job.fault, 1797.0, 12000.0, round(12000 * options.machine_duration_s), job.fault)
    (quiet,) = ContactTwin(BEARINGS["6205"], own, unit="g").simulate([condition], rng)
    noise = rng.standard_normal(condition.n_samples) * quiet.samples.std() * 10 ** (-options.snr_db / 20)
    records = RecordSet.from_records("machine", "g", BEARINGS["6205"], [Record(condition, quiet.samples + noise)])
    found = identify(records, TwinSpec("contact"), seed=rng).estimates
    out: dict[str, Any] = {}
    for name, true in (("stiffness", k), ("damping", c)):
        out[name] = found[name].value / true - 1
        held = found[name].interval
        out[f"{name} inside"] = None if held is None else bool(held[0] <= true <= held[1])
    return out


def recordings(options: Options, root: Path | None) -> tuple[str, tuple[RecordSet, RecordSet]]:
    """One recording per fault, cut into the half that is fitted and the half that is judged on."""
    try:
        records, title = data.load("cwru", root), "CWRU"
    except data.NotAtHandError:
        if root is not None:  # who names data wants those used
            raise
        records, title = make_rig("virtual_cwru", duration_s=4.0).records(0), "virtual rig, not CWRU"
    halves: tuple[list[Record], list[Record]] = ([], [])
    for fault in options.faults:
        wanted = (fault, options.load_hp, options.fault_size_inch)
        abouts = [(c.fault, c.extra["load_hp"], c.extra["fault_size_inch"]) for c in records.conditions]
        if wanted not in abouts:
            what = f"no {fault} recording of {options.fault_size_inch:g} in at {options.load_hp} hp"
            raise TwingapError(what, where=title)
        record = records[abouts.index(wanted)]
        half = record.samples.size // 2
        for number, part in enumerate(halves):
            condition = replace(record.condition, n_samples=half)
            part.append(Record(condition, record.samples[number * half : (number + 1) * half].copy()))
    first, second = (RecordSet.from_records(records.name, records.unit, records.bearing, part) for part in halves)
    return title, (first, second)


def halves(work: Work) -> tuple[RecordSet, RecordSet]:
    work.title, found = recordings(work.options, work.root)
    return found


def searches(work: Work) -> Iterator[Search]:
    """Every optimiser on every recording and setting, all with the same evaluations."""
    options, seeds = work.options, range(work.size.seeds)
    for each in itertools.product(options.faults, options.settings, OPTIMISERS, seeds):
        yield Search(*each, work.size.evaluations)


def both(work: Work) -> Inputs:
    fit, judge = work["halves"]
    return {"fit": (fit, fit.digest), "judge": (judge, judge.digest), **as_input(work)}


def comparisons(work: Work) -> Iterator[Comparison]:
    """The values given, and of ZOA and differential evolution the run of median cost: neither luck nor bad luck."""
    options, found = work.options, work["searches"]
    for fault, setting in itertools.product(options.faults, options.settings):
        values = _values(options, setting)
        for optimiser in ("zoa", "differential-evolution"):
            wanted = (fault, setting, optimiser)
            runs = [r.value for r in found if (r.job.fault, r.job.setting, r.job.optimiser) == wanted]
            middle = sorted(runs, key=lambda v: float(v["best"][-1]))[(len(runs) - 1) // 2]
            values[f"identified, {WORDS[optimiser]}"] = (middle["stiffness"], middle["damping"])
        for name, (stiffness, damping) in values.items():
            yield Comparison(fault, setting, name, stiffness, damping)


def machines(work: Work) -> Iterator[Recovery]:
    for fault, seed in itertools.product(work.options.faults, range(work.size.machines)):
        yield Recovery(fault, seed)


def _values(options: Options, setting: str) -> dict[str, tuple[float, float]]:
    """Stiffness and damping that are not identified, by name."""
    if setting == "paper":
        return {"empirical": options.empirical, "paper preset": options.printed}
    preset = PRESETS[setting]
    return {f"{setting} preset": (preset.stiffness, preset.damping)}


def _share(parts: Sequence[Array], powers: Array) -> float:
    """Part of the fitted power that is the contact's vibration rather than noise."""
    weighed = np.sum([powers * part.sum(axis=1) for part in parts], axis=0)
    return float(weighed[0] / weighed.sum())
