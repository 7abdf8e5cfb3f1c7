"""Half of the simulations elsewhere: the same numbers, whatever becomes of the other process."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from typing import Any

import joblib
import numpy as np
import pytest

from tests.twingap.gap.test_level import evidence_of as own_evidence_of
from tests.twingap.gap.test_level import simulated
from tests.twingap.gap.test_nearest import evidence_of, machine
from twingap.effects import make_effect
from twingap.gap.evidence import Evidence
from twingap.gap.nearest import bring_nearest
from twingap.gap.second_process import EvidenceOfTwo, SecondProcess, second_process

HUM = make_effect("mains_interference", {"level": 0.9})
START = make_effect("mains_interference", {"level": 0.2})


@pytest.fixture(scope="module")
def second() -> Iterator[SecondProcess]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(joblib, "cpu_count", lambda: 2)
        with second_process(True) as process:
            assert process is not None
            yield process


def of_two(evidence: Evidence, second: SecondProcess) -> EvidenceOfTwo:
    simulator = evidence.against().simulator
    return EvidenceOfTwo(evidence.calibrated, simulator, evidence.spec, evidence.root, evidence.dampings, second)


@pytest.mark.parametrize("own", [False, True], ids=["twin", "own simulator"])
def test_it_makes_what_is_made_here(own: bool, second: SecondProcess) -> None:
    alone = own_evidence_of(machine(HUM), simulated(1 / 9.81, "g")) if own else evidence_of(machine(HUM))
    both = of_two(alone, second)
    there = []
    asked = second.views

    def counted(*given: Any) -> Any:
        there.append(asked(*given))
        return there[-1]

    second.views = counted  # type: ignore[method-assign]
    one, two = (bring_nearest(e, e.against([START]).simulator, [START], {}) for e in (alone, both))
    second.views = asked  # type: ignore[method-assign]
    assert len(there) > 20 and all(future is not None and future.exception() is None for future in there)
    assert one.effects == two.effects and one.misfit == two.misfit and one.before == two.before
    for k, ours in enumerate(both.replicates(two.simulator, two.effects, range(2, 5)), start=2):
        records = alone.simulated(one.simulator, one.effects, alone.held_out.conditions, k)
        theirs = alone.views(records, both._places[1][1])
        np.testing.assert_array_equal(ours.matrix, theirs.matrix)
        assert ours.conditions == theirs.conditions


def test_what_it_cannot_do_is_done_here(second: SecondProcess) -> None:
    """A simulator that cannot be sent, and a process that dies in the middle."""
    alone = evidence_of(machine(HUM))
    simulator = alone.against().simulator
    wanted = alone.misfit(simulator, [HUM])
    simulator.lock = threading.Lock()  # type: ignore[attr-defined]
    assert of_two(alone, SecondProcess(second._executor)).misfit(simulator, [HUM]) == wanted
    del simulator.lock  # type: ignore[attr-defined]
    both = of_two(alone, second)
    assert both.misfit(simulator, [HUM]) == wanted
    second._executor.submit(os._exit, 1)
    assert both.misfit(simulator, [HUM]) == wanted
    assert both.misfit(simulator, [START]) == alone.misfit(simulator, [START])
    assert second.views(simulator, [HUM], 0, 4) is None


def test_there_is_none_where_none_is_wanted_or_no_core_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joblib, "cpu_count", lambda: 1)
    for wanted in (False, True):
        with second_process(wanted) as process:
            assert process is None
