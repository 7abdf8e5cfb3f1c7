"""`twingap identify`."""

from __future__ import annotations


def identify() -> None:
    """To be written."""
