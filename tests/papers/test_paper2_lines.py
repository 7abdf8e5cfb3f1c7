"""Whose line a recording shows, on signals made for it and on the virtual rig."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from papers.extra.lines import jobs as lines
from papers.extra.lines.jobs import Options, prominences, read
from papers.extra.lines.study import STUDY, told
from twingap.bearing import BEARINGS
from twingap.config import build, read_toml
from twingap.data import NotAtHandError
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet

BEARING, FS_HZ, TURN_HZ = BEARINGS["6205"], 12_000.0, 30.0


def modulated(fault: str, carrier_hz: float, samples: int = 48_000) -> np.ndarray:
    """Noise around a carrier whose energy beats twice a strike of the fault, and at its rate."""
    rng, t = np.random.default_rng(3), np.arange(samples) / FS_HZ
    beat = 2 * np.pi * BEARING.fault_order(fault) * TURN_HZ * t
    return (1 + 0.5 * np.cos(beat) + 0.4 * np.cos(2 * beat)) * np.cos(
        2 * np.pi * carrier_hz * t
    ) + 0.5 * rng.standard_normal(samples)


@pytest.mark.parametrize(("place", "fault"), [(0, "inner"), (1, "outer"), (2, "ball")])
def test_a_fault_stands_out_at_its_own_order_in_the_band_of_its_carrier(place: int, fault: str) -> None:
    found = prominences(modulated(fault, 2880.0), FS_HZ, TURN_HZ, BEARING, options(bands=[[0.04, 0.12], [0.20, 0.28]]))
    assert found.shape == (2, 3)
    assert found[1].argmax() == place and found[1, place] > 10 * np.delete(found[1], place).max()
    assert found[0].max() < 4


def recording(name: str, fault: str, shown: str | None, samples: int = 48_000) -> Record:
    """Said to have one fault; another's line, or none, is what its samples show."""
    x = modulated(shown, 2880.0, samples) if shown else np.random.default_rng(4).standard_normal(samples)
    return Record(Condition(name, 60 * TURN_HZ, FS_HZ, samples, fault), x)


def options(**changed: object) -> Options:
    given = {**read_toml(STUDY.config), **changed}
    return build(Options, given, "test")


def test_healthy_recordings_are_read_and_short_ones_left_out() -> None:
    records = RecordSet.from_records("set", "g", BEARING, [
        recording("sound", "healthy", None), recording("misled", "ball", "inner"), recording("plain", "outer", "outer"),
        recording("short", "healthy", None, 47_999),
    ])  # fmt: skip
    found = read(records, "one", options()).set_index("recording")
    assert list(found.index) == ["sound", "misled", "plain"]
    assert found["class"].tolist() == ["healthy", "ball", "outer"]
    assert found.loc["sound", ["inner", "outer", "ball"]].max() < 5
    assert found.loc[["misled", "plain"], "highest"].tolist() == ["inner", "outer"]
    bands = found["bands where the own line is the highest"]
    assert np.isnan(bands["sound"]) and bands["plain"] >= 1
    cut = read(records, "one", options(longest_s=2.0)).set_index("recording")
    assert (found["length_s"] == 4.0).all() and (cut["length_s"] == 2.0).all()
    assert 1.2 < found.loc["plain", "outer"] / cut.loc["plain", "outer"] < 1.7  # the root of the length
    with pytest.raises(TwingapError, match="no recording of 5 s"):
        read(records, "one", options(shortest_s=5.0))


def told_of(rows: list[list[object]]) -> pd.DataFrame:
    columns = ["data", "recording", "class", "sensor", "inner", "outer", "ball", "highest"]
    return told(pd.DataFrame(rows, columns=columns)).set_index(["data", "sensor", "class"])


COUNTS = ["recordings", "above healthy", "above all without it", "highest of its recording"]
REFERENCES = ["own line, lowest", "own line, highest", "healthy, highest", "without the fault, highest"]


def test_an_own_line_is_held_against_healthy_recordings_and_against_all_without_the_fault() -> None:
    found = told_of([
        ["set", "sound", "healthy", "DE", 3.0, 4.0, 2.0, "outer"],
        ["set", "sounder", "healthy", "DE", 2.0, 3.0, 2.5, "outer"],
        ["set", "a", "outer", "DE", 6.0, 9.0, 2.0, "outer"],  # above everything
        ["set", "b", "outer", "DE", 9.0, 5.0, 2.0, "inner"],  # above healthy, not above the inner race's
        ["set", "c", "outer", "DE", 2.5, 3.5, 2.0, "outer"],  # the highest it has, yet a healthy one's is higher
        ["set", "d", "inner", "DE", 8.0, 7.0, 1.0, "inner"],  # above healthy, not above an outer race's
    ])  # fmt: skip
    assert found.loc[("set", "DE", "outer"), COUNTS].tolist() == [3, 2, 1, 2]
    assert found.loc[("set", "DE", "outer"), REFERENCES].tolist() == [3.5, 9.0, 4.0, 7.0]
    assert found.loc[("set", "DE", "outer"), "above one without it"] == pytest.approx((3 + 2 + 1) / 9)
    assert found.loc[("set", "DE", "inner"), COUNTS].tolist() == [1, 1, 0, 1]
    assert found.loc[("set", "DE", "inner"), REFERENCES].tolist() == [8.0, 8.0, 3.0, 9.0]
    assert len(found) == 2, "healthy recordings have no line of their own, and one sensor is not several"


