"""Calibrate first: what calibration removes is no gap.

records --split by group--> fit part, held-out part
both    --lines-----------> true speeds                        (`gap.speed`)
fit     --spectra---------> the twin's free parameters         (`identify`, without its intervals)
fit     --mode, level-----> Frame: bearing, band, yardstick    (`gap.view`)
twin with more effects --spectra of its own records against the fit part's--> baseline anew (`match_baseline`)

Everything that a diagnosis reports is measured on the held-out part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import FAULTS, Bearing
from twingap.effects import Stage, catalogue
from twingap.errors import TwingapError
from twingap.gap.speed import Speeds, comb_heights, estimate_speeds
from twingap.gap.view import Frame
from twingap.records import Condition, Record, RecordSet
from twingap.streams import root_entropy
from twingap.twins.twin_file import TwinSpec, build_twin, flat, nested

Array = NDArray[np.float64]

MOST_FIT: Final = 12
"""Records of each state that parameters are read from: more hardly sharpen them."""
SEGMENT_S: Final = 0.08
"""Aimed length of a segment, s: half of what `identify` takes, at a third of its time."""
CLEAR_COMB: Final = 6.0
"""Height of a fault's comb (see `speed.COMB`) from which a record of unknown state is taken to have that fault."""


@dataclass(frozen=True)
class Calibrated:
    """Records and twin, ready to be compared.

    Parameters
    ----------
    fit, held_out : RecordSet
        With corrected speeds; the bearing is known in both.
    spec : TwinSpec or None
        With every parameter that the fit part shows; None for a user's simulated records.
    frame : Frame
    speeds : Speeds
        Of all records kept, in the order of `names`.
    names : tuple[str, ...]
        Records kept.
    shared : tuple[str, ...]
        Records that stand in both parts, since their fault has one group only.
    aside : tuple[str, ...]
        Records left out, their fault unknown.
    notes : tuple[str, ...]
        What was done and what cannot be decided, for people.
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


def calibrate(
    records: RecordSet, spec: TwinSpec | None, rng: np.random.Generator, *, sim: RecordSet | None = None
) -> Calibrated:
    """Split, correct speeds, and identify what the twin leaves free.

    Parameters
    ----------
    records : RecordSet
        Real ones.
    spec : TwinSpec or None
        The twin; None with `sim`.
    rng : numpy.random.Generator
        Deals out groups.
    sim : RecordSet, optional
        The user's simulated records: nothing is identified then.

    Returns
    -------
    Calibrated

    Raises
    ------
    TwingapError
        When nobody knows the bearing, or records cannot be read.
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
    known, aside = _known(records, bearing, notes)
    speeds = estimate_speeds(known, bearing)
    notes += speeds.notes
    known = _with_bearing(speeds.corrected(known), bearing)
    fit, held_out, shared = split_parts(known, rng, notes)
    identified = None
    if spec is not None and sim is None:
        identified, frame = _identified(spec, fit, bearing, rng, notes)
    else:
        frame = _frame(fit, bearing, rng)
    return Calibrated(
        fit, held_out, identified, frame, speeds, tuple(c.name for c in known.conditions), shared, aside, tuple(notes)
    )


# ------------------------------------------------------------------------------------------------------------- records


def _refuse_unreadable(records: RecordSet) -> None:
    for record in records:
        where = f"record {record.condition.name!r}"
        if record.samples.size < 256:
            raise TwingapError(
                f"{record.samples.size} samples found, at least 256 expected", where=where, mend="bring longer records"
            )
        if not np.isfinite(record.samples).all():
            raise TwingapError("a sample is not a finite number", where=where, mend="remove or repair the record")
        if not np.ptp(record.samples) > 0:
            raise TwingapError("all samples are equal", where=where, mend="remove the record")


def _with_bearing(records: RecordSet, bearing: Bearing) -> RecordSet:
    """The same records, their bearing known."""
    return RecordSet(records.name, records.unit, bearing, records.conditions, lambda i: records[i].samples)


