"""Intervals of closure against more runs of the same machine."""

from __future__ import annotations

from typing import Any

import pytest

from twingap.rigs.worlds.plan import cases
from twingap.study import closure_coverage
from twingap.study.closure_coverage import Checked, check

pytestmark = pytest.mark.usefixtures("few_trials")

SEED = 78


def test_an_interval_covers_what_lies_in_it() -> None:
    assert Checked("w", ("clipping",), 0.6, (0.4, 0.8), 0.8).covered
    assert not Checked("w", ("clipping",), 0.6, (0.4, 0.8), 0.81).covered


def test_a_world_is_run_again_and_measured_in_the_same_measure(learnt: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closure_coverage, "RUNS", 3)
    monkeypatch.setattr(closure_coverage, "REPLICATES", 2)
    strong = next(c for c in cases(300, SEED) if dict(c.effects) == {"quantisation": "strong"} and c.arm == "twin")
    found = check(strong, SEED, learnt)
    assert found is not None
    assert "quantisation" in found.effects
    assert found.ci[0] <= found.closure <= found.ci[1]
    # More runs of one machine differ from its records by chance alone.
    assert found.reference == pytest.approx(found.closure, abs=0.25)


def test_a_machine_without_a_gap_has_no_closure_to_check(learnt: Any) -> None:
    none = next(c for c in cases(300, SEED) if c.kind == "none" and c.arm == "twin")
    assert check(none, SEED, learnt) is None
