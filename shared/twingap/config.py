"""Typed, frozen configuration from TOML, with errors that name file, key, value and what was expected."""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

from twingap.errors import TwingapError

T = TypeVar("T")


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Parse a TOML file.

    Raises
    ------
    TwingapError
        When the file is missing, a folder, not UTF-8 or not TOML.
    """
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise TwingapError(f"is not valid TOML: {error}", where=path) from error
    except UnicodeDecodeError as error:
        raise TwingapError("is not UTF-8 text", where=path, mend="save it as UTF-8") from error
    except OSError as error:
        raise TwingapError(f"cannot be read: {error.strerror}", where=path) from error


def build(kind: type[T], table: Mapping[str, Any], where: object) -> T:
    """Make a (nested) dataclass from a parsed TOML table.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are bool, int, float, str, Path, Literal, ``X | None``, ``tuple[X, ...]``,
        ``dict[str, X]`` or dataclasses of these. Fields without a default are required.
    table : Mapping
        The parsed table. Unknown keys are errors: a misspelt option must not pass silently.
    where : object
        File (and table) named in errors.

    Raises
    ------
    TwingapError
        Naming file, key, value and what was expected.
    """
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}  # type: ignore[arg-type]
    hints = typing.get_type_hints(kind)
    for key in table:
        if key not in fields:
            raise TwingapError(f"unknown key {key!r}", where=where, mend=f"known keys: {', '.join(fields)}")
    values: dict[str, Any] = {}
    for name, field in fields.items():
        if name in table:
            values[name] = _convert(hints[name], table[name], f"{where}: {name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise TwingapError(f"key {name!r} is missing", where=where, mend=f"add {name} = {_expected(hints[name])}")
    return kind(**values)


def _convert(kind: Any, value: Any, where: str) -> Any:
    """`value` as `kind`, or an error that says what was expected."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind) and isinstance(value, Mapping):
        return build(typing.cast(type, kind), value, where)
    if origin in (Union, types.UnionType):
        return _convert(next(a for a in arguments if a is not type(None)), value, where)
    if origin is Literal and value in arguments:
        return value
    if origin is tuple and isinstance(value, list):
        return tuple(_convert(arguments[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if origin is dict and isinstance(value, Mapping):
        return {key: _convert(arguments[1], item, f"{where}.{key}") for key, item in value.items()}
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind in (str, bool) and isinstance(value, kind):
        return value
    if kind is Path and isinstance(value, str):
        return Path(value)
    if kind is Any:
        return value
    raise TwingapError(f"{value!r} found, {_expected(kind)} expected", where=where)


def _expected(kind: Any) -> str:
    """What a value of this kind looks like, in words."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is Literal:
        return "one of " + ", ".join(repr(a) for a in arguments)
    if origin in (Union, types.UnionType):
        return _expected(next(a for a in arguments if a is not type(None)))
    if origin is tuple:
        return f"a list, each {_expected(arguments[0])}"
    if dataclasses.is_dataclass(kind) or origin is dict:
        return "a table"
    names = {float: "a finite number", int: "a whole number", str: "a string", bool: "true or false", Path: "a path"}
    return names.get(kind, "a value")
