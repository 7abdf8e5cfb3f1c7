"""Commands in forked processes, small inputs for them, and the size of a run.

The ordinary test suite runs a part of the trials; ``TWINGAP_FAULTS=full``, which ``tox -e faults`` sets, runs all.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.config import to_toml
from twingap.records import Condition
from twingap.records.folder import write_records
from twingap.twins.phenomenological import PhenomenologicalTwin

FULL: Final = os.environ.get("TWINGAP_FAULTS") == "full"


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int
    out: str
    err: str
    timed_out: bool
    seconds: float
    cpu_s: float
    peak_mb: float
    changes: int | None
    network: list[str]

    def refused(self) -> str:
        """The only line on standard error of a command that ended with status 2."""
        assert self.status == 2, (self.status, self.err[-3000:])
        lines = [line for line in self.err.splitlines() if line.strip()]
        assert len(lines) == 1 and lines[0].startswith("twingap: "), self.err[-3000:]
        return lines[0]


def _permitted(*words: str) -> bool:
    """Whether a program is there and allowed."""
    return shutil.which(words[0]) is not None and subprocess.run(words, capture_output=True).returncode == 0


class Forks:
    """A server of `tests/faults/forking.py`, in a namespace without network where that is permitted."""

    def __init__(self) -> None:
        root = Path(__file__).resolve().parents[2]  # what a trial prepares stands in the tests
        paths = os.pathsep.join([*(path for path in sys.path if path), str(root)])
        self.isolated = _permitted("unshare", "-n", "true")
        self._server = subprocess.Popen(
            [*["unshare", "-n"][: 2 * self.isolated], sys.executable, str(Path(__file__).with_name("forking.py"))],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": paths},
        )  # fmt: skip
        assert self._server.stdout is not None
        assert json.loads(self._server.stdout.readline()) == {"ready": True}

    def __call__(self, cwd: Path, *words: object, **given: Any) -> Ended:
        """Run `twingap WORDS` in a folder; see `_child` in forking.py for what can be given."""
        asked = {
            "words": [str(word) for word in words], "cwd": str(cwd), "limits": {}, "uid": 0, "clock_s": 0,
            "kill_at": None, "signals": [], "watch_network": False, "timeout_s": 600, "env": {}, "prepare": "", **given,
        }  # fmt: skip
        assert self._server.stdin is not None and self._server.stdout is not None
        self._server.stdin.write(json.dumps(asked) + "\n")
        self._server.stdin.flush()
        return Ended(**json.loads(self._server.stdout.readline()))

    def close(self) -> None:
        """End the server."""
        assert self._server.stdin is not None
        self._server.stdin.close()
        self._server.wait(300)  # a busy machine takes long to end a process


@pytest.fixture(scope="session")
def twingap() -> Iterator[Forks]:
    """Runs commands in forked processes."""
    forks = Forks()
    yield forks
    forks.close()


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of small inputs: twin.toml, table.csv, the record set `set`, a fleet of two, and exports."""
    top = tmp_path_factory.mktemp("inputs")
    top.chmod(0o755)
    twin = {"twin": {"model": "phenomenological"}, "bearing": asdict(BEARINGS["6205"])}
    (top / "twin.toml").write_text(to_toml(twin), encoding="utf-8")
    rows = [f"r{i},{1500 + 10 * i},{('healthy', 'inner', 'outer')[i % 3]}" for i in range(12)]
    (top / "table.csv").write_text("\n".join(["record,speed_rpm,fault", *rows]) + "\n", encoding="utf-8")
    faults = ("healthy", "outer", "inner", "ball")
    conditions = [Condition(f"r{i}", (1500.0, 1800.0)[i // 4 % 2], 8192.0, 8192, faults[i % 4]) for i in range(8)]
    for name, seed in (("set", 0), ("fleet/one", 1), ("fleet/two", 2)):
        made = PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(seed))
        write_records(top / name, "<script>alert(7)</script>", "g", BEARINGS["6205"], None, made)
    (top / "exports").mkdir()
    for i in range(6):
        values = np.random.default_rng(i).normal(size=500)
        lines = [f"{k / 1000:.6f},{x:.9f}" for k, x in enumerate(values)]
        path = top / "exports" / f"inner_{1500 + i}.csv"
        path.write_text("\n".join(["time,acc", *lines]) + "\n", encoding="utf-8")
    return top


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis that was tracked."""

    out: Path
    ended: Ended


@pytest.fixture(scope="session")
def diagnosed(twingap: Forks, inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    """A diagnosis, tracked in a new store, whose attempts to reach other machines are noted."""
    folder = tmp_path_factory.mktemp("diagnosed")
    words = ["gap", inputs / "set", "--twin", inputs / "twin.toml", "--quick", "--out", folder / "gap"]
    ended = twingap(folder, *words, "--tracking-uri", f"sqlite:///{folder / 'runs.db'}", watch_network=True)
    assert ended.status == 0, ended.err
    return Diagnosed(folder / "gap", ended)


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Callable[[], None]]:
    """A new file system of that size at a folder; yields what makes it read-only. Skips where that is not permitted."""
    folder.mkdir()
    if not _permitted("mount", "-t", "tmpfs", "-o", f"size={kilobytes}k,mode=0755", "tmpfs", str(folder)):
        pytest.skip("mounting a file system is not permitted here")
    try:
        yield lambda: subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True) and None
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def tree(folder: Path, parts: Sequence[str] = ("",)) -> dict[str, bytes]:
    """Content of all files below a folder that are not hidden, by relative path; run times are left out.

    Parameters
    ----------
    folder : Path
    parts : sequence of str
        Beginnings of the paths that count.
    """
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        visible = not any(part.startswith(".") for part in name.parts)
        if path.is_file() and visible and name.as_posix().startswith(tuple(parts)):
            found[name.as_posix()] = _without_run_time(path)
    return found


_VARYING: Final = ("runtime_s", "diagnosis_s", "computed_s", "peak_mb", "seconds", "command")
"""Keys of JSON files that differ between two runs."""


def _without_run_time(path: Path) -> bytes:
    content = path.read_bytes()
    return json.dumps(_same(json.loads(content))).encode() if path.suffix == ".json" else content


def _same(value: Any) -> Any:
    """A JSON value without run times and what is computed from them."""
    if isinstance(value, dict):
        timed = str(value.get("score", "")).startswith(("runtime", "peak memory"))
        return {} if timed else {key: _same(item) for key, item in value.items() if key not in _VARYING}
    return [_same(item) for item in value] if isinstance(value, list) else value


def hidden(folder: Path) -> list[str]:
    """Hidden files and folders below a folder: what an unfinished command may leave."""
    return [path.relative_to(folder).as_posix() for path in folder.rglob(".*")] if folder.exists() else []
