"""The diagnosis of a twin: calibrate, search for missing effects, test on held-out records, report.

records, twin (or simulated records) --calibrate--> Evidence --explain--> effects that the twin lacks
held-out part against replicates of the twin, before and after --> places, tests, closures --> GapReport
"""

from __future__ import annotations

import copy
import dataclasses
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from twingap.effects import Effect, catalogue
from twingap.errors import TwingapError
from twingap.files import replacing, replacing_folder
from twingap.gap.distance.closure import Closure, closure_interval, paired
from twingap.gap.distance.closure_metrics import TrainingSets, closure_metrics
from twingap.gap.distance.curves import curves
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.localisation import locate
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.two_sample_tests import overall_tests
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.knowledge import shipped
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.report.files import write_report
from twingap.gap.report.model import Candidate, GapReport, ParameterValue, Place, StandIns, Status, Verdict
from twingap.gap.search.closest_twin import closest_spec, stand_ins
from twingap.gap.search.effect_search import ALPHA, ALPHA_REST, SURE, Estimated, Explanation, estimate, explain
from twingap.gap.search.evidence import THOROUGH, Compared, Evidence, replicates_of, simulator_of
from twingap.gap.search.exchange_test import exchange_p_value
from twingap.gap.search.modelled_effects import completed
from twingap.identify.calibrate import Calibrated, calibrate_prepared, prepare
from twingap.provenance import versions
from twingap.records import Condition, Record, RecordSet
from twingap.records.folder import read_record_set, write_records
from twingap.streams import root_entropy
from twingap.twins.simulator import Simulator, TwinSimulator
from twingap.twins.twin_file import Provenance, TwinSpec, flat, overruled, read_twin, write_twin

Progress = Callable[[str, float], None]
"""progress(what, fraction): what is being done, and which part of the whole is done, 0 to 1."""
FilePath = str | os.PathLike[str]

MOST_RECORDS: Final = 240
"""Records that a diagnosis looks at; of more, as many of each fault and speed are taken as this allows."""
_SIMULATED: Final = 220
"""Simulated records that tests and places are measured with, all replicates together."""
_UNITS: Final = {
    "resonance_hz": "Hz", "structure_noise_rms": "of scale", "white_noise_rms": "of scale",
    "scale": "unit of the records",
    **{f"impact_amplitude.{fault}": "of scale" for fault in ("inner", "outer", "ball", "cage")},
}  # fmt: skip
_OTHER_LEVEL: Final = 0.02
"""Log ratio of levels from which it is told that effects changed them."""
AT_FLOOR: Final = 0.9
"""Closure that the interval has to reach for a gap to be called explained."""
PLAIN_REST: Final = 0.01
"""Family-wise p at and below which a place of the rest keeps a gap from being explained. At 0.05 a fitted value that is
off by a little would: right verdicts leave places at 0.03 to 0.04."""
_LIKELY: Final = 0.02
"""Probability below which a candidate's baseline is not matched anew: its closure says that it is none."""


