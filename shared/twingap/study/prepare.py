"""Records of the calibrated twin paired with the measured ones: the input of rival methods, in study and training.

records, spec or sim --calibrate--> corrected speeds, identified twin --simulate--> (records, simulated)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.twins.twin_file import TwinSpec


def prepared(
    records: RecordSet, spec: TwinSpec, rng: np.random.Generator, sim: RecordSet | None = None
) -> tuple[RecordSet, RecordSet]:
    """All records kept by calibration, and one record of the calibrated twin per condition.

    Rivals get the records of both parts, fit and held-out. They are trained on such pairs too, so calibration has the
    same effect in training and evaluation, and no rival is weakened by half the records. `sim` are records of the
    user's own simulator, in place of the built-in twin's.

    Raises
    ------
    TwingapError
        When the twin cannot be calibrated.
    """
    from twingap.gap.search.evidence import simulator_of
    from twingap.identification.calibrate import calibrate

    calibrated = calibrate(records, None if sim is not None else spec, rng, sim=sim)
    kept = {r.condition.name: r for part in (calibrated.fit, calibrated.held_out) for r in part}
    real = RecordSet.from_records("records", records.unit, calibrated.frame.bearing, kept.values())
    made = simulator_of(calibrated, sim).simulate((), real.conditions, int(rng.integers(2**62)), 1)
    return real, RecordSet.from_records("simulated", real.unit, real.bearing, made)


def training_worlds(n: int, rng: np.random.Generator) -> Iterator[tuple[RecordSet, RecordSet, frozenset[str]]]:
    """Simulated gaps on which the diagnosis is trained, as pairs of record sets for the rivals.

    Machines with an effect outside the catalogue are left out: a plain classifier has no class for them.

    Yields
    ------
    (records, simulated records, missing effects)
    """
    from twingap.gap.knowledge.simulated_gaps import draw_gap

    made = 0
    while made < n:
        gap = draw_gap(rng, most_records=36)
        if gap.outside:
            continue
        try:
            real, simulated = prepared(gap.records, gap.spec, rng, gap.sim)
        except TwingapError:
            continue
        made += 1
        yield real, simulated, frozenset(effect.name for effect in gap.missing)
