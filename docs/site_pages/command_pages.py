"""The page of the command line: every command with every argument and option, from the program itself."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from site_pages.markdown import safe, table

HEAD = """# Command line

Every command ends with the paths of what it wrote. It exits with 0 when it has done its job, and with 2 and one line
that says what is wrong, where, and how to mend it when the input is at fault.
"""


def commands() -> Iterator[tuple[str, Any]]:
    """All commands by what is typed ("twingap data list"), groups left out."""
    from twingap.cli import app

    yield from _below("twingap", typer.main.get_command(app))


def _below(path: str, command: Any) -> Iterator[tuple[str, Any]]:
    subcommands = getattr(command, "commands", None)
    if subcommands is None:
        yield path, command
        return
    for name, each in subcommands.items():
        if not each.hidden:
            yield from _below(f"{path} {name}", each)


def shown(command: Any) -> tuple[list[Any], list[Any]]:
    """Its arguments and its options, hidden ones left out."""
    parameters = [p for p in command.params if not getattr(p, "hidden", False) and p.name != "help"]
    arguments = [p for p in parameters if p.param_type_name == "argument"]
    return arguments, [p for p in parameters if p.param_type_name == "option"]


def pages(docs: Path) -> dict[str, str]:
    """reference/commands.md."""
    known = list(commands())
    top = [{"command": f"[`{path}`](#{anchor(path)})", "does": safe(first(command.help))} for path, command in known]
    parts = [HEAD, table(top), *(_section(path, command) for path, command in known)]
    return {"reference/commands.md": "\n".join(parts)}


def anchor(path: str) -> str:
    """Anchor of a command's section."""
    return path.replace(" ", "-")


def first(text: str | None) -> str:
    """First paragraph, in one line."""
    return " ".join((text or "").split("\n\n")[0].split())


def _section(path: str, command: Any) -> str:
    arguments, options = shown(command)
    usage = " ".join([path, *(_usage(a) for a in arguments), *(_usage(o) for o in options if o.required)])
    if any(not o.required for o in options):
        usage += " [OPTIONS]"
    parts = [f"({anchor(path)})=", f"## {path}", "", f"```text\n{usage}\n```", "", _paragraphs(command.help), ""]
    if arguments:
        parts += [table([{"argument": f"`{name(a)}`", "meaning": safe(a.help or "")} for a in arguments])]
    if options:
        rows = [
            {"option": _names(o), "value": _value(o), "default": _default(o), "meaning": safe(o.help or "")}
            for o in options
        ]
        parts += [table(rows)]
    examples = [" ".join(line.split()) for line in (command.epilog or "").split("\n\n") if line.startswith("twingap ")]
    if examples:
        parts += ["```console", *(f"$ {line}" for line in examples), "```", ""]
    return "\n".join(parts)


def _paragraphs(text: str | None) -> str:
    return "\n\n".join(safe(paragraph) for paragraph in (text or "").split("\n\n"))


def name(parameter: Any) -> str:
    """What an argument is called in the usage."""
    return str(parameter.metavar or parameter.name.upper())


def _usage(parameter: Any) -> str:
    if parameter.param_type_name == "option":
        return f"{parameter.opts[0]} {name(parameter)}"
    text = name(parameter) + ("..." if parameter.nargs == -1 else "")
    return text if parameter.required else f"[{text}]"


def _names(option: Any) -> str:
    return ", ".join(f"`{flag}`" for flag in (*option.opts, *option.secondary_opts))


_WORDS = {int: "whole number", float: "number", Path: "path", str: "text"}


def _value(option: Any) -> str:
    """What may be given: choices, a name, or a kind with its range."""
    if option.is_flag:
        return ""
    kind = option.type_descriptor.annotation
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return ", ".join(f"`{choice.value}`" for choice in kind)
    if option.metavar:
        return f"`{option.metavar}`"
    text = _WORDS.get(kind, getattr(kind, "__name__", ""))
    if option.min is not None and option.max is not None:
        return f"{text}, {option.min:g} to {option.max:g}"
    return f"{text}, at least {option.min:g}" if option.min is not None else text


def _default(option: Any) -> str:
    if option.required:
        return "required"
    value = getattr(option.default, "value", option.default)
    if option.is_flag:
        return f"`{option.opts[0]}`" if value and option.secondary_opts else ""
    return "" if value is None or value == [] or value == () else f"`{value}`"
