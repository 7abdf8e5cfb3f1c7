"""Sample files: each format holds what was put in, and whatever is wrong with one is said in one line."""

from __future__ import annotations

import os
import pickle
import tempfile
import tracemalloc
import wave
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.io import loadmat, savemat, wavfile

from twingap.errors import TwingapError
from twingap.records.samples import SUFFIXES, inspect, load

Array = NDArray[np.float64]
X = np.sin(np.arange(200.0))


def _write_csv(path: Path, x: Array) -> None:
    path.write_text("\n".join(map(repr, x.tolist())))


def _write_parquet(path: Path, x: Array) -> None:
    pd.DataFrame({"x": x}).to_parquet(path)


WRITERS: dict[str, Callable[[Path, Array], None]] = {
    ".npy": np.save,
    ".npz": lambda path, x: np.savez(path, x=x),
    ".mat": lambda path, x: savemat(path, {"x": x}),
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".wav": lambda path, x: wavfile.write(path, 12000, x),
    **dict.fromkeys((".txt", ".tsv", ".asc", ".dat", ".lvm"), _write_csv),
}
OPTIONAL = (".h5", ".hdf5", ".tdms", ".uff", ".unv", ".mf4")
"""Suffixes that need the extra twingap[formats]; see test_optional_formats.py."""


def test_every_format_is_written_here() -> None:
    assert {*WRITERS, *OPTIONAL} == set(SUFFIXES)


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("name", ["a", "Messung 1 – Außenring 轴承", "A"])
def test_one_vector_comes_back_to_the_last_bit(tmp_path: Path, suffix: str, name: str) -> None:
    path = tmp_path / (name + suffix)
    WRITERS[suffix](path, X)
    if name == "A":
        path = path.rename(tmp_path / ("A" + suffix.upper()))
    found = inspect(path).find()
    assert found.n_samples == X.size
    samples = found.load()
    assert samples.dtype == np.float64
    np.testing.assert_array_equal(samples, X)
    samples[:] = 0  # a copy of the caller's own
    np.testing.assert_array_equal(load(path), X)


@pytest.mark.parametrize("suffix", WRITERS)
def test_one_sample_and_constant_vectors_are_records_too(tmp_path: Path, suffix: str) -> None:
    for x in (np.array([0.25]), np.full(50, 0.25)):
        WRITERS[suffix](tmp_path / f"x{suffix}", x)
        np.testing.assert_array_equal(load(tmp_path / f"x{suffix}"), x)


@pytest.mark.parametrize("dtype", ["f2", "f4", ">f8", "i1", "<i2", ">i4", "u8", "g"])
def test_real_types_become_float64(tmp_path: Path, dtype: str) -> None:
    x = np.arange(5).astype(dtype)
    np.save(tmp_path / "x.npy", x)
    np.savez_compressed(tmp_path / "x.npz", x=x)
    for path in (tmp_path / "x.npy", tmp_path / "x.npz"):
        np.testing.assert_array_equal(load(path), np.arange(5.0), strict=True)


def test_keyed_files_are_read_by_key(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", de=X, fe=2 * X, rpm=1797.0, note="free text")
    savemat(tmp_path / "a.mat", {"de": X, "fe": 2 * X, "rpm": 1797.0, "note": "free text"}, do_compression=True)
    for path in (tmp_path / "a.npz", tmp_path / "a.mat"):
        np.testing.assert_array_equal(load(path, "fe"), 2 * X)
        with pytest.raises(TwingapError, match=r"holds 4 channels and none is named; name one of de, fe, rpm, note"):
            load(path)
        with pytest.raises(TwingapError, match=r"has no channel 'BA'; it has de, fe, rpm, note"):
            load(path, "BA")
        with pytest.raises(TwingapError, match="has no channel '0'"):  # a key, never an index
            load(path, "0")
        with pytest.raises(TwingapError, match="real numbers expected"):
            load(path, "note")


def test_single_numbers_beside_one_vector_are_no_second_vector(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"z": X, "rpm": 1797.0})
    np.testing.assert_array_equal(load(tmp_path / "a.mat"), X)


