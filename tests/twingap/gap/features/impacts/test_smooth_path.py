"""Combs over harmonics where the twin's mode lies beside the machine's: those that go on are found, bends are none."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.features.impacts import impact_pair_comb, impulse_response
from twingap.gap.features.impacts.smooth_path import OverHarmonics, log_likelihood_ratios
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

RATIOS = np.array([0.1, 0.2, 0.35, 0.6, 0.9])
HARMONICS = np.arange(1, 61)


def mode(place, damping=0.06):
    """ln of the power of a mode over harmonics."""
    return -np.log((1 - (HARMONICS / place) ** 2) ** 2 + (2 * damping * HARMONICS / place) ** 2)


def ratio(seed, comb=0.0, part=0.21, beside=3.0):
    """Measured over simulated power: the mode's place is off, harmonics scatter by 15 %."""
    rng = np.random.default_rng(seed)
    bend = mode(24.0 + beside) - mode(24.0)
    teeth = np.log(np.abs(1 + comb * np.exp(2j * np.pi * part * HARMONICS)) ** 2)
    return bend + teeth + 0.15 * rng.standard_normal(HARMONICS.size)


def best(log, least=0.01):
    every = np.ones(HARMONICS.size)
    return log_likelihood_ratios(OverHarmonics(log, every, 0.02 * every, 0 * every), RATIOS, least)


@pytest.mark.parametrize("comb", [0.35, -0.35])
@pytest.mark.parametrize("seed", range(4))
def test_a_comb_is_found_beside_a_mode_that_is_out_of_place(comb, seed):
    gain = best(ratio(seed, comb))
    row, column = np.unravel_index(int(np.argmax(gain)), gain.shape)
    assert gain[row, column] > 20
    assert (1 if row == 0 else -1) * RATIOS[column] == comb


def test_a_mode_that_is_out_of_place_is_no_comb():
    """Of as many delays and ratios as are tried, the best of pure chance is about as likely as their number."""
    gains = [best(ratio(seed, beside=beside)).max() for seed in range(12) for beside in (0.0, 3.0, -4.0)]
    assert np.median(gains) < 7
    assert max(gains) < 16


def test_what_one_path_does_to_noise_and_impacts_alike_is_taken_out():
    every = np.ones(HARMONICS.size)
    bend = mode(30.0, 0.02) - mode(24.0, 0.02)
    log = bend + 0.05 * np.random.default_rng(0).standard_normal(HARMONICS.size)
    told, untold = (
        log_likelihood_ratios(OverHarmonics(log, every, 0.02 * every, path), RATIOS, 0.01).max()
        for path in (bend, 0 * every)
    )
    assert told < 8
    assert told < untold


def impact_spectra(bearing, place, effects=(), seed=0, fs_hz=20000.0):
    parameters = PhenomenologicalParameters(
        resonance_hz=place * fs_hz, damping_ratio=0.05, impact_amplitude={"outer": 12.0}
    )
    conditions = [Condition(f"r{s}", s, fs_hz, int(fs_hz), "outer") for s in (1100.0, 1450.0, 1900.0)]
    records = PhenomenologicalTwin(bearing, parameters, effects).simulate(conditions, np.random.default_rng(seed))
    frame = Frame(bearing, (0.15 * fs_hz, 0.25 * fs_hz), 1.0)
    return [impulse_response.impact_spectrum(RecordTransforms(r.samples, r.condition, frame)) for r in records]


@pytest.mark.parametrize("name", ["6205", "UER204", "ZA-2115"])
def test_records_of_a_second_impact_are_likelier_with_it_though_the_twin_has_another_mode(name):
    bearing = BEARINGS[name]
    effect = make_effect("entry_exit", {"arc_deg": 0.23 * 360 / bearing.n_rollers, "exit_ratio": 0.5})
    twin = impact_spectra(bearing, 0.225)
    found = {
        there: impact_pair_comb.compare(impact_spectra(bearing, 0.2, effects, seed=1), twin, bearing)[
            "clear_smooth_path_gain"
        ]
        for there, effects in ((True, (effect,)), (False, ()))
    }
    assert found[True] > np.log1p(20) > np.log1p(12) > found[False]
