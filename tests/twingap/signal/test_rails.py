"""Rails are found however seldom records reach them; falling densities, coarse converters and sines have none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from twingap.signal.rails import Extreme, best_rail, extremes

Array = NDArray[np.float64]
SURE = 4.0


def records(seed: int, count: int = 12, step: float = 0.0, sine: float = 0.0) -> list[Array]:
    rng = np.random.default_rng(seed)
    turns = 0.0123 * np.arange(8000)
    made = [rng.standard_normal(8000) + sine * np.sin(2 * np.pi * (turns + rng.random())) for _ in range(count)]
    return [step * np.round(x / step) if step else x for x in made]


def of(made: list[Array]) -> list[Extreme]:
    return [extreme for x in made for extreme in extremes(x)]


@pytest.mark.parametrize("step", [0.0, 0.01])
def test_a_rail_that_one_sample_in_thousands_reaches_is_found(step: float) -> None:
    made = [np.clip(x, None, 3.0) for x in records(1, step=step)]
    assert 10 < sum(int(np.count_nonzero(x == x.max())) for x in made if x.max() > 2.999) < 200
    rail = best_rail(of(made))
    assert rail.evidence > 6
    assert rail.level == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_lower_rail_is_found_as_the_upper_one_in_any_unit(sign: int, unit: float) -> None:
    rail = best_rail(of([unit * sign * np.clip(x, None, 3.0) for x in records(2)]))
    assert rail.evidence > 6
    assert rail.level == pytest.approx(3.0 * sign * unit)


@given(
    seed=st.integers(0, 2**32),
    step=st.one_of(st.just(0.0), st.floats(1e-4, 3.0)),
    sine=st.one_of(st.just(0.0), st.floats(0.1, 20.0)),
)
def test_noise_and_sines_have_no_rail_at_any_resolution(seed: int, step: float, sine: float) -> None:
    assert best_rail(of(records(seed, step=step, sine=sine))).evidence < SURE


def test_evidence_of_machines_without_a_rail_is_no_larger_than_it_states() -> None:
    found = [best_rail(of(records(seed, 6, step))).evidence for seed in range(60) for step in (1e-4, 1e-3, 0.01, 0.1)]
    assert np.mean(np.array(found) > 1) <= 0.1


def test_three_equal_peaks_of_one_record_in_many_are_chance() -> None:
    """On 16 bits, one of hundreds of extremes is reached three times where impacts are alike."""
    alike = Extreme(0.665, visits=3, inside=0, repeated=0, levels=655.0)
    others = [Extreme(0.5 + 0.001 * k, visits=1, inside=20, repeated=1, levels=655.0) for k in range(150)]
    assert best_rail([alike, *others]).evidence < SURE - 1
    assert best_rail([alike] * 4 + others).evidence > SURE, "four records agree"


def test_samples_in_a_row_are_one_visit() -> None:
    x = records(3, 1)[0]
    x[100:400] = x.max() + 0.5  # a stretch that the converter held
    assert extremes(x)[0].visits == 1


def test_levels_that_repeat_as_often_as_the_extreme_are_no_rail() -> None:
    waveform = np.tile(np.sin(2 * np.pi * np.arange(200) / 200), 40)  # without noise, every period is the same
    assert best_rail(of([waveform])).evidence == 0.0


def test_constant_records_have_no_rail() -> None:
    assert best_rail(of([np.zeros(100), np.full(100, 3.0)])).evidence == 0.0
    assert best_rail([]).evidence == 0.0