def _known(records: RecordSet, bearing: Bearing, notes: list[str]) -> tuple[RecordSet, tuple[str, ...]]:
    """Records whose state is known or, where none is, what their envelopes say it is; and the names of the others."""
    unknown = [i for i, c in enumerate(records.conditions) if c.fault is None]
    if not unknown:
        return records, ()
    if len(unknown) < len(records):
        names = tuple(records.conditions[i].name for i in unknown)
        notes.append(
            f"{len(names)} records of unknown fault were left aside: a twin cannot simulate a fault that nobody names"
        )
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
            "no record says what fault it is of, and none shows a fault's comb: all were taken to be healthy; impacts "
            "cannot be compared"
        )
    else:
        told = ", ".join(f"{number} {fault}" for fault, number in counts.items())
        notes.append(
            f"no record says what fault it is of: faults were read off the strongest comb of the envelopes ({told}); "
            "a comb moved by slip or wrong speed onto another fault's place, or a fault without a comb, would be "
            "mistaken"
        )
    conditions = [replace(c, fault=fault) for c, fault in zip(records.conditions, found, strict=True)]
    return RecordSet(records.name, records.unit, records.bearing, conditions, lambda i: records[i].samples), ()


def split_parts(
    records: RecordSet, rng: np.random.Generator, notes: list[str]
) -> tuple[RecordSet, RecordSet, tuple[str, ...]]:
    """Fit part, held-out part and the names of records in both: groups whole, every fault and its speeds in each part.

    Groups of one fault are sorted by speed (then load and time) and dealt out in pairs, by lot within a pair. A fault
    with one group only stands in both parts, which `notes` say.
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
    for own_groups in by_fault.values():
        ordered = sorted(own_groups, key=key)
        if len(ordered) == 1:
            lone += ordered
            continue
        for pair in range(0, len(ordered), 2):
            first = int(rng.integers(2))
            both = ordered[pair : pair + 2]
            if len(both) == 1:  # the odd one out goes where the last odd one did not
                first, spare = spare, 1 - spare
            for turn, group in enumerate(both):
                part = (first + turn) % 2
                parts[part].extend(groups[group])
                held[part] |= faults[group]
    for group in lone:
        missing = [part for part in (0, 1) if not faults[group] <= held[part]]
        # Where one part has these faults from other groups, this group goes to the other; else it stands in both.
        for part in missing or [spare]:
            parts[part].extend(groups[group])
        if not missing:
            spare = 1 - spare
        if len(missing) == 2:
            shared += [records.conditions[i].name for i in groups[group]]
    if shared:
        kinds = sorted({str(c.fault) for c in records.conditions if c.name in set(shared)})
        notes.append(
            f"records of {', '.join(kinds)} are of one group each: {len(shared)} records stand in both the part that "
            "calibrates the twin and the part that it is compared with"
        )
    if not parts[0] or not parts[1]:
        full = parts[0] or parts[1]
        parts = (full, full)
    return records.take(sorted(parts[0])), records.take(sorted(parts[1])), tuple(shared)


def thinned(records: RecordSet, most: int = MOST_FIT) -> RecordSet:
    """At most `most` records of each state, evenly spread over its speeds."""
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
    """Band and yardstick from records alone: the band of their dominant mode, and healthy RMS."""
    own = thinned(records, 6)
    scale = healthy_rms(records)
    if scale is None:  # the quietest there is
        scale = float(np.sqrt(min(r.samples.var() for r in own)))
    try:
        found, _ = quick_identify(TwinSpec("phenomenological", bearing=bearing), own, rng, impacts=False)
    except TwingapError:
        return Frame(bearing, _impulsive_band(own, bearing), scale)
    given = flat(found.parameters)
    return Frame(bearing, mode_band(given["resonance_hz"], given["damping_ratio"], own.conditions, bearing), scale)


def _impulsive_band(records: RecordSet, bearing: Bearing) -> tuple[float, float]:
    """Band of the highest kurtosis, Hz, of the record where it is highest; wide enough for the impact rate."""
    from twingap.signal import most_impulsive_band

    found = []
    for record in records:
        condition = record.condition
        widest = 3 * _impact_hz(condition, bearing)
        level = int(math.log2(min(max(condition.fs_hz / 2 / widest, 2.0), condition.n_samples / 128)))
        (best,) = most_impulsive_band(record.samples, condition.fs_hz, max_level=max(level, 1))
        found.append((best.kurtosis, best.low_hz, best.high_hz))
    _, low, high = max(found)
    top = min(c.fs_hz for c in records.conditions) / 2
    return (low, min(high, top)) if low < 0.9 * top else (0.1 * top, 0.9 * top)


def mode_band(
    resonance_hz: float, damping_ratio: float, conditions: Sequence[Condition], bearing: Bearing
) -> tuple[float, float]:
    """Band in which impacts ring, Hz: the mode's, wide enough for envelopes to show the impact rate's harmonics."""
    top = min(c.fs_hz for c in conditions) / 2
    rate = float(np.median([_impact_hz(c, bearing) for c in conditions]))
    wanted = min(4 * rate, 0.2 * top)
    # A very broad mode is a poor fit to several: the band does not follow it.
    half = max(min(3 * damping_ratio * resonance_hz, 0.12 * top), wanted)
    low, high = resonance_hz - half, resonance_hz + half
    # A mode close to either end keeps the width of its band.
    begin, end = 0.02 * top, 0.98 * top
    low, high = (begin, min(begin + 2 * half, end)) if low < begin else (low, high)
    return (max(end - 2 * half, begin), end) if high > end else (low, high)


def _impact_hz(condition: Condition, bearing: Bearing) -> float:
    fault = condition.fault if condition.fault not in (None, "healthy", "cage") else "inner"
    return bearing.fault_order(str(fault)) * condition.speed_rpm / 60


# ---------------------------------------------------------------------------------------------------------- parameters


def _identified(
    spec: TwinSpec, fit: RecordSet, bearing: Bearing, rng: np.random.Generator, notes: list[str]
) -> tuple[TwinSpec, Frame]:
    """The twin with what the fit part shows, and the frame that goes with it."""
    if spec.model == "phenomenological":
        found, told = quick_identify(spec, thinned(fit), rng)
        notes += told
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
        from twingap.identify import identify

        outcome = identify(spec, thinned(fit), rng)
        notes += outcome.notes
        return outcome.spec, frame
    return _scaled(spec, fit, rng, notes), frame


def quick_identify(
    spec: TwinSpec, records: RecordSet, rng: np.random.Generator, *, impacts: bool = True
) -> tuple[TwinSpec, list[str]]:
    """The phenomenological twin's free parameters, as `identify` finds them but without its intervals.

    Parameters
    ----------
    spec : TwinSpec
        What it fixes stays.
    records : RecordSet
        Of known faults.
    rng : numpy.random.Generator
    impacts : bool
        False: impact amplitudes are left alone.

    Returns
    -------
    TwinSpec
        With all parameters.
    list of str
        What could not be found.
    """
    # The parts of identification below its intervals, which cost most of its time.
    from twingap.identify.phenomenological import _Amplitude, _is, _Problem
    from twingap.identify.spectra import spectra

    notes: list[str] = []
    root = root_entropy(rng)
    healthy = _is(records, "healthy")
    everything = np.ones(len(records), bool)
    baseline = healthy if healthy.any() else everything
    if not healthy.any():
        notes.append(
            "no healthy record: noise levels were read between the lines of the other records, and structure_noise_rms "
            "may hold part of the impacts' energy"
        )
    problem = _Problem(spec, records, spectra(records, SEGMENT_S), "whittle", ~everything)
    problem, fit = problem.begin(baseline, notes)
    values = dict(problem.values(fit))
    scale = problem.levels(fit)["scale"]
    for fault in FAULTS[1:] if impacts else ():
        name = f"impact_amplitude.{fault}"
        if name in problem.given:
            continue
        if not _is(records, fault).any():
            if fault in ("inner", "outer", "ball"):
                notes.append(f"no record of fault {fault!r}: its impact amplitude keeps the default")
            continue
        power = _Amplitude.of(problem, fault, fit, root).power(fit, healthy, everything) / scale**2
        values[name] = math.sqrt(max(power, 0.0))
    whole = flat(_all_parameters(spec)) | values
    return replace(spec, parameters=nested(flat(spec.parameters) | {k: float(v) for k, v in whole.items()})), notes


def _all_parameters(spec: TwinSpec) -> dict[str, Any]:
    """The model's parameters, defaults included."""
    import dataclasses

    from twingap.twins.twin_file import model_parameters

    return dataclasses.asdict(model_parameters(spec))


