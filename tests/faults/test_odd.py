"""Odd inputs over all commands: special and huge files, hostile names, numbers out of range; one line each."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.faults.conftest import Forks
from tests.faults.test_hostile import everything
from twingap.bearing import BEARINGS
from twingap.records import Condition, Record
from twingap.records.folder import write_records

IMPORT = ("--fs-hz", 12000, "--speed-rpm", 1800, "--out", "new")
SIMULATE = ("--fs-hz", 8192, "--duration-s", 0.1, "--out", "new")
GAP = ("--twin", "twin.toml", "--quick", "--no-track", "--out", "new")
Make = Callable[[Path], object]


def fifo(name: str) -> Make:
    """A pipe that nobody writes to, in place of a file."""

    def make(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        os.mkfifo(folder / name)

    return make


def sparse(name: str) -> Make:
    """A file of 8 GB of null bytes that takes no space."""

    def make(folder: Path) -> None:
        with (folder / name).open("wb") as stream:
            stream.truncate(8 << 30)

    return make


def text(name: str, content: str) -> Make:
    return lambda folder: (folder / name).write_text(content)


def samples(name: str, values: object) -> Make:
    return lambda folder: np.save(folder / name, np.asarray(values))


def set_of_one_value(folder: Path) -> None:
    conditions = [Condition(f"r{i}", 1800.0, 8192.0, 4096, time_s=60.0 * i) for i in range(12)]
    records = [Record(condition, np.full(4096, 1e300)) for condition in conditions]
    write_records(folder / "flat", "flat", "g", BEARINGS["6205"], None, records)


def ladder(folder: Path) -> None:
    """Groups that hold the next one twice: 2^40 paths to one data set."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "x.h5", "w") as file:
        group = file
        for _ in range(40):
            inner = group.create_group("a")
            group["b"] = inner
            group = inner
        group["x"] = np.zeros(9)


