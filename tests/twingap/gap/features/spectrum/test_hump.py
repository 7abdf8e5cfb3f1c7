"""A mode that the twin lacks is a narrow hump of all records; what is none is not taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.twingap.gap.features.spectrum.test_change import FS_HZ, summaries
from twingap.effects import Effect, make_effect
from twingap.gap.features.spectrum import hump

FAULTS = ("healthy",) * 8 + ("outer", "inner") * 8


def compared(*effects: Effect, seed: int = 1) -> dict[str, float]:
    """Sixteen records with these effects against simulations without."""
    own = {"modes": (), "faults": FAULTS}
    return hump.compare(summaries(effects, seed, **own), summaries(seed=seed + 1000, **own))


@pytest.mark.parametrize("place", [0.06, 0.11, 0.31])
@pytest.mark.parametrize("damping_ratio", [0.012, 0.03])
def test_a_weak_mode_is_found_where_it_is(place: float, damping_ratio: float) -> None:
    more = {"frequency_hz": place * FS_HZ, "damping_ratio": damping_ratio, "gain": 0.15 * place / 0.06}
    found = compared(make_effect("second_resonance", more))
    assert found["hump"] > 6 and found["hump_rival"] < 0.5 * found["hump"]
    assert found["hump_fs"] == pytest.approx(place, rel=0.06)
    assert found["hump_damping"] == pytest.approx(damping_ratio, rel=0.6)
    assert found["hump_unsteady"] < 0.7 and found["hump_level"] > 0.2


def test_machines_without_a_gap_have_none() -> None:
    heights = [compared(seed=seed)["hump"] for seed in range(30)]
    assert max(heights) < 6


@pytest.mark.parametrize(
    "effect",
    [
        make_effect("mains_interference", {"level": 3.0}),
        make_effect("line_spectrum", {"frequencies_hz": (3100.3, 3163.1), "amplitudes": (9.0, 4.0)}),
        make_effect("speed_gain"),
        make_effect("slip_jitter", {"sigma": 0.03}),
    ],
)
def test_lines_however_strong_and_effects_on_impacts_are_none(effect: Effect) -> None:
    found = compared(effect)
    assert not (found["hump"] > 6 and found["hump_rival"] < 0.5 * found["hump"] and found["hump_damping"] < 0.06)


def test_a_wide_band_of_noise_is_wide() -> None:
    found = compared(make_effect("coloured_noise", {"level": 1.0}))
    assert found["hump"] < 6 or found["hump_damping"] > 0.06 or found["hump_rival"] > 0.5 * found["hump"]


def test_few_records_and_two_sampling_rates_say_nothing() -> None:
    real, made = summaries(seed=1), summaries(seed=2)
    assert np.isnan(hump.compare(real[:3], made[:3])["hump"])
    assert np.isnan(hump.compare([*real[:-1], real[-1]._replace(fs_hz=2 * FS_HZ)], made)["hump"])
