"""Jobs on the closest twin of public records: its closure and the classifier that it teaches, under stated splits.

split: fit part | judged part --fit part alone--> closest twin, machines drawn from its units
judged part --distance--> closure of the twin and of the population, beside real records in place of the twin
simulated under the fit part's conditions, real records of the fit part --trees--> judged recordings named right
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from threadpoolctl import threadpool_limits

from twingap.effects import trainable
from twingap.effects.by_state import unit_of
from twingap.errors import TwingapError
from twingap.gap.closest import ceiling
from twingap.gap.distance.closure import closure, closure_interval, paired
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.held_out import HeldOut
from twingap.gap.knowledge import shipped
from twingap.gap.search.closest_twin import closest_spec, closest_twin
from twingap.gap.search.effect_search import explain
from twingap.gap.search.evidence import THOROUGH, Compared, Evidence, simulator_of
from twingap.gap.search.free_spectra import by_of
from twingap.identification.calibrate import Prepared, calibrate_prepared, prepare
from twingap.records import Condition, RecordSet
from twingap.streams import root_entropy
from twingap.twins.population import has_population, machines
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec

PIECE_S: Final = 2.0
"""Length of a record, s. Longer records resolve closer lines, and are fewer."""
TAUGHT: Final = 4
"""Simulated records per record of the fit part that a classifier learns from; machines of a population likewise. More
take longer."""
TREES: Final = 300
"""Trees of a classifier. More make its accuracy depend less on its random numbers."""
_FIRST_TAUGHT: Final = 20
"""Number of the first replicate that a classifier learns from: none that a value was fitted to."""


@dataclass(frozen=True)
class Split:
    """A stated split of a set's records: `groups` are the recordings that are fitted, all others are judged.

    With `new_bearings` the judged records are of other bearings than the fitted ones, else of other operating points.
    """

    name: str
    new_bearings: bool
    groups: frozenset[str]

    def fitted(self, condition: Condition) -> bool:
        """Whether a record is fitted."""
        return condition.group in self.groups


class WithDetectorsAlone(Evidence):
    """Evidence to which effects without a detector cannot be added."""

    def can_add(self, name: str) -> str | None:
        return super().can_add(name) if name in trainable() else "it has no detector"


def splits(records: RecordSet) -> list[Split]:
    """Stated splits of a set: by operating point, and bearings left out.

    Operating points (motor load, or speed) are fitted and judged alternately; with four points or more the reverse is a
    second split. Where every fault has several bearings, each split of the others leaves out one bearing of every
    fault. Healthy records are fitted wherever the fit part would have none, and where bearings are left out.
    """
    conditions = records.conditions
    points = sorted({_point(c) for c in conditions})
    turns = 0 if len(points) < 2 else 1 if len(points) < 4 else 2
    of: dict[str, dict[str, None]] = {}
    for c in conditions:
        if c.fault != "healthy":
            of.setdefault(str(c.fault), {})[unit_of(c)] = None
    count = min((len(units) for units in of.values()), default=0)
    left_out = [[sorted(units)[k] for units in of.values()] for k in range(count if count > 1 else 0)]
    return [
        *(_by_point(conditions, points[first::2], points[1 - first :: 2]) for first in range(turns)),
        *(_without(conditions, units) for units in left_out),
    ]


def _point(condition: Condition) -> float:
    """Operating point of a record: motor load in hp where it is known, else speed in rpm."""
    load = condition.extra.get("load_hp")
    return float(round(condition.speed_rpm) if load is None else load)


def _by_point(conditions: Sequence[Condition], fitted: Sequence[float], judged: Sequence[float]) -> Split:
    unit = "rpm" if conditions[0].extra.get("load_hp") is None else "hp"
    no_healthy = not any(c.fault == "healthy" and _point(c) in fitted for c in conditions)
    groups = {str(c.group) for c in conditions if _point(c) in fitted or (no_healthy and c.fault == "healthy")}
    sides = (" and ".join(f"{point:g}" for point in side) for side in (fitted, judged))
    return Split("{} {unit} fitted, {} judged".format(*sides, unit=unit), False, frozenset(groups))


def _without(conditions: Sequence[Condition], units: Sequence[str]) -> Split:
    groups = {str(c.group) for c in conditions if c.fault == "healthy" or unit_of(c) not in units}
    return Split(f"{', '.join(sorted(units))} left out", True, frozenset(groups))


def closest_row(
    records: RecordSet, spec: TwinSpec, rng: np.random.Generator, split: Split, *, detectors_alone: bool = False
) -> dict[str, Any]:
    """Row of one split: effects and closures of the closest twin, and accuracies of the classifiers that it teaches.

    JSON values; ``refused`` holds the reason when there is no closest twin. With `detectors_alone`, effects without a
    detector are left out, and nothing is taught.
    """
    begin = time.perf_counter()
    about = {"split_by": split.name, "new_bearings": split.new_bearings}
    try:
        with threadpool_limits(1):
            prepared = prepare(records, spec, rng, fitted=split.fitted)
            held_out, now = _found(prepared, spec, rng, detectors_alone=detectors_alone)
            row = _judged(held_out, now, rng)
            if not detectors_alone:
                row["accuracy"] = _taught(held_out, now, rng)
    except TwingapError as error:
        return {**about, "refused": str(error), "seconds": time.perf_counter() - begin}
    size = {"fitted": len(prepared.fit), "judged": len(prepared.held_out), "recordings": len(prepared.held_out.groups)}
    return {**about, **size, "refused": "", **row, "seconds": time.perf_counter() - begin}


def _found(
    prepared: Prepared, spec: TwinSpec, rng: np.random.Generator, *, detectors_alone: bool
) -> tuple[HeldOut, Compared]:
    """The closest twin, found on the fit part alone, and the judged part."""
    fit = prepared.fit
    alone = replace(prepared, held_out=fit, shared=tuple(c.name for c in fit.conditions))
    calibrated = calibrate_prepared(alone, spec, rng)
    kind = WithDetectorsAlone if detectors_alone else Evidence
    simulator, root, learnt = simulator_of(calibrated), root_entropy(rng) >> 66, shipped()
    evidence = kind(calibrated, simulator, spec, root, THOROUGH)
    found = explain(evidence, learnt, lambda what, part: None)
    now = closest_twin(evidence, found, learnt)
    judged = Evidence(replace(calibrated, held_out=prepared.held_out, shared=()), simulator, spec, root, THOROUGH)
    return HeldOut(judged, found), now


def _judged(held_out: HeldOut, now: Compared, rng: np.random.Generator) -> dict[str, Any]:
    """Closures on the judged part: of the verdict's effects, the closest twin, its population, and real records."""
    found, count = held_out.found, held_out.fewer
    before = held_out.replicates(found.before.simulator, found.before.effects, count)
    verdict = found.after if found.gap else found.before
    named = held_out.replicates(verdict.simulator, verdict.effects, count) if verdict.effects else before
    first, second = paired(held_out.real, before, named)
    scale, (floor, _) = first.scale, second.floor(rng)
    made = {"verdict": named, "closest": held_out.replicates(now.simulator, now.effects, count)}
    if drawn := _population(held_out, now, held_out.part.conditions, 2 * TAUGHT, rng):
        made["population"] = drawn
    closed = {n: closure_interval(*paired(held_out.real, before, own, scale), floor, rng) for n, own in made.items()}
    by_bearing = {name: _by_bearing(held_out.real, before, own, floor) for name, own in made.items()}
    replayed = ceiling(held_out, before, floor)
    return {
        "named": list(found.names) if found.gap else [], "effects": [effect.name for effect in now.effects],
        "by": by_of(now.effects), "gap": {"before": closed["verdict"].before, "floor": floor},
        "closure": {name: [one.closure, *one.ci] for name, one in closed.items()},
        "by_bearing": {**by_bearing, "same bearing": replayed.same_unit, "other bearings": replayed.other_unit},
    }  # fmt: skip


