"""Jobs of the study on public records: one diagnosis each.

PublicJob --records of a public set--> twin | effect withheld | effect injected | single recording --> row
"""

from __future__ import annotations

import dataclasses
import json
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects import (
    CageModulation,
    Effect,
    EntryExit,
    ImpactScatter,
    LoadZone,
    SlipJitter,
    Stage,
    apply_to_waveform,
    catalogue,
    make_effect,
)
from twingap.effects.background import Background
from twingap.errors import TwingapError
from twingap.gap.report.advice import place_words
from twingap.gap.report.model import ClosestTwin, GapReport, Metric
from twingap.identification.speed import Samples, estimate_speeds
from twingap.records import Record, RecordSet
from twingap.streams import Streams
from twingap.study.public_closest import PIECE_S as CLOSEST_S
from twingap.study.public_closest import closest_row, splits
from twingap.study.public_filter import filter_row
from twingap.study.public_sets import PIECE_S, bearing_of, halves, public_set
from twingap.twins.phenomenological import paper1_chain
from twingap.twins.twin_file import TwinSpec

Kind = Literal["twin", "withheld", "injected", "nothing", "recording", "looks", "closest", "filtered"]
ACCURACY: Final = "accuracy on the records"
"""Beginning of the name of the accuracy metric in the report: of a classifier trained on the twin alone."""
TWINS: Final[Mapping[str, str]] = {
    "bare": "phenomenological twin without effects",
    "paper1": "paper 1: eq. 1 as a chain of effects",
    "paper2": "paper 2: contact twin, printed values",
    "paper3": "paper 3: contact twin, physical values, jitter",
}
"""Twin -> description."""
INJECTED: Final[tuple[Effect, ...]] = (
    SlipJitter(sigma=0.015, accumulating=True),
    ImpactScatter(sigma=0.45),
    LoadZone(depth=0.5),
    CageModulation(depth=0.5),
    EntryExit(arc_deg=4.0),
)
"""Effects that are injected at other than the catalogue's default values, so that they are clearly detectable."""
_LEAST_CHANGE: Final = 1e-9
"""Relative RMS below which a change counts as rounding."""


@dataclass(frozen=True)
class PublicJob:
    """One job of the study.

    "twin": records against a twin; "withheld": against the twin with the effects of `chain` except `effect`; "injected"
    and "nothing": one half of the records, with or without `effect` added, against the other half; "recording": one
    recording against the others of its bearing; "looks": plain indicators of every recording; "closest": the closest
    twin of one part of the records, judged on the other; "filtered": one half, through a drawn filter, against the
    other half.
    """

    kind: Kind
    data_set: str
    twin: str  # one of `TWINS`
    seed: int
    pieces: int  # records cut from each recording
    effect: str = ""  # withheld or injected
    chain: str = ""  # JSON: effect -> parameters, in addition to the twin's own
    split: int = 0  # number of the random halving, or of the stated split (`public_closest.splits`)
    recording: str = ""
    detectors_alone: bool = False  # whether the closest twin has effects with detectors alone

    @property
    def description(self) -> str:
        """Description of the job, for progress and errors."""
        has_split = self.kind in ("injected", "nothing", "closest", "filtered")
        more = [self.effect or self.recording, f"split {self.split}" if has_split else ""]
        more += ["with detectors alone"] * self.detectors_alone
        return " ".join(filter(None, (self.kind, self.data_set, self.twin, *more)))


def twin_spec(name: str, records: RecordSet) -> tuple[TwinSpec, tuple[str, ...]]:
    """A paper's twin for these records with its free parameters, and its effects that cannot act on these records."""
    bearing = records.bearing
    if name == "bare":
        return TwinSpec("phenomenological", bearing=bearing), ()
    if name in ("paper2", "paper3"):
        effects = ("slip_jitter",) if name == "paper3" else ()
        return TwinSpec("contact", effects, "paper" if name == "paper2" else "physical", bearing=bearing), ()
    if name != "paper1":
        raise TwingapError(f"unknown twin {name!r}", mend=f"use one of {', '.join(TWINS)}")
    chain, left_out = [], []
    for effect in paper1_chain():
        if effect.name == "damage_growth" and any(c.time_s is None for c in records.conditions):
            left_out.append("damage_growth: the records have no time within a run")
        else:
            chain.append(effect)
    values = {e.name: parameters_of(e) for e in chain}
    return TwinSpec("phenomenological", tuple(e.name for e in chain), None, values, bearing), tuple(left_out)


def with_effects(spec: TwinSpec, chain: Mapping[str, Mapping[str, Any]], without: str = "") -> TwinSpec:
    """The twin with further effects at given values, without the effect `without` (which may be its own)."""
    names = tuple(n for n in dict.fromkeys((*spec.effects, *chain)) if n != without)
    values = {k: v for k, v in spec.parameters.items() if k != without}
    values |= {n: dict(v) for n, v in chain.items() if n != without}
    return replace(spec, effects=names, parameters=values)


