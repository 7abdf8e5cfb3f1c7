"""Study on public records: what the papers' twins lack, effects withheld and added, single recordings, closest twins.

sets --twins--> verdicts --the best twin, an effect withheld--> named again?
     --halves, an effect injected or none--> named? false alarms?
     --each recording alone--> compared with the literature
     --stated splits--> closest twin: closure, what it teaches a classifier
     --halves, one through a drawn filter--> path named, gain recovered?      all --> public.json, public.md
"""

from __future__ import annotations

import functools
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from twingap import files
from twingap.data.registry import reader
from twingap.errors import TwingapError, one_of
from twingap.provenance import digest_of_code, plain, versions
from twingap.study.intervals import of_rate
from twingap.study.public_closest import PIECE_S, splits
from twingap.study.public_jobs import TWINS, PublicJob, can_be_injected, chain_of, run_job, twin_spec
from twingap.study.public_sets import DOCUMENTED, SINGLE, PublicSet, documented, public_set
from twingap.study.sweeps import swept

SCHEMA: Final = "twingap.public/1"
SETS: Final = ("cwru", "hit_sm")
PARTS: Final = ("verdicts", "closest", "filtered")
"""Parts of the study: verdicts on records, the closest twin under stated splits, records through a drawn filter."""
FILTERS: Final = 3
"""Halvings of each set, each with a filter of its own."""
SEARCHED: Final = ("bare", "paper1")
"""Twins from which effects are withheld; the contact twin is not one, as its effects follow from its physics."""

Progress = Callable[[str, int, int], None]
"""Progress callback: progress(stage, done, total)."""


@dataclass(frozen=True)
class Plan:
    """Extent of the study."""

    sets: tuple[str, ...] = SETS  # names of the data sets
    seed: int = 0
    pieces: int = 2  # records cut from each recording
    splits: int = 6  # random halvings of each set with no effect added
    injections: int = 1  # halvings on which every effect is injected, in the first set
    single_pieces: int = 3  # records of each recording that is diagnosed by itself; 0 = no single recordings
    parts: tuple[str, ...] = PARTS  # which of `PARTS` to run


def run_public(
    out: str | os.PathLike[str],
    plan: Plan,
    *,
    root: str | None = None,
    jobs: int | None = None,
    backend: str = "loky",
    address: str | None = None,
    command: str = "",
    progress: Progress = lambda what, done, total: None,
) -> dict[str, Any]:
    """Run all parts of the study on public records.

    Parameters
    ----------
    out : path-like
        Output folder; results of the same code on the same records that it holds already are reused.
    root : str or None
        Data root; TWINGAP_DATA when None.
    jobs, backend, address
        Where to run; see `twingap.sweep.backends.open_pool`. Workers of a cluster must see the data at the same path.
    command : str
        Command line, for the provenance.

    Returns
    -------
    dict
        Content of public.json.

    Raises
    ------
    TwingapError
        For an unknown set or part, a folder that cannot be written, and when none of the sets is available and none has
        a surrogate.
    """
    begin = time.perf_counter()
    for name in plan.sets:
        reader(name)  # raises for an unknown name
    for name in plan.parts:
        if name not in PARTS:
            raise TwingapError(f"unknown part {name!r}", mend=one_of(name, PARTS, "parts"))
    held, skipped = _available(plan, root)
    files.try_folder(out)
    code, data = _digests(held)

    def run(work: Sequence[PublicJob], what: str) -> list[Any]:
        return swept(
            functools.partial(run_job, root=root), work, functools.partial(progress, what),
            lambda job: job.description, store=Path(out) / "work", version=code, data=data, n_jobs=jobs,
            backend=backend, address=address,
        )  # fmt: skip

    results: dict[PublicJob, dict[str, Any]] = {}
    best: dict[str, str] = {}
    if "verdicts" in plan.parts:
        work = [j for name in held for j in _first_jobs(plan, name, held[name])]
        results |= zip(work, run(work, "records diagnosed"), strict=True)
        known = {(j.data_set, j.twin): row for j, row in results.items() if j.kind == "twin"}
        best = {name: best_twin({t: known[name, t] for t in SEARCHED}) for name in held}
        later = [j for name in held for j in _withheld_jobs(plan, name, best[name], known, held[name])]
        results |= zip(later, run(later, "effects withheld"), strict=True)
    if "closest" in plan.parts:
        work = [j for name in held for j in _closest_jobs(plan, name, root)]
        results |= zip(work, run(work, "closest twins"), strict=True)
    if "filtered" in plan.parts:
        work = [j for name in held for j in _filtered_jobs(plan, name)]
        results |= zip(work, run(work, "filtered records"), strict=True)
    twins = {(j.data_set, j.twin): row for j, row in results.items() if j.kind == "twin"}
    table: dict[str, Any] = {
        "schema": SCHEMA,
        "sets": [
            {"name": name, "title": own.title, "real": own.real, "records": len(own.records),
             "recordings": list(own.records.groups), "sha256": own.records.digest}
            for name, own in held.items()
        ],
        "skipped": skipped,
        "twins": [{"set": s, "twin": t, **row} for (s, t), row in twins.items()],
        "best": best,
        "withheld": withheld_rows(results),
        "injected": injected_rows(results),
        "nothing": nothing_rows(results),
        "single": single_rows(results),
        "closest": closest_rows(results),
        "filtered": [{"set": j.data_set, **row} for j, row in results.items() if j.kind == "filtered"],
        "documented": [
            {"finding": d.finding, "recordings": list(d.recordings), "shows": d.shows, "source": d.source}
            for d in DOCUMENTED
        ],
    }  # fmt: skip
    table["provenance"] = {
        "command": command, "plan": plain(plan), "versions": versions(), "code_sha256": code, "data": data,
        "diagnoses": len(results), "computed_s": sum(r.get("seconds", 0.0) for r in results.values()),
        "runtime_s": round(time.perf_counter() - begin, 1),
    }  # fmt: skip
    return table


