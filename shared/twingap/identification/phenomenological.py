"""Identification of the phenomenological twin's free parameters from records.

healthy records --Whittle or eq. 8--> mode, two noises --+--> scale, relative noise levels
faulty records  --excess energy in the mode's band-------+--> impact amplitude per fault
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import FAULTS
from twingap.errors import TwingapError
from twingap.identification.healthy_model import SHORT_S, HealthyModel, is_of
from twingap.identification.impact_amplitude import Amplitude
from twingap.identification.intervals import clusters, jackknife
from twingap.identification.resonance import HealthyFit
from twingap.identification.result import Estimate, Fit, Outcome, Progress
from twingap.identification.spectra import SEGMENT_S, SHORTEST, spectra
from twingap.records import Record, RecordSet
from twingap.streams import root_entropy
from twingap.twins.twin_file import TwinSpec, flat, model_parameters, nested

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

METHODS = ("whittle", "eq8")
COLOURING = ("second_resonance", "sensor_rolloff", "coloured_noise", "distributed_roughness")
"""Effects that change the healthy spectrum, for which the fit assumes one mode and white noise."""
NO_HEALTHY = (
    "no healthy record: noise levels were estimated between the lines of the other records, and between their impacts; "
    "structure_noise_rms may include part of the impacts' energy"
)
QUICK_SEGMENT_S = 0.08
"""Desired length of a segment without intervals, s; longer ones resolve sharper modes and are slower."""
FAULTY_SEGMENT_S = 0.34
"""Desired length of a segment where all records are faulty, s. Strong lines leave few bins of noise between them, so
shorter segments give much larger scatter."""
SLOW_RPM = 60.0
"""Speed below which a note warns that values may be turns per second or another column; higher warns more often."""
SURE_SHARE = 0.9
"""Fraction of the fitted structure noise below which the removed part exceeds the scatter of the fit."""
MOST_UNEQUAL = 1000.0
"""Ratio of the loudest to the quietest record of a state above which a note warns of different units."""
MOST_RECORDS = 300
"""Most records of each state; more hardly shrink intervals and are slower."""


def identify_phenomenological(
    spec: TwinSpec, records: RecordSet, rng: np.random.Generator, *, level: float, method: str, progress: Progress
) -> Outcome:
    """Identify the free parameters of `spec`: mode, noise levels, scale, impact amplitudes. See `identify`."""
    if method not in METHODS:
        raise TwingapError(f"method {method!r}", where="identification", mend=f"use one of {', '.join(METHODS)}")
    root = root_entropy(rng)
    records, notes = _chosen(records)
    records = _in_blocks(records, notes)
    healthy = is_of(records, "healthy")
    faults = [fault for fault in FAULTS[1:] if is_of(records, fault).any()]
    everything = np.ones(len(records), bool)
    baseline = healthy if healthy.any() else everything
    if not healthy.any():
        notes.append(NO_HEALTHY)
    if (slowest := min(c.speed_rpm for c in records.conditions)) < SLOW_RPM:
        notes.append(f"speed_rpm is as low as {slowest:g}: check that it is in turns per minute")
    if len(_groups(records, baseline)) == 1:
        notes.append(
            "all records that the noise was fitted to are of one group: intervals include the scatter within it only"
        )
    for name in COLOURING:
        if name in spec.effects:
            notes.append(
                f"the twin's {name} was not removed from the records: it is included in resonance, damping, noises, "
                "scale and impact amplitudes, so that the twin has it twice; values without intervals"
            )
    if silent := [name for name in spec.effects if not spec.parameters.get(name)]:
        notes.append(
            f"{', '.join(silent)}: the twin file gives no value, and spectra alone do not determine it: defaults were "
            "kept (`twingap gap` estimates such values)"
        )
    progress("spectra", 0.0)
    segment_s = SEGMENT_S if healthy.any() else FAULTY_SEGMENT_S
    problem = HealthyModel(spec, records, spectra(records, segment_s), method, ~everything)
    progress("resonance and noise", 0.0)
    problem = problem if healthy.any() else problem.between_lines()
    notes += _unequal(problem)
    problem, fit = problem.begin(baseline, notes)
    if (why := problem.no_scale(fit)) is not None:
        raise TwingapError(why, where="[parameters]", mend="give scale, or leave the noise level out")
    if not healthy.any():
        problem, fit = problem.between_impacts(fit, root)
    amplitudes = {
        fault: Amplitude.of(problem, fault, fit, root)
        for fault in faults
        if f"impact_amplitude.{fault}" not in problem.given
    }
    names = [*problem.coordinates(fit), *(f"impact_amplitude.{fault}" for fault in amplitudes)]

    def estimate(keep: Mask, start: HealthyFit) -> Array:
        """Coordinates of all parameters, with the fit to some baseline records and amplitudes from all faulty ones."""
        own = problem.refit(keep, baseline, start)
        scale = problem.levels(own)["scale"]
        powers = [a.power(own, keep & healthy, everything) / scale**2 for a in amplitudes.values()]
        return np.array([*problem.coordinates(own).values(), *powers])

    at = estimate(everything, fit)
    if method == "eq8":
        notes.append("eq. 8 uses one peak and its decay: values without intervals")
        estimates = {name: Estimate(value) for name, value in problem.values(fit).items()}
        for name, power in zip(names[len(estimates) :], at[len(estimates) :], strict=True):
            estimates[name] = Estimate(float(np.sqrt(max(power, 0.0))))
    else:
        estimates = _with_intervals(problem, fit, healthy, baseline, amplitudes, estimate, at, level, notes, progress)
    if any(name in spec.effects for name in COLOURING):
        estimates = {name: Estimate(estimated.value) for name, estimated in estimates.items()}
    for fault in FAULTS[1:]:
        if fault not in faults and f"impact_amplitude.{fault}" not in problem.given:
            notes.append(f"no record of fault {fault!r}: its impact amplitude keeps the default")
    return Outcome(estimates, _fits(problem, fit, healthy, baseline, amplitudes), tuple(notes))


def _with_intervals(
    problem: HealthyModel,
    fit: HealthyFit,
    healthy: Mask,
    baseline: Mask,
    amplitudes: Mapping[str, Amplitude],
    estimate: Callable[[Mask, HealthyFit], Array],
    at: Array,
    level: float,
    notes: list[str],
    progress: Progress,
) -> dict[str, Estimate]:
    """Values with jackknife intervals over the records of the fit, for amplitudes also over faulty ones."""
    places = np.flatnonzero(baseline)
    of = clusters([str(problem.records.conditions[p].group) for p in places])
    done = 0

    def without(keep: Mask) -> Array:
        nonlocal done
        progress("intervals", done / (of.max() + 1))
        done += 1
        mask = np.ones(len(problem.records), bool)
        mask[places] = keep
        return estimate(mask, fit)

    bare = {
        f"impact_amplitude.{fault}": Estimate(float(np.sqrt(max(power, 0.0))))
        for fault, power in zip(amplitudes, at[len(at) - len(amplitudes) :], strict=True)
    }
    if problem.mode_may_be_masked(fit, baseline):
        notes.append(
            f"records shorter than {SHORT_S:g} s do not separate a sharp mode from a line, and one of them is "
            "at the resonance: values without intervals, and the damping may be too high"
        )
        return {name: Estimate(value) for name, value in problem.values(fit).items()} | bare
    spread = jackknife(without, of)
    out = {}
    values = problem.values(fit)
    for name, (lo, hi) in zip(values, spread.interval(at, level), strict=False):
        low, high = problem.interval(name, lo, hi)
        out[name] = Estimate(values[name], (low, high) if low <= values[name] <= high else None)
    if problem.mode_from.any():
        # A mode estimated from lines is biased by their positions by more than its scatter, as is all that depends on
        # it.
        notes.append("a resonance estimated from lines of faults has no interval, nor has what depends on it")
        sound = ("white_noise_rms", "scale")
        return {name: e if name in sound else Estimate(e.value) for name, e in out.items()} | bare
    if problem.noise_share < SURE_SHARE:
        notes.append(
            f"{1 - problem.noise_share:.0%} of the apparent structure noise between the lines was identified as "
            "impacts by its variation over time: noise levels, scale and impact amplitudes have no intervals"
        )
        sound = ("resonance_hz", "damping_ratio")
        return {name: e if name in sound else Estimate(e.value) for name, e in out.items()} | bare
    scale = problem.levels(fit)["scale"]
    for place, (fault, amplitude) in enumerate(amplitudes.items(), start=len(values)):
        own = spread.at(place) + amplitude.spread(fit, healthy, scale)
        lo, hi = own.interval(at[place : place + 1], level)[0]
        if lo <= 0:
            notes.append(f"the impacts of fault {fault!r} do not stand out of the healthy energy around the resonance")
        # A negative excess is chance; the upper end is then that of an excess of zero.
        hi = max(hi, hi - at[place])
        value, lo, hi = (float(np.sqrt(max(v, 0.0))) for v in (at[place], lo, hi))
        out[f"impact_amplitude.{fault}"] = Estimate(value, (lo, hi))
    return out


def quick_identify(
    spec: TwinSpec, records: RecordSet, rng: np.random.Generator, *, impacts: bool = True
) -> tuple[TwinSpec, list[str]]:
    """The phenomenological twin with its free parameters identified as by `identify`, without intervals.

    Parameters
    ----------
    spec : TwinSpec
        Twin with fixed parameters.
    records : RecordSet
        Records of known faults.
    rng : numpy.random.Generator
    impacts : bool
        Whether impact amplitudes are identified.

    Returns
    -------
    TwinSpec
        Twin with all parameters.
    list of str
        Notes on what could not be identified.
    """
    notes: list[str] = []
    root = root_entropy(rng)
    healthy = is_of(records, "healthy")
    everything = np.ones(len(records), bool)
    baseline = healthy if healthy.any() else everything
    if not healthy.any():
        notes.append(NO_HEALTHY)
    segment_s = QUICK_SEGMENT_S if healthy.any() else FAULTY_SEGMENT_S
    problem = HealthyModel(spec, records, spectra(records, segment_s), "whittle", ~everything)
    problem = problem if healthy.any() else problem.between_lines()
    problem, fit = problem.begin(baseline, notes)
    if not healthy.any():
        problem, fit = problem.between_impacts(fit, root)
    values = dict(problem.values(fit))
    scale = problem.levels(fit)["scale"]
    for fault in FAULTS[1:] if impacts else ():
        name = f"impact_amplitude.{fault}"
        if name in problem.given:
            continue
        if not is_of(records, fault).any():
            if fault in ("inner", "outer", "ball"):
                notes.append(f"no record of fault {fault!r}: its impact amplitude keeps the default")
            continue
        power = Amplitude.of(problem, fault, fit, root).power(fit, healthy, everything) / scale**2
        values[name] = math.sqrt(max(power, 0.0))
    complete = flat(dataclasses.asdict(model_parameters(spec))) | values
    return replace(spec, parameters=nested(flat(spec.parameters) | {k: float(v) for k, v in complete.items()})), notes


def _unequal(problem: HealthyModel) -> list[str]:
    """Notes on states whose records differ too much in level, probably by their unit or gain."""
    loud: dict[str | None, list[tuple[float, str]]] = {}
    for one in problem.measured:
        for power, place in zip(one.psd.sum(axis=1) * one.fs_hz / one.segment, one.places, strict=True):
            condition = problem.records.conditions[int(place)]
            loud.setdefault(condition.fault, []).append((math.sqrt(power), condition.name))
    notes = []
    for own in loud.values():
        (low, quiet), (high, loudest) = min(own), max(own)
        if high > MOST_UNEQUAL * low:
            notes.append(
                f"record {loudest!r} is {high / low:.2g} times as loud as {quiet!r}, which is of the same state: check "
                "their units"
            )
    return notes


def _groups(records: RecordSet, keep: Mask) -> set[str]:
    return {str(c.group) for c, k in zip(records.conditions, keep, strict=True) if k}


def _chosen(records: RecordSet) -> tuple[RecordSet, list[str]]:
    """At most `MOST_RECORDS` of each state, evenly spaced over the set."""
    places: dict[str | None, list[int]] = {}
    for place, condition in enumerate(records.conditions):
        places.setdefault(condition.fault, []).append(place)
    kept: list[int] = []
    notes = []
    for fault, own in places.items():
        if len(own) > MOST_RECORDS:
            notes.append(
                f"{MOST_RECORDS} of {len(own)} records of state {fault or 'unknown'!r} were used, evenly spaced"
            )
            own = [own[i] for i in np.linspace(0, len(own) - 1, MOST_RECORDS).round().astype(int)]
        kept += own
    return records.take(sorted(kept)), notes


def _in_blocks(records: RecordSet, notes: list[str], count: int = 4) -> RecordSet:
    """Records, with the only record of a state cut into blocks to estimate its scatter."""
    states = [c.fault for c in records.conditions]
    if all(states.count(state) > 1 for state in states):
        return records
    made: list[Record] = []
    for place, condition in enumerate(records.conditions):
        if states.count(condition.fault) > 1:
            made.append(records[place])
            continue
        size = condition.n_samples // count
        if size < SHORTEST:
            raise TwingapError(
                f"{condition.n_samples} samples are too few for the only record of fault {condition.fault!r}",
                where=f"record {condition.name!r}",
                mend=f"use at least {count * SHORTEST} samples, or two records",
            )
        notes.append(
            f"one record of state {condition.fault or 'unknown'!r}: its intervals include the scatter within it only"
        )
        samples = records[place].samples
        for i in range(count):
            block = replace(condition, name=f"{condition.name} block {i + 1}", n_samples=size)
            made.append(Record(block, samples[i * size : (i + 1) * size]))
    return RecordSet.from_records(records.name, records.unit, records.bearing, made)


def _fits(
    problem: HealthyModel, fit: HealthyFit, healthy: Mask, baseline: Mask, amplitudes: Mapping[str, Amplitude]
) -> tuple[Fit, ...]:
    """Measured and fitted spectra."""
    unit, out = problem.records.unit, []
    for s in problem.of(baseline):
        title = f"{'healthy' if healthy.any() else 'all'}, {_counted(len(s.places))} at {s.fs_hz:g} Hz"
        averages = s.mean()[1]
        out.append(
            Fit(title, s.f_hz, s.mean(lines=True)[0], fit.psd(s), s.usable & (averages > 0), fit.resonance_hz, unit)
        )
    for fault, amplitude in amplitudes.items():
        power = max(0.0, amplitude.power(fit, healthy, np.ones(len(problem.records), bool)))
        for s, inside, template, _ in amplitude.sides:
            fitted = fit.psd(s) + power * s.averages @ template / s.averages.sum()
            title = f"{fault}, {_counted(len(s.places))} at {s.fs_hz:g} Hz"
            out.append(Fit(title, s.f_hz, s.mean(lines=True)[0], fitted, inside, fit.resonance_hz, unit, band=True))
    return tuple(out)


def _counted(records: int) -> str:
    return "1 record" if records == 1 else f"{records} records"
