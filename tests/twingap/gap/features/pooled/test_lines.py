"""Lines that only the mean of many records shows."""

from dataclasses import replace

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.features.pooled import lines
from twingap.gap.features.tones.whitened_spectra import Mean, whiten
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalTwin

RATES = {"6205": 12000.0, "UER204": 25600.0, "ZA-2115": 20000.0}


def whitened(name, effects=(), count=12, faults=("healthy", "outer", "inner"), seed=0):
    fs_hz, bearing = RATES[name], BEARINGS[name]
    speeds = np.linspace(1400.0, 2100.0, count)
    conditions = [
        Condition(f"r{i}", float(speeds[i]), fs_hz, int(fs_hz), faults[i % len(faults)]) for i in range(count)
    ]
    frame = Frame(bearing, (2500.0, 4500.0), 1.0)
    records = PhenomenologicalTwin(bearing, None, effects).simulate(conditions, np.random.default_rng(seed))
    return [whiten(RecordTransforms(r.samples, r.condition, frame)) for r in records]


def measured(name, *effects, **options):
    return lines.measure(whitened(name, effects, **options), BEARINGS[name])


@pytest.mark.parametrize("name", RATES)
def test_mains_too_weak_for_one_record_stands_in_the_mean_and_in_hz_only(name):
    hum = make_effect("mains_interference", {"level": 0.03, "mains_hz": 50.0, "n_harmonics": 1})
    with_it, without = measured(name, hum), measured(name)
    assert with_it["mains_50_1"] > 1.8 > without["mains_50_1"] + 0.4
    assert with_it["mains_50_max"] >= with_it["mains_50_1"]
    assert with_it["order_1"] < 1.6


@pytest.mark.parametrize("name", RATES)
def test_what_turns_with_the_shaft_adds_up_in_orders(name):
    gear = make_effect("gear_mesh", {"level": 0.06, "teeth": 29, "depth": 1.0, "n_harmonics": 1})
    found = measured(name, gear)
    assert np.exp(found["gear_teeth"]) == pytest.approx(29)
    assert found["gear"] > measured(name)["gear"]


@pytest.mark.parametrize(("name", "order"), [("6205", 4.3), ("UER204", 3.6), ("ZA-2115", 4.61)])
def test_the_orders_of_another_bearing_are_found(name, order):
    other = make_effect("foreign_bearing", {"level": 4.0, "order": order, "resonance_hz": 3000.0})
    found = measured(name, other)
    assert np.exp(found["foreign_order"]) == pytest.approx(order, rel=0.005)


def test_nothing_looks_like_nothing_however_many_records():
    for count in (6, 24):
        z = [measured("6205", count=count, seed=seed) for seed in range(3)]
        for name in ("mains_50_all", "half_all", "order_high", "mains_60_all"):
            assert abs(np.mean([found[name] for found in z])) < 0.8


def of_noise(count, seed, *tones):
    """White noise of one second, with a tone (Hz, amplitude, in so many of the records) or none."""
    rng, t = np.random.default_rng(seed), np.arange(12000) / 12000
    kept = []
    for i in range(count):
        x = rng.standard_normal(12000)
        x += sum(level * np.sin(2 * np.pi * hz * t) for hz, level, records in tones if i < records)
        condition = Condition(f"r{i}", 1130.0 + 31 * i, 12000.0, 12000, "healthy")
        kept.append(whiten(RecordTransforms(x, condition, Frame(BEARINGS["6205"], (2500.0, 4500.0), 1.0))))
    return kept


@pytest.mark.parametrize("count", [1, 2, 4, 12, 30])
def test_z_of_noise_is_a_normal_deviate_whatever_the_number_of_records(count):
    kept = of_noise(count, seed=count)
    for mean in (Mean.in_hz(kept), Mean.in_orders(kept)):
        z = mean.z[np.isfinite(mean.z)]
        assert abs(z.mean()) < 0.12 and z.std() == pytest.approx(1, abs=0.12)
        # One place in a thousand of normal deviates lies beyond 3.1; of one record's power alone it would be 5.7.
        assert np.quantile(z, 0.999) < 4.2