def parameters_of(effect: Effect) -> dict[str, Any]:
    """Parameters of an effect by name."""
    return {f.name: getattr(effect, f.name) for f in dataclasses.fields(effect)}  # type: ignore[arg-type]


def injected_effect(name: str) -> Effect:
    """The effect at the strength at which it is injected into real records."""
    return next((effect for effect in INJECTED if effect.name == name), None) or make_effect(name)


def run_job(job: PublicJob, root: str | None = None) -> dict[str, Any]:
    """Run one job: JSON values, of which ``refused`` holds the reason when there is no diagnosis."""
    own = public_set(job.data_set, root, job.pieces, CLOSEST_S if job.kind == "closest" else PIECE_S)
    rng = np.random.default_rng([job.seed, zlib.crc32(job.description.encode())])
    about = {"title": own.title, "real": own.real}
    if job.kind == "looks":
        from twingap.study.public_indicators import indicators

        return {**about, "recordings": indicators(own.records, rng)}
    records, spec = own.records, twin_spec(job.twin, own.records)[0]
    if job.kind == "closest":
        split = splits(records)[job.split]
        return {**about, **closest_row(records, spec, rng, split, detectors_alone=job.detectors_alone)}
    if job.kind in ("injected", "nothing", "filtered"):
        return {**about, **_against_itself(job, records, spec, rng)}
    if job.kind == "recording":
        return {**about, **_against_same_bearing(job.recording, records, spec, rng)}
    if job.kind == "withheld":
        spec = with_effects(spec, json.loads(job.chain), job.effect)
    left_out = twin_spec(job.twin, records)[1]
    found = diagnosed(records, spec, rng, quick=job.kind != "twin")
    return {**about, "left_out": list(left_out), "twin_effects": list(spec.effects), **found}


def diagnosed(
    records: RecordSet, spec: TwinSpec, rng: np.random.Generator, sim: RecordSet | None = None, *, quick: bool = True
) -> dict[str, Any]:
    """Diagnosis as JSON values, or the reason of a refusal; with the closest twin unless `quick`."""
    from twingap.gap import diagnose

    begin = time.perf_counter()
    size = {"records": len(records), "recordings": len(records.groups)}
    try:
        found = diagnose(records, spec, seed=rng, sim=sim, quick=quick)
    except TwingapError as error:
        return {**size, "refused": str(error), "seconds": time.perf_counter() - begin}
    return {**size, "refused": "", "seconds": time.perf_counter() - begin, **summary(found.report)}


def summary(report: GapReport) -> dict[str, Any]:
    """Values of a report that the tables show."""
    verdict = report.verdict
    return {
        "status": verdict.status,
        "sentence": verdict.sentence,
        "effects": list(verdict.effects),
        "confidence_set": [list(s) for s in verdict.confidence_set],
        "p_value": verdict.p_value,
        "closure": verdict.closure,
        "closure_ci": None if verdict.closure_ci is None else list(verdict.closure_ci),
        **_measures(report.metrics),
        "closest": _closest(report.closest),
        "where": [
            {"place": f"{p.domain}: {place_words(p)}", "share": p.share, "p_value": p.p_value}
            for p in report.places[:5]
        ],
        "which": [
            {
                "effect": c.effect, "probability": c.probability, "closure": c.closure, "ci": list(c.closure_ci),
                "cannot": c.acts, "parameters": {k: v.value for k, v in c.parameters.items()},
            }
            for c in report.candidates if c.effect in verdict.effects or c.probability > 0.1
        ],
        "notes": list(report.notes),
    }  # fmt: skip


def _measures(metrics: Sequence[Metric]) -> dict[str, dict[str, float] | None]:
    """The gap over all domains and the accuracy: before, after and floor of each."""
    accuracy = next((m for m in metrics if m.metric.startswith(ACCURACY)), None)
    found = {"gap": metrics[0] if metrics else None, "accuracy": accuracy}
    return {
        name: None if m is None else {"before": m.before, "after": m.after, "floor": m.floor}
        for name, m in found.items()
    }


def _closest(found: ClosestTwin) -> dict[str, Any] | None:
    if not found.attribution:
        return None
    values = {one.effect: {k: v.value for k, v in one.parameters.items()} for one in found.effects}
    shares = {share.group: share.share for share in found.attribution}
    return {
        "effects": list(values), "shares": shares, "closure": found.closure, "closure_ci": list(found.closure_ci),
        "parameters": values, **_measures(found.metrics),
    }  # fmt: skip