def _available(plan: Plan, root: str | None) -> tuple[dict[str, PublicSet], dict[str, str]]:
    held: dict[str, PublicSet] = {}
    skipped: dict[str, str] = {}
    for name in plan.sets:
        try:
            held[name] = public_set(name, root, plan.pieces)
        except TwingapError as error:
            skipped[name] = str(error)
    if not held:
        raise TwingapError(
            "none of the sets is available", where=", ".join(plan.sets), mend="; ".join(skipped.values())
        )
    return held, skipped


def _digests(held: Mapping[str, PublicSet]) -> tuple[str, dict[str, str]]:
    """Digests of the code of the diagnosis and of its data."""
    import twingap.effects
    import twingap.gap
    import twingap.identification
    import twingap.signal
    import twingap.twins
    from twingap.gap.knowledge import shipped_digest
    from twingap.study import public_closest, public_filter, public_indicators, public_jobs, public_sets

    code = digest_of_code(
        twingap.effects, twingap.gap, twingap.identification, twingap.signal, twingap.twins, public_closest,
        public_filter, public_indicators, public_jobs, public_sets,
    )  # fmt: skip
    return code, {"learnt": shipped_digest(), **{name: own.records.digest for name, own in held.items()}}


# ---------------------------------------------------------------------------------------------------------------- jobs


def _first_jobs(plan: Plan, name: str, own: PublicSet) -> list[PublicJob]:
    made = functools.partial(PublicJob, data_set=name, seed=plan.seed, pieces=plan.pieces)
    jobs = [made("twin", twin=twin) for twin in TWINS]
    jobs += [made("nothing", twin="bare", split=split) for split in range(plan.splits)]
    if name == plan.sets[0] and plan.injections and plan.splits:
        effects = can_be_injected(own.records)
        # Effects alternate over the halvings; each halving is also diagnosed with no effect added.
        jobs += [
            made("injected", twin="bare", effect=effect, split=(place + turn) % plan.splits)
            for turn in range(plan.injections)
            for place, effect in enumerate(effects)
        ]
    if name == SINGLE:
        jobs.append(made("looks", twin="bare"))
        if plan.single_pieces:
            single = functools.partial(PublicJob, data_set=name, seed=plan.seed, pieces=plan.single_pieces)
            jobs += [single("recording", twin="bare", recording=group) for group in own.records.groups]
    return jobs


