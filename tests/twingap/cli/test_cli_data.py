"""`twingap data` as it is typed: results on standard output, one line and exit status 2 for a mistake."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from tests.twingap.cli.typed import Run, Said
from twingap.records.folder import read_record_set


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap data ...`."""
    return partial(typed, "data")


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data root with two recordings that only resemble CWRU's."""
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    folder = tmp_path / "dät a"
    (folder / "cwru").mkdir(parents=True)
    for number in (105, 107):
        samples = np.random.default_rng(number).normal(size=(480, 1))
        savemat(folder / "cwru" / f"{number}.mat", {f"X{number}_DE_time": samples})
    return folder


def refused(said: Said, *parts: str) -> None:
    """One line on standard error, exit status 2."""
    assert said.status == 2
    assert said.err.startswith("twingap: ")
    assert said.err.count("\n") == 1
    for part in parts:
        assert part in said.err


def test_list_needs_no_data(twingap: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    said = twingap("list")
    assert said.status == 0
    assert said.err == ""
    for name in ("cwru", "ims", "femto", "hit_sm", "xjtu_sy", "smart_maintenance", "virtual_cwru"):
        assert f"\n{name}: " in said.out
    assert "No licence is published" in said.out
    assert "none set" in said.out
    table = json.loads(twingap("list", "--json").out)
    assert {row["name"]: row["present"] for row in table}["cwru"] is None


def test_list_tells_what_is_here(twingap: Run, root: Path) -> None:
    table = {row["name"]: row for row in json.loads(twingap("list", "--root", root, "--json").out)}
    cwru = table["cwru"]
    assert (cwru["files"], cwru["present"], cwru["verified"], cwru["altered"]) == (42, 2, 0, 2)
    assert (table["ims"]["present"], table["virtual_cwru"]["made_here"]) == (0, True)
    assert "ALTERED" in twingap("list", "--root", root).out


def test_verify_names_what_is_altered_and_exits_2(twingap: Run, root: Path) -> None:
    said = twingap("verify", "cwru", "--root", root)
    refused(said, "2 altered files: cwru/105.mat, cwru/107.mat", "fetch")
    assert "altered: cwru/105.mat: expected sha256:f80b0ea0" in said.out
    assert "missing: cwru/106.mat: expected sha256:e5cec7cd" in said.out
    refused(twingap("verify", "--root", root, "--json"), "altered")


def test_verify_is_content_with_missing_and_unexpected_files(twingap: Run, root: Path) -> None:
    for number in (105, 107):
        (root / "cwru" / f"{number}.mat").rename(root / "cwru" / f"my {number}.mat")
    said = twingap("verify", "--root", root, "--json")
    assert (said.status, said.err) == (0, "")
    sets = {one["name"]: one for one in json.loads(said.out)}
    assert sets["cwru"]["intact"]
    statuses = {finding["path"]: finding for finding in sets["cwru"]["findings"]}
    assert statuses["cwru/my 105.mat"]["status"] == "unexpected"
    assert statuses["cwru/my 105.mat"]["found"].startswith("sha256:")
    assert statuses["cwru/105.mat"]["status"] == "missing"
    assert "xjtu_sy: not here" in twingap("verify", "--root", root).out


def test_export_writes_a_record_set(twingap: Run, root: Path, tmp_path: Path) -> None:
    out = tmp_path / "out ü"
    said = twingap("export", "cwru", "--root", root, "--out", out, "--where", "load_hp=2")
    assert (said.status, said.err) == (0, "")
    assert said.out.splitlines()[-1] == str(out)
    records = read_record_set(out)
    [condition] = records.conditions
    assert (condition.name, condition.fault, condition.speed_rpm, condition.fs_hz) == ("107", "inner", 1750.0, 12_000.0)
    assert (condition.extra["load_hp"], condition.extra["bearing_id"]) == (2, "inner-0.007")
    assert (records.unit, records.name) == ("g", "cwru")
    assert records.bearing is not None
    np.testing.assert_array_equal(records[0].samples, np.random.default_rng(107).normal(size=480))


def test_export_json_and_options(twingap: Run, root: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    said = twingap("export", "cwru", "--root", root, "--out", out, "--option", "fs_hz=6000", "--json")
    assert json.loads(said.out) == {
        "name": "cwru",
        "folder": str(out),
        "records": 2,
        "groups": 2,
        "faults": {"inner": 2},
    }
    assert {c.n_samples for c in read_record_set(out).conditions} == {240}


def test_export_of_a_virtual_rig_repeats_itself(twingap: Run, tmp_path: Path) -> None:
    digests = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        arguments = ("--where", "load_hp=0", "--where", "fault=inner", "--option", "duration_s=0.2", "--seed", seed)
        assert twingap("export", "virtual_cwru", "--out", tmp_path / name, *arguments).status == 0
        digests.append(read_record_set(tmp_path / name).digest)
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--where", "load=2"), "no column 'load'; columns: record"),
        (("--where", "load_hp=two"), "a number expected; load_hp takes 0, 2"),
        (("--where", "load_hp=9"), "no record of cwru has load_hp=9"),
        (("--where", "load_hp"), "write column=value"),
        (("--option", "fs_hz"), "write key=value"),
        (("--option", "speed=3"), "known keys: channel, fs_hz"),
        (("--option", "channel=BA"), "no CWRU recording with channel BA"),
    ],
)
def test_export_refuses_in_one_line_and_writes_nothing(
    twingap: Run, root: Path, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    refused(twingap("export", "cwru", "--root", root, "--out", tmp_path / "out", *arguments), said)
    assert not (tmp_path / "out").exists()


def test_export_leaves_nothing_when_a_recording_breaks_half_way(twingap: Run, root: Path, tmp_path: Path) -> None:
    path = root / "cwru" / "107.mat"
    samples = np.full((480, 1), 1.0)
    samples[100] = np.nan
    savemat(path, {"X107_DE_time": samples})
    refused(twingap("export", "cwru", "--root", root, "--out", tmp_path / "out"), "107.mat", "sample 100")
    path.write_bytes(path.read_bytes()[:-200])
    refused(twingap("export", "cwru", "--root", root, "--out", tmp_path / "out"), "107.mat")
    assert sorted(p.name for p in tmp_path.iterdir()) == [root.name]


def test_export_does_not_write_over_what_is_there(twingap: Run, root: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("kept", encoding="utf-8")
    refused(twingap("export", "cwru", "--root", root, "--out", tmp_path / "out"), "not an empty folder")
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["mine"]


@pytest.mark.parametrize("command", [("verify",), ("fetch", "cwru"), ("export", "cwru", "--out", "x")])
def test_without_a_data_root_one_line_says_so(
    twingap: Run, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    refused(twingap(*command), "TWINGAP_DATA or --root")


def test_unknown_sets_and_roots_are_one_line(twingap: Run, tmp_path: Path) -> None:
    refused(twingap("verify", "cwr", "--root", tmp_path), "no data set 'cwr'; use one of cwru")
    refused(twingap("export", "cwr", "--out", tmp_path / "x", "--root", tmp_path), "no data set 'cwr'")
    refused(twingap("fetch", "cwr", "--root", tmp_path), "no data set 'cwr'")
    refused(twingap("list", "--root", tmp_path / "absent"), "does not exist")
    refused(twingap("fetch", "xjtu_sy", "--root", tmp_path / "new"), "by hand")
    assert not (tmp_path / "new").exists()


def test_as_a_program_of_its_own(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "TWINGAP_DATA"} | {"TWINGAP_DATA": str(tmp_path)}
    command = [sys.executable, "-m", "twingap.cli", "data", "verify", "cwru"]
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0
    assert run.stdout.startswith("cwru: 42 missing")
    run = subprocess.run([*command, "nope"], capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 2
    assert run.stderr.startswith("twingap: no data set 'nope'")


@pytest.mark.data
def test_a_flipped_byte_in_a_real_file_is_caught(twingap: Run, tmp_path: Path) -> None:
    real = os.environ.get("TWINGAP_DATA")
    if not real or not (Path(real) / "cwru" / "105.mat").is_file():
        pytest.skip("TWINGAP_DATA is not set or has no cwru/105.mat")
    (tmp_path / "cwru").mkdir()
    copy = Path(shutil.copyfile(Path(real) / "cwru" / "105.mat", tmp_path / "cwru" / "105.mat"))
    assert twingap("verify", "cwru", "--root", tmp_path).status == 0
    content = bytearray(copy.read_bytes())
    content[len(content) // 2] ^= 1
    copy.write_bytes(content)
    refused(twingap("verify", "cwru", "--root", tmp_path), "1 altered file: cwru/105.mat")
