"""Formats of the extra twingap[formats]: MATLAB 7.3 and HDF5, TDMS, universal files, MF4."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twingap.errors import TwingapError
from twingap.records.folder import read_record_set
from twingap.records.samples import inspect, load

X = np.sin(np.arange(300.0))


def _matlab(file: Any, name: str, value: Any, kind: str = "double") -> Any:
    data = file.create_dataset(name, data=value)
    data.attrs["MATLAB_class"] = np.bytes_(kind)
    return data


def _mat_73(path: Path) -> None:
    """A file as MATLAB 7.3 writes it: a vector, a matrix, a struct, a struct array whose elements have names."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        _matlab(file, "x", X[None])
        _matlab(file, "data", np.stack([-X, X]))  # axes are reversed in the file
        group = file.create_group("bearing")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        _matlab(group, "gs", X[None])
        _matlab(group, "sr", [[12000.0]])
        elements = file.create_group("Y")
        elements.attrs["MATLAB_class"] = np.bytes_("struct")
        kept = file.create_group("#refs#")
        names = [
            _matlab(kept, f"n{i}", np.array([[ord(c)] for c in name], "u2"), "char")
            for i, name in enumerate(("force", "vib"))
        ]
        datas = [_matlab(kept, f"d{i}", x[None]) for i, x in enumerate((np.ones(40), X))]
        for name, items in (("Name", names), ("Data", datas)):
            elements.create_dataset(name, data=np.array([[i.ref for i in items]]).T, dtype=h5py.ref_dtype)


@pytest.mark.parametrize("channel", ["x", "data[1]", "data[1]", "bearing.gs", "Y/vib"])
def test_matlab_73(tmp_path: Path, channel: str) -> None:
    _mat_73(tmp_path / "x.mat")
    np.testing.assert_array_equal(load(tmp_path / "x.mat", channel), X)


def test_matlab_73_lists_its_channels(tmp_path: Path) -> None:
    _mat_73(tmp_path / "x.mat")
    with pytest.raises(TwingapError, match=r"Y/force, .*Y/vib.*bearing\.gs, bearing\.sr, data\[0\], data\[1\], x"):
        load(tmp_path / "x.mat")


def test_hdf5_stays_in_its_file(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["secret"] = X
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["run/acc"] = np.stack([X, -X], 1)
        file["link"] = h5py.ExternalLink("other.h5", "/secret")
        file["circle"] = file["run"]
        file["run/up"] = file["/"]
        file.create_dataset("outside", (300,), "f8", external=[(str(tmp_path / "raw.bin"), 0, 2400)])
        layout = h5py.VirtualLayout((300,), "f8")
        layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "secret", (300,))
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("huge", (2**31,), "f8", chunks=(2**20,), compression="gzip")
        file.create_dataset("text", data="a note")
    names = {c.name: c.problem for c in inspect(tmp_path / "x.h5").channels}
    assert "link" not in names
    assert names["outside"] == names["virtual"] == "lies in another file, which is not read"
    assert names["huge"] is not None and "states 2147483648 values" in names["huge"]
    first = next(name for name in names if name.endswith("acc[1]"))
    np.testing.assert_array_equal(load(tmp_path / "x.h5", first), -X)


def test_tdms(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("run", "acc", X, {"wf_increment": 1 / 25600, "unit_string": "g"}),
        nptdms.ChannelObject("run", "tacho", X[:20]),
    ]
    with nptdms.TdmsWriter(str(tmp_path / "x.tdms")) as writer:
        writer.write_segment(channels)
    file = inspect(tmp_path / "x.tdms")
    assert file.fs_hz == pytest.approx(25600)
    assert file.find("run/acc").unit == "g"
    np.testing.assert_array_equal(file.find("run/acc").load(), X)


def test_universal_files(tmp_path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    file = pyuff.UFF(str(tmp_path / "x.uff"))
    for name, data in (("acc", X), ("acc 2", -X)):
        one = pyuff.prepare_58(
            binary=1, func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, data=data, x=np.arange(300) / 12800,
            id1=name, rsp_ent_name="NONE", ref_ent_name="NONE", abscissa_spacing=1, abscissa_min=0.0,
            abscissa_inc=1 / 12800, ord_data_type=4, num_pts=300, abscissa_spec_data_type=17,
            ordinate_spec_data_type=12, orddenom_spec_data_type=0, ordinate_axis_units_lab="g", ver_num=1, id2="NONE",
            id3="NONE", id4="NONE", id5="NONE", load_case_id=0, z_axis_value=0.0,
        )  # fmt: skip
        file.write_sets(one, "add")
    found = inspect(tmp_path / "x.uff")
    assert [c.name for c in found.channels] == ["acc", "acc 2"]
    assert found.fs_hz == pytest.approx(12800, rel=1e-4)
    np.testing.assert_allclose(found.find("acc 2").load(), -X, rtol=1e-12)


def test_mf4(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(300) / 12800
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(X, time, name="acc", unit="m/s^2"), asammdf.Signal(-X, time, name="acc 2")])
        file.save(tmp_path / "x.mf4")
    found = inspect(tmp_path / "x.mf4")
    assert [(c.name, c.unit) for c in found.channels] == [("acc", "m/s^2"), ("acc 2", "")]
    assert found.fs_hz == pytest.approx(12800, rel=1e-6)
    np.testing.assert_array_equal(found.find("acc 2").load(), -X)


@pytest.mark.parametrize("suffix", [".h5", ".tdms", ".uff", ".mf4"])
@pytest.mark.parametrize("content", [b"", b"not such a file", bytes(700)])
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    (tmp_path / f"x{suffix}").write_bytes(content)
    with pytest.raises(TwingapError) as caught:
        load(tmp_path / f"x{suffix}")
    assert str(tmp_path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_rate_that_the_file_states_is_compared_with_the_set(tmp_path: Path) -> None:
    (tmp_path / "recordset.toml").write_text("[recordset]\nfs_hz = 12000\n")
    (tmp_path / "records.csv").write_text("record,file,channel,speed_rpm\na,a.lvm,A,1800\n")
    (tmp_path / "a.lvm").write_text("Delta_X\t1.9531E-5\nX_Value\tA\n0.0\t1.0\n1.0\t2.0\n2.0\t2.0\n")
    with pytest.raises(TwingapError, match=r"states 51200\.7 Hz but the record set 12000 Hz"):
        read_record_set(tmp_path)
    (tmp_path / "recordset.toml").write_text("[recordset]\nfs_hz = 51200\n")
    assert read_record_set(tmp_path)[0].samples.tolist() == [1.0, 2.0, 2.0]


def test_a_missing_extra_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.tdms").write_bytes(b"TDSm")
    code = (
        "import sys; sys.modules['nptdms'] = None\n"
        "from twingap.records.samples import inspect\n"
        f"inspect({str(tmp_path / 'x.tdms')!r})"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert 'files of type .tdms need the package npTDMS; install it: pip install "twingap[formats]"' in ended.stderr


def test_damaged_mf4_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("asammdf")
    (tmp_path / "x.mf4").write_bytes(b"MDF     4.10    " + bytes(200))
    with pytest.raises(TwingapError) as caught:
        inspect(tmp_path / "x.mf4")
    del caught
    gc.collect()
    assert capfd.readouterr().err == ""
