"""Files and folders appear whole or not at all, whatever ends the writing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from twingap.errors import TwingapError
from twingap.files import kind_of, replacing, replacing_folder, save_npy, sha256, try_folder, try_outputs

BOTH = pytest.mark.parametrize("place", [replacing, replacing_folder])


def _tree(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "deep er" / "größe.csv"
    with replacing(target) as temporary:
        assert temporary.suffix == ".csv"  # writers go by it
        temporary.write_text("a")
        assert not target.exists()
    assert target.read_text() == "a"
    with replacing(target) as temporary:
        temporary.write_text("b")
        assert target.read_text() == "a"
    assert target.read_text() == "b"
    assert _tree(tmp_path) == ["deep er", "deep er/größe.csv"]


def test_a_folder_appears_when_it_is_whole(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("new/er", "empty"):
        with replacing_folder(tmp_path / name) as temporary:
            (temporary / "x").write_text("a")
            assert not (tmp_path / name / "x").exists()
        assert (tmp_path / name / "x").read_text() == "a"
    assert _tree(tmp_path) == ["empty", "empty/x", "new", "new/er", "new/er/x"]


def test_results_are_as_readable_as_other_files(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        with replacing(tmp_path / "x") as temporary:
            temporary.write_text("a")
        with replacing_folder(tmp_path / "y"):
            pass
    finally:
        os.umask(old)
    assert (tmp_path / "x").stat().st_mode & 0o777 == 0o640
    assert (tmp_path / "y").stat().st_mode & 0o777 == 0o750


@BOTH
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_a_failure_leaves_nothing(tmp_path: Path, place: type, error: type[BaseException]) -> None:
    with pytest.raises(error), place(tmp_path / "a" / "b" / "c") as temporary:
        (temporary / "x" if temporary.is_dir() else temporary).write_text("half")
        raise error
    assert _tree(tmp_path) == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere file names must be Unicode")
@BOTH
def test_a_name_that_is_not_unicode(tmp_path: Path, place: type) -> None:
    target = tmp_path / os.fsdecode(b"gr\xfc\xdfe")
    with place(target):
        pass
    assert [os.fsencode(path.name) for path in tmp_path.iterdir()] == [b"gr\xfc\xdfe"]


def test_a_failure_leaves_the_last_good_state(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("good")
    with pytest.raises(ValueError), replacing(tmp_path / "x") as temporary:
        temporary.write_text("half")
        raise ValueError
    assert (tmp_path / "x").read_text() == "good"
    assert _tree(tmp_path) == ["x"]


def test_a_folder_that_holds_something_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").write_text("mine")
    (tmp_path / "file").write_text("mine")
    for name in ("full", "file"):
        with (
            pytest.raises(TwingapError, match="exists already and is not an empty folder; name a new folder"),
            replacing_folder(tmp_path / name),
        ):
            raise AssertionError("too late")
    assert _tree(tmp_path) == ["file", "full", "full/x"]


@BOTH
@pytest.mark.parametrize("name", ["x", "sub/x"])
def test_a_file_where_a_folder_should_be(tmp_path: Path, place: type, name: str) -> None:
    (tmp_path / "file").write_text("mine")
    with (
        pytest.raises(TwingapError, match=r"file: is not a folder, a folder expected; name another place"),
        place(tmp_path / "file" / name),
    ):
        raise AssertionError("too late")
    assert _tree(tmp_path) == ["file"]


def test_folders_and_devices_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="is a folder, a file expected"), replacing(tmp_path):
        pass
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(TwingapError, match="is not a regular file"), replacing(tmp_path / "pipe"):
        pass
    with pytest.raises(TwingapError, match="is no file name"), replacing(tmp_path / "a\0b"):
        pass
    with pytest.raises(TwingapError, match="cannot be written: File name too long"), replacing(tmp_path / ("x" * 300)):
        pass


def test_what_lies_at_a_path(tmp_path: Path) -> None:
    (tmp_path / "x").touch()
    os.mkfifo(tmp_path / "pipe")
    kinds = {".": "folder", "x": "file", "pipe": "other", "y": "missing", "x/y": "missing"}
    assert {name: kind_of(tmp_path / name) for name in kinds} == kinds
    with pytest.raises(TwingapError, match="cannot be read: File name too long"):
        kind_of(tmp_path / ("x" * 300))
    with pytest.raises(TwingapError, match="is no file name"):
        kind_of(tmp_path / "a\0b")


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    with replacing(tmp_path / "link") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


@BOTH
@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_no_permission(tmp_path: Path, place: type) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(TwingapError, match="cannot be written: Permission denied"), place(tmp_path / "locked" / "x"):
        pass


def test_an_error_about_another_file_names_that_file(tmp_path: Path) -> None:
    with (
        pytest.raises(TwingapError, match=r"other/gone.txt: cannot be used: No such file"),
        replacing(tmp_path / "x"),
    ):
        (tmp_path / "other" / "gone.txt").read_text()
    assert _tree(tmp_path) == []


PROGRAM = """
import resource, signal, sys
from pathlib import Path
from twingap.errors import TwingapError
from twingap.files import kind_of, replacing, replacing_folder

