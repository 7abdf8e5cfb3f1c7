"""Signatures of effects of the acquisition."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twingap.effects import Clipping, Dropout, Quantisation
from twingap.effects.quantisation import MidRiseQuantisation
from twingap.records import Record


def repeats(x: np.ndarray) -> int:
    """Samples equal to the one before."""
    return int((np.diff(x) == 0).sum())


def test_clipping_makes_atoms_at_the_rails_and_nothing_else(lab: Any) -> None:
    without, with_it = lab.pair(Clipping(rail=3.0))
    assert (np.abs(without) > 3).any()
    assert np.abs(with_it).max() == 3.0
    assert (with_it == 3.0).sum() > 20 < (with_it == -3.0).sum()
    inside = np.abs(without) < 3
    np.testing.assert_array_equal(with_it[inside], without[inside])
    assert np.unique(with_it[inside]).size == inside.sum(), "no grid, no runs"
    np.testing.assert_array_equal(*lab.pair(Clipping(rail=15.0), "healthy"))


def test_quantisation_makes_a_grid_without_rails(lab: Any) -> None:
    without, with_it = lab.pair(Quantisation(step=0.25))
    np.testing.assert_array_equal(with_it / 0.25, np.rint(with_it / 0.25))
    assert np.abs(with_it - without).max() <= 0.125 + 1e-12
    assert np.unique(with_it).size < 120 < 40_000 < np.unique(without).size
    top = with_it.max()
    assert (with_it == top).sum() < 10, "the largest value is no atom"


@pytest.mark.parametrize("effect", [Clipping(rail=2.0), Quantisation(step=0.5)])
def test_rails_and_steps_are_multiples_of_the_healthy_rms(lab: Any, effect: Any) -> None:
    lab = lab.where(n_samples=3000)
    louder = lab.where(parameters=replace(lab.parameters, scale=4.0))
    np.testing.assert_allclose(louder.make([effect]), 4 * lab.make([effect]), atol=1e-9)


def test_dropout_makes_runs_of_equal_samples_and_leaves_the_rest(lab: Any) -> None:
    without, with_it = lab.pair(Dropout(rate_hz=10.0, length_s=0.005), count=20)
    assert repeats(without.ravel()) == 0
    held = np.diff(with_it, axis=1) == 0
    changed = with_it != without
    np.testing.assert_array_equal(changed[:, 1:], held), "only held samples differ"
    # 10 gaps a second of 5 ms for 80 s, overlapping a little.
    assert held.sum() / lab.fs_hz / 80 == pytest.approx(10 * 0.005, rel=0.15)
    begins = (np.diff(held.astype(int), axis=1) == 1).sum()
    assert begins == pytest.approx(800, rel=0.15)


def test_no_gap_is_no_change(lab: Any) -> None:
    np.testing.assert_array_equal(*lab.where(n_samples=3000).pair(Dropout(rate_hz=0.0)))


def test_gaps_may_reach_over_either_end(lab: Any) -> None:
    x = lab.where(n_samples=300).make([Dropout(rate_hz=50.0, length_s=10.0)], count=20)
    assert np.isfinite(x).all()
    assert any(repeats(record) > 250 for record in x)


def of(lab: Any, *effects: Any, count: int = 12) -> list[Record]:
    """Records with these effects."""
    made = zip(lab.conditions("outer", count), lab.make(effects, count=count), strict=True)
    return [Record(condition, samples) for condition, samples in made]


@pytest.mark.parametrize("others", [(), (Clipping(rail=2.0),), (Quantisation(step=0.5),)])
def test_gaps_are_read_off_the_records(lab: Any, others: tuple[Any, ...]) -> None:
    bare, missing = of(lab, count=2), Dropout(rate_hz=6.0, length_s=0.008)
    for gaps in (missing, replace(missing, zeros=True)):
        found = Dropout.read_off(of(lab, gaps, *others), bare)
        assert found["rate_hz"] == pytest.approx(6.0, rel=0.2)
        assert found["length_s"] == pytest.approx(0.008, rel=0.2)
        assert found["zeros"] == gaps.zeros
    assert not Dropout.read_off(of(lab, missing, *others), of(lab, missing)), "the twin has it"


@pytest.mark.parametrize("other", [Clipping(rail=1.5), Quantisation(step=2.0), Quantisation(step=0.02)])
def test_no_gap_is_read_off_a_rail_or_a_coarse_converter(lab: Any, other: Any) -> None:
    assert not Dropout.read_off(of(lab, other), of(lab, count=2))


def test_slow_vibration_on_a_rail_is_no_gap(lab: Any) -> None:
    slow = lab.where(parameters=replace(lab.parameters, resonance_hz=150.0, white_noise_rms=0.01))
    clipped = of(slow, Clipping(rail=7.8))
    assert min(repeats(record.samples) for record in clipped) > 50
    assert not Dropout.read_off(clipped, of(slow, count=2))


@pytest.mark.parametrize("step", [0.03, 0.25, 2.0])
def test_a_step_is_read_off_the_records(lab: Any, step: float) -> None:
    bare, coarse = of(lab, count=2), Quantisation(step=step)
    others = (Dropout(rate_hz=2.0), Clipping(rail=3.01))
    for chain in ((coarse,), (coarse, *others), (MidRiseQuantisation(step=step),)):
        assert Quantisation.read_off(of(lab, *chain), bare)["step"] == pytest.approx(step, rel=1e-3)
    assert not Quantisation.read_off(of(lab, coarse), of(lab, coarse)), "the twin has it"


def test_no_step_is_read_off_fine_records_or_those_of_two_converters(lab: Any) -> None:
    bare = of(lab, count=2)
    assert not Quantisation.read_off(of(lab, Dropout(), Clipping(rail=1.5)), bare)
    mixed = [*of(lab, Quantisation(step=0.2)), *of(lab, Quantisation(step=0.3))]
    assert not Quantisation.read_off(mixed, bare)
