"""Fault orders, levels above the quietest, simulated fleets, and the trees that learn from them."""

from dataclasses import replace

import numpy as np
import pytest

from twingap.adapt.fleets import Fleets
from twingap.adapt.levels import NAMES, band_levels, levels_above_the_quietest, operating_points
from twingap.adapt.order_features import flattened, line_orders, names, order_features
from twingap.adapt.order_forest import Examples, examples, train_forest
from twingap.adapt.population import CLASSES, Population, stated
from twingap.adapt.windows import Windows, cut
from twingap.bearing import BEARINGS
from twingap.effects import SlipJitter
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

BEARING = BEARINGS["6205"]
FS_HZ, SPEED_RPM, LENGTH = 12000.0, 1800.0, 4096
CONDITIONS = tuple(Condition(f"r{i}", SPEED_RPM, FS_HZ, 2 * LENGTH, "healthy") for i in range(3))


def windows_of(fault: str, amplitude: float = 20.0, speed_rpm: float = SPEED_RPM) -> Windows:
    parameters = PhenomenologicalParameters(3000.0, 0.05, dict.fromkeys(CLASSES[1:], amplitude))
    condition = Condition(fault, speed_rpm, FS_HZ, 2 * LENGTH, fault)
    # Without jitter whitening, which evens out lines and noise alike, would take the impacts with it.
    twin = PhenomenologicalTwin(BEARING, parameters, [SlipJitter(0.01)])
    made = twin.simulate([condition], np.random.default_rng(1))
    return cut(made, LENGTH, 2, CLASSES)


def noise(levels: list[float], groups: list[str], speeds: list[float] | None = None) -> Windows:
    rng = np.random.default_rng(0)
    x = np.array(levels)[:, None] * rng.standard_normal((len(levels), LENGTH))
    speed = np.full(len(levels), SPEED_RPM) if speeds is None else np.array(speeds)
    return Windows(x, np.full(len(levels), FS_HZ), speed, np.array(groups))


def fleets(members: int = 4, model: str = "phenomenological") -> Fleets:
    spec = TwinSpec(model)
    return Fleets(Population(spec, BEARING, "", CONDITIONS, stated(spec), 2 * 1024), members)


# -- fault orders -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", CLASSES[1:])
@pytest.mark.parametrize("spectrum", ["unfiltered", "whitened", "flattened", "impulsive"])
def test_the_line_of_a_fault_stands_out_at_its_own_place(fault: str, spectrum: str) -> None:
    found = dict(zip(names(BEARING), order_features(windows_of(fault), BEARING).mean(axis=0), strict=True))
    own = {f: found[f"{spectrum}: {f} 1"] for f in CLASSES[1:]}
    assert max(own, key=lambda f: own[f]) == fault
    assert own[fault] > max(v for f, v in own.items() if f != fault) + 1.0
    highest = order_features(windows_of(fault), BEARING)[:, names(BEARING).index(f"{spectrum}: order of the highest")]
    multiple = highest / BEARING.fault_order(fault)
    np.testing.assert_allclose(multiple, np.round(multiple), atol=0.05)


def test_neither_amplitude_nor_labels_nor_speed_change_what_is_read() -> None:
    made = windows_of("outer")
    read = order_features(made, BEARING)
    np.testing.assert_allclose(order_features(replace(made, samples=7.0 * made.samples), BEARING), read, atol=1e-6)
    np.testing.assert_array_equal(order_features(made.unlabelled(), BEARING), read)
    # The same turns of the shaft at another speed, sampled in step: the same orders.
    faster = replace(made, speed_rpm=2 * made.speed_rpm, fs_hz=2 * made.fs_hz)
    np.testing.assert_allclose(order_features(faster, BEARING), read, atol=1e-6)


