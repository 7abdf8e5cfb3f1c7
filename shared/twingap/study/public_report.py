"""Output of the study on public records: public.json and public.md.

table of `run_public` --json--> public.json;  --tables, `closest_section`--> public.md
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twingap.study.public_closest_report import closest_section
from twingap.study.public_filter import filter_section
from twingap.study.public_jobs import TWINS
from twingap.study.tables import grid, write_tables


def write_public(table: Mapping[str, Any], out: str | os.PathLike[str]) -> list[Path]:
    """Write public.json and public.md; returns their paths."""
    return write_tables(table, markdown(table), Path(out), "public")


def markdown(table: Mapping[str, Any]) -> str:
    """The study on public records as Markdown tables."""
    about, titles = table["provenance"], {s["name"]: s["title"] for s in table["sets"]}
    plan, used = about["plan"], about["versions"]
    parts = [
        "# The gap diagnosis on public records",
        f"Command: `{about['command']}`, seed {plan['seed']}, twingap {used['twingap']}, code "
        f"{about['code_sha256'][:12]}, learnt {about['data']['learnt'][:12]}; {about['diagnoses']} results, "
        f"{about['computed_s']:.0f} s of computing. Records of 1 s, {plan['pieces']} of each recording; recordings are "
        "never on both sides unless a table says so.",
        *(
            f"**{s['title']}**: a surrogate for {s['name'].upper()}, whose records were not available; nothing "
            "below is of that set."
            for s in table["sets"] if not s["real"]
        ),
        *(f"Left out: {name} ({why})." for name, why in table["skipped"].items()),
        grid([
            {"set": s["title"], "recordings": len(s["recordings"]), "records": s["records"]} for s in table["sets"]
        ]),
        *(_verdicts(table, titles) if table["twins"] else ()),
        *(closest_section(table["closest"]) if table["closest"] else ()),
        *(filter_section(table["filtered"]) if table["filtered"] else ()),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _verdicts(table: Mapping[str, Any], titles: Mapping[str, str]) -> list[str]:
    """Sections on verdicts: papers' twins, effects withheld and added, nothing added, single recordings."""
    injected = [r for r in table["injected"] if not r["refused"]]
    return [
        "## What each paper's twin lacks",
        "Accuracy: of a classifier that learns from the twin's records alone, on held-out real records, before and "
        "after the verdict's effects are added; in brackets, learning from other real records. Closest adds: "
        "effects of the closest twin that are not named. The closure then includes the verdict's "
        "effects and is measured on held-out records, with fewer simulations.",
        grid(twin_rows(table)),
        *(part for row in table["twins"] for part in _details(row, titles)),
        "## An effect withheld",
        "From the twin with the smallest gap after its verdict's effects are added, one effect is left out, unknown to "
        "the diagnosis. These effects are those of a verdict or of paper 1; the truth is unknown. The table therefore "
        "shows whether verdicts are consistent, not whether they are true. Covers: the confidence set contains the "
        "effect together with the effects missing from the full twin.",
        grid([{"set": titles[r["set"]], "twin": r["twin"], "left out": r["effect"],
                "comes from": "verdict" if r["from_verdict"] else "the paper", **_naming(r)}
               for r in table["withheld"]]),
        _tally(table["withheld"]),
        "## Real records with an effect added",
        "One half of the real recordings is used as the simulator, the other half, with the effect added, as the "
        "machine. Changed: RMS of the change over that of a record, median. An effect that hardly changes the records "
        "(speed_gain where speeds are nearly equal) cannot be detected.",
        grid([{"effect": r["effect"], "parameters": _values(r["parameters"]), "halved by": r["split_by"],
               "acts on": _percent(r["acts_on"]), "changed": _percent(r["changed"]), **_naming(r)}
              for r in injected]),
        _tally(injected),
        *(f"Not added: {r['effect']} ({r['refused']})." for r in table["injected"] if r["refused"]),
        "## Nothing added",
        "Halves of the same records against each other; a gap is a false alarm unless recordings of the same bearing "
        "differ by themselves, which they do to some degree. Halvings share recordings, but the interval "
        "(95 %, Clopper-Pearson) assumes that they are independent, so it is too narrow.",
        grid([_nothing(r) for r in table["nothing"]]),
        "## Single recordings and findings of the literature",
        grid([{"finding": d["finding"], "recordings": ", ".join(d["recordings"]) or "not known", "source": d["source"]}
              for d in table["documented"]]),
        _agreement(table["single"]),
        "Plain indicators and the verdict of each recording. Comb: height of the fault's own comb in the envelope, "
        "significant from 6. At extremes: samples at one extreme value, clipped from 4. Bursts: level of the loudest "
        "twentieth over the median, top quarter of the band. The verdict is of a diagnosis against the other "
        "recordings of the same bearing, used as the simulator: what all recordings of a bearing share is no gap "
        "there, and what the load changes is one.",
        grid([_single(row) for row in table["single"]]),
    ]  # fmt: skip