def best_twin(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """The twin with the smallest gap after its verdict's effects are added; "" when all diagnoses were refused."""
    left = {twin: row["gap"]["after"] for twin, row in rows.items() if not row["refused"] and row["gap"]}
    return min(left, key=lambda twin: left[twin]) if left else ""


def _withheld_jobs(
    plan: Plan, name: str, twin: str, twins: Mapping[tuple[str, str], Mapping[str, Any]], own: PublicSet
) -> list[PublicJob]:
    if not twin:
        return []
    chain = chain_of(twins[name, twin])
    text = json.dumps(chain, sort_keys=True)
    effects = dict.fromkeys((*twin_spec(twin, own.records)[0].effects, *chain))
    return [
        PublicJob("withheld", name, twin, plan.seed, plan.pieces, effect, text) for effect in ("", *effects)
    ]  # fmt: skip


def _closest_jobs(plan: Plan, name: str, root: str | None) -> list[PublicJob]:
    """Every stated split with the whole catalogue, those by operating point also with detectors alone."""
    stated = splits(public_set(name, root, plan.pieces, PIECE_S).records)
    return [
        PublicJob("closest", name, "bare", plan.seed, plan.pieces, split=place, detectors_alone=alone)
        for alone in (False, True)
        for place, split in enumerate(stated)
        if not (alone and split.new_bearings)
    ]


def _filtered_jobs(plan: Plan, name: str) -> list[PublicJob]:
    """Halvings of a set, one half of each through a filter."""
    return [
        PublicJob("filtered", name, "bare", plan.seed, plan.single_pieces or plan.pieces, split=split)
        for split in range(FILTERS)
    ]


# ---------------------------------------------------------------------------------------------------------------- rows


def naming(row: Mapping[str, Any], effect: str, others: Sequence[str] = ()) -> dict[str, Any]:
    """Whether a diagnosis (a row of `run_job`) names a missing effect: first, at all, and whether its confidence set
    contains the truth, which is the effect together with other missing ones."""
    if row.get("refused"):
        return {"first": None, "named": None, "covers": None, "in_a_set": None}
    sets = [set(s) for s in row["confidence_set"]]
    return {
        "first": row["effects"][:1] == [effect], "named": effect in row["effects"],
        "covers": {effect, *others} in sets, "in_a_set": any(effect in s for s in sets),
    }  # fmt: skip


def withheld_rows(results: Mapping[PublicJob, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per withheld effect; effects missing from the full chain are expected too."""
    own = {j: row for j, row in results.items() if j.kind == "withheld"}
    rest = {j.data_set: list(row.get("effects", [])) for j, row in own.items() if not j.effect}
    return [
        {"set": j.data_set, "twin": j.twin, "effect": j.effect, "rest": rest[j.data_set],
         "from_verdict": j.effect in json.loads(j.chain), **naming(row, j.effect, rest[j.data_set]), **_short(row)}
        for j, row in own.items() if j.effect
    ]  # fmt: skip


def injected_rows(results: Mapping[PublicJob, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per injected effect; effects named on the same halving without injection are expected too."""
    uninjected = {(j.data_set, j.split): list(r.get("effects", [])) for j, r in results.items() if j.kind == "nothing"}
    out = []
    for j, row in results.items():
        if j.kind == "injected":
            rest = uninjected.get((j.data_set, j.split), [])
            more = {key: row.get(key) for key in ("split_by", "parameters", "acts_on", "changed")}
            out.append({
                "set": j.data_set, "effect": j.effect, "split": j.split, "rest": rest,
                "named_without_it": j.effect in rest, **naming(row, j.effect, rest), **more, **_short(row),
            })  # fmt: skip
    return out


def nothing_rows(results: Mapping[PublicJob, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per set: how often a gap is claimed between halves of the same records."""
    out = []
    own = {j: row for j, row in results.items() if j.kind == "nothing"}
    for name in dict.fromkeys(j.data_set for j in own):
        rows = [row for j, row in own.items() if j.data_set == name]
        diagnosed = [row for row in rows if not row["refused"]]
        alarms = [row for row in diagnosed if row["status"] != "no_gap"]
        low, high = of_rate(len(alarms), len(diagnosed)) if diagnosed else (0.0, 1.0)
        named: dict[str, int] = {}
        for effect in (e for row in alarms for e in row["effects"]):
            named[effect] = named.get(effect, 0) + 1
        out.append({
            "set": name, "title": rows[0]["title"], "split_by": rows[0]["split_by"], "alarms": len(alarms),
            "splits": len(diagnosed), "rate": len(alarms) / len(diagnosed) if diagnosed else None, "interval": [low,
            high], "named": named, "p_values": [row["p_value"] for row in diagnosed], "accuracy": [row["accuracy"] for
            row in diagnosed], "refused": [r["refused"] for r in rows if r["refused"]],
        })  # fmt: skip
    return out


def closest_rows(results: Mapping[PublicJob, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per closest twin."""
    return [
        {"set": j.data_set, "detectors_alone": j.detectors_alone, **row}
        for j, row in results.items()
        if j.kind == "closest"
    ]


def single_rows(results: Mapping[PublicJob, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per recording: plain indicators, verdict, findings of the literature, and whether these agree."""
    verdicts = {j.recording: row for j, row in results.items() if j.kind == "recording"}
    indicators = [row for j, result in results.items() if j.kind == "looks" for row in result["recordings"]]
    titles = [result["title"] for j, result in results.items() if j.kind == "looks"]
    out = []
    for row in indicators:
        verdict = verdicts.get(row["recording"], {})
        real = not titles[0].startswith("virtual")
        findings = documented(row["recording"]) if real else ()  # numbers of a virtual rig denote other recordings
        unclear = [d for d in findings if d.shows == "fault unclear"]
        out.append({
            **row, "title": titles[0], **_short(verdict), "findings": [d.finding for d in findings],
            "reported_unclear": bool(unclear),
            "agrees": None if row["shows_fault"] is None or not real else row["shows_fault"] != bool(unclear),
        })  # fmt: skip
    return out


def _short(row: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("title", "refused", "status", "effects", "confidence_set", "p_value", "closure", "accuracy", "seconds")
    return {key: row[key] for key in keys if key in row}
