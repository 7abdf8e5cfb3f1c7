"""Signatures of effects on the shaft angle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from twingap.effects import Draft, MainsInterference, MeanSlip, ShaftHarmonics, SpeedFluctuation
from twingap.streams import Streams, root_entropy


def angle(lab: Any, effect: SpeedFluctuation) -> np.ndarray:
    """The shaft angle of record 0, by the effect's own stream."""
    (condition,) = lab.conditions("outer", 1)
    t = np.arange(condition.n_samples) / condition.fs_hz
    draft = Draft(condition, lab.bearing, 1.0, t, t * lab.fr)
    effect.apply(draft, Streams(root_entropy(np.random.default_rng(lab.seed)), 0)(effect.name))
    return draft.turns


def test_fluctuating_shaft_turns_on_at_its_mean_speed(lab: Any) -> None:
    turns = angle(lab, SpeedFluctuation(level=0.3, bandwidth_hz=10))
    even = np.arange(lab.n_samples) / lab.fs_hz * lab.fr
    assert (np.diff(turns) > 0).all()
    assert turns[0] == 0
    assert turns[-1] == pytest.approx(even[-1], rel=1e-12)
    relative = np.diff(turns) * lab.fs_hz / lab.fr - 1
    assert 0.15 < relative.std() < 0.4


def test_fluctuation_smears_more_at_high_orders_and_vanishes_after_order_tracking(lab: Any) -> None:
    effect = SpeedFluctuation(level=0.003, bandwidth_hz=2.0)
    without, with_it = (lab.envelope(x) for x in lab.pair(effect))
    turns = angle(lab, effect)
    tracked = np.interp(np.arange(lab.n_samples) / lab.fs_hz * lab.fr, turns, with_it[0])[None]
    kept, back = [], []
    for n in (1, 3, 6):
        line = n * lab.bearing.bpfo * lab.fr
        kept.append(lab.line(with_it, line) / lab.line(without, line))
        back.append(lab.line(tracked, line) / lab.line(without, line))
    assert 1.05 > kept[0] > max(kept[1:])
    assert kept[2] < 0.5
    assert min(back) > 0.9


def test_fluctuation_moves_only_what_follows_the_angle(lab: Any) -> None:
    effect = SpeedFluctuation(level=0.02)
    tones = [ShaftHarmonics(level_1x=0, level_2x=0, level_3x=1.0), MainsInterference(level=1.0)]
    without = lab.make(tones, "healthy") - lab.make([], "healthy")
    with_it = lab.make([*tones, effect], "healthy") - lab.make([], "healthy")
    assert lab.line(with_it, 50.0) == pytest.approx(lab.line(without, 50.0), rel=0.02)
    assert lab.line(with_it, 3 * lab.fr) < 0.7 * lab.line(without, 3 * lab.fr)


@pytest.mark.parametrize("slip", [0.02, -0.015])
def test_slip_moves_outer_and_inner_apart_and_keeps_lines_sharp(lab: Any, slip: float) -> None:
    effect, kinematic = MeanSlip(slip=slip), lab.bearing
    orders = kinematic.slipped(1 - slip)
    assert orders["outer"] + orders["inner"] == pytest.approx(kinematic.n_rollers, rel=1e-15)
    assert (orders["outer"] - kinematic.bpfo) * (orders["inner"] - kinematic.bpfi) < 0
    for fault in ("outer", "inner"):
        without, with_it = (lab.envelope(x) for x in lab.pair(effect, fault))
        old, new = kinematic.fault_order(fault) * lab.fr, orders[fault] * lab.fr
        assert lab.line(with_it, new) == pytest.approx(lab.line(without, old), rel=0.1), "as sharp as before"
        assert lab.prominence(with_it, old) < 5 < lab.prominence(without, old)


@pytest.mark.parametrize("of_rollers", [1.0, 0.0, -1.0])
def test_the_cage_does_not_settle_how_rollers_spin(lab: Any, of_rollers: float) -> None:
    effect, kinematic = MeanSlip(slip=0.03, of_rollers=of_rollers), lab.bearing
    orders = {}
    for fault in ("outer", "inner", "ball"):
        draft = Draft(lab.conditions(fault, 1)[0], kinematic, 1.0, np.zeros(2), np.zeros(2))
        effect.apply(draft, np.random.default_rng(0))
        orders[fault] = draft.fault_order
        assert draft.cage_speed_ratio == pytest.approx(0.97)
    assert orders["outer"] == pytest.approx(0.97 * kinematic.bpfo)
    assert orders["outer"] + orders["inner"] == pytest.approx(kinematic.n_rollers)
    # A spin follows the inner ring's speed as seen from the cage, stays, or goes the other way by as much.
    moved = kinematic.slipped(0.97)["ball"] - kinematic.fault_order("ball")
    assert orders["ball"] - kinematic.fault_order("ball") == pytest.approx(of_rollers * moved)


def test_slip_leaves_the_shaft_alone(lab: Any) -> None:
    tone = ShaftHarmonics(level_1x=1.0)
    without = lab.make([tone], "healthy")
    np.testing.assert_array_equal(lab.make([tone, MeanSlip(slip=0.03)], "healthy"), without)


@pytest.mark.parametrize("level", [0.002, 0.03])
def test_speed_varies_by_its_level_about_its_mean(lab: Any, level: float) -> None:
    n, relative = 60_000, []
    t = np.arange(n) / 1000.0
    for seed in range(40):
        draft = Draft(lab.conditions("healthy", 1)[0], lab.bearing, 1.0, t, t * lab.fr)
        SpeedFluctuation(level=level, bandwidth_hz=4.0).apply(draft, np.random.default_rng(seed))
        assert draft.turns[-1] == pytest.approx(t[-1] * lab.fr)
        relative.append(np.diff(draft.turns) * 1000 / lab.fr - 1)
    assert np.sqrt(np.mean(np.square(relative))) == pytest.approx(level, rel=0.05)
