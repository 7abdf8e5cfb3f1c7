"""Readers, on files written in the layout that the owners document."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from twingap.data import NotAtHandError, load, manifest_of
from twingap.data.ims import ims_features
from twingap.errors import TwingapError
from twingap.records import Array, RecordSet

RNG = np.random.default_rng(7)


def noise(*shape: int) -> Array:
    return RNG.normal(size=shape)


def write_cwru(root: Path, number: int, arrays: dict[str, Array], name: str | None = None) -> None:
    (root / "cwru").mkdir(parents=True, exist_ok=True)
    savemat(root / "cwru" / (name or f"{number}.mat"), arrays)


def test_cwru_takes_what_the_file_says_and_names_the_bearing(tmp_path: Path) -> None:
    drive, fan = noise(2400, 1), noise(2400, 1)
    write_cwru(tmp_path, 105, {"X105_DE_time": drive, "X105_FE_time": fan, "X105RPM": np.array([[1801]])})
    write_cwru(tmp_path, 171, {"X171_DE_time": drive * 2})
    records = load("cwru", tmp_path)
    assert [c.name for c in records.conditions] == ["105", "171"]
    first, second = records.conditions
    assert (first.speed_rpm, first.fault, first.group, first.fs_hz) == (1801.0, "inner", "105", 12000.0)
    assert dict(first.extra) == {
        "load_hp": 0,
        "fault_size_inch": 0.007,
        "fault_position": None,
        "bearing_id": "inner-0.007",
        "end": "DE",
        "source": "original",
    }
    assert (second.speed_rpm, second.extra["load_hp"], second.extra["bearing_id"]) == (1750.0, 2, "inner-0.014")
    assert records.unit == "g"
    assert records.bearing is not None
    assert records.bearing.name == "6205"
    np.testing.assert_array_equal(records[0].samples, drive.ravel())
    np.testing.assert_array_equal(load("cwru", tmp_path, channel="FE")[0].samples, fan.ravel())


def test_cwru_99_is_not_taken_for_98(tmp_path: Path) -> None:
    right = noise(4800, 1)
    write_cwru(tmp_path, 99, {"X098_DE_time": noise(480, 1), "X099_DE_time": right})
    records = load("cwru", tmp_path, fs_hz=None)
    assert len(records) == 1
    np.testing.assert_array_equal(records[0].samples, right.ravel())
    assert records.conditions[0].fs_hz == 48_000


def test_cwru_decimates_the_normal_baseline_without_shift_or_alias(tmp_path: Path) -> None:
    t = np.arange(48_000) / 48_000
    slow, fast = np.sin(2 * np.pi * 500 * t), np.sin(2 * np.pi * 9_000 * t)
    write_cwru(tmp_path, 97, {"X097_DE_time": slow[:, None] + fast[:, None]})
    record = load("cwru", tmp_path)[0]
    assert record.condition.fs_hz == 12_000
    assert len(record.samples) == 12_000
    inside = slice(200, -200)
    # 9 kHz would fold to 3 kHz; what is left is the slow tone where it was.
    np.testing.assert_allclose(record.samples[inside], slow[::4][inside], atol=5e-3)


def test_cwru_stand_ins_serve_only_without_the_official_file(tmp_path: Path) -> None:
    write_cwru(tmp_path, 99, {"X099_DE_time": noise(400, 1), "X099_FE_time": noise(400, 1)}, "99_repacked.mat")
    np.save(tmp_path / "cwru" / "98_windows_48k.npy", noise(5, 64).astype(np.float32))
    records = load("cwru", tmp_path)
    assert len(records) == 6
    assert records.groups == ("98", "99")
    assert {c.n_samples for c in records.conditions} == {16, 100}
    assert all("third-party" in c.extra["source"] for c in records.conditions)
    assert [len(record.samples) for record in records] == [16] * 5 + [100]
    assert len(load("cwru", tmp_path, channel="FE")) == 1  # windows are of the drive end
    write_cwru(tmp_path, 98, {"X098_DE_time": noise(400, 1)})
    write_cwru(tmp_path, 99, {"X099_DE_time": noise(800, 1)})
    official = load("cwru", tmp_path)
    assert [c.extra["source"] for c in official.conditions] == ["original", "original"]
    assert official.conditions[1].n_samples == 200


def write_hit_sm(root: Path) -> Array:
    (root / "hit_sm").mkdir(parents=True)
    samples = noise(512, 1)
    savemat(root / "hit_sm" / "OR8_900.mat", {"z15_2": samples})
    savemat(root / "hit_sm" / "Normal_600.mat", {"VarName1": samples})
    return samples


def test_hit_sm_finds_the_one_vector_whatever_its_name(tmp_path: Path) -> None:
    samples = write_hit_sm(tmp_path)
    records = load("hit_sm", tmp_path)
    healthy, outer = records.conditions
    assert (healthy.fault, healthy.speed_rpm, healthy.extra["defect_arc_deg"]) == ("healthy", 600.0, 0)
    assert (outer.fault, outer.speed_rpm, outer.extra["defect_arc_deg"]) == ("outer", 900.0, 8)
    assert records.unit == ""
    np.testing.assert_array_equal(records[1].samples, samples.ravel())
    savemat(tmp_path / "hit_sm" / "OR8_900.mat", {"a": samples, "b": samples})
    with pytest.raises(TwingapError, match="holds 2 channels"):
        load("hit_sm", tmp_path)


def write_paderborn(
    root: Path, stem: str = "N15_M07_F10_K001_1", samples: int = 250_000, last: str = "vibration_1"
) -> Array:
    """A file in the owner's layout: time axes X and channels Y, as arrays of structs, compressed."""
    folder = root / "paderborn" / stem.split("_")[3]
    folder.mkdir(parents=True, exist_ok=True)
    vibration, slow = noise(samples), noise(samples // 16)
    kinds = [("Name", object), ("Type", object), ("Data", object), ("XIndex", object), ("Raster", object)]

    def structs(*rows: tuple[str, Array, str]) -> np.ndarray[Any, Any]:
        return np.array([[(name, "Signal", data[None], 1.0, raster) for name, data, raster in rows]], dtype=kinds)

    x = structs(("", np.arange(samples) / 64e3, "HostService"), ("", np.arange(slow.size) / 4e3, "Mech_4kHz"))
    y = structs(
        ("force", slow, "Mech_4kHz"), ("phase_current_1", 2 * vibration, "HostService"), ("speed", slow, "Mech_4kHz"),
        ("temp_2_bearing_module", noise(5), "Temp_1Hz"), (last, vibration, "HostService"),
    )  # fmt: skip
    file = {stem: {"Info": {"Duration": 4.0}, "X": x, "Y": y, "Description": {"General": "made"}}}
    savemat(folder / f"{stem}.mat", file, do_compression=True)
    return vibration


def test_paderborn_takes_the_vibration_and_reads_the_name(tmp_path: Path) -> None:
    made = {
        stem: write_paderborn(tmp_path, stem)
        for stem in ("N15_M07_F10_KA01_10", "N15_M07_F10_KA01_2", "N09_M07_F10_KB23_1")
    }
    for left_out in ("N15_M01_F10_KA08_2", "notes_1"):  # damaged at the source; no recording
        path = tmp_path / "paderborn" / "KA08" / f"{left_out}.mat"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"no MATLAB file")
    records = load("paderborn", tmp_path)
    assert [c.name for c in records.conditions] == ["N15_M07_F10_KA01_2", "N15_M07_F10_KA01_10", "N09_M07_F10_KB23_1"]
    first, _, both = records.conditions
    assert (first.speed_rpm, first.load_n, first.fs_hz, first.fault) == (1500.0, 1000.0, 64_000.0, "outer")
    assert (both.speed_rpm, both.fault, both.extra["damage"]) == (900.0, None, "inner+outer")
    assert (first.extra["origin"], both.extra["origin"]) == ("artificial", "lifetime")
    assert dict(first.extra)["torque_nm"] == 0.7
    assert records.groups == ("KA01_N15_M07_F10", "KB23_N09_M07_F10")
    assert records.bearing is not None
    assert (records.bearing.pitch_diameter_mm, records.unit) == (28.55, "")
    np.testing.assert_array_equal(records[1].samples, made["N15_M07_F10_KA01_10"][:249_600])


