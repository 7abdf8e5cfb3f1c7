"""Sets of explanations that cannot be told apart."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.twingap.gap.search.test_optimise import evidence_of as evidence_on
from tests.twingap.gap.search.test_optimise import machine
from tests.twingap.identification.test_level import evidence_of, simulated
from twingap.effects import Effect, make_effect
from twingap.gap.knowledge import shipped
from twingap.gap.search import effect_search
from twingap.gap.search.effect_search import ALPHA, CAUTIOUS_ALPHA, confidence_set, level_of_gap, to_name
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.twins.twin_file import TwinSpec

PROBABILITIES = st.dictionaries(
    st.sampled_from(["clipping", "dropout", "looseness", "mean_slip", "waviness"]), st.floats(0, 1), max_size=5
)


def test_a_sure_effect_stands_alone():
    assert confidence_set({"clipping": 0.999, "dropout": 0.001}, 0.95) == (("clipping",),)


def test_nothing_is_an_explanation_too():
    assert confidence_set({"clipping": 0.001}, 0.95) == ((),)


def test_what_is_uncertain_stands_both_with_and_without():
    sets = confidence_set({"clipping": 0.999, "dropout": 0.6}, 0.9)
    assert sets == (("clipping", "dropout"), ("clipping",))


def test_a_simulator_of_the_users_own_has_to_differ_more_where_its_records_cannot_be_exchanged():
    records, rng = machine(), np.random.default_rng(1)
    few = evidence_of(records.select(lambda c: c.name[-1] in "01"), simulated(1.0, "m/s^2"))
    assert level_of_gap(few) == level_of_gap(few, 0.7) == CAUTIOUS_ALPHA < ALPHA
    assert level_of_gap(few, 0.95) == ALPHA
    own = evidence_of(records, simulated(1.0, "m/s^2"))
    assert level_of_gap(own) == ALPHA
    for effects in ((), ("impact_scatter",)):
        spec = TwinSpec("phenomenological", effects, None, {"impact_scatter": {"sigma": 0.3}} if effects else {})
        calibrated = calibrate(records, spec, rng)
        assert level_of_gap(Evidence(calibrated, simulator_of(calibrated, None), spec, 7)) == ALPHA


def test_what_a_search_let_go_is_named_when_it_is_as_likely_as_what_it_kept():
    probability = {"clipping": 0.76, "dropout": 0.65, "looseness": 0.75, "mean_slip": 0.74, "waviness": 0.1}
    assert to_name(probability, 0.75) == ["clipping", "looseness"]


def dropped(truth: Effect, *others: Effect, p: float = 0.8) -> dict[str, float]:
    """What is dropped on a machine with one effect, of which the search names others too, all with a probability."""
    evidence = evidence_on(machine(truth))
    search = effect_search._Search(evidence, shipped())
    search.values = {effect.name: effect_search.Estimated(effect, {}) for effect in (truth, *others)}
    search.now = evidence.against(search.added())
    out = search.drop_without_gain(dict.fromkeys(search.values, p), 0.525)
    assert set(search.values) == {truth.name, *(effect.name for effect in others)} - set(out)
    assert search.now.effects == search.added()
    return out


def test_an_effect_is_dropped_without_which_the_twin_is_as_close_unless_it_is_very_probable_or_lines_show_it() -> None:
    clipping, bursts = make_effect("clipping", {"rail": 3.0}), make_effect("impulsive_noise", {"level": 20.0})
    found = dropped(clipping, bursts)
    assert set(found) == {"impulsive_noise"} and 0.1 < found["impulsive_noise"] < 0.3
    assert dropped(clipping, bursts, p=0.96) == {}
    # Distances do not see these side lines, but they stand out in all records together.
    faint = {"level": 0.05, "depth": 1.5, "carrier_hz": 3100.0, "sideband_order": 2.0}
    assert dropped(make_effect("drive_interference", faint)) == {}


@given(PROBABILITIES, st.floats(0.5, 0.99))
def test_the_sets_reach_the_level_and_no_more(probability, level):
    sets = confidence_set(probability, level)
    assert len(set(map(frozenset, sets))) == len(sets)

    def weight(chosen):
        out = 1.0
        for name, p in probability.items():
            out *= p if name in chosen else 1 - p
        return out

    every = sorted(
        (weight(c) for r in range(len(probability) + 1) for c in itertools.combinations(probability, r)), reverse=True
    )
    # What is all but certain is not split: at most 1 % each is given away.
    assert sum(map(weight, sets)) >= level - 0.01 * len(probability) - 1e-9
    assert weight(sets[0]) >= every[0] - 0.01 * len(probability)


def test_an_interval_that_reaches_a_choice_holds_numbers() -> None:
    """A choice that the search found, true or false, is an end of its interval like any other value."""
    found = effect_search._Search.__new__(effect_search._Search)
    given = make_effect("slip_jitter", {"accumulating": False})
    found.values = {"slip_jitter": effect_search.Estimated(given, {"accumulating": (0.1, 0.4)})}
    found._store_values([make_effect("slip_jitter", {"accumulating": True})])
    ends = found.values["slip_jitter"].intervals["accumulating"]
    assert ends == (0.1, 1.0) and all(type(end) is float for end in ends)
