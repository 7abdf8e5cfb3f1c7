"""report.html: a diagnosis as one page that needs no other file and no network.

GapReport --sections--> data of each section --Jinja2 templates--> page; figures by Plotly, whose library is embedded

Whatever comes from the user's data is escaped by the templates. The bytes depend on the report alone, without its run
time.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from twingap.gap.report.figures import all_figures
from twingap.gap.report.model import GapReport
from twingap.gap.report.sections import SECTIONS
from twingap.gap.report.sections.headline import headline

_CONFIG: Final = {
    "displaylogo": False, "responsive": True, "displayModeBar": "hover",
    "modeBarButtons": [["toImage", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
}  # fmt: skip


def page(report: GapReport) -> str:
    """The page; any part of the report may be empty."""
    figures = {name: _figure(name, figure) for name, figure in all_figures(report)}
    sections = [section for make in SECTIONS if (section := make(report, figures)) is not None]
    plotly = plotly_library() if figures else ""
    return templates().get_template("page.html").render(headline=headline(report), sections=sections, plotly=plotly)


@cache
def templates() -> Environment:
    """The templates, which escape what they show; the filter ``code`` sets words between backticks as code."""
    found = Environment(
        loader=PackageLoader("twingap.gap.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=StrictUndefined,
    )  # fmt: skip
    found.filters["code"] = lambda text: Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))
    return found


@cache
def plotly_library() -> str:
    """Plotly's JavaScript, the bundle with lines and bars alone (plotly.js-basic-dist-min)."""
    folder = resources.files("twingap.gap.report")
    return folder.joinpath("templates/plotly-basic.min.js").read_text(encoding="utf-8")


def _figure(name: str, figure: Any) -> str:
    place = "fig-" + "".join(c if c.isascii() and c.isalnum() else "-" for c in name)
    return str(figure.to_html(full_html=False, include_plotlyjs=False, div_id=place, config=_CONFIG))
