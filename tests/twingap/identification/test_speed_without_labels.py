"""Speeds of records without labels: all lines of a record, all records of a set, and what stays open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.identification.speed_without_labels import (
    FAULTS,
    RATIOS,
    SpeedProbabilities,
    as_stated,
    combine,
    line_scores,
    speeds_without_labels,
)
from twingap.records import Condition, Record, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

BEARING = BEARINGS["6205"]


def stated_wrongly(faults: list[str], ratios: list[float], seed: int = 0) -> RecordSet:
    """Plain faults without shaft lines, whose stated speeds are wrong."""
    conditions = [
        Condition(f"r{i}", 1200.0 * ratio, 10_000.0, 20_000, fault)
        for i, (fault, ratio) in enumerate(zip(faults, ratios, strict=True))
    ]
    loud = dict.fromkeys(FAULTS, 15.0)
    twin = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(2000.0, 0.05, loud))
    made = twin.simulate(conditions, np.random.default_rng(seed))
    wrong = [replace(r, condition=replace(r.condition, speed_rpm=1200.0, fault=None)) for r in made]
    return RecordSet.from_records("wrong", "", BEARING, wrong)


def peak(ratio: float, height: float = 20.0) -> np.ndarray:
    """Evidence of a record for one ratio."""
    return height * np.exp(-0.5 * ((RATIOS - ratio) / 0.002) ** 2)


def test_every_race_shows_its_speed_without_a_label_or_a_shaft_line() -> None:
    ratios = [0.94, 1.05, 1.03, 0.96, 0.95, 1.0]
    found = speeds_without_labels(stated_wrongly(["inner", "outer", "inner", "outer", "ball", "ball"], ratios), BEARING)
    np.testing.assert_allclose(found.ratio, ratios, atol=0.005)
    assert (found.weights.max(axis=1) > 0.1).all() and len(found.candidates(5, 0.01)[0]) <= 2
    assert len(found.notes) == 1 and "-6.0 to +5." in found.notes[0]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faults_own_lines_explain_most(fault: str) -> None:
    (record,) = stated_wrongly([fault], [0.97])
    scores = line_scores(record.samples, record.condition, BEARING)
    number, place = np.unravel_index(scores.argmax(), scores.shape)
    assert FAULTS[number] == fault and RATIOS[place] == pytest.approx(0.97, abs=0.004)


def test_records_that_show_their_speed_decide_for_those_that_do_not() -> None:
    dark, doubtful = np.zeros(RATIOS.size), np.maximum(peak(0.96, 8.0), peak(1.05, 9.0))
    alone = combine(np.array([doubtful]))
    assert alone.ratio[0] == pytest.approx(1.05, abs=0.01)
    found = combine(np.array([doubtful, dark, *(peak(r) for r in (0.958, 0.96, 0.961, 0.963))]))
    np.testing.assert_allclose(found.ratio[:2], 0.96, atol=0.005)
    assert found.weights[1][np.abs(RATIOS - 0.96) < 0.01].sum() > 0.9
    assert found.shown.all() and "-4" in found.notes[0]


def test_what_no_line_shows_stays_open() -> None:
    noise = np.random.default_rng(0).standard_normal((2, 20_000))
    records = [Record(Condition(f"n{i}", 1200.0, 10_000.0, 20_000), x) for i, x in enumerate(noise)]
    found = speeds_without_labels(RecordSet.from_records("noise", "", BEARING, records), BEARING)
    assert (found.weights[:, np.abs(RATIOS - 1) < 0.01].sum(axis=1) < 0.9).all()
    ratios, weights = found.candidates(5, 0.01)
    assert len(ratios) > 2 and not found.shown.any() and found.notes == []
    np.testing.assert_allclose(weights.sum(axis=0), 1)


def test_stated_speeds_are_one_candidate() -> None:
    ratios, weights = as_stated(3).candidates(5, 0.01)
    np.testing.assert_allclose(ratios, np.ones((1, 3)))
    np.testing.assert_array_equal(weights, np.ones((1, 3)))


def test_candidates_do_not_overlap() -> None:
    spread = SpeedProbabilities(np.full((1, RATIOS.size), 1 / RATIOS.size))
    ratios, weights = spread.candidates(5, 0.01)
    assert np.diff(np.sort(ratios[:, 0])).min() > 0.01 and weights[:, 0].max() < 0.3


def test_hum_at_a_multiple_of_mains_is_no_fault() -> None:
    """At 1200 rpm a 6205's ball would strike 100 times a second if the speed were 6 % higher."""
    rng, n = np.random.default_rng(0), 40_000
    hum = 1 + 0.9 * np.cos(2 * np.pi * 100.0 * np.arange(n) / 10_000.0)
    x = rng.standard_normal(n) * hum**2
    of_hum = line_scores(x, Condition("hum", 1200.0, 10_000.0, n), BEARING)[FAULTS.index("ball")]
    of_slower = line_scores(x, Condition("hum", 1200.0, 9_900.0, n), BEARING)[FAULTS.index("ball")]
    assert of_slower.max() > 2 * of_hum.max(), "at 99 Hz the same lines are no mains"