@dataclass(frozen=True)
class Diagnosis:
    """A finished diagnosis: its report, and simulators of the twin before and after.

    Parameters
    ----------
    report : GapReport
    explanation : Explanation
    calibrated : Calibrated
    root : int
        Entropy that all simulated records derive from.
    closest : Compared or None
        The twin with the verdict's effects and stand-ins; None where stand-ins were not asked for or do not help.
    closest_asked : bool
        Whether `write` writes the closest twin too.
    """

    report: GapReport
    explanation: Explanation
    calibrated: Calibrated
    root: int
    closest: Compared | None = None
    closest_asked: bool = False

    def sim_before(self) -> Iterator[Record]:
        """Records of the calibrated twin as given, for the conditions of all records used."""
        return self._simulated(self.explanation.before.simulator, ())

    def sim_after(self) -> Iterator[Record]:
        """The same with the verdict's effects added."""
        after = self.explanation.after if self.explanation.gap else self.explanation.before
        return self._simulated(after.simulator, after.effects)

    def sim_closest(self) -> Iterator[Record]:
        """The same with stand-ins too; equal to `sim_after` where there are none."""
        return self._simulated(self._closest.simulator, self._closest.effects)

    def closest_twin(self) -> TwinSpec | None:
        """The twin with the verdict's effects and stand-ins at their fitted values; None for finished records."""
        spec = closest_spec(self._closest)
        if spec is None:
            return None
        stated = self.report.provenance
        source = Provenance(
            str(stated["records_sha256"]), self.calibrated.fit.unit, version=str(stated["version"]),
            method="twingap gap --closest", seed=int(stated["seed"]),
        )  # fmt: skip
        return replace(spec, bearing=self.calibrated.frame.bearing, identified=source)

    def write(self, folder: FilePath, *, export: bool = False, progress: Progress | None = None) -> tuple[Path, ...]:
        """Write gap.json and report.html into a folder, all files or none.

        A diagnosis with ``closest=True`` also writes closest.toml, unless it was of finished simulated records.

        Parameters
        ----------
        folder : path-like
            Made when missing.
        export : bool
            Also write the record sets sim_before and sim_after, and with ``closest=True`` sim_closest.
        progress : callable, optional
            Called with what is done and the part of the whole, 0 to 1.

        Returns
        -------
        tuple of Path
            What was written, gap.json first.

        Raises
        ------
        TwingapError
            When the folder cannot be written, or holds one of the record sets already.
        """
        folder, told = Path(folder), progress or _quiet
        sets = {"sim_before": self.sim_before, "sim_after": self.sim_after, "sim_closest": self.sim_closest}
        names = tuple(sets)[: 3 if self.closest_asked else 2] if export else ()
        twin = self.closest_twin() if self.closest_asked else None
        records, bearing = self.calibrated.fit, self.calibrated.frame.bearing
        further = [*([folder / "closest.toml"] if twin is not None else []), *(folder / name for name in names)]
        with ExitStack() as places:
            if twin is not None:
                write_twin(places.enter_context(replacing(folder / "closest.toml")), twin)
            for done, name in enumerate(names):
                told(f"write {name}", done / len(names))
                label = f"{self.report.provenance['records']}, {name.removeprefix('sim_')}"
                place = places.enter_context(replacing_folder(folder / name))
                write_records(place, label, records.unit, bearing, None, sets[name]())
            return (*write_report(self.report, folder), *further)

    def _repr_html_(self) -> str:
        """The report's verdict and effects, for notebooks."""
        return self.report._repr_html_()

    @property
    def _closest(self) -> Compared:
        found = self.explanation
        return self.closest or (found.after if found.gap else found.before)

    def _simulated(self, simulator: Simulator, effects: tuple[Effect, ...]) -> Iterator[Record]:
        parts = (self.calibrated.fit, self.calibrated.held_out)
        by_name = {condition.name: condition for part in parts for condition in part.conditions}
        for name in self.calibrated.names:
            if name in by_name:
                yield from simulator.simulate(effects, (by_name[name],), self.root, 1)


