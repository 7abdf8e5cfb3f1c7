"""What a diagnosis brings along, learnt beforehand from simulated gaps: `twingap train`.

draw_gap --calibrate, compare--> examples (in chunks, resumable) --learn--> detectors, estimators, null --+
draw_gap --search with these--> ends of searches (in chunks, resumable) --learn--> judgement --------------+--> cache
"""

from __future__ import annotations

import gzip
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from twingap.errors import TwingapError
from twingap.files import replacing, sha256, try_folder
from twingap.provenance import digest_of_value

if TYPE_CHECKING:
    from twingap.gap.knowledge.learn import Learnt
    from twingap.gap.knowledge.score_calibration import Judgement
    from twingap.records import RecordSet

MACHINES: Final = 2010
"""Machines of a full training, which takes some 20 minutes on two threads with the searches."""
CHUNK: Final = 30
PER_SEARCH: Final = 6
"""Machines learnt from for each one that is searched. Judged by half as many, effects that were said to be missing
at 0.7 to 0.9 were so in seven of ten cases."""
SEARCHED_FROM: Final = 1_000_000
"""Number of the first machine that is searched: none of them is learnt from."""
SEARCH_CHUNK: Final = 10
MOST_RECORDS: Final = 24
SEED: Final = 20

Report = Callable[[str, float], None]


def quiet(what: str, fraction: float) -> None:
    """Report nothing."""


def cache_folder() -> Path:
    """Where what is learnt is kept: ``TWINGAP_HOME``/gap, or the user's cache folder."""
    home = os.environ.get("TWINGAP_HOME")
    if home:
        return Path(home).absolute() / "gap"
    import pooch

    return Path(pooch.os_cache("twingap")) / "gap"


def default_machines() -> int:
    """Machines to learn from when nobody says: `MACHINES`, or ``TWINGAP_GAP_MACHINES`` for trials and tests.

    Raises
    ------
    TwingapError
        When the variable is not a number of at least 20.
    """
    text = os.environ.get("TWINGAP_GAP_MACHINES", str(MACHINES))
    if not text.isdecimal() or int(text) < 20:
        raise TwingapError(f"{text!r}, a number of at least 20 expected", where="TWINGAP_GAP_MACHINES")
    return int(text)


def default_among() -> tuple[str, ...]:
    """Effects to learn when nobody says: all, or those that ``TWINGAP_GAP_EFFECTS`` lists with commas, for trials.

    Raises
    ------
    TwingapError
        For an unknown effect.
    """
    from twingap.effects import catalogue

    names = tuple(name.strip() for name in os.environ.get("TWINGAP_GAP_EFFECTS", "").split(",") if name.strip())
    for name in names:
        if name not in catalogue():
            raise TwingapError(f"unknown effect {name!r}", where="TWINGAP_GAP_EFFECTS")
    return names


def behind_examples() -> tuple[ModuleType, ...]:
    """Code that examples depend on: what draws, simulates, calibrates and compares."""
    import twingap.effects
    import twingap.gap.features
    import twingap.identify
    import twingap.twins
    from twingap.gap import external_simulator as own_simulator
    from twingap.gap.distance import feature_vectors as views
    from twingap.gap.distance import paired as distance
    from twingap.gap.distance import stratification as strata
    from twingap.gap.features import comparison
    from twingap.gap.features.pooled import features as whole  # fmt: skip
    from twingap.gap.features.pooled import trends
    from twingap.gap.knowledge import effect_variants as as_built
    from twingap.gap.knowledge import examples, machines
    from twingap.gap.knowledge import outside_catalogue as strangers
    from twingap.gap.knowledge import simulated_gaps as gaps
    from twingap.gap.search import evidence
    from twingap.gap.search import parameter_scale as parameters
    from twingap.identify import baseline, calibrate, speed, speed_reading
    from twingap.identify import impact_band as band
    from twingap.signal import order_statistics
    from twingap.signal import record_transforms as view
    from twingap.twins import simulator

    return (
        twingap.effects, twingap.twins, twingap.identify, twingap.gap.features, band, baseline, calibrate,
        comparison, distance, evidence, own_simulator, simulator, speed, speed_reading, strata, trends, view, views,
        whole, as_built, examples, gaps, machines, parameters, strangers, order_statistics,
    )  # fmt: skip


def behind_learning() -> tuple[ModuleType, ...]:
    """Code that what is learnt depends on besides: what learns, and what searches."""
    from twingap.gap.knowledge import detectability as visible
    from twingap.gap.knowledge import detectors, learn, null, searches, trees
    from twingap.gap.knowledge import score_calibration as judgement
    from twingap.gap.search import effect_search as which
    from twingap.gap.search import initial_values as starts
    from twingap.gap.search import optimise as nearest
    from twingap.gap.search import parameter_prior as prior
    from twingap.gap.search import spectral_fits as likeliest

    return learn, detectors, trees, null, judgement, searches, visible, which, nearest, starts, prior, likeliest


