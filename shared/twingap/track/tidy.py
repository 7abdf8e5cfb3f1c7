"""Names and tables in the form that file systems and tracking libraries accept."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from typing import Any

import pandas as pd


def clean_name(name: str) -> str:
    """`name` in the characters that every tracking library accepts: "macro F1 (%)" becomes "macro F1 percent"."""
    known = name.replace("%", "percent").replace("(", "").replace(")", "")
    parts = re.sub(r"[^A-Za-z0-9_\-. :/]+", "_", known).split("/")
    kept = "/".join(part.strip() for part in parts if part.strip(" ."))
    return kept if 0 < len(kept) <= 200 else f"{kept[:200]}-{zlib.crc32(name.encode()):08x}".lstrip("-")


def clean_file(name: str) -> str:
    """`name` as one file name; letters of any alphabet are kept."""
    return re.sub(r"[^\w\-. ()]+", "_", name).strip(" .")[:120] or "unnamed"


def flatten(value: Any, prefix: str = "") -> dict[str, Any]:
    """Nested tables as a single table with dotted names."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{type(value).__name__} given, a mapping or dataclass expected")
    flat: dict[str, Any] = {}
    for key, item in value.items():
        flat |= flatten(item, f"{prefix}{key}.") if isinstance(item, Mapping) and item else {prefix + key: item}
    return flat


def flat_table(frame: pd.DataFrame) -> pd.DataFrame:
    """The table with its index as columns (unless it is only a row number) and one text per column name."""
    counts = isinstance(frame.index, pd.RangeIndex) and frame.index.name is None
    flat = frame.copy() if counts else frame.reset_index()
    flat.columns = pd.Index(
        [" ".join(str(p) for p in c if str(p)) if isinstance(c, tuple) else str(c) for c in flat.columns]
    )
    return flat.reset_index(drop=True)