def diagnose(
    records: RecordSet | FilePath,
    twin: TwinSpec | FilePath,
    *,
    seed: int | np.random.Generator = 0,
    sim: RecordSet | FilePath | None = None,
    closest: bool = False,
    learnt: Learnt | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose where records and twin differ, which effects the twin lacks, and what adding them closes.

    Parameters
    ----------
    records : RecordSet or path-like
        Records of the machine, or the folder that holds them.
    twin : TwinSpec or path-like
        What is modelled already, or its twin file.
    seed : int or numpy.random.Generator
        Same seed, same result. The report states -1 for a generator.
    sim : RecordSet or path-like, optional
        Simulated records of the user's own simulator, in place of the twin's.
    closest : bool
        Whether to look, where a rest remains, for effects that bring the twin closer (stand-ins): takes minutes.
    learnt : Learnt, optional
        What was learnt from simulated gaps; None takes what the package ships with.
    progress : callable, optional
        Called with what is done and the part of the whole, 0 to 1.

    Returns
    -------
    Diagnosis

    Raises
    ------
    TwingapError
        When a file cannot be read, or the records cannot be diagnosed.
    """
    begin, told = time.monotonic(), progress or _quiet
    spec, twin_file = (twin, "") if isinstance(twin, TwinSpec) else (read_twin(twin), Path(twin).name)
    records, sim = _record_set(records), None if sim is None else _record_set(sim)
    # One row at a time is predicted from, thousands of times: more threads only wait for each other.
    with threadpool_limits(1, user_api="openmp"):
        found = _diagnosed(records, spec, np.random.default_rng(seed), sim, told, learnt, closest)
    known = {
        "records": records.name,
        "twin": twin_file,
        "twin_model": spec.model,
        "twin_effects": list(spec.effects),
        "version": versions()["twingap"],
        "simulator": "" if sim is None else sim.name,
        "seed": -1 if isinstance(seed, np.random.Generator) else int(seed),
        "records_sha256": records.digest,
        "runtime_s": round(time.monotonic() - begin, 2),
        "n_records": len(records),
    }
    told("done", 1.0)
    return replace(found, report=replace(found.report, provenance={**known, **found.report.provenance}))


def _diagnosed(
    records: RecordSet,
    spec: TwinSpec,
    rng: np.random.Generator,
    sim: RecordSet | None,
    progress: Progress,
    learnt: Learnt | None,
    closest: bool,
) -> Diagnosis:
    """The diagnosis; the provenance of its report states only what is known here."""
    _two_or_more(records)
    brought = spec if sim is None else replace(spec, bearing=sim.bearing)
    notes = [told] if (told := overruled(brought, records.bearing, "twin file" if sim is None else sim.name)) else []
    used = _thinned(records, notes)
    progress("calibration", 0.02)
    prepared = prepare(used, None if sim is not None else spec, rng, sim=sim)
    learnt = shipped() if learnt is None else learnt
    if sim is None:
        spec, completing = completed(prepared, spec, copy.deepcopy(rng), learnt)
        notes += completing
    calibrated = calibrate_prepared(prepared, None if sim is not None else spec, rng)
    root = root_entropy(rng) >> 66
    simulator = simulator_of(calibrated, sim)
    evidence = Evidence(calibrated, simulator, spec, root, THOROUGH)
    found = explain(evidence, learnt, lambda what, part: progress(what, 0.1 + 0.5 * part))
    progress("exchange of records", 0.6)
    found, unlike = _confirmed(found, evidence)
    notes += unlike
    progress("places and tests", 0.65)
    trial = _Trial(evidence, found)
    before = trial.replicates(found.before.simulator, found.before.effects, trial.most)
    first = Paired(trial.real, before)
    located = locate(first, rng)
    tests = tuple(test.test for test in overall_tests(first, rng))
    after = before
    if found.gap and found.after.effects:
        after = trial.replicates(found.after.simulator, found.after.effects, trial.fewer)
    count = min(len(before), len(after))
    progress("closure", 0.75)
    pairs = paired(trial.real, before[:count], after[:count])
    floors = pairs[1].floor(rng)
    floor, _ = floors
    metrics = closure_metrics(trial.real, before[:count], after[:count], rng, more=trial.lessons(), floors=floors)
    closed = closure_interval(*pairs, floor, rng)
    progress("candidates", 0.8)
    candidates = tuple(trial.candidates(learnt, floor, rng, lambda part: progress("candidates", 0.8 + 0.18 * part)))
    rest = locate(Paired(trial.real, after), rng).places if found.gap else ()
    status = _status(found, closed, rest)
    verdict = Verdict(
        status, found.names if status in ("explained", "partly_explained") else (), found.confidence_set,
        found.p_value, *((closed.closure, closed.ci) if found.after.effects and found.gap else (None, None)),
    )  # fmt: skip
    closer, told_closer = None, None
    if closest and status in ("partly_explained", "unexplained"):
        told_closer, closer, tried = _with_stand_ins(trial, (before, after), learnt, rng, progress)
        notes += tried
    rates = sorted({c.fs_hz for c in records.conditions})
    report = GapReport(
        verdict=verdict,
        places=located.places if found.gap else (),
        candidates=candidates,
        metrics=metrics,
        provenance={
            "n_used": len(used),
            "n_fit": len(calibrated.fit),
            "n_held_out": len(calibrated.held_out),
            "bearing": calibrated.frame.bearing.name,
            "fs_hz": rates[0] if len(rates) == 1 else rates,
            "learnt": str(learnt.about.get("key", "")),
        },
        notes=(*notes, *calibrated.notes, *_told(found)),
        calibration=_calibration(calibrated, found),
        rest=rest if status in ("partly_explained", "unexplained") else (),
        tests=tests,
        curves=curves(trial.real, before[:count], after[:count] if after is not before else None),
        stand_ins=told_closer,
    )
    return Diagnosis(report, found, calibrated, root, closer, closest)


def _with_stand_ins(
    trial: _Trial,
    verdict: tuple[list[FeatureVectors], list[FeatureVectors]],
    learnt: Learnt,
    rng: np.random.Generator,
    progress: Progress,
) -> tuple[StandIns | None, Compared | None, list[str]]:
    """What stands in for the rest; nothing where held-out records do not say that it comes nearer for sure."""
    found = trial.found
    closer = stand_ins(trial.evidence, found, learnt, lambda what, _: progress(what, 0.98))
    none = ["of the other effects none brings the twin nearer to held-out records for sure"]
    if closer is None:
        return None, None, none
    now = closer.compared
    views = trial.replicates(now.simulator, now.effects, trial.fewer)
    count = min(*map(len, verdict), len(views))
    before, after, views = verdict[0][:count], verdict[1][:count], views[:count]
    further = paired(trial.real, after, views)
    if closure_interval(*further, further[1].floor(rng)[0], rng).ci[0] <= 0:
        return None, None, none
    pairs = paired(trial.real, before, views)
    closed = closure_interval(*pairs, pairs[1].floor(rng)[0], rng)
    metrics = closure_metrics(trial.real, before, views, rng, more=trial.lessons(now))
    values = {effect.name: _of_effect(effect, {}) for effect in now.effects}
    return StandIns(closer.added, values, closed.closure, closed.ci, metrics), now, []


def _confirmed(found: Explanation, evidence: Evidence) -> tuple[Explanation, list[str]]:
    """What was found; no gap where it is to a simulator of the user's own, no effect is sure to be missing, and the
    records differ from one another as much."""
    own = isinstance(found.before.simulator, ExternalSimulator)
    if not own or not found.gap or max(found.probability.values(), default=0.0) >= SURE:
        return found, []
    p = exchange_p_value(evidence)
    if p is None or p <= ALPHA:
        return replace(found, p_value=max(found.p_value, p or 0.0)), []
    told = (
        f"machines that were learnt from seldom look like this without a gap (p = {found.p_value:.2g}), but when "
        f"records and simulated ones change sides at random that is not rare (p = {p:.2g}): recordings differ as much "
        "from each other"
    )
    sets = ((), *(effects for effects in found.confidence_set if effects))
    nothing = replace(found, gap=False, effects=(), p_value=p, confidence_set=sets, after=found.before)
    return nothing, [told]


class _Trial:
    """The held-out part, measured in views against simulations."""

    def __init__(self, evidence: Evidence, found: Explanation) -> None:
        self.evidence, self.found = evidence, found
        self.part = evidence.calibrated.held_out
        self.grid = Grid.of(self.part.conditions, evidence.frame.bearing)
        self.real = evidence.vectors(self.part, self.grid)
        n = len(self.part)
        simulator = found.before.simulator
        self.most = replicates_of(simulator, self.part.conditions, int(np.clip(np.ceil(_SIMULATED / n), 3, 39)))
        self.fewer = min(self.most, int(np.clip(np.ceil(_SIMULATED / 3 / n), 2, 12)))

    def replicates(self, simulator: Simulator, effects: tuple[Effect, ...], count: int) -> list[FeatureVectors]:
        """Feature vectors of so many simulations of the held-out part."""
        numbers = range(2, 2 + count)
        made = self.evidence.simulated
        return [self.evidence.vectors(made(simulator, effects, self.part.conditions, k), self.grid) for k in numbers]

    def lessons(self, after: Compared | None = None) -> TrainingSets:
        """What a classifier can be trained on besides: of finished records, those of the fit part's conditions too."""
        found = self.found
        if not isinstance(found.before.simulator, ExternalSimulator):
            return None, None
        fit = self.evidence.calibrated.fit.conditions
        after = after or (found.after if found.gap else found.before)
        return self._lesson(found.before, fit), self._lesson(after, fit)

    def _lesson(self, compared: Compared, conditions: Sequence[Condition]) -> tuple[FeatureVectors, list[str]]:
        made = self.evidence.simulated(compared.simulator, compared.effects, conditions, 2)
        return self.evidence.vectors(made, self.grid), [str(c.fault) for c in conditions]

    def candidates(
        self, learnt: Learnt, floor: float, rng: np.random.Generator, progress: Callable[[float], None]
    ) -> Iterator[Candidate]:
        """Every catalogued effect, judged among the named ones: the gap without it and with it."""
        found = self.found
        named = {one.effect.name: one for one in found.effects}
        # All baselines are matched alike here: only effects are to differ.
        after = self.evidence.against(found.after.effects)
        base = self._of(after)
        names = [name for name in catalogue() if name not in self.evidence.modelled]
        for done, name in enumerate(names):
            progress(done / len(names))
            probability = min(max(found.probability.get(name, 0.0), 0.0), 1.0)
            others = tuple(other for other in named if other != name)
            if name in found.cannot:
                gap = float(base[1].over_domains(base[1].squares())[0][0])
                own = named.get(name)
                yield Candidate(
                    name,
                    probability,
                    gap,
                    gap,
                    0.0,
                    (0.0, 0.0),
                    _values(own) if own else {},
                    found.cannot[name],
                    others,
                )
                continue
            if name in named:
                without = self.evidence.against(tuple(named[o].effect for o in others if o not in found.cannot))
                pair = paired(self.real, self._of(without)[0], base[0])
                value = named[name]
            else:
                value = estimate(name, after.fit, self.evidence, learnt)
                few = base[0][: 1 + (probability > _LIKELY)]
                pair = paired(self.real, few, self._with(value.effect, probability, len(few)))
            closed = closure_interval(*pair, floor, rng, draws=200)
            yield Candidate(
                name,
                probability,
                closed.before,
                closed.after,
                closed.closure,
                closed.ci,
                _values(value),
                None,
                others,
            )

    def _of(self, compared: Compared) -> tuple[list[FeatureVectors], Paired]:
        views = self.replicates(compared.simulator, compared.effects, min(self.most, 2))
        return views, Paired(self.real, views)

    def _with(self, effect: Effect, probability: float, count: int) -> list[FeatureVectors]:
        """The twin with the named effects and one more."""
        after = self.evidence.against(self.found.after.effects)
        effects = (*after.effects, effect)
        simulator = self.evidence.against(effects).simulator if probability > _LIKELY else after.simulator
        try:
            return self.replicates(simulator, effects, count)
        except TwingapError:  # at these values it cannot act on one of the records: then it explains nothing
            return self.replicates(after.simulator, after.effects, count)


def _status(found: Explanation, closed: Closure, rest: Sequence[Place]) -> Status:
    """Explained only where nothing is left over, no place of the rest is plain, and the distance may have come down to
    its floor.

    Both intervals have to reach it: that of the closure is wide where there was little to close.
    """
    if not found.gap:
        return "no_gap"
    if not found.effects:
        return "unexplained"
    reached = found.rest_p > ALPHA_REST and closed.ci[1] >= AT_FLOOR and closed.after_ci[0] <= closed.floor
    plain = any(place.p_value <= PLAIN_REST for place in rest)
    return "explained" if reached and not plain else "partly_explained"


def _two_or_more(records: RecordSet) -> None:
    if len(records) < 2:
        raise TwingapError(
            "holds one record, at least 2 expected: one to calibrate with, one to measure on",
            where=f"record set {records.name!r}", mend="cut longer recordings into records",
        )  # fmt: skip


def _thinned(records: RecordSet, notes: list[str]) -> RecordSet:
    """At most `MOST_RECORDS`, spread over faults, and within a fault over speeds, times and groups as they come."""
    if len(records) <= MOST_RECORDS:
        return records
    of: dict[str | None, list[int]] = {}
    for place, c in enumerate(records.conditions):
        of.setdefault(c.fault, []).append(place)
    share = MOST_RECORDS // len(of)
    kept: list[int] = []
    for places in of.values():
        conditions = records.conditions
        places.sort(key=lambda p: (conditions[p].speed_rpm, conditions[p].time_s or 0.0, p))
        picked = np.unique(np.linspace(0, len(places) - 1, min(share, len(places))).round().astype(int))
        kept += [places[int(i)] for i in picked]
    notes.append(f"{len(kept)} of {len(records)} records were looked at, spread over faults and speeds")
    return records.take(sorted(kept))


def _values(found: Estimated) -> Mapping[str, ParameterValue]:
    return _of_effect(found.effect, found.intervals)


def _of_effect(effect: Effect, intervals: Mapping[str, tuple[float, float]]) -> Mapping[str, ParameterValue]:
    return {
        field.name: ParameterValue(
            float(getattr(effect, field.name)), field.metadata["unit"], intervals.get(field.name)
        )
        for field in dataclasses.fields(effect)  # type: ignore[arg-type]
    }


def _calibration(calibrated: Calibrated, found: Explanation) -> dict[str, ParameterValue]:
    """What calibration found: the twin's parameters as given, the speeds, the gain."""
    out: dict[str, ParameterValue] = {}
    before = found.before.simulator
    if isinstance(before, TwinSimulator):
        baseline = {k: v for k, v in flat(before.spec.parameters).items() if k.split(".")[0] not in catalogue()}
        out |= {name: ParameterValue(float(value), _UNITS.get(name, "")) for name, value in baseline.items()}
    out["speed_correction"] = ParameterValue(float(calibrated.speeds.common_ratio), "true over nominal")
    gain = getattr(before, "gain", None)
    if gain is not None:
        out["unit_gain"] = ParameterValue(float(gain), "records over simulation")
    return out


def _told(found: Explanation) -> Iterator[str]:
    for name in found.names:
        if name in found.cannot:
            yield f"{name} is named from the records alone: {found.cannot[name]}, so it could not be added and checked"
    yield from getattr(found.before.simulator, "notes", ())
    before, after = (getattr(one.simulator, "gain", 1.0) for one in (found.before, found.after))
    if abs(math.log(after / before)) > _OTHER_LEVEL:
        yield (
            f"brought nearest to the records, simulated samples are multiplied by {before:.4g} as they are and by "
            f"{after:.4g} with the named effects"
        )


def _record_set(records: RecordSet | FilePath) -> RecordSet:
    return records if isinstance(records, RecordSet) else read_record_set(records)


def _quiet(what: str, fraction: float) -> None:
    """Show no progress."""