def _scaled(spec: TwinSpec, fit: RecordSet, rng: np.random.Generator, notes: list[str]) -> TwinSpec:
    """A model of the user's own: only its level is brought to the records', where it has a `scale`."""
    names = flat(_all_parameters(spec))
    if "scale" not in names or spec.given("scale"):
        notes.append(f"model {spec.model!r} has nothing to identify: its parameters are taken as they are")
        return spec
    from twingap.gap.simulator import TwinSimulator

    own = thinned(fit, 6)
    made = TwinSimulator(spec, own.bearing, own.unit).simulate((), own.conditions, root_entropy(rng), 0)
    pairs = [(r.samples.var(), m.samples.var(), r.condition.fault == "healthy") for r, m in zip(own, made, strict=True)]
    chosen = [p for p in pairs if p[2]] or pairs
    gain = math.sqrt(sum(p[0] for p in chosen) / max(sum(p[1] for p in chosen), 1e-300))
    level = float(names["scale"]) * gain
    notes.append(f"model {spec.model!r}: its level was brought to the records' by scale = {level:.4g}")
    return replace(spec, parameters=nested(flat(spec.parameters) | {"scale": level}))


def recalibrate(
    calibrated: Calibrated, spec: TwinSpec, rng: np.random.Generator, *, free: TwinSpec | None = None, steps: int = 4
) -> Calibrated:
    """The same parts with a twin that has further effects: its baseline is matched to the fit part anew.

    Parameters
    ----------
    calibrated : Calibrated
    spec : TwinSpec
        The calibrated twin with further effects and their parameters.
    free : TwinSpec, optional
        The user's twin: what it fixes stays. None leaves all baseline parameters free.
    steps : int
        As `match_baseline`.
    """
    if spec.model != "phenomenological":
        return replace(calibrated, spec=spec)
    fit = thinned(calibrated.fit, 6)
    return replace(calibrated, spec=match_baseline(spec, fit, calibrated.frame, rng, steps, free=free))


