"""Calibration: parameters recovered, parts that share nothing, and what cannot be decided said."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification.baseline import match_baseline, mode_density
from twingap.identification.calibrate import calibrate, prepare, recalibrate, split_parts
from twingap.identification.impact_band import mode_band
from twingap.records import Condition, Record, RecordSet
from twingap.twins.twin_file import TwinSpec, build_twin, flat

TRUTH: dict[str, Any] = {
    "resonance_hz": 2400.0,
    "damping_ratio": 0.06,
    "scale": 0.3,
    "structure_noise_rms": 0.7,
    "white_noise_rms": math.sqrt(1 - 0.49),
    "impact_amplitude": {"inner": 7.0, "outer": 9.0, "ball": 6.0},
}
PLAIN = TwinSpec("phenomenological")


def machine(
    effects: Sequence[str] = (),
    faults: Sequence[str | None] = ("healthy", "inner", "outer", "ball"),
    n: int = 24,
    fs_hz: float = 12_000.0,
    factor: float = 1.0,
    seed: int = 0,
    **parameters: Any,
) -> RecordSet:
    rng = np.random.default_rng(seed)
    twin = build_twin(TwinSpec("phenomenological", tuple(effects), parameters=TRUTH | parameters), BEARINGS["6205"])
    conditions = [
        Condition(f"r{i}", 1200 + 150 * (i // len(faults)), fs_hz, int(fs_hz), faults[i % len(faults)])
        for i in range(n)
    ]
    made = twin.simulate(conditions, rng)
    wrong = [replace(r, condition=replace(r.condition, speed_rpm=r.condition.speed_rpm / factor)) for r in made]
    return RecordSet.from_records("machine", "m/s^2", BEARINGS["6205"], wrong)


def values(spec: TwinSpec | None) -> dict[str, float]:
    assert spec is not None
    return flat(spec.parameters)


def near(found: dict[str, float], rel: float) -> None:
    truth = flat(TRUTH)
    for name in ("resonance_hz", "scale", "structure_noise_rms", "white_noise_rms"):
        assert found[name] == pytest.approx(truth[name], rel=rel), name
    assert found["damping_ratio"] == pytest.approx(truth["damping_ratio"], rel=3 * rel)
    for fault in ("inner", "outer", "ball"):
        name = f"impact_amplitude.{fault}"
        assert found[name] == pytest.approx(truth[name], rel=2 * rel), name


def test_parameters_and_speeds_are_recovered() -> None:
    records = machine(factor=1.025)
    found = calibrate(records, PLAIN, np.random.default_rng(0))
    near(values(found.spec), 0.04)
    assert found.frame.scale == pytest.approx(0.3, rel=0.03)
    assert found.frame.band_hz[0] < 2400 < found.frame.band_hz[1]
    assert found.speeds.common_ratio == pytest.approx(1.025, rel=3e-4)
    whole = {c.name: c.speed_rpm for part in (found.fit, found.held_out) for c in part.conditions}
    for condition in records.conditions:
        assert whole[condition.name] == pytest.approx(1.025 * condition.speed_rpm, rel=3e-4)


def test_the_parts_share_no_group_and_each_has_every_fault_and_slow_and_fast() -> None:
    found = calibrate(machine(), PLAIN, np.random.default_rng(1))
    assert found.fit.common_groups(found.held_out) == ()
    assert len(found.fit) == 8 and len(found.held_out) == 16
    for part in (found.fit, found.held_out):
        for fault in ("healthy", "inner", "outer", "ball"):
            speeds = [c.speed_rpm for c in part.conditions if c.fault == fault]
            assert max(speeds) - min(speeds) > 100


def test_same_seed_same_calibration() -> None:
    records = machine(n=8)
    one, other = (calibrate(records, PLAIN, np.random.default_rng(3)) for _ in range(2))
    assert values(one.spec) == values(other.spec)
    assert one.fit.conditions == other.fit.conditions
    assert one.frame == other.frame


def test_what_the_file_fixes_stays() -> None:
    given = TwinSpec("phenomenological", parameters={"resonance_hz": 2450.0, "impact_amplitude": {"inner": 3.0}})
    found = values(calibrate(machine(n=8), given, np.random.default_rng(0)).spec)
    assert found["resonance_hz"] == 2450.0
    assert found["impact_amplitude.inner"] == 3.0
    assert found["impact_amplitude.outer"] == pytest.approx(9.0, rel=0.15)


@pytest.mark.parametrize(
    ("effects", "parameters"),
    [
        (["coloured_noise"], {}),
        (["sensor_rolloff"], {"sensor_rolloff": {"corner_hz": 2500.0}}),
        (["slip_jitter"], {"slip_jitter": {"sigma": 0.05}}),
        (["entry_exit", "shaft_harmonics"], {}),
    ],
)
def test_the_baseline_is_found_again_under_further_effects(effects: list[str], parameters: dict[str, Any]) -> None:
    found = calibrate(machine(effects, **parameters), PLAIN, np.random.default_rng(0))
    assert found.spec is not None
    more = replace(found.spec, effects=tuple(effects), parameters={**found.spec.parameters, **parameters})
    again = recalibrate(found, more, np.random.default_rng(1))
    near(values(again.spec), 0.06)


@pytest.mark.parametrize(
    ("effect", "values_of_it"),
    [
        ("coloured_noise", {"level": 2.0, "slope": 1.0, "low_hz": 30.0, "high_hz": 1500.0}),
        ("second_resonance", {"frequency_hz": 900.0, "damping_ratio": 0.02, "gain": 0.6}),
        ("impulsive_noise", {"level": 30.0, "rate_hz": 12.0, "resonance_hz": 700.0, "damping_ratio": 0.03}),
    ],
)
def test_the_mode_is_not_taken_for_what_a_modelled_effect_makes(effect: str, values_of_it: dict[str, Any]) -> None:
    """The hump that stands out of healthy spectra is the effect's; impacts are weighed where they ring."""
    own = {"resonance_hz": 4700.0, "damping_ratio": 0.02, "structure_noise_rms": 0.3, "white_noise_rms": 0.95}
    records = machine([effect], **own, **{effect: values_of_it})
    found = values(calibrate(records, TwinSpec("phenomenological", (effect,), parameters={effect: values_of_it}),
                             np.random.default_rng(0)).spec)  # fmt: skip
    assert found["resonance_hz"] == pytest.approx(4700.0, rel=0.04)
    assert found["scale"] == pytest.approx(0.3 * math.hypot(0.3, 0.95), rel=0.1)
    for fault, amplitude in TRUTH["impact_amplitude"].items():
        strength = found[f"impact_amplitude.{fault}"] * found["scale"]
        assert strength == pytest.approx(0.3 * amplitude, rel=0.25)


