"""Fit of a population twin: the closest twin of recordings, with values by recording from which machines are drawn.

recordings --pieces, states--> verdict's effects --> closest twin --path and background by recording--> TwinSpec

The states are given: read off the recordings (`twingap.classify`) where labels may not be used. Each recording counts
as a bearing of its own. Where a closest twin is no closer with values by recording, and so has none (see
`twingap.gap.search.closest_twin`), path and background are measured by recording all the same.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from threadpoolctl import threadpool_limits

from twingap import RecordSet
from twingap.data import cut
from twingap.effects.by_state import UNIT_COLUMNS
from twingap.gap.knowledge import shipped
from twingap.gap.search.closest_twin import closest_spec, closest_twin
from twingap.gap.search.effect_search import explain
from twingap.gap.search.evidence import THOROUGH, Compared, Evidence, simulator_of
from twingap.gap.search.free_spectra import BACKGROUND, PATH, by_of, measured
from twingap.identification.calibrate import calibrate_prepared, prepare
from twingap.provenance import plain
from twingap.streams import root_entropy
from twingap.twins.twin_file import TwinSpec

BARE: Final = TwinSpec("phenomenological")
"""Twin that effects are added to."""
PIECE_S: Final = 1.0
PIECES: Final = 1
"""Length (s) and number of the records cut from a recording; more, and longer ones, take longer."""


@dataclass(frozen=True)
class Fit:
    """Fit of a population twin."""

    records: str  # digest of the pieces that it is fitted to
    states: tuple[str, ...]  # of the pieces
    seed: int


def pieces(recordings: RecordSet) -> RecordSet:
    """Unlabelled records cut from recordings, evenly spaced, whose only extra column names the recording as unit."""
    every = cut(recordings, duration_s=PIECE_S)
    groups = np.array([c.group for c in every.conditions])
    kept: list[int] = []
    for group in dict.fromkeys(groups):
        own = np.flatnonzero(groups == group)
        kept += [int(i) for i in own[np.unique(np.linspace(0, own.size - 1, PIECES).round().astype(int))]]
    return _with(every.take(kept), [None] * len(kept))


def _with(records: RecordSet, states: Sequence[str | None]) -> RecordSet:
    conditions = [
        dataclasses.replace(c, fault=state, extra={UNIT_COLUMNS[-1]: c.group})
        for c, state in zip(records.conditions, states, strict=True)
    ]
    held = [record.samples for record in records]
    return RecordSet(records.name, records.unit, records.bearing, conditions, held.__getitem__)


def fit_population(job: Fit, every: dict[str, RecordSet]) -> dict[str, Any]:
    """Population twin of the pieces ``every[job.records]``: fields of `TwinSpec` as JSON values, and whether its values
    by recording are those of the closest twin (``by_unit``)."""
    known = _with(every[job.records], job.states)
    rng = np.random.default_rng([job.seed, 67])
    with threadpool_limits(1):
        prepared = prepare(known, BARE, rng)
        known = prepared.speeds.corrected(known)
        # Nothing is held out: who judges has other recordings.
        names = tuple(c.name for c in known.conditions)
        prepared = dataclasses.replace(prepared, fit=known, held_out=known, shared=names)
        calibrated = calibrate_prepared(prepared, BARE, rng)
        evidence = Evidence(calibrated, simulator_of(calibrated), BARE, root_entropy(rng) >> 66, THOROUGH)
        learnt = shipped()
        now = closest_twin(evidence, explain(evidence, learnt, lambda what, part: None), learnt)
        by_unit = by_of(effect for effect in now.effects if effect.name in (PATH, BACKGROUND)) == "unit"
        if not by_unit and (made := measured(evidence, now.simulator, now.effects, (PATH, BACKGROUND), by="unit")):
            now = Compared(evidence, made[1], made[0])
    spec = closest_spec(now)
    assert spec is not None  # the bare twin has a file
    return {
        "model": spec.model, "effects": list(spec.effects), "parameters": plain(spec.parameters), "by_unit": by_unit,
    }  # fmt: skip
