"""A simulator of the user's own: levels, values read off the records, impacts in finished waveforms, verdicts."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, firwin2, freqz, lfilter, welch

from tests.twingap.gap.own_simulator import (
    BEARING,
    FS_HZ,
    HUM,
    RAIL,
    SECOND_MODE,
    conditions,
    diagnosed,
    function,
    machine,
    simulated,
    waveform,
)
from twingap.effects import TransferPath, make_effect
from twingap.effects.clipping import Clipping
from twingap.effects.impact_train import response_of
from twingap.effects.mains_interference import MainsInterference
from twingap.gap.api import _significant
from twingap.gap.distance.closure import Closure
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.report.formats import closure
from twingap.gap.report.model import REFERENCE, Place, TwoSampleTest, Verdict
from twingap.gap.search.closest_twin import closest_spec
from twingap.gap.search.effect_search import Estimated, Explanation
from twingap.gap.search.evidence import Compared, Evidence, simulator_of
from twingap.gap.search.initial_values import observations
from twingap.gap.search.measured_effects import with_measured
from twingap.identification import identify
from twingap.identification.calibrate import calibrate
from twingap.records import Record, RecordSet
from twingap.twins import TwinSpec, register_callable
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import flat

WAYS = ("sim", "function")


@cache
def evidence(name: str, way: str) -> Evidence:
    """One of `MACHINES` against the simulator."""
    return evidence_of(machine(name), way)


def evidence_of(records: RecordSet, way: str, sim: RecordSet | None = None) -> Evidence:
    register_callable("own simulator", function)
    spec = TwinSpec("own simulator", bearing=BEARING)
    sim = None if way == "function" else sim or simulated()
    calibrated = calibrate(records, spec if sim is None else None, np.random.default_rng(0), sim=sim)
    return Evidence(calibrated, simulator_of(calibrated, sim), spec, 7)


def level(of: Evidence) -> float:
    simulator = of.against().simulator
    if isinstance(simulator, ExternalSimulator):
        return simulator.gain
    assert isinstance(simulator, TwinSimulator)
    return float(flat(simulator.spec.parameters)["scale"])


# ---------------------------------------------------------------------------------------------------------------- level


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["hum, clipping", "second mode"])
def test_what_the_machine_has_more_is_no_reason_for_a_louder_simulator(way: str, name: str) -> None:
    assert level(evidence(name, way)) == pytest.approx(1.0, rel=0.03)


def test_a_simulator_in_another_unit_is_still_matched() -> None:
    quiet = (Record(r.condition, 0.25 * r.samples) for r in simulated())
    sim = RecordSet.from_records("quiet", "g", BEARING, quiet)
    assert level(evidence_of(machine("hum, clipping"), "sim", sim)) == pytest.approx(4.0, rel=0.03)


@pytest.mark.parametrize("way", WAYS)
def test_effects_are_relative_to_the_simulators_own_healthy_vibration(way: str) -> None:
    healthy = [r.samples.std() for r in simulated() if r.condition.fault == "healthy"]
    own = evidence("hum, clipping", way).against().simulator
    assert own.reference_rms == pytest.approx(float(np.sqrt(np.mean(np.square(healthy)))), rel=0.1)


def test_the_calibration_of_a_function_is_kept_in_its_twin_file() -> None:
    of = evidence("hum, clipping", "function")
    spec = closest_spec(Compared(of, (), of.against().simulator))
    assert spec is not None
    again = calibrate(machine("hum, clipping"), spec, np.random.default_rng(1)).spec
    assert again is not None
    assert flat(again.parameters) == flat(spec.parameters)
    found = identify(machine("hum, clipping"), TwinSpec("own simulator", bearing=BEARING))
    assert found.estimates["scale"].value == pytest.approx(float(flat(spec.parameters)["scale"]), rel=0.03)
    assert flat(found.spec.parameters).keys() == {"scale", "healthy_rms"}


# ----------------------------------------------------------------------------------------------------------- read off


@pytest.mark.parametrize("way", WAYS)
def test_a_rail_and_a_line_of_the_mains_are_read_off_in_the_records_unit(way: str) -> None:
    of = evidence("hum, clipping", way)
    simulator = of.against().simulator
    rail = of.at_read_values(make_effect("clipping"), simulator).parameter_values()["rail"]
    hum = of.at_read_values(make_effect("mains_interference"), simulator).parameter_values()
    assert rail * simulator.reference_rms == pytest.approx(RAIL, rel=1e-6)
    assert hum["level"] * simulator.reference_rms == pytest.approx(HUM, rel=0.03)
    assert hum["mains_hz"] == 50.0


def test_nothing_is_read_off_where_records_show_nothing_exactly() -> None:
    plain = evidence("nothing", "sim")
    assert not plain.read_off("clipping")
    assert not plain.read_off("mains_interference")
    steps = (Record(r.condition, np.round(r.samples / 0.3) * 0.3) for r in machine("nothing"))
    coarse = RecordSet.from_records("coarse", "g", BEARING, steps)
    assert not Clipping.read_off(coarse, ())
    hum = machine("hum")
    assert MainsInterference.read_off(hum, simulated())
    assert not MainsInterference.read_off(hum, hum)  # the simulator has it


# --------------------------------------------------------------------------------------------------------------- modes


@pytest.mark.parametrize("way", WAYS)
def test_a_second_mode_is_sought_at_the_hump_of_the_spectra(way: str) -> None:
    of = evidence("second mode", way)
    first = vars(make_effect("second_resonance").spectral_values(observations(of, of.against().fit))[0])
    assert first["frequency_hz"] == pytest.approx(SECOND_MODE[0], rel=0.04)


def test_the_response_to_an_impact_is_read_off_waveforms() -> None:
    at = [c for c in conditions() if c.fault != "healthy"]
    waves = [waveform(c, np.random.default_rng(i)) for i, c in enumerate(at)]
    passes = [FS_HZ / (BEARING.fault_order(str(c.fault)) * c.speed_rpm / 60) for c in at]
    response = response_of(waves, passes)
    assert response is not None
    power = np.abs(np.fft.rfft(response, 4096)) ** 2
    assert power.argmax() / 4096 * FS_HZ == pytest.approx(1850.0, rel=0.02)
    noise = [np.random.default_rng(i).standard_normal(25_600) for i in range(12)]
    assert response_of(noise, passes) is None


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("fault", ["healthy", "outer"])
def test_impacts_and_force_of_a_finished_waveform_pass_a_second_mode(way: str, fault: str) -> None:
    """A filter that raises impacts as the mode does would raise the noise of healthy records too much."""
    at = [c for c in conditions() if c.fault == fault]
    f_hz, damping, gain = SECOND_MODE
    mode = make_effect("second_resonance", {"frequency_hz": f_hz, "damping_ratio": damping, "gain": gain})
    made = evidence("nothing", way).against().simulator.simulate((mode,), at, 5, 0)
    real = [r for r in machine("second mode") if r.condition.fault == fault]
    place, theirs = welch(np.array([r.samples for r in made]), FS_HZ, nperseg=512)
    _, ours = welch(np.array([r.samples for r in real]), FS_HZ, nperseg=512)
    off_db = 10 * np.log10(theirs.mean(axis=0) / ours.mean(axis=0))
    assert np.abs(off_db[(place > 4800) & (place < 5600)]).mean() < 1.2
    assert np.abs(off_db[(place > 300) & (place < 12_000)]).mean() < 0.8


def filtered(records: RecordSet, gains: tuple[float, ...]) -> tuple[RecordSet, np.ndarray]:
    """Records that have passed a secret FIR filter as a whole, and its impulse response."""
    places = np.linspace(0, FS_HZ / 2, len(gains))
    taps = firwin2(257, places, 10 ** (np.array(gains) / 20), fs=FS_HZ)
    rows = (Record(r.condition, np.convolve(r.samples, taps)[: r.condition.n_samples]) for r in records)
    return RecordSet.from_records("filtered", "g", BEARING, rows), taps


def test_a_filter_of_whole_waveforms_is_a_path_and_takes_the_place_of_what_stands_in_for_it() -> None:
    records, taps = filtered(machine("nothing"), (-6.0, 8.0, -9.0, 5.0, 9.0, -8.0, 3.0))
    evidence = evidence_of(records, "sim")
    mode = make_effect("second_resonance", {"frequency_hz": 8500.0, "gain": 0.3})
    before, after = evidence.against(), evidence.against((mode,))
    explanation = Explanation(
        0.01, True, (Estimated(mode, {}),), {}, ((), ("second_resonance",)), 0.01, before, after, {}
    )
    found = with_measured(evidence, explanation)
    assert found.names == ("transfer_path",)
    assert found.confidence_set == (("transfer_path",),)
    assert found.probability["second_resonance"] == 0.0
    (path,) = found.after.effects
    assert isinstance(path, TransferPath) and path.all_samples
    at = np.linspace(300.0, 12_000.0, 60)
    true = 20 * np.log10(np.abs(freqz(taps, worN=at, fs=FS_HZ)[1]))
    off_db = np.interp(at, path.frequencies_hz, path.gains_db) - true
    assert np.quantile(np.abs(off_db - np.median(off_db)), 0.9) < 1.5


def test_a_mode_of_the_impacts_is_no_filter_of_whole_waveforms() -> None:
    of = evidence("second mode", "sim")
    f_hz, damping, gain = SECOND_MODE
    mode = make_effect("second_resonance", {"frequency_hz": f_hz, "damping_ratio": damping, "gain": gain})
    before, after = of.against(), of.against((mode,))
    explanation = Explanation(0.01, True, (Estimated(mode, {}),), {}, ((),), 0.01, before, after, {})
    assert with_measured(of, explanation).names == ("second_resonance",)


@pytest.mark.parametrize("probability", [1.0, 0.5])
def test_a_path_does_not_replace_a_roll_off_of_another_form_than_in_the_catalogue(probability: float) -> None:
    """The path closes more, but its gain is nearly flat beside the roll-off."""
    b, a = butter(1, 1500.0, fs=FS_HZ)
    rows = (Record(r.condition, lfilter(b, a, r.samples)) for r in machine("nothing"))
    evidence = evidence_of(RecordSet.from_records("rolled off", "g", BEARING, rows), "sim")
    rolloff = make_effect("sensor_rolloff", {"corner_hz": 2200.0, "order": 2, "background": 1.0})
    before, after = evidence.against(), evidence.against((rolloff,))
    estimated = (Estimated(rolloff, {}),)
    of = {"sensor_rolloff": probability}
    found = with_measured(evidence, Explanation(0.01, True, estimated, of, ((),), 0.5, before, after, {}))
    assert found.names == ("sensor_rolloff",)


# ------------------------------------------------------------------------------------------------------------- verdicts


def test_what_a_function_is_stated_to_model_is_no_candidate() -> None:
    register_callable("clips", function, has=["clipping"])
    assert "clipping" in TwinSimulator(TwinSpec("clips"), BEARING).has


def test_a_gap_that_nothing_shows_is_none() -> None:
    compared = evidence("nothing", "sim").against()
    found = Explanation(0.03, True, (), {}, (("clipping",),), 1.0, compared, compared, {})
    below = Closure(0.0, 0.0, 0.14, 0.0, (0.0, 0.0))
    quiet = (TwoSampleTest("a", 0.5, 0.7),)
    changed, notes = _significant(found, below, quiet, ())
    assert not changed.gap
    assert changed.p_value == 0.7
    assert len(notes) == 1
    place = Place("frequency", 100.0, 200.0, "Hz", 1.0, 0.01)
    for closed, tests, places in (
        (replace(below, before=0.3), quiet, ()),
        (below, (TwoSampleTest("a", 0.9, 0.01),), ()),
        (below, quiet, (place,)),
    ):
        assert _significant(found, closed, tests, places) == (found, [])


def test_a_gap_that_is_more_than_doubled_has_no_percentage() -> None:
    assert closure(-1.9, (-3.0, -1.2)) == "widens the gap"
    verdict = Verdict("partly_explained", ("clipping",), (("clipping",),), 0.01, -3.7, (-5.0, -2.0))
    assert "widens the gap, a significant rest remains" in verdict.sentence


def test_a_function_that_made_the_records_is_no_gap() -> None:
    assert diagnosed(machine("nothing"), "function").verdict.status == "no_gap"


def test_hum_and_clipping_are_named_and_close_the_gap() -> None:
    report = diagnosed(machine("hum, clipping"), "sim")
    assert set(report.verdict.effects) == {"mains_interference", "clipping"}
    assert (report.verdict.closure or math.nan) > 0.75
    (rail,) = (c.parameters["rail"] for c in report.candidates if c.effect == "clipping")
    assert rail.value * report.calibration[REFERENCE].value == pytest.approx(RAIL, rel=1e-3)
