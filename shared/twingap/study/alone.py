"""The slowest diagnoses of a study once more, one at a time: what each takes where it has the machine to itself.

study.json --slowest worlds, made again--> diagnosed alone --> seconds beside those of the study

A study diagnoses as many worlds at once as there are cores, and two threads of one core take each other's time. Run as
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
from twingap.study.verdicts import found_in

if TYPE_CHECKING:
    from twingap.rigs.worlds import Case


class Timed(NamedTuple):
    """One world's diagnosis.

    Parameters
    ----------
    case : str
    in_study_s, alone_s : float
        Wall time beside others, and alone.
    same : bool
        Whether it was named the same effects again.
    """

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
    planned : sequence of Case, optional
        What the study was made of; as `twingap study blind` plans it when None.
    diagnose : callable, optional
        See `worker.Diagnose`; `twingap.gap.diagnose` when None.

    Returns
    -------
    list of Timed
        Slowest of the study first.

    Raises
    ------
    TwingapError
        When the study was of other code, or of another training: other answers take other times.
    """
    from twingap.rigs.worlds import cases, make_world

    about, diagnose = study["provenance"], diagnose or diagnosis()
    code = {"diagnosis": digest_of(diagnose), "worlds": digest_of_worlds()}
    # What is learnt is made here where it is not at hand, which takes its time: neither for other code, nor within the
    # first world's time.
    if code != about["code_sha256"] or learnt_digest(diagnose) != about["learnt_sha256"]:
        raise TwingapError("the study is of another diagnosis", mend="take the code and the training that it ran on")
    by_name = {case.name: case for case in planned or cases(about["cases"], about["seed"])}
    worlds = sorted(study["worlds"], key=lambda world: -world["found"]["runtime_s"])
    out = []
    for world in worlds[:count]:
        case, before = by_name[world["was"]["case"]], world["found"]
        blind = blinded(make_world(case, about["seed"]))
        told = worker.asked(blind, worker.root_of(case, about["seed"]), diagnose)
        found = () if told["report"] is None else found_in(told["report"], told["seconds"], told["peak_mb"]).effects
        out.append(Timed(case.name, before["runtime_s"], told["seconds"], list(found) == list(before["effects"])))
    return out


def main() -> int:
    """Print what the slowest diagnoses of a study take alone."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", type=Path, metavar="DIR", help="filled by `twingap study blind --out DIR`")
    parser.add_argument("--slowest", type=int, default=6, metavar="N", help="so many (6)")
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
