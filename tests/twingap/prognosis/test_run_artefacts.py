"""Remaining life along runs with clipped records and sensors that settle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from twingap.prognosis.estimate import LifeOptions
from twingap.prognosis.follow import Followed, follow
from twingap.prognosis.run_records import read_run
from twingap.records import Condition, Record
from twingap.records.folder import write_records

Array = np.ndarray


def followed(
    folder: Path, change: Callable[[int, Array], Array], onset: int = 90, limit: float | None = None
) -> Followed:
    """A run whose amplitude grows from `onset` on, with changed samples."""
    rng = np.random.default_rng(0)

    def records() -> list[Record]:
        made = []
        for i in range(150):
            x = rng.standard_normal(4096) * (1 if i < onset else np.exp((i - onset) / 20))
            made.append(Record(Condition(f"{i:03d}", 1800.0, 25600.0, 4096, time_s=600.0 * i), change(i, x)))
        return made

    return follow(read_run(write_records(folder / "run", "run", "g", None, None, records())), LifeOptions(limit))


def test_clipped_records_bound_life_from_above(tmp_path: Path) -> None:
    free = followed(tmp_path / "free", lambda i, x: x)
    clipped = followed(tmp_path / "clipped", lambda i, x: np.clip(x, -12, 12))
    last = clipped.rows()[-1]
    assert free.rows()[-1]["remaining_time_s"] == 0
    assert last["anomaly"] == 1 and last["remaining_time_s"] is None
    assert last["remaining_time_s_lo"] == 0 < last["remaining_time_s_hi"]
    note = next(note for note in clipped.notes if "clipped" in note)
    assert note.startswith("33 records, the first '117', are clipped (") and "at most remaining_time_s_hi" in note
    assert not any("clipped" in note for note in free.notes)
    assert [r["remaining_time_s"] for r in clipped.rows()[:110]] == [r["remaining_time_s"] for r in free.rows()[:110]]


def test_a_limit_within_the_range_is_reached_by_clipped_records(tmp_path: Path) -> None:
    clipped = followed(tmp_path, lambda i, x: np.clip(x, -12, 12), limit=23.0)
    assert clipped.rows()[-1]["remaining_time_s"] == 0
    assert any(note.startswith("end of life is reached") for note in clipped.notes)


@pytest.mark.parametrize("tau_s", [0.03, 0.1])
def test_a_settling_sensor_is_no_anomaly(tmp_path: Path, tau_s: float) -> None:
    offset = 30 * np.exp(-np.arange(4096) / 25600 / tau_s)
    settling = followed(tmp_path, lambda i, x: x + offset * (i >= 70), onset=999)
    assert settling.alarm is None
    assert any("in 80 records, the first '070', the sensor settles after power-on" in note for note in settling.notes)


def test_dropouts_are_left_out_and_said(tmp_path: Path) -> None:
    def hold(i: int, x: Array) -> Array:
        return np.where(np.arange(x.size) > 1000, 40.0, x) if i >= 80 else x

    found = followed(tmp_path, hold, onset=999)
    assert found.alarm is None
    assert any("in 70 records, the first '080', the signal stands still" in note for note in found.notes)


def test_spikes_of_a_loose_contact_are_no_anomaly(tmp_path: Path) -> None:
    def spike(i: int, x: Array) -> Array:
        return x + 200.0 * (np.arange(x.size) == 7 * i) if i >= 80 else x

    found = followed(tmp_path, spike, onset=999)
    assert found.alarm is None
    assert any("in 70 records, the first '080', single samples stand out" in note for note in found.notes)


@pytest.mark.parametrize("resonance_hz", [4000, 6400, 9600])
def test_growing_impacts_that_ring_are_an_anomaly_and_no_spikes(tmp_path: Path, resonance_hz: float) -> None:
    """At 6400 Hz, a quarter of the sampling rate, every second sample of the response is near zero."""
    ring = np.exp(-np.arange(300) / 20) * np.sin(2 * np.pi * np.arange(300) * resonance_hz / 25600)

    def impacts(i: int, x: Array) -> Array:
        return x + 20 * np.exp((i - 80) / 30) * np.pad(ring, (500, 4096 - 800)) if i >= 80 else x

    found = followed(tmp_path, impacts, onset=999)
    assert found.onset == "080"
    assert found.rows()[-1]["remaining_time_s"] == 0
    assert not any("single samples" in note for note in found.notes)


@pytest.mark.parametrize("rows", [1, 60])
def test_a_sensor_that_fades_is_said_and_is_no_running_in(tmp_path: Path, rows: int) -> None:
    """At once and slowly, while the bearing's amplitude grows from row 90 on."""
    found = followed(tmp_path, lambda i, x: x * np.exp(-7 * min(max(i - 70, 0) / rows, 1)))
    assert any("as of a failing sensor" in note for note in found.notes)
    assert found.alarm is None