def test_paderborn_refuses_other_files(tmp_path: Path) -> None:
    write_paderborn(tmp_path, samples=1000)
    with pytest.raises(TwingapError, match="holds 1000 samples"):
        load("paderborn", tmp_path)[0]
    write_paderborn(tmp_path, samples=1000, last="noise_1")
    with pytest.raises(TwingapError, match="has no channel"):
        load("paderborn", tmp_path)[0]


def write_femto(root: Path, run: str, numbers: list[int], separator: str = ",") -> Array:
    folder = root / "femto" / run
    folder.mkdir(parents=True)
    snapshots = noise(len(numbers), 2560, 2)
    for number, snapshot in zip(numbers, snapshots, strict=True):
        clock = f"9{separator}39{separator}39{separator}6.5664e+004"
        rows = (f"{clock}{separator}{h:.6f}{separator}{v:.6f}" for h, v in snapshot)
        (folder / f"acc_{number:05d}.csv").write_text("\n".join(rows) + "\n", encoding="ascii")
    return snapshots


@pytest.mark.parametrize(("run", "separator"), [("Learning_set/Bearing1_1", ","), ("Full_Test_Set/Bearing1_4", ";")])
def test_femto_reads_the_owners_snapshots(tmp_path: Path, run: str, separator: str) -> None:
    snapshots = write_femto(tmp_path, run, [1, 2, 4], separator)
    (tmp_path / "femto" / run / "temp_00001.csv").write_text("1,2,3\n", encoding="ascii")
    records = load("femto", tmp_path)
    assert [c.time_s for c in records.conditions] == [0.0, 10.0, 30.0]
    assert {(c.speed_rpm, c.load_n, c.fault, c.group) for c in records.conditions} == {
        (1800.0, 4000.0, None, run.split("/")[1])
    }
    np.testing.assert_allclose(records[2].samples, snapshots[2, :, 0], atol=1e-6)
    np.testing.assert_allclose(load("femto", tmp_path, axis="vertical")[1].samples, snapshots[1, :, 1], atol=1e-6)


