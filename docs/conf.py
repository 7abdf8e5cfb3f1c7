"""Configuration of the documentation site."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

# Before anything imports Numba, PyTorch or MLflow: tutorials write into a folder of their own and track nothing.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["TWINGAP_HOME"] = tempfile.mkdtemp(prefix="twingap-docs-")
os.environ["MPLBACKEND"] = "agg"

import site_pages  # noqa: E402
from site_pages.links import to_pages  # noqa: E402
from site_pages.tutorials import CONFIGURATION, DATA_AT_HAND  # noqa: E402

from twingap import __version__  # noqa: E402

project = "twingap"
author = "The twingap authors"
copyright = author
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.doctest",
    "sphinx_design",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "gallery", "tutorials/*.ipynb", "**/README.md"]
suppress_warnings = [
    "ref.python",  # one name in two packages (Estimate, say): the first one is linked
    "config.cache",
]
default_role = "py:obj"
nitpicky = False

myst_enable_extensions = ["colon_fence", "deflist", "fieldlist"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_generate = False
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

doctest_global_setup = "import numpy as np\nimport twingap\n"
doctest_test_doctest_blocks = "default"

html_theme = "furo"
html_title = "twingap"
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5d8f", "color-brand-content": "#0b5d8f"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f0", "color-brand-content": "#7cc4f0"},
}
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = CONFIGURATION
if not DATA_AT_HAND:
    tags.add("without_data")  # type: ignore[name-defined]  # noqa: F821


def as_typed(app: Any, what: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    """Show docstrings as they are typed.

    reStructuredText would take |x| for a substitution, and napoleon what stands before the colon in a property's first
    line for its type.
    """
    if what in ("property", "attribute") and lines and ":" in lines[0]:
        lines[0] = f": {lines[0]}"
    in_code = False
    for i, line in enumerate(lines):
        begins = i > 0 and lines[i - 1].endswith("::")
        in_code = begins or (in_code and (not line.strip() or line.startswith(" ")))
        if not in_code:
            parts = line.split("`")
            parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
            lines[i] = "`".join(parts)


def with_links_to_pages(app: Any, docname: str, source: list[str]) -> None:
    """Link to generated pages, where the source links to what they are generated from."""
    source[0] = to_pages(source[0], docname)


def setup(app: Any) -> None:
    """Write the generated pages before Sphinx looks for sources."""
    app.connect("source-read", with_links_to_pages)
    app.connect("autodoc-process-docstring", as_typed, priority=400)
    app.connect("config-inited", lambda app, config: site_pages.write_all(HERE), priority=10)
