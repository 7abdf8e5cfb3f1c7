"""Readers on the real records: the faults show where the geometry says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, hilbert, sosfiltfilt

from twingap.data import cut, load, where
from twingap.data.ims import ims_features
from twingap.records import Record

pytestmark = pytest.mark.data


def strongest_order(record: Record, lo: float, hi: float, band_hz: tuple[float, float]) -> float:
    """Order of the highest line of the squared envelope spectrum between two orders; written apart from `signal`."""
    c = record.condition
    sos = butter(4, band_hz, btype="bandpass", fs=c.fs_hz, output="sos")
    squared = np.abs(hilbert(sosfiltfilt(sos, record.samples))) ** 2
    spectrum = np.abs(np.fft.rfft((squared - squared.mean()) * np.hanning(c.n_samples)))
    orders = np.fft.rfftfreq(c.n_samples, 1 / c.fs_hz) / (c.speed_rpm / 60)
    inside = (orders > lo) & (orders < hi)
    return float(orders[inside][np.argmax(spectrum[inside])])


@pytest.mark.parametrize("number", ["105", "106", "107", "108", "209", "130", "131", "234"])
def test_cwru_envelope_peaks_at_the_fault_order(real_root: Path, number: str) -> None:
    records = load("cwru", real_root)
    [record] = where(records, [f"record={number}"])
    assert records.bearing is not None
    assert record.condition.fault is not None
    order = records.bearing.fault_order(record.condition.fault)
    found = strongest_order(record, 2.5, 8.0, (2000, 5500))
    assert found == pytest.approx(order, rel=0.02)


def test_cwru_is_whole(real_root: Path) -> None:
    records = load("cwru", real_root)
    faulty = records.select(lambda c: c.fault != "healthy")
    assert len(faulty.groups) == 36
    assert len({c.extra["bearing_id"] for c in faulty.conditions}) == 9
    assert {c.fs_hz for c in records.conditions} == {12_000.0}
    for c in records.conditions:
        assert c.speed_rpm == pytest.approx({0: 1797, 1: 1772, 2: 1750, 3: 1730}[c.extra["load_hp"]], abs=10)
    sources = {c.group: c.extra["source"] for c in records.conditions}
    if sources.get("99") != "original" and "99" in sources:
        assert sources["99"] == "third-party conversion 99_repacked.mat"
    # A fault is louder than health at the same load, on every load.
    for hp in (0, 2):
        healthy = where(records, [f"load_hp={hp}", "fault=healthy"])
        inner = where(records, [f"load_hp={hp}", "fault=inner"])
        assert min(r.samples.std() for r in inner) > max(r.samples.std() for r in healthy)


def test_cwru_channels(real_root: Path) -> None:
    base = load("cwru", real_root, channel="BA")
    assert len(base) == 36
    assert {c.fault for c in base.conditions} == {"inner", "ball", "outer"}
    assert len(load("cwru", real_root, channel="FE").groups) >= 38


def test_cwru_cut_into_seconds_keeps_its_groups(real_root: Path) -> None:
    records = where(load("cwru", real_root), ["load_hp=2", "fault=outer"])
    pieces = cut(records, duration_s=1.0)
    assert len(pieces) == 30
    assert pieces.groups == records.groups
    whole = np.concatenate([piece.samples for piece in pieces[:10]])
    np.testing.assert_array_equal(whole, records[0].samples[: whole.size])


@pytest.mark.parametrize(("name", "order"), [("OR8_1200", "bpfo"), ("OR5_900", "bpfo"), ("IR8_1200", "bpfi")])
def test_hit_sm_envelope_peaks_near_the_fault_order(real_root: Path, name: str, order: str) -> None:
    records = load("hit_sm", real_root)
    assert len(records) == 21
    [record] = where(records, [f"record={name}"])
    assert records.bearing is not None
    found = strongest_order(record, 2.5, 6.5, (2000, 20_000))
    assert found == pytest.approx(getattr(records.bearing, order), rel=0.03)


def test_femto_runs_end_louder_than_they_began(real_root: Path) -> None:
    records = load("femto", real_root)
    runs = records.groups
    assert len(runs) >= 6
    for run in runs[:6]:
        places = [i for i, c in enumerate(records.conditions) if c.group == run]
        early = np.mean([records[i].samples.std() for i in places[:20]])
        late = np.mean([records[i].samples.std() for i in places[-20:]])
        assert late > 1.5 * early
        times = [records.conditions[i].time_s for i in places]
        assert times == sorted(times)  # type: ignore[type-var]


@pytest.mark.parametrize(("test", "rows"), [(1, 2156 * 8), (2, 984 * 4), (3, 6324 * 4)])
def test_ims_features_are_whole_and_consistent(real_root: Path, test: int, rows: int) -> None:
    table = ims_features(real_root, test=test)
    assert len(table) == rows
    assert table["time_s"].min() == 0
    # rms^2 = mean^2 + std^2 to the table's own precision: channels were not mixed up.
    np.testing.assert_allclose(table["rms"] ** 2, table["mean"] ** 2 + table["std"] ** 2, rtol=1e-6)
    if test == 2:
        failing, healthy = (table[(table.bearing == b) & (table.time_s > 500_000)]["rms"].median() for b in (1, 4))
        assert failing > 2 * healthy
