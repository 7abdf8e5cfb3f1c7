"""Simulators: the same chances whatever the effects; a user's records brought to the real conditions."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.data import cut, load, where
from twingap.effects import catalogue, make_effect
from twingap.effects.on_waveform import apply_to_waveform
from twingap.errors import TwingapError
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.features.comparison import feature_names
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate, healthy_rms
from twingap.records import Condition, Record, RecordSet
from twingap.streams import Streams
from twingap.twins.callable_twin import register_callable
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec, build_twin, read_twin

BEARING = BEARINGS["6205"]
CONDITIONS = [
    Condition(f"r{i}", 1500 + 300 * (i // 3), 10_000.0, 5000, ("healthy", "inner", "outer")[i % 3]) for i in range(6)
]


def sim(conditions: list[Condition] = CONDITIONS, seed: int = 0, unit: str = "m/s^2") -> RecordSet:
    return build_twin(TwinSpec("phenomenological"), BEARING, unit).simulate(conditions, np.random.default_rng(seed))


# --------------------------------------------------------------------------------------------------------------- twins


def test_effects_leave_all_other_chances_alone() -> None:
    own = TwinSimulator(TwinSpec("phenomenological"), BEARING)
    before = own.simulate((), CONDITIONS, 7, 0)
    after = own.simulate((make_effect("mains_interference", {"level": 0.5}),), CONDITIONS, 7, 0)
    for a, b in zip(before, after, strict=True):
        added = b.samples - a.samples
        assert added.std() > 0.1
        # Nothing but tones at the mains' multiples was added.
        spectrum = np.abs(np.fft.rfft(added)) ** 2
        hum = np.arange(50, 301, 50) // 2
        assert spectrum[hum].sum() > 0.999 * spectrum.sum()


def test_a_record_depends_on_its_name_alone() -> None:
    own = TwinSimulator(TwinSpec("phenomenological", ("slip_jitter",)), BEARING)
    whole = own.simulate((), CONDITIONS, 3, 1)
    part = own.simulate((), CONDITIONS[4:], 3, 1)
    np.testing.assert_array_equal(whole[4].samples, part[0].samples)
    other = own.simulate((), CONDITIONS, 3, 2)
    assert not np.array_equal(whole[4].samples, other[4].samples)


def test_an_effect_is_not_added_twice() -> None:
    own = TwinSimulator(TwinSpec("phenomenological", ("load_zone",)), BEARING)
    assert own.has == ("load_zone",)
    assert own.can_add("load_zone") == "the twin already has it"
    a = own.simulate((), CONDITIONS, 1, 0)
    b = own.simulate((make_effect("load_zone", {"depth": 1.0}),), CONDITIONS, 1, 0)
    np.testing.assert_array_equal(a[1].samples, b[1].samples)


def test_the_plain_twin_takes_every_effect_and_the_contact_twin_says_which_it_does_not() -> None:
    plain = TwinSimulator(TwinSpec("phenomenological"), BEARING, conditions=CONDITIONS)
    assert {name: plain.can_add(name) for name in catalogue()} == dict.fromkeys(catalogue())
    contact = TwinSimulator(TwinSpec("contact"), BEARING, conditions=CONDITIONS)
    assert "own physics" in str(contact.can_add("entry_exit"))
    assert "unknown effect" in str(plain.can_add("nothing_of_the_kind"))


# ------------------------------------------------------------------------------------------------ own simulated records


def test_own_records_come_back_to_the_byte() -> None:
    made = sim()
    real = sim(seed=1)
    own = ExternalSimulator(made, real, BEARING, 1.0)
    assert own.gain == 1.0
    for record, given in zip(own.simulate((), real.conditions, 5, 0), made, strict=True):
        assert record.samples.tobytes() == given.samples.tobytes()


def test_own_records_are_left_as_they_are_by_effects() -> None:
    made = sim()
    before = [r.samples.copy() for r in made]
    own = ExternalSimulator(made, sim(seed=1), BEARING, 1.0)
    noisy = own.simulate((make_effect("mains_interference"),), CONDITIONS, 5, 0)
    assert not np.array_equal(noisy[0].samples, before[0])
    for record, kept in zip(made, before, strict=True):
        np.testing.assert_array_equal(record.samples, kept)


def test_effects_on_impacts_leave_the_simulators_noise_where_healthy_records_tell_it() -> None:
    grown = make_effect("damage_growth", {"rate_per_s": 2e-3})
    timed = [replace(c, time_s=1000.0) for c in CONDITIONS]
    made = sim(timed, 2)
    faulty = made.select(lambda c: c.fault != "healthy")

    def power_between(own: ExternalSimulator, replicate: int = 0) -> list[float]:
        """Of a fifth of the short stretches, the quietest, with the effect over without it; by record of a defect."""
        out = []
        for condition in timed:
            if condition.fault == "healthy":
                continue
            (before,), (after,) = (own.simulate(e, [condition], 5, replicate) for e in ((), (grown,)))
            stretches = [np.quantile((r.samples.reshape(-1, 20) ** 2).mean(axis=1), 0.2) for r in (before, after)]
            out.append(float(stretches[1] / stretches[0]))
        return out

    gain = math.exp(2 * 2.0)
    whole = power_between(ExternalSimulator(faulty, sim(timed, 1), BEARING, 1.0))
    assert whole == pytest.approx([gain] * 4)
    own = ExternalSimulator(made, sim(timed, 1), BEARING, 1.0)
    apart = power_between(own)
    assert max(apart) < 0.6 * gain, "impacts ring on into the quietest fifth"
    # The same again, at another level too: what is kept is of the records as they were brought.
    assert power_between(own) == apart
    assert power_between(own.with_gain(3 * own.gain)) == pytest.approx(apart, rel=1e-3)
    # Healthy records have no impacts.
    healthy = [c for c in timed if c.fault == "healthy"]
    for a, b in zip(own.simulate((), healthy, 5, 0), own.simulate((grown,), healthy, 5, 0), strict=True):
        np.testing.assert_array_equal(a.samples, b.samples)


def test_disturbances_go_by_the_simulators_own_vibration() -> None:
    """A machine with a strong disturbance vibrates more: that is no yardstick of the disturbance."""
    hum = make_effect("mains_interference", {"level": 1.5, "decay": 0.2})
    made, units = sim(), 2.5
    loud = [
        apply_to_waveform((hum,), r, BEARING, healthy_rms(sim(seed=1)), Streams(4, i))
        for i, r in enumerate(sim(seed=1))
    ]
    real = RecordSet.from_records("real", "", BEARING, (Record(r.condition, units * r.samples) for r in loud))
    own = ExternalSimulator(made, real, BEARING, healthy_rms(real)).with_gain(units)
    tone = [
        b.samples - a.samples
        for a, b in zip(own.simulate((), CONDITIONS, 5, 0), own.simulate((hum,), CONDITIONS, 5, 0), strict=True)
    ]
    added = float(np.mean([x.std() for x in tone]))
    there = units * float(np.mean([(a.samples - b.samples).std() for a, b in zip(loud, sim(seed=1), strict=True)]))
    assert added == pytest.approx(there, rel=0.05)


def test_without_a_healthy_simulated_record_the_real_ones_are_the_yardstick() -> None:
    faulty = [c for c in CONDITIONS if c.fault != "healthy"]
    own = ExternalSimulator(sim(faulty), sim(seed=1), BEARING, 0.8)
    assert own.reference_rms == pytest.approx(0.8)
    assert own.with_gain(3 * own.gain).reference_rms == pytest.approx(2.4)


def test_another_unit_is_calibrated_away() -> None:
    made = sim()
    in_g = RecordSet.from_records("g", "g", BEARING, [Record(r.condition, r.samples / 9.80665) for r in sim(seed=1)])
    own = ExternalSimulator(made, in_g, BEARING, 0.1)
    assert own.gain == pytest.approx(1 / 9.80665, rel=0.05)
    assert any("multiplied" in note for note in own.notes)


def test_louder_healthy_records_alone_set_no_gain() -> None:
    """A sensitivity scales all records; a healthy machine may be louder one day than another."""
    louder = RecordSet.from_records(
        "louder", "m/s^2", BEARING,
        [Record(r.condition, r.samples * (1.3 if r.condition.fault == "healthy" else 1.0)) for r in sim()],
    )  # fmt: skip
    assert ExternalSimulator(louder, sim(seed=1), BEARING, 1.0).gain == 1.0
    every = RecordSet.from_records("every", "m/s^2", BEARING, [Record(r.condition, 1.3 * r.samples) for r in sim()])
    assert ExternalSimulator(every, sim(seed=1), BEARING, 1.0).gain == pytest.approx(1 / 1.3, rel=0.05)


def test_of_simulated_records_at_several_rates_those_that_reach_the_real_one_are_taken() -> None:
    slow = [replace(c, name=f"slow {c.name}", fs_hz=8_000.0, n_samples=4000) for c in CONDITIONS]
    fast = [replace(c, name=f"fast {c.name}") for c in CONDITIONS]
    both = RecordSet.from_records("both", "m/s^2", BEARING, [*sim(slow), *sim(fast)])
    own = ExternalSimulator(both, sim(seed=1), BEARING, 1.0)
    assert {r.condition.fs_hz for r in own.simulate((), CONDITIONS, 5, 0)} == {10_000.0}
    with pytest.raises(TwingapError, match="is sampled at 8000 Hz"):
        ExternalSimulator(sim(slow), sim(seed=1), BEARING, 1.0)


def test_short_simulated_records_are_repeated_and_that_is_said() -> None:
    short = [replace(c, n_samples=500) for c in CONDITIONS]
    own = ExternalSimulator(sim(short), sim(seed=1), BEARING, 1.0)
    assert any("repeated to their length" in note for note in own.notes)
    assert not any("repeated" in note for note in ExternalSimulator(sim(), sim(seed=1), BEARING, 1.0).notes)


def test_a_record_of_nearly_the_real_speed_is_left_alone() -> None:
    wanted = Condition("x", 1560.0, 10_000.0, 10_000, "inner")
    own = ExternalSimulator(sim([Condition("m", 1500.0, 10_000.0, 10_000, "inner")], 1), sim([wanted], 2), BEARING, 1.0)
    own.gain = 1.0
    (record,) = own.simulate((), [wanted], 0, 0)
    assert record.condition == replace(wanted, speed_rpm=1500.0)
    np.testing.assert_array_equal(record.samples, own.sim[0].samples)
    assert any("3.9 % slower" in note for note in own.notes)
    same = ExternalSimulator(sim([replace(wanted, name="m")], 1), sim([wanted], 2), BEARING, 1.0)
    assert not any("turn" in note for note in same.notes)


def test_a_simulated_record_is_brought_to_the_real_speed() -> None:
    made = sim([Condition("s", 1500.0, 10_000.0, 20_000, "inner"), Condition("h", 1500.0, 10_000.0, 20_000, "healthy")])
    turns = np.arange(20_000) / 10_000 * 25
    tone = RecordSet.from_records(
        "tones", "m/s^2", BEARING, [Record(made.conditions[0], np.sin(2 * np.pi * 4 * turns)), made[1]]
    )
    wanted = Condition("x", 1680.0, 10_000.0, 10_000, "inner")
    real = sim([wanted], 2)
    own = ExternalSimulator(tone, real, BEARING, 1.0)
    own.gain = 1.0
    (record,) = own.simulate((), [wanted], 0, 0)
    spectrum = np.abs(np.fft.rfft(record.samples * np.hanning(10_000)))
    assert np.argmax(spectrum) == 112  # order 4 of 28 Hz, bins of 1 Hz
    assert any("shaft angle" in note for note in own.notes)


def test_a_higher_rate_is_brought_down_and_a_lower_one_refused() -> None:
    fast = [replace(c, fs_hz=20_000.0, n_samples=10_000) for c in CONDITIONS]
    own = ExternalSimulator(sim(fast), sim(seed=1), BEARING, 1.0)
    assert {r.samples.size for r in own.simulate((), CONDITIONS, 0, 0)} == {5000}
    slow = [replace(c, fs_hz=8000.0, n_samples=4000) for c in CONDITIONS]
    with pytest.raises(TwingapError, match="sampled at 8000 Hz"):
        ExternalSimulator(sim(slow), sim(seed=1), BEARING, 1.0)


def test_replicates_are_other_records_as_far_as_there_are_any() -> None:
    """Beyond them the same come again as they are: cut or turned, they would be no other chance."""
    conditions = [replace(CONDITIONS[1], name=f"s{i}") for i in range(2)]
    made = sim(conditions)
    real = sim([replace(CONDITIONS[1], name="x")], 3)
    own = ExternalSimulator(made, real, BEARING, 1.0)
    own.gain = 1.0
    assert own.replicates(real.conditions) == 2
    first, second, third = (own.simulate((), real.conditions, 0, k)[0].samples for k in range(3))
    np.testing.assert_array_equal(first, made[0].samples)
    np.testing.assert_array_equal(second, made[1].samples)
    np.testing.assert_array_equal(third, made[0].samples)


def test_records_that_nothing_is_calibrated_by_get_simulated_ones_of_their_own() -> None:
    made = sim([replace(CONDITIONS[1], name=f"s{i}") for i in range(4)])
    real = sim([replace(CONDITIONS[1], name=f"x{i}") for i in range(4)], 3)
    own = ExternalSimulator(made, real.take([0, 1]), BEARING, 1.0, others=real.conditions[2:])
    for replicate in range(3):
        got = own.simulate((), real.conditions, 0, replicate)
        assert len({r.samples.tobytes() for r in got}) == 4
    assert own.replicates(real.conditions) == 1


def test_a_simulator_of_the_machine_itself_is_at_no_distance_from_it() -> None:
    """Every record at a speed of its own, so that each simulated one stands for one real one and for no other."""
    speeds = np.linspace(1200, 1800, 18)
    conditions = [
        Condition(f"r{i}", float(s), 10_000.0, 5000, ("healthy", "inner", "outer")[i % 3]) for i, s in enumerate(speeds)
    ]
    found = []
    for seed in range(0, 24, 2):
        real, made = sim(conditions, seed), sim([replace(c, name=f"s{c.name}") for c in conditions], seed + 1)
        calibrated = calibrate(real, None, np.random.default_rng(seed), sim=made)
        own = Evidence(calibrated, simulator_of(calibrated, made), TwinSpec("phenomenological"), seed)
        features = dict(zip(feature_names(), own.against().held_out, strict=True))
        # Signed roots of squares that are zero on average.
        found.append([np.sign(v) * v**2 for v in (features[f"distance|{kind}"] for kind in ("frequency", "order"))])
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / math.sqrt(len(found))
    assert np.all(np.abs(mean) < 4 * error + 0.05)


def test_like_records_get_different_simulated_ones() -> None:
    made = sim([replace(CONDITIONS[1], name=f"s{i}") for i in range(3)])
    real = sim([replace(CONDITIONS[1], name=f"x{i}") for i in range(3)], 3)
    own = ExternalSimulator(made, real, BEARING, 1.0)
    got = own.simulate((), real.conditions, 0, 0)
    assert len({r.samples.tobytes() for r in got}) == 3


def test_what_a_waveform_cannot_take_is_said() -> None:
    own = ExternalSimulator(sim(), sim(seed=1), BEARING, 1.0)
    assert "finished waveform" in str(own.can_add("mean_slip"))
    assert own.can_add("distributed_roughness") is None, "its impacts show its path"
    quiet = ExternalSimulator(sim([CONDITIONS[0]]), sim([CONDITIONS[0]], 1), BEARING, 1.0)
    assert "no path" in str(quiet.can_add("distributed_roughness"))
    assert own.can_add("speed_fluctuation") is None
    assert own.can_add("clipping") is None


FAINT = {"impact_amplitude": {"inner": 2.5, "outer": 2.5}}
"""Impacts that raise the spectrum of a record but do not stand out one by one."""


def added_roughness(own: Any, conditions: list[Condition]) -> np.ndarray:
    """Density, in 256 bands, of what roughness adds to the healthy record."""
    rough = make_effect("distributed_roughness", {"level": 1.0})
    before, after = (own.simulate(chain, conditions, 7, 0)[0].samples for chain in ((), (rough,)))
    return np.asarray(np.abs(np.fft.rfft((after - before)[:20480])[1:] ** 2).reshape(256, -1).mean(axis=1))


def test_roughness_passes_the_path_of_a_simulator_whose_impacts_do_not_stand_out() -> None:
    conditions = [replace(c, name=f"{c.name}{k}", n_samples=20480) for c in CONDITIONS for k in range(4)]
    twin = build_twin(TwinSpec("phenomenological", parameters=FAINT), BEARING, "")
    made, real = (twin.simulate(conditions, np.random.default_rng(seed)) for seed in (0, 1))
    own = ExternalSimulator(made, real, BEARING, 1.0)
    assert own._response(10_000.0) is None
    assert own.can_add("distributed_roughness") is None
    density = added_roughness(own, conditions)
    resonance = round(256 * twin.parameters.resonance_hz / 5000)
    assert np.abs(np.argmax(density) - resonance) <= 12
    assert density[resonance] > 20 * np.median(density)


def test_roughness_passes_the_path_of_a_function_whose_impacts_do_not_stand_out() -> None:
    ringing = np.exp(-np.arange(80) / 15) * np.sin(2 * np.pi * 0.2 * np.arange(80))

    def faint(conditions: Any, rng: Any) -> list[np.ndarray]:
        made = [rng.standard_normal(c.n_samples) for c in conditions]
        for x, c in zip(made, conditions, strict=True):
            if c.fault != "healthy":
                x += np.convolve(rng.standard_normal(x.size) * (rng.random(x.size) < 0.1), ringing)[: x.size]
        return made

    register_callable("faint impacts", faint)
    conditions = [replace(c, n_samples=20480) for c in CONDITIONS]
    density = added_roughness(TwinSimulator(TwinSpec("faint impacts"), BEARING, "", conditions), conditions)
    resonance = round(256 * 0.2 / 0.5)
    assert np.abs(np.argmax(density) - resonance) <= 12
    assert density[resonance] > 10 * np.median(density)


def test_faults_that_nobody_simulated() -> None:
    healthy = sim([CONDITIONS[0]])
    own = ExternalSimulator(healthy, sim(seed=1), BEARING, 1.0)
    assert own.missing == {"inner", "outer"}
    with pytest.raises(TwingapError, match="no simulated record of fault 'inner'"):
        own.simulate((), CONDITIONS, 0, 0)
    with pytest.raises(TwingapError, match="no record of inner"):
        ExternalSimulator(healthy, sim([CONDITIONS[1]], 1), BEARING, 1.0)
    with pytest.raises(TwingapError, match="fault is unknown"):
        own.simulate((), [replace(CONDITIONS[0], fault=None)], 0, 0)


def test_simulated_records_are_ranked_by_fault_speed_load_and_time() -> None:
    """Against the distance written out, pair by pair; unknown loads and times count for nothing."""
    rng = np.random.default_rng(9)

    def some(n: int, prefix: str) -> list[Record]:
        out = []
        for i in range(n):
            load, time_s = float(rng.choice([100, 250])), float(rng.integers(0, 40))
            speed_rpm, fault = float(rng.choice([1000, 1500, 1504, 2000])), str(rng.choice(["outer", "inner"]))
            condition = Condition(
                f"{prefix}{i}", speed_rpm, 12000, 64, fault,
                load_n=load if rng.random() < 0.7 else None, time_s=time_s if rng.random() < 0.7 else None,
            )  # fmt: skip
            out.append(Record(condition, rng.standard_normal(64)))
        return out

    made, real = (RecordSet.from_records(name, "g", BEARING, some(30, name)) for name in ("made", "real"))
    own = ExternalSimulator(made, real, BEARING, 1.0)
    times = [c.time_s for c in made.conditions if c.time_s is not None]

    def apart(a: Condition, b: Condition) -> float:
        distance = (a.fault != b.fault) * 1e6 + abs(math.log2(a.speed_rpm / b.speed_rpm))
        if a.load_n and b.load_n:
            distance += 0.3 * abs(math.log2(a.load_n / b.load_n))
        if a.time_s is not None and b.time_s is not None:
            distance += abs(a.time_s - b.time_s) / (max(times) - min(times))
        return distance

    for condition in real.conditions:
        wanted = [apart(c, condition) for c in made.conditions]
        np.testing.assert_allclose(own._simulated_conditions.distances(condition), wanted, rtol=1e-12)
        order = sorted((d, i) for i, d in enumerate(wanted))
        assert own._ranked(condition) == [i for d, i in order if d <= order[0][0] + 0.01]


def test_records_of_the_same_bearing_are_matched_before_those_of_the_same_speed() -> None:
    def of(name: str, speed_rpm: float, unit: str) -> Record:
        condition = Condition(name, speed_rpm, 12000, 64, "outer", extra={"bearing_id": unit} if unit else {})
        return Record(condition, np.random.default_rng(0).standard_normal(64))

    made = RecordSet.from_records("made", "g", BEARING, [of("a", 1500, "A"), of("b", 1550, "B"), of("c", 1900, "B")])
    real = RecordSet.from_records("real", "g", BEARING, [of("b1", 1500, "B"), of("x", 1500, "X"), of("none", 1900, "")])
    own = ExternalSimulator(made, real, BEARING, 1.0)
    assert [own._ranked(c)[0] for c in real.conditions] == [1, 0, 2]


# ------------------------------------------------------------------------------------------------------------ functions


def tones(conditions: list[Condition], rng: np.random.Generator) -> list[np.ndarray]:
    return [0.01 * rng.standard_normal(c.n_samples) + np.sin(np.arange(c.n_samples)) for c in conditions]


def test_a_function_is_a_twin(tmp_path: Path) -> None:
    register_callable("my tones", tones, has=["mains_interference"])
    path = tmp_path / "TWIN.toml"
    path.write_text('[twin]\nmodel = "my tones"\neffects = ["clipping"]\n[parameters.clipping]\nrail = 0.5\n')
    spec = read_twin(path)
    own = TwinSimulator(spec, BEARING, conditions=CONDITIONS)
    made = own.simulate((), CONDITIONS, 0, 0)
    assert max(np.abs(r.samples).max() for r in made) == 0.5
    assert "own physics" in str(own.can_add("mains_interference"))
    assert "finished waveform" in str(own.can_add("mean_slip"))
    again = TwinSimulator(spec, BEARING).simulate((), CONDITIONS[3:], 0, 0)
    np.testing.assert_array_equal(again[0].samples, made[3].samples)


def test_effects_act_on_a_functions_output_as_on_any_waveform() -> None:
    from twingap.effects import apply_to_waveform
    from twingap.twins.simulator import streams_of

    register_callable("tones", tones)
    own = TwinSimulator(TwinSpec("tones"), BEARING)
    chain = tuple(
        make_effect(n)
        for n in ("speed_fluctuation", "slip_jitter", "entry_exit", "load_zone", "sensor_rolloff", "quantisation")
    )
    (got,) = own.simulate(chain, CONDITIONS[1:2], 4, 0)
    (plain,) = own.simulate((), CONDITIONS[1:2], 4, 0)
    wanted = apply_to_waveform(chain, plain, BEARING, 1.0, streams_of(CONDITIONS[1], 4, 0))
    np.testing.assert_allclose(got.samples, wanted.samples, atol=1e-12)


def test_a_functions_level_is_calibrated() -> None:
    register_callable("tones", tones)
    real = sim(seed=1)
    spec = calibrate(real, TwinSpec("tones"), np.random.default_rng(0)).spec
    assert spec is not None
    made = TwinSimulator(spec, BEARING).simulate((), CONDITIONS[:1], 0, 0)
    assert made[0].samples.std() == pytest.approx(real[0].samples.std(), rel=0.2)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda conditions, rng: [np.zeros(3)], "samples of shape"),
        (lambda conditions, rng: [np.full(c.n_samples, np.nan) for c in conditions], "finite"),
        (lambda conditions, rng: [np.zeros(c.n_samples) for c in conditions], "all equal"),
        (lambda conditions, rng: [1j * rng.standard_normal(c.n_samples) for c in conditions], "no array of numbers"),
        (lambda conditions, rng: 1 / 0, r"record 'r0': the function failed in .*, line \d+: ZeroDivision"),
        (lambda conditions, rng: None, "no array of numbers"),
        (lambda conditions, rng: ["text"], "no array of numbers"),
    ],
)
def test_a_function_that_gives_something_else_is_told(function: object, message: str) -> None:
    register_callable("broken", function)  # type: ignore[arg-type]
    with pytest.raises(TwingapError, match=message):
        TwinSimulator(TwinSpec("broken"), BEARING).simulate((), CONDITIONS, 0, 0)


def test_names_that_are_taken_and_what_is_no_function_are_refused() -> None:
    with pytest.raises(TwingapError, match="is a built-in model"):
        register_callable("contact", tones)
    with pytest.raises(TwingapError, match="function expected"):
        register_callable("x", 3)  # type: ignore[arg-type]
    with pytest.raises(TwingapError, match="unknown effect"):
        register_callable("x", tones, has=["nothing"])


# ----------------------------------------------------------------------------------------------------- real recordings


@pytest.mark.data
def test_one_half_of_real_recordings_simulates_the_other() -> None:
    root = os.environ.get("TWINGAP_DATA")
    if not root or not Path(root, "cwru").is_dir():
        pytest.skip("no CWRU recordings")
    records = where(load("cwru", root), ["load_hp=2"])
    pieces = cut(records, duration_s=1.0)
    odd = pieces.take([i for i in range(len(pieces)) if i % 2])
    even = pieces.take([i for i in range(len(pieces)) if i % 2 == 0][:40])
    found = calibrate(even, None, np.random.default_rng(0), sim=odd)
    own = ExternalSimulator(odd, found.fit, found.frame.bearing, found.frame.scale)
    assert own.gain == 1.0
    real = [*found.fit, *found.held_out]  # defects of one fault differ in size: one part may have the small ones
    conditions = [record.condition for record in real]
    made = own.simulate((), conditions, 1, 0)
    for record, condition in zip(made, conditions, strict=True):
        # Near speeds are kept: 1750 rpm as stated beside 1745 as found.
        assert record.condition.speed_rpm == pytest.approx(condition.speed_rpm, rel=0.06)
        assert replace(record.condition, speed_rpm=condition.speed_rpm) == condition
    for fault in {c.fault for c in conditions}:
        powers = [[r.samples.var() for r in side if r.condition.fault == fault] for side in (made, real)]
        assert np.log(np.mean(powers[0]) / np.mean(powers[1])) == pytest.approx(0, abs=1.5)