def test_an_even_hum_is_a_hum_whose_first_harmonic_is_not_there():
    found = lines.measure(of_noise(12, 3, (240.0, 0.05, 12)), BEARINGS["6205"])
    assert found["mains_60_max"] > 2 > found["mains_60_1"] + 0.5


def test_a_carrier_too_weak_for_one_record_is_found_by_the_lines_beside_it():
    drive = make_effect(
        "drive_interference", {"level": 0.05, "depth": 1.5, "carrier_hz": 2711.0, "sideband_order": 4.0}
    )
    found = measured("UER204", drive, faults=("healthy",))
    assert np.exp(found["carrier_fs"]) * RATES["UER204"] == pytest.approx(2711, abs=3)
    assert found["carrier_side_order"] == pytest.approx(4, abs=0.03)
    assert found["carrier"] > measured("UER204", faults=("healthy",))["carrier"] + 0.3


def test_one_record_with_a_strong_line_is_no_line_of_all():
    """As loud as a hundred times the noise in one of twelve records says less than a little in each of them."""
    (in_all,) = Mean.in_hz(of_noise(12, 5, (3001.0, 0.05, 12))).at(np.array([3001.0]))
    (in_one,) = Mean.in_hz(of_noise(12, 5, (3001.0, 1.0, 1))).at(np.array([3001.0]))
    assert in_one < 4 < 5 < in_all


def test_no_record_says_nothing():
    assert all(np.isnan(value) for value in lines.measure([], BEARINGS["6205"]).values())


def test_a_short_record_takes_no_line_from_the_longer_ones():
    """Bins of a tenth of a second are ten times as wide: on their axis nine of ten lines fall between two places."""
    rng, bearing = np.random.default_rng(7), BEARINGS["6205"]
    frame = Frame(bearing, (2500.0, 4500.0), 1.0)

    def of(count, samples, start=0):
        t = np.arange(samples) / 12000.0
        signals = rng.standard_normal((count, samples)) + 0.08 * np.sin(2 * np.pi * 3005 * t)
        conditions = [Condition(f"r{start + i}", 1130.0 + 31 * i, 12000.0, samples, "healthy") for i in range(count)]
        return [whiten(RecordTransforms(x, c, frame)) for x, c in zip(signals, conditions, strict=True)]

    long = of(12, 12000)
    alone, beside = (lines.measure(kept, bearing) for kept in (long, [*long, *of(1, 1200, 12)]))
    assert beside["fixed"] == pytest.approx(alone["fixed"], abs=0.15)
    assert 12000 * np.exp(beside["fixed_fs"]) == pytest.approx(3005, abs=1.5)


def test_a_line_of_long_records_is_found_whatever_its_order():
    """Three hundred turns resolve a third of a step of the axis that records of a second need."""
    bearing, samples = BEARINGS["6205"], 120000
    frame, rng = Frame(bearing, (2500.0, 4500.0), 1.0), np.random.default_rng(9)
    t = np.arange(samples) / 12000.0
    found = []
    for order in (7.2, 7.205, 7.215):
        kept = []
        for i in range(3):
            x = rng.standard_normal(samples) + 0.03 * np.sin(2 * np.pi * order * (28.0 + i) * t)
            condition = Condition(f"r{i}", 60 * (28.0 + i), 12000.0, samples, "healthy")
            kept.append(whiten(RecordTransforms(x, condition, frame)))
        z = Mean.in_orders(kept)
        found.append(float(np.nanmax(z.at(order + np.linspace(-0.002, 0.002, 9)))))
    assert min(found) > 4.5
    assert min(found) > 0.7 * max(found)


