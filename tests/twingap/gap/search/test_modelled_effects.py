"""Effects that a twin file names without a value."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from tests.twingap.gap.conftest import FewEffects
from tests.twingap.gap.search.test_optimise import machine
from twingap.effects import make_effect
from twingap.gap import diagnose
from twingap.gap.search.modelled_effects import completed, without_values
from twingap.identification.calibrate import prepare
from twingap.twins.twin_file import TwinSpec


def test_only_effects_without_any_value_are_open() -> None:
    spec = TwinSpec(
        "phenomenological", ("slip_jitter", "load_zone", "mains_interference"), None,
        {"mains_interference": {"mains_hz": 60.0}},
    )  # fmt: skip
    assert without_values(spec) == ("slip_jitter", "load_zone")


def test_values_are_read_off_the_fit_part_and_are_in_the_report(learnt: Any, few_effects: FewEffects) -> None:
    few_effects("clipping")
    records = machine(
        make_effect("mains_interference", {"level": 0.8, "mains_hz": 50.0, "n_harmonics": 2}), n_samples=5000
    )
    named = TwinSpec("phenomenological", ("mains_interference",))
    rng = np.random.default_rng(3)
    before = copy.deepcopy(rng.bit_generator.state)
    own = copy.deepcopy(rng)
    prepared = prepare(records, named, own)
    spec, notes = completed(prepared, named, copy.deepcopy(own), learnt)
    assert rng.bit_generator.state == before
    found = spec.parameters["mains_interference"]
    assert isinstance(found, dict) and abs(np.log(found["level"] / 0.8)) < 0.5
    assert found["mains_hz"] == 50.0
    assert len(notes) == 1 and "mains_interference (level = " in notes[0]
    given = TwinSpec("phenomenological", ("mains_interference",), None, {"mains_interference": dict(found)})
    assert completed(prepared, given, rng, learnt) == (given, ())
    report = diagnose(records, named, seed=3, learnt=learnt, quick=True).report
    assert notes[0] in report.notes
    assert "mains_interference" not in report.verdict.effects