# ------------------------------------------------------------------------------------- the baseline under more effects

MOST_SIMULATED: Final = 4
"""Records of each state that are simulated to match a baseline."""
BANDS: Final = 128
"""Bands of the spectra that baselines are matched in."""


@dataclass(frozen=True)
class _Side:
    """Records of one state at one rate: mean power density in bands, tones left out."""

    fault: str
    fs_hz: float
    conditions: tuple[Condition, ...]
    psd: Array
    energy: float  # mean square in the frame's band


def match_baseline(
    spec: TwinSpec,
    fit_records: RecordSet,
    frame: Frame,
    rng: np.random.Generator,
    steps: int = 4,
    *,
    free: TwinSpec | None = None,
) -> TwinSpec:
    """Bring the baseline of a twin with effects to records, through the twin itself.

    The healthy spectrum is linear in two powers (structure noise, white noise; disturbances go with their sum), whose
    spectra are simulated with one of them alone; so they come by weighted non-negative least squares, for each of a few
    resonances and dampings around the present ones. Impacts come from the energy that they add in the band, found by
    fixed-point iteration. Random streams are the same throughout.

    Parameters
    ----------
    spec : TwinSpec
        Phenomenological, with all parameters and the effects.
    fit_records : RecordSet
        A few of each state do.
    frame : Frame
    rng : numpy.random.Generator
    steps : int
        Rounds; 0 leaves the mode alone and matches levels once.
    free : TwinSpec, optional
        What it fixes stays as it is.

    Returns
    -------
    TwinSpec
    """
    root = root_entropy(rng)
    fixed = set(flat(free.parameters)) if free is not None else set()
    values = {k: float(v) for k, v in flat(_all_parameters(spec)).items()}
    sides = _sides(list(fit_records), frame)
    quiet = [s for s in sides if s.fault == "healthy"]
    loud = [s for s in sides if s.fault != "healthy"]
    noise_free = not {"structure_noise_rms", "white_noise_rms", "scale"} & fixed
    matcher = _Matcher(spec, frame, fit_records.unit, root)
    if quiet:
        at, best_powers = _mode_search(matcher, quiet, values, fixed, steps)
        values["resonance_hz"], values["damping_ratio"] = at
        if noise_free:
            before = values["scale"]
            structure, white = np.sqrt(best_powers)
            scale = math.hypot(structure, white)
            if scale > 0:
                values.update(scale=scale, structure_noise_rms=structure / scale, white_noise_rms=white / scale)
                for fault in FAULTS[1:]:
                    name = f"impact_amplitude.{fault}"
                    if name in values and name not in fixed:
                        values[name] *= before / scale
    for _ in range(2 if steps else 1):
        for fault in sorted({s.fault for s in loud}):
            name = f"impact_amplitude.{fault}"
            if name in fixed:
                continue
            values[name] = matcher.amplitude(fault, [s for s in loud if s.fault == fault], values)
    return matcher.spec_with(values)