def twin_rows(table: Mapping[str, Any]) -> list[dict[str, str]]:
    """One row of text per set and twin: verdict, missing effects, gap and accuracy before and after."""
    titles = {s["name"]: s["title"] for s in table["sets"]}
    return [_twin(row, titles) for row in table["twins"]]


def _twin(row: Mapping[str, Any], titles: Mapping[str, str]) -> dict[str, str]:
    first = {"set": titles[row["set"]], "twin": f"{row['twin']} ({TWINS[row['twin']]})"}
    if row["refused"]:
        columns = ("lacks", "closes", "gap", "accuracy", "closest adds", "closes then", "accuracy then")
        return {**first, "verdict": f"refused: {row['refused']}", **dict.fromkeys(columns, "")}
    gap, closest = row["gap"], row.get("closest")
    return {
        **first,
        "verdict": f"{row['status']} (p {row['p_value']:.2g})",
        "lacks": ", ".join(row["effects"]) or "nothing named",
        "closes": _closure(row),
        "gap": f"{gap['before']:.2f} to {gap['after']:.2f} (floor {gap['floor']:.2f})",
        "accuracy": _accuracy(row["accuracy"]),
        "closest adds": ", ".join(closest["effects"]) if closest else "none",
        "closes then": _closure(closest) if closest else "",
        "accuracy then": _accuracy(closest["accuracy"]) if closest else "",
    }


def _details(row: Mapping[str, Any], titles: Mapping[str, str]) -> list[str]:
    if row["refused"]:
        return []
    named = [
        {"effect": c["effect"], "probability": f"{c['probability']:.2f}",
         "closes": "" if c["cannot"] else _part(c["closure"]),
         "90 % interval": "" if c["cannot"] else f"{_part(c['ci'][0])} to {_part(c['ci'][1])}",
         "values": _values(c["parameters"]), "cannot be added": c["cannot"] or ""}
        for c in row["which"]
    ]  # fmt: skip
    closest = [
        {"closest twin": effect, "values, fitted together": _values(values)}
        for effect, values in (row.get("closest") or {"parameters": {}})["parameters"].items()
    ]
    places = [
        {"where": w["place"], "share": f"{w['share']:.0%}", "p": f"{w['p_value']:.2g}"} for w in row["where"]
    ]  # fmt: skip
    notes = [*row["left_out"], *row["notes"]]
    return [
        f"### {titles[row['set']]}, {row['twin']}",
        row["sentence"],
        grid(named) if named else "",
        grid(closest) if closest else "",
        grid(places) if places else "",
        "\n".join(f"- {note}" for note in notes),
    ]


def _naming(row: Mapping[str, Any]) -> dict[str, str]:
    return {
        "verdict": row.get("status") or f"refused: {row.get('refused', '')}",
        "named": ", ".join(row.get("effects") or ()),
        "first": _yes(row["first"]), "at all": _yes(row["named"]), "covers": _yes(row["covers"]),
        "in a set": _yes(row["in_a_set"]), "also expected": ", ".join(row["rest"]),
    }  # fmt: skip


