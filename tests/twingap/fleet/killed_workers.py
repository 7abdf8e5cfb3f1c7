"""A fleet on two local dask workers, of which one is killed every so many seconds, against the same fleet undisturbed.

``python -m tests.twingap.fleet.killed_workers 50 60`` simulates 50 machines, kills a worker every 60 s, and compares
all files of the two fleets but for the time that each diagnosis took.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

from twingap.cli.demo import demo_case
from twingap.config import to_toml
from twingap.records.folder import write_record_set
from twingap.rigs.worlds import make_world


def main(machines: int, every_s: float) -> bool:
    """Whether both fleets are the same."""
    with TemporaryDirectory() as folder:
        top = Path(folder)
        for seed in range(100, 100 + machines):
            world = make_world(demo_case(seed), seed)
            write_record_set(world.records, top / "fleet" / f"m{seed}")
        (top / "twin.toml").write_text(to_toml(world.twin), encoding="utf-8")
        killed = _killed(_command(top, "disturbed", "--backend", "dask"), every_s)
        subprocess.run(_command(top, "undisturbed"), check=True, stdout=subprocess.DEVNULL)
        disturbed, undisturbed = (_contents(top / name) for name in ("disturbed", "undisturbed"))
        same = disturbed == undisturbed and len(undisturbed) > machines
        print(f"{machines} machines, {killed} workers killed: {'the same' if same else 'other'} results")
        return same


def _command(top: Path, out: str, *words: str) -> list[str]:
    fleet = [sys.executable, "-m", "twingap.cli", "fleet", str(top / "fleet"), "--twin", str(top / "twin.toml")]
    return [*fleet, "--out", str(top / out), "--quick", "--no-track", "--jobs", "2", *words]


def _killed(command: list[str], every_s: float) -> int:
    """Number of workers killed while the command ran."""
    process, last, killed = subprocess.Popen(command, stdout=subprocess.DEVNULL), time.monotonic(), 0
    while process.poll() is None:
        time.sleep(0.5)
        if time.monotonic() - last < every_s:
            continue
        last = time.monotonic()
        workers = list(_workers(process.pid))
        if workers:
            workers[killed % len(workers)].kill()
            killed += 1
    if process.returncode:
        raise SystemExit(f"the fleet ended with status {process.returncode}")
    return killed


def _workers(pid: int) -> Iterator[psutil.Process]:
    """Processes of dask's workers."""
    for child in psutil.Process(pid).children(recursive=True):
        with suppress(psutil.Error):  # it has ended since
            if "spawn_main" in " ".join(child.cmdline()):
                yield child


def _contents(folder: Path) -> dict[str, Any]:
    """Path -> content of every file but the hidden ones; of reports without the time they took."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file())
    visible = [path for path in paths if not any(part.startswith(".") for part in path.relative_to(folder).parts)]
    return {str(path.relative_to(folder)): _content(path) for path in visible}


def _content(path: Path) -> Any:
    if path.name != "gap.json":
        return path.read_bytes()
    report = json.loads(path.read_text(encoding="utf-8"))
    report["provenance"].pop("runtime_s")
    return report


if __name__ == "__main__":
    sys.exit(0 if main(int(sys.argv[1]), float(sys.argv[2])) else 1)
