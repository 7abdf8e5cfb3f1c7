"""Training of the diagnosis on simulated gaps: the computation of `twingap train`.

machines in chunks --examples--> learn --> Learnt --searches on other machines, in chunks--> score calibration --> files

Chunks are stored: an interrupted training resumes, and a larger one reuses the chunks of a smaller one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from twingap.effects import trainable
from twingap.errors import TwingapError
from twingap.gap.features.comparison import feature_names
from twingap.gap.knowledge.examples import examples, stacked
from twingap.gap.knowledge.learn import Examples, learn
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.knowledge.learnt_file import definition, write_learnt
from twingap.gap.knowledge.score_calibration import Outcome, learn_score_calibration
from twingap.gap.knowledge.searches import searches
from twingap.gap.search.parameter_scale import trained_coordinates
from twingap.provenance import digest_of_value, versions
from twingap.sweep import sweep

MACHINES: Final = 4020
"""Number of machines for training. More improve detectors slowly, at a proportional cost."""
CHUNK: Final = 30
"""Machines of one job. A smaller number balances the load better, with more files."""
PER_SEARCH: Final = 6
"""Machines trained on per machine searched. A larger value makes the score calibration less certain."""
SEARCHED_FROM: Final = 1_000_000
"""Number of the first machine searched; machines trained on have smaller numbers."""
SEARCH_CHUNK: Final = 10
"""Searched machines of one job. A smaller number balances the load better, with more files."""
MOST_RECORDS: Final = 24
"""Largest number of records of a simulated machine. A larger number takes proportionally longer."""
SEED: Final = 20
"""Default seed of the simulated machines."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Chunk:
    """Simulated machines of one job: `count` of them, numbered from `first` on."""

    seed: int
    first: int
    count: int


def train(
    folder: Path, *, seed: int = SEED, machines: int = MACHINES, backend: str = "loky", address: str | None = None,
    jobs: int | None = None, progress: Progress | None = None,
) -> Path:  # fmt: skip
    """Train the diagnosis on simulated gaps.

    Parameters
    ----------
    folder : Path
        Output folder: models in `folder`/learnt, intermediate chunks in `folder`/chunks.
    machines : int
        Number of simulated machines to train on; a sixth as many more are searched.
    backend, address, jobs
        Where chunks are computed; see `twingap.sweep.sweep`. The result does not depend on it.
    progress : callable, optional
        Called with a description of the current step and the completed part, 0 to 1.

    Returns
    -------
    Path
        Folder of learnt.json and learnt.npz.

    Raises
    ------
    TwingapError
        For fewer than 20 machines, or where too few of them have a gap or none.
    """
    notify = progress or (lambda what, part: None)
    if machines < 20:
        raise TwingapError(f"machines = {machines}, at least 20 expected", where="training")
    run = partial(
        sweep, store=folder / "chunks", backend=backend, address=address, n_jobs=jobs, version=_version(),
        describe=_label,
    )  # fmt: skip
    wanted = [Chunk(seed, first, min(CHUNK, machines - first)) for first in range(0, machines, CHUNK)]
    counted = _counted(notify, "simulated gaps", len(wanted), 0.0, 0.7)
    parts = (result.value for result in run(_example_chunk, wanted, on_result=counted))
    made = stacked([Examples(**{name: np.asarray(value) for name, value in part.items()}) for part in parts])
    learning = lambda what, part: notify(what, 0.7 + 0.15 * part)  # noqa: E731
    learnt = learn(made, tuple(trainable()), trained_coordinates(), feature_names(), learning)
    learnt.about.update(machines=machines, seed=seed, version=versions()["twingap"])
    count = machines // PER_SEARCH
    searched = [
        Chunk(seed, SEARCHED_FROM + first, min(SEARCH_CHUNK, count - first)) for first in range(0, count, SEARCH_CHUNK)
    ]
    counted = _counted(notify, "searches", max(len(searched), 1), 0.85, 0.15)
    key = digest_of_value({"machines": machines, "seed": seed})
    ended = run(partial(_search_chunk, learnt), searched, on_result=counted, data={"learnt": key})
    calibrate(learnt, [result.value for result in ended])
    write_learnt(learnt, folder / "learnt")
    return folder / "learnt"


def calibrate(learnt: Learnt, ends: Sequence[Mapping[str, Any]]) -> None:
    """Add the score calibration to `learnt`, from searches as `_search_chunk` returns them."""
    outcomes = [Outcome(*row) for chunk in ends for row in chunk["outcomes"]]
    missing = [bool(there) for chunk in ends for there in chunk["missing"]]
    chunk_of = [number for number, chunk in enumerate(ends) for _ in chunk["missing"]]
    learnt.calibration = learn_score_calibration(outcomes, missing, chunk_of)


def _version() -> str:
    """Version of the chunks: a hash of the names of features, the definitions of effects and the number of records."""
    effects = {name: definition(name) for name in trainable()}
    return digest_of_value({"features": list(feature_names()), "effects": effects, "records": MOST_RECORDS})[:16]


def _label(chunk: Chunk) -> str:
    """Description of a job for messages."""
    return f"machines {chunk.first} to {chunk.first + chunk.count - 1}"


def _example_chunk(chunk: Chunk) -> dict[str, Any]:
    """Arrays of the examples of a chunk."""
    made = examples(chunk.seed, range(chunk.first, chunk.first + chunk.count), MOST_RECORDS)
    return dict(vars(made))


def _search_chunk(learnt: Learnt, chunk: Chunk) -> dict[str, Any]:
    """Searches of a chunk: `outcomes` (fields of `Outcome`, a row per effect) and `missing` (the truth of each row)."""
    numbers = range(chunk.first, chunk.first + chunk.count)
    ends = searches(learnt, chunk.seed, numbers, MOST_RECORDS)
    return {"outcomes": [list(map(float, outcome)) for outcome, _ in ends], "missing": [there for _, there in ends]}


def _counted(progress: Progress, what: str, total: int, begin: float, part: float) -> Callable[[object], None]:
    """Callback per finished job, for a step that covers `part` of the progress from `begin`."""
    done = iter(range(1, total + 1))
    return lambda _: progress(what, begin + part * next(done) / total)
