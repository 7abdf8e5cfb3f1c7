"""The virtual Smart Maintenance rig (surrogate): its published frame, its lives, and that its truth stays apart."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from twingap.bearing import BEARINGS
from twingap.data import load
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.records.folder import read_record_set, write_record_set
from twingap.rigs import RunTruth, SmartMaintenanceRig, digest, make_rig, truth
from twingap.rigs.smart_maintenance import DIGEST, RUNS, TITLE

SMALL = SmartMaintenanceRig(interval_s=180.0, duration_s=0.1)
ONE = SmartMaintenanceRig(interval_s=300.0, duration_s=0.1, bearings=("A156",))


@pytest.fixture(scope="module")
def records() -> RecordSet:
    made = SMALL.records(0)
    return RecordSet.from_records(made.name, made.unit, made.bearing, made)


@pytest.fixture(scope="module")
def true() -> dict[str, RunTruth]:
    return truth(SMALL, 0)


def of(records: RecordSet, bearing_id: str) -> RecordSet:
    return records.select(lambda c: c.group == bearing_id)


def test_the_frame_is_the_published_one() -> None:
    rig = SmartMaintenanceRig()
    table = rig.records(0).table
    assert rig.n_samples == 25_000 and set(table["fs_hz"]) == {50_000.0} and set(table["load_n"]) == {9000.0}
    published = {"A148": 142.5, "A150": 197.5, "A153": 229.3, "A154": 126.0, "A155": 369.3, "A156": 251.3}
    last = table.groupby("group")["time_s"].max() / 60
    assert last.round(6).to_dict() == published
    assert (table.groupby("group")["time_s"].min() < 20).all()
    assert table.groupby("group")["time_s"].diff().dropna().round(6).unique().tolist() == [20.0]
    assert sorted(set(table["speed_rpm"])) == [float(s) for s in range(1000, 2001, 100)]
    assert "virtual" in rig.title and "surrogate" in rig.title and rig.title == TITLE


def test_a156_drops_abruptly_twice_after_its_onset() -> None:
    table = SmartMaintenanceRig(bearings=("A156",)).records(0).table
    after = table[table["time_s"] > 60 * 224.0]
    drops = after[after["speed_rpm"].diff() < -500]
    assert len(drops) == 2 and (drops["speed_rpm"] == 1000).all()
    np.testing.assert_allclose(drops["time_s"] / 60, [231, 242], atol=20 / 60)
    rises = after["speed_rpm"].diff().dropna()
    assert set(rises[rises > -500]) <= {0.0, 100.0}


def test_columns_are_those_of_the_real_sets_reader(tmp_path: Path, records: RecordSet) -> None:
    folder = tmp_path / "smart_maintenance" / "A148"
    folder.mkdir(parents=True)
    np.save(folder / "00001.npy", np.ones(100))
    (folder / "measurements.csv").write_text("file,time_s,speed_rpm\n00001.npy,0,1000\n", encoding="utf-8")
    real = load("smart_maintenance", tmp_path)
    mine, theirs = records.table, real.table
    assert list(mine.columns) == list(theirs.columns)
    assert (records.unit, records.bearing) == (real.unit, real.bearing)
    same = ["record", "fault", "load_n", "fs_hz", "group", "bearing_id", "end_fault", "end_of_life_peak_to_peak_g"]
    row = mine[mine["group"] == "A148"].iloc[0]
    assert row[same].to_dict() == theirs.iloc[0][same].to_dict()


def test_the_truth_is_not_in_the_records(records: RecordSet, true: dict[str, RunTruth], tmp_path: Path) -> None:
    assert records.table["anomaly_s"].isna().all()
    assert records.table["fault"].isna().all()
    numbers = records.table.select_dtypes("number").to_numpy()
    for life in true.values():
        assert not np.isclose(numbers, life.onset_s).any() and not np.isclose(numbers, life.spall_mm[-1]).any()
    few = records.take([0, 1])
    write_record_set(few, tmp_path / "set")
    assert read_record_set(tmp_path / "set").digest == few.digest


@pytest.mark.parametrize("bearing_id", RUNS)
def test_life_ends_at_15_g_with_the_last_snapshot_and_not_before(records: RecordSet, bearing_id: str) -> None:
    peak_to_peak = np.array([np.ptp(r.samples) for r in of(records, bearing_id)])
    assert 15.0 <= peak_to_peak[-1] < 15.5
    assert peak_to_peak[:-1].max() < 15.0


@pytest.mark.parametrize("bearing_id", RUNS)
def test_damage_begins_at_the_onset_and_shows(records: RecordSet, true: dict[str, RunTruth], bearing_id: str) -> None:
    life, run = true[bearing_id], of(records, bearing_id)
    assert life.onset_s == pytest.approx(60 * RUNS[bearing_id].onset_min)
    assert life.end_of_life_s == pytest.approx(60 * RUNS[bearing_id].duration_min)
    np.testing.assert_array_equal(life.time_s, [c.time_s for c in run.conditions])
    before = life.time_s <= life.onset_s
    assert np.all(life.spall_mm[before] == 0) and np.all(np.diff(life.spall_mm[~before]) > 0)
    assert life.damage[-1] == 1 and 1 < life.spall_mm[-1] < 8
    # Peak to peak over the healthy level of the same speed: level before the onset, far above it at the end.
    speed = np.array([c.speed_rpm for c in run.conditions])
    level = np.array([np.ptp(r.samples) for r in run])
    healthy = np.polyval(np.polyfit(speed[before], level[before], 2), speed)
    ratio = level / healthy
    assert abs(np.polyfit(life.time_s[before], ratio[before], 1)[0]) * life.onset_s < 0.15, "no trend while healthy"
    assert ratio[before].max() < 2 and ratio[-1] > 2.5
    assert np.corrcoef(life.damage[~before], ratio[~before])[0, 1] > 0.7


def test_what_remains_is_counted_in_turns_and_in_time(true: dict[str, RunTruth]) -> None:
    for life in true.values():
        assert life.remaining_turns[-1] == 0 and life.remaining_time_s[-1] == 0
        a_minute = np.diff(-life.remaining_turns) / 3
        assert np.all((a_minute >= 1000) & (a_minute <= 2000))
    constant = truth(SmartMaintenanceRig(300.0, 0.1, profile="constant", bearings=("A154",)), 0)["A154"]
    slope = np.diff(constant.remaining_turns / (1500 / 60)) / np.diff(constant.time_s)
    np.testing.assert_allclose(slope, -1, rtol=1e-9)


def test_the_last_records_ring_at_the_inner_races_order() -> None:
    rig = SmartMaintenanceRig(interval_s=300.0, bearings=("A150",))
    last = rig.records(0)[-1]
    envelope = np.abs(signal.hilbert(last.samples))
    spectrum = np.abs(np.fft.rfft((envelope - envelope.mean()) * np.hanning(envelope.size)))
    order = np.fft.rfftfreq(envelope.size, 1 / 50_000.0) * 60 / last.condition.speed_rpm
    bpfi = BEARINGS["6205"].bpfi
    floor = np.median(spectrum[order < 25])
    for k in (1, 2):
        assert spectrum[np.abs(order - k * bpfi) < 0.02 * k * bpfi].max() > 5 * floor
    assert spectrum[np.abs(order - 1) < 0.07].max() > 5 * floor, "a loaded zone, seen once a turn"


def test_same_seed_same_bytes_in_any_order_and_process() -> None:
    one, two = ONE.records(7), ONE.records(7)
    _ = two[-1].samples  # asked for out of order
    sent: RecordSet = pickle.loads(pickle.dumps(two))
    assert digest(one) == digest(two) == digest(sent)
    assert digest(one) != digest(ONE.records(8))
    more = SmartMaintenanceRig(interval_s=300.0, duration_s=0.1, bearings=("A148", "A156")).records(7)
    assert of(more, "A156")[3].samples.tobytes() == one[3].samples.tobytes()


def test_recorded_digest() -> None:
    assert digest(ONE.records(0)) == DIGEST


def test_it_is_made_by_name() -> None:
    assert make_rig("virtual_smart_maintenance", interval_s=180.0, duration_s=0.1) == SMALL


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"interval_s": 0.1}, "interval_s = 0.1, between 1 and 600"),
        ({"duration_s": float("nan")}, "duration_s = nan"),
        ({"interval_s": 2.0, "duration_s": 5.0}, "choose a duration shorter than the interval"),
        ({"bearings": ("A147",)}, "unknown bearing 'A147'; use A148, A150"),
        ({"bearings": ()}, "one or more different ones"),
        ({"bearings": ("A148", "A148")}, "one or more different ones"),
        ({"profile": "sine"}, "unknown shape 'sine'"),
    ],
)
def test_mistakes_are_explained(options: dict[str, object], said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        SmartMaintenanceRig(**options)  # type: ignore[arg-type]


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(TwingapError, match="seed = -1"):
        SMALL.records(-1)
