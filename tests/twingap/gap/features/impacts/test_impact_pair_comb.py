"""Second impacts are combs over harmonics: at any speed, of any fault, out of many faint records, and not by chance."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import EntryExit, make_effect
from twingap.effects.entry_exit import SoftEntryExit
from twingap.gap.features.impacts import impact_pair_comb, impulse_response
from twingap.gap.features.pooled.features import PooledRecords
from twingap.gap.features.spectrum.record_summary import summarise
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

RATES = {"6205": 12000.0, "UER204": 25600.0, "ZA-2115": 20000.0}
SPEEDS = (1100.0, 1450.0, 1900.0)


def impact_spectra(name, effects=(), faults=("outer", "inner"), seed=0, amplitude=12.0, speeds=SPEEDS):
    fs_hz, bearing = RATES[name], BEARINGS[name]
    impacts = dict.fromkeys(("inner", "outer", "ball"), amplitude)
    parameters = PhenomenologicalParameters(resonance_hz=0.2 * fs_hz, damping_ratio=0.05, impact_amplitude=impacts)
    conditions = [
        Condition(f"{fault}{i}", speed, fs_hz, int(fs_hz), fault)
        for fault in faults for i, speed in enumerate(speeds)
    ]  # fmt: skip
    frame = Frame(bearing, (0.15 * fs_hz, 0.25 * fs_hz), 1.0)
    twin = PhenomenologicalTwin(bearing, parameters, effects)
    records = twin.simulate(conditions, np.random.default_rng(seed))
    return [impulse_response.impact_spectrum(RecordTransforms(r.samples, r.condition, frame)) for r in records]


def compared(name, effects, seed=1, **more):
    return impact_pair_comb.compare(
        impact_spectra(name, effects, seed=seed, **more), impact_spectra(name, **more), BEARINGS[name]
    )


@pytest.mark.parametrize("name", RATES)
def test_one_machine_has_no_comb_against_itself(name):
    found = compared(name, ())
    assert found["clear_gain"] < 0.2
    assert found["faint_score"] < 1


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("arc_deg", [1.5, 3.0, 6.0])
def test_a_second_impact_is_a_comb_of_its_arc_at_any_speed(name, arc_deg):
    found = compared(name, [make_effect("entry_exit", {"arc_deg": arc_deg, "exit_ratio": 0.8})])
    for kind in ("clear", "faint"):
        assert found[f"{kind}_gain"] > 0.4
        assert np.exp(found[f"{kind}_arc_log"]) == pytest.approx(arc_deg, rel=0.05)
        assert found[f"{kind}_same"] > found[f"{kind}_opposed"]


@pytest.mark.parametrize("part", [0.12, 0.27, 0.4])
def test_long_defects_and_those_of_rollers_are_combs_too(part):
    """On a ball one pass is half a turn of it: nearly half a pass is an arc of seventy degrees."""
    found = compared("6205", [make_effect("entry_exit", {"arc_deg": 180 * part, "exit_ratio": 0.8})], faults=("ball",))
    assert found["clear_gain"] > 0.5
    assert np.exp(found["clear_arc_log"]) == pytest.approx(180 * part, rel=0.06)


def test_each_fault_is_a_defect_of_its_own_length():
    """As much of a pass on a ball as on a race is another arc: one arc for both would be no comb."""
    found = compared("6205", [SoftEntryExit(arc_deg=10.0, exit_ratio=0.8, pass_part=0.25)], faults=("outer", "ball"))
    assert found["clear_gain"] > 0.5


def test_a_reversed_second_impact_is_a_comb_turned_round():
    found = compared("6205", [EntryExit(arc_deg=3.0, exit_ratio=0.8, turned=True)])
    assert found["clear_ratio"] < 0
    assert np.exp(found["clear_arc_log"]) == pytest.approx(3.0, rel=0.05)


def test_where_the_cage_slips_the_comb_is_that_of_the_rate_that_lines_show():
    """Two per cent of slip move harmonic 50 by one: at kinematic rates a comb is blurred, and off by as much."""
    both = [make_effect("mean_slip", {"slip": 0.02}), make_effect("entry_exit", {"arc_deg": 17.0, "exit_ratio": 0.5})]
    found = compared("UER204", both, faults=("outer",))
    assert found["faint_score"] > 2.5
    assert np.exp(found["faint_arc_log"]) == pytest.approx(17.0, rel=0.005)


def test_a_faint_second_impact_shows_in_many_records():
    """A comb 3 dB deep, impacts hardly above the noise: its score grows with the records, by chance it does not."""
    faint = [make_effect("entry_exit", {"arc_deg": 4.0, "exit_ratio": 0.2})]
    few, many = {"speeds": (1450.0,)}, {"speeds": tuple(np.linspace(1200, 1700, 10))}

    def scores(effects, of):
        found = [compared("6205", effects, seed, amplitude=6.0, faults=("outer",), **of) for seed in (1, 2, 3, 4)]
        return np.array([f["faint_score"] for f in found])

    assert scores(faint, many).min() > scores(faint, few).mean()
    assert scores(faint, many).min() > 1.3 * scores((), many).max()


def test_a_score_counts_harmonics():
    """The same comb in more harmonics is less likely to be chance."""
    rng = np.random.default_rng(0)

    def of(harmonics, depth):
        k = np.arange(1, harmonics + 1)
        comb = 1 + depth * np.cos(2 * np.pi * 0.2 * k)
        power = np.full(harmonics, 100.0)
        error, places = np.ones(harmonics), np.zeros(harmonics, int)
        noisy = power * comb * np.exp(0.3 * rng.standard_normal(harmonics))
        return impulse_response.ImpactSpectrum("outer", noisy, error, places, np.ones(64))

    def score(harmonics, depth):
        found = [
            impact_pair_comb.compare([of(harmonics, depth)], [of(harmonics, 0.0)], BEARINGS["6205"])["clear_score"]
            for _ in range(20)
        ]
        return float(np.mean(found))

    assert score(200, 0.5) > score(30, 0.5) + 0.2
    assert score(200, 0.0) < score(30, 0.0) + 0.25


def test_nothing_is_said_without_impacts():
    assert all(np.isnan(v) for v in impact_pair_comb.compare([], impact_spectra("6205"), BEARINGS["6205"]).values())


def mixed(effects, amplitudes, seed):
    """Records of one defect at different loudness."""
    return [
        record
        for i, amplitude in enumerate(amplitudes)
        for record in impact_spectra("6205", effects, ("outer",), seed + i, amplitude, (1100.0 + 70 * i,))
    ]


@pytest.mark.parametrize("more", [(1.0,), (2.0,), (3.0,) * 4, (1.0, 2.5, 4.0, 5.5, 7.0, 9.0)])
def test_records_that_drown_do_not_silence_the_comb_of_the_others(more):
    second, loud = [make_effect("entry_exit", {"arc_deg": 4.0, "exit_ratio": 0.5})], (12.0,) * 4
    found = impact_pair_comb.compare(mixed(second, loud + more, 1), mixed((), loud + more, 50), BEARINGS["6205"])
    assert found["clear_score"] > 2.5
    assert np.exp(found["clear_arc_log"]) == pytest.approx(4.0, rel=0.03)
    assert found["clear_ratio"] > 0


def of_path(resonance_hz, effects, seed):
    """Impacts and noise, healthy records among them, at six speeds."""
    parameters = PhenomenologicalParameters(resonance_hz, 0.1, impact_amplitude={"outer": 12.0})
    conditions = [
        Condition(f"{fault}{i}", 1200.0 + 90 * i, 12000.0, 12000, fault)
        for fault in ("outer", "healthy") for i in range(6)
    ]  # fmt: skip
    frame = Frame(BEARINGS["6205"], (1800.0, 3000.0), 1.0)
    twin = PhenomenologicalTwin(BEARINGS["6205"], parameters, effects)
    records = twin.simulate(conditions, np.random.default_rng(seed))
    return PooledRecords(tuple(summarise(RecordTransforms(r.samples, r.condition, frame)) for r in records))


def combs(real, simulated):
    return impact_pair_comb.compare(
        real.impact_spectra, simulated.impact_spectra, BEARINGS["6205"], real.noise - simulated.noise
    )


@pytest.mark.parametrize("moved", [0.95, 1.1])
def test_a_mode_that_calibration_missed_is_no_comb(moved):
    """It shapes the ratio over harmonics as it shapes that of the noise."""
    real, simulated = of_path(2400.0 * moved, (), 1), of_path(2400.0, (), 2)
    found = combs(real, simulated)
    assert max(found["clear_score"], found["faint_score"]) < 0.7
    assert np.isnan(found["clear_arc_log"])
    unaware = impact_pair_comb.compare(real.impact_spectra, simulated.impact_spectra, BEARINGS["6205"])
    assert unaware["clear_score"] > found["clear_score"] + 0.4


def test_a_second_impact_is_heard_beside_a_second_mode():
    mode = make_effect("second_resonance", {"frequency_hz": 4300.0, "damping_ratio": 0.03, "gain": 0.8})
    double = make_effect("entry_exit", {"arc_deg": 4.0, "exit_ratio": 0.4})
    simulated = of_path(2400.0, (), 2)
    both, alone = combs(of_path(2400.0, [mode, double], 1), simulated), combs(of_path(2400.0, [mode], 1), simulated)
    assert np.exp(both["clear_arc_log"]) == pytest.approx(4.0, rel=0.05)
    assert both["clear_score"] > alone["clear_score"] + 0.4
    assert np.isnan(alone["clear_arc_log"])
