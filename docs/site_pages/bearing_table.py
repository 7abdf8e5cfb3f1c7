"""The page of the bearings that are known by name."""

from __future__ import annotations

from pathlib import Path

from site_pages.markdown import number, table
from twingap.bearing import BEARINGS

HEAD = """# Bearings

Bearings that are known by name. Orders are in multiples of shaft speed; a ball defect strikes at 2 {term}`BSF`. Any
other bearing is a `[bearing]` table in `recordset.toml` or in the twin file.
"""


def pages(docs: Path) -> dict[str, str]:
    """reference/bearings.md."""
    rows = [
        {
            "name": f"`{name}`", "rollers": b.n_rollers, "roller, mm": number(b.roller_diameter_mm),
            "pitch, mm": number(b.pitch_diameter_mm), "contact angle, deg": number(b.contact_angle_deg),
            "FTF": f"{b.ftf:.4f}", "BPFO": f"{b.bpfo:.4f}", "BPFI": f"{b.bpfi:.4f}", "BSF": f"{b.bsf:.4f}",
        }
        for name, b in BEARINGS.items()
    ]  # fmt: skip
    return {"reference/bearings.md": HEAD + "\n" + table(rows)}
