"""The spread of a path's delays is found, and none where impacts are sharp."""

from __future__ import annotations

import pytest

from tests.twingap.gap.search.test_free_spectra import evidence_of
from twingap.effects import make_effect
from twingap.effects.transfer_path import delay_spread_s
from twingap.gap.search.free_spectra import PATH, measured
from twingap.gap.search.path_delays import with_delays

GAINS = {
    "frequencies_hz": (0.0, 900.0, 1600.0, 3200.0, 4200.0, 5000.0),
    "gains_db": (0.0, 10.0, -12.0, 12.0, -8.0, -8.0),
}


@pytest.mark.parametrize("by", ["all", "fault"])
@pytest.mark.parametrize(("true_s", "low_s", "high_s"), [(0.0, 0.0, 0.0005), (0.003, 0.0015, 0.006)])
def test_spread_is_recovered(true_s: float, low_s: float, high_s: float, by: str) -> None:
    evidence = evidence_of(make_effect(PATH, GAINS | {"delay_spread_s": true_s}))
    given = measured(evidence, evidence.against().simulator, (), (PATH,), by=by)  # type: ignore[arg-type]
    assert given is not None
    found = with_delays(evidence, *given)
    (path,) = found[1]
    assert low_s <= delay_spread_s(path) <= high_s
    assert evidence.misfit(*found) <= evidence.misfit(*given)
    # Measured once more, the path keeps its spread.
    again = measured(evidence, *found, (PATH,), by=by)  # type: ignore[arg-type]
    assert again is not None and delay_spread_s(again[1][0]) == delay_spread_s(path)


def test_without_a_path_nothing_changes() -> None:
    evidence = evidence_of()
    hum = (make_effect("mains_interference", {"level": 0.8}),)
    simulator = evidence.against().simulator
    assert with_delays(evidence, simulator, hum) == (simulator, hum)
