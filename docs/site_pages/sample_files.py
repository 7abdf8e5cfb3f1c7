"""The page of the files of samples: what the readers state about each type."""

from __future__ import annotations

from pathlib import Path

from twingap.records import samples

HEAD = """# Files of samples

A record set names files of these types: {suffixes}. Values are checked when they are read: a NaN, an infinity or a
missing sample ends the reading with file, row and column.

"""


def pages(docs: Path) -> dict[str, str]:
    """reference/sample-files.md."""
    head = HEAD.replace("{suffixes}", ", ".join(f"`{suffix}`" for suffix in samples.SUFFIXES))
    parts = [head]
    for paragraph in (samples.__doc__ or "").strip().split("\n\n")[1:]:
        # Lines in columns are shown as they are typed.
        columns = any(line.startswith((".", " ")) or "--" in line for line in paragraph.splitlines())
        parts.append(f"```text\n{paragraph}\n```\n" if columns else paragraph + "\n")
    return {"reference/sample-files.md": "\n".join(parts)}
