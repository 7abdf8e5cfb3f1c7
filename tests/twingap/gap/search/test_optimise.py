"""Fitted values: those of the machine, within what the twin file fixes and a bounded number of trials."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.gap.distance.paired import Paired
from twingap.gap.search import evidence
from twingap.gap.search import optimise as nearest
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.gap.search.optimise import Optimised, at_estimates, closest, not_farther, optimise
from twingap.gap.search.parameter_prior import Prior
from twingap.gap.search.parameter_scale import to_number
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.simulator import Simulator
from twingap.twins.twin_file import TwinSpec, flat

OWN = PhenomenologicalParameters(2400.0, 0.05, {"inner": 5.0, "outer": 6.0}, 0.7, 0.6, 1.5)


def machine(*effects: Effect, n_samples: int = 10000, own: PhenomenologicalParameters = OWN) -> RecordSet:
    """Twelve records of two states at two speeds."""
    conditions = [
        Condition(f"{fault}{i}", 1500.0 + 300.0 * (i % 2), 10000.0, n_samples, fault, group=f"{fault}{i}")
        for fault in ("healthy", "inner")
        for i in range(6)
    ]
    made = PhenomenologicalTwin(BEARINGS["6205"], own, effects).simulate(conditions, np.random.default_rng(4))
    return RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], made)


def evidence_of(records: RecordSet, spec: TwinSpec | None = None) -> Evidence:
    spec = spec or TwinSpec("phenomenological")
    calibrated = calibrate(records, spec, np.random.default_rng(1))
    return Evidence(calibrated, simulator_of(calibrated), spec, 7)


@pytest.mark.parametrize(
    ("truth", "guess", "parameter"),
    [
        (make_effect("mains_interference", {"level": 0.9}), {"level": 0.1}, "level"),
        (make_effect("clipping", {"rail": 3.0}), {"rail": 4.2}, "rail"),
        (make_effect("quantisation", {"step": 0.8}), {"step": 0.3}, "step"),
        (make_effect("cage_modulation", {"depth": 0.7}), {"depth": 0.2}, "depth"),
    ],
)
def test_the_value_of_the_machine_is_found_from_afar(truth: Effect, guess: dict[str, float], parameter: str) -> None:
    own = evidence_of(machine(truth))
    start = make_effect(truth.name, {**{k: v for k, v in vars(truth).items() if k != parameter}, **guess})
    compared = own.against([start])
    found = optimise(own, compared.simulator, [start], {(truth.name, parameter): 0.1})
    # As near as the truth; how near that is to its value, two faulty records say more or less sharply.
    assert found.misfit <= 1.02 * own.misfit(own.against([truth]).simulator, [truth])
    assert getattr(found.effects[0], parameter) == pytest.approx(getattr(truth, parameter), rel=0.35)
    assert found.misfit < 0.8 * found.before


def test_values_that_make_up_for_each_other_are_moved_together() -> None:
    """One after the other they would go down a valley in small steps, or stay on its slope."""
    truth = make_effect("coloured_noise", {"level": 0.8, "slope": 0.5, "low_hz": 500.0, "high_hz": 1600.0})
    own = evidence_of(machine(truth))
    start = make_effect("coloured_noise", {"level": 0.4, "slope": 0.0, "low_hz": 350.0, "high_hz": 2100.0})
    found = optimise(own, own.against([start]).simulator, [start], {})
    best = own.misfit(own.against([truth]).simulator, [truth])
    assert found.before > 1.15 * best
    assert found.misfit < 1.05 * best
    assert vars(found.effects[0])["level"] == pytest.approx(0.8, rel=0.2)


def test_few_trials_go_to_values_that_are_moved_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """One by one, far places of values that are right already would take all of them."""
    monkeypatch.setattr(evidence, "TRIALS", (40, 40))
    right = [make_effect("mains_interference", {"level": 0.3}), make_effect("cage_modulation", {"depth": 0.5})]
    truth = make_effect("coloured_noise", {"level": 0.8, "slope": 0.5, "low_hz": 500.0, "high_hz": 1600.0})
    own = evidence_of(machine(*right, truth))
    start = [*right, make_effect("coloured_noise", {"level": 0.4, "slope": 0.0, "low_hz": 350.0, "high_hz": 2100.0})]
    found = optimise(own, own.against(start).simulator, start, {})
    best = own.misfit(own.against([*right, truth]).simulator, [*right, truth])
    assert found.misfit - best < 0.5 * (found.before - best)


def test_what_comes_by_chance_stays_where_other_chances_disagree(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others are sought without it: one fit to chance does not undo them."""
    gaps = make_effect("dropout", {"rate_hz": 1.0, "length_s": 0.02})
    own = evidence_of(machine(gaps, make_effect("mains_interference", {"level": 0.9})))
    start = [replace(gaps, rate_hz=1.5), make_effect("mains_interference", {"level": 0.3})]
    monkeypatch.setattr(
        nearest.ValueSearch, "validated", lambda self, *built: not any(name == "dropout" for name, _ in self.at)
    )
    found = optimise(own, own.against(start).simulator, start, {})
    by_name = {effect.name: vars(effect) for effect in found.effects}
    assert by_name["dropout"] == vars(start[0])
    assert by_name["mains_interference"]["level"] == pytest.approx(0.9, rel=0.35)
    assert found.misfit < found.before


