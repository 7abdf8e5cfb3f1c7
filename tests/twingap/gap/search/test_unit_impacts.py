"""Statistics of impacts of single bearings are those that their own records have."""

from __future__ import annotations

from tests.twingap.gap.search.test_free_spectra import evidence_of
from twingap.effects import make_effect
from twingap.effects.by_state import State, of_state
from twingap.gap.search.free_spectra import BACKGROUND, PATH, measured
from twingap.gap.search.unit_impacts import effects_on_impacts, unit_distance, with_impacts_by_unit
from twingap.records import Condition

CONDITIONS = [
    Condition(f"{fault}{unit}{i}", 1500.0 + 37.0 * i, 10000.0, 10000, fault, extra={"bearing_id": unit})
    for fault, unit in (("healthy", "none"), ("outer", "even"), ("outer", "scattered"))
    for i in range(6)
]


def test_one_bearing_of_two_scatters() -> None:
    """The other one's impacts are even: neither one value for both nor more impacts of its own are right for it."""
    own = {"sigma": 0.0, "outer": {"units": {"scattered": {"sigma": 0.9}}}}
    evidence = evidence_of(make_effect("impact_scatter", own), conditions=CONDITIONS)
    bare = evidence.against().simulator
    simulator, chain = measured(evidence, bare, (), (PATH, BACKGROUND), by="unit") or (bare, ())
    twin, found = with_impacts_by_unit(evidence, simulator, chain, ["impact_scatter", "load_zone"])
    (scatter,) = (effect for effect in found if effect.name == "impact_scatter")
    sigma = [of_state(scatter, State("outer", unit)).parameter_values()["sigma"] for unit in ("even", "scattered")]
    assert sigma[0] <= 0.2 and 0.4 <= sigma[1] <= 1.5
    assert evidence.misfit(twin, found) < 0.9 * evidence.misfit(simulator, chain)


def test_the_load_turns_with_the_shaft_of_one_bearing() -> None:
    """Its impacts on the outer race vary once a turn, those of the other bearing do not."""
    own = {"depth": 0.0, "outer": {"units": {"scattered": {"depth": 1.0, "rotating": True}}}}
    evidence = evidence_of(make_effect("load_zone", own), conditions=CONDITIONS)
    bare = evidence.against().simulator
    simulator, chain = measured(evidence, bare, (), (PATH, BACKGROUND), by="unit") or (bare, ())
    twin, found = with_impacts_by_unit(evidence, simulator, chain, ["load_zone"])
    (zone,) = (effect for effect in found if effect.name == "load_zone")
    even, turning = (of_state(zone, State("outer", unit)).parameter_values() for unit in ("even", "scattered"))
    assert turning["rotating"] and turning["depth"] > 0.3
    assert not even["rotating"] or even["depth"] < 0.3
    assert unit_distance(evidence, twin, found) < 0.9 * unit_distance(evidence, simulator, chain)


def test_bearings_that_are_alike_get_nothing() -> None:
    evidence = evidence_of(conditions=CONDITIONS)
    bare = evidence.against().simulator
    simulator, chain = measured(evidence, bare, (), (PATH, BACKGROUND), by="unit") or (bare, ())
    _, found = with_impacts_by_unit(evidence, simulator, chain, effects_on_impacts())
    added = [
        (effect.name, unit)
        for effect in found if not effect.measured for unit in ("even", "scattered")
        if of_state(effect, State("outer", unit)) != of_state(effect, State("outer")).weakened(0.0)
    ]  # fmt: skip
    assert len(added) <= 1, "by chance"
