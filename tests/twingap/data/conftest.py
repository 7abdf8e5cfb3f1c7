"""Small data sets of the tests' own, and the real ones where they are at hand."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from twingap.data.manifest import CROISSANT, Manifest, read_manifest


@pytest.fixture
def real_root() -> Path:
    """The data root with real records."""
    root = os.environ.get("TWINGAP_DATA")
    if not root:
        pytest.skip("TWINGAP_DATA is not set: no real records at hand")
    return Path(root)


@pytest.fixture
def small_set(tmp_path: Path) -> Callable[..., Manifest]:
    """Makes a manifest of a data set named "small" from the content of its files."""

    def make(contents: dict[str, bytes], *, items: list[dict[str, Any]] | None = None, **own: Any) -> Manifest:
        distribution: list[dict[str, Any]] = [
            {
                "@type": "cr:FileObject",
                "@id": f"small/{name}",
                "name": name,
                "contentUrl": f"small/{name}",
                "contentSize": f"{len(content)} B",
                "encodingFormat": "application/octet-stream",
                "sha256": hashlib.sha256(content).hexdigest(),
            }
            for name, content in contents.items()
        ]
        document = {
            "@type": "sc:Dataset",
            "name": "small",
            "alternateName": "A small set",
            "description": "Made by a test.",
            "conformsTo": CROISSANT,
            "license": "https://www.apache.org/licenses/LICENSE-2.0",
            "citeAs": "a test",
            "distribution": distribution + (items or []),
            **own,
        }
        path = tmp_path / "small.json"
        path.write_text(json.dumps(document), encoding="utf-8")
        return read_manifest(path)

    return make


@pytest.fixture
def lay_out() -> Callable[[Path, dict[str, bytes]], None]:
    """Writes files below a root's folder of the small set."""

    def write(root: Path, contents: dict[str, bytes]) -> None:
        for name, content in contents.items():
            path = root / "small" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    return write
