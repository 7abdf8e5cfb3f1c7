"""Pairs of lines about a carrier without a line: found where they are, and nothing else is taken for one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, LineSpectrum, make_effect
from twingap.effects.drive_interference import CERTAIN_PAIR
from twingap.gap.features.tones.side_pairs import SidePair, strongest_pair
from twingap.gap.features.tones.whitened_spectra import whiten
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalTwin

BEARING, FS_HZ = BEARINGS["6205"], 12_000.0


def pair_of(
    effects: Sequence[Effect], *, speeds: tuple[float, float] = (1400.0, 2100.0), count: int = 16,
    stated: float = 0.0, seed: int = 0, absent: int = 0,
) -> SidePair:  # fmt: skip
    """Of records with these effects but for some (`absent`); stated speeds are wrong by up to this part."""
    rng = np.random.default_rng(seed)
    rpm = rng.uniform(*speeds, count)
    faults = ("healthy", "outer", "inner", "ball")
    made = [Condition(f"r{i}", float(rpm[i]), FS_HZ, int(FS_HZ), faults[i % 4]) for i in range(count)]
    whole, bare = (PhenomenologicalTwin(BEARING, None, of).simulate(made, rng) for of in (tuple(effects), ()))
    records = [*list(bare)[:absent], *list(whole)[absent:]]
    frame = Frame(BEARING, (2500.0, 4500.0), 1.0)
    white = [
        whiten(
            RecordTransforms(r.samples, replace(c, speed_rpm=c.speed_rpm * (1 + rng.uniform(-stated, stated))), frame)
        )
        for r, c in zip(records, made, strict=True)
    ]
    found = strongest_pair(white)
    assert found is not None
    return found


def drive(level: float = 0.1, carrier_hz: float = 4187.0, order: float = 2.0, carrier: float = 0.0) -> LineSpectrum:
    """Two lines of a drive, and a line at its carrier."""
    return LineSpectrum(
        frequencies_hz=(carrier_hz,), amplitudes=(carrier,), orders=(), order_amplitudes=(),
        carriers_hz=(carrier_hz,) * 2, carrier_orders=(-order, order), carrier_amplitudes=(level, level),
    )  # fmt: skip


@pytest.mark.parametrize("order", [1.0, 2.0, 6.0])
@pytest.mark.parametrize("stated", [0.0, 0.015])
def test_a_pair_is_found_where_it_is(order: float, stated: float) -> None:
    found = pair_of((drive(order=order),), stated=stated)
    assert found.z > CERTAIN_PAIR and found.part > 0.8
    assert found.carrier_hz == pytest.approx(4187.0, abs=1.5)
    assert found.order == pytest.approx(order, rel=0.01)
    quiet = PhenomenologicalTwin(BEARING, None, ()).reference_rms
    assert np.exp(found.level_log) == pytest.approx(0.1 * quiet, rel=0.25)


def test_records_without_the_pair_do_not_count() -> None:
    found = pair_of((drive(order=6.0),), absent=6)
    assert 0.5 < found.part < 0.95
    assert found.carrier_hz == pytest.approx(4187.0, abs=1.5)


def test_lines_of_a_motor_that_slips_are_at_its_own_order() -> None:
    assert pair_of((drive(order=3.9),)).order == pytest.approx(3.9, abs=0.02)


def test_the_first_of_two_pairs_is_the_drives() -> None:
    two = LineSpectrum(
        frequencies_hz=(), amplitudes=(), orders=(), order_amplitudes=(), carriers_hz=(4187.0,) * 4,
        carrier_orders=(-4.0, -2.0, 2.0, 4.0), carrier_amplitudes=(0.12, 0.1, 0.1, 0.12),
    )  # fmt: skip
    assert pair_of((two,)).order == 2.0


def test_a_carrier_with_a_line_is_none() -> None:
    assert pair_of((drive(carrier=0.2),)).z < CERTAIN_PAIR


@pytest.mark.parametrize(
    "effect",
    [
        make_effect("gear_mesh", {"level": 2.0, "teeth": 41, "depth": 1.4}),
        make_effect("foreign_bearing", {"level": 8.0}),
        make_effect("looseness", {"level": 2.0}),
        make_effect("waviness", {"level": 2.0}),
        make_effect("mains_interference", {"level": 2.0, "n_harmonics": 20}),
        make_effect("line_spectrum", {"frequencies_hz": (1130.0, 2212.0, 3317.0), "amplitudes": (1.0, 1.0, 1.0)}),
        None,
    ],
    ids=lambda effect: effect.name if effect else "nothing",
)
def test_other_lines_are_none(effect: Effect | None) -> None:
    for seed, speeds in enumerate([(1400.0, 2100.0), (1000.0, 2500.0)]):
        assert pair_of((effect,) if effect else (), speeds=speeds, seed=seed).z < CERTAIN_PAIR
