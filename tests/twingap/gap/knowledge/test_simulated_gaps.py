"""Simulated gaps: reproducible, of every effect, and such that records could show them."""

from dataclasses import replace

import numpy as np
import pytest

from twingap.effects import EntryExit, MeanSlip, Mode, SpeedGain, make_effect, trainable
from twingap.effects.drawing import healthy_density
from twingap.gap.knowledge.machines import draw_bearing, draw_machine
from twingap.gap.knowledge.outside_catalogue import _changed, _Plan, _shape, _wandering, with_outside_effect
from twingap.gap.knowledge.simulated_gaps import draw_effects, draw_gap
from twingap.gap.search.parameter_scale import Setting, coordinates, to_effect, to_number, with_errors


def test_the_same_seed_gives_the_same_gap():
    one, other = (draw_gap(np.random.default_rng(3), most_records=6) for _ in range(2))
    assert one.missing == other.missing
    for a, b in zip(one.records, other.records, strict=True):
        assert np.array_equal(a.samples, b.samples)
        assert a.condition == b.condition


@pytest.mark.slow
def test_every_effect_is_drawn_and_differs_from_the_machine_without_it():
    rng = np.random.default_rng(11)
    seen = {}
    for _ in range(400):
        if len(seen) == len(trainable()) and all(seen.values()):
            break
        machine = draw_machine(rng, own_simulator=False, most_records=8)
        for effect in draw_effects(rng, machine, 3):
            if seen.get(effect.name):  # a rail that nothing meets, now and then, is no effect
                continue
            with_it, without = (
                machine.twin(effects).simulate(machine.conditions, np.random.default_rng(5))
                for effects in ((effect,), ())
            )
            seen[effect.name] = any(
                not np.array_equal(a.samples, b.samples) for a, b in zip(with_it, without, strict=True)
            )
    assert set(seen) == set(trainable())
    assert all(seen.values())


def test_bearings_have_a_geometry_that_is_possible():
    rng = np.random.default_rng(0)
    for _ in range(300):
        bearing = draw_bearing(rng)  # refuses by itself what cannot be
        assert bearing.bpfo < bearing.bpfi


def test_numbers_and_effects_go_both_ways():
    rng = np.random.default_rng(8)
    for _ in range(60):
        machine = draw_machine(rng, own_simulator=False, most_records=8)
        setting = Setting.of(machine.conditions)
        for effect in draw_effects(rng, machine, 2):
            numbers = {p: to_number(effect, p, setting) for name, p in coordinates() if name == effect.name}
            again = to_effect(effect.name, numbers, setting)
            for parameter in numbers:
                assert getattr(again, parameter) == pytest.approx(getattr(effect, parameter), rel=1e-6, abs=1e-9)


def test_bands_whose_frequencies_wander_keep_their_power_and_leave_the_rest_alone():
    fs_hz, n = 10_000.0, 40_000
    t = np.arange(n) / fs_hz
    x = np.sin(2 * np.pi * 3000 * t) + np.sin(2 * np.pi * 400 * t)
    plan = _Plan("shift", "wave", 2.0, 0.2, 0.4, 1.0, 64, 0)
    changed = _wandering(x, plan, _shape(t, plan, np.random.default_rng(0)))
    assert changed.std() == pytest.approx(x.std(), rel=0.01)
    power = np.abs(np.fft.rfft(changed * np.hanning(n))) ** 2
    f = np.fft.rfftfreq(n, 1 / fs_hz)
    low, sharp, near = (power[(f > a) & (f < b)].sum() for a, b in ((395, 405), (2995, 3005), (2800, 3200)))
    assert near == pytest.approx(low, rel=0.05)
    # A cosine of half height 0.008 fs moves the line by 80 Hz about its mean.
    assert sharp < 0.2 * near
    assert (f * power)[f > 2000].sum() / power[f > 2000].sum() == pytest.approx(3000, abs=2)


def test_one_fault_is_enough_for_slip_and_none_is_not():
    machine = draw_machine(np.random.default_rng(0), own_simulator=False, most_records=8)
    for kinds, drawn in ((("inner",), True), (("healthy", "outer"), True), (("healthy",), False)):
        own = tuple(replace(c, fault=kinds[i % len(kinds)]) for i, c in enumerate(machine.conditions))
        found = MeanSlip.draw(replace(machine, conditions=own), np.random.default_rng(1))
        assert (found is not None) == drawn


def test_failed_bearings_come_alone_too():
    kinds = [
        frozenset(str(c.fault) for c in draw_machine(np.random.default_rng(k), False, 8).conditions) for k in range(300)
    ]
    alone = [own for own in kinds if "healthy" not in own and len(own) < 3]
    assert {len(own) for own in alone} == {1, 2}
    assert 0.02 < len(alone) / 300 < 0.1