def test_one_sensor_is_enough_and_each_is_judged_by_its_own_references() -> None:
    found = told_of([
        ["set", "sound", "healthy", "DE", 3.0, 3.0, 3.0, "inner"],
        ["set", "a", "ball", "DE", 30.0, 2.0, 4.0, "inner"],  # its own line is the highest at FE alone, lower than 30
        ["set", "a", "ball", "FE", 1.0, 2.0, 5.0, "ball"],
        ["set", "b", "ball", "DE", 9.0, 2.0, 2.0, "inner"],  # nowhere
        ["set", "b", "ball", "FE", 9.0, 2.0, 2.0, "inner"],
        ["set", "c", "outer", "DE", 1.0, 9.0, 5.0, "outer"],
        ["set", "c", "outer", "FE", 1.0, 9.0, 4.0, "outer"],
        ["other", "a", "ball", "one", 1.0, 2.0, 2.5, "ball"],
        ["other", "b", "healthy", "one", 1.0, 2.0, 2.0, "outer"],
    ])  # fmt: skip
    assert found.loc[("set", "DE", "ball"), COUNTS].tolist() == [2, 1, 0, 0]
    no_healthy = found.loc[("set", "FE", "ball")]
    assert np.isnan(no_healthy["above healthy"]) and np.isnan(no_healthy["healthy, highest"])
    assert no_healthy[["above all without it", "highest of its recording"]].tolist() == [1, 1]
    joint = found.loc[("set", "at least one", "ball")]
    assert joint[COUNTS].tolist() == [2, 1, 1, 1] and joint[REFERENCES].isna().all()
    assert found.loc[("set", "at least one", "outer"), COUNTS].tolist() == [1, 1, 1, 1]
    assert found.loc[("other", "one", "ball"), COUNTS].tolist() == [1, 1, 1, 1]
    assert "at least one" not in found.loc["other"].index


def test_a_sensor_that_is_missing_is_an_error_unless_the_data_set_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = RecordSet.from_records("set", "g", BEARING, [recording("sound", "healthy", None)])
    missing = {"FE"}

    def load(name: str, root: Path | None = None, channel: str = "one", **given: float) -> RecordSet:
        if channel in missing:
            raise NotAtHandError(f"{channel} is not at hand")
        return sound

    monkeypatch.setattr(lines.datasets, "load", load)
    size = options().profiles["full"]
    with pytest.raises(TwingapError, match="FE is not at hand"):
        lines.load(options(), size, None)
    missing.add("DE")
    assert set(lines.load(options(), size, None)) == {("hit_sm", "one")}
    with pytest.raises(TwingapError, match="DE is not at hand"):
        lines.load(options(), size, tmp_path)
    missing.clear()
    assert set(lines.load(options(), size, None)) == {
        ("cwru", "DE"), ("cwru", "FE"), ("cwru", "BA"), ("hit_sm", "one"),
    }  # fmt: skip


def test_records_that_cannot_be_read_are_not_taken_for_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hit_sm").mkdir()
    (tmp_path / "hit_sm" / "IR2_600.mat").write_bytes(b"cut short")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=r"IR2_600\.mat"):
        lines.load(options(), options().profiles["full"], None)


def test_without_records_the_virtual_rig_is_read_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    monkeypatch.chdir(tmp_path)
    study = STUDY.run(out=tmp_path / "out", backend="sequential")
    assert study.title == "virtual rig, not CWRU"
    found = study.tables["lines-told"].set_index("class")
    assert found["recordings"].sum() > 20 and "healthy" not in found.index
    assert (found["highest of its recording"] == found["recordings"]).all()
    assert (found["above healthy"] == found["recordings"]).all()
    assert (study.tables["lines-recordings"]["class"] == "healthy").sum() == 4
    assert (
        (tmp_path / "out" / "tables" / "lines-told.md")
        .read_text(encoding="utf-8")
        .startswith("lines-told (virtual rig, not CWRU)")
    )