def _mode_search(
    matcher: _Matcher, quiet: Sequence[_Side], values: dict[str, float], fixed: set[str], steps: int
) -> tuple[tuple[float, float], Array]:
    """Resonance and damping that fit best, and the powers of structure and white noise that go with them.

    From the best of a few starts (where the fit of one mode to what further effects make is far off), along each axis
    in turn; a step that leads on is kept, one that does not is halved.
    """
    top = 0.49 * min(s.fs_hz for s in quiet)
    names = ("resonance_hz", "damping_ratio")
    free = [axis for axis in (0, 1) if names[axis] not in fixed]
    start = (values["resonance_hz"], values["damping_ratio"])

    def tried(point: tuple[float, float]) -> tuple[float, Array, tuple[float, float]]:
        inside = (float(np.clip(point[0], 0.01 * top, top)), float(np.clip(point[1], 1e-3, 0.45)))
        return (*matcher.noise(quiet, *inside, values), inside)

    best = tried(start)
    if steps and len(free) == 2:
        loudest = max(quiet, key=lambda s: len(s.conditions))
        smooth = np.convolve(loudest.psd[2:], np.ones(3) / 3, mode="same")
        peak = (int(np.argmax(smooth[: int(0.9 * smooth.size)])) + 2.5) / BANDS * loudest.fs_hz / 2
        best = min([best, *(tried((f, 0.04)) for f in (start[0], peak))], key=lambda t: t[0])
    step = [0.03, 0.25]
    for _ in range(steps):
        for axis in free:
            points = [(0.0, best), *((sign, tried(_moved(best[2], axis, sign * step[axis]))) for sign in (-1.0, 1.0))]
            losses = np.array([p[1][0] for p in sorted(points, key=lambda p: p[0])])
            bend = losses[0] - 2 * losses[1] + losses[2]
            vertex = float(0.5 * (losses[0] - losses[2]) / bend) if bend > 0 else 0.0
            if 0.05 < abs(vertex) < 1:
                points.append((vertex, tried(_moved(best[2], axis, vertex * step[axis]))))
            how_far, found = min(points, key=lambda p: p[1][0])
            best = found
            step[axis] *= 1.5 if abs(how_far) == 1 else 0.5
    return best[2], best[1]


def _moved(point: tuple[float, float], axis: int, by: float) -> tuple[float, float]:
    """The point with one coordinate multiplied by exp(by)."""
    factor = math.exp(by)
    return (point[0] * factor, point[1]) if axis == 0 else (point[0], point[1] * factor)


