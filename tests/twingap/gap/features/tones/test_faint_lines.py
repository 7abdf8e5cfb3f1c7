"""Lines that all records share and that are faint in each are found; noise, gears and other impacts have none."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from twingap.bearing import Bearing
from twingap.gap.features.tones import faint_harmonics, faint_mains, side_lines
from twingap.gap.features.tones.fine_spectra import FineSpectra
from twingap.gap.features.tones.whitened_spectra import whiten
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

BEARING = Bearing("6205", 9, 7.94, 39.04)
FS_HZ, SECONDS, RECORDS = 20_000.0, 1.0, 24
SPEEDS = (1130.0, 1490.0, 1790.0, 2210.0)
FAINT = 0.025
"""Amplitude of a line whose power in one record is 3 times that of white noise of unit variance in its bin."""

Lines = Sequence[tuple[float, float, float]]  # frequency, Hz; shaft orders added to it; amplitude


def spectra(lines: Lines, seed: int = 0, speeds: Sequence[float] = SPEEDS, faulty: bool = False, off: float = 0.0):
    """Fine spectra of noise with lines; stated speeds are off by this standard deviation."""
    rng, frame = np.random.default_rng(seed), Frame(BEARING, (0.0, FS_HZ / 2), 1.0)
    t = np.arange(round(FS_HZ * SECONDS)) / FS_HZ
    white = []
    for k in range(RECORDS):
        stated = speeds[k % len(speeds)]
        shaft_hz = stated / 60 * (1 + off * rng.standard_normal())
        x = rng.standard_normal(t.size)
        for hz, order, amplitude in lines:
            x += amplitude * np.cos(2 * np.pi * ((hz + order * shaft_hz) * t + rng.random()))
        fault = "inner" if faulty and k >= RECORDS // 2 else "healthy"
        condition = Condition(f"r{k}", stated, FS_HZ, t.size, fault)
        white.append(whiten(RecordTransforms(x, condition, frame)))
    return FineSpectra.of(white)


def drive(own: float, side: float, order: float = 4.0, hz: float = 3217.3) -> Lines:
    return [(hz, 0.0, own), (hz, -order, side), (hz, order, side)]


@pytest.mark.parametrize("own", [0.0, FAINT], ids=["suppressed", "carrier"])
@pytest.mark.parametrize("off", [0.0, 0.005])
def test_a_faint_drive_is_found_with_its_carrier_and_order(own: float, off: float) -> None:
    found = side_lines.strongest(spectra(drive(own, 1.3 * FAINT), off=off))
    assert found.carrier_hz == pytest.approx(3217.3, abs=1.0)
    assert found.order == 4.0
    assert found.z > found.rival_z + 1.95
    assert found.z > 6.5
    assert np.exp(found.level_log) == pytest.approx(1.3 * FAINT, rel=0.3)
    if own:
        assert np.exp(found.own_level_log) == pytest.approx(own, rel=0.3)


@pytest.mark.parametrize("hz", [(50.0, 100.0, 150.0), (60.0,), (120.0, 240.0, 360.0)], ids=str)
def test_a_faint_hum_is_found(hz: Sequence[float]) -> None:
    found = faint_mains.strongest(spectra([(one, 0.0, 1.2 * FAINT) for one in hz]))
    assert found.mains_hz == (50.0 if hz[0] == 50.0 else 60.0)
    assert found.z > max(found.rival_z + 1.95, 5.0)
    if hz[0] in (50.0, 60.0):
        assert np.exp(found.level_log) == pytest.approx(1.2 * FAINT, rel=0.3)


@pytest.mark.parametrize("orders", [(1.0,), (2.0,), (1.0, 2.0, 3.0)], ids=str)
def test_faint_harmonics_of_the_shaft_are_found(orders: Sequence[float]) -> None:
    found = faint_harmonics.strongest(spectra([(0.0, order, 1.5 * FAINT) for order in orders], off=0.002))
    assert found.z > max(found.rival_z + 1.95, 5.0)
    assert found.half_z < 4.0
    assert np.exp(found.level_logs[int(orders[0]) - 1]) == pytest.approx(1.5 * FAINT, rel=0.35)


def test_noise_has_no_such_lines() -> None:
    certain = np.zeros(3, int)
    for seed in range(40):
        of = spectra([], seed=100 + seed, faulty=bool(seed % 2))
        sides, mains, shaft = side_lines.strongest(of), faint_mains.strongest(of), faint_harmonics.strongest(of)
        certain += [
            sides.z > max(sides.rival_z + 1.95, 6.5), mains.z > max(mains.rival_z + 1.95, 5.0),
            shaft.z > max(shaft.rival_z + 1.95, 5.0),
        ]  # fmt: skip
    assert (certain <= 1).all()


@pytest.mark.parametrize("amplitude", [FAINT, 0.3])
def test_lines_of_a_gear_and_of_a_loose_part_are_not_taken_for_others(amplitude: float) -> None:
    gear = spectra([(0.0, 41.0 + k, amplitude) for k in (-1, 0, 1)])
    found = side_lines.strongest(gear)
    assert found.z < max(found.rival_z + 1.95, 6.5)
    loose = faint_harmonics.strongest(spectra([(0.0, 0.5 * k, amplitude) for k in range(1, 9)]))
    assert loose.half_z > 4.0


def test_a_line_in_one_state_or_at_one_speed_is_not_shared() -> None:
    rng, frame = np.random.default_rng(5), Frame(BEARING, (0.0, FS_HZ / 2), 1.0)
    t = np.arange(round(FS_HZ * SECONDS)) / FS_HZ
    for with_lines in (lambda k: k < 8, lambda k: k % 4 == 0):
        white = []
        for k in range(RECORDS):
            speed = SPEEDS[k % 4]
            x = rng.standard_normal(t.size)
            if with_lines(k):
                for hz, order, _ in drive(1.0, 1.0):
                    x += 0.3 * np.cos(2 * np.pi * ((hz + order * speed / 60) * t + rng.random()))
            kind = "outer" if k < 8 else "healthy"
            white.append(whiten(RecordTransforms(x, Condition(f"r{k}", speed, FS_HZ, t.size, kind), frame)))
        found = side_lines.strongest(FineSpectra.of(white))
        assert found.z < max(found.rival_z + 1.95, 6.5)


def test_at_one_speed_a_gear_and_a_drive_cannot_be_told_apart() -> None:
    assert side_lines.strongest(spectra(drive(FAINT, FAINT), speeds=(1790.0,))) is None


def test_few_records_say_nothing_and_longer_ones_share_their_axis() -> None:
    frame = Frame(BEARING, (0.0, FS_HZ / 2), 1.0)
    rng = np.random.default_rng(3)

    def record(k: int, seconds: float) -> RecordTransforms:
        t, shaft_hz = np.arange(round(FS_HZ * seconds)) / FS_HZ, SPEEDS[k % 4] / 60
        x = rng.standard_normal(t.size)
        for hz, order, amplitude in drive(0.0, 0.05):
            x += amplitude * np.cos(2 * np.pi * ((hz + order * shaft_hz) * t + rng.random()))
        return RecordTransforms(x, Condition(f"r{k}", SPEEDS[k % 4], FS_HZ, t.size, "healthy"), frame)

    assert FineSpectra.of([whiten(record(k, 1.0)) for k in range(5)]) is None
    mixed = [whiten(record(k, seconds)) for k, seconds in zip(range(12), itertools.cycle((1.0, 1.7)))]
    found = side_lines.strongest(FineSpectra.of(mixed))
    assert found.carrier_hz == pytest.approx(3217.3, abs=1.5)
    assert found.order == 4.0
