"""Combs sought in each record at the speed where they stand highest."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.gap.features.tones.aligned_combs import aligned
from twingap.gap.features.tones.whitened_spectra import NOISE, whiten
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

FRAME = Frame(BEARINGS["6205"], (2500.0, 4500.0), 1.0)


def record(x, rpm, fault="healthy"):
    condition = Condition("r", rpm, 12000.0, x.size, fault)
    return whiten(RecordTransforms(x, condition, FRAME))


def test_deviates_of_noise_are_small_and_of_unit_spread():
    kept = record(np.random.default_rng(0).standard_normal(60000), 1500.0)
    deviates = kept.deviates()[10:-10]
    assert abs(deviates.mean()) < 0.4
    assert deviates.std() == pytest.approx(1, abs=0.12)


def test_a_record_is_moved_to_where_its_comb_stands():
    rng, t, true = np.random.default_rng(1), np.arange(12000) / 12000, 25.0
    x = rng.standard_normal(12000) + 0.2 * sum(np.sin(2 * np.pi * k * 9 * true * t + k) for k in (1, 2))
    combs, weights = np.array([[9.0, 18.0], [10.0, 20.0]]), np.ones(2)
    for stated, reach in ((true, 0.002), (true * 1.02, 0.03), (true * 0.975, 0.03)):
        kept = record(x, 60 * stated)
        found = aligned([kept], [kept.deviates()], combs, weights, [reach])
        assert found.lines[0].min() > 3
        assert found.score[0, 0] > found.score[1, 0] + 3
    kept = record(x, 60 * true * 1.02)
    assert aligned([kept], [kept.deviates()], combs, weights, [0.002]).score[0, 0] < 5


def test_a_comb_beyond_the_record_is_unknown():
    kept = record(np.random.default_rng(2).standard_normal(12000), 1500.0)
    found = aligned([kept], [kept.deviates()], np.array([[9.0], [400.0]]), np.ones(1), [0.01])
    assert np.isfinite(found.score[0, 0]) and np.isnan(found.score[1, 0])
    assert np.isnan(found.mean()[1])


def test_a_defects_own_comb_counts_as_noise():
    """Only where its lines can be told from what lies between them."""
    t, rate = np.arange(12000) / 12000, BEARINGS["6205"].bpfo * 25.0
    x = np.random.default_rng(3).standard_normal(12000)
    x += sum(np.sin(2 * np.pi * k * rate * t) for k in range(1, 50))
    kept = record(x, 1500.0, "outer")
    own = np.rint(np.arange(1, 20) * kept.rate_hz / kept.df_hz).astype(int)
    assert kept.rate_hz == pytest.approx(rate, rel=2e-3)
    assert not kept.deviates()[own].any()
    assert np.allclose(kept.power()[own], NOISE, rtol=1e-3)


def test_levels_are_those_of_the_spectrum():
    t = np.arange(12000) / 12000
    x = np.random.default_rng(5).standard_normal(12000) + 0.5 * np.sin(2 * np.pi * 3000 * t)
    (level,) = record(x, 1500.0).level_logs(np.array([3000]))
    assert np.exp(level) == pytest.approx(0.5 * 0.5**2 / 2 + 0.5 * 0.25 * 0.5**2 / 2, rel=0.2)