def test_columns_are_read_by_name_or_index(tmp_path: Path) -> None:
    table = pd.DataFrame({"t": np.arange(200.0), "acc x": X, "note": ["text"] * 200})
    table.to_csv(tmp_path / "a.csv", index=False)
    table.to_parquet(tmp_path / "a.parquet")
    for path in (tmp_path / "a.csv", tmp_path / "a.parquet"):
        np.testing.assert_array_equal(load(path, "acc x"), X)
        np.testing.assert_array_equal(load(path, "1"), X)
        for wrong in ("3", "acc y", "-1", "9" * 5000):
            with pytest.raises(TwingapError, match=r"has no channel .*; it has t, acc x, note"):
                load(path, wrong)
        with pytest.raises(TwingapError, match="note"):
            load(path, "note")
    np.save(tmp_path / "a.npy", np.column_stack([X, 2 * X, 3 * X]))
    np.testing.assert_array_equal(load(tmp_path / "a.npy", "2"), 3 * X)
    with pytest.raises(TwingapError, match="name one of 0, 1, 2"):
        load(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.column_stack([X, 2 * X, 3 * X])[:3])  # short, but not on its side
    np.testing.assert_array_equal(load(tmp_path / "a.npy", "2"), 3 * X[:3])
    np.save(tmp_path / "a.npy", np.column_stack([X, 2 * X, 3 * X]).T)
    with pytest.raises(TwingapError, match="has 200 columns of 3 samples"):
        load(tmp_path / "a.npy", "0")
    np.testing.assert_array_equal(load(tmp_path / "a.npy", "row 1"), 2 * X)
    wavfile.write(tmp_path / "a.wav", 8000, np.column_stack([X, 2 * X]))
    np.testing.assert_array_equal(load(tmp_path / "a.wav", "1"), 2 * X)


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".mat"])
@pytest.mark.parametrize("shape", [(200, 1), (1, 200), (1, 200, 1)])
def test_a_vector_may_be_a_row_or_a_column(tmp_path: Path, suffix: str, shape: tuple[int, ...]) -> None:
    WRITERS[suffix](tmp_path / f"x{suffix}", X.reshape(shape))
    np.testing.assert_array_equal(load(tmp_path / f"x{suffix}"), X)


