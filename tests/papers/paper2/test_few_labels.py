"""SVM and maps by class: nothing leaks between recordings, scaling is inside; and the function that chooses."""

from __future__ import annotations

import numpy as np
import pytest

from papers.paper2_digital_twin.methods.choose import Thresholds, choose
from papers.paper2_digital_twin.methods.few_labels import fit_few_labels
from papers.paper2_digital_twin.methods.severity import MapOptions, fit_class_maps
from twingap.errors import TwingapError


def clouds(rng: np.random.Generator, per: int = 30) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    centres = np.array([[0.0, 0, 0], [6, 0, 0], [0, 6, 0]])
    labels = np.repeat(np.arange(3), per)
    return centres[labels] + rng.standard_normal((3 * per, 3)), labels, np.array([f"r{i % 15}" for i in range(3 * per)])


def test_scaling_is_inside_the_pipeline() -> None:
    rng = np.random.default_rng(0)
    x, y, _ = clouds(rng)
    groups = np.array([f"{label}-{i % 5}" for i, label in enumerate(y)])
    size = np.array([1e-4, 1.0, 1e5])
    new = clouds(rng)[0]
    plain = fit_few_labels(x, y, groups, 3).probabilities(new)
    scaled = fit_few_labels(x * size, y, groups, 3).probabilities(new * size)
    np.testing.assert_allclose(plain, scaled, atol=1e-6)
    assert (plain.argmax(axis=1) == np.repeat(np.arange(3), 30)).mean() > 0.95


def test_pieces_of_one_recording_never_stand_on_both_sides_of_a_fold() -> None:
    """Labels of recordings that nothing explains: pieces of a recording look alike, and only a leak could tell."""
    rng = np.random.default_rng(1)
    place = 8 * rng.standard_normal((30, 4))
    x = np.repeat(place, 12, axis=0) + 0.1 * rng.standard_normal((360, 4))
    y = np.repeat(np.arange(30) % 2, 12)
    told = fit_few_labels(x, y, np.repeat([f"r{i}" for i in range(30)], 12), 2).cross_validated
    leaky = fit_few_labels(x, y, np.array([f"{i % 2}{i % 7}{y[i]}" for i in range(360)]), 2).cross_validated
    assert told is not None and told < 0.75
    assert leaky is not None and leaky > 0.95


def test_one_record_a_class_is_enough_for_an_answer_and_none_is_cross_validated() -> None:
    x = np.array([[0.0, 0], [5, 0], [0, 5]])
    own = fit_few_labels(x, np.arange(3), np.array(["a", "b", "c"]), 4)
    assert own.cross_validated is None
    told = own.probabilities(x)
    assert told.argmax(axis=1).tolist() == [0, 1, 2]
    assert (told[:, 3] == 0).all()  # a class that nobody showed
    np.testing.assert_allclose(told.sum(axis=1), 1)


def test_maps_of_one_record_are_the_nearest_neighbour() -> None:
    rng = np.random.default_rng(2)
    x, new = rng.standard_normal((4, 3)), rng.standard_normal((50, 3))
    maps = fit_class_maps(x, np.arange(4), 5, MapOptions(), rng)
    scaled = np.linalg.norm((new[:, None] - x) / x.std(axis=0), axis=-1)
    np.testing.assert_allclose(maps.mqe(new)[:, :4], scaled)
    assert np.isinf(maps.mqe(new)[:, 4]).all()
    told = maps.probabilities(new)
    assert (told.argmax(axis=1) == scaled.argmin(axis=1)).all()
    assert (told[:, 4] == 0).all()


def test_maps_tell_clouds_apart() -> None:
    rng = np.random.default_rng(3)
    x, y, _ = clouds(rng)
    new, truth, _ = clouds(rng)
    assert (fit_class_maps(x, y, 3, MapOptions(side=4), rng).probabilities(new).argmax(axis=1) == truth).mean() > 0.95


LIMITS = Thresholds(correct=1, svm=5, som=50)


@pytest.mark.parametrize(
    ("n", "approach"),
    [
        (0, "twin network"), (1, "corrected network"), (4, "corrected network"), (5, "SVM"), (49, "SVM"),
        (50, "SOM-MQE"), (5000, "SOM-MQE"),
    ],
)  # fmt: skip
def test_the_choice_follows_the_thresholds_and_says_why(n: int, approach: str) -> None:
    made = choose(n, 99, thresholds=LIMITS)
    assert made.approach == approach
    assert str(n) in made.why


def test_the_scarcest_fault_decides_and_the_alarm_needs_healthy_windows_alone() -> None:
    made = choose({"inner": 80, "ball": 2, "outer": 7}, 98, thresholds=LIMITS)
    assert made.approach == "corrected network"
    assert "ball" in made.why
    assert not made.alarm
    assert choose(0, 99).alarm
    assert not choose(0, 99, false_alarm=0.001).alarm


def test_a_method_that_never_leads_is_never_chosen() -> None:
    never = Thresholds(svm=None, som=None)
    assert choose(10**6, thresholds=never).approach == "corrected network"
    assert choose(10**6).approach == "corrected network"  # what was measured: nothing passes it by more than luck


@pytest.mark.parametrize("counts", [{}, {"inner": -1}, -3])
def test_nonsense_is_refused_in_one_line(counts: dict[str, int] | int) -> None:
    with pytest.raises(TwingapError, match="labelled records"):
        choose(counts)
