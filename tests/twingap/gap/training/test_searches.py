"""Whole searches on machines not learnt from."""

import numpy as np

from twingap.effects import catalogue
from twingap.gap.training.gaps import draw_gap
from twingap.gap.training.searches import searches


def test_every_effect_of_every_machine_has_an_end_and_a_truth(learnt):
    among, machines = ("mains_interference", "clipping", "quantisation"), (1_000_000, 1_000_001, 1_000_002)
    found = searches(learnt, 0, machines, 8, among)
    gaps = [draw_gap(np.random.default_rng([0, machine]), most_records=8, among=among) for machine in machines]
    assert len(found) == sum(len(catalogue()) - len(gap.modelled) for gap in gaps)
    assert sum(missing for _, missing in found) == sum(len(gap.missing) for gap in gaps)
    # What was never learnt can hardly be likely, and is not named.
    assert sum(outcome.named for outcome, _ in found) <= 3 * len(machines)
    for outcome, _ in found:
        assert 0 < outcome.p_value <= 1
        assert 0 < outcome.rest_p <= 1
        assert np.isfinite(outcome.features()).all()
    # Again, and the same.
    assert searches(learnt, 0, machines[:1], 8, among) == found[: len(catalogue()) - len(gaps[0].modelled)]
