"""Pooled scores of several seeds of one blind study: more worlds, narrower intervals.

study.json of each seed --worlds, all by the same diagnosis--> rows --scores--> a column per seed, and one of all

Run as ``python -m twingap.study.pooled DIR DIR ...``; it prints the scores against their targets, and the rivals that
ran on every seed.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twingap.errors import TwingapError
from twingap.study import scores
from twingap.study.tables import grid
from twingap.study.verdicts import Found, Row, Was

DIAGNOSIS = "diagnosis"


def read_studies(folders: Sequence[Path]) -> list[Mapping[str, Any]]:
    """Content of study.json of each folder.

    Raises
    ------
    TwingapError
        When a folder holds no finished study, or studies cannot be pooled: a seed occurs twice, or the code or the
        trained model differs.
    """
    studies: list[Mapping[str, Any]] = []
    for folder in folders:
        path = folder / "study.json"
        try:
            table = json.loads(path.read_text(encoding="utf-8"))
            about = table["provenance"]
            key = about["seed"], about["code_sha256"]["diagnosis"], about["learnt_sha256"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise TwingapError(
                "no finished study", where=str(path), mend="name folders that `twingap study blind --out` filled"
            ) from error
        for other, seen in zip(folders, studies, strict=False):
            about = seen["provenance"]
            if key[0] == about["seed"]:
                raise TwingapError(f"seed {key[0]} is in {other} too", where=str(path), mend="count it once")
            if key[1:] != (about["code_sha256"]["diagnosis"], about["learnt_sha256"]):
                raise TwingapError(
                    f"is of another diagnosis than {other}",
                    where=str(path), mend="pool studies of the same code and the same trained model",
                )  # fmt: skip
        studies.append(table)
    return studies


def rows_of(table: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Rows of the diagnosis and of each rival, one per world."""
    out: dict[str, list[Row]] = {DIAGNOSIS: []}
    for world in table["worlds"]:
        was = Was(**_tuples(_present_names(world["was"])))
        out[DIAGNOSIS].append(Row(was, Found(**_tuples(world["found"]))))
        for method, row in world["rivals"].items():
            found = Found(row["status"], tuple(row["effects"]), p_value=row["p_value"])
            out.setdefault(method, []).append(Row(was, found))
    return out


def _present_names(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a truth, with `uncatalogued` under its former name too."""
    return {"uncatalogued" if name == "outsiders" else name: value for name, value in fields.items()}


def _tuples(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Fields with JSON lists converted back to tuples."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}


def markdown(studies: Sequence[Mapping[str, Any]]) -> str:
    """Scores by seed and over all worlds, and a comparison of the methods, as Markdown."""
    each = [rows_of(table) for table in studies]
    seeds = [f"seed {table['provenance']['seed']}" for table in studies]
    own = [{(s.name, s.among): s for s in scores.headline(rows[DIAGNOSIS])} for rows in each]
    pooled = scores.headline([row for rows in each for row in rows[DIAGNOSIS]])
    lines = [
        {
            "score": score.name, "among": score.among,
            **{seed: _words(part.get((score.name, score.among))) for seed, part in zip(seeds, own, strict=True)},
            "all": _words(score), "target": score.target.words if score.target else "",
            "met": {None: "", True: "yes", False: "**no**"}[score.met],
        }
        for score in pooled
    ]  # fmt: skip
    methods = [method for method in each[0] if all(method in rows for rows in each)]
    comparison = []
    for method in methods:
        together = scores.headline([row for rows in each for row in rows[method]])
        chosen = {f"{s.name}: {s.among}": _words(s) for s in together if s.name in scores.COMPARED}
        comparison.append({"method": method, **chosen})
    count = sum(len(rows[DIAGNOSIS]) for rows in each)
    return (
        f"{count} worlds, {', '.join(seeds)}; the same code and the same trained model.\n\n"
        f"## Scores against targets\n\n{grid(lines)}\n\n## Methods on all of these worlds\n\n{grid(comparison)}\n"
    )


def _words(score: scores.Score | None) -> str:
    if score is None or score.row["value"] is None:
        return "-"
    row = score.row
    count = f"{score.k} of {score.n}: " if score.k is not None else ""
    within = "" if row["low"] is None else f" ({row['low']:.3g} to {row['high']:.3g})"
    return f"{count}{row['value']:.3g}{within}"


def main() -> int:
    """Print the pooled scores of several studies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument(
        "folders", nargs="+", type=Path, metavar="DIR", help="filled by `twingap study blind --out DIR`"
    )
    try:
        print(markdown(read_studies(parser.parse_args().folders)))
    except TwingapError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
