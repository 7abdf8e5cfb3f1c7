"""Records through a drawn filter: the path is named, its gain recovered; a wrong gain shows as an error."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import freqz

from twingap.bearing import BEARINGS
from twingap.effects import TransferPath
from twingap.records import Condition, Record, RecordSet
from twingap.study.public_filter import drawn_filter, filter_row, filter_section, filtered, gain_error_db
from twingap.twins import TwinSpec
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

FS_HZ = 12_000.0


def machine(seed: int, count: int = 24) -> RecordSet:
    """Healthy and outer-race records of a twin."""
    rng = np.random.default_rng(seed)
    conditions = [
        Condition(f"r{i}", float(round(rng.uniform(1500, 1800))), FS_HZ, 6000, ("healthy", "outer")[i % 2])
        for i in range(count)
    ]
    own = PhenomenologicalParameters(3000.0, 0.04, scale=0.3, structure_noise_rms=0.3)
    made = PhenomenologicalTwin(BEARINGS["6205"], own, (), unit="g").simulate(conditions, rng)
    return RecordSet.from_records(f"machine {seed}", "g", BEARINGS["6205"], made)


def test_a_filter_of_real_records_is_named_and_recovered() -> None:
    row = filter_row(machine(1), machine(2), TwinSpec("phenomenological"), np.random.default_rng(5))
    assert row["effects"][0] == "transfer_path"
    assert row["median_db"] < 1.0
    assert row["closure"] > 0.6
    json.dumps(row)
    text = "\n".join(filter_section([{"title": "set", "split": 0, "split_by": "recording", **row}]))
    assert f"{row['median_db']:.2f}" in text and "transfer_path" in text


def test_gains_are_compared_where_records_have_energy() -> None:
    taps = drawn_filter(np.random.default_rng(3))
    rng = np.random.default_rng(4)
    t = np.arange(6000) / FS_HZ
    low = 0.001 * rng.standard_normal(6000) + np.sin(2 * np.pi * 500 * t)  # energy at 500 Hz alone
    rows = [Record(Condition("a", 1800.0, FS_HZ, 6000, "healthy"), low)]
    records = filtered(RecordSet.from_records("set", "g", BEARINGS["6205"], rows), taps)
    f_hz = np.linspace(1, FS_HZ / 2, 300)
    gains_db = 20 * np.log10(np.abs(freqz(taps, worN=2 * np.pi * f_hz / FS_HZ)[1]))
    right = TransferPath(frequencies_hz=tuple(f_hz), gains_db=tuple(gains_db))
    assert gain_error_db(right, 1.0, records, taps).max() < 0.1
    assert gain_error_db(right, 2.0, records, taps) == pytest.approx(6.02, abs=0.1)
    wrong_above = TransferPath(frequencies_hz=tuple(f_hz), gains_db=tuple(np.where(f_hz > 2000, 30, gains_db)))
    assert gain_error_db(wrong_above, 1.0, records, taps).max() < 0.1
