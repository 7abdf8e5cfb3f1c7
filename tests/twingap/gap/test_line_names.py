"""Lines are named after what they are multiples of, and only after that."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import LineSpectrum
from twingap.gap.line_names import DRIVE, MAINS, OWN_BEARING, SHAFT, UNKNOWN, named_lines

BEARING = BEARINGS["6205"]


def lines(hz: tuple[float, ...] = (), orders: tuple[float, ...] = ()) -> LineSpectrum:
    return LineSpectrum(
        frequencies_hz=hz, amplitudes=(1.0,) * len(hz), orders=orders, order_amplitudes=(1.0,) * len(orders)
    )


def test_known_rates_name_their_multiples() -> None:
    own = BEARING.bpfo
    found = named_lines(
        lines((100.0, 150.0, 4190.0, 4250.0, 777.0), (1.0, 2.0, 5.0, own, 2 * own, 11.37)), BEARING, 30.0
    )
    assert found[MAINS] == (100.0, 150.0) and found[DRIVE] == (4190.0, 4250.0)
    assert found[SHAFT] == (1.0, 2.0, 5.0) and found[OWN_BEARING] == (own, 2 * own)
    assert sorted(found[UNKNOWN]) == [11.37, 777.0]


def test_lines_about_a_carrier_are_a_drives() -> None:
    about = LineSpectrum(
        frequencies_hz=(), amplitudes=(), orders=(), order_amplitudes=(), carriers_hz=(4200.0, 4200.0),
        carrier_orders=(-2.0, 2.0), carrier_amplitudes=(1.0, 1.0),
    )  # fmt: skip
    assert named_lines(about, BEARING, 30.0) == {DRIVE: (4140.0, 4260.0)}


def test_a_line_nearly_once_a_turn_is_the_shafts() -> None:
    """Speeds have errors, and a record of a second resolves a hertz."""
    found = named_lines(lines(orders=(0.992, 3.04)), BEARING, 22.0)
    assert found[SHAFT] == (0.992,) and found[UNKNOWN] == (3.04,)


def test_another_bearing_needs_its_first_line_and_two_more() -> None:
    other = BEARINGS["6203"].fault_order("inner")
    family = tuple(k * other for k in (1, 2, 3))
    assert any("6203" in kind for kind in named_lines(lines(orders=family), BEARING, 30.0))
    assert not any("another" in kind for kind in named_lines(lines(orders=family[1:]), BEARING, 30.0))


@pytest.mark.parametrize("seed", range(3))
def test_few_lines_are_named_by_chance(seed: int) -> None:
    places = tuple(np.sort(np.random.default_rng(seed).uniform(0.6, 60.0, 40)).tolist())
    found = named_lines(lines(orders=places), BEARING, 30.0)
    assert len(found[UNKNOWN]) > 30
