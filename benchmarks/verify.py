"""Verification of a data set, against sha256sum on the same files."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.data.manifest import DataFile, Manifest
from twingap.data.verify import digest, verify


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Files as large and as many as CWRU's drive-end set, in the page cache: what is timed is hashing, not the disk."""
    n_files, n_bytes, rounds = (4, 100_000, 2) if quick else (40, 4_000_000, 5)
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory(prefix="twingap-bench-") as temporary:
        root = Path(temporary)
        paths = [root / "made" / f"{i:03d}.bin" for i in range(n_files)]
        paths[0].parent.mkdir()
        for path in paths:
            path.write_bytes(rng.bytes(n_bytes))
        facts = _manifest(paths)
        if verify(facts, root).count("ok") != n_files:
            raise AssertionError("files just written do not verify")
        rivals: dict[str, Callable[[], object]] = {
            "twingap data verify": lambda: verify(facts, root),
            "reading alone": lambda: [path.read_bytes() for path in paths],
        }
        if shutil.which("sha256sum"):
            rivals["sha256sum"] = lambda: subprocess.run(["sha256sum", *paths], capture_output=True, check=True)
        seconds = in_turn(rivals, rounds)
    total = n_files * n_bytes
    ours = seconds["twingap data verify"]
    rows = [
        {
            "how": name,
            "MB/s": f"{total / min(took) / 1e6:.0f}",
            "our speed / its": f"{ratio(took, ours):.2f}",
        }
        for name, took in seconds.items()
    ]
    targets = []
    notes = ["reading alone is the floor: every byte must pass through memory once"]
    if "sha256sum" in seconds:
        targets.append(Target("verify / sha256sum, speed", ratio(seconds["sha256sum"], ours), 1.0))
    else:
        notes.append("sha256sum is not installed here: no peer")
    return Measurement(f"verification of {n_files} files of {n_bytes / 1e6:g} MB", rows, targets, notes)


def _manifest(paths: list[Path]) -> Manifest:
    files = tuple(
        DataFile(f"made/{path.name}", None, path.stat().st_size, digest(path).removeprefix("sha256:")) for path in paths
    )
    return Manifest("made", "made", "", None, "", "", None, "", None, False, files, (), (), {})