def shaped(count, seed, kinds=("healthy",), hz=None, only="", low_hz=0.0, rpm=1130.0, step=31.0, level=0.08):
    """Noise through a sharp mode at `low_hz`, with a tone at `hz` in the records of one kind or of all."""
    rng, t, bearing = np.random.default_rng(seed), np.arange(12000) / 12000, BEARINGS["6205"]
    f = np.fft.rfftfreq(12000, 1 / 12000)
    kept = []
    for i in range(count):
        kind, x = kinds[i % len(kinds)], rng.standard_normal(12000)
        if low_hz:
            gain = 1 + 2.0 / np.abs(1 - (f / low_hz) ** 2 + 0.012j * f / low_hz) * 0.05
            x = np.fft.irfft(np.fft.rfft(x) * gain, 12000)
        if hz is not None and only in ("", kind):
            x += level * np.sin(2 * np.pi * hz * t + rng.random())
        condition = Condition(f"r{i}", rpm + step * i, 12000.0, 12000, kind)
        kept.append(whiten(RecordTransforms(x, condition, Frame(bearing, (2500.0, 4500.0), 1.0))))
    return lines.measure(kept, bearing)


def test_a_carrier_is_there_whatever_the_state_of_the_bearing():
    """What stands beside the harmonics of impacts is in records of one kind; a carrier is in all of them."""
    kinds = ("healthy", "outer", "inner")
    in_all, in_one, in_none = (shaped(18, 3, kinds, *what) for what in ((3003.0,), (3003.0, "outer"), ()))
    assert 12000 * np.exp(in_all["fixed_fs"]) == pytest.approx(3003, abs=2)
    assert in_all["fixed"] > in_one["fixed"] + 0.8
    assert in_one["fixed"] < in_none["fixed"] + 0.3


def test_a_sharp_mode_is_no_line():
    plain, mode = (shaped(18, 5, low_hz=hz) for hz in (0.0, 800.0))
    line = shaped(18, 5, hz=1703.0, low_hz=800.0)
    assert mode["fixed"] < plain["fixed"] + 0.2
    assert line["fixed"] > mode["fixed"] + 0.5
    assert 12000 * np.exp(line["fixed_fs"]) == pytest.approx(1703, abs=2)


def test_a_whole_order_of_a_shaft_at_one_speed_is_no_carrier():
    at_one_speed = {"rpm": 1200.0, "step": 0.0}
    turning, carrier = (shaped(12, 7, hz=hz, **at_one_speed) for hz in (3000.0, 3010.0))
    assert turning["fixed"] < 1.9 < carrier["fixed"]
    assert 12000 * np.exp(shaped(12, 7, hz=3000.0)["fixed_fs"]) == pytest.approx(3000, abs=2)


def test_a_line_at_a_multiple_of_the_mains_is_a_carrier_where_there_is_no_hum():
    found = shaped(18, 9, hz=1050.0)
    assert 12000 * np.exp(found["fixed_fs"]) == pytest.approx(1050, abs=2)


def with_wrong_speeds(effect, seed=0, off=0.01, count=16, faults=("healthy", "outer")):
    """Records whose stated speeds are off by so much, each by another part of it; what carries a comb is put right."""
    bearing, rng = BEARINGS["6205"], np.random.default_rng(seed)
    speeds = np.linspace(1400.0, 2100.0, count)
    conditions = [Condition(f"r{i}", float(v), 12000.0, 12000, faults[i % len(faults)]) for i, v in enumerate(speeds)]
    records = PhenomenologicalTwin(bearing, None, (effect,) if effect else ()).simulate(conditions, rng)
    frame, kept = Frame(bearing, (2500.0, 4500.0), 1.0), []
    for record in records:
        true = record.condition
        wrong = true.speed_rpm * (1 + off * rng.uniform(-1, 1))
        stated = replace(true, speed_rpm=wrong if true.fault == "healthy" else true.speed_rpm)
        kept.append(whiten(RecordTransforms(record.samples, stated, frame)))
    return lines.measure(kept, bearing)


