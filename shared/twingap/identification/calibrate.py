"""Calibration of a twin to records before they are compared: differences that it removes are not part of the gap.

records --split by group--> fit part, held-out part
both    --lines-----------> true speeds                        (`identify.speed`)
fit     --spectra---------> the twin's free parameters         (`identify`, without its intervals)
fit     --mode, level-----> Frame: bearing, band, amplitude scale
twin with more effects --spectra of its records and of the fit part--> new baseline (`match_baseline`)

All reported results are computed on the held-out part. Pooled features, which calibration hardly affects, are computed
on both parts: trends of levels within a fault, lines of many records, the comb of entry-exit impacts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import FAULTS, Bearing
from twingap.errors import TwingapError
from twingap.identification.baseline import Key, match_baseline
from twingap.identification.impact_band import impact_hz, mode_band
from twingap.identification.phenomenological import quick_identify
from twingap.identification.speed import Speeds, estimate_speeds
from twingap.identification.speed_reading import comb_heights
from twingap.identification.user_model import levelled
from twingap.records import Condition, RecordSet
from twingap.signal import most_impulsive_band
from twingap.signal.record_transforms import Frame
from twingap.twins.twin_file import TwinSpec, build_twin, flat, in_unit

Array = NDArray[np.float64]

MOST_FIT: Final = 12
"""Most records of each state from which parameters are identified: more are slower and hardly more accurate."""
MOST_LEVELLED: Final = 6
"""Most records of each state from which the level of a user's model is matched: more are slower and more accurate."""
CLEAR_COMB: Final = 6.0
"""Height of a fault's comb (see `speed_reading.COMB`) from which a record of unknown state is assigned to that fault;
a larger value assigns weak faults to the healthy state."""


@dataclass(frozen=True)
class Calibrated:
    """Records and the calibrated twin, ready for comparison.

    Parameters
    ----------
    fit, held_out : RecordSet
        With corrected speeds; the bearing is known in both.
    spec : TwinSpec or None
        With every parameter that the fit part identifies; None for a user's simulated records.
    frame : Frame
    speeds : Speeds
        Speeds of all records kept, in the order of `names`.
    names : tuple[str, ...]
        Records kept.
    shared : tuple[str, ...]
        Records that are in both parts, since their fault has one group only.
    aside : tuple[str, ...]
        Records left out, as their fault is unknown.
    notes : tuple[str, ...]
        Steps taken and undecidable questions, for the report.
    """

    fit: RecordSet
    held_out: RecordSet
    spec: TwinSpec | None
    frame: Frame
    speeds: Speeds
    names: tuple[str, ...]
    shared: tuple[str, ...]
    aside: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Prepared:
    """Records ready to calibrate a twin with: speeds corrected, split into a fit part and a held-out part.

    Fields as in `Calibrated`.
    """

    fit: RecordSet
    held_out: RecordSet
    speeds: Speeds
    names: tuple[str, ...]
    shared: tuple[str, ...]
    aside: tuple[str, ...]
    notes: tuple[str, ...]


def calibrate(
    records: RecordSet, spec: TwinSpec | None, rng: np.random.Generator, *, sim: RecordSet | None = None
) -> Calibrated:
    """Calibrate a twin: split the records, correct their speeds and identify the twin's free parameters.

    Parameters
    ----------
    records : RecordSet
        Measured records.
    spec : TwinSpec or None
        The twin; None with `sim`.
    rng : numpy.random.Generator
        Assigns groups to parts.
    sim : RecordSet, optional
        The user's simulated records: then no parameter is identified.

    Returns
    -------
    Calibrated

    Raises
    ------
    TwingapError
        When the bearing is unknown, or records cannot be read.
    """
    return calibrate_prepared(prepare(records, spec, rng, sim=sim), None if sim is not None else spec, rng)


def prepare(
    records: RecordSet,
    spec: TwinSpec | None,
    rng: np.random.Generator,
    *,
    sim: RecordSet | None = None,
    fitted: Callable[[Condition], bool] | None = None,
) -> Prepared:
    """Check the records, correct their speeds and split them: the part of `calibrate` that needs no twin model.

    Other parameters and errors are those of `calibrate`.

    Parameters
    ----------
    fitted : callable, optional
        Whether a record belongs to the fit part, for a split of one's own; None for `split_parts`.
    """
    bearing = records.bearing or (spec.bearing if spec is not None else None) or (sim.bearing if sim else None)
    if bearing is None:
        raise TwingapError(
            "the bearing is not known",
            where=f"record set {records.name!r}",
            mend="add [bearing] to recordset.toml or to the twin file",
        )
    if spec is None and sim is None:
        raise TwingapError(
            "neither a twin nor simulated records are given", mend="give a twin file, or records to --sim"
        )
    _refuse_unreadable(records)
    notes: list[str] = []
    if sim is not None:
        _refuse_unreadable(sim, "simulated record")
    known, aside = _known(records, bearing, notes)
    if sim is not None:
        known, others = _simulated_too(known, sim, notes)
        aside = (*aside, *others)
    speeds = estimate_speeds(known, bearing)
    notes += speeds.notes
    known = _with_bearing(speeds.corrected(known), bearing)
    fit, held_out, shared = split_parts(known, rng, notes) if fitted is None else stated_parts(known, fitted)
    return Prepared(fit, held_out, speeds, tuple(c.name for c in known.conditions), shared, aside, tuple(notes))


