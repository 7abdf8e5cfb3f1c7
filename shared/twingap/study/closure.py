"""Reference values for a verdict's closure: gap closed by the true effects, and gap left without any effect.

machine without effects --replayed--> before --+
machine with the true effects, true values ----+--gap.distance from the records--> (before - after) / (before - floor)
records ---------------------------------------+
machine without effects --replayed, blinded, calibrated--> twin --gap.distance--> gap that no effect can close

The first assumes a twin that equals the machine. The second is the best that this twin can reach, as its structure
differs from the machine's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from twingap.errors import TwingapError
from twingap.gap.distance.feature_vectors import FeatureVectors, measure_vectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.gap.search.modelled_effects import without_values
from twingap.gap.search.optimise import optimise
from twingap.identification.calibrate import calibrate
from twingap.records import RecordSet
from twingap.rigs.worlds import replay
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.study.blind import Blind, blinded

REPLICATES: Final = 2
"""Simulated replicates of each record; more lower the sampling error of the distances and are slower."""


def true_closure(world: Any, seed: int) -> float | None:
    """Closure of the world's catalogued effects at their true values; None without any, or where there is no gap.

    New records of the same machine are compared: without any effect that the twin lacks, and with the catalogued
    effects. Effects outside the catalogue are in neither, so the gap due to them stays open.
    """
    truth = world.truth
    if not truth.effects:
        return None
    records = world.records
    # True speeds: tachometer errors are not part of the gap, and calibration is not evaluated here.
    conditions = [replace(c, speed_rpm=s) for c, s in zip(records.conditions, truth.speed_rpm, strict=True)]
    fs = min(c.fs_hz for c in conditions)
    scale = float(np.median([np.sqrt(np.mean(r.samples**2)) for r in records]))
    frame = Frame(records.bearing, (0.05 * fs, 0.45 * fs), scale)
    grid = Grid.of(conditions, records.bearing)

    def vectors(of: RecordSet) -> FeatureVectors:
        transforms = (RecordTransforms(r.samples, c, frame) for r, c in zip(of, conditions, strict=True))
        return measure_vectors(transforms, grid)

    real = vectors(records)
    rng = np.random.default_rng([seed, 0xC105])
    fresh = [int(s) for s in rng.integers(2**31, size=2 * REPLICATES)]
    before = Paired(real, [vectors(replay(world, effects=(), seed=s)) for s in fresh[:REPLICATES]])
    after = Paired(
        real, [vectors(replay(world, effects=truth.effects, seed=s)) for s in fresh[REPLICATES:]], before.scale
    )
    (start,), (end,) = (pair.over_domains(pair.squares())[0] for pair in (before, after))
    floor, _ = before.floor(rng)
    worse = start - floor
    return float((start - end) / worse) if worse > 0.05 * max(floor, 1e-9) else None


def left_without_effects(world: Any, seed: int) -> float | None:
    """Gap between the machine without its effects and its own calibrated twin: no effect of the catalogue closes it.

    The machine turns at its true speeds. A twin of finished records at the stated speeds does not follow them, and that
    remains in this gap. Over all domains on the held-out part, in standard deviations. None where the twin cannot be
    calibrated, or has effects without values, which only a diagnosis could estimate.
    """
    bare = blinded(replace(world, records=replay(world, effects=(), seed=seed)))
    if bare.sim is None and without_values(bare.twin):
        return None
    try:
        return _left(bare, np.random.default_rng([seed, 0x1EF7]))
    except TwingapError:
        return None


def _left(bare: Blind, rng: np.random.Generator) -> float:
    calibrated = calibrate(bare.records, None if bare.sim is not None else bare.twin, rng, sim=bare.sim)
    evidence = Evidence(calibrated, simulator_of(calibrated, bare.sim), bare.twin, int(rng.integers(2**62)), THOROUGH)
    simulator = optimise(evidence, evidence.against().simulator, (), {}).simulator
    pair = Paired(evidence.held_out.vectors, evidence.held_out_replicates(simulator, (), REPLICATES))
    return float(pair.over_domains(pair.squares())[0][0])
