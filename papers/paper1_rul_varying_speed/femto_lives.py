"""Paper 1's twin of lives on FEMTO's real runs: remaining life before and after its gap is closed.

snapshots of a run, up to now --> twin, six simulated lives --+--> CNN, proposed model 3 --> judged to the run's end
                                                              |
    with the effects that the gap diagnosis names on records from the anomaly to now, or with what those records say
    of impacts, noise and path ("closed", as in table 5) -----+

The recipe is the paper's, with what these runs force on it: snapshots of 0.1 s every 10 s, each run at one speed, no
planted fault (inner race is taken, as in the paper), and no known end (ten times the healthy peak to peak is taken, as
`femto` does; what is judged is the time to the last snapshot). Two of the six end within the ten minutes after the
alarm that the paper waits for, so two minutes are tried as well.

Run as a part of the paper (``twingap run paper1 --profile full``), or alone:
``python -m papers.paper1_rul_varying_speed.femto_lives --profile full --out DIR``; interrupted, it goes on where it
was.
"""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from papers.paper1_rul_varying_speed import life_gap_diagnoses
from papers.paper1_rul_varying_speed.cases import Case, Reading, adapted, case_of
from papers.paper1_rul_varying_speed.femto_lives_tables import errors, of_runs, summary
from papers.paper1_rul_varying_speed.job import Added, Job, train_and_judge
from papers.paper1_rul_varying_speed.life_gap import MODELS, added
from papers.paper1_rul_varying_speed.life_gap_diagnoses import SEEN, Asked, modelled, pair_of, row_of
from papers.paper1_rul_varying_speed.methods.run import read_run
from papers.paper1_rul_varying_speed.models import architecture_of
from papers.paper1_rul_varying_speed.options import CONFIG, Options, read_options
from papers.paper1_rul_varying_speed.training_code import code_of_training
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.data import load
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_path
from twingap.records import RecordSet
from twingap.sweep import sweep

if TYPE_CHECKING:
    import pandas as pd

    from twingap.track import Run

FAULT: Final = "inner"
REFERENCE_MIN: Final = 10.0
"""Healthy beginning: 60 snapshots, as many as `twingap rul` takes."""
END_RATIO: Final = 10.0
"""Peak to peak at the end of life over the healthy one."""
STRIDES: Final = (2, 2)
"""Of the convolutions: 2,560 samples leave 128 features, near the 112 that the paper's 25,000 leave."""
PRINTED, CLOSED = "printed", "closed"
"""Variants of the configuration."""


@dataclass(frozen=True)
class Size:
    """How much is run.

    Parameters
    ----------
    bearings : tuple of str
        Empty: all.
    waits_min : tuple of float
        After the alarm until damage is fitted, min.
    seeds : int
        Trainings per run, wait, twin and model.
    steps : int
        Gradient steps of each.
    most_records : int
        Simulated records per training.
    """

    bearings: tuple[str, ...]
    waits_min: tuple[float, ...]
    seeds: int
    steps: int
    most_records: int


PROFILES: Final = {
    "smoke": Size(("Bearing2_1",), (2.0,), 1, 100, 300),
    "full": Size((), (10.0, 2.0), 5, 800, 2000),
}


@dataclass(frozen=True)
class Wanted:
    """One diagnosis.

    Parameters
    ----------
    bearing : str
    wait_min : float
    seed : int
    """

    bearing: str
    wait_min: float
    seed: int

    @property
    def words(self) -> str:
        """In words."""
        return f"{self.bearing}, {self.wait_min:g} min after the alarm"


@dataclass(frozen=True)
class FemtoLives:
    """What came out.

    Parameters
    ----------
    tables : dict of str to DataFrame
        femto_lives (runs and verdicts), femto_lives_rmse (trainings), femto_lives_summary.
    computed : int
        Diagnoses and trainings that ran now; the others came from the store.
    """

    tables: dict[str, pd.DataFrame]
    computed: int


def read_case(records: RecordSet, name: str, wait_min: float, options: Options) -> Case:
    """A run as the paper's recipe reads it; the end is known to the judge alone.

    Parameters
    ----------
    records : RecordSet
        Of the whole data set.
    name : str
        Of the bearing.
    wait_min : float
        After the alarm.
    options : Options
        The paper's: lives, their range, the rule of the anomaly.

    Raises
    ------
    TwingapError
        When nothing can be simulated before the run ends.
    """
    own = records.select(lambda c: c.group == name)
    if own.bearing is None:
        raise TwingapError("brings no bearing geometry", where=f"record set {records.name!r}")
    run = read_run(own)
    adaptation = dataclasses.replace(
        options.adaptation, reference_min=REFERENCE_MIN, after_alarm_min=wait_min,
        limit=END_RATIO * float(np.median(run.peak_to_peak[: run.rows_in(REFERENCE_MIN)])),
    )  # fmt: skip
    twin, waited = adapted(own, run, name, adaptation)
    # From here on the end of the run is looked at: for labels that only the judge gets.
    length, healthy = own.conditions[0].n_samples, run.rows_in(REFERENCE_MIN)
    return case_of(own, run, twin, run.time_s.size - 1, Reading(name, FAULT, length, healthy, None, waited))


@functools.lru_cache(maxsize=12)
def _case(name: str, wait_min: float, root: str | None, config: str) -> Case:
    return read_case(load("femto", root), name, wait_min, read_options(Path(config)))


