"""`twingap data`: list, verify, fetch and export public data sets."""

from __future__ import annotations

import functools
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twingap.cli.options import AnySeed, Effects, Json, Seed, examples, say, say_json, wrote
from twingap.cli.progress import progress, steps
from twingap.errors import TwingapError

if TYPE_CHECKING:
    from twingap.data.manifest import Manifest
    from twingap.data.verify import Verification

app = typer.Typer(help="Public data sets: list, verify, fetch, export.", no_args_is_help=True)

Root = Annotated[
    Path | None, typer.Option("--root", help="Folder of the data sets, one subfolder each; TWINGAP_DATA when absent.")
]
Name = Annotated[str, typer.Argument(help="Name of a data set; see `twingap data list`.", show_default=False)]


@app.command("list", epilog=examples("twingap data list --root DATA", "twingap data list cwru"))
def list_sets(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="One data set, with all that is known about it.")
    ] = None,
    root: Root = None,
    quick: Annotated[bool, typer.Option("--quick", help="Compare sizes only, without checksums.")] = False,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """List the data sets: licence, size, source, files present and verified; with NAME, its whole data card.

    A card states channels, units, rates, recordings, bearing and fault orders, loads, labels, pitfalls, and the
    commands that the set suits.
    """
    from twingap.data import card_of, data_root, manifest_names, manifest_of

    try:
        folder: Path | None = data_root(root)
    except TwingapError:
        if root is not None:
            raise
        folder = None  # the sets can be listed without any data
    all_facts = [manifest_of(each) for each in ((name,) if name is not None else manifest_names())]
    checks = _verify_all(all_facts, folder, quick=quick) if folder is not None else [None] * len(all_facts)
    if as_json:
        say_json([_listing(f, c) for f, c in zip(all_facts, checks, strict=True)])
        return
    say(f"data root: {folder}" if folder else "data root: none set (TWINGAP_DATA or --root)")
    for facts, check in zip(all_facts, checks, strict=True):
        say(f"\n{facts.name}: {facts.title}")
        say(f"  size       {'made on demand' if facts.made_here else _human(facts.size_bytes)}")
        say(f"  licence    {facts.licence}")
        say(f"  from       {facts.url or ('twingap itself' if facts.made_here else facts.how_to_get)}")
        say(f"  here       {_presence(facts, check)}")
        rows = card_of(facts).rows()
        if name is None:
            rows = [(key, text) for key, text in rows if key in ("recordings", "suits")]
        else:
            rows.append(("cite", facts.citation))
        for key, text in rows:
            say(f"  {key:<10} {text}")


@app.command("verify", epilog=examples("twingap data verify", "twingap data verify cwru ims"))
def verify_sets(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME", help="Data sets; all by default.", show_default=False)
    ] = None,
    root: Root = None,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """Verify every present file by its manifest; exit status 2 when one is altered.

    Missing and unexpected files are reported but are no error.
    """
    from twingap.data import data_root, manifest_names, manifest_of

    chosen = [manifest_of(name) for name in dict.fromkeys(names or manifest_names())]
    checks = _verify_all(chosen, data_root(root))
    if as_json:
        say_json([asdict(c) | {"intact": c.intact} for c in checks])
    else:
        for facts, check in zip(chosen, checks, strict=True):
            _print_check(facts, check, in_full=bool(names))
    altered = [finding.path for check in checks for finding in check.findings if finding.status == "altered"]
    if altered:
        shown = ", ".join(altered[:5]) + (f" and {len(altered) - 5} more" if len(altered) > 5 else "")
        raise TwingapError(
            f"{len(altered)} altered file{'s' * (len(altered) > 1)}: {shown}",
            mend="remove them and fetch their data set again",
        )


@app.command("fetch", epilog=examples("twingap data fetch cwru --root DATA"))
def fetch_set(name: Name, root: Root = None, effects: Effects = None, seed: AnySeed = 0, as_json: Json = False) -> None:
    """Download a data set from its owner, verify and unpack it; an interrupted download is resumed."""
    from twingap.data import data_root, manifest_of
    from twingap.data.fetch import fetch

    facts, folder = manifest_of(name), data_root(root, must_exist=False)
    with progress(name) as shown:
        fetched = fetch(facts, folder, progress=shown.count)
    place = folder / facts.name
    if as_json:
        result = {
            "name": name,
            "folder": str(place),
            "downloaded": [str(path) for path in fetched.downloaded],
            "kept": [str(path) for path in fetched.kept],
            "unpacked": fetched.unpacked,
        }
        say_json(result)
    else:
        say(
            f"{name}: {len(fetched.downloaded)} files downloaded and verified, {len(fetched.kept)} already present, "
            f"{fetched.unpacked} unpacked"
        )
    wrote(place, as_json=as_json)


