"""Two sets of records, signature by signature: what a diagnosis reads.

measured records  --signatures--> Measured --+
                                             +--compare--> one vector of named features, the same for every machine
simulated records --signatures--> Measured --+

A feature is a difference of means between measured and simulated records (in the signature's own unit, and in standard
errors, as a normal deviate), of their spread, or of their trend over speed and time; or how far the sets lie apart in
the views that a report shows. Where a set has no record of a kind, the feature is NaN: nobody knows.

A set is one part of the records. Lines of many records, combs of second strikes and levels over speed and time may be
asked of all records that there are (`whole`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from twingap.gap import features as signatures
from twingap.gap.distance.feature_vectors import DOMAINS, Grid, Views
from twingap.gap.distance.feature_vectors import measure as measure_views
from twingap.gap.distance.paired import Paired
from twingap.gap.features.impacts import impulse_response as answer
from twingap.gap.features.pooled import features as whole
from twingap.gap.features.pooled.features import Whole
from twingap.gap.features.pooled.trends import courses, normal, slope
from twingap.gap.features.spectrum import change, path
from twingap.gap.features.spectrum import features as background
from twingap.gap.features.spectrum.record_summary import Outline, outline_of
from twingap.identify.speed import Speeds
from twingap.records import Condition, Record
from twingap.signal.record_transforms import Frame, RecordView, known_medians

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GROUPS = {
    True: ("all", "outer", "inner", "ball"),
    False: ("all", "healthy", "faulty"),
}
"""Kinds of records that means are taken over, for signatures of strikes (True) and for all others."""
CONTEXT = (
    "records", "healthy_share", "log_samples", "log_turns", "speeds", "span_s",
    "own_simulator", "models", "slip", "slip_z", "slip_decidable", "speed_z", "speed_scatter",
    "slip_free", "slip_free_z", "slip_evidence",
    "slip_seen", "slip_seen_size", "slip_seen_rest", "slip_rollers",
    "extent_1", "extent_4", "extent_13", "extent_41", "extent_121", "extent_mean",
)  # fmt: skip
_SMALL_SLIP = 1e-3
_FEWEST_FREE = 2
"""Degrees of freedom from which pairs say more than the records of each side by themselves."""


@dataclass(frozen=True)
class Measured:
    """Signatures of a set of records.

    Parameters
    ----------
    values : Array [records, signatures]
        In the order of `signatures.NAMES`; NaN where one does not apply.
    outlines : tuple of Outline
        Smooth spectra.
    views : Views
        What distances are measured in.
    """

    values: Array
    outlines: tuple[Outline, ...]
    views: Views

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Of the records."""
        return tuple(outline.condition for outline in self.outlines)

    def take(self, places: Sequence[int] | NDArray[np.int64]) -> Measured:
        """The records at these places."""
        kept = np.asarray(places, dtype=int)
        return Measured(self.values[kept], tuple(self.outlines[i] for i in kept), self.views.take(kept))

    @cached_property
    def path(self) -> Array:
        """[path.NAMES] Shape of the mean spectra."""
        found = path.measure(self.outlines)
        return np.array([found[name] for name in path.NAMES])

    @cached_property
    def alone(self) -> Whole:
        """These records, asked together and without any others."""
        return Whole(self.outlines)

    def faults(self) -> NDArray[np.str_]:
        """[records] Fault of each, "" when unknown."""
        return np.array([c.fault or "" for c in self.conditions])


def measure(records: Iterable[Record], frame: Frame, grid: Grid) -> Measured:
    """Measure every signature and every view of every record, one record at a time.

    Parameters
    ----------
    records : iterable of Record
    frame : Frame
    grid : Grid
        One and the same for sets that are to be compared.
    """
    values: list[Array] = []
    outlines: list[Outline] = []

    def seen() -> Iterator[RecordView]:
        for record in records:
            view = RecordView(record.samples, record.condition, frame)
            values.append(signatures.measure(view))
            outlines.append(outline_of(view))
            yield view

    views = measure_views(seen(), grid)
    return Measured(np.array(values), tuple(outlines), views)


