"""The level of a simulator that has no other baseline: matched anew with every effect, where it is free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.twingap.gap.search.test_optimise import OWN, machine
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.search.evidence import THOROUGH, Evidence, level_of, simulator_of
from twingap.gap.search.initial_values import observations
from twingap.gap.search.optimise import optimise
from twingap.identification.baseline import match_level, state_spectra
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, Record, RecordSet
from twingap.signal.record_transforms import Frame
from twingap.twins.callable_twin import register_callable
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

LOSS = make_effect("sensor_rolloff", {"order": 2, "corner_hz": 1500.0, "background": 1.0})


def simulated(gain: float, unit: str, seed: int = 9) -> RecordSet:
    """What the user simulates of `machine`, without any effect, in another unit or in the same."""
    plain = machine()
    made = PhenomenologicalTwin(BEARINGS["6205"], OWN, ()).simulate(plain.conditions, np.random.default_rng(seed))
    records = (Record(r.condition, gain * r.samples) for r in made)
    return RecordSet.from_records("own", unit, BEARINGS["6205"], records)


def evidence_of(records: RecordSet, sim: RecordSet) -> Evidence:
    spec = TwinSpec("phenomenological")
    calibrated = calibrate(records, None, np.random.default_rng(1), sim=sim)
    return Evidence(calibrated, simulator_of(calibrated, sim), spec, 7, THOROUGH)


def gain_of(simulator: object) -> float:
    assert isinstance(simulator, ExternalSimulator)
    return simulator.gain


def test_what_a_sensor_loses_is_not_taken_for_a_weak_machine() -> None:
    own = evidence_of(machine(LOSS), simulated(0.01, "g"))
    assert gain_of(own.against().simulator) < 80  # without the loss, weaker strikes are all that it can be
    assert gain_of(own.against([LOSS]).simulator) == pytest.approx(100.0, rel=0.03)


def test_a_level_in_one_unit_is_no_free_one() -> None:
    own = evidence_of(machine(), simulated(1.0, "m/s^2"))
    assert gain_of(own.against([LOSS]).simulator) == 1.0
    assert level_of(own.against().simulator, own.spec) is None


def test_a_level_that_is_off_moves_with_the_values() -> None:
    own = evidence_of(machine(LOSS), simulated(0.01, "g"))
    start = own.with_values(own.against([LOSS]).simulator, [LOSS], {"gain": 60.0})
    found = optimise(own, start, [LOSS], {}, moved=())
    assert gain_of(found.simulator) == pytest.approx(100.0, rel=0.06)
    assert found.misfit < 0.7 * found.before


def test_low_passes_are_sought_in_what_the_user_simulates() -> None:
    own = evidence_of(machine(LOSS), simulated(0.01, "g"))
    guess = make_effect("sensor_rolloff", {"order": 6, "corner_hz": 3500.0})
    first = vars(guess.spectral_values(observations(own, own.against().fit))[0])
    assert first["order"] == 2
    assert first["corner_hz"] == pytest.approx(1500.0, rel=0.3)


def test_a_functions_level_is_matched_with_its_effects() -> None:
    def noise(conditions: list[Condition], rng: np.random.Generator) -> list[np.ndarray]:
        return [rng.standard_normal(c.n_samples) for c in conditions]

    register_callable("level noise", noise)
    rng = np.random.default_rng(2)
    conditions = [Condition(f"r{i}", 1500.0, 10000.0, 10000, "healthy", group=f"r{i}") for i in range(8)]
    b = np.ones(8) / 8  # a loss of most of the power, which takes a tenfold level
    rows = (Record(c, 10 * np.convolve(rng.standard_normal(c.n_samples + 7), b, "valid")) for c in conditions)
    spec = TwinSpec("level noise")
    calibrated = calibrate(RecordSet.from_records("x", "g", BEARINGS["6205"], rows), spec, np.random.default_rng(0))
    own = Evidence(calibrated, simulator_of(calibrated), spec, 7)
    before = level_of(own.against().simulator, spec)
    loss = make_effect("sensor_rolloff", {"order": 2, "corner_hz": 600.0})
    after = level_of(own.against([loss]).simulator, spec)
    assert before is not None and after is not None
    assert after[0] == "scale"
    assert after[1] > 1.8 * before[1]


def test_strong_tones_and_bands_that_an_effect_fills_do_not_decide() -> None:
    frame = Frame(BEARINGS["6205"], (1000.0, 2000.0), 1.0)
    rng = np.random.default_rng(5)
    condition = Condition("r", 1500.0, 10000.0, 40000, "healthy")
    x = rng.standard_normal(40000)
    hiss = np.fft.irfft(np.fft.rfft(rng.standard_normal(40000)) * (np.fft.rfftfreq(40000) < 0.04), 40000) * 100
    tone = 30 * np.sin(np.arange(40000) * 0.7)
    (side,) = state_spectra([Record(condition, 3 * x + hiss + tone)], frame)

    def made(level: float, conditions: object) -> list[Record]:
        return [Record(condition, level * rng.permutation(x))]

    assert match_level(made, [side], frame, 20.0) == pytest.approx(3.0, rel=0.03)
    assert match_level(made, [replace(side, psd=0 * side.psd)], frame, 1.0) > 0  # silence: any level is as wrong