def examples_key(seed: int = SEED, among: Sequence[str] = ()) -> str:
    """Digest of all that examples depend on: the catalogue, and the code behind them."""
    from twingap.effects import catalogue
    from twingap.effects.handover import digest_of_effects
    from twingap.provenance import digest_of_code

    own = digest_of_effects()
    about = ({"own effects": own} if own else {}) | {
        "code": digest_of_code(*behind_examples()), "effects": list(catalogue()), "seed": seed,
        "most_records": MOST_RECORDS, "chunk": CHUNK, "among": list(among),
    }  # fmt: skip
    return digest_of_value(about)[:16]


def key(machines: int, seed: int = SEED, among: Sequence[str] = ()) -> str:
    """Digest of all that what is learnt depends on: the examples, their number, and how is learnt from them."""
    from twingap.provenance import digest_of_code

    code = digest_of_code(*behind_learning())
    about = {"examples": examples_key(seed, among), "learn": code, "machines": machines}
    return digest_of_value(about)[:16]


def is_trained() -> bool:
    """Whether what a diagnosis asks for is in the cache."""
    return _whole(cache_folder() / f"learnt-{key(default_machines(), SEED, default_among())}.gz")


def train(
    cache: Path | None = None,
    seed: int = SEED,
    report: Report = quiet,
    *,
    machines: int = 0,
    jobs: int = 0,
    among: Sequence[str] = (),
) -> Path:
    """Learn the diagnosis from simulated gaps, or return what was learnt before.

    Parameters
    ----------
    cache : Path, optional
        Folder for the result and the examples on the way there; an interrupted training goes on where it was.
    seed : int
    report : callable
        Told of progress.
    machines : int
        Simulated machines to learn from; 0 is `default_machines`.
    jobs : int
        Processes; 0 is one per core.
    among : sequence of str
        Effects to learn; empty is `default_among`.

    Returns
    -------
    Path
        The learnt file, beside it its sha256.
    """
    import joblib

    from twingap.effects import catalogue
    from twingap.effects.handover import handed_effects, with_effects
    from twingap.gap.features.comparison import feature_names
    from twingap.gap.knowledge.examples import stacked
    from twingap.gap.knowledge.learn import learn
    from twingap.gap.search.parameter_scale import coordinates

    folder = cache_folder() if cache is None else Path(cache)
    machines, among = machines or default_machines(), tuple(among) or default_among()
    own = key(machines, seed, among)
    target = folder / f"learnt-{own}.gz"
    if _whole(target):
        return target
    try_folder(folder)
    chunks = [range(start, min(start + CHUNK, machines)) for start in range(0, machines, CHUNK)]
    # A chunk is the same whatever the number of machines, but for the last one of an odd number.
    kept = folder / f"examples-{examples_key(seed, among)}"
    paths = [kept / f"{chunk.start:05d}-{len(chunk)}.npz" for chunk in chunks]
    waiting = [(chunk, path) for chunk, path in zip(chunks, paths, strict=True) if not path.exists()]
    report("simulated gaps", (len(paths) - len(waiting)) / len(paths))
    effects = handed_effects()
    tasks = (joblib.delayed(with_effects)(effects, _chunk, seed, chunk, path, tuple(among)) for chunk, path in waiting)
    parallel = joblib.Parallel(n_jobs=jobs or os.cpu_count(), return_as="generator_unordered")
    for done, _ in enumerate(parallel(tasks), start=len(paths) - len(waiting) + 1):
        report("simulated gaps", 0.7 * done / len(paths))
    examples = stacked([_read(path) for path in paths])
    with joblib.parallel_config(max_nbytes=None):  # see `_judged`
        learnt = learn(
            examples, tuple(catalogue()), coordinates(), feature_names(),
            lambda what, part: report(what, 0.7 + 0.15 * part),
        )  # fmt: skip
    count = machines // PER_SEARCH
    learnt.judgement = _judged(
        learnt,
        folder / f"searches-{own}",
        seed,
        count,
        among,
        jobs,
        lambda part: report("searches", 0.85 + 0.15 * part),
    )
    learnt.sight = None  # searches alone ask it, and to read its forests takes longer than to read all the rest
    learnt.about.update(machines=machines, seed=seed, key=own, examples=len(examples))
    # Trees are thousands of small arrays, over which joblib takes four times as long to read as pickle does.
    with replacing(target) as temporary, gzip.open(temporary, "wb", compresslevel=3) as file:
        pickle.dump(learnt, file, protocol=5)
    with replacing(target.with_suffix(".sha256")) as temporary:
        temporary.write_text(f"{sha256(target)}  {target.name}\n", encoding="utf-8")
    load.cache_clear()
    return target


