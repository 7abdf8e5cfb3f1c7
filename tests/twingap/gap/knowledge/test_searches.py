"""Whole searches on machines not learnt from."""

from dataclasses import replace

import numpy as np

from twingap.effects import trainable
from twingap.gap.knowledge.detectability import learn_detectability
from twingap.gap.knowledge.searches import searches
from twingap.gap.knowledge.simulated_gaps import draw_gap
from twingap.gap.search.parameter_scale import coordinates


def test_every_effect_of_every_machine_has_an_end_and_a_truth(learnt):
    among, machines = ("mains_interference", "clipping", "quantisation"), (1_000_001, 1_000_002)
    found = searches(learnt, 0, machines, 8, among)
    gaps = [draw_gap(np.random.default_rng([0, machine]), most_records=8, among=among) for machine in machines]
    assert len(found) == sum(len(trainable()) - len(gap.modelled) for gap in gaps)
    assert sum(missing for _, missing in found) == sum(len(gap.missing) for gap in gaps)
    # What was never learnt can hardly be likely, and is not named.
    assert sum(outcome.named for outcome, _ in found) <= 3 * len(machines)
    for outcome, _ in found:
        assert 0 < outcome.p_value <= 1
        assert 0 < outcome.rest_p <= 1
        assert np.isfinite(outcome.features()).all()
    # Again, and the same.
    assert searches(learnt, 0, machines[:1], 8, among) == found[: len(trainable()) - len(gaps[0].modelled)]


def test_effects_that_nobody_could_have_seen_teach_nothing(learnt):
    """Where a machine's mains is found on none alike, its end says neither that it was there nor that it was not."""
    among, machines = ("mains_interference", "clipping", "quantisation"), (1_000_002,)
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
    one, other = (searches(replace(learnt, detectability=sight), 0, machines, 8, among) for sight in (None, blind))
    gaps = [draw_gap(np.random.default_rng([0, machine]), most_records=8, among=among) for machine in machines]
    hums = sum("mains_interference" in {effect.name for effect in gap.missing} for gap in gaps)
    assert hums == 1
    assert len(one) - len(other) == hums
    assert sum(there for _, there in one) - sum(there for _, there in other) == hums
