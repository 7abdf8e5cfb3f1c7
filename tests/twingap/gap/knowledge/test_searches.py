"""Whole searches on machines not learnt from."""

from dataclasses import replace

import numpy as np
import pytest

from twingap.effects import trainable
from twingap.gap.knowledge.detectability import learn_detectability
from twingap.gap.knowledge.searches import searches
from twingap.gap.knowledge.simulated_gaps import draw_gap
from twingap.gap.search.parameter_scale import coordinates

AMONG, MACHINES = ("mains_interference", "clipping", "quantisation"), (1_000_001, 1_000_002)


@pytest.fixture(scope="module")
def gaps():
    return [draw_gap(np.random.default_rng([0, machine]), most_records=8, among=AMONG) for machine in MACHINES]


@pytest.fixture(scope="module")
def found(learnt, few_trials):
    """Ends of the searches on both machines, one machine after the other."""
    return searches(learnt, 0, MACHINES, 8, AMONG)


def test_every_effect_of_every_machine_has_an_end_and_a_truth(learnt, gaps, found):
    assert len(found) == sum(len(trainable()) - len(gap.modelled) for gap in gaps)
    assert sum(missing for _, missing in found) == sum(len(gap.missing) for gap in gaps)
    # What was never learnt can hardly be likely, and is not named.
    assert sum(outcome.named for outcome, _ in found) <= 3 * len(MACHINES)
    for outcome, _ in found:
        assert 0 < outcome.p_value <= 1
        assert 0 < outcome.rest_p <= 1
        assert np.isfinite(outcome.features()).all()
    # Again, and the same.
    assert searches(learnt, 0, MACHINES[:1], 8, AMONG) == found[: len(trainable()) - len(gaps[0].modelled)]


def test_effects_that_nobody_could_have_seen_teach_nothing(learnt, gaps, found):
    """Where a machine's mains is found on none alike, its end says neither that it was there nor that it was not."""
    assert learnt.detectability is None
    one = found[len(trainable()) - len(gaps[0].modelled) :]
    names = coordinates()
    rng = np.random.default_rng(0)
    shape = (200, len(learnt.effects))
    missing = np.zeros(shape, bool)
    missing[:, learnt.effects.index("mains_interference")] = True
    said = {"mains_interference": np.full(200, -5.0)}
    features = np.zeros((200, len(learnt.features)))
    blind, hidden = learn_detectability(
        said, missing, rng.standard_normal((200, len(names))), features, learnt.effects, names, learnt.features
    )
    assert hidden.sum() == 200
    other = searches(replace(learnt, detectability=blind), 0, MACHINES[1:], 8, AMONG)
    hums = sum(effect.name == "mains_interference" for effect in gaps[1].missing)
    assert hums == 1
    assert len(one) - len(other) == hums
    assert sum(there for _, there in one) - sum(there for _, there in other) == hums
