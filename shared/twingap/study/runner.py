"""Complete blind study, from cases to study.json; an interrupted study resumes.

cases --make, seal--> sealed.json --blind--> diagnoses, rivals --open seals--> rows --score--> study.json
"""

from __future__ import annotations

import functools
import json
import os
import secrets
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from twingap import files
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_value, plain, versions
from twingap.study import scores, worker
from twingap.study.parameters import parameter_errors
from twingap.study.prepare import prepared, training_worlds
from twingap.study.rivals import PERMUTATIONS, Detectors, Examples, OneClassifier, Rival, as_row, with_two_sample
from twingap.study.sweeps import swept
from twingap.study.verdicts import PLAIN, Found, Row, found_in, of_kind, was_of

if TYPE_CHECKING:
    from twingap.rigs.worlds import Case

SCHEMA: Final = "twingap.study/1"
CHUNK: Final = 20
"""Training worlds of the rivals per job; more make fewer and longer jobs."""
DIAGNOSIS: Final = "diagnosis"
TWO_SAMPLE: Final = "two-sample test, random forest"
BOTH: Final = "extra-trees detectors with two-sample test"

Progress = Callable[[str, int, int], None]
"""Progress callback: progress(stage, done, total)."""


@dataclass(frozen=True)
class Study:
    """Result of a study.

    Parameters
    ----------
    table : Mapping
        Content of study.json.
    rows : Mapping[str, Sequence[Row]]
        Rows by method, the diagnosis first.
    """

    table: Mapping[str, Any]
    rows: Mapping[str, Sequence[Row]]


def diagnosis() -> worker.Diagnose:
    """The diagnosis of this package."""
    from twingap.gap import diagnose  # type: ignore[attr-defined, unused-ignore]

    return diagnose  # type: ignore[no-any-return, unused-ignore]


def default_rivals() -> tuple[Rival, ...]:
    """The rivals that are trained on examples."""
    from twingap.study.distortions import DistortionTests
    from twingap.study.neural import NeuralPosterior

    return (OneClassifier(), Detectors(), NeuralPosterior(), DistortionTests())


def run_study(
    out: str | os.PathLike[str],
    cases: Sequence[Case],
    seed: int,
    *,
    diagnose: worker.Diagnose | None = None,
    prepare: worker.Prepare = prepared,
    training: worker.Triples = training_worlds,
    training_count: int = 1000,
    rivals: Sequence[Rival] | None = None,
    permutations: int = PERMUTATIONS,
    closest: bool = False,
    jobs: int | None = None,
    backend: str = "loky",
    address: str | None = None,
    command: str = "",
    progress: Progress = lambda what, done, total: None,
) -> Study:
    """Make, seal, diagnose, open and score worlds.

    Parameters
    ----------
    out : path-like
        Output folder; one that holds the beginning of the same study is resumed.
    cases : sequence of Case
        From `twingap.rigs.worlds.cases`; names unique.
    diagnose : callable, optional
        See `worker.Diagnose`; `twingap.gap.diagnose` when None. Defined at module level, as `prepare` and `training`.
    prepare : callable
        Makes the simulated records for the rivals; see `worker.Prepare`.
    training : callable
        Makes the worlds on which rivals are trained; see `worker.Triples`.
    training_count : int
        Number of these worlds; 0 = no rival that needs training.
    rivals : sequence of Rival, optional
        None = `default_rivals()`.
    permutations : int
        Permutations of the rivals' two-sample test; with fewer than 19 it can never claim a gap, with 0 no rival runs.
    closest : bool
        Whether the diagnosis also seeks the closest twin, which takes about twice as long.
    jobs, backend, address
        Where to run; see `twingap.sweep.backends.open_pool`.
    command : str
        Command line, for the provenance.

    Returns
    -------
    Study
        Written to study.json, study.md and figures by `twingap.study.write_study`.

    Raises
    ------
    TwingapError
        When the folder holds another study, or a truth differs from the sealed one.
    SweepError
        When a diagnosis ended with an error other than `TwingapError`; results of the other worlds are kept.
    """
    begin = time.perf_counter()
    names = [case.name for case in cases]
    if len(set(names)) < len(names):
        raise TwingapError("two cases of one name", where="study", mend="give every case its own name")
    diagnose = diagnose or diagnosis()
    code = {"diagnosis": digest_of(diagnose), "worlds": digest_of_worlds()}

    where = {"n_jobs": jobs, "backend": backend, "address": address}
    run = _Run(Path(out), cases, seed, code, where, progress)
    sealed = _sealed(run)
    worlds, learnt_from = sealed["worlds"], learnt_digest(diagnose)
    diagnoses = run.swept(
        "diagnoses", "worlds diagnosed", functools.partial(worker.diagnose_world, diagnose=diagnose, prepare=prepare),
        [worker.DiagnoseJob(c, seed, worlds[c.name]["records_sha256"], permutations, closest) for c in cases],
        digest_of(worker.diagnose_world, "blind", "rivals", "statistics", "worker"),
        {**code, "learnt": learnt_from, "prepare": digest_of(prepare)},
    )  # fmt: skip
    found = {DIAGNOSIS: [_found(d) for d in diagnoses]}
    if permutations:
        found[TWO_SAMPLE] = [_tested(d) for d in diagnoses]
    learnt, skipped = _learnt(run, training, training_count if permutations else 0, rivals)
    x = np.array([d["statistics"] for d in diagnoses])
    for rival in learnt:
        found[rival.name] = rival.predict(x)
        if isinstance(rival, Detectors):
            found[BOTH] = with_two_sample(found[rival.name], found[TWO_SAMPLE])

    was = _opened(run, sealed)
    rows = {method: [Row(w, f) for w, f in zip(was, findings, strict=True)] for method, findings in found.items()}
    provenance = {
        "seed": seed, "cases": len(cases), "command": command, "versions": versions(), "code_sha256": code,
        "sealed_with": sealed["code_sha256"], "learnt_sha256": learnt_from,
        "frozen": sealed["code_sha256"]["diagnosis"] == code["diagnosis"],
        "closest": closest, "training_worlds_of_rivals": training_count if learnt else 0, "rivals_skipped": skipped,
        "diagnosis_s": sum(d["seconds"] for d in diagnoses), "runtime_s": time.perf_counter() - begin,
    }  # fmt: skip
    return Study(_table(rows, diagnoses, provenance), rows)