def calibrate_prepared(prepared: Prepared, spec: TwinSpec | None, rng: np.random.Generator) -> Calibrated:
    """Identify the twin's free parameters on the fit part; with `spec` None (simulated records) only the frame.

    `rng` is in the state in which `prepare` left it, or a copy of that.
    """
    fit, notes = prepared.fit, list(prepared.notes)
    assert fit.bearing is not None  # `prepare` sets it
    identified = None
    if spec is not None:
        identified, frame = _identified(in_unit(spec, fit.unit), fit, fit.bearing, rng, notes)
    else:
        frame = _frame(fit, fit.bearing, rng)
    return Calibrated(
        fit, prepared.held_out, identified, frame, prepared.speeds, prepared.names, prepared.shared, prepared.aside,
        tuple(notes),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- records


def _refuse_unreadable(records: RecordSet, what: str = "record") -> None:
    for record in records:
        where = f"{what} {record.condition.name!r}"
        if record.samples.size < 256:
            raise TwingapError(
                f"{record.samples.size} samples found, at least 256 expected", where=where, mend="bring longer records"
            )
        if not np.isfinite(record.samples).all():
            raise TwingapError("a sample is not a finite number", where=where, mend="remove or repair the record")
        if not np.ptp(record.samples) > 0:
            raise TwingapError("all samples are equal", where=where, mend="remove the record")


def _with_bearing(records: RecordSet, bearing: Bearing) -> RecordSet:
    """The same records with the bearing set."""
    return RecordSet(records.name, records.unit, bearing, records.conditions, lambda i: records[i].samples)


def _known(records: RecordSet, bearing: Bearing, notes: list[str]) -> tuple[RecordSet, tuple[str, ...]]:
    """Records of known state (where no state is known, as read from envelopes), and the names of the others."""
    unknown = [i for i, c in enumerate(records.conditions) if c.fault is None]
    if not unknown:
        return records, ()
    if len(unknown) < len(records):
        names = tuple(records.conditions[i].name for i in unknown)
        notes.append(f"{len(names)} records of unknown fault were left out: a twin can simulate named faults only")
        left = set(unknown)
        return records.take(i for i in range(len(records)) if i not in left), names
    found: list[str] = []
    for record in records:
        heights = comb_heights(record.samples, record.condition, bearing)
        fault = max(heights, key=lambda name: heights[name])
        found.append(fault if heights[fault] > CLEAR_COMB else "healthy")
    counts = {fault: found.count(fault) for fault in FAULTS if fault in found}
    if set(counts) == {"healthy"}:
        notes.append(
            "no record states its fault, and none has a fault's comb: all were assumed healthy; impacts "
            "cannot be compared"
        )
    else:
        counted = ", ".join(f"{number} {fault}" for fault, number in counts.items())
        notes.append(
            f"no record names its fault: faults were read off the strongest comb of the envelopes ({counted}); "
            "a comb moved by slip or wrong speed onto another fault's place, or a fault without a comb, would be "
            "mistaken"
        )
    conditions = [replace(c, fault=fault) for c, fault in zip(records.conditions, found, strict=True)]
    return RecordSet(records.name, records.unit, records.bearing, conditions, lambda i: records[i].samples), ()


def _simulated_too(records: RecordSet, sim: RecordSet, notes: list[str]) -> tuple[RecordSet, tuple[str, ...]]:
    """Records of faults that the simulated set contains too, and the names of the others; all if it contains none."""
    made = {c.fault for c in sim.conditions}
    kept = [i for i, c in enumerate(records.conditions) if c.fault in made]
    if not kept or len(kept) == len(records):
        return records, ()
    left = [c for c in records.conditions if c.fault not in made]
    faults = ", ".join(dict.fromkeys(str(c.fault) for c in left))
    notes.append(f"no simulated record of {faults}: {len(left)} real records of it are left aside")
    return records.take(kept), tuple(c.name for c in left)


def split_parts(
    records: RecordSet, rng: np.random.Generator, notes: list[str]
) -> tuple[RecordSet, RecordSet, tuple[str, ...]]:
    """Fit part, held-out part and names of records in both: groups whole, every fault and its speeds in each part.

    Groups of one fault are sorted by speed (then load and time) and taken in threes, of which a random one goes to the
    fit part: identification of a few parameters needs fewer records than a decision. Of two groups, one goes to each
    part. Where every fault would give one group, one fault of three or four gives two with distant speeds, since speed
    dependence is identifiable only for a fault recorded at two speeds. A fault with one group is in both parts, which
    is added to `notes`.
    """
    groups: dict[str, list[int]] = {}
    for place, condition in enumerate(records.conditions):
        groups.setdefault(str(condition.group), []).append(place)
    if len(groups) == 1:
        notes.append(
            "all records are of one group: the twin was calibrated on the records it is compared with, so the gap "
            "may be underestimated"
        )
        return records, records, tuple(c.name for c in records.conditions)
    faults = {g: frozenset(str(records.conditions[i].fault) for i in places) for g, places in groups.items()}
    parts: tuple[list[int], list[int]] = ([], [])
    shared: list[str] = []
    by_fault: dict[frozenset[str], list[str]] = {}
    for group, own in faults.items():
        by_fault.setdefault(own, []).append(group)

    def key(group: str) -> tuple[float, ...]:
        own = [records.conditions[i] for i in groups[group]]
        values = np.array([(c.speed_rpm, c.load_n or 0.0, c.time_s or 0.0) for c in own]).mean(axis=0)
        return tuple(values.tolist())

    held = [set[str](), set[str]()]
    lone: list[str] = []
    spare = int(rng.integers(2))
    # Faults before healthy: the first with enough groups gets two speeds in the fit part.
    in_order = sorted(by_fault.items(), key=lambda item: item[0] == {"healthy"})
    spanned = any(len(own_groups) > 4 for own, own_groups in in_order if own != {"healthy"})
    for own, own_groups in in_order:
        ordered = sorted(own_groups, key=key)
        if len(ordered) == 1:
            lone += ordered
            continue
        spans = not spanned and own != {"healthy"} and len(ordered) in (3, 4)
        spanned = spanned or spans
        fitted = {ordered[turn] for turn in _fitted(len(ordered), spans, rng)}
        for group in ordered:
            part = 0 if group in fitted else 1
            parts[part].extend(groups[group])
            held[part] |= faults[group]
    for group in lone:
        missing = [part for part in (0, 1) if not faults[group] <= held[part]]
        # The group goes to each part that lacks one of its faults; if neither does, to the spare part.
        for part in missing or [spare]:
            parts[part].extend(groups[group])
        if not missing:
            spare = 1 - spare
        if len(missing) == 2:
            shared += [records.conditions[i].name for i in groups[group]]
    if shared:
        kinds = sorted({str(c.fault) for c in records.conditions if c.name in set(shared)})
        notes.append(
            f"records of {', '.join(kinds)} are of one group each: {len(shared)} records are in both the part that "
            "calibrates the twin and the part that it is compared with"
        )
    if not parts[0] or not parts[1]:
        full = parts[0] or parts[1]
        parts = (full, full)
    return records.take(sorted(parts[0])), records.take(sorted(parts[1])), tuple(shared)


def stated_parts(
    records: RecordSet, fitted: Callable[[Condition], bool]
) -> tuple[RecordSet, RecordSet, tuple[str, ...]]:
    """Fit part, held-out part and names of records in both (none), as `fitted` assigns the records.

    Raises
    ------
    TwingapError
        For an empty part, or a group with records in both.
    """
    chosen = [fitted(condition) for condition in records.conditions]
    parts = [[i for i, own in enumerate(chosen) if own is side] for side in (True, False)]
    if not all(parts):
        raise TwingapError("the split leaves one part without records", where=f"record set {records.name!r}")
    fit, held_out = (records.take(places) for places in parts)
    if common := fit.common_groups(held_out):
        raise TwingapError(f"the split puts records of {', '.join(sorted(common))} in both parts")
    return fit, held_out, ()


def _fitted(count: int, spans: bool, rng: np.random.Generator) -> list[int]:
    """Indices of the fit part's groups among a fault's `count`; with `spans`, two distant ones of three or four."""
    if spans:
        first = int(rng.integers(count - 2))
        return [first, first + 2]
    # A single group at the end goes to the held-out part.
    blocks = [(begin, min(3, count - begin)) for begin in range(0, count, 3)]
    return [begin + int(rng.integers(size)) for begin, size in blocks if size > 1]


def thinned(records: RecordSet, most: int = MOST_FIT) -> RecordSet:
    """At most `most` records of each state, evenly spaced over its speeds."""
    by_fault: dict[str | None, list[int]] = {}
    for place, condition in enumerate(records.conditions):
        by_fault.setdefault(condition.fault, []).append(place)
    kept: list[int] = []
    for places in by_fault.values():
        if len(places) > most:
            ordered = sorted(places, key=lambda i: (records.conditions[i].speed_rpm, i))
            places = [ordered[i] for i in np.linspace(0, len(ordered) - 1, most).round().astype(int)]
        kept += places
    return records.take(sorted(kept))


# --------------------------------------------------------------------------------------------------------------- frame


def healthy_rms(records: RecordSet) -> float | None:
    """RMS about the mean of healthy records; None without any."""
    own = [r.samples.var() for r in thinned(records) if r.condition.fault == "healthy"]
    return float(np.sqrt(np.mean(own))) if own else None


def _frame(records: RecordSet, bearing: Bearing, rng: np.random.Generator) -> Frame:
    """Frame from records alone: the band of their dominant mode, and healthy RMS."""
    own = thinned(records, 6)
    scale = healthy_rms(records)
    if scale is None:  # without healthy records, that of the quietest record
        scale = float(np.sqrt(min(r.samples.var() for r in own)))
    try:
        found, _ = quick_identify(TwinSpec("phenomenological", bearing=bearing), own, rng, impacts=False)
    except TwingapError:
        return Frame(bearing, _impulsive_band(own, bearing), scale)
    given = flat(found.parameters)
    return Frame(bearing, mode_band(given["resonance_hz"], given["damping_ratio"], own.conditions, bearing), scale)


def _impulsive_band(records: RecordSet, bearing: Bearing) -> tuple[float, float]:
    """Band of the highest kurtosis over all records, Hz; at least as wide as the impact rate requires."""
    found = []
    for record in records:
        condition = record.condition
        widest = 3 * impact_hz(condition, bearing)
        level = int(math.log2(min(max(condition.fs_hz / 2 / widest, 2.0), condition.n_samples / 128)))
        (best,) = most_impulsive_band(record.samples, condition.fs_hz, max_level=max(level, 1))
        found.append((best.kurtosis, best.low_hz, best.high_hz))
    _, low, high = max(found)
    top = min(c.fs_hz for c in records.conditions) / 2
    return (low, min(high, top)) if low < 0.9 * top else (0.1 * top, 0.9 * top)


# ---------------------------------------------------------------------------------------------------------- parameters


def _identified(
    spec: TwinSpec, fit: RecordSet, bearing: Bearing, rng: np.random.Generator, notes: list[str]
) -> tuple[TwinSpec, Frame]:
    """The twin with its free parameters identified on the fit part, and the matching frame."""
    if spec.model == "phenomenological":
        found, more = quick_identify(spec, thinned(fit), rng)
        notes += more
        given = flat(found.parameters)
        band = mode_band(given["resonance_hz"], given["damping_ratio"], fit.conditions, bearing)
        frame = Frame(bearing, band, healthy_rms(fit) or build_twin(found, bearing, fit.unit).reference_rms)
        if found.effects:
            found = match_baseline(found, thinned(fit, 6), frame, rng, free=spec)
            given = flat(found.parameters)
            band = mode_band(given["resonance_hz"], given["damping_ratio"], fit.conditions, bearing)
            frame = Frame(bearing, band, frame.scale)
        return found, frame
    frame = _frame(fit, bearing, rng)
    if spec.model == "contact":
        from twingap.identification import identify

        outcome = identify(thinned(fit), spec, seed=rng)
        notes += outcome.notes
        return outcome.spec, frame
    return levelled(spec, thinned(fit, MOST_LEVELLED), rng, notes)[0], frame


def recalibrate(
    calibrated: Calibrated,
    spec: TwinSpec,
    rng: np.random.Generator,
    *,
    free: TwinSpec | None = None,
    steps: int = 4,
    dampings: Sequence[float] = (0.04,),
    known: dict[Key, Array] | None = None,
) -> Calibrated:
    """The same parts with a twin with further effects, its baseline matched to the fit part again.

    Parameters
    ----------
    calibrated : Calibrated
    spec : TwinSpec
        The calibrated twin with further effects and their parameters.
    free : TwinSpec, optional
        The user's twin, whose fixed parameters stay; None leaves all baseline parameters free.
    steps, dampings, known
        As in `match_baseline`.

    Returns
    -------
    Calibrated
    """
    if spec.model != "phenomenological":
        return replace(calibrated, spec=spec)
    fit, frame = thinned(calibrated.fit, 6), calibrated.frame
    matched = match_baseline(spec, fit, frame, rng, steps, free=free, dampings=dampings, known=known)
    return replace(calibrated, spec=matched)