def test_windows_of_several_speeds_are_read_each_at_its_own() -> None:
    slow, fast = windows_of("inner"), windows_of("inner", speed_rpm=2400.0)
    both = Windows(
        np.concatenate([fast.samples, slow.samples]), np.concatenate([fast.fs_hz, slow.fs_hz]),
        np.concatenate([fast.speed_rpm, slow.speed_rpm]), np.concatenate([fast.group, slow.group]),
    )  # fmt: skip
    apart = np.concatenate([order_features(fast, BEARING), order_features(slow, BEARING)])
    np.testing.assert_allclose(order_features(both, BEARING), apart, atol=1e-9)


def test_short_windows_are_read_as_far_as_they_go() -> None:
    made = windows_of("outer")
    short = order_features(replace(made, samples=made.samples[:, :512]), BEARING)
    assert np.isfinite(short).all() and short.shape[1] == len(names(BEARING))


def test_names_and_places_are_those_of_the_bearing() -> None:
    found = line_orders(BEARING)
    assert found["outer 2"] == pytest.approx(2 * BEARING.bpfo) and found["inner + shaft"] == pytest.approx(
        BEARING.bpfi + 1
    )
    assert len(names(BEARING)) == order_features(windows_of("ball"), BEARING).shape[1] == len(set(names(BEARING)))


def test_lines_are_where_published_fault_orders_put_them() -> None:
    """Orders of the 6205 as the owner of the CWRU records states them: 5.4152, 3.5848, 4.7135, 0.39828."""
    outer, inner, ball, cage = 3.5848, 5.4152, 4.7135, 0.39828
    wanted = {
        "shaft 1": 1, "shaft 2": 2, "shaft 3": 3, "cage 1": cage, "cage 2": 2 * cage,
        "outer 1": outer, "outer 2": 2 * outer, "outer 3": 3 * outer,
        "inner 1": inner, "inner 2": 2 * inner, "inner 3": 3 * inner,
        "ball 1": ball, "ball 2": 2 * ball, "ball 3": 3 * ball,
        "inner - shaft": 4.4152, "inner + shaft": 6.4152, "twice inner - shaft": 9.8304, "twice inner + shaft": 11.8304,
        "outer - shaft": 2.5848, "outer + shaft": 4.5848, "ball - cage": 4.3152, "ball + cage": 5.1118,
        "outer - cage": 3.1865, "outer + cage": 3.9831, "inner - cage": 5.0169, "inner + cage": 5.8135,
    }  # fmt: skip
    assert line_orders(BEARING) == pytest.approx(wanted, rel=2e-4)