def _sides(records: Sequence[Record], frame: Frame) -> list[_Side]:
    """Records gathered by state and rate."""
    by: dict[tuple[str, float], list[Record]] = {}
    for record in records:
        by.setdefault((str(record.condition.fault), record.condition.fs_hz), []).append(record)
    out = []
    for (fault, fs_hz), own in by.items():
        measured = [_bands(r, frame) for r in own]
        out.append(
            _Side(
                fault, fs_hz, tuple(r.condition for r in own), np.mean([m[0] for m in measured], axis=0),
                float(np.mean([m[1] for m in measured])),
            )
        )  # fmt: skip
    return out


def _bands(record: Record, frame: Frame) -> tuple[Array, float]:
    """Power density in `BANDS` bands without tones, and mean square in the frame's band, tones and all."""
    import scipy.fft

    x, fs_hz = record.samples, record.condition.fs_hz
    transform = scipy.fft.rfft(x - x.mean())
    power = (transform.real**2 + transform.imag**2) * (2 / (fs_hz * x.size))
    df = fs_hz / x.size
    low, high = (round(f / df) for f in frame.band_hz)
    energy = float(power[max(low, 1) : max(high, low + 1)].sum() * df)
    per = (power.size - 1) // BANDS
    if per < 1:
        return np.interp(np.arange(BANDS), np.linspace(0, BANDS - 1, power.size - 1), power[1:]), energy
    blocks = power[1 : 1 + per * BANDS].reshape(BANDS, per)
    if per < 8:
        return np.asarray(blocks.mean(axis=1)), energy
    # Tones lie above what chance does to the largest of so many bins: each bin counts as at most that.
    level = np.median(blocks, axis=1, keepdims=True) / math.log(2)
    return np.asarray(np.minimum(blocks, level * (math.log(per) + 3)).mean(axis=1)), energy


