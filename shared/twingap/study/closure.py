"""How much of a world's gap its true effects close: the yardstick of a verdict's closure.

machine without effects --replayed--> before --+
machine with the true effects, true values ----+--gap.distance from the records--> (before - after) / (before - floor)
records ---------------------------------------+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from twingap.records import Condition, RecordSet

REPLICATES = 2


def true_closure(world: Any, seed: int) -> float | None:
    """Closure of the catalogued effects that the world has, at the values it has them.

    Fresh records of the same machine are compared: without any effect that the twin lacks, and with those of the
    catalogue. Outsiders are in neither, so what they change stays open.

    Parameters
    ----------
    world : World
        See `twingap.rigs.worlds`.
    seed : int
        Of the fresh records.

    Returns
    -------
    float or None
        None where there is no effect to add, or no gap to close.
    """
    from twingap.gap.distance import Paired
    from twingap.gap.view import Frame
    from twingap.gap.views import Grid
    from twingap.rigs.worlds import replay

    truth = world.truth
    if not truth.effects:
        return None
    records = world.records
    # True speeds: what a wrong tachometer does is no gap, and calibration is not what is judged here.
    conditions = [replace(c, speed_rpm=s) for c, s in zip(records.conditions, truth.speed_rpm, strict=True)]
    fs = min(c.fs_hz for c in conditions)
    scale = float(np.median([np.sqrt(np.mean(r.samples**2)) for r in records]))
    frame = Frame(records.bearing, (0.05 * fs, 0.45 * fs), scale)
    grid = Grid.of(conditions, records.bearing)

    def views(of: RecordSet) -> Any:
        return _views(of, conditions, frame, grid)

    real = views(records)
    rng = np.random.default_rng([seed, 0xC105])
    fresh = [int(s) for s in rng.integers(2**31, size=2 * REPLICATES)]
    before = Paired(real, [views(replay(world, effects=(), seed=s)) for s in fresh[:REPLICATES]])
    after = Paired(
        real, [views(replay(world, effects=truth.effects, seed=s)) for s in fresh[REPLICATES:]], None, before.scale
    )
    start, end = before.distance(rng), after.distance(rng)
    worse = start.overall - start.floor
    return float((start.overall - end.overall) / worse) if worse > 0.05 * max(start.floor, 1e-9) else None


def _views(records: RecordSet, conditions: Sequence[Condition], frame: Any, grid: Any) -> Any:
    from twingap.gap.view import RecordView
    from twingap.gap.views import measure

    return measure((RecordView(r.samples, c, frame) for r, c in zip(records, conditions, strict=True)), grid)
