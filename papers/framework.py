"""Studies: what one declares (options, steps, tables, figures), and the one runner of all of them.

config.toml --options--> profile --+
                                   +--> Step, Step, ... --> tables, figures, metrics --> folder, tracker, screen
data root, seed, backend ----------+      (jobs: sweep, keys by `imports`)

A study is a folder with ``config.toml``, ``jobs.py``, ``tables.py``, ``figures.py``, and ``study.py``, which holds its
`Study` under the name ``STUDY``. The functions that workers run are in ``jobs.py``, which imports neither tables nor
figures: the keys of stored results change with the code that makes results, and with nothing else. This module makes
none.
"""

from __future__ import annotations

import functools
import importlib
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec

from papers.figures import style
from papers.imports import digest_of_imports
from papers.options import read
from twingap import TwingapError, files
from twingap.provenance import digest_of_path, digest_of_value, plain
from twingap.sweep import BACKENDS, sweep
from twingap.sweep import Result as Result
from twingap.track import NullTracker
from twingap.track import Run as Run

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""
P = ParamSpec("P")
Rows = Iterator[dict[str, Any]]  # rows of a table: column -> value
Inputs = Mapping[str, tuple[Any, str | None]]
"""Name of an argument of a step's function -> its value, and its digest; None where results do not depend on it."""


def _nothing(work: Work) -> dict[str, Any]:
    return {}


def _drawn(figures: Mapping[str, Callable[[Work], Figure]], work: Work) -> Iterator[tuple[str, Figure]]:
    yield from ((name, draw(work)) for name, draw in figures.items())


@dataclass(frozen=True)
class Step:
    """A step of a study."""

    name: str  # its outputs are ``work[name]``: results in the order of its jobs, or what the function returned
    # With `jobs`: ``function(job, **inputs)``, at module level in ``jobs.py``, run by workers. Without: called once,
    # with the `Work`; what it yields is kept as a list.
    function: Callable[..., Any]
    jobs: Callable[[Work], Iterable[Any]] | None = None  # frozen dataclasses, or mappings of JSON values
    inputs: Callable[[Work], Inputs] = _nothing  # what the function reads besides its job
    words: Callable[[Any], str] | None = None  # of a job, for progress and errors