def test_an_effect_that_is_idle_at_one_speed_is_not_at_others() -> None:
    gain = {"exponent": -2.0, "reference_speed_rpm": 1800.0, "on_noise": 1.0}
    records = machine(["speed_gain"], speed_gain=gain)
    spec = TwinSpec("phenomenological", ("speed_gain",), parameters={"speed_gain": gain})
    found = values(calibrate(records, spec, np.random.default_rng(0)).spec)
    assert found["scale"] == pytest.approx(TRUTH["scale"], rel=0.1)


def test_recalibration_without_effects_moves_nothing_much() -> None:
    found = calibrate(machine(), PLAIN, np.random.default_rng(0))
    assert found.spec is not None
    before, after = values(found.spec), values(recalibrate(found, found.spec, np.random.default_rng(1)).spec)
    for name in before:
        assert after[name] == pytest.approx(before[name], rel=0.12), name


def test_matching_keeps_what_is_fixed() -> None:
    found = calibrate(machine(["coloured_noise"]), PLAIN, np.random.default_rng(0))
    assert found.spec is not None
    free = TwinSpec("phenomenological", parameters={"damping_ratio": 0.1, "impact_amplitude": {"ball": 2.0}})
    given = replace(found.spec, effects=("coloured_noise",))
    given = replace(given, parameters={**given.parameters, "damping_ratio": 0.1})
    again = values(match_baseline(given, found.fit, found.frame, np.random.default_rng(0), free=free))
    assert again["damping_ratio"] == 0.1
    assert again["impact_amplitude.ball"] == values(given)["impact_amplitude.ball"]


def test_the_modes_density_is_that_of_simulated_structure_noise() -> None:
    spec = {"resonance_hz": 2400.0, "damping_ratio": 0.06, "structure_noise_rms": 1.0, "white_noise_rms": 1e-6}
    twin = build_twin(TwinSpec("phenomenological", parameters=spec), BEARINGS["6205"])
    record = twin.simulate([Condition("x", 1500.0, 12_000.0, 480_000, "healthy")], np.random.default_rng(0))[0]
    power = np.abs(np.fft.rfft(record.samples)) ** 2 * 2 / (12_000 * 480_000)
    measured = power[1:].reshape(128, -1).mean(axis=1)
    np.testing.assert_allclose(mode_density(2400.0, 0.06, 12_000.0), measured, rtol=0.12)


