"""Pages of the documentation that are generated from the code: nothing in them is typed by hand.

effects registry, command line, JSON Schema, manifests, result of the current study, public names --> Markdown in docs/
"""

from __future__ import annotations

from pathlib import Path

from site_pages import (
    bearing_table,
    benchmark_page,
    command_pages,
    data_cards,
    effect_pages,
    gap_file,
    python_pages,
    sample_files,
    validation,
)

GENERATORS = (
    command_pages,
    effect_pages,
    bearing_table,
    gap_file,
    sample_files,
    data_cards,
    python_pages,
    validation,
    benchmark_page,
)


def write_all(docs: Path) -> None:
    """Write the generated pages into the folder of the documentation.

    Parameters
    ----------
    docs : Path
        Files that have not changed keep their time, so that Sphinx does not read them again.
    """
    for generator in GENERATORS:
        for name, page in generator.pages(docs).items():
            write(docs / name, page)


def write(path: Path, text: str) -> None:
    """Write a page, unless it is there and the same."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
