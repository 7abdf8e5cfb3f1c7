"""The rate of impacts is read where their lines show it, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.records import Condition, Record, RecordSet
from twingap.signal.impact_rate import rate_ratio

BEARING = BEARINGS["6205"]
FS_HZ = 12000.0


def records(
    fault: str, ratio: float, *, jitter: float = 0.0, strength: float = 12.0, seed: int = 0, lines: int = 30
) -> RecordSet:
    """Four records of two seconds at two speeds, of impacts at this ratio to the kinematic rate, and a loud shaft."""
    rng, made = np.random.default_rng(seed), []
    for i, rpm in enumerate((1796.0, 1796.0, 1750.0, 1750.0)):
        condition = Condition(f"{fault}{i}", rpm, FS_HZ, 24000, fault)
        t = np.arange(24000) / FS_HZ
        x = rng.standard_normal(t.size) + sum(3 * np.cos(2 * np.pi * k * rpm / 60 * t) for k in range(1, lines))
        period = 60 / rpm / (ratio * BEARING.fault_order(fault))
        at = np.arange(0.3, 2.0 / period) * period
        at += jitter * period * rng.standard_normal(at.size)
        pulses = np.bincount(np.clip((at * FS_HZ).round().astype(int), 0, t.size - 1), minlength=t.size)
        ring = np.exp(-900 * t[:300]) * np.sin(2 * np.pi * 3200 * t[:300])
        made.append(Record(condition, x + strength * np.convolve(pulses, ring)[: t.size]))
    return RecordSet.from_records("machine", "g", BEARING, made)


@pytest.mark.parametrize("fault", ["inner", "outer", "ball"])
@pytest.mark.parametrize("ratio", [0.9925, 1.0, 1.0041, 1.016])
def test_the_rate_is_read(fault: str, ratio: float) -> None:
    assert rate_ratio(records(fault, ratio), BEARING.fault_order(fault)) == pytest.approx(ratio, abs=2e-4)
    assert rate_ratio(records(fault, ratio, jitter=0.01, seed=1), BEARING.fault_order(fault)) == pytest.approx(
        ratio, abs=3e-4
    )


def test_none_is_read_without_impacts_or_off_a_shaft_that_has_many_lines() -> None:
    found = [rate_ratio(records(fault, 1.0, strength=0.0, seed=seed), BEARING.fault_order(fault))
             for fault in ("inner", "outer", "ball") for seed in range(30)]  # fmt: skip
    assert np.mean(np.isfinite(found)) <= 0.02
    # Lines of the shaft at multiples of 5 are no impacts that strike five times a turn.
    assert np.isnan(rate_ratio(records("outer", 1.0, strength=0.0, lines=190), 5.03))
