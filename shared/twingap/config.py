"""Typed, frozen configuration from TOML, with errors that name file, key, value and the expected form."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import os
import re
import tomllib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

from twingap.errors import TwingapError
from twingap.files import open_text

T = TypeVar("T")
_DEEP = re.compile(r"""(?<![\w.-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){99}""")
"""A dotted key of a hundred parts; the time and memory that `tomllib` takes grow with the square of their number."""


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Parse a TOML file.

    Raises
    ------
    TwingapError
        When the file is missing, a folder, not UTF-8 or not TOML.
    """
    try:
        with open_text(path) as stream:
            text = stream.read()
        if _DEEP.search(text):
            raise TwingapError("is not valid TOML: nested too deeply", where=path)
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, and Python's errors for impossible dates and very long numbers
        raise TwingapError(f"is not valid TOML: {error}", where=path) from error
    except RecursionError as error:
        raise TwingapError("is not valid TOML: nested too deeply", where=path) from error


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
        Naming file, key, value and the expected form.
    """
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}  # type: ignore[arg-type]
    hints = _hints(kind)  # type: ignore[arg-type]  # mypy: a type is hashable
    for key in table:
        if key not in fields:
            raise TwingapError(f"unknown key {key!r}", where=where, mend=f"known keys: {', '.join(fields)}")
    values: dict[str, Any] = {}
    for name, field in fields.items():
        if name in table:
            values[name] = _convert(hints[name], table[name], f"{where}: {name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise TwingapError(f"key {name!r} is missing", where=where, mend=f"add {name} = {_expected(hints[name])}")
    try:
        return kind(**values)
    except TwingapError as error:  # the object's own checks do not name the file
        what = error.what if error.where is None else f"{error.where}: {error.what}"
        raise TwingapError(what, where=where, mend=error.mend) from error


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    """Types of a dataclass's fields; cached, as many twins are made."""
    return typing.get_type_hints(kind)


def to_toml(table: Mapping[str, Any]) -> str:
    """TOML text of (nested) tables, from which `read_toml` restores equal values.

    Parameters
    ----------
    table : Mapping
        Values are str, bool, int, float, paths, lists or tuples of these, or Mappings (tables); None is left out,
        since TOML has no such value.

    Raises
    ------
    TypeError
        For other values.
    """
    return "\n".join(_toml_lines(table, ())) + "\n"


def _toml_lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    given = {key: value for key, value in table.items() if value is not None}
    lines = [f"{_toml_key(k)} = {_toml_value(v)}" for k, v in given.items() if not isinstance(v, Mapping)]
    for key, value in given.items():
        if isinstance(value, Mapping):
            inner = (*path, key)
            lines += ["", f"[{'.'.join(map(_toml_key, inner))}]", *_toml_lines(value, inner)]
    return lines[1:] if not path and lines[:1] == [""] else lines


def _toml_key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key, re.ASCII) else _toml_value(key)


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, (str, Path)):
        # TOML's basic strings are JSON's, but for one control character that JSON leaves bare.
        return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    raise TypeError(f"{value!r} has no place in TOML")


def _convert(kind: Any, value: Any, where: str) -> Any:
    """`value` as `kind`, or an error that states the expected form."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind) and isinstance(value, Mapping):
        return build(typing.cast(type, kind), value, where)
    if origin in (Union, types.UnionType):
        return _convert_union(kind, value, where)
    if origin is Literal and any(value == a and type(value) is type(a) for a in arguments):
        return value
    if origin is tuple and isinstance(value, (list, tuple)):
        return tuple(_convert(arguments[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if origin is dict and isinstance(value, Mapping):
        return {key: _convert(arguments[1], item, f"{where}.{key}") for key, item in value.items()}
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:  # an integer beyond the range of float
            number = math.inf
        if math.isfinite(number):
            return number
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind in (str, bool) and isinstance(value, kind):
        return value
    if kind is Path and isinstance(value, str):
        return Path(value)
    if kind is Any:
        return value
    raise TwingapError(f"{_shown(value)} found, {_expected(kind)} expected", where=where)


def _convert_union(kind: Any, value: Any, where: str) -> Any:
    """The value as the first of the kinds that fits."""
    kinds = [a for a in typing.get_args(kind) if a is not type(None)]
    if len(kinds) == 1:
        return _convert(kinds[0], value, where)
    for one in kinds:
        try:
            return _convert(one, value, where)
        except TwingapError:
            continue
    raise TwingapError(f"{_shown(value)} found, {_expected(kind)} expected", where=where)


def _shown(value: Any) -> str:
    """A value as shown in errors, shortened."""
    try:
        text = repr(value)
    except ValueError:  # Python does not print integers of more than 4300 digits
        return "an endless number"
    return text if len(text) <= 80 else text[:77] + "..."


def _expected(kind: Any) -> str:
    """Expected form of a value of this kind, as text."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is Literal:
        return "one of " + ", ".join(repr(a) for a in arguments)
    if origin in (Union, types.UnionType):
        return " or ".join(_expected(a) for a in arguments if a is not type(None))
    if origin is tuple:
        return f"a list, each {_expected(arguments[0])}"
    if dataclasses.is_dataclass(kind) or origin is dict:
        return "a table"
    names = {float: "a finite number", int: "a whole number", str: "a string", bool: "true or false", Path: "a path"}
    return names.get(kind, "a value")