@dataclass(frozen=True)
class _Run:
    """What the steps of a study have in common: its folder, cases, seed, digests of the code, and where jobs run."""

    folder: Path
    cases: Sequence[Case]
    seed: int
    code: Mapping[str, str]
    where: Mapping[str, Any]
    progress: Progress

    def swept(
        self, step: str, what: str, function: Callable[[Any], Any], work: Sequence[Any], version: str,
        data: Mapping[str, str],
    ) -> list[Any]:  # fmt: skip
        """Results of the jobs of a step; those that the folder holds are reused."""
        return swept(
            function, work, functools.partial(self.progress, what), _in_words, store=self.folder / "work" / step,
            version=version, data=data, **self.where,
        )  # fmt: skip


def _table(
    rows: Mapping[str, Sequence[Row]], diagnoses: Sequence[Mapping[str, Any]], provenance: dict[str, Any]
) -> dict[str, Any]:
    """Content of study.json."""
    from twingap.effects import catalogue

    own, effects = rows[DIAGNOSIS], list(catalogue())
    plain_own = of_kind(own, *PLAIN)
    worlds = []
    for i, row in enumerate(own):
        made = {key: diagnoses[i][key] for key in ("refused", "report")}
        worlds.append({**plain(row), **made, "rivals": {m: as_row(rows[m][i].found) for m in rows if m != DIAGNOSIS}})
    return {
        "schema": SCHEMA,
        "scores": [s.row for s in scores.headline(own)],
        "rivals": {m: [s.row for s in scores.headline(r)] for m, r in rows.items() if m != DIAGNOSIS},
        "details": [s.row for s in scores.detailed(own)],
        "by_effect": scores.by_effect(own),
        "by_uncatalogued": scores.by_uncatalogued(own),
        "parameters": parameter_errors(plain_own),
        "statuses": scores.statuses(own),
        "confusion": {"effects": effects, "first_named": [*effects, scores.NOTHING],
                      "counts": scores.confusion(own, effects).tolist()},
        "reliability": scores.reliability(plain_own),
        "worlds": worlds,
        "provenance": provenance,
    }  # fmt: skip


def _sealed(run: _Run) -> dict[str, Any]:
    """Content of sealed.json, written here unless the folder holds one."""
    cases, code = run.cases, run.code
    identity = {"seed": run.seed, "cases": digest_of_value([plain(case) for case in cases]), "worlds": code["worlds"]}
    held = run.folder / "sealed.json"
    if held.exists():
        return _resumed(held, identity)
    nonces = {case.name: secrets.token_hex(16) for case in cases}
    # Nonces are written first: without them the seals could not be opened.
    _write(run.folder / "nonces.json", nonces)
    work = [worker.SealJob(case, run.seed, nonces[case.name]) for case in cases]
    made = run.swept("sealing", "worlds sealed", worker.seal_world, work, code["worlds"], {})
    sealed = {"asked": identity, "code_sha256": dict(code),
              "worlds": {case.name: value for case, value in zip(cases, made, strict=True)}}  # fmt: skip
    _write(held, sealed)
    return sealed


def _resumed(held: Path, identity: Mapping[str, Any]) -> dict[str, Any]:
    try:
        sealed: dict[str, Any] = json.loads(held.read_text(encoding="utf-8"))
        before = sealed["asked"]
    except (ValueError, KeyError, TypeError) as error:
        raise TwingapError(f"is damaged: {error}", where=held, mend="name a new folder") from error
    for what in ("seed", "cases", "worlds"):
        if before.get(what) != identity[what]:
            why = "its worlds were made by other code" if what == "worlds" else f"it has another {what.rstrip('s')}"
            raise TwingapError(f"another study was sealed here: {why}", where=held, mend="name a new folder")
    return sealed


