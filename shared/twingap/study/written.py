"""Output of a study: study.json, study.md and figures.

Study --json--> study.json;  --tables--> study.md;  --figures--> *.png
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from twingap.study.figures import draw_all
from twingap.study.tables import markdown, write_tables

if TYPE_CHECKING:
    from twingap.study.runner import Study


def write_study(study: Study, out: str | os.PathLike[str]) -> list[Path]:
    """Write study.json, study.md and the figures; returns their paths."""
    folder = Path(out)
    written = write_tables(study.table, markdown(study.table), folder, "study")
    return [*written, *draw_all(study.table, folder)]
