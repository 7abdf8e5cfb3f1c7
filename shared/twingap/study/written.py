"""Output of a study: study.json, study.md and figures.

Study --json--> study.json;  --tables--> study.md;  --figures--> *.png
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from twingap import files
from twingap.study.figures import draw_all
from twingap.study.tables import finite, markdown

if TYPE_CHECKING:
    from twingap.study.runner import Study


def write_study(study: Study, out: str | os.PathLike[str]) -> list[Path]:
    """Write study.json, study.md and the figures.

    Returns
    -------
    list of Path
        The files written.
    """
    folder = Path(out)
    text = json.dumps(finite(study.table), indent=1, allow_nan=False) + "\n"
    written = []
    for name, content in (("study.json", text), ("study.md", markdown(study.table))):
        with files.replacing(folder / name) as temporary:
            temporary.write_text(content, encoding="utf-8")
        written.append(folder / name)
    return [*written, *draw_all(study.table, folder)]