def test_femto_reads_the_conversion_until_the_owners_files_are_there(tmp_path: Path) -> None:
    (tmp_path / "femto").mkdir()
    converted = noise(3, 2560).astype(np.float32)
    np.savez(tmp_path / "femto" / "Bearing2_2.npz", horizontal_g=converted, start_time_of_day_s=np.arange(3.0))
    records = load("femto", tmp_path)
    assert [c.name for c in records.conditions] == ["Bearing2_2_00001", "Bearing2_2_00002", "Bearing2_2_00003"]
    np.testing.assert_array_equal(records[1].samples, converted[1].astype(np.float64))
    assert records[1].samples.dtype == np.float64
    with pytest.raises(TwingapError, match="no FEMTO run with the vertical"):
        load("femto", tmp_path, axis="vertical")
    write_femto(tmp_path, "Learning_set/Bearing2_2", [1])
    assert [c.extra["source"] for c in load("femto", tmp_path).conditions] == ["original"]


def write_xjtu(folder: Path, numbers: list[int], header: str) -> Array:
    folder.mkdir(parents=True)
    snapshots = noise(len(numbers), 32_768, 2)
    for number, snapshot in zip(numbers, snapshots, strict=True):
        np.savetxt(folder / f"{number}.csv", snapshot, fmt="%.5f", delimiter=",", header=header, comments="")
    return snapshots


XJTU_HEADER = "Horizontal_vibration_signals,Vertical_vibration_signals"


@pytest.mark.parametrize("above", ["", "XJTU-SY_Bearing_Datasets/"])
def test_xjtu_sy_reads_runs_in_order_of_time(tmp_path: Path, above: str) -> None:
    # As text, "10" comes before "2".
    folder = tmp_path / "xjtu_sy" / above / "37.5Hz11kN" / "Bearing2_4"
    numbers = [42, 10, 2, 33, 1, 5]
    snapshots = write_xjtu(folder, numbers, XJTU_HEADER)
    records = load("xjtu_sy", tmp_path)
    assert [c.time_s for c in records.conditions] == [60.0 * (n - 1) for n in sorted(numbers)]
    assert records.conditions[3].name == "Bearing2_4_0010"
    condition = records.conditions[0]
    assert (condition.speed_rpm, condition.load_n, condition.fs_hz) == (2250.0, 11_000.0, 25_600.0)
    assert (condition.fault, condition.extra["end_fault"], condition.group) == (None, "outer", "Bearing2_4")
    assert records.bearing is not None
    assert records.bearing.name == "UER204"
    np.testing.assert_allclose(records[3].samples, snapshots[1, :, 0], atol=1e-5)
    np.testing.assert_allclose(load("xjtu_sy", tmp_path, axis="vertical")[1].samples, snapshots[2, :, 1], atol=1e-5)


