"""Limits of lines are those of noise, and of other lines in the band of impacts; which lines are the same."""

from __future__ import annotations

import numpy as np
import pytest

from tests.twingap.gap.search.test_free_spectra import evidence_of
from twingap.effects import make_effect
from twingap.gap.search.free_spectra import LINES, measured
from twingap.gap.search.missing_lines import _PART, Line, _joined, _limit


def test_noise_exceeds_the_limit_of_lines_as_often_as_stated() -> None:
    """And where most places are those of lines, the limit is hardly higher: none is hidden by the others."""
    rng = np.random.default_rng(3)
    records, bins, count, level = 8, 3, 40_000, 2e-3
    power = rng.exponential(size=(records, count, bins)).max(axis=2) / np.log(2)
    heights = np.quantile(np.log(power), _PART, axis=0, method="lower")
    limit = _limit(heights, records, bins, level)
    assert np.mean(heights > limit) == pytest.approx(level, rel=0.4)
    lines = rng.uniform(size=count) < 0.7
    assert _limit(heights + 3.0 * lines, records, bins, level) == pytest.approx(limit, abs=0.25)


def test_records_at_one_speed_do_not_decide_what_a_line_is_tied_to() -> None:
    """Of lines of all records and of records at 30 Hz alone: one is both, and as strong as these records have it."""
    common = [Line(10.0, 1.0, by_order=True), Line(700.0, 0.5, by_order=False)]
    own = [Line(300.1, 2.0, by_order=False), Line(900.0, 0.3, by_order=False)]
    joined = _joined(common, own, 30.0, 1.0)
    assert joined == [Line(10.0, 2.0, by_order=True), Line(700.0, 0.5, by_order=False), own[1]]


def test_of_many_lines_those_in_the_band_of_impacts_are_left_to_them() -> None:
    """Lines 9 Hz apart, as side lines of impacts lie: outside of the band, they are found."""
    places = np.arange(1300.0, 3300.0, 9.0)
    amplitudes = 0.3 * np.random.default_rng(0).uniform(0.5, 1.5, places.size)
    comb = make_effect(LINES, {"frequencies_hz": tuple(places.tolist()), "amplitudes": tuple(amplitudes.tolist())})
    evidence = evidence_of(comb, faults=("healthy", "outer"), n=6)
    _, (lines,) = measured(evidence, evidence.against().simulator, (), (LINES,)) or pytest.fail()
    found = np.array(lines.parameter_values()["frequencies_hz"])
    hit = np.abs(found - places[:, None]).min(axis=1) < 1.5
    low, high = evidence.frame.band_hz
    inside = (places > low) & (places < high)
    assert hit[inside].mean() < 0.1 and hit[~inside].mean() > 0.9


def test_lines_about_a_carrier_are_found_at_their_orders() -> None:
    """All of one drive, and none of them a second time as a line in Hz."""
    drive = make_effect(LINES, {
        "frequencies_hz": (), "amplitudes": (), "orders": (), "order_amplitudes": (), "carriers_hz": (1900.0,) * 4,
        "carrier_orders": (-4.0, -2.0, 2.0, 4.0), "carrier_amplitudes": (0.2, 0.4, 0.4, 0.2),
    })  # fmt: skip
    evidence = evidence_of(drive, faults=("healthy", "outer"), n=8)
    _, (lines,) = measured(evidence, evidence.against().simulator, (), (LINES,)) or pytest.fail()
    found = lines.parameter_values()
    assert sorted(found["carrier_orders"]) == [-4.0, -2.0, 2.0, 4.0]
    np.testing.assert_allclose(found["carriers_hz"], 1900.0, atol=1.5)
    strength = dict(zip(found["carrier_orders"], found["carrier_amplitudes"], strict=True))
    assert [strength[order] for order in (-4.0, -2.0, 2.0, 4.0)] == pytest.approx([0.2, 0.4, 0.4, 0.2], rel=0.35)
    assert not found["frequencies_hz"] and not found["orders"]
