"""Clipped samples, settling sensors and electrical spikes are found, and nothing else is taken for them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from twingap.records.artefacts import clipped_samples, without_settling, without_spikes

X = np.random.default_rng(0).standard_normal(4096)


def test_clipped_samples_are_counted() -> None:
    assert clipped_samples(np.clip(X, -2, 2)) == int(np.count_nonzero(np.abs(X) >= 2))
    assert clipped_samples(np.clip(X, -9, 2)) == int(np.count_nonzero(X >= 2))
    assert clipped_samples(np.round(np.clip(X, -2, 2), 2)) == int(np.count_nonzero(np.abs(np.round(X, 2)) >= 2))


@given(levels=st.integers(2, 4000), phase=st.floats(0, 1), seed=st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_quantised_signals_are_not_clipped(levels: int, phase: float, seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal(4096)
    tone = np.sin(2 * np.pi * (0.01234 * np.arange(4096) + phase))
    assert clipped_samples(np.round(noise * levels / 4)) == 0
    assert clipped_samples(np.round(tone * levels + phase)) == 0


@pytest.mark.parametrize("tau", [0.03, 0.2, 0.8])
def test_an_exponential_offset_is_removed(tau: float) -> None:
    offset = 30 * np.exp(-np.arange(4096) / 4096 / tau)
    settled, found = without_settling(X + offset)
    assert found == pytest.approx(30, rel=0.05)
    assert abs((settled - settled.mean()) - (X - X.mean())).max() < 0.5


@pytest.mark.parametrize(
    "x",
    [
        X,
        X + 20,
        X + 3 * np.sin(np.arange(4096) / 300),
        X * (1 + 5 * np.exp(-np.arange(4096) / 500)),
        X + 0.5 * np.exp(-np.arange(4096) / 800),
        np.sin(np.arange(4096) / 3) * np.exp(-np.arange(4096) / 800),
        np.ones(4096),
        X[:100],
    ],
)
def test_what_is_no_settling_stays_as_it_is(x: np.ndarray) -> None:
    settled, offset = without_settling(x)
    assert offset == 0
    assert settled is x


@given(place=st.integers(1, 4094), height=st.floats(40, 1e6), sign=st.sampled_from([-1, 1]), seed=st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_a_spike_of_one_sample_is_taken_out(place: int, height: float, sign: int, seed: int) -> None:
    x = np.random.default_rng(seed).standard_normal(4096)
    spiky = x.copy()
    spiky[place] = sign * height
    cleaned, count = without_spikes(spiky)
    assert count == 1
    assert np.array_equal(np.delete(cleaned, place), np.delete(x, place))
    assert cleaned[place] == (x[place - 1] + x[place + 1]) / 2


def test_impacts_whose_response_is_short_are_no_spikes() -> None:
    """Behind a linear-phase filter at 0.45 of the sampling rate; those that fall on a sample leave others small."""
    x, n = X.copy(), np.arange(X.size)
    for i in range(16):
        x += 40 * np.sinc(0.9 * (n - 100 - (240 + i / 16) * i))
    assert without_spikes(x)[1] == 0
    alone = X + 40 * np.sinc(0.9 * (n - 100))
    assert without_spikes(alone)[1] == 1, "the first of them, by itself"


@given(
    resonance=st.floats(0.02, 0.49),
    quality=st.floats(10, 100),
    between=st.floats(0, 1),
    height=st.floats(40, 1e4),
    seed=st.integers(0, 99),
)
@example(resonance=0.25, quality=10, between=0, height=60, seed=0)  # every second sample is zero
@settings(max_examples=200, deadline=None)
def test_an_impact_that_rings_is_no_spike(
    resonance: float, quality: float, between: float, height: float, seed: int
) -> None:
    """At any resonance below half the sampling rate, wherever the impact falls between samples."""
    since = np.arange(200) + between
    ring = np.exp(-np.pi * resonance / quality * since) * np.sin(2 * np.pi * resonance * since)
    x = np.random.default_rng(seed).standard_normal(4096)
    x[1000:1200] += height * ring / np.abs(ring).max()
    assert without_spikes(x)[1] == 0