@dataclass(frozen=True)
class _Matcher:
    """Simulates a twin under changed baselines with the same random streams."""

    spec: TwinSpec
    frame: Frame
    unit: str
    root: int
    known: dict[float, Array] = field(default_factory=dict)

    @cached_property
    def plain(self) -> TwinSpec:
        """The twin without its effects."""
        own = {k: v for k, v in self.spec.parameters.items() if k not in self.spec.effects}
        return replace(self.spec, effects=(), parameters=own)

    def spec_with(self, values: dict[str, float]) -> TwinSpec:
        """The twin with these baseline values."""
        return replace(self.spec, parameters=nested(flat(self.spec.parameters) | values))

    def simulated(self, conditions: Sequence[Condition], values: dict[str, float]) -> list[Record]:
        """Its records."""
        from twingap.gap.simulator import TwinSimulator

        own = TwinSimulator(self.spec_with(values), self.frame.bearing, self.unit)
        return own.simulate((), conditions, self.root, 0)

    def noise(self, quiet: Sequence[_Side], f: float, zeta: float, values: dict[str, float]) -> tuple[float, Array]:
        """Misfit of the healthy spectra and the powers of structure and white noise that give it."""
        loss, powers, weights = 0.0, np.zeros(2), 0.0
        for side in quiet:
            conditions = side.conditions[:MOST_SIMULATED]
            basis = []
            for structure, white in ((1.0, 1e-4), (1e-4, 1.0)):
                own = values | {
                    "resonance_hz": f, "damping_ratio": zeta, "scale": 1.0,
                    "structure_noise_rms": structure, "white_noise_rms": white,
                }  # fmt: skip
                exact = structure**2 * mode_density(f, zeta, side.fs_hz) + white**2 * 2 / side.fs_hz
                basis.append(exact * self._changed(conditions, own))
            inside = slice(2, int(0.92 * BANDS))
            got, one = _nonnegative(np.array(basis).T[inside], side.psd[inside])
            loss += one * len(side.conditions)
            powers += got * len(side.conditions)
            weights += len(side.conditions)
        return loss / weights, powers / weights

    def _changed(self, conditions: Sequence[Condition], values: dict[str, float]) -> Array | float:
        """Factor by which effects change the healthy spectrum [BANDS], read off records with the same chances."""
        if self.acts == "nothing":
            return 1.0
        # Without structure noise the mode does not matter, unless an effect drives it.
        lasting = self.acts == "after the mode" and values["structure_noise_rms"] < values["white_noise_rms"]
        if lasting and conditions[0].fs_hz in self.known:
            return self.known[conditions[0].fs_hz]
        factor = self.density(conditions, values, self.spec) / self.density(conditions, values, self.plain)
        if lasting:
            self.known[conditions[0].fs_hz] = factor
        return factor

    @cached_property
    def acts(self) -> Literal["nothing", "after the mode", "more"]:
        """What the effects do to a healthy record."""
        stages = {catalogue()[name].stage for name in self.spec.effects}
        if stages <= {Stage.SHAFT, Stage.EXCITATION}:
            short = [Condition("short", 1800.0, 4 * self.frame.band_hz[1], 512, "healthy", time_s=0.0)]
            values = {"resonance_hz": self.frame.band_hz[1] / 2, "damping_ratio": 0.05}
            one, other = (replace(self, spec=s).simulated(short, values)[0].samples for s in (self.spec, self.plain))
            if np.array_equal(one, other):  # they change the strikes of a defect, say
                return "nothing"
        return "more" if Stage.EXCITATION in stages else "after the mode"

    def density(self, conditions: Sequence[Condition], values: dict[str, float], spec: TwinSpec) -> Array:
        """Mean power density [BANDS] of a twin's records."""
        made = replace(self, spec=spec).simulated(conditions, values)
        return np.asarray(np.mean([_bands(r, self.frame)[0] for r in made], axis=0))

    def amplitude(self, fault: str, sides: Sequence[_Side], values: dict[str, float]) -> float:
        """Impact amplitude that brings the energy in the band to what it is in the records."""
        name = f"impact_amplitude.{fault}"
        now = max(values[name], 1e-3)
        gain, loss = 0.0, 0.0
        for side in sides:
            conditions = side.conditions[:MOST_SIMULATED]
            struck = self.simulated(conditions, values | {name: now})
            calm = self.simulated(conditions, values | {name: 0.0})
            with_impacts = float(np.mean([_bands(r, self.frame)[1] for r in struck]))
            without = float(np.mean([_bands(r, self.frame)[1] for r in calm]))
            gain += (side.energy - without) * len(side.conditions)
            loss += (with_impacts - without) * len(side.conditions)
        if loss <= 0:
            return now
        return now * math.sqrt(float(np.clip(gain / loss, 0.01, 100.0)))


def mode_density(resonance_hz: float, damping_ratio: float, fs_hz: float) -> Array:
    """[BANDS] Power density of sampled structure noise of unit variance, 1/Hz, from 0 to half the rate."""
    f = (np.arange(8 * BANDS) + 0.5) / (16 * BANDS)
    w = 2 * math.pi * resonance_hz / fs_hz
    r, theta = math.exp(-damping_ratio * w), math.sqrt(1 - damping_ratio**2) * w
    turn = np.exp(-2j * math.pi * f)
    power = 1 / np.abs(1 - 2 * r * math.cos(theta) * turn + r**2 * turn**2) ** 2
    return np.asarray((power / power.mean() * 2 / fs_hz).reshape(BANDS, 8).mean(axis=1))


def _nonnegative(basis: Array, wanted: Array) -> tuple[Array, float]:
    """Powers [2] of the two spectra [bins, 2] by least squares of relative errors, and their mean log misfit."""
    from scipy.optimize import nnls

    weight = 1 / np.maximum(wanted, 1e-300)
    got = np.zeros(2)
    for _ in range(4):
        got = nnls(basis * weight[:, None], wanted * weight)[0]
        model = np.maximum(basis @ got, 1e-3 * wanted)
        weight = 1 / np.sqrt(model * wanted)
    rest = np.log(np.maximum(basis @ got, 1e-300) / np.maximum(wanted, 1e-300))
    return got, float(np.mean(np.minimum(rest**2, 1.0)))
