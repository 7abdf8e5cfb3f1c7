"""The closest twin on held-out records: the part of the gap that it closes, by group of effects, beside real records.

closest twin --replicates of the held-out part--> closure, attribution over groups, measures --+
real records in place of the twin --same distance--> ceiling ----------------------------------+--> ClosestTwin
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from twingap.effects import Effect, LineSpectrum
from twingap.effects.by_state import UNIT_COLUMNS, ByState
from twingap.gap.distance.closure import Closure, closure, closure_interval, paired
from twingap.gap.distance.closure_metrics import closure_metrics
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.held_out import HeldOut, values_of_effect
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.line_names import named_lines
from twingap.gap.report.model import Ceiling, ClosestEffect, ClosestTwin, Metric, ParameterValue
from twingap.gap.search.attribution import attribution
from twingap.gap.search.closest_twin import closest_twin
from twingap.gap.search.evidence import Compared
from twingap.gap.search.free_spectra import BACKGROUND, PATH, by_of, measured
from twingap.records import Array, Condition
from twingap.twins.simulator import Simulator, TwinSimulator

CLOSEST_FILE: Final = "closest.toml"
"""Twin file of the closest twin, beside gap.json."""
_REPLAYED: Final = 3
"""Largest number of real records that stand in place of the twin for each held-out record."""
_FEWEST_RECORDS: Final = 3
"""Records of a state in the fit part from which their spread is known."""
_FEWEST: Final = 0.5
"""Part of the held-out records that need such records for a ceiling. A smaller value measures it on fewer records."""


def closest_of(
    held_out: HeldOut, learnt: Learnt, before: Sequence[FeatureVectors], of_named: Closure, measures: Sequence[Metric],
    scale: Array, replayed: Ceiling, rng: np.random.Generator, progress: Callable[[str, float], None],
) -> tuple[ClosestTwin, Compared]:  # fmt: skip
    """The closest twin with its closure and attribution.

    `before` are replicates of the twin as given, `scale` [bins] is that of the verdict's comparisons. `of_named` is the
    closure of the verdict's effects, which is also that of the closest twin where nothing else brings it closer; of the
    verdict's `measures`, the twin as given and the floor are the same for both.
    """
    evidence, found = held_out.evidence, held_out.found
    begin = found.after if found.gap else found.before
    sought = closest_twin(evidence, found, learnt, lambda what, part: progress(what, 0.6 * part))
    count = min(len(before), held_out.fewer)
    first, floor = list(before[:count]), of_named.floor

    def evaluated(now: Compared) -> tuple[list[FeatureVectors], Closure]:
        after = held_out.replicates(now.simulator, now.effects, count)
        same = found.gap and bool(now.effects) and now.effects == begin.effects
        return after, of_named if same else closure_interval(*paired(held_out.real, first, after, scale), floor, rng)

    now, (after, closed) = sought, evaluated(sought)
    if closed.ci[1] < of_named.closure:  # what was fitted does not hold for other records
        now, (after, closed) = begin, evaluated(begin)
    few = min(count, 2)

    def refitted(chain: tuple[Effect, ...]) -> tuple[Simulator, tuple[Effect, ...]]:
        names = [name for name in (PATH, BACKGROUND) if name in {effect.name for effect in chain}]
        made = measured(evidence, now.simulator, chain, names, 2, by=by_of(chain)) if names else None
        return made or (now.simulator, chain)

    shares = attribution(
        evidence, now.simulator, now.effects, real=held_out.real, before=first[:few],
        made=lambda simulator, effects: held_out.replicates(simulator, effects, few),
        refitted=refitted, floor=floor, rng=rng, progress=lambda part: progress("attribution", 0.6 + 0.35 * part),
    )  # fmt: skip
    # Shares are measured with fewer replicates: scaled, they add up to the closure that is reported.
    total = sum(share.share for share in shares)
    factor = closed.closure / total if abs(total) > 0.05 and closed.closure / total > 0 else 1.0
    groups = tuple(
        replace(
            one, effects=tuple(replace(part, share=factor * part.share) for part in one.effects),
            share=factor * one.share, share_ci=(factor * one.share_ci[0], factor * one.share_ci[1]),
        )
        for one in shares
    )  # fmt: skip
    own = closure_metrics(held_out.real, first, after, rng, more=held_out.training_sets(now), scale=scale)
    # The twin as given and the floor are those of the verdict's measures, which were drawn with other random numbers.
    of = {measure.metric: measure for measure in measures}
    stated = ((m, of.get(m.metric, m)) for m in own)
    metrics = tuple(replace(m, before=o.before, ci_before=o.ci_before, floor=o.floor) for m, o in stated)
    effects = tuple(
        ClosestEffect(one.name, {**values_of_effect(one, {}), **line_counts(one, held_out)}) for one in now.effects
    )
    twin = CLOSEST_FILE if isinstance(now.simulator, TwinSimulator) else ""
    shown = groups if closed.closure > 0 else ()
    return ClosestTwin(effects, closed.closure, closed.ci, shown, replayed, twin, metrics), now


def of_verdict(held_out: HeldOut, closed: Closure | None, replayed: Ceiling) -> ClosestTwin:
    """The verdict's twin as the closest one, without attribution; `closed` is None where nothing was added."""
    found = held_out.found
    effects = tuple(
        ClosestEffect(one.name, values_of_effect(one, {})) for one in (found.after.effects if found.gap else ())
    )
    value, ci = (closed.closure, closed.ci) if closed else (0.0, (0.0, 0.0))
    return ClosestTwin(effects, value, ci, ceiling=replayed)


