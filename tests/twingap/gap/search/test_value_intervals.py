"""Intervals of fitted values keep what the records allow, and nothing far beyond."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.twingap.gap.search.test_free_spectra import evidence_of
from twingap.effects import make_effect
from twingap.gap.search.effect_search import Estimated, Explanation
from twingap.gap.search.value_intervals import FARTHER, with_shorter_intervals

MODE = make_effect("second_resonance", {"frequency_hz": 3900.0, "damping_ratio": 0.03, "gain": 0.9})
HUM = make_effect("mains_interference", {"level": 0.5, "mains_hz": 50.0, "n_harmonics": 1})
WIDE = {"frequency_hz": (600.0, 4700.0), "damping_ratio": (0.005, 0.2), "gain": (0.01, 15.0)}


@pytest.fixture(scope="module")
def found():
    evidence = evidence_of(MODE, HUM)
    before, after = evidence.against(), evidence.against((MODE, HUM))
    hum = Estimated(HUM, {"decay": (0.1, 0.9), "mains_hz": (49.0, 51.0), "n_harmonics": (1, 8)})
    explanation = Explanation(0.01, True, (Estimated(MODE, WIDE), hum), {}, ((),), 0.5, before, after, {})
    return evidence, explanation, with_shorter_intervals(evidence, explanation)


def test_what_the_records_rule_out_leaves_the_interval_and_the_true_value_stays(found) -> None:
    mode = found[2].effects[0].intervals
    for parameter, true in (("frequency_hz", 3900.0), ("damping_ratio", 0.03), ("gain", 0.9)):
        assert WIDE[parameter][0] <= mode[parameter][0] < true < mode[parameter][1] <= WIDE[parameter][1]
    assert 3200 < mode["frequency_hz"][0] < mode["frequency_hz"][1] < 4500
    assert mode["gain"][1] < 8.0


def test_at_a_shortened_end_the_twin_is_clearly_farther(found) -> None:
    evidence, explanation, shorter = found
    after = explanation.after
    limit = FARTHER * evidence.misfit(after.simulator, after.effects)
    for end in shorter.effects[0].intervals["frequency_hz"]:
        chain = tuple(e.moved(frequency_hz=end) if e.name == MODE.name else e for e in after.effects)
        assert evidence.misfit(evidence.with_values(after.simulator, chain), chain) > limit


def test_values_that_records_do_not_show_and_numbers_of_things_keep_their_intervals(found) -> None:
    hum = found[2].effects[1].intervals
    assert hum["decay"] == (0.1, 0.9), "there is one harmonic alone"
    assert hum["n_harmonics"] == (1, 8)
    evidence, explanation, _ = found
    assert with_shorter_intervals(evidence, replace(explanation, gap=False)).effects == explanation.effects
