"""What studies have in common: a profile, progress, tables and figures written and logged, a command line.

configuration --profile_of--> sizes --> sweep(on_result=Count) --> keep_tables, keep_figures --> folder, tracker
arguments --command--> run(profile, out=...) --> tables on the screen

Jobs, what they are compared with, tables and figures are a study's own. Nothing here has a part in a result, so no
store's keys depend on it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from twingap import files
from twingap.errors import TwingapError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from twingap.track import Run

P = TypeVar("P")
S = TypeVar("S")
Progress = Callable[[str, int, int], None]
"""Called with what is going on, how much of it is done, and how much there is."""
SIZES: Final[Any] = {"font.size": 13, "axes.titlesize": 13, "axes.labelsize": 13, "legend.fontsize": 12}
"""Of letters in figures."""


def profile_of(profiles: Mapping[str, P], name: str, config: Path) -> P:
    """The sizes of a profile.

    Raises
    ------
    TwingapError
        For a name that the configuration does not have.
    """
    if name not in profiles:
        raise TwingapError(f"unknown profile {name!r}", where=config, mend=f"use one of {', '.join(profiles)}")
    return profiles[name]


@dataclass
class Count:
    """Counts results as they become known, and says so; what `twingap.sweep` calls.

    Parameters
    ----------
    what : str
    total : int
        May be set later, when it is known: until then, all that is done counts as all that there is.
    progress : Progress
    """

    what: str
    total: int
    progress: Progress
    done: int = 0

    def __call__(self, _: object) -> None:
        self.done += 1
        self.progress(self.what, self.done, max(self.total, self.done))


def write_table(table: pd.DataFrame, base: Path, data: str = "") -> None:
    """Write ``base.csv``, six digits, and ``base.md``, four, whole or not at all.

    Parameters
    ----------
    table : DataFrame
    base : Path
        Without an ending.
    data : str
        Where the numbers come from, said beside the name.
    """
    with files.replacing(base.with_name(base.name + ".csv")) as path:
        table.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")
    shown = table.map(lambda v: "" if v is None or v != v else f"{v:.4g}" if isinstance(v, float) else str(v))
    lines = ["| " + " | ".join(map(str, shown.columns)) + " |", "|" + "---|" * len(shown.columns)]
    lines += ["| " + " | ".join(row) + " |" for row in shown.itertuples(index=False)]
    title = f"{base.name} ({data})" if data else base.name
    with files.replacing(base.with_name(base.name + ".md")) as path:
        path.write_text(f"{title}\n\n" + "\n".join(lines) + "\n", encoding="utf-8")


def write_figure(figure: Figure, path: Path, sizes: Any = SIZES) -> None:
    """Write a PNG, whole or not at all; `sizes` as when it was drawn, since some letters are set only now."""
    import matplotlib as mpl

    with mpl.rc_context(sizes), files.replacing(path) as temporary:
        figure.savefig(temporary, dpi=100, metadata={"Software": "twingap"})


def keep_tables(
    tables: Mapping[str, pd.DataFrame],
    out: Path,
    log: Run | None,
    data: str = "",
    write: Callable[[pd.DataFrame, Path, str], None] = write_table,
) -> None:
    """Write tables into ``out/tables`` and log them.

    Parameters
    ----------
    tables : mapping
        By name.
    out : Path
    log : Run or None
        Of a tracker.
    data : str
        Where the numbers come from.
    write : callable
    """
    for name, frame in tables.items():
        write(frame, out / "tables" / name, data)
        if log is not None:
            log.table(name, frame)


def keep_figures(figures: Iterable[tuple[str, Figure]], out: Path, log: Run | None, sizes: Any = SIZES) -> None:
    """Write figures into ``out/figures`` and log them, each as soon as it is drawn."""
    for name, figure in figures:
        write_figure(figure, out / "figures" / f"{name}.png", sizes)
        if log is not None:
            log.figure(name, figure)


def command(
    run: Callable[..., S],
    description: str,
    shown: Callable[[S], Mapping[str, pd.DataFrame]],
    arguments: Sequence[str] | None = None,
    *,
    takes: Collection[str] = (),
    told: Callable[[S], Iterable[str]] = lambda study: (),
) -> None:
    """Run a study as its command line says, tracked; a mistake of the user's is one line, an interruption another.

    Parameters
    ----------
    run : callable
        ``run(profile, out=, backend=, log=, progress=, ...)``.
    description : str
    shown : callable
        Title -> table, of what `run` returned: printed at the end.
    arguments : sequence of str, optional
        The process's own when absent.
    takes : collection of {"root", "seed", "device"}
        What else `run` takes.
    told : callable
        Lines to print below the tables.

    Raises
    ------
    SystemExit
        With status 2 after a mistake, 130 when interrupted.
    """
    import argparse

    from twingap.effects import load_effects
    from twingap.track import MlflowTracker, NullTracker

    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--profile", default="smoke")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--backend", default="loky")
    if "root" in takes:
        parser.add_argument("--root", type=Path, help="data root; TWINGAP_DATA when absent")
    if "seed" in takes:
        parser.add_argument("--seed", type=int, default=0)
    if "device" in takes:
        parser.add_argument("--device", default="auto", choices=("auto", "cpu", "cuda"))
    parser.add_argument(
        "--effects", type=Path, action="append", default=[], metavar="FILE.py",
        help="effects of your own: a Python file that registers them; may be given several times",
    )  # fmt: skip
    parser.add_argument("--tracking-uri", help="of MLflow's store; MLFLOW_TRACKING_URI, or a file in .twingap")
    parser.add_argument("--no-track", action="store_true", help="keep no run for `twingap ui`")
    given = vars(parser.parse_args(arguments))
    profile, effects, uri, untracked = (given.pop(name) for name in ("profile", "effects", "tracking_uri", "no_track"))

    def say(what: str, done: int, total: int) -> None:
        print(f"\r{what}: {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

    name = run.__module__.rpartition(".")[2]
    try:
        for path in effects:
            load_effects(path)
        tags = _tags(run, profile)
        tracker = NullTracker() if untracked else MlflowTracker(uri, " ".join(filter(None, (tags["paper"], name))))
        with tracker.run(f"{name} · {profile} · seed {given.get('seed', 0)}", tags) as log:
            log.parameters({"profile": profile} | {key: given[key] for key in ("seed", "device") if key in given})
            study = run(profile, **given, log=log, progress=say)
    except KeyboardInterrupt:
        print("\ntwingap: interrupted; what was finished is kept, run the same command to go on", file=sys.stderr)
        raise SystemExit(130) from None
    except TwingapError as error:
        print(f"twingap: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    for title, frame in shown(study).items():
        print(f"\n{title}\n{frame.to_string(index=False, float_format=lambda v: f'{v:.4g}')}")
    print(*told(study), given["out"] / "tables", given["out"] / "figures", sep="\n")


def _tags(run: Callable[..., Any], profile: str) -> dict[str, str]:
    """What a run is found by: the paper and the study that its function is of."""
    *folders, study = run.__module__.split(".")
    paper = folders[-1].partition("_")[0] if folders else ""
    return {"paper": paper, "study": study, "profile": profile}
