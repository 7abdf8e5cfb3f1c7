"""What true values leave of a gap."""

from __future__ import annotations

import pytest

from twingap.study.true_values import left

SEED = 991


@pytest.mark.parametrize(
    ("name", "number", "own"),
    [
        ("looseness", 5, True), ("gear_mesh", 10, True), ("foreign_bearing", 6, True), ("coloured_noise", 2, True),
        ("quantisation", 4, True), ("coloured_noise", 0, False), ("gear_mesh", 17, False),
        ("second_resonance", 4, False),
    ],
)  # fmt: skip
def test_true_values_close_a_gap(name: str, number: int, own: bool) -> None:
    found = left(name, number, SEED, own=own)
    assert found is not None
    assert found.before > 1.4
    assert found.after < 1.0
    assert found.after < 0.5 * found.before


def test_an_effect_that_the_simulator_cannot_have_is_none() -> None:
    assert left("mean_slip", 0, SEED, own=True) is None


def test_the_same_machine_again() -> None:
    assert left("load_zone", 0, SEED) == left("load_zone", 0, SEED)
