"""Hostile archives and files: refused in one line, nothing executed, nothing outside the folder, bounded memory."""

from __future__ import annotations

import io
import pickle
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from tests.faults.conftest import FULL, Diagnosed, Forks
from twingap.data.manifest import FilePattern
from twingap.data.unpack import unpack
from twingap.errors import TwingapError

ANY = [FilePattern("small/*.csv")]


def zipped(*members: tuple[str | zipfile.ZipInfo, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return stream.getvalue()


def link(name: str) -> zipfile.ZipInfo:
    """A member that claims to be a symbolic link."""
    info = zipfile.ZipInfo(name)
    info.create_system, info.external_attr = 3, 0o120777 << 16
    return info


def everything(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


@pytest.mark.parametrize("name", ["../out.csv", "/tmp/out.csv", "a/../../../out.csv", "..\\out.csv", "C:\\out.csv"])
def test_archives_write_nothing_outside(tmp_path: Path, name: str) -> None:
    (tmp_path / "all.zip").write_bytes(zipped((name, b"1"), ("in.csv", b"2")))
    unpack(tmp_path / "all.zip", tmp_path / "root" / "small", "small", ANY)
    assert (tmp_path / "root" / "small" / "in.csv").read_bytes() == b"2"
    assert {path.name for path in tmp_path.iterdir()} == {"all.zip", "root"}
    assert not Path("/tmp/out.csv").exists()


def test_links_in_archives_lead_nowhere(tmp_path: Path) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("secret")
    members = [(link("a.csv"), str(secret).encode()), (link("d"), str(tmp_path).encode()), ("d/b.csv", b"3")]
    (tmp_path / "all.zip").write_bytes(zipped(*members, ("in.csv", b"2")))
    try:
        unpack(tmp_path / "all.zip", tmp_path / "root" / "small", "small", ANY)
    except TwingapError as error:
        assert "\n" not in str(error)
    assert not any(path.is_symlink() for path in (tmp_path / "root").rglob("*"))
    assert all(path.read_bytes() != b"secret" for path in (tmp_path / "root").rglob("*.csv"))
    assert everything(tmp_path / "root") <= {"small", "small/in.csv", "small/a.csv", "small/b.csv"}


def test_links_of_unpacking_programs_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from twingap.data import unpack as module

    def extracted(archive: Path, folder: Path) -> None:
        (folder / "a.csv").symlink_to("/etc/passwd")
        (folder / "in.csv").write_bytes(b"2")

    monkeypatch.setattr(module, "_by_program", extracted)
    unpack(tmp_path / "all.rar", tmp_path / "small", "small", ANY)
    assert everything(tmp_path / "small") == {"in.csv"}


def bomb_by_size() -> bytes:
    """A zip file that states more bytes than any disk has."""
    whole = bytearray(zipped(("in.csv", bytes(1000))))
    central = whole.rindex(b"PK\x01\x02")
    struct.pack_into("<I", whole, central + 24, 0xFFFFFFF0)
    copies = whole[central : whole.rindex(b"PK\x05\x06")] * 60000
    end = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, 60000, 60000, len(copies), central, 0)
    return bytes(whole[:central] + copies + end)


def bomb_that_lies() -> bytes:
    """A zip file of 200 MB that states ten bytes."""
    whole = bytearray(zipped(("in.csv", bytes(200_000_000))))
    central = whole.rindex(b"PK\x01\x02")
    struct.pack_into("<I", whole, central + 24, 10)
    struct.pack_into("<I", whole, 22, 10)
    return bytes(whole)


def nested(depth: int) -> bytes:
    """Archives within archives, each under a name of its own."""
    content = zipped(("in.csv", b"2"))
    for level in range(depth):
        content = zipped((f"{level}.zip", content))
    return content


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (bomb_by_size, "unpacks to .* GB, .* are free"),
        (bomb_that_lies, "cannot be unpacked"),
        (lambda: nested(12), "archives within archives"),
        (lambda: zipped(("in.csv", b"1"))[:-30], "cannot be unpacked"),
        (lambda: zipped(("in.csv", bytes(5000))).replace(b"\x4b\x4c", b"\xff\xff"), "cannot be unpacked|none of"),
    ],
)
def test_bombs_are_refused(tmp_path: Path, content: Callable[[], bytes], reason: str) -> None:
    (tmp_path / "all.zip").write_bytes(content())
    try:
        unpack(tmp_path / "all.zip", tmp_path / "small", "small", ANY)
    except TwingapError as error:
        assert "\n" not in str(error)
        assert not everything(tmp_path / "small")
    else:
        assert reason.endswith("none of")


