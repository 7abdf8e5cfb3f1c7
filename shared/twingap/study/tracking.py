"""Studies of the diagnosis as tracked runs, so that versions and methods compare.

study.json  --track_blind---> Run: scores of the diagnosis; a Run inside for each rival method
public.json --track_public--> Run: rates; a Run inside for each set and twin
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from twingap.track import Run, Tracker

Files = Iterable[str | os.PathLike[str]]


def track_blind(tracker: Tracker, table: Mapping[str, Any], files: Files = ()) -> None:
    """Log a blind study, the content of its study.json, and keep files with the run.

    Raises
    ------
    TwingapError
        When the tracker's store cannot be written.
    """
    about = table["provenance"]
    stated = {name: about[name] for name in ("cases", "seed", "training_worlds_of_rivals", "frozen", "learnt_sha256")}
    name = f"blind · {about['cases']} worlds · seed {about['seed']}"
    with tracker.run(name, {"kind": "blind study", "command": about["command"]}) as run:
        run.parameters({"method": "diagnosis", **stated})
        run.metrics(_scores(table["scores"]) | {"runtime_s": about["runtime_s"]})
        run.table("scores", pd.DataFrame(table["scores"]))
        run.table("by_effect", pd.DataFrame(table["by_effect"]).map(_cell))
        _keep(run, files)
        for method, scores in table["rivals"].items():
            with run.run(f"{method} · seed {about['seed']}", {"kind": "rival"}) as inner:
                inner.parameters({"method": method, **stated})
                inner.metrics(_scores(scores))


def track_public(tracker: Tracker, table: Mapping[str, Any], files: Files = ()) -> None:
    """Log a study on public records, the content of its public.json; files and errors as `track_blind`."""
    about = table["provenance"]
    names = ", ".join(one["name"] for one in table["sets"])
    with tracker.run(f"public · {names} · seed {about['plan']['seed']}", {"kind": "public study"}) as run:
        run.parameters({**about["plan"], "learnt_sha256": about["data"]["learnt"]})
        run.metrics({f"gap claimed with nothing added/{row['set']}": row["rate"] for row in table["nothing"]})
        for part in ("withheld", "injected"):
            run.metrics({f"{part}/{how}": _part(table[part], how) for how in ("first", "named", "covers")})
        run.metrics({"diagnoses": about["diagnoses"], "runtime_s": about["runtime_s"]})
        for one in table["sets"]:
            run.data(one["name"], one["sha256"])
        _keep(run, files)
        for row in table["twins"]:
            with run.run(f"{row['set']} · {row['twin']}", {"kind": "twin"}) as inner:
                verdict = row["refused"] or row["status"]
                effects = ", ".join(row.get("effects", ()))
                inner.parameters({"set": row["set"], "twin": row["twin"], "status": verdict, "effects": effects})
                inner.metrics({name: row.get(name) for name in ("p_value", "closure", "seconds")})
                for measure in ("gap", "accuracy"):
                    inner.metrics({f"{when}/{measure}": value for when, value in (row.get(measure) or {}).items()})
        for row in table["closest"]:
            with run.run(f"{row['set']} · closest · {row['split_by']}", {"kind": "closest twin"}) as inner:
                inner.parameters({name: row[name] for name in ("set", "split_by", "detectors_alone", "refused")})
                inner.metrics({f"closure/{name}": own[0] for name, own in row.get("closure", {}).items()})
                inner.metrics({f"accuracy/{name}": own for name, own in row.get("accuracy", {}).items()})


def _scores(rows: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """Value and interval of each score, by its name and the worlds that it is of."""
    found: dict[str, float | None] = {}
    for row in rows:
        name = f"{row['score']}/{row['among']}"
        found |= {name: row["value"], f"low/{name}": row["low"], f"high/{name}": row["high"]}
    return found


def _part(rows: Sequence[Mapping[str, Any]], how: str) -> float | None:
    """Part of the diagnosed rows of which `how` is true; None without any."""
    diagnosed = [row for row in rows if row[how] is not None]
    return sum(bool(row[how]) for row in diagnosed) / len(diagnosed) if diagnosed else None


def _cell(value: Any) -> Any:
    """A cell of a CSV file: lists and tables as text."""
    return str(value) if isinstance(value, (dict, list)) else value


def _keep(run: Run, files: Files) -> None:
    for path in files:
        run.file(path)
