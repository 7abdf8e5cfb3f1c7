"""Parts of a section of the page: data that the templates render; only figures are HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple


class Line(NamedTuple):
    """A line of a cell; `style` is a CSS class: "strong", "small", "remark" or none."""

    text: str
    style: str = ""


Cell = str | Sequence[Line | str]
"""Text, or lines below each other. Words between backticks are set as code."""
Figures = Mapping[str, str]
"""Name -> figure as HTML, see `figures.all_figures`."""


@dataclass(frozen=True)
class Table:
    """A table of which the first rows are shown at once (None: all), and the others unfold.

    `head` may be empty; `more` names further rows, as in "3 more places"; `kind` is a CSS class.
    """

    part: ClassVar[str] = "table"
    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    shown: int | None = None
    more: str = "rows"
    kind: str = ""


@dataclass(frozen=True)
class Items:
    """A list; of a long one the first are shown and the others unfold. `ordered` numbers them."""

    part: ClassVar[str] = "items"
    items: Sequence[str]
    ordered: bool = False
    shown: int | None = None
    more: str = "items"
    kind: str = ""


@dataclass(frozen=True)
class Figure:
    """A figure, as HTML that `page` made, with a title above it."""

    part: ClassVar[str] = "figure"
    html: str
    title: str = ""
    wide: bool = False


@dataclass(frozen=True)
class Code:
    """Lines of a file."""

    part: ClassVar[str] = "code"
    text: str
    title: str = ""


Part = Table | Items | Figure | Code


@dataclass(frozen=True)
class Section:
    """A section of the page: title, introduction (may be empty), and parts in their order; `kind` is a CSS class."""

    title: str
    text: str = ""
    parts: Sequence[Part] = ()
    kind: str = ""

    @property
    def anchor(self) -> str:
        """Target of links to the section."""
        return self.title.lower().replace(" ", "-")


def figure(figures: Figures, name: str) -> tuple[Figure, ...]:
    """The figure of this name as a part; nothing where there is none."""
    return (Figure(figures[name]),) if name in figures else ()
