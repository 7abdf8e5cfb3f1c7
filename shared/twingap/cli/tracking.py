"""Tracking of commands whose results are written before they are logged."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from twingap.errors import TwingapError

if TYPE_CHECKING:
    from twingap.track import Tracker

Track = Annotated[bool, typer.Option("--track/--no-track", help="Store the result as a run for `twingap ui`.")]


class Tracking:
    """Tracking of a command, or none.

    An address that the user states must work before the command begins. The default store is opened when results are
    written already; an unusable one then gives a message only.

    Parameters
    ----------
    experiment : str
    wanted : bool
    uri : str or None
        Address that the user states.

    Raises
    ------
    TwingapError
        When the store at this address cannot be used.
    """

    def __init__(self, experiment: str, wanted: bool, uri: str | None) -> None:
        self.experiment, self.wanted = experiment, wanted
        self.tracker = self._open(uri) if wanted and uri is not None else None

    def log(self, write: Callable[[Tracker], None]) -> None:
        """Call `write` with the tracker, if tracking is wanted."""
        if not self.wanted:
            return
        try:
            write(self.tracker or self._open(None))
        except TwingapError as error:
            print(f"twingap: not tracked: {error}", file=sys.stderr)

    def _open(self, uri: str | None) -> Tracker:
        from twingap.track import MlflowTracker

        return MlflowTracker(uri, self.experiment)