def test_xjtu_sy_refuses_other_columns_and_lengths(tmp_path: Path) -> None:
    write_xjtu(tmp_path / "xjtu_sy" / "35Hz12kN" / "Bearing1_1", [1], "a,b")
    with pytest.raises(TwingapError, match="no channel 'Horizontal_vibration_signals'"):
        load("xjtu_sy", tmp_path)[0]
    path = tmp_path / "xjtu_sy" / "35Hz12kN" / "Bearing1_1" / "1.csv"
    path.write_text(f"{XJTU_HEADER}\n1,2\n3,4\n", encoding="ascii")
    with pytest.raises(TwingapError, match="Bearing1_1_0001"):
        load("xjtu_sy", tmp_path)[0]


def write_ims(folder: Path, n_columns: int, names: list[str]) -> Array:
    folder.mkdir(parents=True)
    snapshots = noise(len(names), 20_480, n_columns)
    for name, snapshot in zip(names, snapshots, strict=True):
        np.savetxt(folder / name, snapshot, fmt="%.3f", delimiter="\t")
    return snapshots


def test_ims_gives_a_record_per_bearing_and_accelerometer(tmp_path: Path) -> None:
    two = write_ims(tmp_path / "ims" / "2nd_test", 4, ["2004.02.12.10.42.39", "2004.02.12.10.32.39"])
    records = load("ims", tmp_path)
    assert len(records) == 8
    assert [c.time_s for c in records.conditions] == [0.0] * 4 + [600.0] * 4
    first = records.conditions[0]
    assert (first.name, first.group) == ("test2-bearing1_2004.02.12.10.32.39", "test2-bearing1")
    assert (first.fault, first.extra["end_fault"]) == (None, "outer")
    assert first.load_n == pytest.approx(26_689, abs=1)
    np.testing.assert_allclose(records[6].samples, two[0, :, 2], atol=1e-3)
    one = write_ims(tmp_path / "ims" / "1st_test", 8, ["2003.10.22.12.06.24"])
    both = load("ims", tmp_path, test=1)
    assert len(both) == 8
    ends = [c.extra["end_fault"] for c in both.conditions]
    assert ends == [None, None, None, None, "inner", "inner", "ball", "ball"]
    np.testing.assert_allclose(both[5].samples, one[0, :, 5], atol=1e-3)
    assert len(load("ims", tmp_path)) == 16


@pytest.mark.parametrize("folder", ["4th_test/txt", "3rd_test/4th_test/txt", "3rd_test"])
def test_ims_knows_the_third_test_by_all_its_names(tmp_path: Path, folder: str) -> None:
    write_ims(tmp_path / "ims" / folder, 4, ["2004.03.04.09.27.46"])
    records = load("ims", tmp_path, test=3)
    assert [c.extra["end_fault"] for c in records.conditions] == [None, None, "outer", None]


def test_ims_refuses_a_snapshot_with_other_columns_or_words(tmp_path: Path) -> None:
    write_ims(tmp_path / "ims" / "2nd_test", 8, ["2004.02.12.10.32.39"])
    with pytest.raises(TwingapError, match="8 columns, 4 expected"):
        load("ims", tmp_path)[0]
    path = tmp_path / "ims" / "2nd_test" / "2004.02.12.10.32.39"
    for text in ("1\t2\t3\tx\n", "1\t2\t3\t\n", "", "\x00\xff"):
        path.write_bytes(text.encode("latin-1"))
        with pytest.raises(TwingapError, match=r"2004\.02\.12"):
            load("ims", tmp_path)[0]


