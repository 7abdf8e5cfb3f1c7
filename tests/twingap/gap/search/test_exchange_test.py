"""A simulator of the user's own against a machine whose recordings differ: no gap unless exchanges show one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.gap.api import _confirmed
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.search.effect_search import Explanation
from twingap.gap.search.evidence import FEWEST_GROUPS, Evidence, simulator_of
from twingap.gap.search.exchange_test import exchange_p_value, sign_flip_p_value
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, Record, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

HUM = make_effect("mains_interference", {"level": 1.5})


def recordings(seed: int, *effects: Effect, count: int = 16) -> RecordSet:
    """Each through a path of its own, as if the sensor had been mounted anew, every other one with a hum."""
    rng = np.random.default_rng(seed)
    made: list[Record] = []
    for i in range(count):
        own = PhenomenologicalParameters(2600.0 * rng.lognormal(0, 0.2), 0.04 * rng.lognormal(0, 0.5), scale=0.3)
        condition = Condition(f"r{i}", 1500.0, 12000.0, 6000, ("healthy", "outer")[i % 2], group=f"g{i}")
        chain = (*effects, *([HUM] * (rng.random() < 0.5)))
        made += PhenomenologicalTwin(BEARINGS["6205"], own, chain, unit="g").simulate([condition], rng)
    return RecordSet.from_records("machine", "g", BEARINGS["6205"], made)


def evidence_of(records: RecordSet, sim: RecordSet) -> Evidence:
    calibrated = calibrate(records, None, np.random.default_rng(1), sim=sim)
    return Evidence(calibrated, simulator_of(calibrated, sim), TwinSpec("phenomenological"), 7)


def test_the_p_value_holds_whatever_signatures_have_in_common() -> None:
    rng = np.random.default_rng(3)
    groups = np.repeat(np.array(list("abcdefghij")), 2)
    p = []
    for _ in range(800):
        common = rng.standard_normal((10, 4)) @ rng.standard_normal((4, 30))
        heavy = np.repeat(rng.standard_t(2, (10, 30)) + common, 2, axis=0)  # of a group alike
        heavy[rng.random(heavy.shape) < 0.1] = np.nan
        covariates = np.stack([np.arange(20.0) // 7, np.zeros(20)], axis=1)
        p.append(sign_flip_p_value(heavy + 0.1 * rng.standard_normal(heavy.shape), covariates, groups, rng, draws=199))
    for level in (0.05, 0.2, 0.5):
        assert (np.array(p) <= level).mean() <= level + 3 * np.sqrt(level * (1 - level) / len(p))
    assert (np.array(p) <= 0.05).mean() > 0.02


def test_what_all_pairs_have_or_what_grows_shows_and_one_signature_alone_does_not() -> None:
    rng = np.random.default_rng(4)
    groups = np.array([f"g{i}" for i in range(12)])
    noise, few = rng.standard_normal((12, 100)), np.arange(100) < 20
    speed = np.stack([np.arange(12.0) - 5.5, np.zeros(12)], axis=1)
    assert sign_flip_p_value(noise + few, speed, groups, rng) < 0.01
    assert sign_flip_p_value(noise + 0.4 * few * speed[:, :1], speed, groups, rng) < 0.01
    assert sign_flip_p_value(noise + 0.4 * few * speed[:, :1], 0 * speed, groups, rng) > 0.05
    assert sign_flip_p_value(noise + 100.0 * (np.arange(100) == 0), speed, groups, rng) > 0.05
    assert sign_flip_p_value(np.full((12, 3), np.nan), speed, groups, rng) == 1.0
    assert sign_flip_p_value(np.zeros((12, 3)), speed, groups, rng) == 1.0


def test_recordings_that_differ_among_themselves_are_no_gap_and_what_all_have_is_one() -> None:
    sim = recordings(1)
    assert exchange_p_value(evidence_of(recordings(2), sim)) > 0.1
    rough = make_effect("quantisation", {"step": 1.5})
    assert exchange_p_value(evidence_of(recordings(2, rough), sim)) <= 0.01


def test_a_level_that_healthy_records_set_wrong_is_no_difference() -> None:
    """One healthy recording may be louder than another; the gain that it sets acts on all simulated samples."""
    machine, sim = recordings(2), recordings(1)
    step = 0.01  # a converter's: a gain on its samples leaves differences of rounding
    machine, sim = (
        RecordSet.from_records(
            own.name, "g", own.bearing, [Record(r.condition, np.round(r.samples / step) * step) for r in own]
        )
        for own in (machine, sim)
    )
    evidence = evidence_of(machine, sim)
    right = exchange_p_value(evidence)
    simulator = evidence.against().simulator
    assert right is not None and isinstance(simulator, ExternalSimulator)
    louder = Evidence(evidence.calibrated, simulator.with_gain(1.4 * simulator.gain), evidence.spec, 7)
    assert exchange_p_value(louder) == pytest.approx(right, abs=0.05)


def test_few_groups_cannot_be_exchanged() -> None:
    few = recordings(2, count=FEWEST_GROUPS - 2)
    assert exchange_p_value(evidence_of(few, recordings(1))) is None


@pytest.mark.parametrize("surest", [0.5, 0.95])
def test_a_gap_that_nothing_explains_for_sure_has_to_be_borne_out(surest: float) -> None:
    evidence = evidence_of(recordings(2), recordings(1))
    now = evidence.against()
    sets = (("clipping",), ())
    found = Explanation(0.01, True, (), {"clipping": surest}, sets, 0.01, now, now, {})
    told = _confirmed(found, evidence)
    if surest > 0.9:
        assert told == (found, [])
        return
    confirmed, (note,) = told
    assert not confirmed.gap
    assert confirmed.p_value > 0.05
    assert confirmed.confidence_set == ((), ("clipping",))
    assert "recordings differ" in note
    of_twin: Any = SimpleNamespace(
        simulator=SimpleNamespace(makes_waveforms=False)
    )  # a twin has no recordings to exchange
    assert _confirmed(replace(found, before=of_twin), evidence)[1] == []
