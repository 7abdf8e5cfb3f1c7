"""Paper 1's twin of lives on FEMTO's real runs: remaining life before and after its gap is closed.

snapshots of a run, up to now --> twin, six simulated lives --+--> CNN, proposed model 3 --> judged to the run's end
                                                              |
    with the effects that the gap diagnosis names on records from the anomaly to now, or with what those records say
    of impacts, noise and path ("closed", as in table 5) -----+

The recipe is the paper's, with what these runs force on it: snapshots of 0.1 s every 10 s, each run at one speed, no
planted fault (inner race is taken, as in the paper), and no known end (ten times the healthy peak to peak is taken, as
`femto` does; what is judged is the time to the last snapshot). Two of the six end within the ten minutes after the
alarm that the paper waits for, so two minutes are tried as well.
"""

import dataclasses
import functools
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from papers.extra.life_gap.diagnoses import SEEN, Asked, modelled, pair_of, row_of
from papers.extra.life_gap.jobs import MODELS, added, lives_config, root_of
from papers.framework import Inputs, Result, Work
from papers.paper1_rul_varying_speed.cases import Case, adapted, case_of
from papers.paper1_rul_varying_speed.job import Added, Job, job_of, train_and_judge
from papers.paper1_rul_varying_speed.lives import options as of_lives
from papers.paper1_rul_varying_speed.methods.architecture import architecture_of
from papers.paper1_rul_varying_speed.methods.run import read_run
from twingap import RecordSet, TwingapError
from twingap.data import data_root, load
from twingap.gap.knowledge import shipped_digest
from twingap.provenance import digest_of_path

FAULT: Final = "inner"
REFERENCE_MIN: Final = 10.0  # healthy beginning: 60 snapshots, as many as `twingap rul` takes
END_RATIO: Final = 10.0  # peak to peak at the end of life over the healthy one
STRIDES: Final = (2, 2)
"""Of the convolutions: 2,560 samples leave 128 features, near the 112 that the paper's 25,000 leave."""
PRINTED, CLOSED = "printed", "closed"  # variants of the configuration


@dataclass(frozen=True)
class Size(of_lives.Size):
    waits_min: tuple[float, ...]


@dataclass(frozen=True)
class Options:
    lives: Path
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Wanted:
    bearing: str
    wait_min: float
    seed: int

    @property
    def words(self) -> str:
        return f"{self.bearing}, {self.wait_min:g} min after the alarm"


def read_case(records: RecordSet, name: str, wait_min: float, options: of_lives.Options) -> Case:
    """A run as the paper's recipe reads it; the end is known to the judge alone."""
    own = records.select(lambda c: c.group == name)
    run = read_run(own)
    healthy = run.rows_in(REFERENCE_MIN)
    adaptation = dataclasses.replace(
        options.adaptation, reference_min=REFERENCE_MIN, after_alarm_min=wait_min,
        limit=END_RATIO * float(np.median(run.peak_to_peak[:healthy])),
    )  # fmt: skip
    twin, waited = adapted(own, run, name, adaptation)
    # From here on the end of the run is looked at: for labels that only the judge gets.
    return case_of(
        own, run, twin, run.time_s.size - 1, waited, name=name, fault=FAULT, n_samples=own.conditions[0].n_samples,
        healthy_rows=healthy,
    )  # fmt: skip


@functools.lru_cache(maxsize=12)
def _case(name: str, wait_min: float, root: str | None, config: str) -> Case:
    return read_case(load("femto", root), name, wait_min, of_lives.read_options(Path(config)))


def diagnosed(wanted: Wanted, *, root: str | None, config: str) -> dict[str, Any]:
    """What the printed twin lacks, by records from the anomaly to now alone, as a row."""
    case = _case(wanted.bearing, wanted.wait_min, root, config)
    signal = of_lives.read_options(Path(config)).variants[PRINTED].signal
    asked = Asked("femto lives", SEEN, wanted.words, (wanted.bearing,), wanted.seed)
    real, sim = pair_of(asked, [case], signal)
    return row_of(asked, real, modelled(signal), sim)


def trainings_of(case: Case, options: of_lives.Options, named: Added | None, size: Size) -> Iterator[Job]:
    """Trainings of the printed twin, of the same with the named effects where there are any, and of the closed one."""
    twins = [(PRINTED, None), *([(PRINTED, named)] if named is not None else []), (CLOSED, None)]
    for seed, (variant, more), model in itertools.product(range(size.seeds), twins, MODELS):
        shape = dataclasses.replace(architecture_of(model), strides=STRIDES)
        yield job_of(case, options, variant, model, shape, seed, size, added=more)


def wanted(work: Work) -> list[Wanted]:
    names = work.size.bearings or load("femto", root_of(work)).groups
    return [Wanted(name, wait, work.seed) for wait in work.size.waits_min for name in names]


def cases(work: Work) -> dict[Wanted, Case]:
    """Runs as training sees them; why there is none of the others stands in ``work["refused"]``."""
    records = load("femto", root_of(work))
    found: dict[Wanted, Case] = {}
    refused: dict[Wanted, str] = {}
    for place, one in enumerate(work["wanted"]):
        work.progress("femto_lives, runs read", place, len(work["wanted"]))
        try:
            found[one] = read_case(records, one.bearing, one.wait_min, of_lives.read_options(lives_config(work)))
        except TwingapError as error:
            refused[one] = str(error)
    if not found:
        raise TwingapError(next(iter(refused.values())), where="femto lives")
    work["refused"] = refused
    return found


def inputs(work: Work) -> Inputs:
    """Where the snapshots are, and the digests of all that a diagnosis reads."""
    config = lives_config(work)
    read = f"{shipped_digest()} {digest_of_path(data_root(work.root) / 'femto')}"
    return {"root": (root_of(work), read), "config": (str(config), repr(of_lives.read_options(config)))}


def trained(work: Work) -> Iterator[tuple[Wanted, Result[Job]]]:
    options = of_lives.read_options(lives_config(work))
    told = {r.job: added(dict(r.value)) for r in work["diagnoses"]}
    for one, case in work["cases"].items():
        results = work.sweep(
            train_and_judge, trainings_of(case, options, told[one], work.size), {"case": (case, case.digest)},
            lambda j: f"{j.bearing}, {j.variant} twin, {j.model}, seed {j.seed}, {j.added}",
            f"training, {one.words}",
            data={"adaptation": repr((options.adaptation, one.wait_min, REFERENCE_MIN, END_RATIO))},
        )  # fmt: skip
        yield from ((one, result) for result in results)