def test_what_shows_is_judged_beside_all_modes_of_the_structure():
    machine = draw_machine(np.random.default_rng(2), own_simulator=False, most_records=4)
    own = machine.parameters
    hz = 0.5 * own.resonance_hz
    loud = replace(machine, modes=(Mode(hz, own.damping_ratio, 3.0),))
    assert healthy_density(loud, hz) > 3 * healthy_density(machine, hz)
    assert healthy_density(loud, hz, (hz, own.damping_ratio, -3.0)) == pytest.approx(healthy_density(machine, hz))


def test_a_strange_record_keeps_its_length_and_changes():
    machine = draw_machine(np.random.default_rng(2), own_simulator=False, most_records=8)
    records = machine.twin().simulate(machine.conditions, np.random.default_rng(2))
    for seed in range(12):
        changed = with_outside_effect(records, np.random.default_rng(seed))
        assert all(np.isfinite(r.samples).all() for r in changed)
        assert any(not np.array_equal(a.samples, b.samples) for a, b in zip(changed, records, strict=True))
        assert changed.conditions == records.conditions


def test_records_of_a_sensor_that_is_fixed_anew_differ_in_level_alone():
    machine = draw_machine(np.random.default_rng(2), own_simulator=False, most_records=8)
    records = machine.twin().simulate(machine.conditions, np.random.default_rng(2))
    plan, rng = _Plan("level", "even", 1.0, 0.0, 0.5, 1.0, 64, 0), np.random.default_rng(3)
    factors = []
    for record in records:
        changed = _changed(record, plan, rng)
        assert np.allclose(changed / changed.std(), record.samples / record.samples.std())
        factors.append(changed.std() / record.samples.std())
    assert 0.05 < np.std(np.log(factors)) < 0.25


def test_a_twin_file_has_what_it_models_at_true_values_or_a_little_off():
    """Values that are read off records are never quite right: a machine is not to be called lacking for that."""
    same = []
    for seed in range(160):
        gap = draw_gap(np.random.default_rng([31, seed]), own_simulator=False, most_records=5)
        same += [gap.spec.parameters[effect.name] == effect.parameter_values() for effect in gap.modelled]
    assert 0.3 < np.mean(same) < 0.75
    assert len(same) > 15


def test_values_a_little_off_are_of_the_same_effect_and_near():
    effect, rng = make_effect("gear_mesh", {"level": 0.5, "teeth": 23, "n_harmonics": 3}), np.random.default_rng(2)
    setting = Setting(12_000.0, 0.0, 1.0, 1800.0)
    made = [with_errors(effect, 0.1, setting, rng) for _ in range(300)]
    assert {one.teeth for one in made} == {23}  # known, or not at all
    assert np.std([np.log(one.level) for one in made]) == pytest.approx(0.1, abs=0.02)
    assert with_errors(effect, 0.0, setting, rng) == effect


def test_second_impacts_are_drawn_where_they_can_be_told_from_one():
    """At least two samples after the first in some record, and well before the next pass."""
    rng, arcs = np.random.default_rng(21), 0
    while arcs < 40:
        machine = draw_machine(rng, own_simulator=False, most_records=8)
        values = EntryExit.draw(machine, rng)
        if values is None:
            continue
        arcs += 1
        race, parts = 360 / machine.bearing.n_rollers, []
        for c in machine.conditions:
            if c.fault == "healthy":
                continue
            part = values["arc_deg"] / (180.0 if c.fault == "ball" else race)
            parts.append((part, part * c.fs_hz / (machine.bearing.fault_order(c.fault) * c.speed_rpm / 60)))
        assert max(samples for _, samples in parts) >= 2
        assert 0.004 < max(part for part, _ in parts) < 0.45


def test_gains_over_speed_are_drawn_where_a_fault_or_noise_that_feels_them_is_met_at_several_speeds():
    rng, drawn = np.random.default_rng(12), 0
    for _ in range(400):
        machine = draw_machine(rng, own_simulator=False, most_records=10)
        values = SpeedGain.draw(machine, rng)
        if values is None:
            continue
        drawn += 1
        spans = {}
        for kind in {c.fault for c in machine.conditions}:
            speeds = [c.speed_rpm for c in machine.conditions if c.fault == kind]
            spans[kind] = max(speeds) / min(speeds)
        heard = [span for kind, span in spans.items() if kind != "healthy" or values["on_noise"] > 0.2]
        assert max(heard) > 1.12
        assert abs(values["exponent"]) >= 0.15
    assert drawn > 120
