"""The catalogue: a page for every registered effect, with a figure of its signature, and a page that lists them."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from site_pages import signatures
from site_pages.markdown import described, number, safe, table
from twingap.effects import Effect, Stage, catalogue
from twingap.effects.registry import look_alikes

HEAD = """# Catalogue of effects

Every modelling choice of a {term}`twin` is one {term}`effect`. An effect acts in one of five stages, in this order:
shaft angle, excitation, path, disturbance, acquisition. Effects of one group stand in for each other: where single
names are uncertain, a diagnosis names the group. Amplitudes are in multiples of {term}`healthy rms`. Effects marked ○
have no detector: they are parts of the {term}`closest twin`, and three of them are also named where they close a good
part of the gap.

`twingap effects` prints this list, `twingap effects NAME` one effect.
[Write an effect](../how-to/write-an-effect.md) shows how to add one.
"""

STAGES = {
    Stage.SHAFT: "Shaft angle",
    Stage.EXCITATION: "Excitation",
    Stage.PATH: "Path",
    Stage.DISTURBANCE: "Disturbance",
    Stage.ACQUISITION: "Acquisition",
}


def pages(docs: Path) -> dict[str, str]:
    """reference/catalogue.md and reference/effects/NAME.md; figures are drawn where they are missing or old."""
    folder = docs / "reference" / "effects"
    folder.mkdir(parents=True, exist_ok=True)
    found = {"reference/catalogue.md": overview()}
    for name, kind in catalogue().items():
        shown = signatures.signature(kind)
        figure = folder / f"{name}.png"
        if not _is_newer(figure, signatures.__file__, inspect.getfile(kind)):
            signatures.draw(shown, figure)
        found[f"reference/effects/{name}.md"] = page(name, kind, shown)
    return found


def _is_newer(figure: Path, *sources: str) -> bool:
    """Whether a figure was drawn after its sources were written."""
    return figure.is_file() and figure.stat().st_mtime > max(Path(source).stat().st_mtime for source in sources)


def overview() -> str:
    """The list of all effects by stage."""
    parts = [HEAD]
    for stage in Stage:
        rows = [
            {
                "effect": f"[{name}](effects/{name}.md)" + " ○" * (not kind.trained),
                "what it is": first(kind),
                "group": kind.group,
            }
            for name, kind in catalogue().items()
            if kind.stage is stage
        ]
        parts += [f"## {STAGES[stage]}\n", table(rows)]
    names = "\n".join(f"effects/{name}" for name in catalogue())
    parts.append(f"```{{toctree}}\n:hidden:\n\n{names}\n```\n")
    return "\n".join(parts)


def page(name: str, kind: type[Effect], shown: signatures.Signature) -> str:
    """The page of one effect."""
    fields = (*kind.parameters(), *kind.profiles())
    values = {field.name: getattr(shown.effect, field.name) for field in fields}
    where = STAGES[kind.stage].lower() + (f", group {kind.group}" if kind.group else "")
    parts = [
        f"# {name}\n",
        f"*Stage: {where}.*\n",
        described(kind) + "\n",
        f"```{{figure}} {name}.png\n:alt: Record, spectrum and envelope spectrum with and without {name}\n"
        f":class: card\n\n{signatures.caption(shown, values)}\n```\n",
        "## Parameters\n",
        table([_parameter(field) for field in fields]),
    ]
    if kind.profiles():
        parts += ["Lists are measured from spectra; a [twin file](../twin-file.md) states them.\n"]
    if not kind.trained:
        parts += [
            "No detector is trained for it. It is a part of the {term}`closest twin`, whose "
            "{term}`attribution` states what it closes.\n"
        ]
    if others := look_alikes(name):
        links = ", ".join(f"[{other}]({other}.md)" for other in others)
        parts += ["## Look-alikes\n", f"It is most easily taken for {links}.\n"]
    if kind.deciding_measurement:
        parts += ["What would decide: " + safe(kind.deciding_measurement) + ".\n"]
    if kind.inherent_in:
        models = ", ".join(f"`{model}`" for model in kind.inherent_in)
        parts += [f"The physics of these models has it already: {models}.\n"]
    if kind.references:
        parts += ["## References\n", *(f"- {safe(reference)}" for reference in kind.references), ""]
    return "\n".join(parts)


def first(kind: type[Effect]) -> str:
    """First paragraph of an effect's description."""
    return " ".join(described(kind).split("\n\n")[0].split())


def _parameter(field: Any) -> dict[str, str]:
    about = field.metadata
    meaning = {"parameter": f"`{field.name}`", "meaning": safe(about["doc"]), "unit": about["unit"]}
    if "profile" in about:
        return {**meaning, "default": ", ".join(map(number, field.default)), "plausible": "a list"}
    low, high = about["plausible"]
    if field.type in ("bool", bool):
        default, plausible = str(field.default).lower(), "true or false"
    elif about["choices"]:
        default, plausible = number(field.default), " or ".join(number(one) for one in about["choices"])
    else:
        default, plausible = number(field.default), f"{number(low)} to {number(high)}"
    scale = ", logarithmic" if about["log"] else ""
    return {**meaning, "default": default, "plausible": plausible + scale}
