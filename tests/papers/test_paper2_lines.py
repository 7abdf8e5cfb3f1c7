"""Whose line a recording shows, on signals made for it and on the virtual rig."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from papers.paper2_digital_twin.lines import CONFIG, Limit, Reading, limit_of, prominences, run, told
from papers.paper2_digital_twin.lines import main as start
from twingap.bearing import BEARINGS

BEARING, FS_HZ, TURN_HZ = BEARINGS["6205"], 12_000.0, 30.0
READING = Reading(((0.04, 0.12), (0.20, 0.28)), 2, 0.01)


def modulated(fault: str, carrier_hz: float, samples: int = 48_000) -> np.ndarray:
    """Noise around a carrier whose energy beats twice a strike of the fault, and at its rate."""
    rng, t = np.random.default_rng(3), np.arange(samples) / FS_HZ
    beat = 2 * np.pi * BEARING.fault_order(fault) * TURN_HZ * t
    return (1 + 0.5 * np.cos(beat) + 0.4 * np.cos(2 * beat)) * np.cos(
        2 * np.pi * carrier_hz * t
    ) + 0.5 * rng.standard_normal(samples)


@pytest.mark.parametrize(("place", "fault"), [(0, "inner"), (1, "outer"), (2, "ball")])
def test_a_fault_stands_out_at_its_own_order_in_the_band_of_its_carrier(place: int, fault: str) -> None:
    found = prominences(modulated(fault, 2880.0), FS_HZ, TURN_HZ, BEARING, READING)
    assert found.shape == (2, 3)
    assert found[1].argmax() == place and found[1, place] > 10 * np.delete(found[1], place).max()
    assert found[0].max() < 4


def test_noise_passes_its_limit_as_often_as_stated() -> None:
    noise = Limit(6000, FS_HZ, TURN_HZ, BEARING, READING, 200, 0.1)
    limit, rng = limit_of(noise), np.random.default_rng(9)
    passed = sum(
        prominences(rng.standard_normal(6000), FS_HZ, TURN_HZ, BEARING, READING).max() > limit for _ in range(200)
    )
    assert 5 <= passed <= 42


def test_recordings_are_counted_by_sensor_and_over_all_of_them() -> None:
    columns = ["data", "recording", "class", "sensor", "inner", "outer", "ball", "limit", "highest"]
    rows = pd.DataFrame(
        [
            ["set", "a", "outer", "DE", 9.0, 5.0, 2.0, 3.0, "inner"],
            ["set", "a", "outer", "FE", 4.0, 12.0, 2.0, 3.0, "outer"],
            ["set", "b", "outer", "DE", 9.0, 2.0, 2.0, 3.0, "inner"],
            ["set", "b", "outer", "FE", 8.0, 2.5, 2.0, 3.0, "inner"],
            ["other", "a", "ball", "one", 1.0, 2.0, 2.5, 3.0, "ball"],
        ],
        columns=columns,
    )
    found = told(rows).set_index(["data", "sensor"])
    counts = ["recordings", "own line above noise", "and no other higher", "another higher"]
    assert found.loc[("set", "DE"), counts].tolist() == [2, 1, 0, 2]
    assert found.loc[("set", "FE"), counts].tolist() == [2, 1, 1, 1]
    assert found.loc[("set", "any"), counts].tolist() == [2, 1, 1, 1]
    assert found.loc[("other", "one"), counts].tolist() == [1, 0, 0, 0]
    assert ("other", "any") not in found.index


def test_without_records_the_virtual_rig_is_read_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    monkeypatch.chdir(tmp_path)
    config = tmp_path / "lines.toml"
    text = CONFIG.read_text(encoding="utf-8")
    assert "noises = 100 " in text
    config.write_text(text.replace("noises = 100 ", "noises = 8 "), encoding="utf-8")
    study = run(out=tmp_path / "out", config=config, backend="sequential")
    assert study.title == "virtual rig, not CWRU"
    found = study.tables["lines-told"].set_index("class")
    assert (found["another higher"] == 0).all() and found["recordings"].sum() > 20
    assert (
        (tmp_path / "out" / "tables" / "lines-told.md")
        .read_text(encoding="utf-8")
        .startswith("lines-told (virtual rig, not CWRU)")
    )


def test_a_profile_that_is_not_there_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        start(["--profile", "huge", "--out", str(tmp_path), "--no-track"])
    assert left.value.code == 2 and capsys.readouterr().err.strip().count("\n") == 0