def line_counts(effect: Effect, held_out: HeldOut) -> dict[str, ParameterValue]:
    """Number of lines of each kind (`line_names`); of lines measured by fault, those of the fault that has most."""
    own = [effect.base, *(one for _, one in effect.states)] if isinstance(effect, ByState) else [effect]
    lines = [one for one in own if isinstance(one, LineSpectrum)]
    if not lines:
        return {}
    most = max(lines, key=lambda one: one.places[0].size)
    shaft_hz = float(np.mean([c.speed_rpm for c in held_out.part.conditions])) / 60
    kinds = named_lines(most, held_out.evidence.frame.bearing, shaft_hz)
    return {f"lines of {kind}": ParameterValue(float(len(places)), "lines") for kind, places in kinds.items()}


def ceiling(held_out: HeldOut, before: Sequence[FeatureVectors], floor: float) -> Ceiling:
    """Closure that real records reach in place of the twin, from the gap that replicates of it leave before.

    Each held-out record is compared with records of the fit part of the same fault and the nearest speeds.
    """
    conditions, fit = held_out.part.conditions, held_out.evidence.calibrated.fit.conditions
    column = next((name for name in UNIT_COLUMNS if any(c.extra.get(name) for c in fit)), None)

    def unit(condition: Condition) -> str:
        return str(condition.extra.get(column)) if column else str(condition.fault)

    def closes(same: bool) -> float | None:
        chosen: dict[int, list[int]] = {}
        for row, condition in enumerate(conditions):
            alike = [
                (abs(math.log(c.speed_rpm / condition.speed_rpm)), i)
                for i, c in enumerate(fit)
                if c.fault == condition.fault and (unit(c) == unit(condition)) is same and c.group != condition.group
            ]
            if alike:
                chosen[row] = [i for _, i in sorted(alike)][:_REPLAYED]
        # The spread of records that stand in is needed, so that their noise can be taken out.
        counts_of = Counter(c.fault for c in fit)
        chosen = {row: own for row, own in chosen.items() if counts_of[conditions[row].fault] >= _FEWEST_RECORDS}
        if len(chosen) < max(2, _FEWEST * len(conditions)):
            return None
        # One unit at a time: over several, records that stand for each other would cancel.
        units = dict.fromkeys(unit(conditions[row]) for row in chosen)
        rows = [[row for row in chosen if unit(conditions[row]) == one] for one in units]
        gaps = [_replayed(held_out, before, own, [chosen[row] for row in own]) for own in rows]
        counts = [len(own) for own in rows]
        first, last = (float(np.average(side, weights=counts)) for side in zip(*gaps, strict=True))
        return closure(first, last, floor)

    return Ceiling(closes(same=True), closes(same=False) if column else None)


def _replayed(
    held_out: HeldOut, before: Sequence[FeatureVectors], rows: Sequence[int], places: Sequence[Sequence[int]]
) -> tuple[float, float]:
    """Gap of some held-out records to the twin as given, and to the records of the fit part at `places`.

    Records of the fit part serve several held-out ones, so that the noise of their mean is common to all of these; it
    is taken out with their spread.
    """
    real, made = held_out.real.take(list(rows)), held_out.fit_vectors
    start = Paired(real, [one.take(list(rows)) for one in before])
    count = max(len(own) for own in places)
    pair = Paired(real, [made.take([own[k % len(own)] for own in places]) for k in range(count)], start.scale)
    squares = pair.squares().copy()
    for stratum, own in enumerate(pair.strata):
        used = [places[row][k % len(places[row])] for row in own for k in range(count)]
        fault = pair.conditions[own[0]].fault
        alike = [i for i, c in enumerate(made.conditions) if c.fault == fault]
        if len(alike) > 1:
            weights = np.bincount(used) / len(used)
            spread = (made.matrix[alike] / start.scale).var(axis=0, ddof=1)
            squares[0, stratum] -= spread * float(np.sum(weights**2))
    before_gap = float(start.over_domains(start.squares())[0][0])
    return before_gap, float(pair.over_domains(squares)[0][0])