def test_what_is_exact_or_wrong_stays() -> None:
    own = evidence_of(machine(make_effect("foreign_bearing", {"level": 6.0, "order": 3.37})))
    start = make_effect("foreign_bearing", {"level": 2.0, "order": 3.37})
    found = optimise(own, own.against([start]).simulator, [start], {})
    assert vars(found.effects[0])["order"] == pytest.approx(3.37, rel=1e-12)
    assert vars(found.effects[0])["level"] > 3.0


def test_what_other_random_streams_do_not_bear_out_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    hum = make_effect("mains_interference", {"level": 0.9})
    own = evidence_of(machine(hum))
    start = make_effect("mains_interference", {"level": 0.2})
    simulator = own.against([start]).simulator
    assert optimise(own, simulator, [start], {}).effects != (start,)
    gap, asked = Evidence.gap, []

    def worse(self: Evidence, simulator: Simulator, effects: tuple[Effect, ...], replicate: int = 3) -> float:
        asked.append(replicate)
        return -gap(self, simulator, effects, replicate)

    monkeypatch.setattr(Evidence, "gap", worse)
    found = optimise(own, simulator, [start], {})
    assert found.effects == (start,)
    assert found.simulator is simulator
    assert found.misfit == found.before
    assert set(asked) == {5, 6, 7}


def test_what_drives_records_and_twin_apart_is_sought_anew_from_the_twin_without_it() -> None:
    hum = make_effect("mains_interference", {"level": 0.4})
    own = evidence_of(machine(hum))
    bare = Optimised(own.against().simulator, (), 0.0, 0.0)
    loud = Optimised(bare.simulator, (replace(hum, level=9.0),), 0.0, 0.0)
    found = not_farther(own, loud, bare, {})
    gaps = [own.gap(one.simulator, one.effects, 9) for one in (found, bare, loud)]
    assert gaps[0] < 0.6 * gaps[1] < gaps[2]
    assert vars(found.effects[0])["level"] == pytest.approx(0.4, rel=0.3)
    assert not_farther(own, found, bare, {}) is found


def test_values_far_from_their_estimates_are_tried_at_them_too() -> None:
    """Roughness from a much weaker start ends weak; of both results the closer one is kept."""
    truth = make_effect("distributed_roughness", {"level": 1.5, "depth": 0.6})
    own = evidence_of(machine(truth))
    priors = {("distributed_roughness", "level"): Prior(to_number(truth, "level", own.setting), 0.3)}
    weak = make_effect("distributed_roughness", {"level": 0.1, "depth": 0.1})
    near = make_effect("distributed_roughness", {"level": 1.4, "depth": 0.1})
    assert at_estimates((near,), priors, own.setting) == (near,)
    (back,) = at_estimates((weak,), priors, own.setting)
    assert vars(back)["level"] == pytest.approx(1.5)
    assert vars(back)["depth"] == 0.1, "no estimate"
    results = [
        optimise(own, own.against([effect]).simulator, [effect], {}, priors=priors, grid=False)
        for effect in (weak, back)
    ]
    kept = closest(own, results, priors)
    assert kept is results[1]
    assert vars(kept.effects[0])["level"] == pytest.approx(1.5, rel=0.3)


def test_a_baseline_that_is_off_is_brought_back() -> None:
    own = evidence_of(machine())
    twin = own.against().simulator
    wrong = flat(twin.spec.parameters) | {"scale": 2 * OWN.scale, "resonance_hz": 2600.0}  # type: ignore[attr-defined]
    started = own.with_values(twin, (), wrong)
    found = optimise(own, started, (), {})
    values = flat(found.simulator.spec.parameters)  # type: ignore[attr-defined]
    levels = np.hypot(values["structure_noise_rms"], values["white_noise_rms"]) * values["scale"]
    assert levels == pytest.approx(np.hypot(0.7, 0.6) * 1.5, rel=0.1)
    assert values["resonance_hz"] == pytest.approx(2400.0, rel=0.03)