@cache
def feature_names() -> tuple[str, ...]:
    """Names of what `compare` returns, in its order."""
    names: list[str] = []
    for strikes in GROUPS:
        own = [name for name, of in zip(signatures.NAMES, _of_strikes(), strict=True) if of == strikes]
        names += [f"{n}|{group}.{kind}" for group in GROUPS[strikes] for kind in ("diff", "z", "level") for n in own]
    courses_of = ("spread", "on_speed", "on_speed.z", "on_time", "on_time.z")
    names += [f"{name}|{kind}" for kind in courses_of for name in signatures.NAMES]
    names += [f"shape|{name}" for name in background.COMPARED]
    names += [f"answer|{name}" for name in answer.COMPARED]
    names += [f"change|{name}" for name in change.NAMES]
    names += [f"view|{name}" for name in _viewed()]
    names += [f"path|{name}" for name in path.NAMES] + [f"path|{name}.diff" for name in path.NAMES]
    return (*names, *whole.feature_names(), *(f"context|{name}" for name in CONTEXT))


def compare(
    real: Measured,
    simulated: Measured,
    speeds: Speeds | None,
    of_whole: Array,
    *,
    own: bool = False,
    models: bool = False,
) -> Array:
    """[features] What tells the measured set from the simulated one; see `feature_names`.

    Parameters
    ----------
    real, simulated : Measured
    speeds : Speeds or None
        Of calibration, which tell of the cage's slip.
    of_whole : Array
        What `whole.compare` says: of these records, or of all that there are, these among them.
    own : bool
        Whether the simulator is the machine's own: then nothing had to be matched, and small differences mean more.
    models : bool
        Whether the twin has effects as given, which the machine may have in another form.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # means of nothing are NaN, and meant so
        blocks = [*_by_group(real, simulated), _spread(real, simulated), *_trends(real, simulated)]
        per_signature = np.concatenate(blocks)
        ours, theirs = cast(Any, real.outlines), cast(Any, simulated.outlines)  # all that shapes ask of a view
        shapes = background.compare(ours, theirs)
        shape = np.array([shapes[name] for name in background.COMPARED], float)
        answers = answer.compare(real.alone.struck, simulated.alone.struck, real.alone.noise - simulated.alone.noise)
        told = np.array([answers[name] for name in answer.COMPARED], float)
        changes = change.compare(real.outlines, simulated.outlines, own=own)
        changed = np.array([changes[name] for name in change.NAMES], float)
        context, apart = _context(real, speeds, own, models), _apart(real.views, simulated.views)
        context = np.concatenate((context, _slip(real, simulated)))
        paths = (real.path, real.path - simulated.path)
        out = np.concatenate(
            (per_signature, shape, told, changed, apart, *paths, of_whole, context, _extent(per_signature))
        )
    return np.where(np.isfinite(out), out, np.nan)


@cache
def _viewed() -> tuple[str, ...]:
    """Names of the distances: over all views, of each view, and of each kind of bins in a view that has several."""
    names = ["overall", *DOMAINS]
    for domain, axis in Grid(1e4, 40.0, 20.0, 1.0).axes.items():
        kinds = tuple(dict.fromkeys(axis.kind))
        names += [f"{domain}_{kind}" for kind in kinds if len(kinds) > 1]
    return tuple(names)


def _apart(real: Views, simulated: Views) -> Array:
    """[_viewed] Distances in standard deviations between records, as reports have them, but negative where the square
    is: the least of what chance makes of no distance at all."""
    pair = Paired(real, [simulated])
    square = pair.over_strata(pair.squares())[0]
    found: dict[str, float] = {}
    for domain, axis in real.axes.items():
        own, kinds = square[real.columns(domain)], np.array(axis.kind)
        found[domain] = float(own @ axis.weight)
        found |= {f"{domain}_{kind}": float(own[kinds == kind].mean()) for kind in dict.fromkeys(axis.kind)}
    found["overall"] = float(np.mean([found[domain] for domain in real.domains]))
    values = np.array([found[name] for name in _viewed()])
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))


@cache
def _of_strikes() -> Mask:
    """[signatures] Which of them are measured on the strikes of a defect."""
    return np.array([name.startswith(("events.", "answer.")) for name in signatures.NAMES])


def _by_group(real: Measured, simulated: Measured) -> list[Array]:
    """Difference of means, the same in standard errors, and the measured mean: [signatures] each, group by group."""
    columns = []
    ours, theirs = real.faults(), simulated.faults()
    paired = len(theirs) == len(ours) and bool((ours == theirs).all())
    for strikes, groups in GROUPS.items():
        own = _of_strikes() == strikes
        for group in groups:
            r = real.values[_belongs(ours, group)][:, own]
            b = simulated.values[_belongs(theirs, group)][:, own]
            if len(r) == 0 or len(b) == 0:
                columns += [np.full(int(own.sum()), np.nan)] * 3
                continue
            mean_r, mean_b = np.nanmean(r, axis=0), np.nanmean(b, axis=0)
            n_r, n_b = np.isfinite(r).sum(axis=0), np.isfinite(b).sum(axis=0)
            # Two records of a kind say little of their spread: a hundredth of the level keeps z finite.
            small = 1e-3 + 0.01 * np.abs(mean_b)
            within = np.nansum((r - mean_r) ** 2, axis=0) + np.nansum((b - mean_b) ** 2, axis=0)
            variance = within / np.maximum(n_r + n_b - 2, 1) + small**2
            diff = mean_r - mean_b
            t = diff / np.sqrt(variance * (1 / np.maximum(n_r, 1) + 1 / np.maximum(n_b, 1)))
            z = normal(t, n_r + n_b - 2)
            if paired:
                z = _paired(r - b, ours[_belongs(ours, group)], small, z)
            columns += [diff, z, known_medians(r)]  # a median: one wrong line is no level
    return columns


def _paired(differences: Array, kinds: NDArray[np.str_], small: Array, otherwise: Array) -> Array:
    """[signatures] Normal deviates of the mean difference between records and simulated ones of the same conditions.

    What speed and fault do to a signature is in both of a pair, and does not widen the error. With too few pairs,
    `otherwise`.
    """
    seen = np.isfinite(differences)
    count, free, squares = seen.sum(axis=0), seen.sum(axis=0), np.zeros(differences.shape[1])
    for kind in np.unique(kinds):
        own = differences[kinds == kind]
        squares += np.nansum((own - np.nanmean(own, axis=0)) ** 2, axis=0)
        free = free - seen[kinds == kind].any(axis=0)
    error = np.sqrt((squares / np.maximum(free, 1) + small**2) / np.maximum(count, 1))
    found = normal(np.nanmean(differences, axis=0) / error, free)
    return np.where(free >= _FEWEST_FREE, found, otherwise)


def _belongs(faults: NDArray[np.str_], group: str) -> Mask:
    if group == "all":
        return np.ones(faults.size, bool)
    return np.asarray((faults != "healthy") if group == "faulty" else (faults == group))


def _spread(real: Measured, simulated: Measured) -> Array:
    """[signatures] Log ratio of the spread between records of one kind."""
    out = []
    for measured in (real, simulated):
        residual, kinds = measured.values.copy(), measured.faults()
        for kind in np.unique(kinds):
            residual[kinds == kind] -= np.nanmean(residual[kinds == kind], axis=0)
        out.append(np.log(np.nanstd(residual, axis=0) + 1e-3))
    return np.asarray(out[0] - out[1])


def _trends(real: Measured, simulated: Measured) -> list[Array]:
    """Slope of measured less simulated over log speed and over time (run = 1), and its t value: [signatures] each."""
    residual = real.values.copy()
    ours, theirs = real.faults(), simulated.faults()
    paired = len(theirs) == len(ours) and bool((ours == theirs).all())
    for kind in np.unique(ours):
        mask = ours == kind
        if paired:
            residual[mask] -= simulated.values[mask]
    return [column for x in courses(real.conditions) for column in slope(x, residual, ours)]


def _extent(per_signature: Array) -> Array:
    """How far the sets lie apart whatever the signature: the largest of |z|, one after the other, and their mean."""
    z = np.sort(np.abs(per_signature[_z_places()]))
    z = z[np.isfinite(z)][::-1]
    if z.size == 0:
        return np.full(6, np.nan)
    return np.array([*(np.log1p(z[min(k, z.size - 1)]) for k in (0, 3, 12, 40, 120)), np.log1p(np.mean(z**2))])


@cache
def _z_places() -> NDArray[np.int64]:
    return np.array([i for i, name in enumerate(feature_names()) if name.endswith(".z") and "|on_" not in name])


def _context(real: Measured, of: Speeds | None, own: bool, models: bool) -> Array:
    """What every feature's scatter depends on, and what calibration found of the speeds."""
    conditions = real.conditions
    times = [c.time_s for c in conditions if c.time_s is not None]
    speeds = np.array([c.speed_rpm for c in conditions])
    return np.array(
        [
            np.log(len(conditions)),
            np.mean([c.fault == "healthy" for c in conditions]),
            np.log(np.mean([c.n_samples for c in conditions])),
            np.log(np.mean([c.duration_s * c.speed_rpm / 60 for c in conditions])),
            np.log(speeds.max() / speeds.min()),
            np.log1p(max(times) - min(times)) if times else np.nan,
            float(own),
            float(models),
            *(_speeds(of) if of is not None else [np.nan] * 8),
        ]
    )


