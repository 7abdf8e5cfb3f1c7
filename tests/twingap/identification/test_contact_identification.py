"""Stiffness and damping of the contact twin, found again in its own records."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.signal import lfilter

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification import Identification, contact_bottom, identify
from twingap.identification.contact import identify_contact
from twingap.identification.contact_bottom import Bottom
from twingap.identification.contact_objective import SpectrumObjective, states_of
from twingap.identification.optimise import DEFAULT, Array, Objective, differential_evolution
from twingap.records import Condition, Record, RecordSet
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import ContactParameters
from twingap.twins.twin_file import STANDARD_GRAVITY, TwinSpec, flat, in_unit

TRUE = ContactParameters(stiffness=4e9, damping=800.0, scale=0.1)


def records(own: ContactParameters = TRUE, faults: tuple[str, ...] = ("healthy", "inner", "outer")) -> RecordSet:
    conditions = [Condition(f"{f}{i}", 1797.0, 12000.0, 6000, f) for f in faults for i in range(2)]
    return ContactTwin(BEARINGS["6205"], own, unit="g").simulate(conditions, np.random.default_rng(1))


def test_parameters_are_recovered() -> None:
    spec = TwinSpec("contact")
    found = identify(records(), spec).estimates
    assert found["stiffness"].value == pytest.approx(4e9, rel=0.05)
    assert found["damping"].value == pytest.approx(800.0, rel=0.15)
    assert found["scale"].value == pytest.approx(0.1, rel=0.1)
    assert found["structure_noise_rms"].value == pytest.approx(TRUE.structure_noise_rms, rel=0.15)
    assert found["white_noise_rms"].value == pytest.approx(TRUE.white_noise_rms, rel=0.15)
    for estimate in found.values():
        assert estimate.interval is not None and estimate.interval[0] < estimate.value < estimate.interval[1]


def machine(
    fault: str, seed: int, snr_db: float = 10.0, duration_s: float = 3.0
) -> tuple[ContactParameters, RecordSet]:
    """A contact machine drawn at random, without noise of its own, and one record of it in white noise."""
    rng = np.random.default_rng([seed, 5])
    stiffness, damping = np.exp(rng.uniform(*np.log([[1.5e9, 200.0], [2e10, 2000.0]])))
    own = ContactParameters(float(stiffness), float(damping), scale=0.1, structure_noise_rms=0.0, white_noise_rms=0.0)
    condition = Condition(fault, 1797.0, 12000.0, round(duration_s * 12000), fault)
    (quiet,) = ContactTwin(BEARINGS["6205"], own, unit="g").simulate([condition], rng)
    noise = rng.standard_normal(quiet.samples.size) * quiet.samples.std() * 10 ** (-10 / 20)
    return own, RecordSet.from_records("m", "g", BEARINGS["6205"], [Record(condition, quiet.samples + noise)])


@functools.cache
def identified(fault: str, optimiser: str, seed: int, duration_s: float) -> tuple[ContactParameters, Identification]:
    """A machine, and what is identified from its record."""
    own, measured = machine(fault, seed, duration_s=duration_s)
    return own, identify(measured, TwinSpec("contact"), seed=seed, optimiser=optimiser)


RECOVERED = (("inner", "zoa"), ("outer", "differential-evolution"), ("ball", "zoa-ports"))


@pytest.mark.parametrize(("fault", "optimiser"), RECOVERED)
def test_a_machine_in_noise_10_db_below_it_is_recovered_within_5_percent(fault: str, optimiser: str) -> None:
    own, found = identified(fault, optimiser, 1, 2.0)
    assert found.estimates["stiffness"].value == pytest.approx(own.stiffness, rel=0.05)
    assert found.estimates["damping"].value == pytest.approx(own.damping, rel=0.05)


@pytest.fixture
def few_trajectories(monkeypatch: pytest.MonkeyPatch) -> None:
    """For what does not depend on the scatter of damping."""
    monkeypatch.setattr(contact_bottom, "TRAJECTORIES", contact_bottom.SETS)


@pytest.mark.usefixtures("few_trajectories")
def test_the_same_seed_gives_the_same_numbers() -> None:
    measured = machine("outer", 2, duration_s=0.3)[1]
    found = [identify(measured, TwinSpec("contact"), seed=3, optimiser="zoa") for _ in range(2)]
    assert found[0].estimates == found[1].estimates
    assert all(estimate.interval for estimate in found[0].estimates.values())


@pytest.mark.usefixtures("few_trajectories")
def test_who_lacks_something_is_told_that_intervals_do_not_hold_it() -> None:
    """The same machine with a strong second mode: the twin of one mode still finds a minimum."""
    measured = machine("outer", 1, duration_s=1.0)[1]
    ringing = lfilter([1.0], [1.0, -1.9 * np.cos(0.6), 0.9025], measured[0].samples)
    other = RecordSet.from_records("m", "g", measured.bearing, [Record(measured[0].condition, ringing)])
    found = [identified("outer", "differential-evolution", 1, 2.0)[1], identify(other, TwinSpec("contact"))]
    assert [any("moves values beyond" in note for note in one.notes) for one in found] == [False, True]


@pytest.mark.usefixtures("few_trajectories")
def test_records_too_short_for_two_blocks_give_no_intervals() -> None:
    measured = machine("outer", 1, duration_s=0.1)[1]
    found = identify(measured, TwinSpec("contact"))
    assert all(estimate.interval is None for estimate in found.estimates.values())
    assert any("no intervals" in note for note in found.notes)


def test_what_no_optimiser_can_be_chosen_for() -> None:
    with pytest.raises(TwingapError, match="unknown optimiser 'annealing'"):
        identify(machine("outer", 1)[1], TwinSpec("contact"), optimiser="annealing")
    with pytest.raises(TwingapError, match="is for the contact twin"):
        identify(machine("outer", 1)[1], TwinSpec("phenomenological"), optimiser="zoa")


@pytest.mark.slow
def test_intervals_keep_their_level() -> None:
    """Fewer than five of six machines inside: a chance of 11 % for 90 % intervals, of 89 % for such as hold half."""
    made = [identified(fault, optimiser, 1, 2.0) for fault, optimiser in RECOVERED]
    made += [identified(fault, DEFAULT, 100, 1.0) for fault, _ in RECOVERED]
    for name in ("stiffness", "damping"):
        intervals = [(getattr(own, name), found.estimates[name].interval) for own, found in made]
        assert sum(held is not None and held[0] <= true <= held[1] for true, held in intervals) >= 5, name


def test_any_optimiser_will_do_and_only_sees_what_is_free() -> None:
    """Stiffness is fixed: one dimension is left, searched here by plain bisection of a grid."""
    tried: list[Array] = []

    def grid(objective: Objective, bounds: Array, rng: np.random.Generator, evaluations: int) -> Array:
        points = np.linspace(*bounds[0], 16)[:, None]
        tried.append(points)
        return points[int(np.argmin(objective(points)))]

    spec = TwinSpec("contact", parameters={"stiffness": 4e9, "scale": 0.1})
    found = identify_contact(
        spec, records(faults=("outer",)), np.random.default_rng(0),
        level=0.9, method="whittle", progress=lambda what, fraction: None, optimiser=grid,
    ).estimates  # fmt: skip
    assert tried[0].shape == (16, 1)
    step = tried[0][1, 0] - tried[0][0, 0]
    assert abs(np.log(found["damping"].value / 800.0)) <= step
    assert set(found) == {"damping", "structure_noise_rms", "white_noise_rms"}


def test_the_objective_is_least_at_the_truth_and_infinite_where_nothing_runs() -> None:
    twin = ContactTwin(BEARINGS["6205"], TRUE)
    states = states_of(records(), [])
    starts = np.random.default_rng(0).random((sum(len(s.conditions) for s in states), 3))
    objective = SpectrumObjective(twin, states, starts, {})
    at = np.log([TRUE.stiffness, TRUE.damping])
    away = np.array([[0, 0], [0.3, 0], [-0.3, 0], [0, 1.0], [0, -1.0], [np.log(9e13) - at[0], 0]])
    values = objective(at + away)
    assert values[0] == values[:5].min() and values[0] < 0.1
    assert np.isinf(values[5])


def test_differential_evolution_finds_a_valley_with_holes() -> None:
    def objective(points: Array) -> Array:
        values = np.sum((points - [1.0, -2.0]) ** 2, axis=1)
        return np.where(points[:, 0] > 3, np.inf, values)

    best = differential_evolution(objective, np.array([[-5.0, 5.0], [-5.0, 5.0]]), np.random.default_rng(0), 800)
    assert best == pytest.approx([1.0, -2.0], abs=0.1)


def test_healthy_records_alone_leave_scale_as_it_is() -> None:
    spec = TwinSpec("contact", parameters={"stiffness": 4e9, "damping": 800.0})
    found = identify(records(faults=("healthy",)), spec)
    assert any("scale keeps its value" in note for note in found.notes)
    # What it keeps leads from the twin's m/s^2 to the records' g, and is in the file, so that units can be converted.
    values = flat(found.spec.parameters)
    assert values["scale"] == pytest.approx(1 / STANDARD_GRAVITY) and "scale" not in found.spec.intervals
    assert flat(in_unit(found.spec, "m/s^2").parameters)["scale"] == pytest.approx(1.0)
    assert values["scale"] * values["structure_noise_rms"] == pytest.approx(0.1 * TRUE.structure_noise_rms, rel=0.2)
    given = TwinSpec("contact", parameters={**spec.parameters, "scale": 0.1})
    kept = identify(records(faults=("healthy",)), given)
    assert flat(kept.spec.parameters)["scale"] == 0.1 and not any("leads from" in note for note in kept.notes)


def test_where_contact_leaves_no_trace_noise_is_what_is_simulated() -> None:
    """A contact at its default level would drown it."""
    powers = np.array([0.0, 0.04, 0.01])
    found = Bottom(np.log([4e9, 800.0]), 0.6, powers, [], None).estimates(0.9)
    scale, structure, white = (found[n].value for n in ("scale", "structure_noise_rms", "white_noise_rms"))
    assert (scale * structure, scale * white) == pytest.approx((0.2, 0.1)) and scale < 1e-6
    own = ContactParameters(4e9, 800.0, scale=scale, structure_noise_rms=structure, white_noise_rms=white)
    condition = Condition("i", 1797.0, 12000.0, 24000, "inner")
    (made,) = ContactTwin(BEARINGS["6205"], own, unit="g").simulate([condition], np.random.default_rng(3))
    assert made.samples.std() == pytest.approx(np.sqrt(powers.sum()), rel=0.1)


def test_states_that_the_model_does_not_know() -> None:
    with pytest.raises(TwingapError, match="no record of a state that the contact model can simulate"):
        identify(records(faults=("healthy",)).without_labels(), TwinSpec("contact"))
    with pytest.raises(TwingapError, match="eq8"):
        identify(records(faults=("healthy",)), TwinSpec("contact"), method="eq8")