def diagnosed(wanted: Wanted, *, root: str | None, config: str) -> dict[str, Any]:
    """What the printed twin lacks, by records from the anomaly to now alone, as a row."""
    from twingap.gap import diagnose

    case = _case(wanted.bearing, wanted.wait_min, root, config)
    signal = read_options(Path(config)).variants[PRINTED].signal
    asked = Asked("femto lives", SEEN, wanted.words, (wanted.bearing,), wanted.seed)
    real, sim = pair_of(asked, [case], signal)
    try:
        found = diagnose(real, modelled(signal), seed=asked.rng, sim=sim, quick=True)
    except TwingapError as error:
        return {"refused": str(error), "records": len(real)}
    return row_of(found) | {"records": len(real)}


def trainings_of(case: Case, options: Options, named: Added | None, size: Size) -> Iterator[Job]:
    """Trainings of the printed twin, of the same with the named effects where there are any, and of the closed one."""
    length = case.known.real.samples.shape[1]
    twins = [(PRINTED, None), *([(PRINTED, named)] if named is not None else []), (CLOSED, None)]
    for seed in range(size.seeds):
        for variant, more in twins:
            chosen = options.variants[variant]
            own = dataclasses.replace(options.training, steps=size.steps, alike=chosen.alike)
            for model in MODELS:
                shape = dataclasses.replace(architecture_of(model), length=length, strides=STRIDES)
                yield Job(
                    case.name, variant, model, shape, seed, own, chosen.signal, 1, size.most_records,
                    options.judging.criterion, added=more,
                )  # fmt: skip


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
) -> FemtoLives:
    """Diagnose and train what is missing; tables, figure.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path, optional
        Data root; TWINGAP_DATA when None.
    seed : int
        Of the diagnoses.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figure go there as well.
    progress : callable
    config : Path
        The paper's.
    draw : bool
        Make the figure.

    Raises
    ------
    TwingapError
        When FEMTO's runs are not at hand, or none of them can be predicted.
    """
    import twingap.gap
    from twingap.data.root import data_root
    from twingap.gap.knowledge import shipped_digest

    options, size = read_options(config), profile_of(PROFILES, profile, Path(__file__))
    where = None if root is None else str(root)
    records = load("femto", where)
    wanted = [Wanted(name, wait, seed) for wait in size.waits_min for name in size.bearings or records.groups]
    cases: dict[Wanted, Case] = {}
    refused: dict[Wanted, str] = {}
    for place, one in enumerate(wanted):
        progress("runs read", place, len(wanted))
        try:
            cases[one] = read_case(records, one.bearing, one.wait_min, options)
        except TwingapError as error:
            refused[one] = str(error)
    if not cases:
        raise TwingapError(next(iter(refused.values())), where="femto lives")
    given: dict[str, Any] = {"store": out / "results", "backend": backend, "address": address}
    answers = sweep(
        functools.partial(diagnosed, root=where, config=str(config)), list(cases),
        version=code_of_training() + digest_of_code(twingap.gap, sys.modules[__name__], life_gap_diagnoses),
        data={"learnt": shipped_digest(), "femto": digest_of_path(data_root(where) / "femto")},
        describe=lambda job: job.words, on_result=Count("diagnoses", len(cases), progress), **given,
    )  # fmt: skip
    told = {answer.job: dict(answer.value) for answer in answers}
    jobs = {one: list(trainings_of(case, options, added(told[one]), size)) for one, case in cases.items()}
    count = Count("trainings", sum(map(len, jobs.values())), progress)
    trained: list[tuple[Wanted, Job, dict[str, Any]]] = []
    computed = sum(bool(answer.why) for answer in answers)
    for one, case in cases.items():
        results = sweep(
            functools.partial(train_and_judge, case=case), jobs[one],
            data={"run": case.digest, "adaptation": repr((options.adaptation, one.wait_min, REFERENCE_MIN, END_RATIO))},
            version=code_of_training(), on_result=count,
            describe=functools.partial(_words, one), **given,
        )  # fmt: skip
        computed += sum(bool(r.why) for r in results)
        trained += [(one, r.job, dict(r.value)) for r in results]
    every = errors([(one.wait_min, job, value) for one, job, value in trained])
    made = {
        "femto_lives": of_runs([(one.bearing, one.wait_min, cases.get(one), told.get(one), refused.get(one, ""))
                                for one in wanted]),
        "femto_lives_rmse": every, "femto_lives_summary": summary(every),
    }  # fmt: skip
    keep_tables(made, out, log, "FEMTO")
    if draw:
        from papers.paper1_rul_varying_speed.femto_lives_figures import lives

        keep_figures([("femto_lives", lives(every, made["femto_lives"]))], out, log)
    return FemtoLives(made, computed)


def _words(wanted: Wanted, job: Job) -> str:
    return f"{wanted.words}, {job.variant} twin, {job.model}, seed {job.seed}, {job.added}"


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(
        run, "Paper 1's twin of lives on FEMTO's runs, before and after its gap is closed: tables and a figure.",
        lambda study: {name: study.tables[name] for name in ("femto_lives", "femto_lives_summary")}, arguments,
        takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper1_rul_varying_speed.femto_lives import main as run_main

    run_main()
