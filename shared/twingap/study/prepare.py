"""The calibrated twin's records beside the measured ones: what the rivals are given, in the study and in training.

records, spec or sim --gap.calibrate--> corrected speeds, identified twin --simulate--> (records, simulated)
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
    """All records that calibration kept, and as many of the calibrated twin under the same conditions.

    Rivals get the records of both parts, fitted and held out: they learnt on such pairs too, so that what calibration
    takes away is the same in both, and no rival is weakened by half the records.

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
    """The simulated gaps that the diagnosis learns from, as pairs for the rivals.

    Machines with something outside the catalogue are left out: a plain classifier has no class for them.

    Yields
    ------
    (records, simulated records, effects missing)
    """
    from twingap.gap.knowledge.simulated_gaps import draw_gap

    made = 0
    while made < n:
        gap = draw_gap(rng, most_records=36)
        if gap.strange:
            continue
        try:
            real, simulated = prepared(gap.records, gap.spec, rng, gap.sim)
        except TwingapError:
            continue
        made += 1
        yield real, simulated, frozenset(effect.name for effect in gap.missing)
