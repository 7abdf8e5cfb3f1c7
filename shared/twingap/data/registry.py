"""Readers by name: `load("cwru")` gives a record set."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import os
import typing
from collections.abc import Callable
from typing import Any, Final

from twingap.config import build
from twingap.errors import TwingapError
from twingap.records import RecordSet

READERS: Final[dict[str, str]] = {
    "cwru": "twingap.data.cwru:load_cwru",
    "femto": "twingap.data.femto:load_femto",
    "hit_sm": "twingap.data.hit_sm:load_hit_sm",
    "ims": "twingap.data.ims:load_ims",
    "paderborn": "twingap.data.paderborn:load_paderborn",
    "smart_maintenance": "twingap.data.smart_maintenance:load_smart_maintenance",
    "virtual_cwru": "twingap.data.virtual:load_virtual_cwru",
    "xjtu_sy": "twingap.data.xjtu_sy:load_xjtu_sy",
}
"""Data set -> its reader, imported on first use."""


def reader(name: str) -> Callable[..., RecordSet]:
    """The reader of a data set.

    Raises
    ------
    TwingapError
        For a name without a reader.
    """
    if name not in READERS:
        raise TwingapError(f"no data set {name!r}", mend=f"use one of {', '.join(READERS)}")
    module, function = READERS[name].split(":")
    found: Callable[..., RecordSet] = getattr(importlib.import_module(module), function)
    return found


def load(name: str, root: str | os.PathLike[str] | None = None, **options: Any) -> RecordSet:
    """A public data set as a record set; samples are read on access.

    Parameters
    ----------
    name : str
        One of `READERS`.
    root : path-like, optional
        Data root; the environment variable TWINGAP_DATA when absent.
    **options
        Options of the reader: `channel`, `fs_hz`...

    Raises
    ------
    NotAtHandError
        When no file of the data set is available.
    TwingapError
        For an unknown name or option, and when present files cannot be read.
    """
    read = reader(name)
    given = {key: value for key, value in options.items() if value is not None}
    build(_options(read), given, f"data set {name}")  # refuses unknown names and values of another type
    return read(root, **options)


def _options(read: Callable[..., RecordSet]) -> type[Any]:
    """A dataclass with the names and types of a reader's options."""
    hints = typing.get_type_hints(read)
    fields = [
        (key, hints[key], dataclasses.field(default=parameter.default))
        for key, parameter in inspect.signature(read).parameters.items()
        if key != "root"
    ]
    return dataclasses.make_dataclass("Options", fields)


def takes(name: str, option: str) -> bool:
    """Whether the reader of a data set has an option of this name."""
    return option in inspect.signature(reader(name)).parameters
