"""Records of a rig kept in files: the same bytes, verified, whole or not there, one at a time in memory."""

import os
import pickle
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.rigs import SmartMaintenanceRig, digest, stored_folder, stored_records

RIG = SmartMaintenanceRig(interval_s=300.0, duration_s=0.1, bearings=("A148", "A154"))


@pytest.fixture(scope="module")
def simulated() -> str:
    return digest(RIG.records(1))


def files(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.rglob("*") if p.is_file())


def test_stored_records_are_the_simulated_ones(tmp_path: Path, simulated: str) -> None:
    seen: list[tuple[str, float]] = []
    stored = stored_records(RIG, 1, folder=tmp_path, progress=lambda what, at: seen.append((what, at)))
    assert digest(stored) == simulated
    assert files(tmp_path) == ["A148.npy", "A148.npy.sha256", "A154.npy", "A154.npy.sha256"]
    assert {what for what, _ in seen} == {"A148", "A154"} and seen[-1] == ("A154", 1.0)
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.npy")}
    again = stored_records(RIG, 1, folder=tmp_path, progress=lambda *_: pytest.fail("made twice"))
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.npy")} == before
    sent: RecordSet = pickle.loads(pickle.dumps(again))
    assert sent[3].samples.tobytes() == RIG.records(1)[3].samples.tobytes()
    assert sent[3].samples.flags.writeable and type(sent[3].samples) is np.ndarray
    # A rig of fewer bearings finds its run there already.
    few = SmartMaintenanceRig(interval_s=300.0, duration_s=0.1, bearings=("A154",))
    assert len(stored_records(few, 1, folder=tmp_path, progress=lambda *_: pytest.fail("made twice"))) == 26
    # Another seed or snapshot lies elsewhere.
    assert len(list(tmp_path.iterdir())) == 1
    stored_records(few, 2, folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def damage_samples(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(bytes(data))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def forget(path: Path) -> None:
    path.with_name(path.name + ".sha256").unlink()


def empty(path: Path) -> None:
    path.with_name(path.name + ".sha256").write_text("")


@pytest.mark.parametrize("harm", [damage_samples, cut, forget, empty])
def test_a_file_that_does_not_match_is_made_again(tmp_path: Path, simulated: str, harm: object) -> None:
    opened = stored_records(RIG, 1, folder=tmp_path)
    (path,) = tmp_path.rglob("A154.npy")
    harm(path)  # type: ignore[operator]
    with pytest.raises(TwingapError, match="does not match its checksum; make the records again"):
        opened[-1]
    assert digest(stored_records(RIG, 1, folder=tmp_path)) == simulated


def test_an_interruption_leaves_no_half_file(tmp_path: Path, simulated: str) -> None:
    def stop(what: str, fraction: float) -> None:
        if what == "A154" and fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stored_records(RIG, 1, folder=tmp_path, progress=stop)
    assert files(tmp_path) == ["A148.npy", "A148.npy.sha256"]
    assert digest(stored_records(RIG, 1, folder=tmp_path)) == simulated


def test_a_run_is_never_in_memory_whole(tmp_path: Path) -> None:
    rig = SmartMaintenanceRig(interval_s=120.0, duration_s=0.2, bearings=("A148",))
    whole = 8 * rig.n_samples * rig.times_s("A148").size
    stored_records(rig, 1, folder=tmp_path)
    tracemalloc.start()
    try:
        for record in stored_records(rig, 1, folder=tmp_path):
            assert record.samples.size == rig.n_samples
        assert tracemalloc.get_traced_memory()[1] < whole / 5
        tracemalloc.reset_peak()
        held = tracemalloc.get_traced_memory()[0]
        next(tmp_path.rglob("A148.npy")).unlink()
        stored_records(rig, 1, folder=tmp_path)
        # Simulating holds a dozen arrays of one snapshot, twice oversampled and complex.
        assert tracemalloc.get_traced_memory()[1] - held < max(whole / 2, 60 * 8 * rig.n_samples)
    finally:
        tracemalloc.stop()


def test_an_unwritable_place_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(TwingapError, match="file"):
        stored_records(RIG, 1, folder=tmp_path / "file")


def test_the_folder_follows_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TWINGAP_HOME", str(tmp_path))
    assert stored_folder() == tmp_path / "rigs"
    monkeypatch.delenv("TWINGAP_HOME")
    assert os.fspath(stored_folder()).endswith("rigs")