def _slip(real: Measured, simulated: Measured) -> Array:
    """Slip of the cage that faults' rates show beyond the simulator's, its size, what it leaves of them, and the part
    by which rollers' spin moves.

    Each fault's rate has its own share in a slip (BPFO moves one way, BPFI the other), so one number has to explain
    both races. A roller's is asked only where one of these is not there: its spin is not settled by the cage. The size
    is logarithmic; with one fault nothing is known.
    """
    bearing, rate = real.outlines[0].frame.bearing, signatures.NAMES.index("events.rate_log_ratio")
    slipped = bearing.slipped(1 - _SMALL_SLIP)
    shown = {}
    for fault in ("outer", "inner", "ball"):
        ours, theirs = (np.nanmedian(of.values[of.faults() == fault, rate]) for of in (real, simulated))
        if np.isfinite(ours - theirs):
            shown[fault] = ours - theirs
    if len(shown) < 2:
        return np.full(4, np.nan)
    shares = {fault: np.log(slipped[fault] / bearing.fault_order(fault)) / _SMALL_SLIP for fault in shown}
    races = [fault for fault in shown if fault != "ball" or len(shown) == 2]
    share, of_all = (np.array([values[fault] for fault in races]) for values in (shares, shown))
    slip = float(share @ of_all) / float(share @ share)
    rest = float(np.sqrt(np.mean((of_all - slip * share) ** 2)))
    settled = len(shown) == 3 and abs(slip) > _SMALL_SLIP
    spin = float(np.clip(shown["ball"] / (slip * shares["ball"]), -3, 3)) if settled else np.nan
    return np.array([slip, np.log(abs(slip) + 1e-4), np.log(rest + 1e-4), spin])


def _speeds(of: Speeds) -> list[float]:
    known = np.isfinite(of.slip_sigma) and of.slip_sigma > 0
    error = np.log(max(of.common_ratio, 1e-3))
    return [
        of.slip,
        of.slip / of.slip_sigma if known else np.nan,
        float(of.decidable),
        error / of.common_sigma if np.isfinite(of.common_sigma) and of.common_sigma > 0 else np.nan,
        of.scatter,
        of.slip_free if known else np.nan,
        of.slip_free / of.slip_sigma if known else np.nan,
        of.slip_evidence if known else np.nan,
    ]