def _opened(run: _Run, sealed: Mapping[str, Any]) -> list[Any]:
    """Truths of the worlds, each verified against its seal."""
    from twingap.rigs.worlds import open_seal

    nonces = json.loads((run.folder / "nonces.json").read_text(encoding="utf-8"))
    own = digest_of(worker.open_world, "closure")
    version = digest_of_value([run.code["worlds"], own, _digest_of_references()])
    work = [worker.OpenJob(case, run.seed) for case in run.cases]
    results = run.swept("opening", "seals opened", worker.open_world, work, version, {})
    was, opened = [], {}
    for case, value in zip(run.cases, results, strict=True):
        seal = sealed["worlds"][case.name]["seal"]
        truth = open_seal(seal, value["truth"], nonces[case.name])
        was.append(was_of(truth, value["closure"], value["left"]))
        opened[case.name] = {"seal": seal, "nonce": nonces[case.name], "truth": value["truth"]}
    _write(run.folder / "opened.json", opened)
    return was


def _learnt(
    run: _Run, training: worker.Triples, count: int, rivals: Sequence[Rival] | None
) -> tuple[list[Rival], dict[str, str]]:
    """Trained rivals, and the reasons why others were skipped."""
    wanted = list(default_rivals() if rivals is None else rivals)
    skipped = {r.name: reason for r in wanted if (reason := r.skip())}
    ready = [r for r in wanted if r.name not in skipped]
    if not count or not ready:
        return [], skipped | {r.name: "no training worlds" for r in ready}
    sizes = [min(CHUNK, count - start) for start in range(0, count, CHUNK)]
    parts = run.swept(
        "training", "training worlds of rivals", functools.partial(worker.learn_from, worlds=training),
        [worker.LearnJob(run.seed, i, size) for i, size in enumerate(sizes)],
        digest_of(worker.learn_from, "statistics"),
        {"training": digest_of(training), "diagnosis": run.code["diagnosis"]},
    )  # fmt: skip
    x, present = (np.concatenate([part[name] for part in parts]) for name in ("x", "present"))
    examples = Examples(x, present.astype(bool), tuple(parts[0]["effects"]))
    for place, rival in enumerate(ready):
        run.progress("rivals trained", place, len(ready))
        rival.fit(examples, np.random.default_rng([run.seed, place, 0xF17]))
    return ready, skipped


def _in_words(job: Any) -> str:
    """Name of the case without further labels, as it is stored next to results that a diagnosis could read."""
    return job.case.name if hasattr(job, "case") else f"chunk {job.chunk}"


def _found(diagnosis: Mapping[str, Any]) -> Found:
    usage = {"runtime_s": diagnosis["seconds"], "peak_mb": diagnosis["peak_mb"]}
    return Found("refused", **usage) if diagnosis["report"] is None else found_in(diagnosis["report"], **usage)


def _tested(diagnosis: Mapping[str, Any]) -> Found:
    test = diagnosis["two_sample"]
    return Found(test["status"], tuple(test.get("effects", ())), p_value=test.get("p_value"))


def digest_of(function: Callable[..., Any], *own: str) -> str:
    """Digest of a function's code: of the whole package for the diagnosis, else of the function's module."""
    import importlib

    module = function.__module__
    parts: list[ModuleType | Any] = [importlib.import_module(f"twingap.study.{name}") for name in own] or [function]
    if module.startswith(("twingap.gap", "twingap.study.prepare")):
        parts += [
            importlib.import_module(f"twingap.{p}") for p in ("gap", "signal", "identification", "twins", "effects")
        ]
    return digest_of_code(*parts)


def digest_of_worlds() -> str:
    """Digest of the code that makes worlds."""
    import twingap.rigs

    return digest_of_code(twingap.rigs)


def _digest_of_references() -> str:
    """Digest of the code that computes a world's gap and calibrates its twin."""
    from twingap.gap.distance import feature_vectors, paired
    from twingap.gap.search import evidence, optimise
    from twingap.identification import baseline, calibrate
    from twingap.signal import record_transforms
    from twingap.twins import simulator

    return digest_of_code(
        baseline, calibrate, paired, evidence, optimise, simulator, record_transforms, feature_vectors
    )


def learnt_digest(diagnose: worker.Diagnose) -> str:
    """Digest of the trained model of this package's diagnosis; empty for another method."""
    from twingap.gap.knowledge import shipped_digest

    return shipped_digest() if diagnose.__module__.startswith("twingap.gap") else ""


def _write(path: Path, value: Any) -> None:
    with files.replacing(path) as temporary:
        temporary.write_text(json.dumps(plain(value), indent=1, sort_keys=True) + "\n", encoding="utf-8")


def command_line() -> str:
    """Command line of this process."""
    import shlex

    name = Path(sys.argv[0]).name
    return shlex.join([*(["python", "-m", "twingap.cli"] if name == "__main__.py" else [name]), *sys.argv[1:]])