@dataclass(frozen=True)
class Study:
    """A study, as it is declared."""

    name: str
    title: str  # stands above the headlines
    # dataclass of the entries of `config`, which are explained there; its field `profiles` has each profile's sizes
    options: type[Any]
    steps: Sequence[Step]
    # name -> what makes the table, in order, so that a later one may read ``work.tables``; or what makes all of them
    tables: Mapping[str, Callable[[Work], pd.DataFrame]] | Callable[[Work], Mapping[str, pd.DataFrame]]
    config: Path = Path("config.toml")  # beside the module of `options`
    figures: Mapping[str, Callable[[Work], Figure]] | Callable[[Work], Iterable[tuple[str, Figure]]] | None = None
    headlines: tuple[str, ...] = ()  # tables that are printed at the end
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # of headlines, where not all are printed
    data: str = ""  # where the numbers come from, unless a step says it
    named: bool = False  # whether that is the last column, ``data``, of tables that have none
    metrics: Callable[[Work], Mapping[str, float | None]] = _nothing  # logged
    at_hand: Callable[[Path | None], bool] = lambda root: True  # in that data root; else a paper leaves the study out
    letters: tuple[int, int] = (13, 12)  # sizes of letters in figures, and of those in legends, points

    def __post_init__(self) -> None:
        object.__setattr__(self, "config", Path(inspect.getfile(self.options)).parent / self.config)

    def read(self, config: Path | None = None) -> Any:
        """The options; errors name file, key, value and what was expected."""
        return read(self.options, config or self.config)

    def run(
        self, profile: str = "smoke", *, out: Path, root: Path | None = None, seed: int = 0, backend: str = "loky",
        address: str | None = None, device: str = "auto", log: Run | None = None,
        progress: Progress = lambda what, done, total: None, config: Path | None = None, draw: bool = True,
    ) -> Work:  # fmt: skip
        """Run a profile of the study; what an interrupted run has finished is taken up again.

        Raises `TwingapError` for a configuration, profile, data root, backend or folder that cannot be used.

        Parameters
        ----------
        out : Path
            Folder for ``tables/``, ``figures/`` and ``results/``, the store of finished jobs. Results computed
            elsewhere can be copied into it: their keys depend on jobs, code and data, not on machine or path.
        root : Path or None
            Data root; TWINGAP_DATA when None.
        seed : int
            First of the profile's seeds.
        backend, address
            Where jobs run; see `twingap.sweep`.
        device : {"auto", "cpu", "cuda"}
            Of the trainings that can use a GPU.
        log : Run or None
            Of a tracker: parameters, metrics, tables and figures go there.
        config : Path or None
            In place of the study's own.
        draw : bool
            Whether figures are made.
        """
        path = config or self.config
        options = self.read(path)
        if profile not in options.profiles:
            known = ", ".join(options.profiles)
            raise TwingapError(f"unknown profile {profile!r}", where=path, mend=f"use one of {known}")
        if backend not in BACKENDS:
            raise TwingapError(f"unknown backend {backend!r}", mend=f"use one of {', '.join(BACKENDS)}")
        files.try_folder(out)
        with NullTracker().run(self.name) as forgetful:
            work = Work(
                self, profile, options, options.profiles[profile], out, root, seed, backend, address, device,
                log or forgetful, progress, self.data, path,
            )  # fmt: skip
        used = {**plain(options), "profiles": {profile: plain(work.size)}}
        work.log.parameters({**used, "profile": profile, "seed": seed})
        work.log.data(path.name, digest_of_path(path), role="configuration")
        for step in self.steps:
            if step.jobs is None:
                made = step.function(work)
                work[step.name] = list(made) if isinstance(made, Iterator) else made
            else:
                work[step.name] = work.sweep(step.function, step.jobs(work), step.inputs(work), step.words, step.name)
        self._publish(work, draw)
        return work

    def _publish(self, work: Work, draw: bool) -> None:
        """Tables, figures and metrics, to the folder and to the tracker, each as soon as it is made."""
        made = self.tables(work) if callable(self.tables) else self.tables
        for name, table in made.items():
            work.tables[name] = table = table(work) if callable(table) else table
            if self.named and "data" not in table:
                table["data"] = work.title
            write_table(table, work.out / "tables" / name, work.title)
            work.log.table(name, table)
        if metrics := self.metrics(work):
            work.log.metrics(metrics)
        if work.missing:
            work.log.parameters({"missing": list(work.missing)})
        if draw and self.figures is not None:
            import matplotlib as mpl

            with mpl.rc_context(style(*self.letters)):
                drawn = self.figures(work) if callable(self.figures) else _drawn(self.figures, work)
                for name, figure in drawn:
                    write_figure(figure, work.out / "figures" / f"{name}.png")
                    work.log.figure(name, figure)


