"""Diagnosis of a twin: calibration, search for missing effects, tests on held-out records, report.

records, twin (or simulated records) --calibrate--> Evidence --explain--> effects that the twin lacks
held-out part against replicates of the twin, before and after --> places, tests, closures --> GapReport
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from twingap.effects import catalogue
from twingap.effects.handover import digests_of_effects
from twingap.errors import TwingapError
from twingap.gap.closest import CLOSEST_FILE, ceiling, closest_of, of_verdict
from twingap.gap.diagnosis import Diagnosis, FilePath, Progress, no_progress
from twingap.gap.distance.closure import Closure, closure_interval, paired
from twingap.gap.distance.closure_metrics import closure_metrics, with_statistics
from twingap.gap.distance.curves import curves
from twingap.gap.distance.localisation import followed, locate, new_ones, presentable
from twingap.gap.distance.paired import Paired
from twingap.gap.distance.two_sample_tests import two_sample_tests
from twingap.gap.held_out import HeldOut
from twingap.gap.knowledge import shipped
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.report.at_hand import RECORDS_HAVE, records_have
from twingap.gap.report.formats import number
from twingap.gap.report.model import (
    REFERENCE,
    Candidate,
    Ceiling,
    GapReport,
    ParameterValue,
    Place,
    Status,
    TwoSampleTest,
    Verdict,
)
from twingap.gap.report.status import AT_FLOOR, LEAST_CEILING, MOST
from twingap.gap.search.effect_search import ALPHA, ALPHA_REST, SURE, Explanation, explain, with_line_order
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.gap.search.exchange_test import exchange_p_value
from twingap.gap.search.group_names import groups_of
from twingap.gap.search.measured_effects import with_measured
from twingap.gap.search.modelled_effects import completed
from twingap.gap.search.value_intervals import with_shorter_intervals
from twingap.identification.calibrate import Calibrated, calibrate_prepared, prepare
from twingap.identification.speed_reading import FEWEST_TURNS
from twingap.provenance import versions
from twingap.records import Condition, RecordSet
from twingap.records.folder import read_record_set
from twingap.streams import root_entropy
from twingap.twins.simulator import Simulator, TwinSimulator
from twingap.twins.twin_file import TwinSpec, flat, overruled, read_twin

MOST_RECORDS: Final = 240
"""Largest number of records that a diagnosis uses, spread over faults and speeds. A larger number takes longer."""
_UNITS: Final = {
    "resonance_hz": "Hz", "structure_noise_rms": "of scale", "white_noise_rms": "of scale",
    "scale": "unit of the records",
    **{f"impact_amplitude.{fault}": "of scale" for fault in ("inner", "outer", "ball", "cage")},
}  # fmt: skip
"""Units of the twin's baseline parameters in the report."""
_OTHER_LEVEL: Final = 0.02
"""Log ratio of levels above which a note reports the change of level with the effects. A smaller value adds notes."""
_NAMING: Final = ("explained", "partly_explained")
"""Status with effects."""
_LEAST_S: Final = 0.5
"""Duration that is advised at least where records are too short; a longer one resolves lines better."""