@pytest.mark.parametrize(
    "text",
    [
        "x\n1\n2.5\n-3e2\n",
        "1\n2.5\n-3e2",
        "\ufeffx\r\n1\r\n2.5\r\n-3e2\r\n",
        "\n\nx\n1\n\n2.5\n-3e2\n\n\n",
        '"x"\n"1"\n"2.5"\n"-3e2"\n',
        "x\n 1\n2.5 \n-3e2\n",
        "x\r1\r2.5\r-3e2\r",
    ],
    ids=["header", "no header", "BOM and CRLF", "blank lines", "quoted", "spaces", "old Mac"],
)
def test_csv_dialects(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.csv").write_bytes(text.encode())
    np.testing.assert_array_equal(load(tmp_path / "x.csv"), [1.0, 2.5, -300.0])


@pytest.mark.parametrize(
    ("text", "channel", "samples"),
    [
        ("0,1\n0.0,-1.5\n1e-05,2.5\n", "1", [-1.5, 2.5]),  # as pandas writes columns without names
        ("0,1,2\n,-1.5,1.0\nnan,2.5,2.0\n", "1", [-1.5, 2.5]),
        (",0\n0,-1.5\n1,2.5\n", "0", [-1.5, 2.5]),  # and with its index
        ("t,0,1\n0.0,3.0,-1.5\n0.1,4.0,2.5\n", "1", [-1.5, 2.5]),
        ("# 0,1\n0,-1.5\n1,2.5\n", "1", [-1.5, 2.5]),  # as NumPy writes a header
        ("-x,+y (m/s^2)\n0,-1.5\n1,2.5\n", "1", [-1.5, 2.5]),
        ("0,-1.5\n1,2.5\n", "1", [-1.5, 2.5]),
        ("0.0,1.0\n0.5,2.5\n", "1", [1.0, 2.5]),
        ("0\n1\n2.5\n", None, [0.0, 1.0, 2.5]),
        ("0\n", None, [0.0]),
        ("0.0\n2.5\n", None, [0.0, 2.5]),
        (",0\n,2.5\n", "1", [0.0, 2.5]),
        ("1.5,\n2.5,\n", "0", [1.5, 2.5]),
    ],
)
def test_a_csv_neither_loses_nor_gains_a_row(
    tmp_path: Path, text: str, channel: str | None, samples: list[float]
) -> None:
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    np.testing.assert_array_equal(load(tmp_path / "x.csv", channel), samples)


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("index", [False, True])
def test_tables_without_names_come_back_from_pandas(tmp_path: Path, columns: int, index: bool) -> None:
    whole = np.random.default_rng(columns).normal(size=(3000, columns))
    pd.DataFrame(whole).to_csv(tmp_path / "x.csv", index=index)
    for i in range(columns):
        np.testing.assert_array_equal(load(tmp_path / "x.csv", str(i)), whole[:, i])


@pytest.mark.parametrize(
    ("text", "channel", "reason"),
    [
        ("x\n1\ntwo\n", None, "line 3, column x: 'two' found, a number expected"),
        ("1\n1_000\n", None, "line 2, column 0: '1_000' found"),
        ("x,y\n1,2\n,3\n", "x", "line 3, column x: is empty"),
        ("x,y\n1,2\n3\n", "x", "line 3: has 1 fields, 2 expected"),
        (
            "x\n0,5\n0,3\n",
            None,
            "line 2: has 2 fields, 1 expected; write decimal points: a comma separates fields here",
        ),
        ("x;y\n1;2\n", None, "holds 2 channels and none is named; name one of x, y"),
        ("x,x\n1,2\n", "x", "has 2 channels 'x'; give the column's index"),
        ("x\n1\nnan\n", None, "channel x: sample 1 is nan, finite samples expected"),
        ("1e999\n", None, "sample 0 is inf"),
        ("x\n", None, "is empty, at least 1 sample expected"),
        ("", None, "holds no samples"),
        ("\n\n", None, "holds no samples"),
        ("\n2024-01-01 00:00:00,1.5\n2024-01-01 00:00:01,2.5\n", "1", "line 2: '2024-01-01 00:00:00' is neither"),
        ("ok,1.5\nok,2.5\n", "1", "line 1: mixes numbers ('1.5') and text ('ok'); put a row of column names first"),
        ("ok,0\nok,1\n", "1", "line 1: mixes numbers ('0') and text ('ok')"),
        ("1_000\n2\n", None, "line 1: '1_000' is neither"),
        ("\u22121.5\n2\n", None, "line 1: '\u22121.5' is neither"),
        ('"1,234.5"\n2\n', None, "line 1: '1,234.5' is neither"),
        (".5V\n.6V\n", None, "line 1: '.5V' is neither"),
        ("- 1.5\n2\n", None, "line 1: '- 1.5' is neither"),
        ("-nan(ind)\n2\n", None, "line 1: '-nan(ind)' is neither"),
        ("NA\n2\n", None, "line 1: 'NA' is neither"),
        ("--\n2\n", None, "line 1: '--' is neither"),
        ("0,1\n5,7\n6,8\n", "1", "line 1: '0,1' may be the names of columns or samples; put a row of names first"),
        ("0,1\n0.001,0.99\n0.002,0.98\n", "1", "line 1: '0,1' may be"),  # cosine over time, as %g writes them
        ("0,1,2\n", "1", "line 1: '0,1,2' may be"),
        ("0\n1.25\n2.25\n", None, "line 1: '0' may be"),
        (",10\n0,1.5\n1,2.5\n", "1", "line 1: ',10' may be"),
    ],
)
def test_csv_faults_name_their_line(tmp_path: Path, text: str, channel: str | None, reason: str) -> None:
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    with pytest.raises(TwingapError) as caught:
        load(tmp_path / "x.csv", channel)
    assert str(tmp_path / "x.csv") in str(caught.value)
    assert reason in str(caught.value)


def _wav(path: Path, raw: bytes, width: int) -> None:
    with wave.open(str(path), "wb") as stream:
        stream.setnchannels(1)
        stream.setsampwidth(width)
        stream.setframerate(12000)
        stream.writeframes(raw)


def test_integer_wav_is_scaled_to_full_scale_one(tmp_path: Path) -> None:
    x = np.array([-1.0, -0.5, 0.0, 0.25, 0.5])
    _wav(tmp_path / "8.wav", (128 + 128 * x).astype("u1").tobytes(), 1)
    _wav(tmp_path / "16.wav", (2**15 * x).astype("<i2").tobytes(), 2)
    _wav(tmp_path / "24.wav", b"".join(int(2**23 * v).to_bytes(3, "little", signed=True) for v in x), 3)
    _wav(tmp_path / "32.wav", (2**31 * x).astype("<i4").tobytes(), 4)
    for width in (8, 16, 24, 32):
        assert inspect(tmp_path / f"{width}.wav").fs_hz == 12000
        np.testing.assert_array_equal(load(tmp_path / f"{width}.wav"), x)


def _resized(path: Path, form: int | None = None, data: int | None = None, cut: int = 0) -> None:
    """A recording of 200 samples, less the last bytes, whose header states other sizes."""
    _wav(path, bytes(400), 2)
    raw = bytearray(path.read_bytes()[: 444 - cut])
    raw[4:8] = (len(raw) - 8 if form is None else form).to_bytes(4, "little")
    if data is not None:
        raw[40:44] = data.to_bytes(4, "little")
    path.write_bytes(raw)


@pytest.mark.parametrize(
    ("sizes", "reason"),
    [
        ({"cut": 100}, "is truncated: 100 bytes are missing; copy or write it again"),
        ({"cut": 100, "form": 436}, "is truncated: 100 bytes are missing"),
        ({"data": 402}, "is truncated: 2 bytes are missing"),
        ({"form": 0, "data": 0}, "does not say how many samples it holds, as recorders leave it that crash"),
        ({"form": 36, "data": 0}, "does not say how many samples it holds"),
        ({"form": 2**32 - 1, "data": 2**32 - 1}, "does not say how many samples it holds"),
        ({"data": 2**32 - 1}, "does not say how many samples it holds"),
        ({"cut": 408}, "ends before its samples begin"),
        ({"cut": 400, "data": 0}, "is empty, at least 1 sample expected"),
    ],
)
def test_a_wav_that_does_not_hold_what_it_states_is_refused(tmp_path: Path, sizes: dict[str, int], reason: str) -> None:
    _resized(tmp_path / "x.wav", **sizes)
    with pytest.raises(TwingapError) as caught:
        load(tmp_path / "x.wav")
    assert str(caught.value).startswith(f"{tmp_path / 'x.wav'}")
    assert reason in str(caught.value)


@pytest.mark.parametrize("tail", [b"LIST\x04\0\0\0abcd", b"bext\x03\0\0\0abc\0", b"ab"])
def test_what_recorders_add_to_a_wav_is_of_no_concern(tmp_path: Path, tail: bytes) -> None:
    for stated in (436, 436 + len(tail)):
        _resized(tmp_path / "x.wav", form=436)
        raw = bytearray((tmp_path / "x.wav").read_bytes() + tail)
        raw[4:8] = stated.to_bytes(4, "little")
        (tmp_path / "x.wav").write_bytes(raw)
        assert load(tmp_path / "x.wav").size == 200


def _truncated(suffix: str, keep: float) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        WRITERS[suffix](path, X)
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * keep)])

    return make


def _mat_73(path: Path) -> None:
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" ") + b"\x89HDF\r\n\x1a\n" + bytes(600))


FAULTS: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "missing": ("x.npy", lambda path: None, "no such file"),
    "backslash": ("samples\\x.npy", lambda path: None, "no such file; write / between folders"),
    "folder": ("x.npy", lambda path: path.mkdir(), "is a folder, a file expected"),
    "pipe": ("x.csv", os.mkfifo, "is not a regular file"),
    "suffix": ("x.doc", lambda path: path.write_text("1"), "files of type '.doc' are not read; use one of .npy"),
    "no suffix": ("x", lambda path: path.write_text("1"), "files of type '' are not read"),
    "not npy": ("x.npy", lambda path: path.write_text("1,2,3"), "is not a whole .npy file"),
    "nothing.npy": ("x.npy", lambda path: path.write_bytes(b""), "is not a whole .npy file"),
    "cut npy": ("x.npy", _truncated(".npy", 0.5), "is truncated: "),
    "cut npz": ("x.npz", _truncated(".npz", 0.5), "is not a whole .npz file"),
    "cut mat": ("x.mat", _truncated(".mat", 0.5), "x.mat"),
    "cut parquet": ("x.parquet", _truncated(".parquet", 0.5), "x.parquet"),
    "cut wav": ("x.wav", _truncated(".wav", 0.5), "is truncated"),
    "nan": ("x.npy", lambda path: np.save(path, [0, 1, np.nan]), "sample 2 is nan, finite samples expected"),
    "infinite": ("x.npz", lambda path: np.savez(path, x=[0, -np.inf]), "sample 1 is -inf"),
    "empty": ("x.npy", lambda path: np.save(path, np.empty(0)), "is empty, at least 1 sample expected"),
    "empty npz": ("x.npz", lambda path: np.savez(path), "holds no samples"),
    "number": ("x.npy", lambda path: np.save(path, 1.0), "has shape (), one vector expected"),
    "3-D": ("x.npy", lambda path: np.save(path, np.ones((2, 2, 2))), "has shape (2, 2, 2), one vector expected"),
    "complex": ("x.npy", lambda path: np.save(path, [1j]), "holds complex numbers, real numbers expected"),
    "complex mat": ("x.mat", lambda path: savemat(path, {"x": [1j, 2]}), "holds complex numbers, real numbers"),
    "truths": ("x.npy", lambda path: np.save(path, [True]), "holds true/false values"),
    "text": ("x.npy", lambda path: np.save(path, ["a"]), "holds text, real numbers expected"),
    "structured": ("x.npy", lambda path: np.save(path, np.zeros(2, "i4,f8")), "real numbers expected"),
    "objects": ("x.npy", lambda path: np.save(path, np.array([1, None])), "holds pickled objects, which are never"),
    "objects npz": ("x.npz", lambda path: np.savez(path, x=np.array([1, None])), "key 'x' holds pickled objects"),
    "pickle": ("x.npy", lambda path: path.write_bytes(pickle.dumps([1.0])), "holds pickled objects, which are never"),
    "damaged 7.3": ("x.mat", _mat_73, "x.mat"),
    "matrix": ("x.mat", lambda path: savemat(path, {"x": np.ones((3, 4))}), "has shape (3, 4), one vector expected"),
    "struct": ("x.mat", lambda path: savemat(path, {"x": {"y": "text", "z": 1}}), "holds no vector of samples"),
    "binary": ("x.dat", lambda path: path.write_bytes(bytes(range(32)) * 9), "is no text: it holds null bytes"),
    "null": (
        "x.parquet",
        lambda path: pq.write_table(pa.table({"x": pa.array([1.0, None])}), path),
        "channel x: sample 1 is missing",
    ),
    "list": ("x.parquet", lambda path: pq.write_table(pa.table({"x": [["a"]]}), path), "holds values of type list"),
    "rows": (
        "x.npy",
        lambda path: np.save(path, np.zeros((2, 1000))),
        "has 1000 columns of 2 samples, a column per channel expected; transpose it, so that samples run along the",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_whatever_is_wrong_is_said_in_one_line(tmp_path: Path, fault: str) -> None:
    name, make, reason = FAULTS[fault]
    make(tmp_path / name)
    with pytest.raises(TwingapError) as caught:
        load(tmp_path / name)
    line = str(caught.value)
    assert reason in line
    assert line.count(str(tmp_path / name)) == 1
    assert "\n" not in line


class _Trap:
    """Unpickled, makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., None], tuple[str]]:
        return os.mkdir, (str(self.path),)


def test_nothing_is_ever_unpickled(tmp_path: Path) -> None:
    trap = _Trap(tmp_path / "sprung")
    np.save(tmp_path / "a.npy", np.array([trap], dtype=object))
    (tmp_path / "b.npy").write_bytes(pickle.dumps(trap))
    np.savez(tmp_path / "c.npz", x=np.array([trap], dtype=object))
    for name in ("a.npy", "b.npy", "c.npz"):
        with pytest.raises(TwingapError, match="never loaded"):
            load(tmp_path / name)
    assert not trap.path.exists()


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".mat", ".parquet", ".wav", ".csv"])
def test_inspecting_does_not_load(tmp_path: Path, suffix: str) -> None:
    x = np.arange(500_000, dtype=np.float64)
    WRITERS[suffix](tmp_path / f"x{suffix}", x)
    inspect(tmp_path / f"x{suffix}")  # imports
    tracemalloc.start()
    try:
        assert inspect(tmp_path / f"x{suffix}").find().n_samples == x.size
        assert tracemalloc.get_traced_memory()[1] < x.nbytes / 10
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(("byte", "value"), [(176, 255), (176, 8), (177, 200), (145, 0x79)])
def test_a_damaged_mat_file_does_not_end_the_process(tmp_path: Path, byte: int, value: int) -> None:
    # Bytes 176 and 177 are the type of the data, 145 the flag of complex ones; SciPy's own reader crashes on these.
    savemat(tmp_path / "x.mat", {"x": X})
    data = bytearray((tmp_path / "x.mat").read_bytes())
    data[byte] = value
    (tmp_path / "x.mat").write_bytes(data)
    with pytest.raises(TwingapError, match=r"is damaged|complex"):
        load(tmp_path / "x.mat")


@given(
    kind=st.sampled_from(["f8", "f4", "i2", "u1", "c16"]),
    n=st.integers(1, 40),
    compressed=st.booleans(),
    name=st.text("abcdefgh_", min_size=1, max_size=30).filter(lambda s: not s.startswith("_")),
)
@settings(max_examples=60, deadline=None)
def test_mat_files_that_scipy_writes_pass_the_guard(kind: str, n: int, compressed: bool, name: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mat"
        values = np.arange(n).astype(kind)
        savemat(path, {"other": np.array([1j]), name + "1": values, "last": {"a": "b"}}, do_compression=compressed)
        if kind == "c16":
            with pytest.raises(TwingapError, match="complex"):
                load(path, name + "1")
        else:
            np.testing.assert_array_equal(load(path, name + "1"), np.arange(float(n)))


def _whole_files() -> list[tuple[str, bytes]]:
    with tempfile.TemporaryDirectory() as folder:
        made = []
        for suffix, write in WRITERS.items():
            write(Path(folder) / f"x{suffix}", X[:60])
            made.append((suffix, (Path(folder) / f"x{suffix}").read_bytes()))
        savemat(Path(folder) / "c.mat", {"x": X[:60]}, do_compression=True)
        made.append((".mat", (Path(folder) / "c.mat").read_bytes()))
        return made


WHOLE = _whole_files()
EDITS = st.lists(
    st.tuples(st.floats(0, 1), st.integers(0, 255), st.sampled_from(["set", "insert", "delete"])),
    min_size=1,
    max_size=6,
)


@given(whole=st.sampled_from(WHOLE), edits=EDITS, early=st.booleans(), cut=st.floats(0, 2))
@example(whole=WHOLE[0], edits=[(0.0, 0x80, "set")], early=True, cut=2.0)
@settings(max_examples=500, deadline=None)
def test_any_mutation_of_any_file_is_samples_or_one_line(
    whole: tuple[str, bytes], edits: list[tuple[float, int, str]], early: bool, cut: float
) -> None:
    suffix, data = whole
    mutated = bytearray(data)
    for place, value, kind in edits:
        at = int(place * (min(len(mutated), 200) if early else len(mutated)))
        if kind == "set" and at < len(mutated):
            mutated[at] = value
        elif kind == "insert":
            mutated[at:at] = bytes([value])
        else:
            del mutated[at : at + value % 8]
    if cut < 1:
        mutated = mutated[: int(cut * len(mutated))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"x{suffix}"
        path.write_bytes(mutated)
        try:
            samples = load(path)
        except TwingapError as error:
            assert "\n" not in str(error)
            assert str(path) in str(error)
        else:
            assert samples.dtype == np.float64
            assert samples.ndim == 1
            assert samples.size > 0
            assert np.isfinite(samples).all()


@pytest.mark.data
@pytest.mark.skipif("TWINGAP_DATA" not in os.environ, reason="needs real records: set TWINGAP_DATA")
def test_real_recordings_equal_scipy() -> None:
    root = Path(os.environ["TWINGAP_DATA"])
    for name in ("cwru/105.mat", "cwru/99_repacked.mat", "hit_sm/OR2_900.mat"):
        whole = loadmat(root / name)
        for channel in inspect(root / name).channels:
            np.testing.assert_array_equal(channel.load(), whole[channel.name].ravel())
