"""`twingap effects`: the catalogue of effects."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from twingap.cli.options import AnySeed, Effects, Json, say, say_json, show
from twingap.errors import TwingapError, one_of

if TYPE_CHECKING:
    from twingap.effects import Effect


def effects(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Effect to describe in full; a list of all when absent.")
    ] = None,
    effects: Effects = None,
    seed: AnySeed = 0,
    as_json: Json = False,
) -> None:
    """Describe the effects that a twin can have: parameters, similar effects, deciding measurements."""
    from twingap.effects import catalogue

    known = catalogue()
    if name is None:
        listed = [_described(each, kind) for each, kind in known.items()]
        if as_json:
            say_json(listed)
        else:
            show([{key: about[key] for key in ("effect", "stage", "group", "summary")} for about in listed], False)
        return
    if name not in known:
        raise TwingapError(f"unknown effect {name!r}", mend=one_of(name, known, "effects"))
    about = _described(name, known[name])
    if as_json:
        say_json(about)
        return
    kind_of = ", ".join(word for word in (about["stage"], about["group"]) if word)
    say(f"{name} ({kind_of})", "", about["description"], "")
    show(
        [
            {
                "parameter": each["name"], "meaning": each["meaning"], "unit": each["unit"],
                "default": _as_text(each["default"]), "plausible": _range(each["plausible"]),
            }
            for each in about["parameters"]
        ],
        False,
    )  # fmt: skip
    for title, key in (("similar effects", "look_alikes"), ("references", "references")):
        if about[key]:
            say(f"{title}: {'; '.join(about[key])}")
    if about["deciding_measurement"]:
        say(f"deciding measurement: {about['deciding_measurement']}")
    if not about["trained"]:
        say("part of the closest twin: no detector is trained for it, so that it is not named by itself")


def _described(name: str, kind: type[Effect]) -> dict[str, Any]:
    """Description of an effect."""
    from twingap.effects.registry import look_alikes

    description = inspect.cleandoc(kind.__doc__ or "")
    if description.startswith(f"{kind.__name__}("):  # the default docstring of a dataclass
        description = ""
    return {
        "effect": name,
        "stage": kind.stage.name.lower(),
        "group": str(getattr(kind, "group", None) or ""),
        "summary": " ".join(description.partition("\n\n")[0].split()),
        "description": description,
        "parameters": [_parameter(field) for field in dataclasses.fields(kind)],  # type: ignore[arg-type]
        "look_alikes": list(look_alikes(name)),
        "deciding_measurement": str(getattr(kind, "deciding_measurement", None) or ""),
        "references": list(kind.references),
        "trained": kind.trained,
    }


def _parameter(field: dataclasses.Field[Any]) -> dict[str, Any]:
    """Description of a parameter, or of a profile, which has no plausible range."""
    about, default = field.metadata, cast(Any, field.default)
    is_list = "profile" in about
    return {
        "name": field.name, "meaning": about["doc"], "unit": about["unit"],
        "default": list(default) if is_list else default,
        "plausible": [] if is_list else list(about["plausible"]), "allowed": list(about["allowed"]),
        "logarithmic": not is_list and about["log"], "fitted": not is_list and about["fitted"],
    }  # fmt: skip


def _range(plausible: Sequence[float]) -> str:
    """Text of a plausible range; lists are measured, and have none."""
    return "{:g} to {:g}".format(*plausible) if plausible else "a list, measured"


def _as_text(value: Any) -> Any:
    """A default for the table: of a list its numbers."""
    return ", ".join(f"{one:g}" for one in value) if isinstance(value, list) else value
