"""The training of the diagnosis on simulated gaps: what `twingap train` runs.

machines in chunks --examples--> learn --> Learnt --searches on other machines, in chunks--> score calibration --> files

Every chunk is kept, so that an interrupted training goes on where it was, and a larger one takes over a smaller one's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from twingap.effects import catalogue
from twingap.errors import TwingapError
from twingap.gap.features.comparison import feature_names
from twingap.gap.knowledge.examples import examples, stacked
from twingap.gap.knowledge.learn import Examples, learn
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.knowledge.learnt_file import definition, write_learnt
from twingap.gap.knowledge.score_calibration import Outcome, learn_score_calibration
from twingap.gap.knowledge.searches import searches
from twingap.gap.search.parameter_scale import coordinates
from twingap.provenance import digest_of_value, versions
from twingap.sweep import sweep

MACHINES: Final = 4020
"""Machines to learn from. More sharpen detectors slowly and take proportionally longer."""
CHUNK: Final = 30
"""Machines of one job."""
PER_SEARCH: Final = 6
"""Machines learnt from for each one that is searched: fewer searches make probabilities coarser."""
SEARCHED_FROM: Final = 1_000_000
"""Number of the first machine that is searched; machines learnt from have smaller numbers."""
SEARCH_CHUNK: Final = 10
MOST_RECORDS: Final = 24
"""Records of a simulated machine at most."""
SEED: Final = 20

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Chunk:
    """Simulated machines of one job.

    Parameters
    ----------
    seed : int
    first, count : int
        Numbers of the machines: first, first + 1, ...
    among : tuple of str
        Effects to draw; empty draws from the whole catalogue.
    """

    seed: int
    first: int
    count: int
    among: tuple[str, ...] = ()


def train(
    folder: Path,
    *,
    seed: int = SEED,
    machines: int = MACHINES,
    among: Sequence[str] = (),
    backend: str = "loky",
    address: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Learn the diagnosis from simulated gaps.

    Parameters
    ----------
    folder : Path
        For the result, in `folder`/learnt, and for all chunks on the way there, in `folder`/chunks.
    seed : int
    machines : int
        Simulated machines to learn from; a sixth as many more are searched.
    among : sequence of str
        Effects to learn; empty learns the whole catalogue.
    backend, address, jobs
        Where chunks are computed; see `twingap.sweep.sweep`. The result does not depend on it.
    progress : callable, optional
        Receives what is being done and the share that is done.

    Returns
    -------
    Path
        Folder of learnt.json and learnt.npz.

    Raises
    ------
    TwingapError
        For an effect that the catalogue does not have, or fewer than 20 machines.
    """
    say = progress or _nothing
    names = tuple(dict.fromkeys(among))
    for name in names:
        if name not in catalogue():
            raise TwingapError(f"unknown effect {name!r}", where="training")
    if machines < 20:
        raise TwingapError(f"machines = {machines}, at least 20 expected", where="training")
    run = partial(
        sweep,
        store=folder / "chunks",
        backend=backend,
        address=address,
        n_jobs=jobs,
        version=_version(),
        describe=_label,
    )
    wanted = [Chunk(seed, first, min(CHUNK, machines - first), names) for first in range(0, machines, CHUNK)]
    counted = _counted(say, "simulated gaps", len(wanted), 0.0, 0.7)
    made = stacked([_examples(r.value) for r in run(_example_chunk, wanted, on_result=counted)])
    learnt = learn(
        made, tuple(catalogue()), coordinates(), feature_names(), lambda what, part: say(what, 0.7 + 0.15 * part)
    )
    learnt.about.update(machines=machines, seed=seed, among=list(names), version=versions()["twingap"])
    count = machines // PER_SEARCH
    searched = [
        Chunk(seed, SEARCHED_FROM + first, min(SEARCH_CHUNK, count - first), names)
        for first in range(0, count, SEARCH_CHUNK)
    ]
    counted = _counted(say, "searches", max(len(searched), 1), 0.85, 0.15)
    key = digest_of_value({"machines": machines, "seed": seed, "among": list(names)})
    ended = run(partial(_search_chunk, learnt), searched, on_result=counted, data={"learnt": key})
    calibrate(learnt, [result.value for result in ended])
    write_learnt(learnt, folder / "learnt")
    return folder / "learnt"


def calibrate(learnt: Learnt, ends: Sequence[Mapping[str, Any]]) -> None:
    """Learn from ends of searches, chunk by chunk, what probabilities they stand for."""
    outcomes = [Outcome(*row) for chunk in ends for row in chunk["outcomes"]]
    missing = [bool(there) for chunk in ends for there in chunk["missing"]]
    chunk_of = [number for number, chunk in enumerate(ends) for _ in chunk["missing"]]
    learnt.calibration = learn_score_calibration(outcomes, missing, chunk_of)


def _version() -> str:
    """What chunks depend on besides their own numbers: names of features, definitions of effects."""
    effects = {name: definition(name) for name in catalogue()}
    return digest_of_value({"features": list(feature_names()), "effects": effects, "records": MOST_RECORDS})[:16]


def _label(chunk: Chunk) -> str:
    return f"machines {chunk.first} to {chunk.first + chunk.count - 1}"


def _example_chunk(chunk: Chunk) -> dict[str, Any]:
    made = examples(chunk.seed, range(chunk.first, chunk.first + chunk.count), MOST_RECORDS, chunk.among)
    return dict(vars(made))


def _examples(stored: Mapping[str, Any]) -> Examples:
    return Examples(**{name: np.asarray(value) for name, value in stored.items()})


def _search_chunk(learnt: Learnt, chunk: Chunk) -> dict[str, Any]:
    numbers = range(chunk.first, chunk.first + chunk.count)
    ends = searches(learnt, chunk.seed, numbers, MOST_RECORDS, chunk.among)
    return {"outcomes": [list(map(float, outcome)) for outcome, _ in ends], "missing": [there for _, there in ends]}


def _counted(progress: Progress, what: str, total: int, begin: float, part: float) -> Callable[[object], None]:
    done = iter(range(1, total + 1))
    return lambda _: progress(what, begin + part * next(done) / total)


def _nothing(what: str, fraction: float) -> None:
    pass