def test_ims_feature_tables_become_a_row_per_snapshot_and_bearing(tmp_path: Path) -> None:
    (tmp_path / "ims").mkdir()
    head = ["file_index", "timestamp", "filename"] + [
        f"Bearing{b}_ch1_{f}" for b in range(1, 5) for f in ("rms", "kurt")
    ]
    rows = [
        ["0", "x", "2004.02.12.10.32.39", *map(str, range(8))],
        ["1", "x", "2004.02.12.10.42.39", *map(str, range(10, 18))],
    ]
    path = tmp_path / "ims" / "set2_time_features.csv"
    path.write_text("\n".join(",".join(row) for row in [head, *rows]), encoding="utf-8")
    more = ["file_index"] + [f"Bearing{b}_ch1_env_kurtosis" for b in range(1, 5)]
    (tmp_path / "ims" / "set2_shape_spectral_features.csv").write_text(
        ",".join(more) + "\n0,5,6,7,8\n1,15,16,17,18\n", encoding="utf-8"
    )
    table = ims_features(tmp_path, test=2)
    assert len(table) == 8
    late = table[(table.time_s == 600) & (table.bearing == 3)].iloc[0]
    assert (late["rms"], late["kurt"], late["env_kurtosis"]) == (14, 15, 17)
    assert table[table.bearing == 1].end_fault.unique() == ["outer"]
    with pytest.raises(TwingapError, match="feature tables only, no raw snapshot"):
        load("ims", tmp_path)
    good = path.read_text(encoding="utf-8")
    for broken in (
        good.replace("2004.02.12", "yesterday"),
        good.replace("filename", "name"),
        good.replace("\n1,", "\n0,"),
    ):
        path.write_text(broken, encoding="utf-8")
        with pytest.raises(TwingapError, match="set2_"):
            ims_features(tmp_path, test=2)


def write_smart_maintenance(root: Path, rows: str = "00001.npy,0,1000\n00002.csv,60,1100\n") -> tuple[Array, Array]:
    folder = root / "smart_maintenance" / "A148"
    folder.mkdir(parents=True, exist_ok=True)
    one, two = noise(100), noise(50)
    np.save(folder / "00001.npy", one)
    np.savetxt(folder / "00002.csv", two)
    (folder / "measurements.csv").write_text("file,time_s,speed_rpm\n" + rows, encoding="utf-8")
    return one, two


def test_smart_maintenance_reads_the_assumed_layout(tmp_path: Path) -> None:
    one, two = write_smart_maintenance(tmp_path)
    records = load("smart_maintenance", tmp_path)
    assert [(c.speed_rpm, c.time_s, c.n_samples) for c in records.conditions] == [(1000, 0, 100), (1100, 60, 50)]
    condition = records.conditions[0]
    assert (condition.fs_hz, condition.load_n, condition.group) == (50_000.0, 9000.0, "A148")
    assert condition.extra["anomaly_s"] == pytest.approx(112.6 * 60)
    np.testing.assert_array_equal(records[0].samples, one)
    np.testing.assert_allclose(records[1].samples, two)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("00009.npy,0,1000\n", "line 2: file '00009.npy' does not exist"),
        ("00001.npy,0,1000\n00002.csv,soon,1\n", "line 3: time_s = 'soon'"),
        ("00001.npy,0,\n", "line 2: speed_rpm = ''"),
        ("00001.npy,0,-5\n", "speed_rpm = -5"),
    ],
)
def test_smart_maintenance_names_the_line_at_fault(tmp_path: Path, rows: str, said: str) -> None:
    write_smart_maintenance(tmp_path, rows)
    with pytest.raises(TwingapError, match=said):
        load("smart_maintenance", tmp_path)


def test_virtual_rig_needs_no_data_and_repeats_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    one, again = (load("virtual_cwru", duration_s=0.2, seed=5) for _ in range(2))
    np.testing.assert_array_equal(one[3].samples, again[3].samples)
    other = load("virtual_cwru", duration_s=0.2, seed=6)
    assert not np.array_equal(one[3].samples, other[3].samples)
    assert {"bearing_id", "load_hp"} <= set(one.conditions[0].extra)


WRITERS: dict[str, Callable[[Path], object]] = {
    "cwru": lambda root: write_cwru(root, 105, {"X105_DE_time": noise(240, 1)}),
    "hit_sm": write_hit_sm,
    "femto": lambda root: write_femto(root, "Learning_set/Bearing1_1", [1]),
    "xjtu_sy": lambda root: write_xjtu(root / "xjtu_sy" / "35Hz12kN" / "Bearing1_1", [1], XJTU_HEADER),
    "ims": lambda root: write_ims(root / "ims" / "2nd_test", 4, ["2004.02.12.10.32.39"]),
    "smart_maintenance": write_smart_maintenance,
    "paderborn": write_paderborn,
}