def _by_bearing(
    real: FeatureVectors, before: Sequence[FeatureVectors], after: Sequence[FeatureVectors], floor: float
) -> float:
    """Closure of one bearing at a time, as `ceiling` measures that of real records in place of the twin."""
    gaps, counts = [], []
    units = [(c.fault, unit_of(c)) for c in real.conditions]
    for unit in dict.fromkeys(units):
        rows = [i for i, own in enumerate(units) if own == unit]
        start = Paired(real.take(rows), [one.take(rows) for one in before])
        end = Paired(real.take(rows), [one.take(rows) for one in after], start.scale)
        gaps.append([float(one.over_domains(one.squares())[0][0]) for one in (start, end)])
        counts.append(len(rows))
    first, last = np.average(gaps, axis=0, weights=counts)
    return closure(float(first), float(last), floor)


def _population(
    held_out: HeldOut, now: Compared, conditions: Sequence[Condition], count: int, rng: np.random.Generator
) -> list[FeatureVectors]:
    """Feature vectors of machines drawn from the closest twin's units; none where it has no values of several units."""
    spec, evidence = closest_spec(now), held_out.evidence
    if spec is None or not has_population(spec):
        return []
    drawn = [one for _, one in machines(spec, count, rng)]
    simulators = [TwinSimulator(one, evidence.frame.bearing, evidence.calibrated.fit.unit) for one in drawn]
    return [
        evidence.vectors(evidence.simulated(simulator, (), conditions, _FIRST_TAUGHT + k), held_out.grid)
        for k, simulator in enumerate(simulators)
    ]