def test_flattening_takes_a_resonance_and_leaves_a_line() -> None:
    rng, line, n = np.random.default_rng(0), 683, np.arange(8192)
    coloured = np.convolve(rng.standard_normal(8192), np.exp(-np.arange(200) / 40) * np.cos(np.arange(200)), "same")
    flat = np.abs(np.fft.rfft(flattened((coloured + 40 * np.sin(2 * np.pi * line * n / 8192))[None])[0])) ** 2
    power = flat / np.median(flat)
    assert power[line - 1 : line + 2].max() > 100
    parts = np.log([power[k * 400 + 20 : k * 400 + 380].mean() for k in range(10) if k != line // 400])
    assert np.ptp(parts) < 0.7, "the noise is white to a factor of two; before, to one of hundreds"


# -- levels -----------------------------------------------------------------------------------------------------------


def test_levels_are_nepers_above_the_quietest_recording() -> None:
    made = noise([1.0, 1.0, 3.0, 3.0], ["a", "a", "b", "b"])
    found = dict(zip(NAMES, levels_above_the_quietest(made).T, strict=True))
    for name in ("mean", "band 8", "all", "mean over the quietest"):
        np.testing.assert_allclose(found[name], [0, 0, 2 * np.log(3), 2 * np.log(3)], atol=0.3)
    louder = levels_above_the_quietest(replace(made, samples=100 * made.samples))
    np.testing.assert_allclose(louder, levels_above_the_quietest(made), atol=1e-6)


def test_machines_at_another_speed_are_not_compared() -> None:
    made = noise([1.0, 3.0, 3.0], ["a", "b", "c"], [1000.0, 1500.0, 1510.0])
    assert list(operating_points(made.speed_rpm)) == [0, 1, 1]
    mean = levels_above_the_quietest(made)[:, NAMES.index("mean")]
    np.testing.assert_allclose(mean, 0, atol=0.3)
    assert list(operating_points(np.array([1510.0, 1000.0, 1500.0]))) == [1, 0, 1]


def test_speeds_that_jump_by_three_per_cent_are_two_operating_points() -> None:
    assert list(operating_points(np.array([1500.0, 1544.0]))) == [0, 0]  # 2.9 %
    assert list(operating_points(np.array([1500.0, 1546.0]))) == [0, 1]  # 3.1 %
    assert list(operating_points(np.array([1580.0, 1500.0, 1540.0]))) == [0, 0, 0], "no jump between neighbours"


def test_a_recording_alone_is_its_own_quietest_and_a_tone_is_no_noise() -> None:
    assert np.abs(levels_above_the_quietest(noise([5.0, 5.0], ["a", "a"]))).max() < 0.8
    made = noise([1.0], ["a"])
    tone = replace(made, samples=made.samples + 10 * np.sin(2 * np.pi * 1200 * np.arange(LENGTH) / FS_HZ))
    change = (band_levels(tone) - band_levels(made))[0]
    assert np.abs(change[:-1]).max() < 0.8 < 3 < change[-1]


# -- fleets and trees -------------------------------------------------------------------------------------------------


def test_a_fleet_is_at_one_operating_point_and_the_same_for_one_seed() -> None:
    one, two = (fleets(6).fleet(3, np.random.default_rng(4)) for _ in range(2))
    assert len(one) == len(set(one.groups)) == 6 and {c.fault for c in one.conditions} <= set(CLASSES)
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(one, two, strict=True))
    assert all(abs(c.speed_rpm / SPEED_RPM - 1) < 0.01 for c in one.conditions)


def test_shares_of_healthy_members_are_all_that_can_be() -> None:
    rng = np.random.default_rng(0)
    made = fleets(8)
    shares = [np.mean([c.fault == "healthy" for c in made.fleet(i, rng).conditions]) for i in range(40)]
    assert min(shares) == 0 and max(shares) == 1 and 0.2 < np.mean(shares) < 0.5


def test_the_contact_twin_has_fleets_too() -> None:
    found = fleets(3, "contact").fleet(0, np.random.default_rng(1))
    assert len(found) == 3 and all(np.isfinite(r.samples).all() for r in found)


def test_what_a_fleet_cannot_be() -> None:
    with pytest.raises(TwingapError, match="members = 0"):
        fleets(0)
    with pytest.raises(TwingapError, match="begin with 'healthy'"):
        replace(fleets(), classes=("inner", "healthy"))


def test_trees_tell_plain_faults_of_a_machine_they_have_never_seen() -> None:
    made = fleets(6)
    shown = examples(made, 25, 1024, 2, np.random.default_rng(0))
    assert shown.features.shape == (300, len(names(BEARING)) + len(NAMES)) and len(shown) == 300
    forest = train_forest(shown, BEARING, 4, 0)
    for fault in ("inner", "outer"):
        predicted = forest.probabilities(windows_of(fault))
        np.testing.assert_allclose(predicted.sum(axis=1), 1)
        assert (predicted.argmax(axis=1) == CLASSES.index(fault)).all()
    again = train_forest(shown, BEARING, 4, 0)
    np.testing.assert_array_equal(again.of_features(shown.features), forest.of_features(shown.features))


def test_a_class_that_no_fleet_showed_has_probability_zero() -> None:
    rng = np.random.default_rng(0)
    seen = Examples(rng.standard_normal((20, 3)), np.repeat([0, 2], 10), 2)
    predicted = train_forest(seen, BEARING, 4, 0).of_features(rng.standard_normal((5, 3)))
    assert predicted.shape == (5, 4) and (predicted[:, [1, 3]] == 0).all()