def chain_of(row: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Named effects that the simulator can have -> their fitted values, converted to the catalogue's types."""
    out = {}
    for one in row.get("which", []):
        if one["effect"] in row["effects"] and one["cannot"] is None and one["parameters"]:
            default = catalogue()[one["effect"]]()
            out[one["effect"]] = {k: type(getattr(default, k))(v) for k, v in one["parameters"].items()}
    return out


# ------------------------------------------------------------------------------------------ real records against real


def _against_itself(job: PublicJob, records: RecordSet, spec: TwinSpec, rng: np.random.Generator) -> dict[str, Any]:
    """One half of the records against the other as simulated; the halving depends on seed and split alone."""
    machine, sim, by = halves(records, np.random.default_rng([job.seed, job.split]))
    sim = _as_simulated(sim, "the other half")
    if job.kind == "filtered":
        return {"split_by": by, "split": job.split, **filter_row(machine, sim, spec, rng)}
    about: dict[str, Any] = {"split_by": by, "changed": None, "acts_on": None}
    if job.effect:
        assert machine.bearing is not None
        effect = injected_effect(job.effect)
        machine, share, change, why = injected(machine, effect, machine.bearing, job.seed)
        about |= {"parameters": parameters_of(effect), "acts_on": share, "changed": change}
        if share == 0:
            return {**about, "refused": f"cannot act: {why}", "records": len(machine), "seconds": 0.0}
    return {**about, **diagnosed(machine, spec, rng, sim)}


def _against_same_bearing(
    recording: str, records: RecordSet, spec: TwinSpec, rng: np.random.Generator
) -> dict[str, Any]:
    """One recording against the other recordings of the same bearing as simulated."""
    own = records.select(lambda c: c.group == recording)
    bearing = bearing_of(own.conditions[0])
    if not any(bearing_of(c) == bearing and c.group != recording for c in records.conditions):
        return {"refused": "no other recording of this bearing", "records": len(own), "seconds": 0.0}
    others = records.select(lambda c: bearing_of(c) == bearing and c.group != recording)
    return {"against": list(others.groups), **diagnosed(own, spec, rng, _as_simulated(others, "its other recordings"))}


def _as_simulated(records: RecordSet, name: str) -> RecordSet:
    """Real records in the place of simulated ones, at the speeds that are read off them.

    A simulator turns at the speed that it states; where that of real records is wrong, every order would differ.
    """
    own = estimate_speeds(records).corrected(records)
    return RecordSet(name, own.unit, own.bearing, own.conditions, Samples(own))


def injected(records: RecordSet, effect: Effect, bearing: Bearing, seed: int) -> tuple[RecordSet, float, float, str]:
    """Records with an effect added where it can act; on impacts alone where healthy records separate them from noise.

    Returns
    -------
    RecordSet
    float
        Fraction of the records that changed.
    float
        Median over these of the RMS of the change relative to that of the record.
    str
        Why the effect cannot act on the others; "" where it acts on all.
    """
    quiet = [float(r.samples.var()) for r in records if r.condition.fault == "healthy"]
    reference_rms = float(np.sqrt(np.mean(quiet) if quiet else min(float(r.samples.var()) for r in records)))
    background = Background.of([r.samples for r in records if r.condition.fault == "healthy"])
    made: list[Record] = []
    changes: list[float] = []
    why = ""
    for place, record in enumerate(records):
        try:
            rest = _without_impacts(record, bearing, background) if effect.stage is Stage.EXCITATION else None
            after = apply_to_waveform((effect,), record, bearing, reference_rms, Streams(seed, place), rest)
        except TwingapError as error:
            after, why = record, error.what
        change = float(np.std(after.samples - record.samples)) / max(float(np.std(record.samples)), 1e-300)
        if change > _LEAST_CHANGE:
            changes.append(change)
        made.append(after)
    changed = RecordSet.from_records(f"{records.name} with {effect.name}", records.unit, records.bearing, made)
    return changed, len(changes) / len(made), float(np.median(changes)) if changes else 0.0, why or "it changes nothing"


def _without_impacts(record: Record, bearing: Bearing, background: Background | None) -> NDArray[np.float64] | None:
    """Part of a defective record that is not impacts [samples]; None where it cannot be separated."""
    c = record.condition
    if background is None or c.fault in (None, "healthy"):
        return None
    rate_hz = bearing.fault_order(str(c.fault)) * c.speed_rpm / 60
    passes = np.arange(c.n_samples, dtype=float) * (rate_hz / c.fs_hz)
    return np.asarray(record.samples - background.impacts(np.asarray(record.samples, float), passes), float)


def can_be_injected(records: RecordSet) -> tuple[str, ...]:
    """Catalogued effects that act on the waveform of at least one of these records."""
    by_fault: dict[str, Record] = {}
    for place, condition in enumerate(records.conditions):
        if str(condition.fault) not in by_fault:
            by_fault[str(condition.fault)] = records[place]
    assert records.bearing is not None
    some = RecordSet.from_records(records.name, records.unit, records.bearing, by_fault.values())
    return tuple(n for n in catalogue() if injected(some, injected_effect(n), records.bearing, 0)[1] > 0)