def _tally(rows: Sequence[Mapping[str, Any]]) -> str:
    diagnosed = [r for r in rows if r["first"] is not None]
    if not diagnosed:
        return "No row." if not rows else "All were refused."
    counts = {k: sum(bool(r[k]) for r in diagnosed) for k in ("first", "named", "covers", "in_a_set")}
    return "Of {}: first {first}, at all {named}, covered {covers}, in one of the sets {in_a_set}.".format(
        len(diagnosed), **counts
    )


def _nothing(row: Mapping[str, Any]) -> dict[str, str]:
    rate = "-" if row["rate"] is None else f"{row['rate']:.2f} ({row['interval'][0]:.2f} to {row['interval'][1]:.2f})"
    return {
        "set": row["title"], "halved by": row["split_by"] or "", "called a gap": f"{row['alarms']} of {row['splits']}",
        "rate": rate, "named": ", ".join(f"{k} {v}" for k, v in row["named"].items()),
        "p values": ", ".join(f"{p:.2g}" for p in sorted(row["p_values"])),
    }  # fmt: skip


def _agreement(rows: Sequence[Mapping[str, Any]]) -> str:
    comparable = [r for r in rows if r["agrees"] is not None]
    if not comparable:
        return ""
    unclear = [r for r in comparable if r["reported_unclear"]]
    clear = [r for r in comparable if not r["reported_unclear"]]
    dim = sum(not r["shows_fault"] for r in unclear)
    seen = sum(bool(r["shows_fault"]) for r in clear)
    clipped = [r["recording"] for r in rows if r["clipped"]]
    bursts = [r["recording"] for r in rows if r["bursts"]]
    loose = [r["recording"] for r in rows if "looseness" in (r.get("effects") or ())]
    return (
        f"Of {len(unclear)} recordings reported as unclear, {dim} do not show their fault's comb as the highest and "
        f"significant; of {len(clear)} other faulty ones, {seen} do. Clipped records: {', '.join(clipped) or 'none'}. "
        f"Bursts: {', '.join(bursts) or 'none'}. Looseness named: {', '.join(loose) or 'none'}."
    )


def _single(row: Mapping[str, Any]) -> dict[str, str]:
    comb = row["comb"].get(row["fault"])
    return {
        "recording": row["recording"], "fault": row["fault"],
        "size, in": "" if not row["size_inch"] else f"{row['size_inch']:g}",
        "comb": "" if comb is None else f"{comb:.1f}", "shows it": _yes(row["shows_fault"]),
        "reported unclear": "yes" if row["reported_unclear"] else "",
        "at extremes": f"{row['at_extremes']}", "burst, dB": f"{row['burst_db']:.1f}",
        "kurtosis": f"{row['kurtosis']:.1f}",
        "outlying": ", ".join(f"{k} {v:+.0f}" for k, v in row["outlying"].items()),
        "verdict": row.get("status") or row.get("refused") or "not diagnosed",
        "named": ", ".join(row.get("effects") or ()),
    }  # fmt: skip


def _closure(row: Mapping[str, Any]) -> str:
    if row["closure"] is None:
        return ""
    ci = row["closure_ci"]
    return _part(row["closure"]) + (f" ({_part(ci[0])} to {_part(ci[1])})" if ci else "")


def _part(value: float) -> str:
    """A closure in per cent, without a sign where it rounds to zero."""
    return f"{round(100 * value) + 0:d}%"


def _accuracy(metric: Mapping[str, float] | None) -> str:
    if metric is None:
        return ""
    return f"{metric['before']:.2f} to {metric['after']:.2f} ({metric['floor']:.2f})"


def _values(parameters: Mapping[str, Any] | None) -> str:
    return ", ".join(
        f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in (parameters or {}).items()
    )  # fmt: skip


def _percent(value: float | None) -> str:
    return "" if value is None else f"{value:.0%}"


def _yes(value: bool | None) -> str:
    return {None: "", True: "yes", False: "no"}[value]
