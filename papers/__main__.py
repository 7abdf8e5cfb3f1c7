"""Command line of the studies: ``python -m papers paper2.dynamics --profile full --out DIR``.

A study is named by paper and folder, or by the dotted name of its package where it lies elsewhere.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from papers.framework import load_study
from papers.reproduce import check_configurations, package_of, paper_of, short_names
from twingap import TwingapError
from twingap.effects import load_effects
from twingap.track import MlflowTracker, NullTracker


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a study, tracked; a mistake of the user's is one line, an interruption another."""
    parser = argparse.ArgumentParser(
        prog="python -m papers", description=__doc__, epilog=f"Studies: {', '.join(short_names())}"
    )
    parser.add_argument("study", nargs="?", help="e.g. paper2.dynamics")
    parser.add_argument(
        "--check-configs", action="store_true", help="read the study's configuration, or all, and run nothing"
    )
    parser.add_argument("--profile", default="smoke")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--config", type=Path, help="in place of the study's own")
    parser.add_argument("--root", type=Path, help="data root; TWINGAP_DATA when absent")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--backend", default="loky")
    parser.add_argument("--address", help="of a running dask cluster")
    parser.add_argument("--device", default="auto", choices=("auto", "cpu", "cuda"))
    parser.add_argument(
        "--effects", type=Path, action="append", default=[], metavar="FILE.py",
        help="effects of your own: a Python file that registers them; may be given several times",
    )  # fmt: skip
    parser.add_argument("--tracking-uri", help="of MLflow's store; MLFLOW_TRACKING_URI, or a file in .twingap")
    parser.add_argument("--no-track", action="store_true", help="keep no run for `twingap ui`")
    given = vars(parser.parse_args(arguments))
    name, effects, uri, untracked = (given.pop(key) for key in ("study", "effects", "tracking_uri", "no_track"))
    try:
        for path in effects:
            load_effects(path)
        if given.pop("check_configs"):
            print(*check_configurations(name), sep="\n")
            return
        if name is None or given["out"] is None:
            parser.error("a study and --out are needed")
        _run(name, None if untracked else uri or "", given)
    except KeyboardInterrupt:
        print("\ntwingap: interrupted; what was finished is kept, run the same command to go on", file=sys.stderr)
        raise SystemExit(130) from None
    except TwingapError as error:
        print(f"twingap: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _run(name: str, uri: str | None, given: dict[str, object]) -> None:
    def say(what: str, done: int, total: int) -> None:
        print(f"\r{what}: {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)

    package = package_of(name)
    study, paper = load_study(package), paper_of(package)
    tags = {"paper": paper, "study": study.name, "profile": given["profile"]}
    tracker = NullTracker() if uri is None else MlflowTracker(uri or None, f"{paper} {study.name}".strip())
    with tracker.run(f"{study.name} · {given['profile']} · seed {given['seed']}", tags) as log:
        work = study.run(**given, log=log, progress=say)  # type: ignore[arg-type]
    for title, frame in work.shown():
        print(f"\n{title}\n{frame.to_string(index=False, float_format=lambda v: f'{v:.4g}')}")
    drawn = [work.out / "figures"] if study.figures else []
    print(*work.notes(), work.out / "tables", *drawn, sep="\n")


if __name__ == "__main__":
    main()