@dataclass
class Work:
    """A study at work: what it was asked for, as in `Study.run`, and what it has made so far."""

    study: Study
    profile: str
    options: Any
    size: Any  # of the profile
    out: Path
    root: Path | None
    seed: int
    backend: str
    address: str | None
    device: str
    log: Run
    progress: Progress
    title: str  # where the numbers come from; set by the step that reads data
    config: Path
    missing: tuple[str, ...] = ()  # what was left out since its data are not at hand; set by that step, too
    computed: int = 0  # jobs that ran now; finished: all jobs
    finished: int = 0
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    _made: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, step: str) -> Any:
        return self._made[step]

    def __setitem__(self, step: str, made: Any) -> None:
        self._made[step] = made

    def keyed(self, step: str, by: str) -> tuple[Any, str]:
        """What a step made as an input of jobs, with the digest of the results of another that it was made from."""
        return self[step], digest_of_value([result.key for result in self[by]])

    def sweep(
        self, function: Callable[..., Any], jobs: Iterable[Any], inputs: Inputs | None = None,
        words: Callable[[Any], str] | None = None, what: str = "jobs", *, data: Mapping[str, str] | None = None,
        backend: str | None = None,
    ) -> list[Result[Any]]:  # fmt: skip
        """Run jobs, reusing finished ones; for steps that run several sets of jobs. See `Step` for the parameters.

        `data` are further digests that results depend on; `backend` takes the place of the run's own.
        """
        given, asked, done = dict(inputs or {}), list(jobs), 0

        def count(result: Result[Any]) -> None:
            nonlocal done
            done += 1
            self.finished += 1
            self.computed += bool(result.why)
            self.progress(f"{self.study.name}, {what}", done, len(asked))

        bound = functools.partial(function, **{name: value for name, (value, _) in given.items()})
        digests = {name: digest for name, (_, digest) in given.items() if digest is not None}
        return sweep(
            bound if given else function, asked, store=self.out / "results", backend=backend or self.backend,
            address=None if backend else self.address, version=digest_of_imports(function.__module__),
            data=digests | dict(data or {}), on_result=count, describe=words,
        )  # fmt: skip

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Rows of the headline tables, each with study and table named."""
        about = {"study": self.study.name}
        return [about | {"table": name} | row for name in self.study.headlines for row in rows_of(self.tables[name])]

    def shown(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Title and headline table, to print one after the other."""
        for name in self.study.headlines:
            title = f"{self.study.title}: {name}" + (f" ({self.title})" if self.title else "")
            yield title, self.tables[name][list(self.study.columns.get(name, self.tables[name].columns))]

    def notes(self) -> Iterator[str]:
        if self.missing:
            yield f"{self.study.name}: no data at hand for {', '.join(self.missing)}, left out"
        if self.finished:
            yield f"{self.study.name}: {self.finished} jobs, {self.computed} of them run now"


def as_input(work: Work) -> Inputs:
    """The configuration as an input of jobs, whose keys then depend on all of it but the profiles."""
    entries = {name: value for name, value in plain(work.options).items() if name != "profiles"}
    return {"options": (work.options, digest_of_value(entries))}


def as_table(rows: Callable[P, Rows]) -> Callable[P, pd.DataFrame]:
    """Make a function that yields the rows of a table one that returns the table."""

    @functools.wraps(rows)
    def table(*given: P.args, **more: P.kwargs) -> pd.DataFrame:
        import pandas as pd

        return pd.DataFrame(list(rows(*given, **more)))

    return table


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def load_study(name: str) -> Study:
    """The study of a folder, by the dotted name of its package."""
    try:
        found = importlib.import_module(f"{name}.study").STUDY
    except ModuleNotFoundError as error:
        if not f"{name}.study".startswith(str(error.name)):
            raise
        raise TwingapError(f"no study {name!r}", mend="see `python -m papers --help` for those there are") from None
    assert isinstance(found, Study)
    return found


def write_table(table: pd.DataFrame, base: Path, data: str = "") -> None:
    """Write ``base.csv``, six digits, and ``base.md``, four; `data` says where numbers come from."""
    with files.replacing(base.with_name(base.name + ".csv")) as path:
        table.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")
    shown = table.map(lambda v: "" if v is None or v != v else f"{v:.4g}" if isinstance(v, float) else str(v))
    lines = ["| " + " | ".join(map(str, shown.columns)) + " |", "|" + "---|" * len(shown.columns)]
    lines += ["| " + " | ".join(row) + " |" for row in shown.itertuples(index=False)]
    title = f"{base.name} ({data})" if data else base.name
    with files.replacing(base.with_name(base.name + ".md")) as path:
        path.write_text(f"{title}\n\n" + "\n".join(lines) + "\n", encoding="utf-8")


def write_figure(figure: Figure, path: Path) -> None:
    with files.replacing(path) as temporary:
        figure.savefig(temporary, dpi=110, bbox_inches="tight", metadata={"Software": "twingap"})