def test_teeth_are_counted_though_healthy_speeds_are_wrong_by_a_per_cent():
    """At the thirty-seventh order a per cent is a third of an order: ten bins of a second."""
    gear = make_effect("gear_mesh", {"level": 0.3, "teeth": 37, "depth": 1.0, "n_harmonics": 2})
    found, none = with_wrong_speeds(gear, faults=("healthy",)), with_wrong_speeds(None, faults=("healthy",))
    assert np.exp(found["gear_free_teeth"]) == pytest.approx(37)
    assert found["gear_free"] > max(none["gear_free"], found["gear"], found["gear_free_rival"]) + 0.4
    assert found["gear_free_sides"] > none["gear_free_sides"] + 0.5


def test_a_tone_between_whole_orders_is_no_mesh():
    mesh = make_effect("gear_mesh", {"level": 0.2, "teeth": 31, "depth": 0.8, "n_harmonics": 1})
    on, off = (with_wrong_speeds(effect, off=0.0) for effect in (mesh, make_effect("waviness", {"level": 0.2})))
    assert on["gear_integer_lead"] > off["gear_integer_lead"] + 0.5


@pytest.mark.parametrize("race", ["outer", "inner"])
def test_waves_of_a_race_are_told_from_those_of_the_other_at_wrong_speeds(race):
    waves = make_effect("waviness", {"level": 0.15, "decay": 0.7, "n_harmonics": 3, "inner": race == "inner"})
    found, none = (with_wrong_speeds(effect, off=0.02, faults=("healthy",)) for effect in (waves, None))
    other = {"outer": "inner", "inner": "outer"}[race]
    assert found[f"wave_{race}"] > max(found[f"wave_{other}"], none[f"wave_{race}"]) + 1
    assert np.expm1(found[f"wave_{race}_share"]) > 0.8 > 0.4 > np.expm1(none[f"wave_{race}_share"])
    assert found["wave_max"] == found[f"wave_{race}"]


def test_a_defect_of_a_race_says_nothing_of_its_waves():
    found = with_wrong_speeds(None, faults=("outer",))
    assert np.isnan(found["wave_outer"]) and np.isfinite(found["wave_inner"])


def test_lines_beside_a_carrier_lie_at_any_distance():
    drive = make_effect(
        "drive_interference", {"level": 0.1, "depth": 1.5, "carrier_hz": 2711.0, "sideband_order": 4.37}
    )
    found = measured("UER204", drive, faults=("healthy",))
    assert found["carrier_side_order"] == pytest.approx(4.37, abs=0.03)
    assert found["carrier_sides"] > measured("UER204", faults=("healthy",))["carrier_sides"] + 0.7
    assert found["fixed_others"] < found["fixed"] - 0.5


def test_a_tone_is_as_strong_in_each_record_and_a_mode_of_one_bin_is_not():
    """Noise through a resonator as narrow as a bin stands as high in the mean as a tone does."""
    rng, t, kept = np.random.default_rng(4), np.arange(12000) / 12000, {"tone": [], "mode": []}
    for i in range(16):
        noise = rng.standard_normal(12000)
        narrow = rng.standard_normal(2) @ np.array([np.cos(2 * np.pi * 3003 * t), np.sin(2 * np.pi * 3003 * t)])
        tone = np.sqrt(2) * np.sin(2 * np.pi * 3003 * t + 6.28 * rng.random())
        condition = Condition(f"r{i}", 1130.0 + 31 * i, 12000.0, 12000, "healthy")
        for name, line in (("tone", tone), ("mode", narrow)):
            transforms = RecordTransforms(
                noise + 0.15 * line, condition, Frame(BEARINGS["6205"], (2500.0, 4500.0), 1.0)
            )
            kept[name].append(whiten(transforms))
    tone, mode = (lines.measure(kept[name], BEARINGS["6205"]) for name in ("tone", "mode"))
    for found in (tone, mode):
        assert 12000 * np.exp(found["fixed_fs"]) == pytest.approx(3003, abs=1)
    assert tone["fixed_steady"] < 0.3 < 0.5 < mode["fixed_steady"]