@pytest.mark.parametrize("name", WRITERS)
def test_samples_are_read_on_access_in_any_process(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path)
    records = load(name, tmp_path)
    copy: RecordSet = pickle.loads(pickle.dumps(records))
    np.testing.assert_array_equal(copy[0].samples, records[0].samples)
    records[0].samples[:] = 0  # a caller's own copy
    assert np.ptp(records[0].samples) > 0
    assert records.bearing is not None
    assert records.name == name
    # Samples are not held: with the files gone, so are they.
    fresh = load(name, tmp_path)
    shutil.rmtree(tmp_path / name)
    with pytest.raises(TwingapError):
        fresh[0]


@pytest.mark.parametrize("name", WRITERS)
def test_without_files_one_line_says_what_to_do(tmp_path: Path, name: str) -> None:
    with pytest.raises(NotAtHandError) as caught:
        load(name, tmp_path)
    said = str(caught.value)
    assert "\n" not in said
    assert f"fetch {name}" in said or (manifest_of(name).how_to_get or "?") in said


@pytest.mark.parametrize(
    "content", [b"", b"MATLAB 5.0 MAT-file" + b" " * 200, b"\x80\x04pickle", bytes(range(256)) * 8]
)
def test_a_broken_matlab_file_is_one_line(tmp_path: Path, content: bytes) -> None:
    for name, file in (("cwru", "105.mat"), ("hit_sm", "IR2_600.mat")):
        (tmp_path / name).mkdir()
        (tmp_path / name / file).write_bytes(content)
        with pytest.raises(TwingapError, match=file.replace(".", r"\.")) as caught:
            load(name, tmp_path)
        assert not isinstance(caught.value, NotAtHandError)  # it is there


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut short", b"not a zip at all"])
def test_a_broken_conversion_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "femto").mkdir()
    (tmp_path / "femto" / "Bearing1_1.npz").write_bytes(content)
    with pytest.raises(TwingapError, match=r"Bearing1_1\.npz"):
        load("femto", tmp_path)
    (tmp_path / "cwru").mkdir()
    (tmp_path / "cwru" / "98_windows_48k.npy").write_bytes(content)
    with pytest.raises(TwingapError, match=r"98_windows_48k\.npy"):
        load("cwru", tmp_path)


def test_pickled_windows_are_refused(tmp_path: Path) -> None:
    (tmp_path / "cwru").mkdir()
    np.save(tmp_path / "cwru" / "98_windows_48k.npy", np.array([{"a": 1}], dtype=object))
    with pytest.raises(TwingapError, match="98_windows_48k"):
        load("cwru", tmp_path)


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("cwru", {"fs": 1}, "unknown key 'fs'; known keys: channel, fs_hz"),
        ("cwru", {"channel": "XX"}, "one of 'DE', 'FE', 'BA' expected"),
        ("cwru", {"fs_hz": "fast"}, "a finite number expected"),
        ("cwru", {"fs_hz": -1.0}, "positive"),
        ("cwru", {"fs_hz": 11_999.99}, "no ratio of small numbers"),
        ("nope", {}, "no data set 'nope'"),
    ],
)
def test_wrong_options_are_one_line(tmp_path: Path, name: str, options: dict[str, object], said: str) -> None:
    write_cwru(tmp_path, 105, {"X105_DE_time": noise(240, 1)})
    with pytest.raises(TwingapError, match=said):
        load(name, tmp_path, **options)


def test_the_data_root_is_asked_for_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    with pytest.raises(NotAtHandError, match="TWINGAP_DATA or --root"):
        load("cwru")
    with pytest.raises(NotAtHandError, match="does not exist"):
        load("cwru", tmp_path / "absent")
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(TwingapError, match="a folder expected") as caught:
        load("cwru", tmp_path / "file")
    assert not isinstance(caught.value, NotAtHandError)
    write_cwru(tmp_path, 105, {"X105_DE_time": noise(240, 1)})
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    assert len(load("cwru")) == 1