place, target, how = sys.argv[1:]
if how == "full":
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    with {"file": replacing, "folder": replacing_folder}[place](target) as temporary:
        out = temporary / "x" if temporary.is_dir() else temporary
        out.write_bytes(bytes(100_000 if how == "full" else 10))
        print("writing", flush=True)
        signal.pause()
except TwingapError as error:
    print(error)
"""


@pytest.mark.parametrize("place", ["file", "folder"])
def test_a_full_disk_leaves_nothing_and_is_told(tmp_path: Path, place: str) -> None:
    # A limit on the size of files stands in for the disk: both make the system refuse a write midway.
    command = [sys.executable, "-c", PROGRAM, place, str(tmp_path / "a" / "x"), "full"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == f"{tmp_path / 'a' / 'x'}: cannot be written: File too large; " + (
        "choose a folder that is writable and has space\n"
    )
    assert _tree(tmp_path) == []


@pytest.mark.parametrize("place", ["file", "folder"])
def test_an_interruption_leaves_nothing(tmp_path: Path, place: str) -> None:
    command = [sys.executable, "-c", PROGRAM, place, str(tmp_path / "a" / "x"), "interrupted"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "writing\n"
        assert _tree(tmp_path) != []
        program.send_signal(signal.SIGINT)
        _, trace = program.communicate(timeout=60)
    assert "KeyboardInterrupt" in trace
    assert _tree(tmp_path) == []


@pytest.mark.parametrize("shape", [(0,), (7,), (3, 4)])
@pytest.mark.parametrize("dtype", ["<f8", ">f4", "i2"])
def test_arrays_are_written_as_numpy_writes_them(tmp_path: Path, shape: tuple[int, ...], dtype: str) -> None:
    array = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    save_npy(tmp_path / "a.npy", array)
    np.save(tmp_path / "b.npy", array)
    assert sha256(tmp_path / "a.npy") == sha256(tmp_path / "b.npy")


def test_sha256(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"abc")
    assert sha256(tmp_path / "x") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2


def test_a_folder_is_tried_and_left_as_it_was(tmp_path: Path) -> None:
    try_folder(tmp_path / "new")
    assert _tree(tmp_path) == ["new"]
    (tmp_path / "file").write_text("kept")
    with pytest.raises(TwingapError, match="a folder expected"):
        try_folder(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "kept"


def test_outputs_are_tried_and_nothing_is_left(tmp_path: Path) -> None:
    try_outputs(tmp_path / "new" / "out", ["a.json", "b.html"], ["set"])
    assert _tree(tmp_path) == []
    (tmp_path / "out" / "set").mkdir(parents=True)
    (tmp_path / "out" / "a.json").write_text("old")
    try_outputs(tmp_path / "out", ["a.json"], ["set"])
    (tmp_path / "out" / "set" / "mine").touch()
    before = _tree(tmp_path)
    with pytest.raises(TwingapError, match="set: exists already and is not an empty folder"):
        try_outputs(tmp_path / "out", ["a.json"], ["set"])
    assert _tree(tmp_path) == before and (tmp_path / "out" / "a.json").read_text() == "old"
