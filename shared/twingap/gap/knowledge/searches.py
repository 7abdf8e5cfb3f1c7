"""Searches on machines that no detector was trained on, for the score calibration.

SimulatedGap --calibrate, search--> Outcome of every effect, and whether it is missing
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from twingap.errors import TwingapError
from twingap.gap.knowledge.score_calibration import Outcome
from twingap.gap.knowledge.simulated_gaps import SimulatedGap, draw_gap
from twingap.gap.search.effect_search import search
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.gap.search.parameter_scale import to_number, trained_coordinates
from twingap.identification.calibrate import calibrate

if TYPE_CHECKING:
    from twingap.gap.knowledge.learnt import Learnt


def searches(
    learnt: Learnt, seed: int, machines: Sequence[int], most_records: int, among: Sequence[str] = ()
) -> list[tuple[Outcome, bool]]:
    """Outcome of a search for each effect on simulated machines (see `examples.examples`), and whether it is missing.

    Undetectable effects are left out. Effects are drawn from `among`, or from the whole catalogue.
    """
    found: list[tuple[Outcome, bool]] = []
    for machine in machines:
        rng = np.random.default_rng([seed, machine])
        try:
            gap = draw_gap(rng, most_records=most_records, among=among)
            calibrated = calibrate(gap.records, gap.spec, rng, sim=gap.sim)
            root = int(rng.integers(2**62))
            evidence = Evidence(calibrated, simulator_of(calibrated, gap.sim), gap.spec, root, THOROUGH)
            outcomes = search(evidence, learnt).outcomes
        except TwingapError:  # a machine that cannot be calibrated gives no outcome
            continue
        missing, hidden = {effect.name for effect in gap.missing}, _hidden(gap, evidence, learnt)
        found += [(outcome, name in missing) for name, outcome in outcomes.items() if name not in hidden]
    return found


def _hidden(gap: SimulatedGap, evidence: Evidence, learnt: Learnt) -> set[str]:
    """Undetectable effects of a machine."""
    if learnt.detectability is None:
        return set()
    present, setting = {effect.name: effect for effect in gap.missing}, evidence.setting
    values = [to_number(present[n], p, setting) if n in present else np.nan for n, p in trained_coordinates()]
    missing = np.array([name in present for name in learnt.effects])
    hidden = learnt.detectability.hidden(missing[None], np.array(values)[None], evidence.against().held_out[None])[0]
    return {name for name, one in zip(learnt.effects, hidden, strict=True) if one}
