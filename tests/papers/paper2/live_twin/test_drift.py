"""The drift detector's rate of false alarms: against textbook run lengths and against simulation."""

from __future__ import annotations

import numpy as np
import pytest

from papers.paper2_digital_twin.live_twin.drift import DriftDetector, false_alarms, run_length, threshold_for
from twingap.errors import TwingapError


@pytest.mark.parametrize(("threshold", "expected"), [(4.0, 335.4), (5.0, 930.9)])
def test_run_length_is_the_textbooks(threshold: float, expected: float) -> None:
    """One-sided, allowance 1/2: Montgomery, Introduction to Statistical Quality Control, twice the two-sided values."""
    assert run_length(threshold, 0.5) == pytest.approx(expected, rel=0.005)


def test_run_length_falls_with_drift_and_grows_with_threshold() -> None:
    lengths = [run_length(5.0, 1.0, drift) for drift in (0.0, 0.5, 1.0, 2.0, 4.0)]
    assert lengths == sorted(lengths, reverse=True) and lengths[-1] < 4
    assert run_length(3.0, 1.0) < run_length(4.0, 1.0)


@pytest.mark.parametrize("baseline", [None, 6])
def test_simulated_rate_of_false_alarms_is_the_stated_one(baseline: int | None) -> None:
    """Runs of a hundred samples against a known or an averaged mean; three charts; a new start after an alarm."""
    rate, rng, alarms, runs, length = 0.01, np.random.default_rng(1), 0, 250, 100
    detector = DriftDetector("abc", rate, 1.0, baseline)
    for _ in range(runs):
        offset = 0.0 if baseline is None else rng.standard_normal((baseline, 3)).mean(axis=0)
        detector.reset()
        for z in rng.standard_normal((length, 3)) - offset:
            if detector.push(z) is not None:
                alarms += 1
                detector.reset()
    seen = alarms / (runs * length)
    assert 0.6 * rate < seen < 1.25 * rate


def test_a_drift_is_found_soon_and_named_with_its_direction_and_beginning() -> None:
    detector, rng = DriftDetector(("stiffness", "damping"), 0.001, 1.0), np.random.default_rng(2)
    for n in range(60):
        alarm = detector.push(rng.standard_normal(2) + np.array([0.0, -3.0 if n >= 40 else 0.0]))
        if alarm is not None:
            break
    assert alarm is not None and (alarm.chart, alarm.direction) == ("damping", "down")
    assert 40 <= n <= 46 and abs(alarm.since - (n - 40 + 1)) <= 2


def test_a_higher_rate_means_a_lower_threshold_and_none_is_found_for_an_impossible_one() -> None:
    assert threshold_for(0.05, 1.0, 3) < threshold_for(0.001, 1.0, 3) < threshold_for(0.001, 1.0, 3, 10)
    assert false_alarms(threshold_for(0.002, 1.0, 3, 10), 1.0, 3, 10) == pytest.approx(0.002, rel=0.02)
    with pytest.raises(TwingapError, match="no threshold below"):
        threshold_for(1e-4, 0.25, 3, 1)
