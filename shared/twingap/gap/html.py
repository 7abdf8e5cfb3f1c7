"""The page of a diagnosis."""

from __future__ import annotations

from twingap.gap.report import GapReport


def page(report: GapReport) -> str:
    """The whole page as one text that needs nothing beside it."""
    import html

    return f"<!doctype html><meta charset=utf-8><title>gap</title><h1>{html.escape(report.sentence)}</h1>"
