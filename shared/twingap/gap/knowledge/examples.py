"""Training examples: simulated gaps, processed by the same steps as a diagnosis.

SimulatedGap --calibrate, simulate, compare--> features with the twin as given
             --some missing effects added, at values with errors--> features as in a search
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields

import numpy as np

from twingap.effects import Effect, trainable
from twingap.errors import TwingapError
from twingap.gap.features.comparison import feature_names
from twingap.gap.knowledge.learn import Examples
from twingap.gap.knowledge.simulated_gaps import SimulatedGap, draw_gap
from twingap.gap.search.evidence import Compared, Evidence, simulator_of
from twingap.gap.search.parameter_scale import Setting, to_number, trained_coordinates, with_errors
from twingap.identification.calibrate import calibrate


def examples(seed: int, machines: Sequence[int], most_records: int) -> Examples:
    """Training examples of simulated machines, by number; a machine depends on the seed and its number only."""
    rows = [row for machine in machines for row in _examples_of(seed, machine, most_records)]
    return stacked([Examples(*[np.asarray([value]) for value in row]) for row in rows])


def stacked(parts: Sequence[Examples]) -> Examples:
    """Concatenation of examples."""
    if not parts:
        features, effects = np.zeros((0, len(feature_names())), np.float32), np.zeros((0, len(trainable())), bool)
        flag, values = np.zeros(0, bool), np.zeros((0, len(trained_coordinates())))
        return Examples(features, effects, effects, flag, np.zeros(0, np.int64), flag, values, features)
    return Examples(*[np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Examples)])


def _examples_of(seed: int, machine: int, most_records: int) -> Iterator[tuple[object, ...]]:
    """Rows of one machine: the twin as given and, for some, with effects added; none if it cannot be calibrated."""
    rng = np.random.default_rng([seed, machine])
    try:
        gap = draw_gap(rng, most_records=most_records)
        calibrated = calibrate(gap.records, gap.spec, rng, sim=gap.sim)
        evidence = Evidence(calibrated, simulator_of(calibrated, gap.sim), gap.spec, int(rng.integers(2**62)))
    except TwingapError:  # a machine that cannot be calibrated gives no example
        return
    setting, order = evidence.setting, list(trainable())
    try:
        compared = evidence.against()
        yield _row(compared, gap, gap.missing, machine, True, setting, order)
        if not gap.missing or rng.random() < 0.3:
            return
        found = _added_effects(rng, gap, setting, evidence)
        if not found:
            return
        compared = evidence.against(found)
    except TwingapError:
        return
    left = tuple(e for e in gap.missing if e.name not in {f.name for f in found})
    yield _row(compared, gap, left, machine, False, setting, order)


def _row(
    compared: Compared, gap: SimulatedGap, missing: Sequence[Effect], machine: int, first: bool, setting: Setting,
    order: list[str],
) -> tuple[object, ...]:  # fmt: skip
    """One example, in the order of the fields of `Examples`."""
    present = {effect.name: effect for effect in missing}
    values = [to_number(present[n], p, setting) if n in present else np.nan for n, p in trained_coordinates()]
    has = {effect.name for effect in gap.modelled}
    lacks, models = (np.array([n in names for n in order]) for names in (present, has))
    return (
        compared.held_out.astype(np.float32), lacks, models, gap.outside, machine, first, np.array(values),
        compared.fit.astype(np.float32),
    )  # fmt: skip


def _added_effects(
    rng: np.random.Generator, gap: SimulatedGap, setting: Setting, evidence: Evidence
) -> tuple[Effect, ...]:
    """Some or all of the missing effects that can be added, at values with errors as estimates have them."""
    can = [e for e in gap.missing if evidence.can_add(e.name) is None]
    chance = 1.0 if rng.random() < 0.5 else 0.6
    error = 0.12 * rng.random()
    return tuple(with_errors(effect, error, setting, rng) for effect in can if rng.random() <= chance)