def _judged(
    learnt: Learnt,
    folder: Path,
    seed: int,
    count: int,
    among: tuple[str, ...],
    jobs: int,
    report: Callable[[float], None],
) -> Judgement | None:
    """What ends of searches are worth, from so many of them."""
    import joblib

    from twingap.effects.handover import handed_effects, with_effects
    from twingap.gap.knowledge.score_calibration import Outcome, learn_judgement

    starts = range(0, count, SEARCH_CHUNK)
    chunks = [range(SEARCHED_FROM + s, SEARCHED_FROM + min(s + SEARCH_CHUNK, count)) for s in starts]
    paths = [folder / f"{chunk.start:07d}-{len(chunk)}.npz" for chunk in chunks]
    waiting = [(chunk, path) for chunk, path in zip(chunks, paths, strict=True) if not path.exists()]
    effects = handed_effects()
    tasks = (
        joblib.delayed(with_effects)(effects, _search_chunk, learnt, seed, chunk, path, among)
        for chunk, path in waiting
    )
    # Sent along, not mapped: joblib forgets such maps before its tracker does, which then prints a traceback.
    parallel = joblib.Parallel(n_jobs=jobs or os.cpu_count(), return_as="generator_unordered", max_nbytes=None)
    for done, _ in enumerate(parallel(tasks), start=len(paths) - len(waiting) + 1):
        report(done / len(paths))
    outcomes: list[Outcome] = []
    missing: list[bool] = []
    chunk: list[int] = []
    for number, path in enumerate(paths):
        with np.load(path) as stored:
            outcomes += [Outcome(*row) for row in stored["outcomes"].tolist()]
            missing += stored["missing"].tolist()
            chunk += [number] * len(stored["missing"])
    return learn_judgement(outcomes, missing, chunk)


def _search_chunk(learnt: Learnt, seed: int, machines: range, path: Path, among: tuple[str, ...]) -> None:
    from threadpoolctl import threadpool_limits

    from twingap.gap.knowledge.score_calibration import Outcome
    from twingap.gap.knowledge.searches import searches

    with threadpool_limits(1):
        made = searches(learnt, seed, machines, MOST_RECORDS, among)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, temporary.open("wb") as file:
        outcomes = np.array([outcome for outcome, _ in made], float).reshape(-1, len(Outcome._fields))
        np.savez(file, outcomes=outcomes, missing=np.array([missing for _, missing in made], bool))


@lru_cache(maxsize=2)
def load(path: Path) -> Learnt:
    """What was learnt, checked against its checksum.

    Raises
    ------
    TwingapError
        When the file is not what training wrote.
    """
    if not _whole(path):
        raise TwingapError("is missing or altered", where=path, mend="run `twingap train`")
    with gzip.open(path, "rb") as file:
        found: Learnt = pickle.load(file)
    return found


def _whole(path: Path) -> bool:
    """Whether the file is there and is the one that its checksum names."""
    check = path.with_suffix(".sha256")
    return path.exists() and check.exists() and check.read_text(encoding="utf-8").split()[:1] == [sha256(path)]


def _chunk(seed: int, machines: range, path: Path, among: tuple[str, ...]) -> None:
    from threadpoolctl import threadpool_limits

    from twingap.gap.knowledge.examples import examples

    with threadpool_limits(1):
        made = examples(seed, machines, MOST_RECORDS, among)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **vars(made))


def _read(path: Path) -> Any:
    from twingap.gap.knowledge.learn import Examples

    with np.load(path) as stored:
        return Examples(**{name: stored[name] for name in stored.files})


def worlds(
    n: int, rng: np.random.Generator, most_records: int = MOST_RECORDS
) -> Iterator[tuple[RecordSet, RecordSet, frozenset[str]]]:
    """Simulated gaps for whoever wants to learn in another way: (measured, simulated by the calibrated twin, missing).

    Machines with something outside the catalogue are left out.
    """
    from twingap.gap.knowledge.simulated_gaps import draw_gap
    from twingap.gap.search.evidence import simulator_of
    from twingap.identify.calibrate import calibrate
    from twingap.records import RecordSet

    made = 0
    while made < n:
        gap = draw_gap(rng, most_records=most_records)
        if gap.strange:
            continue
        try:
            calibrated = calibrate(gap.records, gap.spec, rng, sim=gap.sim)
            part = calibrated.held_out
            simulated = simulator_of(calibrated, gap.sim).simulate((), part.conditions, int(rng.integers(2**62)), 1)
        except TwingapError:
            continue
        made += 1
        yield (
            part,
            RecordSet.from_records("simulated", part.unit, part.bearing, simulated),
            frozenset(effect.name for effect in gap.missing),
        )
