"""Settings of the gallery of tutorials: order, working folder, figures."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]

ORDER = ("first_diagnosis.py", "read_a_report.py", "close_a_gap.py", "cwru_end_to_end.py")


class Order:
    """Key that sorts tutorials in the order in which they are read."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __call__(self, name: str) -> int:
        return ORDER.index(name)

    def __repr__(self) -> str:
        return "Order"


def set_figures(settings: dict[str, Any], name: str) -> None:
    """Draw readable figures on a light background, in colours that colour-blind readers tell apart."""
    import matplotlib

    matplotlib.rcParams.update(
        {
            "figure.facecolor": "white", "axes.spines.top": False, "axes.spines.right": False, "font.size": 12,
            "figure.dpi": 100, "figure.constrained_layout.use": True,
            "axes.prop_cycle": matplotlib.cycler(color=["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000"]),
        }
    )  # fmt: skip


def embed_report(block: Any, block_vars: dict[str, Any], settings: dict[str, Any]) -> str:
    """Show the page that a block wrote (a `report.html` among the paths in its variable `written`)."""
    known = block_vars["example_globals"]
    pages = [path for path in known.pop("written", ()) if Path(path).name == "report.html"]
    if not pages:
        return ""
    name = f"{Path(block_vars['src_file']).stem}.html"
    place = DOCS / "_static" / "reports" / name
    place.parent.mkdir(exist_ok=True)
    shutil.copyfile(pages[0], place)
    return f"""
.. raw:: html

   <iframe src="../_static/reports/{name}" class="report" title="The report" loading="lazy"></iframe>
   <p class="report-link"><a href="../_static/reports/{name}">Open this report as a page of its own</a></p>
"""


DATA_AT_HAND = bool(os.environ.get("TWINGAP_DATA")) and (Path(os.environ["TWINGAP_DATA"]) / "cwru").is_dir()
"""Whether the tutorial on public records runs; where it does not, its page says so."""

CONFIGURATION: dict[str, Any] = {
    "examples_dirs": [str(DOCS / "gallery")],
    "gallery_dirs": ["tutorials"],
    "filename_pattern": r"\.py$" if DATA_AT_HAND else r"^(?!.*cwru_).*\.py$",
    "image_scrapers": ("matplotlib", "site_pages.tutorials.embed_report"),
    "within_subsection_order": "site_pages.tutorials.Order",
    "reset_modules": ("matplotlib", "site_pages.tutorials.set_figures"),
    "reset_modules_order": "before",
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1,
    "remove_config_comments": True,
    "capture_repr": ("_repr_html_", "__repr__"),
    "write_computation_times": False,
    "plot_gallery": "True",
    "parallel": True,
}