def _taught(held_out: HeldOut, now: Compared, rng: np.random.Generator) -> dict[str, float]:
    """Accuracy by recording on the judged part of classifiers taught by simulated, by real, and by both records."""
    evidence, before = held_out.evidence, held_out.found.before
    conditions = evidence.calibrated.fit.conditions

    def made(compared: Compared) -> list[FeatureVectors]:
        numbers = range(_FIRST_TAUGHT, _FIRST_TAUGHT + TAUGHT)
        simulated = (evidence.simulated(compared.simulator, compared.effects, conditions, k) for k in numbers)
        return [evidence.vectors(records, held_out.grid) for records in simulated]

    real = [held_out.fit_vectors]
    taught = {"bare": made(before), "closest": made(now)}
    if drawn := _population(held_out, now, conditions, TAUGHT, rng):
        taught["population"] = drawn
    seed = int(rng.integers(2**31))
    out = {name: recognised([own], held_out.real, seed) for name, own in taught.items()}
    out["real"] = recognised([real], held_out.real, seed)
    return out | {f"real and {name}": recognised([real, own], held_out.real, seed) for name, own in taught.items()}


def recognised(taught: Sequence[Sequence[FeatureVectors]], judged: FeatureVectors, seed: int) -> float:
    """Part of the judged recordings that trees name right.

    Sources of examples have equal weight whatever their numbers, as have the classes in each. Probabilities of the
    judged records of one group are averaged.
    """
    from sklearn.ensemble import ExtraTreesClassifier  # a slow import
    from sklearn.utils.class_weight import compute_sample_weight

    labels = [np.array([str(c.fault) for one in source for c in one.conditions]) for source in taught]
    weights = [compute_sample_weight("balanced", own) / own.size for own in labels]
    trees = ExtraTreesClassifier(TREES, max_features="sqrt", random_state=seed, n_jobs=1)
    trees.fit(
        np.concatenate([one.matrix for source in taught for one in source]), np.concatenate(labels),
        np.concatenate(weights),
    )  # fmt: skip
    predicted = trees.predict_proba(judged.matrix)
    groups: dict[str, list[int]] = {}
    for place, condition in enumerate(judged.conditions):
        groups.setdefault(str(condition.group), []).append(place)
    right = [
        trees.classes_[predicted[own].mean(axis=0).argmax()] == str(judged.conditions[own[0]].fault)
        for own in groups.values()
    ]
    return float(np.mean(right))
