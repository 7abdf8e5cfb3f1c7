"""Path, lines and background are named where they are missing, and not where something else is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.twingap.gap.search.test_free_spectra import evidence_of
from twingap.effects import Effect, SecondResonance, make_effect
from twingap.gap.held_out import HeldOut
from twingap.gap.knowledge import shipped
from twingap.gap.search.effect_search import Estimated, Explanation
from twingap.gap.search.free_spectra import BACKGROUND, LINES, PATH
from twingap.gap.search.measured_effects import with_measured

ROUGH = make_effect(
    PATH,
    {"frequencies_hz": (0.0, 900.0, 1600.0, 3200.0, 4200.0, 5000.0), "gains_db": (0.0, 10.0, -12.0, 12.0, -8.0, -8.0)},
)
TONES = make_effect(
    LINES,
    {
        "frequencies_hz": (1237.0, 3311.0),
        "amplitudes": (0.6, 0.4),
        "orders": (1.0, 9.7),
        "order_amplitudes": (1.0, 0.5),
    },
)


def named(*effects: Effect, known: tuple[Effect, ...] = (), rest_p: float = 0.01) -> tuple[str, ...]:
    """What is named on a machine with these effects, of which the search has found some."""
    evidence = evidence_of(*effects, *known)
    before, after = evidence.against(), evidence.against(known)
    values = tuple(Estimated(effect, {}) for effect in known)
    found = with_measured(evidence, Explanation(0.01, True, values, {}, ((),), rest_p, before, after, {}))
    assert found.names[: len(known)] == tuple(effect.name for effect in known)
    assert {effect.name for effect in found.after.effects} == set(found.names)
    assert all(found.probability[name] > 0.85 for name in found.names[len(known) :])
    assert all(set(found.names[len(known) :]) <= set(one) for one in found.confidence_set)
    return found.names


def test_lines_are_named() -> None:
    assert named(TONES) == (LINES,)


def test_a_path_is_named() -> None:
    assert PATH in named(ROUGH) and LINES not in named(ROUGH)


@pytest.mark.parametrize(
    "missing", [("impact_scatter", {"sigma": 0.6}), ("clipping", {"rail": 3.0}), ("load_zone", {"depth": 0.9})]
)
def test_what_acts_on_impacts_or_samples_is_no_path_and_no_line(missing: tuple[str, dict[str, float]]) -> None:
    assert not {PATH, LINES} & set(named(make_effect(*missing)))


def test_what_the_search_has_explained_is_not_named_again() -> None:
    hum = make_effect("mains_interference", {"level": 0.8})
    assert named(known=(hum,)) == ("mains_interference",)


def test_background_is_named_beside_what_is_known() -> None:
    noise = make_effect("coloured_noise", {"level": 2.0, "slope": 0.0, "low_hz": 3500.0, "high_hz": 4500.0})
    scatter = make_effect("impact_scatter", {"sigma": 0.6})
    assert BACKGROUND in named(noise, known=(scatter,))


def test_nothing_is_measured_where_no_rest_points_to_a_further_effect() -> None:
    """But for lines where most of the gap is left: the learnt test knows no lists of lines."""
    hum = make_effect("mains_interference", {"level": 0.8})
    fainter = TONES.moved(level=0.5)
    assert LINES in named(fainter, known=(hum,))
    assert named(fainter, known=(hum,), rest_p=0.5) == ("mains_interference",)
    assert LINES in named(TONES, known=(hum,), rest_p=0.5)


def test_a_path_is_named_in_the_place_of_a_mode_that_stands_in_for_it() -> None:
    """Where the rest points to nothing, too: the mode closes a part, the path most of it."""
    evidence = evidence_of(ROUGH)
    before = evidence.against()
    mode = make_effect("second_resonance", {"frequency_hz": 3200.0, "gain": 0.5, "damping_ratio": 0.05})
    found = with_measured(
        evidence,
        Explanation(0.01, True, (Estimated(mode, {}),), {"second_resonance": 0.9}, (("second_resonance",),), 0.5,
                    before, evidence.against((mode,)), {}),
    )  # fmt: skip
    assert PATH in found.names and "second_resonance" not in found.names
    assert found.probability["second_resonance"] == 0 and found.probability[PATH] > 0.85
    assert {effect.name for effect in found.after.effects} == set(found.names)


def test_a_path_does_not_replace_a_certain_roll_off() -> None:
    """Not even where it closes more."""
    evidence = evidence_of(make_effect("sensor_rolloff", {"corner_hz": 1200.0, "order": 1, "background": 1.0}))
    steep = make_effect("sensor_rolloff", {"corner_hz": 2500.0, "order": 4, "background": 1.0})

    def names(probability: float) -> tuple[str, ...]:
        found = Explanation(
            0.01, True, (Estimated(steep, {}),), {"sensor_rolloff": probability}, ((),), 0.5, evidence.against(),
            evidence.against((steep,)), {},
        )  # fmt: skip
        return with_measured(evidence, found).names

    assert PATH in names(0.6)
    assert names(1.0) == ("sensor_rolloff",)


def test_a_path_does_not_replace_a_mode_that_a_hump_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its gain is not right, so that a path closes more; without the hump, it would be replaced."""
    place = {"frequency_hz": 1100.0, "damping_ratio": 0.03}
    evidence = evidence_of(make_effect("second_resonance", {**place, "gain": 0.6}))
    weak = make_effect("second_resonance", {**place, "gain": 0.1})

    def names() -> tuple[str, ...]:
        found = Explanation(
            0.01, True, (Estimated(weak, {}),), {"second_resonance": 0.95}, ((),), 0.5, evidence.against(),
            evidence.against((weak,)), {},
        )  # fmt: skip
        return with_measured(evidence, found).names

    assert names()[0] == "second_resonance"
    monkeypatch.setattr(SecondResonance, "certain", classmethod(lambda kind, seen: False))
    assert PATH in names() and "second_resonance" not in names()


@pytest.mark.parametrize("rest_p", [0.5, 0.01])
def test_neither_path_nor_background_replaces_coloured_noise(rest_p: float) -> None:
    """A background is coloured noise in a free form, and the path closes little beside it."""
    evidence = evidence_of(
        make_effect("coloured_noise", {"level": 2.0, "slope": 0.0, "low_hz": 3500.0, "high_hz": 4500.0})
    )
    off = make_effect("coloured_noise", {"level": 2.0, "slope": 0.0, "low_hz": 3500.0, "high_hz": 5000.0})
    found = Explanation(
        0.01, True, (Estimated(off, {}),), {"coloured_noise": 0.8}, ((),), rest_p, evidence.against(),
        evidence.against((off,)), {},
    )  # fmt: skip
    assert "coloured_noise" in with_measured(evidence, found).names


def test_what_a_measured_effect_closes_is_reported() -> None:
    """Left out of the twin that has all named effects, like effects with detectors."""
    evidence = evidence_of(TONES, n=6)
    before = evidence.against()
    found = with_measured(evidence, Explanation(0.01, True, (), {}, ((),), 0.01, before, before, {}))
    assert found.names == (LINES,)
    held_out = HeldOut(evidence, found)
    (lines,) = (one for one in held_out.candidates(shipped(), 0.1, np.random.default_rng(0), lambda part: None)
                if one.effect == LINES)  # fmt: skip
    assert lines.acts is None and lines.closure > 0.3 and lines.gap_after < lines.gap_before