def test_of_a_few_short_records_chance_says_little_of_impacts() -> None:
    """Other random streams, other impacts: unless what calibration says of them holds."""
    spec = TwinSpec("phenomenological")
    weak = replace(OWN, impact_amplitude={"inner": 3.0, "outer": 3.0})
    calibrated = calibrate(machine(n_samples=2500, own=weak), spec, np.random.default_rng(1))
    assert len(calibrated.fit) == 4
    found = []
    for root in range(7, 11):
        own = Evidence(calibrated, simulator_of(calibrated), spec, root)
        twin = optimise(own, own.against().simulator, (), {}).simulator
        found.append(flat(twin.spec.parameters)["impact_amplitude.inner"])  # type: ignore[attr-defined]
    assert np.std(np.log(found)) < 0.1


def test_stiff_estimates_do_not_make_up_for_what_is_missing_besides() -> None:
    """Lines of the shaft that are known, beside looseness that is not: louder, they would be nearer."""
    shaft = make_effect("shaft_harmonics", {"level_1x": 0.3, "level_2x": 0.2, "level_3x": 0.1})
    loose = make_effect("looseness", {"level": 1.5, "decay": 0.9})
    own = evidence_of(machine(shaft, loose))
    simulator = own.against([shaft]).simulator
    levels = ("level_1x", "level_2x", "level_3x")
    priors = {("shaft_harmonics", p): Prior(to_number(shaft, p, own.setting), 0.3) for p in levels}
    moved = []
    for weight in (1.0, 30.0):
        found = optimise(own, simulator, [shaft], {}, priors=priors, prior_weight=weight).effects[0]
        moved.append(max(abs(np.log(getattr(found, p) / getattr(shaft, p))) for p in levels))
    assert moved[1] < 0.15
    assert moved[1] < 0.5 * moved[0]


def test_what_the_twin_file_fixes_stays() -> None:
    spec = TwinSpec("phenomenological", (), None, {"resonance_hz": 2700.0})
    own = evidence_of(machine(), spec)
    found = optimise(own, own.against().simulator, (), {})
    assert flat(found.simulator.spec.parameters)["resonance_hz"] == 2700.0  # type: ignore[attr-defined]


def test_effects_that_are_not_to_move_stay_and_the_misfit_never_grows() -> None:
    tone, zone = make_effect("drive_interference", {"level": 0.9}), make_effect("cage_modulation", {"depth": 0.3})
    own = evidence_of(machine(tone))
    simulator = own.against([tone, zone]).simulator
    found = optimise(own, simulator, [tone, zone], {}, moved=["cage_modulation"], baseline=False)
    assert found.effects[0] == tone
    assert found.misfit <= found.before
    assert vars(found.effects[1])["depth"] < 0.3


def test_trials_are_bounded_whatever_the_records(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long records are cut for trials, and many long ones are tried less often."""
    monkeypatch.setattr(evidence, "SAMPLES_TRIED", 4e6)
    short, long, longer = (evidence_of(machine(n_samples=n)) for n in (10000, 40000, 90000))
    assert short.trials > long.trials == longer.trials
    asked = 0
    once = Evidence.tried

    def counted(self: Evidence, *arguments: object) -> Paired:
        nonlocal asked
        asked += 1
        return once(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Evidence, "tried", counted)
    optimise(short, short.against().simulator, (), {}, passes=1000)
    assert asked <= short.trials + 1


def test_values_stay_where_they_are_plausible(monkeypatch: pytest.MonkeyPatch) -> None:
    """Impulses by the thousand that ring for hours would be simulated otherwise, whatever they took."""
    impulses = make_effect("impulsive_noise", {"level": 8.0, "rate_hz": 45.0, "damping_ratio": 0.012})
    own = evidence_of(machine(make_effect("impulsive_noise", {"level": 20.0, "rate_hz": 49.0})))
    tried: list[Effect] = []
    once = Evidence.tried

    def seen(self: Evidence, simulator: object, effects: tuple[Effect, ...]) -> Paired:
        tried.extend(effects)
        return once(self, simulator, effects)  # type: ignore[arg-type]

    monkeypatch.setattr(Evidence, "tried", seen)
    optimise(own, own.against([impulses]).simulator, [impulses], {("impulsive_noise", "rate_hz"): 1.0})
    assert len(tried) > 50
    for field in fields(impulses):  # type: ignore[arg-type]
        low, high = field.metadata["plausible"]
        values = [getattr(effect, field.name) for effect in tried]
        assert 0.999 * low <= min(values)
        # Levels are multiples of a healthy vibration that may be very quiet: three times as high is tried as well.
        assert max(values) <= 1.001 * high * (3 if field.name == "level" else 1)
