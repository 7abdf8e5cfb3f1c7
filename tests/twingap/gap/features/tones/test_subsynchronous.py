"""A line below the shaft's order that all records share is found; noise and lines of one state are none."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.bearing import Bearing
from twingap.effects import subsynchronous as effects_subsynchronous
from twingap.gap.features.tones import subsynchronous
from twingap.gap.features.tones.whitened_spectra import Whitened, whiten
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

BEARING = Bearing("6205", 9, 7.94, 39.04)
FS_HZ, RECORDS = 8_000.0, 24
SPEEDS = (1130.0, 1490.0, 1790.0, 2210.0)
LEAST_LEVEL = effects_subsynchronous._LEVEL
"""ln of the power over its floor from which the diagnosis counts a line."""


def records(
    order: float, amplitude: float, *, seconds: float = 1.0, healthy_too: bool = True, seed: int = 0, fast: float = 1.0
):
    """Whitened spectra of noise with a line; half of the records are of a faulty bearing."""
    rng, frame = np.random.default_rng(seed), Frame(BEARING, (0.0, FS_HZ / 2), 1.0)
    t = np.arange(round(FS_HZ * seconds)) / FS_HZ
    white: list[Whitened] = []
    for k in range(RECORDS):
        fault, speed = ("inner", "healthy")[k % 2], SPEEDS[(k // 2) % len(SPEEDS)] * fast
        x = rng.standard_normal(t.size)
        if healthy_too or fault != "healthy":
            x += amplitude * np.cos(2 * np.pi * (order * speed / 60 * t + rng.random()))
        condition = Condition(f"r{k}", speed, FS_HZ, t.size, fault)
        white.append(whiten(RecordTransforms(x, condition, frame)))
    return white


@pytest.mark.parametrize("order", [0.31, 0.43, 0.5, 0.72])
def test_a_shared_line_is_found_at_its_order(order: float) -> None:
    found = subsynchronous.strongest(records(order, 0.3))
    assert found.order == pytest.approx(order, abs=0.01)
    assert abs(found.order - order) < 4 * found.error + 0.002
    assert found.share == 1.0
    assert found.level_log > LEAST_LEVEL


def test_a_line_near_half_the_shafts_order_is_told_from_one_at_it() -> None:
    """Within half a bin of a record of one second, from many records."""
    whirl, loose = (subsynchronous.strongest(records(order, 0.3)) for order in (0.46, 0.5))
    assert 0.5 - whirl.order > 4 * whirl.error
    assert abs(0.5 - loose.order) < 4 * loose.error + 0.002


def test_lines_of_one_state_are_not_shared() -> None:
    assert subsynchronous.strongest(records(0.4, 0.3, healthy_too=False)).share < 0.5


def test_noise_shares_no_line() -> None:
    found = [subsynchronous.strongest(records(0.4, 0.0, seed=seed)) for seed in range(20)]
    assert max(one.share for one in found) < 0.5
    assert max(one.level_log for one in found) < LEAST_LEVEL


def test_records_of_few_turns_have_no_known_line() -> None:
    assert subsynchronous.strongest(records(0.4, 0.3, seconds=0.25)) is None
    assert np.isnan(subsynchronous.measure(records(0.4, 0.3, seconds=0.25))).all()
    assert subsynchronous.strongest(records(0.4, 0.3)[:6]) is None


def test_hum_of_the_mains_is_no_line_of_the_shaft() -> None:
    """At three times these speeds, 50 Hz lies between 0.45 and 0.88 of the shaft's order."""
    rng, frame = np.random.default_rng(3), Frame(BEARING, (0.0, FS_HZ / 2), 1.0)
    t = np.arange(round(FS_HZ)) / FS_HZ
    white = []
    for k in range(RECORDS):
        x = rng.standard_normal(t.size) + 0.5 * np.cos(2 * np.pi * (50.0 * t + rng.random()))
        white.append(whiten(RecordTransforms(x, Condition(f"r{k}", 6600.0, FS_HZ, t.size, "healthy"), frame)))
    found = subsynchronous.strongest(white)
    assert abs(found.order * 110 - 50) > 2
    assert found.level_log < LEAST_LEVEL


def test_a_state_without_long_records_leaves_the_line_unknown() -> None:
    long = records(0.4, 0.3)
    short = [r._replace(shaft_hz=r.df_hz) if r.kind == "healthy" else r for r in long]
    assert subsynchronous.strongest(short) is None
