"""What a command left when it was typed; the fixture `typed` types."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class Said(NamedTuple):
    """What a command left."""

    status: int
    out: str
    err: str


Run = Callable[..., Said]


def refused(said: Said, *parts: str) -> None:
    """One line on standard error, naming all of `parts`, and exit status 2."""
    assert said.status == 2
    assert said.out == ""
    assert said.err.startswith("twingap: ") and said.err.count("\n") == 1
    for part in parts:
        assert part in said.err