CASES: dict[str, tuple[Make, tuple[object, ...], str]] = {
    # files that never end, or are larger than memory
    "pipe as twin": (fifo("t.toml"), ("simulate", "t.toml", "--records", "table.csv", *SIMULATE), "regular file"),
    "pipe as table": (fifo("set/records.csv"), ("gap", "set", *GAP), "regular file"),
    "pipe as recordset": (fifo("set/recordset.toml"), ("gap", "set", *GAP), "regular file"),
    "pipe as features": (fifo("f.csv"), ("health", "f.csv", "--out", "new"), "regular file"),
    "pipe as effects": (fifo("e.py"), ("effects", "--effects", "e.py"), "regular file"),
    "endless twin": (lambda _: None, ("simulate", "/dev/zero", "--records", "table.csv", *SIMULATE), "regular file"),
    "huge twin": (sparse("t.toml"), ("simulate", "t.toml", "--records", "table.csv", *SIMULATE), "8590 MB"),
    "huge table": (sparse("set/records.csv"), ("gap", "set", *GAP), "8590 MB"),
    "huge features": (sparse("f.csv"), ("health", "f.csv", "--out", "new"), "8590 MB"),
    "huge universal file": (sparse("x.uff"), ("import", "x.uff", *IMPORT), "universal data set"),
    "long line": (text("f.csv", "time_s,rms\n" + "1" * 9_000_000), ("health", "f.csv", "--out", "new"), "comma-sep"),
    # nesting whose cost grows with its square, or faster
    "deep key": (
        text("t.toml", ".".join("a" * 60000) + " = 1"),
        ("simulate", "t.toml", "--records", "table.csv", *SIMULATE), "too deeply",
    ),
    "ladder of groups": (ladder, ("import", "x.h5", *IMPORT), "nested parts"),
    # names and numbers
    "control characters": (
        text("a\x1b[2J.csv", "nothing\n"), ("import", "a\x1b[2J.csv", *IMPORT), r"a\\x1b\[2J\.csv",
    ),
    "long name": (
        text("t.toml", "k" * 100_000 + " = 1"), ("simulate", "t.toml", "--records", "table.csv", *SIMULATE),
        r"kkk \.\.\. ",
    ),
    "endless rollers": (
        samples("x.npy", np.arange(99.0)), ("import", "x.npy", *IMPORT, "--bearing", "inf,7,39"), "unknown bearing",
    ),
    "overflow": (samples("x.npy", 9 * np.arange(99.0)), ("import", "x.npy", *IMPORT, "--scale", 1e308), "is inf"),
    "beyond measuring": (
        set_of_one_value, ("rul", "flat", "--healthy-rows", 8, "--out", "new.csv"), "reach 1e.300",
    ),
    "no parts": (lambda _: None, ("study", "public", "--parts", ",", "--out", "new", "--no-track"), "names no part"),
    # servers
    "no database": (
        lambda _: None, ("gap", "set", *GAP[:3], "--out", "new", "--tracking-uri", "postgresql://x@127.0.0.1:1/x"),
        "tracking store",
    ),
    "no certificate": (
        lambda _: None, ("fleet", "set", *GAP, "--backend", "dask", "--address", "tls://127.0.0.1:1"), "no dask sched",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_odd_input_is_refused_in_one_line(twingap: Forks, inputs: Path, tmp_path: Path, name: str) -> None:
    make, words, reason = CASES[name]
    for each in ("twin.toml", "table.csv"):
        shutil.copy(inputs / each, tmp_path / each)
    shutil.copytree(inputs / "set", tmp_path / "set")
    make(tmp_path)
    before = everything(tmp_path)
    said = twingap(tmp_path, *words, timeout_s=300)
    line = said.refused()
    assert re.search(reason, line), line
    assert len(line) < 2000 and line.isprintable()
    assert everything(tmp_path) == before
    assert said.peak_mb < 900 and said.cpu_s < 10, said


def test_variable_that_is_no_number_is_named(twingap: Forks, inputs: Path, tmp_path: Path) -> None:
    words = ("fleet", inputs / "fleet", "--twin", inputs / "twin.toml", "--no-track", "--out", "new")
    said = twingap(tmp_path, *words, env={"LOKY_MAX_CPU_COUNT": "many"})
    assert "LOKY_MAX_CPU_COUNT" in said.refused()


def test_names_of_records_are_no_paths(twingap: Forks, inputs: Path, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("record,speed_rpm,fault\n../../out,1500,inner\n/tmp/out,1500,inner\n")
    said = twingap(tmp_path, "simulate", inputs / "twin.toml", "--records", "t.csv", *SIMULATE)
    assert said.status == 0
    samples = {path for path in everything(tmp_path) if path.endswith(".npy")}
    assert samples == {"new/samples/0000/000000.npy", "new/samples/0000/000001.npy"}


def test_file_with_thousands_of_channels_is_walked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    h5py = pytest.importorskip("h5py")
    from twingap.records.formats import hdf5
    from twingap.records.samples import inspect

    with h5py.File(tmp_path / "x.h5", "w") as file:
        for i in range(300):
            file[f"d{i}"] = [float(i), 1.0]
    walks = 0

    class Counted(hdf5._Walk):
        def __init__(self, *arguments: object) -> None:
            nonlocal walks
            walks += 1
            super().__init__(*arguments)

    monkeypatch.setattr(hdf5, "_Walk", Counted)
    found = inspect(tmp_path / "x.h5")
    assert {channel.name: channel.load()[0] for channel in found.channels} == {f"d{i}": float(i) for i in range(300)}
    assert walks <= 2
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["d7"] = [-1.0, 0.0, 0.0]
    assert inspect(tmp_path / "x.h5").find("d7").load()[0] == -1.0


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&-"])
def test_closed_streams_are_no_error(tmp_path: Path, closed: str) -> None:
    ended = subprocess.run(
        ["bash", "-c", f'"$0" -m twingap.cli bearings {closed}', sys.executable], cwd=tmp_path, capture_output=True,
        text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )  # fmt: skip
    assert (ended.returncode, ended.stderr) == (0, "")