@app.command("export", epilog=examples('twingap data export cwru --out cwru --where "load_hp=2"'))
def export_set(
    name: Name,
    out: Annotated[Path, typer.Option("--out", help="New folder for the record set.", show_default=False)],
    where: Annotated[
        list[str] | None,
        typer.Option(help='Keep records with column=value, such as "load_hp=2"; repeatable.'),
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option(help="Option of the reader as key=value, such as channel=FE or fs_hz=12000.")
    ] = None,
    effects: Effects = None,
    seed: Seed = 0,
    root: Root = None,
    as_json: Json = False,
) -> None:
    """Export a public data set as a record set."""
    from twingap.data import load
    from twingap.data import where as chosen
    from twingap.data.registry import takes
    from twingap.records.folder import write_records

    options = dict(_key_value(text) for text in option or ())
    if takes(name, "seed"):
        options.setdefault("seed", seed)
    records = load(name, root, **options)
    if where:
        records = chosen(records, where)

    rates = [condition.fs_hz for condition in records.conditions]
    rate = max(dict.fromkeys(rates), key=rates.count)
    write_records(
        out, records.name, records.unit, records.bearing, rate, steps(records, f"export {name}", len(records))
    )
    if as_json:
        counts = records.table["fault"].fillna("unknown").value_counts(sort=False).to_dict()
        result = {"name": name, "folder": str(out), "records": len(records), "groups": len(records.groups)}
        say_json({**result, "faults": counts})
    else:
        say(f"{name}: {len(records)} records in {len(records.groups)} groups")
    wrote(out, as_json=as_json)


def _verify_all(all_facts: list[Manifest], root: Path, *, quick: bool = False) -> list[Verification]:
    """Verify data sets with one progress bar."""
    from twingap.data.verify import bytes_to_hash, verify

    total = 0 if quick else sum(bytes_to_hash(facts, root) for facts in all_facts)
    with progress("verify", total) as shown:
        return [
            verify(facts, root, quick=quick, progress=functools.partial(shown.step, facts.name)) for facts in all_facts
        ]


def _print_check(facts: Manifest, check: Verification, *, in_full: bool) -> None:
    """Print the verification of one set: a summary, and one line for each file that is not verified."""
    if facts.made_here:
        say(f"{facts.name}: made on demand, nothing to verify")
        return
    if not check.here and not in_full:
        say(f"{facts.name}: not here")
        return
    counts = {s: check.count(s) for s in ("ok", "unchecked", "missing", "unexpected", "altered")}
    say(f"{facts.name}: {', '.join(f'{n} {status}' for status, n in counts.items() if n)}")
    for finding in check.findings:
        if finding.status != "ok":
            sums = f"expected {finding.expected or 'nothing known'}, found {finding.found or 'none'}"
            say(f"  {finding.status}: {finding.path}: {sums}{'; ' + finding.mend if finding.mend else ''}")


def _listing(facts: Manifest, check: Verification | None) -> dict[str, Any]:
    """Row of a data set for `list --json`."""
    from twingap.data import card_of

    return {
        "name": facts.name,
        "title": facts.title,
        "licence": facts.licence,
        "citation": facts.citation,
        "url": facts.url,
        "how_to_get": facts.how_to_get,
        "made_here": facts.made_here,
        "size_bytes": facts.size_bytes,
        "files": len(facts.files),
        "present": None if check is None else sum(f.status in ("ok", "unchecked", "altered") for f in check.findings),
        "verified": None if check is None else check.count("ok"),
        "altered": None if check is None else check.count("altered"),
        "unexpected": None if check is None else check.count("unexpected"),
        "card": card_of(facts).about(),
    }


def _presence(facts: Manifest, check: Verification | None) -> str:
    if facts.made_here:
        return "always"
    if check is None:
        return "unknown: no data root"
    if not check.here:
        return "no"
    counts = {
        f"{check.count('ok')} of {len(facts.files)} files verified": check.count("ok"),
        f"{check.count('unchecked')} unchecked": check.count("unchecked"),
        f"{check.count('altered')} ALTERED": check.count("altered"),
        f"{check.count('unexpected')} unexpected": check.count("unexpected"),
    }
    return ", ".join(text for text, n in counts.items() if n)


def _human(size_bytes: int | None) -> str:
    if size_bytes is None:
        return "unknown"
    power = min(3, int(math.log(max(size_bytes, 1), 1000)))
    return f"{size_bytes / 1000**power:.3g} {('B', 'kB', 'MB', 'GB')[power]}"


def _key_value(text: str) -> tuple[str, Any]:
    """Name and value of a reader's option; values are None, numbers or text."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise TwingapError(f"{text!r} is not an option", where="--option", mend="write key=value")
    value = value.strip()
    if value.lower() == "none":
        return key.strip(), None
    for kind in (int, float):
        try:
            return key.strip(), kind(value)
        except ValueError:
            continue
    return key.strip(), value
