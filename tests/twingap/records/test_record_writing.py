"""Record sets are streamed to disk in bounded memory, and appear whole or not at all."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.records.folder import read_record_set, write_record_set, write_records

BEARING = BEARINGS["6205"]
X = np.sin(np.arange(50.0))


def _condition(i: int, **more: Any) -> Condition:
    return Condition(f"r{i}", 1800.0, 12000.0, **{"n_samples": X.size, **more})


def _set(conditions: list[Condition]) -> RecordSet:
    rng = np.random.default_rng(0)
    records = (Record(c, rng.standard_normal(c.n_samples)) for c in conditions)
    return RecordSet.from_records("a set", "g", BEARING, records)


@pytest.mark.parametrize(
    ("records", "reason"),
    [
        ([], "record set 'n': holds no records"),
        ([Record(_condition(1), X), Record(_condition(1), X)], "record 'r1': appears twice"),
        ([Record(_condition(1), X), Record(_condition(2), X * np.nan)], "record 'r2': sample 0 is nan, finite"),
        ([Record(replace(_condition(1), name=" r1"), X)], "name ' r1' is empty or has surrounding space"),
        ([Record(_condition(1, group=""), X)], "group '' is empty or has surrounding space"),
        ([Record(_condition(1, extra={"file": 1}), X)], "extra column 'file' has a name that is taken"),
        ([Record(_condition(1, extra={"a": [1]}), X)], "record 'r1', a: [1] does not fit a table; use text, a number"),
        (
            [Record(_condition(1, extra={"a": "x" * 200_000}), X)],
            "record 'r1', a: str of such length does not fit a table",
        ),
        ([Record(_condition(1, extra={"a": 10**5000}), X)], "record 'r1', a: int of such length does not fit"),
        ([Record(_condition(1, extra={"a": "\ud800"}), X)], "text that is not Unicode"),
    ],
)
def test_what_could_not_be_read_back_is_not_written(tmp_path: Path, records: list[Record], reason: str) -> None:
    with pytest.raises(TwingapError) as caught:
        write_records(tmp_path / "a" / "set", "n", "g", None, None, records)
    assert reason in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_stream_that_fails_halfway_leaves_nothing(tmp_path: Path) -> None:
    def stream() -> Iterator[Record]:
        yield Record(_condition(1), X)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_records(tmp_path / "a" / "set", "n", "g", None, 12000.0, stream())
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").touch()
    with pytest.raises(TwingapError, match="exists already and is not an empty folder"):
        write_records(tmp_path / "full", "n", "g", None, 12000.0, stream())
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["mine"]


def test_streams_are_written_and_read_in_bounded_memory(tmp_path: Path) -> None:
    n, length = 300, 12_000
    one = 8 * length

    def stream() -> Iterator[Record]:
        for i in range(n):
            yield Record(_condition(i, n_samples=length), np.full(length, float(i)))

    write_records(tmp_path / "warm", "n", "g", BEARING, 12000.0, [next(stream())])
    read_record_set(tmp_path / "warm")[0]  # so that no import is counted
    tracemalloc.start()
    try:
        write_records(tmp_path / "set", "n", "g", BEARING, 12000.0, stream())
        assert tracemalloc.get_traced_memory()[1] < 6 * one
        peaks = []
        for _ in range(2):  # Python's own table of names may grow by megabytes in one of them
            tracemalloc.reset_peak()
            before = tracemalloc.get_traced_memory()[0]
            records = read_record_set(tmp_path / "set")
            total = sum(float(record.samples[0]) for record in records)
            peaks.append(tracemalloc.get_traced_memory()[1] - before)
            del records
        # Conditions and paths of all records, about 2 kB each, and a record or two.
        assert min(peaks) < 4 * one + 2500 * n
    finally:
        tracemalloc.stop()
    assert total == sum(range(n))


def test_many_records_are_spread_over_folders(tmp_path: Path) -> None:
    write_records(tmp_path / "s", "n", "", None, None, (Record(_condition(i, n_samples=1), X[:1]) for i in range(1001)))
    assert sorted(p.name for p in (tmp_path / "s" / "samples").iterdir()) == ["0000", "0001"]
    assert len(read_record_set(tmp_path / "s")) == 1001


WRITER = """
import sys, time
import numpy as np
from twingap import Condition, Record
from twingap.records.folder import write_records

def stream():
    for i in range(10**6):
        yield Record(Condition(f"r{i}", 1800.0, 12000.0, 100), np.ones(100))
        if i == 20:
            print("writing", flush=True)
        if i > 20:
            time.sleep(0.01)

write_records(sys.argv[1], "n", "g", None, None, stream())
"""


def test_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITER, str(tmp_path / "a" / "set")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "writing\n"
        assert len(list(tmp_path.rglob("*.npy"))) > 10
        program.send_signal(signal.SIGINT)
        assert program.wait(timeout=60) != 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("limit", [10, 200, 5000, 90_000])
def test_a_full_disk_while_streaming(tmp_path: Path, limit: int) -> None:
    # A limit on the size of files stands in for the disk. Little or much of a file may be missing.
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    records = _set([_condition(0, n_samples=12_000)] if limit > 1000 else [_condition(0)])
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(TwingapError, match=r"set: cannot be written: .*; choose a folder that is writable and has"):
            write_record_set(records, tmp_path / "set")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []
