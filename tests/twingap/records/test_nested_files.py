"""Channels within structures: MATLAB's structs and cells, matrices, lists in Parquet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from scipy.sparse import csc_array

from twingap.errors import TwingapError
from twingap.records.samples import inspect, load

X = np.sin(np.arange(300.0))


def _struct_array(*rows: tuple[str, Any]) -> Any:
    y = np.zeros(len(rows), dtype=[("Name", object), ("Data", object)])
    for i, row in enumerate(rows):
        y[i] = row
    return y


NESTED: dict[str, tuple[dict[str, Any], str]] = {
    "field": ({"bearing": {"sr": 12000.0, "gs": X, "load": 270.0}}, "bearing.gs"),
    "named element": ({"N15": {"Y": _struct_array(("force", np.ones(40)), ("vibration_1", X))}}, "N15.Y/vibration_1"),
    "two elements of one name": ({"Y": _struct_array(("a", np.ones(40)), ("a", X))}, "Y[1].Data"),
    "deep": ({"Stock": {"Alpha": {"A1": X, "A2": np.ones((4, 3))}}}, "Stock.Alpha.A1"),
    "cell": ({"c": np.array([np.ones(3), X], dtype=object)}, "c[1]"),
    "column": ({"data": np.stack([-X, X], 1)}, "data[1]"),
    "row": ({"data": np.stack([-X, X], 0)}, "data[row 1]"),
    "column of a field": ({"s": {"data": np.stack([-X, X], 1)}}, "s.data[1]"),
    "long names": ({"s": {"a_name_longer_than_thirty_one_bytes": X}}, "s.a_name_longer_than_thirty_one_bytes"),
}  # fmt: skip


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", NESTED)
def test_a_path_names_a_channel(tmp_path: Path, kind: str, compressed: bool) -> None:
    held, channel = NESTED[kind]
    savemat(tmp_path / "x.mat", held, do_compression=compressed, long_field_names=True)
    np.testing.assert_array_equal(load(tmp_path / "x.mat", channel), X)


def test_channels_are_listed_by_their_paths(tmp_path: Path) -> None:
    savemat(tmp_path / "x.mat", {"Y": _struct_array(("force", np.ones(40)), ("vib", X)), "data": np.stack([X, X], 1)})
    with pytest.raises(
        TwingapError, match=r"name one of Y\[0\]\.Name, Y/force, Y\[1\]\.Name, Y/vib, data\[0\], data\[1\]$"
    ):
        load(tmp_path / "x.mat")
    with pytest.raises(TwingapError, match=r"channel 'data' holds 2 arrays; name one of data\[0\], data\[1\]"):
        load(tmp_path / "x.mat", "data")
    with pytest.raises(TwingapError, match=r"has no channel 'data\[2\]'"):
        load(tmp_path / "x.mat", "data[2]")


BESIDE: dict[str, tuple[Any, str]] = {
    "matrix": (np.stack([X, X, X], 1), r"name one of fs, x\[0\], x\[1\], x\[2\]"),
    "wide matrix": (np.stack([X, X, X], 0), r"x has shape \(3, 300\), one vector expected .*x\[row 0\]"),
    "struct": ({"note": "text"}, r"x\.note holds values of type 'char'"),
    "cell": (np.array(["a", "b"], dtype=object), r"x\[0\] holds values of type 'char'"),
    "sparse": (csc_array(np.eye(9)), "x holds values of type 'sparse'"),
    "text": ("text", "x holds values of type 'char'"),
    "logical": (np.array([True, False]), "x holds true/false values"),
    "complex": (X + 1j, "x holds complex numbers"),
}


@pytest.mark.parametrize("kind", BESIDE)
def test_a_single_number_is_no_record_beside_what_cannot_be_read(tmp_path: Path, kind: str) -> None:
    held, reason = BESIDE[kind]
    savemat(tmp_path / "x.mat", {"fs": 12000.0, "x": held})
    with pytest.raises(TwingapError, match=reason):
        load(tmp_path / "x.mat")


def test_a_vector_beside_a_matrix_is_not_taken_for_the_record(tmp_path: Path) -> None:
    savemat(tmp_path / "x.mat", {"t": np.arange(300.0), "data": np.stack([X, X], 0)})
    with pytest.raises(TwingapError, match="none is named; name one of t, data"):
        load(tmp_path / "x.mat")


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".mat"])
def test_windows_are_no_channels(tmp_path: Path, suffix: str) -> None:
    windows = np.lib.stride_tricks.sliding_window_view(X, 100)
    path, name, column = tmp_path / f"x{suffix}", "w[row 7]", "w[7]"
    if suffix == ".npy":
        np.save(path, windows)
        name, column = "row 7", "7"
    elif suffix == ".npz":
        np.savez(path, w=windows)
    else:
        savemat(path, {"w": windows})
    for channel in (None, column):
        with pytest.raises(
            TwingapError, match=r"has 100 columns of 201 samples, which are windows rather than channels"
        ):
            load(path, channel)
    np.testing.assert_array_equal(load(path, name), windows[7])
    with pytest.raises(TwingapError, match="it has 201 rows"):
        load(path, name.replace("7", "201"))


def test_lists_in_parquet_are_read(tmp_path: Path) -> None:
    pq.write_table(pa.table({"x": [X.tolist()], "n": [1]}), tmp_path / "one.parquet")
    np.testing.assert_array_equal(load(tmp_path / "one.parquet", "x"), X)
    pq.write_table(pa.table({"x": [X[:5].tolist(), X.tolist()]}), tmp_path / "two.parquet")
    np.testing.assert_array_equal(load(tmp_path / "two.parquet", "x[row 1]"), X)
    with pytest.raises(TwingapError, match=r"name one of x\[row 0\], x\[row 1\]"):
        load(tmp_path / "two.parquet")


def test_headers_of_impossible_size_do_not_take_memory(tmp_path: Path) -> None:
    np.lib.format.open_memmap(tmp_path / "x.npy", "w+", np.float64, (3,))
    raw = (tmp_path / "x.npy").read_bytes().replace(b"(3,), }", b"(2147483648,), }")
    (tmp_path / "x.npy").write_bytes(raw.replace(b"          (2", b"(2"))
    with pytest.raises(TwingapError):
        load(tmp_path / "x.npy")
    savemat(tmp_path / "x.mat", {"x": np.zeros(3)})
    raw = bytearray((tmp_path / "x.mat").read_bytes())
    at = raw.index(b"\x05\x00\x00\x00\x08\x00\x00\x00") + 8
    raw[at : at + 8] = (2**31 - 1).to_bytes(4, "little") * 2
    (tmp_path / "x.mat").write_bytes(raw)
    with pytest.raises(TwingapError, match="is damaged"):
        load(tmp_path / "x.mat")
    savemat(tmp_path / "c.mat", {"x": np.empty((2**12, 0), dtype=object), "y": X})
    np.testing.assert_array_equal(load(tmp_path / "c.mat", "y"), X)


@given(at=st.integers(128, 900), value=st.integers(0, 255), compressed=st.booleans())
@settings(max_examples=150, deadline=None)
def test_a_damaged_structure_is_samples_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, at: int, value: int, compressed: bool
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.mat"
    savemat(path, {"s": {"Y": _struct_array(("a", X[:9]), ("b", X[:9]))}}, do_compression=compressed)
    raw = bytearray(path.read_bytes())
    raw[at % len(raw)] = value
    path.write_bytes(raw)
    try:
        for channel in inspect(path).channels:
            try:
                assert np.isfinite(channel.load()).all() or channel.problem
            except TwingapError as error:
                assert "\n" not in str(error)
    except TwingapError as error:
        assert "\n" not in str(error)