def diagnose(
    records: RecordSet | FilePath,
    twin: TwinSpec | FilePath,
    *,
    seed: int | np.random.Generator = 0,
    sim: RecordSet | FilePath | None = None,
    quick: bool = False,
    learnt: Learnt | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose where records and twin differ, which effects the twin lacks, and what adding them closes.

    Parameters
    ----------
    records : RecordSet or path-like
        Records of the machine, or their folder.
    twin : TwinSpec or path-like
        The twin: its model, effects and fixed parameters, or its twin file.
    seed : int or numpy.random.Generator
        The same seed gives the same result. The report states -1 for a generator.
    sim : RecordSet or path-like, optional
        Simulated records of the user's own simulator, in place of the twin's.
    quick : bool
        Whether to leave out the closest twin and what each group of effects closes, which take most of the time.
    learnt : Learnt, optional
        Models of the diagnosis; None for those of the package.
    progress : callable, optional
        Called with a description of the current step and the completed part, 0 to 1.

    Raises
    ------
    TwingapError
        When a file cannot be read, or the records cannot be diagnosed.
    """
    begin, progress = time.monotonic(), progress or no_progress
    spec, twin_file = (twin, "") if isinstance(twin, TwinSpec) else (read_twin(twin), Path(twin).name)
    records, sim = _record_set(records), None if sim is None else _record_set(sim)
    # Matrices are small and models predict one row at a time: more threads are slower.
    with threadpool_limits(1):
        found = _diagnosed(records, spec, np.random.default_rng(seed), sim, progress, learnt, quick)
        progress("done", 1.0)
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
        "quick": quick,
    }
    if own := digests_of_effects():
        known["own_effects"] = own
    return replace(found, report=replace(found.report, provenance={**known, **found.report.provenance}))


def _diagnosed(
    records: RecordSet,
    spec: TwinSpec,
    rng: np.random.Generator,
    sim: RecordSet | None,
    progress: Progress,
    learnt: Learnt | None,
    quick: bool,
) -> Diagnosis:
    """The diagnosis without the provenance that `diagnose` adds."""
    if len(records) < 2:
        raise TwingapError(
            "holds one record, at least 2 expected: one to calibrate with, one to measure on",
            where=f"record set {records.name!r}", mend="cut longer recordings into records",
        )  # fmt: skip
    stated = spec if sim is None else replace(spec, bearing=sim.bearing)
    notes = [note] if (note := overruled(stated, records.bearing, "twin file" if sim is None else sim.name)) else []
    used = _thinned(records, notes)
    notes += _few_turns(used.conditions)
    if len(rates := sorted({c.fs_hz for c in records.conditions})) > 1:
        of = " and ".join(f"{rate:g}" for rate in rates) if len(rates) < 4 else f"{rates[0]:g} to {rates[-1]:g}"
        notes.append(f"records have sampling rates of {of} Hz: places near half of one may be those of its filter")
    progress("calibration", 0.02)
    prepared = prepare(used, None if sim is not None else spec, rng, sim=sim)
    learnt = shipped() if learnt is None else learnt
    if sim is None:
        spec, estimated = completed(prepared, spec, copy.deepcopy(rng), learnt)
        notes += estimated
    calibrated = calibrate_prepared(prepared, None if sim is not None else spec, rng)
    root = root_entropy(rng) >> 66
    simulator = simulator_of(calibrated, sim)
    evidence = Evidence(calibrated, simulator, spec, root, THOROUGH)
    scale = 1.0 if quick else 0.5
    steps, progress = progress, lambda what, part: steps(what, scale * part)
    found = explain(evidence, learnt, lambda what, part: progress(what, 0.1 + 0.5 * part))
    progress("exchange of records", 0.6)
    found, exchange_notes = _confirmed(found, evidence)
    notes += exchange_notes
    progress("path, lines and background", 0.62)
    found = with_line_order(evidence, with_measured(evidence, found), found)
    if not quick:
        found = with_shorter_intervals(evidence, found)
    progress("places and tests", 0.65)
    held_out = HeldOut(evidence, found)
    before = held_out.replicates(found.before.simulator, found.before.effects, held_out.most)
    first = Paired(held_out.real, before)
    located = locate(first, rng)
    tests = two_sample_tests(first, rng)
    after = before
    if found.gap and found.after.effects:
        after = held_out.replicates(found.after.simulator, found.after.effects, held_out.fewer)
    progress("closure", 0.75)
    count = min(len(before), len(after), held_out.fewer)
    compared = held_out.real, before[:count], after[:count]
    pairs = paired(*compared)
    floors = pairs[1].floor(rng)
    floor, _ = floors
    metrics = closure_metrics(*compared, rng, more=held_out.training_sets(), floors=floors)
    tests = with_statistics(tests, metrics)
    closed = closure_interval(*pairs, floor, rng)
    found, exchange_notes = _significant(found, closed, tests, located.places)
    notes += exchange_notes
    held_out.found = found
    for name in found.names if found.gap else ():
        if not evidence.read_off(name) and (why := catalogue()[name].not_read_off(calibrated.fit.conditions)):
            notes.append(f"{name} could not be read off the records: {why}")
    progress("candidates", 0.8)
    candidates = tuple(held_out.candidates(learnt, floor, rng, lambda part: progress("candidates", 0.8 + 0.18 * part)))
    second = Paired(held_out.real, after)
    rest = locate(second, rng).places if found.gap else ()
    added = bool(found.after.effects and found.gap)
    replayed = ceiling(held_out, before[:count], floor) if found.gap else Ceiling()
    near, closest = of_verdict(held_out, closed if added else None, replayed), None
    if not quick and isinstance(found.before.simulator, TwinSimulator):
        near = replace(near, twin=CLOSEST_FILE)
    if found.gap and not quick:

        def later(what: str, part: float) -> None:
            steps(what, 0.5 + 0.5 * part)

        near, closest = closest_of(held_out, learnt, before, closed, metrics, pairs[0].scale, replayed, rng, later)
    status = _status(found, closed, replayed.same_unit)
    closes = {candidate.effect: candidate.closure for candidate in candidates}
    named = tuple(sorted(found.names, key=lambda name: -closes[name])) if status in _NAMING else ()
    closure, ci = (closed.closure, closed.ci) if added else (None, None)
    p_floor = learnt.p_floor(evidence.against().held_out)
    groups = groups_of(found, learnt)
    verdict = Verdict(status, named, found.confidence_set, found.p_value, closure, ci, p_floor, groups)
    places = presentable(located.places) if found.gap else ()
    if added:
        candidates = tuple(_with_closure_of_verdict(c, named, closed) for c in candidates)
        places = followed(places, rest, first, second)
        rest = new_ones(rest, located.places)
    report = GapReport(
        verdict=verdict,
        places=places,
        candidates=candidates,
        metrics=metrics,
        provenance={
            "n_used": len(used),
            "n_fit": len(calibrated.fit),
            "n_held_out": len(calibrated.held_out),
            "bearing": calibrated.frame.bearing.name,
            "fs_hz": rates[0] if len(rates) == 1 else rates,
            RECORDS_HAVE: records_have(used.conditions),
            "learnt": {key: learnt.about[key] for key in ("version", "machines", "seed") if key in learnt.about},
        },
        notes=(*notes, *calibrated.notes, *_notes(found, evidence, learnt.named_from)),
        calibration=_calibration(calibrated, found),
        calibration_after=_calibration_after(found) if added else {},
        rest=presentable(rest),
        tests=tests,
        curves=curves(
            held_out.real, before[:count], after[:count] if after is not before else (), calibrated.frame.bearing
        ),
        closest=near,
    )
    return Diagnosis(report, found, calibrated, root, closest, not quick)


def _few_turns(conditions: Sequence[Condition]) -> Iterator[str]:
    """Note on records that are too short to read their speed."""
    if short := [c for c in conditions if c.duration_s * c.speed_rpm / 60 < FEWEST_TURNS]:
        longest = max(_LEAST_S, *(60 * FEWEST_TURNS / c.speed_rpm for c in short))
        yield (
            f"{len(short)} of {len(conditions)} records hold fewer than {FEWEST_TURNS:g} turns of the shaft: their "
            f"speed cannot be read and lines of bearing faults are not resolved; record {longest:.2g} s or more"
        )


def _confirmed(found: Explanation, evidence: Evidence) -> tuple[Explanation, list[str]]:
    """The explanation, confirmed by an exchange test for the user's own simulator, or no gap, and notes.

    The test is skipped where an effect is certainly missing.
    """
    own = found.before.simulator.makes_waveforms
    if not own or not found.gap or _shown_by_lines(found) or max(found.probability.values(), default=0.0) >= SURE:
        return found, []
    p = exchange_p_value(evidence)
    if p is None or p <= ALPHA:
        return replace(found, p_value=max(found.p_value, p or 0.0)), []
    return _without_gap(found, p), [
        f"such a difference is rare on the simulated machines without a gap (p = {found.p_value:.2g}), but not when "
        f"records and simulated ones are exchanged at random (p = {p:.2g}): recordings differ as much from each other"
    ]


def _significant(
    found: Explanation, closed: Closure, tests: Sequence[TwoSampleTest], places: Sequence[Place]
) -> tuple[Explanation, list[str]]:
    """The explanation, or no gap where no effect is named and nothing else shows a gap, and notes.

    That is where the distance is below its floor, no place differs, and no two-sample test is significant.
    """
    p = min((test.p_value for test in tests), default=1.0)
    if not found.gap or found.effects or closed.before > closed.floor or places or p <= ALPHA or _shown_by_lines(found):
        return found, []
    return _without_gap(found, max(p, found.p_value)), [
        f"scores like these are rare on the simulated machines without a gap (p = {found.p_value:.2g}), but the "
        "distance is below its floor, no place differs, and no two-sample test is significant"
    ]


def _shown_by_lines(found: Explanation) -> bool:
    """Whether lines show the gap, which tests on distances hardly see."""
    return found.by_lines or found.line_order is not None


def _without_gap(found: Explanation, p_value: float) -> Explanation:
    """The explanation that nothing is missing, with no effect as the most probable set."""
    sets = ((), *(effects for effects in found.confidence_set if effects))
    return replace(found, gap=False, effects=(), p_value=p_value, confidence_set=sets, after=found.before)


def _with_closure_of_verdict(candidate: Candidate, named: tuple[str, ...], closed: Closure) -> Candidate:
    """The candidate; where it is all that the verdict names, what it closes is what the verdict closes."""
    if named != (candidate.effect,) or candidate.acts is not None:
        return candidate
    return replace(
        candidate, gap_before=closed.before, gap_after=closed.after, closure=closed.closure, closure_ci=closed.ci
    )


def _status(found: Explanation, closed: Closure, ceiling: float | None) -> Status:
    """Status of the verdict.

    A gap is explained where the effects leave at most a tenth of it, or no more than real records in place of the twin
    leave. It is explained too where they may close most of it and the rest is not significant: its test, calibrated on
    machines whose effects were added at estimated values, which are a little off, finds effects that are missing. That
    test alone counts where the distance does not see the gap: faint lines hardly change it.
    """
    if not found.gap:
        return "no_gap"
    if not found.effects:
        return "unexplained"
    if closed.closure >= AT_FLOOR or (ceiling is not None and closed.closure >= ceiling >= LEAST_CEILING):
        return "explained"
    unseen = found.by_lines or closed.before <= closed.floor
    if found.line_order is not None:
        return "partly_explained"
    return "explained" if found.rest_p > ALPHA_REST and (unseen or closed.ci[1] >= MOST) else "partly_explained"


def _thinned(records: RecordSet, notes: list[str]) -> RecordSet:
    """At most `MOST_RECORDS` records, spread over faults and, within a fault, over speeds and times."""
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
    notes.append(f"{len(kept)} of {len(records)} records were used, spread over faults and speeds")
    return records.take(sorted(kept))


def _calibration(calibrated: Calibrated, found: Explanation) -> dict[str, ParameterValue]:
    """Calibrated values: the twin's parameters, the speed correction, the gain."""
    out = _parameters(found.before.simulator)
    out["speed_correction"] = ParameterValue(float(calibrated.speeds.common_ratio), "true over nominal")
    reference = (found.after if found.gap else found.before).simulator.reference_rms
    out[REFERENCE] = ParameterValue(float(reference), calibrated.fit.unit)
    return out


def _calibration_after(found: Explanation) -> dict[str, ParameterValue]:
    """Calibrated values with the named effects that differ from those without, in the digits that are shown."""
    before, after = (_parameters(one.simulator) for one in (found.before, found.after))
    return {n: after[n] for n, p in before.items() if n in after and number(after[n].value) != number(p.value)}


def _parameters(simulator: Simulator) -> dict[str, ParameterValue]:
    """The twin's parameters, and the gain of finished waveforms."""
    out: dict[str, ParameterValue] = {}
    if isinstance(simulator, TwinSimulator):
        baseline = {k: v for k, v in flat(simulator.spec.parameters).items() if k.split(".")[0] not in catalogue()}
        out |= {name: ParameterValue(float(value), _UNITS.get(name, "")) for name, value in baseline.items()}
    gain = getattr(simulator, "gain", None)
    if gain is not None:
        out["unit_gain"] = ParameterValue(float(gain), "records over simulation")
    return out


def _slip_not_named(evidence: Evidence, found: Explanation, named_from: float) -> Iterator[str]:
    """Why a slip of the cage that the speeds show, which a note states, is not named as an effect."""
    slip, name = evidence.calibrated.speeds.slip, "mean_slip"
    if slip == 0 or name in found.names:
        return
    why = f"its probability is {found.probability.get(name, 0.0):.0%}, all features weighed together, and an effect is "
    why += f"named from {named_from:.0%}; model it if you trust the speeds"
    if name in evidence.modelled:
        why = "the twin models it"
    elif not found.gap:
        why = "records and twin cannot be distinguished"
    yield f"{name} is not named for this slip of {100 * slip:.2f} %: {why}"


def _notes(found: Explanation, evidence: Evidence, named_from: float) -> Iterator[str]:
    """Notes on a slip that is not named, effects that cannot be added, the simulator, and a change of level."""
    yield from _slip_not_named(evidence, found, named_from)
    for name in found.names:
        if name in found.cannot:
            yield f"{name} is named from the records alone: {found.cannot[name]}, so it could not be added and checked"
    if found.gap and found.line_order is not None:
        yield (
            f"most records of every state share a line at {found.line_order:.2f} of the shaft's order that the twin, "
            "with the named effects, lacks: a belt, another shaft, a whirl, a rub or a loose part has such lines"
        )
    yield from getattr(found.before.simulator, "notes", ())
    before, after = (getattr(one.simulator, "gain", 1.0) for one in (found.before, found.after))
    if abs(math.log(after / before)) > _OTHER_LEVEL:
        yield (
            f"to match the records, simulated samples are multiplied by {before:.4g} as they are and by "
            f"{after:.4g} with the named effects"
        )


def _record_set(records: RecordSet | FilePath) -> RecordSet:
    """The record set, read from its folder where a path is given."""
    return records if isinstance(records, RecordSet) else read_record_set(records)