class Code:
    """Runs a command when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> Any:
        return Path.touch, (self.mark,)


def _npy_of_objects(path: Path, mark: Path) -> None:
    np.save(path, np.array([Code(mark)], dtype=object), allow_pickle=True)


def _npz_of_objects(path: Path, mark: Path) -> None:
    np.savez(path, x=np.array([Code(mark)], dtype=object))


def _pickle(path: Path, mark: Path) -> None:
    path.write_bytes(pickle.dumps(Code(mark)))


def _hdf5_of_pickles(path: Path, mark: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=np.void(pickle.dumps(Code(mark))))


@pytest.mark.parametrize(
    ("suffix", "write"),
    [
        (".npy", _npy_of_objects),
        (".npz", _npz_of_objects),
        *((suffix, _pickle) for suffix in (".npy", ".npz", ".mat", ".h5", ".parquet", ".csv", ".dat", ".wav")),
        (".h5", _hdf5_of_pickles),
    ],
)
def test_nothing_is_unpickled(twingap: Forks, tmp_path: Path, suffix: str, write: Callable[[Path, Path], None]) -> None:
    write(tmp_path / f"x{suffix}", tmp_path / "mark")
    refused_import(twingap, tmp_path, f"x{suffix}")
    assert not (tmp_path / "mark").exists()


HUGE = 2**31


def _npy(path: Path) -> None:
    header = np.lib.format.header_data_from_array_1_0(np.zeros(1))
    with path.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, {**header, "shape": (HUGE,)})
        stream.truncate(stream.tell() + 8 * HUGE)  # sparse: the samples are really there


def _npz(path: Path) -> None:
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (HUGE,)})
    path.write_bytes(zipped(("x.npy", member.getvalue() + bytes(1 << 20))))


def _npz_header(path: Path) -> None:
    """A member whose header is longer than any: 50 MB that take 50 kB."""
    start = b"\x93NUMPY\x02\x00" + struct.pack("<I", 50_000_000) + b"{'descr': '<f8', 'shape': ("
    path.write_bytes(zipped(("x.npy", start + b" " * 50_000_000)))


def _wav(path: Path) -> None:
    n = 2**32 - 100
    head = struct.pack(
        "<4sI4s4sIHHIIHH4sI", b"RIFF", n, b"WAVE", b"fmt ", 16, 1, 1, 12000, 12000, 1, 8, b"data", n - 36
    )
    with path.open("wb") as stream:
        stream.write(head)
        stream.truncate(len(head) + n - 36)


def _mat(path: Path) -> None:
    savemat(path, {"x": np.zeros(100)})
    whole = bytearray(path.read_bytes())
    struct.pack_into("<i", whole, whole.index(struct.pack("<ii", 1, 100)) + 4, 2**31 - 1)
    path.write_bytes(whole)


def _mat_bomb(path: Path) -> None:
    """A compressed variable of 2.4 GB in some MB."""
    shape = struct.pack("<ii", 1, 300_000_000)
    name = struct.pack("<II4s4x", 1, 1, b"x")
    head = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<II", 5, 8) + shape + name[:8] + b"x" + bytes(7)
    size = len(head) + 8 + 8 * 300_000_000
    packer = zlib.compressobj(1)
    parts = [packer.compress(struct.pack("<II", 14, size) + head + struct.pack("<II", 9, 8 * 300_000_000))]
    parts += [packer.compress(bytes(1 << 20)) for _ in range(100)]
    data = b"".join([*parts, packer.flush()])
    path.write_bytes(b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(data)) + data)


def _hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_dataset("x", shape=(HUGE,), dtype="f8", chunks=(1 << 16,), compression="gzip")


def _parquet(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    column = pa.array(np.zeros(10_000_000, "int8"))
    with pq.ParquetWriter(path, pa.schema([("x", pa.int8())])) as writer:
        for _ in range(30):  # 300 million values in some kilobytes
            writer.write_table(pa.table({"x": column}))


def _csv(path: Path) -> None:
    path.write_bytes(b"x\n" + b"1" * 30_000_000 + b"\n")


def _columns(path: Path) -> None:
    path.write_bytes(b",".join(b"%d" % i for i in range(1_000_000)) + b"\n")


@pytest.mark.parametrize(
    ("suffix", "write"),
    [
        (".npy", _npy), (".npz", _npz), (".npz", _npz_header), (".wav", _wav), (".mat", _mat), (".mat", _mat_bomb),
        (".h5", _hdf5), *([(".parquet", _parquet)] * FULL), (".csv", _csv), (".csv", _columns),
    ],
)  # fmt: skip
def test_huge_claims_are_refused_with_little_memory(
    twingap: Forks, tmp_path: Path, suffix: str, write: Callable[[Path], None]
) -> None:
    write(tmp_path / f"x{suffix}")
    said = refused_import(twingap, tmp_path, f"x{suffix}")
    assert said.peak_mb < 900 and said.cpu_s < 20, said


def refused_import(twingap: Forks, folder: Path, name: str) -> Any:
    """End of `twingap import`, which refuses the file and writes nothing."""
    before = everything(folder)
    said = twingap(folder, "import", name, "--fs-hz", 12000, "--speed-rpm", 1800, "--out", "new", timeout_s=120)
    assert said.refused()
    assert everything(folder) == before
    return said


def test_names_are_text_in_reports(diagnosed: Diagnosed) -> None:
    page = (diagnosed.out / "report.html").read_text(encoding="utf-8")
    assert "<script>alert(7)" not in page and "&lt;script&gt;alert(7)" in page