@pytest.mark.parametrize(("f", "zeta"), [(150.0, 0.1), (3000.0, 0.02), (3000.0, 0.5), (5850.0, 0.05)])
def test_the_band_lies_within_the_spectrum_and_shows_impacts(f: float, zeta: float) -> None:
    conditions = [Condition("x", 1800.0, 12_000.0, 12_000, "inner")]
    low, high = mode_band(f, zeta, conditions, BEARINGS["6205"])
    assert 0 < low < high < 6000
    assert high - low > 6 * 162  # twice three harmonics of the impact rate
    assert low <= f <= high


# ----------------------------------------------------------------------------------------------------- poor metadata


def test_without_healthy_records() -> None:
    found = calibrate(machine(faults=("inner", "outer"), n=12), PLAIN, np.random.default_rng(0))
    assert values(found.spec)["resonance_hz"] == pytest.approx(2400.0, rel=0.08)
    assert any("no healthy record" in note for note in found.notes)
    assert found.frame.scale == pytest.approx(0.3, rel=0.5)


def test_healthy_only() -> None:
    found = calibrate(machine(faults=("healthy",), n=6), PLAIN, np.random.default_rng(0))
    assert values(found.spec)["scale"] == pytest.approx(0.3, rel=0.03)
    assert any("no record of fault 'inner'" in note for note in found.notes)


def test_some_unknown_faults_are_left_aside() -> None:
    records = machine(n=12)
    mixed = [replace(r, condition=replace(r.condition, fault=None)) if i < 3 else r for i, r in enumerate(records)]
    found = calibrate(RecordSet.from_records("m", "m/s^2", records.bearing, mixed), PLAIN, np.random.default_rng(0))
    assert found.aside == ("r0", "r1", "r2")
    assert not set(found.aside) & set(found.names)
    assert any("left out" in note for note in found.notes)


def test_no_labels_at_all_are_read_off_the_combs() -> None:
    records = machine(n=12)
    found = calibrate(records.without_labels(), PLAIN, np.random.default_rng(0))
    told = {c.name: c.fault for part in (found.fit, found.held_out) for c in part.conditions}
    assert told == {c.name: c.fault for c in records.conditions}
    assert any("strongest comb" in note for note in found.notes)


def test_no_labels_and_no_comb_is_healthy() -> None:
    found = calibrate(machine(faults=("healthy",), n=6).without_labels(), PLAIN, np.random.default_rng(0))
    assert {c.fault for c in found.fit.conditions} == {"healthy"}
    assert any("assumed healthy" in note for note in found.notes)


def test_two_records() -> None:
    found = calibrate(machine(faults=("healthy",), n=2), PLAIN, np.random.default_rng(0))
    assert len(found.fit) == len(found.held_out) == 1
    assert found.fit.common_groups(found.held_out) == ()
    both = calibrate(machine(faults=("healthy", "inner"), n=2), PLAIN, np.random.default_rng(0))
    assert sorted(both.shared) == ["r0", "r1"]
    assert any("both the part" in note for note in both.notes)


def test_one_group_stands_in_both_parts_and_is_flagged() -> None:
    records = machine(n=8)
    same = [replace(r, condition=replace(r.condition, group="one")) for r in records]
    found = calibrate(RecordSet.from_records("m", "m/s^2", records.bearing, same), PLAIN, np.random.default_rng(0))
    assert found.fit.conditions == found.held_out.conditions
    assert len(found.shared) == 8
    assert any("one group" in note for note in found.notes)


def test_a_lone_group_of_several_faults_goes_where_they_are_missing() -> None:
    x = np.arange(4.0)
    faults = [("a", "inner"), ("b", "inner"), ("c", "inner"), ("c", "outer"), ("d", "healthy"), ("e", "healthy")]
    records = RecordSet.from_records(
        "r", "", None, [Record(Condition(f"{i}", 1500.0, 1.0, 4, f, group=g), x) for i, (g, f) in enumerate(faults)]
    )
    for seed in range(8):
        fit, held_out, shared = split_parts(records, np.random.default_rng(seed), [])
        for part in (fit, held_out):
            assert {c.fault for c in part.conditions} == {"inner", "outer", "healthy"}
        assert set(fit.common_groups(held_out)) == {"c"}
        assert shared == ("2", "3")


