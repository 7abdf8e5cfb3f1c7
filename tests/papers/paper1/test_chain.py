"""The method from amplitudes to lives, on runs whose S, onset, rate and end are known; and that it only looks back."""

import numpy as np
import pytest

from papers.paper1_rul_varying_speed.methods.degradation import (
    DamageFit,
    Trajectory,
    damage,
    end_row,
    fit_damage,
    trajectories,
)
from twingap.prognosis import detect_anomaly, fit_speed_influence, normalised_peak_to_peak
from twingap.prognosis.anomaly import Array

STEPS = np.arange(1000.0, 2001.0, 100.0)
PROFILE = np.tile(np.repeat(np.concatenate((STEPS, STEPS[-2:0:-1])), 6), 15)
"""10 s rows, 60 s a step: 5 hours."""
ONSET, RATE, LIMIT, HEALTHY, SEEN = 700, 0.006, 15.0, 240, 60


def run(seed: int) -> Array:
    """Peak to peak: resonance at 1400 rpm, exponential damage, extremes' scatter of 4 %."""
    clean = PROFILE / 1000 + 1 / (1 + ((PROFILE - 1400) / 80) ** 2)
    scatter = np.exp(0.04 * np.random.default_rng(seed).gumbel(size=PROFILE.size))
    return clean * damage(np.arange(PROFILE.size), RATE, ONSET) * scatter


def chain(p: Array) -> tuple[int, DamageFit, list[Trajectory]]:
    """What is known `SEEN` rows (10 minutes, as in the paper) after the alarm."""
    speed = PROFILE[: p.size]
    influence = fit_speed_influence(p[:HEALTHY], speed[:HEALTHY])
    normalised = normalised_peak_to_peak(p, speed, influence)
    found = detect_anomaly(normalised, HEALTHY, speeds=influence.speeds_rpm.size)
    assert found.onset_row is not None and found.alarm_row is not None
    now = found.alarm_row + SEEN
    fit = fit_damage(np.arange(now + 1), normalised[: now + 1], found.onset_row, level="free")
    lives = trajectories(fit, influence, PROFILE[found.onset_row :], 10.0, LIMIT, not_before_row=now)
    return now, fit, lives


@pytest.mark.parametrize("seed", range(4))
def test_the_true_end_lies_among_the_lives(seed: int) -> None:
    p = run(seed)
    end = end_row(p, LIMIT)
    assert end is not None
    _, fit, lives = chain(p)
    assert ONSET - 5 <= fit.onset <= ONSET + 0.05 * end
    assert fit.rate == pytest.approx(RATE, rel=0.2)
    # One minute of grace: with a few rows' scatter a real run crosses before a smooth one.
    assert lives[0].end_row - 6 <= end <= lives[-1].end_row + 6


def test_the_chain_only_looks_back() -> None:
    p = run(0)
    now, fit, lives = chain(p)
    cut_now, cut_fit, cut_lives = chain(p[: now + 1])
    assert (cut_now, cut_fit) == (now, fit)
    assert [life.rate for life in cut_lives] == [life.rate for life in lives]


def test_the_printed_level_takes_late_detection_for_fast_growth() -> None:
    p = run(1)
    now, free, _ = chain(p)
    influence = fit_speed_influence(p[:HEALTHY], PROFILE[:HEALTHY])
    normalised = normalised_peak_to_peak(p[: now + 1], PROFILE[: now + 1], influence)
    printed = fit_damage(np.arange(now + 1), normalised, free.onset)
    assert free.onset > ONSET and printed.rate > 1.25 * RATE > free.rate
