"""Runtime of the slowest diagnoses of a study, each repeated with the machine to itself.

study.json --slowest worlds--> diagnosed one after the other --> seconds next to those of the study

A study diagnoses as many worlds in parallel as there are cores, so its runtimes include contention. Run as
``python -m twingap.study.alone DIR``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from twingap.errors import TwingapError
from twingap.study import worker
from twingap.study.blind import blinded
from twingap.study.pooled import read_studies
from twingap.study.runner import diagnosis, digest_of, digest_of_worlds, learnt_digest
from twingap.study.tables import grid
from twingap.study.verdicts import RICH, found_in

if TYPE_CHECKING:
    from twingap.rigs.worlds import Case


class Timed(NamedTuple):
    """Wall time of one world's diagnosis in the study, in parallel with others, and alone; and whether the repetition
    named the same effects."""

    case: str
    in_study_s: float
    alone_s: float
    same: bool


def slowest_again(
    study: Mapping[str, Any], count: int, planned: Sequence[Case] | None = None, diagnose: worker.Diagnose | None = None
) -> list[Timed]:
    """Diagnose the slowest worlds of a finished study again, one after the other.

    Parameters
    ----------
    study : Mapping
        Content of study.json.
    count : int
        Number of worlds, in descending order of runtime in the study.
    planned : sequence of Case, optional
        Cases of the study; None = those of `twingap study blind`.
    diagnose : callable, optional
        See `worker.Diagnose`; None = `twingap.gap.diagnose`.

    Raises
    ------
    TwingapError
        When the study used other code or another trained model: runtimes are then not comparable.
    """
    from twingap.rigs.worlds import cases, make_world

    about, diagnose = study["provenance"], diagnose or diagnosis()
    code = {"diagnosis": digest_of(diagnose), "worlds": digest_of_worlds()}
    # A missing trained model is made here, so that its training does not count as runtime of the first world.
    if code != about["code_sha256"] or learnt_digest(diagnose) != about["learnt_sha256"]:
        raise TwingapError("the study is of another diagnosis", mend="use the code and the trained model of the study")
    rich = sum(world["was"]["kind"] in RICH for world in study["worlds"])
    by_name = {case.name: case for case in planned or cases(about["cases"] - rich, about["seed"], rich)}
    worlds = sorted(study["worlds"], key=lambda world: -world["found"]["runtime_s"])
    out = []
    for world in worlds[:count]:
        case, before = by_name[world["was"]["case"]], world["found"]
        blind = blinded(make_world(case, about["seed"]))
        again = worker.timed_diagnosis(blind, worker.root_of(case, about["seed"]), diagnose, bool(about.get("closest")))
        effects = () if again["report"] is None else found_in(again["report"]).effects
        out.append(Timed(case.name, before["runtime_s"], again["seconds"], list(effects) == list(before["effects"])))
    return out


def main() -> int:
    """Print the runtimes of the slowest diagnoses of a study, each alone."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", type=Path, metavar="DIR", help="filled by `twingap study blind --out DIR`")
    parser.add_argument("--slowest", type=int, default=6, metavar="N", help="number of worlds (6)")
    given = parser.parse_args()
    if given.slowest < 1:
        parser.error(f"argument --slowest: {given.slowest}, at least 1 expected")
    try:
        timed = slowest_again(read_studies([given.folder])[0], given.slowest)
    except TwingapError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    rows = [
        {"world": t.case, "in the study, s": f"{t.in_study_s:.1f}", "alone, s": f"{t.alone_s:.1f}",
         "same effects": "yes" if t.same else "no"}
        for t in timed
    ]  # fmt: skip
    print(grid(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
