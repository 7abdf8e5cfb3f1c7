"""The command line is documented: every command, argument and option has help, and its page shows all of them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from site_pages import command_pages

ROOT = Path(__file__).parents[2]
COMMANDS = dict(command_pages.commands())
PAGES = sorted(path for path in (ROOT / "docs").rglob("*.md") if "reference/commands" not in path.as_posix())
TYPED = re.compile(r"^\s*(?:\$ )?(twingap [^#\n]*?)\s*(?:#.*)?$", re.MULTILINE)
BLOCK = re.compile(r"```(?:console|sh)\n(.*?)```", re.DOTALL)


@pytest.mark.parametrize("path", COMMANDS)
def test_every_argument_and_option_has_help(path: str) -> None:
    command = COMMANDS[path]
    assert command.help and command.help.strip().endswith((".", ")")), "the command says what it does"
    arguments, options = command_pages.shown(command)
    silent = [parameter.name for parameter in (*arguments, *options) if not (parameter.help or "").strip()]
    assert not silent


def test_the_page_shows_every_option_of_every_command() -> None:
    page = command_pages.pages(ROOT / "docs")["reference/commands.md"]
    sections = dict(re.findall(r"^## (twingap [^\n]+)\n(.*?)(?=^\(twingap|\Z)", page, re.MULTILINE | re.DOTALL))
    assert sections.keys() == COMMANDS.keys()
    for path, command in COMMANDS.items():
        arguments, options = command_pages.shown(command)
        for flag in (flag for option in options for flag in (*option.opts, *option.secondary_opts)):
            assert f"`{flag}`" in sections[path], f"{path} {flag}"
        for argument in arguments:
            assert f"| `{command_pages.name(argument)}` |" in sections[path]


def test_a_command_without_help_is_found() -> None:
    import typer

    app = typer.Typer()

    @app.command()
    def bare(option: int = 0) -> None: ...

    _, options = command_pages.shown(typer.main.get_command(app))
    assert [option.help for option in options if option.name == "option"] == [None]


def typed_on(path: Path) -> list[str]:
    """Commands in the blocks of a page."""
    return [line for block in BLOCK.findall(path.read_text(encoding="utf-8")) for line in TYPED.findall(block)]


def unknown_in(line: str) -> list[str]:
    """What of a typed command the program does not know."""
    path = max((path for path in COMMANDS if f"{line} ".startswith(f"{path} ")), key=len, default=None)
    if path is None:
        return [line]
    known: set[Any] = {flag for option in COMMANDS[path].params for flag in (*option.opts, *option.secondary_opts)}
    return [word for word in line.split() if word.startswith("-") and word not in known]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_commands_on_pages_exist_with_their_options(page: Path) -> None:
    wrong = {line: unknown for line in typed_on(page) if (unknown := unknown_in(line))}
    assert not wrong


def test_a_mistyped_option_on_a_page_is_found() -> None:
    assert unknown_in("twingap gap RECORDS --twin t.toml --out o --explain") == ["--explain"]
    assert unknown_in("twingap explain RECORDS") == ["twingap explain RECORDS"]
    assert any(typed_on(page) for page in PAGES)
