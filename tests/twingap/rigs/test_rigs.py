"""The virtual stand: its layout, its physics, and that the same seed gives the same bytes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.rigs import RIGS, digest, make_rig
from twingap.rigs.rolling import Impacts, force, impacts, move
from twingap.rigs.structure import Structure
from twingap.rigs.virtual_cwru import DIGESTS


def stand(duration_s: float, seed: int = 0) -> RecordSet:
    return make_rig("virtual_cwru", duration_s=duration_s).records(seed)


def envelope_lines(x: np.ndarray, fs_hz: float, speed_rpm: float) -> tuple[np.ndarray, np.ndarray]:
    """Orders and squared-envelope spectrum, written here apart from `twingap.signal`."""
    envelope = np.abs(signal.hilbert(x)) ** 2
    spectrum = np.abs(np.fft.rfft((envelope - envelope.mean()) * np.hanning(x.size)))
    return np.fft.rfftfreq(x.size, 1 / fs_hz) * 60 / speed_rpm, spectrum


def test_layout_is_that_of_the_public_set() -> None:
    records = stand(0.25)
    table = records.table
    assert len(records) == 40 and records.unit == "g" and records.bearing == BEARINGS["6205"]
    assert set(table["fs_hz"]) == {12_000.0} and set(table["n_samples"]) == {3000}
    assert table["group"].is_unique, "a group is a recording"
    assert table.groupby("bearing_id").size().tolist() == [4] * 10
    assert table.groupby("fault")["bearing_id"].nunique().to_dict() == {"healthy": 1, "inner": 3, "ball": 3, "outer": 3}
    assert set(table["load_hp"]) == {0, 1, 2, 3}


def test_same_seed_same_bytes_in_any_order() -> None:
    one, two = stand(0.25), stand(0.25)
    _ = two[39].samples  # asked for out of order
    assert digest(one) == digest(two)
    assert digest(one) != digest(stand(0.25, seed=1))
    np.testing.assert_array_equal(one[7].samples, stand(0.25).take([7])[0].samples)


def test_recorded_digest() -> None:
    assert digest(stand(1.0)) == DIGESTS[1.0]


@pytest.mark.parametrize("seed", [0, 3])
@pytest.mark.parametrize("fault", ["inner", "outer"])
def test_fault_lines_stand_out_within_slip(seed: int, fault: str) -> None:
    records = stand(4.0, seed).select(lambda c: c.fault == fault and c.extra["load_hp"] == 2)
    for record in records:
        c = record.condition
        order, spectrum = envelope_lines(record.samples, c.fs_hz, c.speed_rpm)
        expected = BEARINGS["6205"].fault_order(fault)
        near = np.abs(order - expected) < 0.02 * expected
        floor = np.median(spectrum[(order > 0.5) & (order < 20)])
        assert spectrum[near].max() > 5 * floor, c.name


def test_inner_race_fault_is_modulated_by_the_shaft_and_outer_is_not() -> None:
    records = stand(8.0).select(lambda c: c.extra["load_hp"] == 2 and c.extra["fault_size_inch"] == 0.014)
    side = {}
    for record in records:
        c = record.condition
        if c.fault not in ("inner", "outer"):
            continue
        order, spectrum = envelope_lines(record.samples, c.fs_hz, c.speed_rpm)
        middle = BEARINGS["6205"].fault_order(c.fault)
        line = spectrum[np.abs(order - middle) < 0.05].max()
        side[c.fault] = max(spectrum[np.abs(order - middle - s) < 0.05].max() for s in (-1, 1)) / line
    assert side["inner"] > 0.4 and side["outer"] < 0.2, side


def test_more_load_more_vibration() -> None:
    records = stand(2.0).select(lambda c: c.fault == "outer" and c.extra["fault_size_inch"] == 0.021)
    rms = [float(np.std(record.samples)) for record in records]
    assert rms == sorted(rms) and rms[-1] > 1.2 * rms[0]


def test_samples_sit_on_the_converters_grid() -> None:
    x = stand(0.25)[0].samples
    codes = x / (20.0 / 2**15)
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)


def test_strike_rates_are_kinematic() -> None:
    bearing, rng = BEARINGS["6205"], np.random.default_rng(0)
    motion = move(bearing, 1800.0, 240_000, 48_000.0, slip=0.0, rng=rng)
    for fault in ("inner", "outer", "ball"):
        pulses = impacts(bearing, fault, 0.36, 400.0, 0.5, motion, rng)
        rate = pulses.time_s.size / 2 / 5.0 / 30.0  # entry and exit; per shaft turn
        assert rate == pytest.approx(bearing.fault_order(fault), rel=0.01), fault


@settings(max_examples=25, deadline=None)
@given(at=st.floats(0.001, 0.009), width=st.floats(2e-4, 1e-3), strength=st.floats(-50, 50))
def test_a_pulse_keeps_its_impulse(at: float, width: float, strength: float) -> None:
    fs_hz = 96_000.0
    pulse = Impacts(np.array([at]), np.array([strength]), np.array([0.0]), np.array([width]))
    total = force(pulse, 1200, fs_hz)
    # The area of sin(pi s)^(3/2) over 0..1 is 0.5564 (a beta function).
    assert total[0].sum() / fs_hz == pytest.approx(0.55637 * strength * width, rel=0.02, abs=1e-9)
    np.testing.assert_allclose(total[1], 0.0, atol=1e-12)


def test_structure_rings_at_its_mode() -> None:
    structure = Structure(np.array([1000.0]), np.array([0.02]), np.array([[1.0], [0.0]]), np.array([1.0]))
    push = np.zeros((2, 48_000))
    push[0, 0] = 1.0
    ring = structure.acceleration(push, 48_000.0)
    spectrum = np.abs(np.fft.rfft(ring[1:]))
    peak = np.fft.rfftfreq(47_999, 1 / 48_000.0)[spectrum.argmax()]
    assert peak == pytest.approx(1000.0, abs=5)
    # Logarithmic decrement: amplitude falls by exp(-zeta w t).
    early, late = np.abs(ring[1:481]).max(), np.abs(ring[481:961]).max()
    assert late / early == pytest.approx(np.exp(-0.02 * 2 * np.pi * 1000 * 0.01), rel=0.05)


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_goes_by_its_name(name: str) -> None:
    rig = make_rig(name)
    assert rig.name == name
    assert rig.records(0).name == name


def test_mistakes_are_explained() -> None:
    with pytest.raises(TwingapError, match=r"unknown rig 'nope'; known rigs: .*virtual_cwru"):
        make_rig("nope")
    with pytest.raises(TwingapError, match="unknown option"):
        make_rig("virtual_cwru", colour=1)
    with pytest.raises(TwingapError, match="duration_s = -1"):
        make_rig("virtual_cwru", duration_s=-1)


def test_stated_speeds_are_wrong_by_three_to_six_per_cent() -> None:
    for seed in range(4):
        records = make_rig("wrong_speeds", records_per_class=3).records(seed)
        off = [abs(float(c.extra["true_rpm"]) / c.speed_rpm - 1) for c in records.conditions]
        assert min(off) >= 0.03 - 1e-9 and max(off) <= 0.06 + 1e-9
        assert {c.fault for c in records.conditions} == {"healthy", "inner", "outer", "ball"} and len(records) == 12
    one, two = (make_rig("wrong_speeds", records_per_class=3).records(0)[5].samples for _ in range(2))
    np.testing.assert_array_equal(one, two)
    with pytest.raises(TwingapError, match="records_per_class = 2"):
        make_rig("wrong_speeds", records_per_class=2)