def test_the_twins_bearing_stands_in() -> None:
    records = machine(n=8)
    bare = RecordSet.from_records("bare", "", None, list(records))
    with pytest.raises(TwingapError, match="bearing is not known"):
        calibrate(bare, PLAIN, np.random.default_rng(0))
    found = calibrate(bare, TwinSpec("phenomenological", bearing=BEARINGS["6205"]), np.random.default_rng(0))
    assert found.frame.bearing == found.fit.bearing == BEARINGS["6205"]
    near(values(found.spec), 0.06)


def test_without_a_twin_the_frame_is_read_off_the_records() -> None:
    records = machine(n=16)
    found = calibrate(records, None, np.random.default_rng(0), sim=machine(seed=1, n=16))
    assert found.spec is None
    low, high = found.frame.band_hz
    assert low < 2400 < high
    assert found.frame.scale == pytest.approx(0.3, rel=0.05)
    with pytest.raises(TwingapError, match="neither"):
        calibrate(records, None, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("samples", "message"),
    [(np.zeros(12_000), "equal"), (np.full(12_000, np.nan), "finite"), (np.arange(100.0), "256")],
)
def test_records_that_cannot_be_read_are_named(samples: np.ndarray[Any, Any], message: str) -> None:
    records = list(machine(n=4))
    bad = Record(Condition("bad", 1500.0, 12_000.0, samples.size, "healthy"), samples)
    with pytest.raises(TwingapError, match=message) as caught:
        calibrate(RecordSet.from_records("b", "", BEARINGS["6205"], [*records, bad]), PLAIN, np.random.default_rng(0))
    assert "'bad'" in str(caught.value)


@pytest.mark.parametrize("count", [3, 4])
def test_one_fault_is_fitted_at_two_speeds_where_groups_are_few(count: int) -> None:
    x, kinds = np.arange(4.0), ("healthy", "inner", "outer")
    records = RecordSet.from_records(
        "r", "", None,
        [
            Record(Condition(f"{k}{i}", 1000.0 + 200 * i, 1.0, 4, k, group=f"{k}{i}"), x)
            for k in kinds for i in range(count)
        ],
    )  # fmt: skip
    for seed in range(8):
        fit, held_out, _ = split_parts(records, np.random.default_rng(seed), [])
        speeds = {k: sorted(c.speed_rpm for c in fit.conditions if c.fault == k) for k in kinds}
        assert [len(speeds[k]) for k in kinds] == [1, 2, 1]
        assert speeds["inner"][1] - speeds["inner"][0] == 400.0
        assert {c.fault for c in held_out.conditions} == set(kinds)
        assert fit.common_groups(held_out) == ()


def test_records_of_a_fault_that_is_not_simulated_are_left_aside_and_simulated_ones_are_read_as_well() -> None:
    records, sim = machine(seed=1), machine(seed=2)
    faults = {c.fault for c in records.conditions}
    assert len(faults) > 2
    some = sim.select(lambda c: c.fault != "outer")
    calibrated = calibrate(records, None, np.random.default_rng(0), sim=some)
    assert {c.fault for c in calibrated.held_out.conditions} == faults - {"outer"}
    assert any("no simulated record of outer" in note for note in calibrated.notes)
    silent = RecordSet.from_records(
        "silent", sim.unit, sim.bearing, [Record(r.condition, 0.0 * r.samples) for r in sim]
    )
    with pytest.raises(TwingapError, match=r"simulated record .*all samples are equal"):
        calibrate(records, None, np.random.default_rng(0), sim=silent)


def test_a_stated_split_is_kept() -> None:
    records = machine(n=8)
    names = {"r0", "r1", "r2", "r3", "r6"}
    found = prepare(records, PLAIN, np.random.default_rng(0), fitted=lambda c: c.name in names)
    assert {c.name for c in found.fit.conditions} == names
    assert {c.name for c in found.held_out.conditions} == {"r4", "r5", "r7"}
    assert found.shared == ()


def test_a_stated_split_needs_records_on_both_sides_and_whole_groups() -> None:
    records = machine(n=8)
    for side in (True, False):
        with pytest.raises(TwingapError, match="one part without records"):
            prepare(records, PLAIN, np.random.default_rng(0), fitted=lambda c, side=side: side)  # type: ignore[misc]
    together = [replace(r, condition=replace(r.condition, group="one")) for r in records]
    grouped = RecordSet.from_records("grouped", "g", BEARINGS["6205"], together)
    with pytest.raises(TwingapError, match="one in both parts"):
        prepare(grouped, PLAIN, np.random.default_rng(0), fitted=lambda c: c.name == "r0")
