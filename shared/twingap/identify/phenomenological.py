"""The phenomenological twin's free parameters from records.

healthy records --Whittle or eq. 8--> mode, two noises --+--> scale, relative noise levels
faulty records  --energy in the mode's band, less theirs-+--> impact amplitude per fault
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from twingap.bearing import FAULTS
from twingap.errors import TwingapError
from twingap.identify.impacts import band, band_energy, impact_gain, unit_spectra
from twingap.identify.intervals import Spread, clusters, jackknife
from twingap.identify.resonance import Fixed, HealthyFit, equation_8, whittle
from twingap.identify.result import Estimate, Fit, Outcome, Report
from twingap.identify.spectra import SHORTEST, Spectra, spectra
from twingap.identify.unstruck import MOST, noise_share
from twingap.records import Record, RecordSet
from twingap.streams import root_entropy
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, build_twin, flat, model_parameters, nested

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

METHODS = ("whittle", "eq8")
COLOURING = ("second_resonance", "sensor_rolloff", "coloured_noise", "distributed_roughness")
"""Effects that change the healthy spectrum, which the fit takes to be one mode and white noise."""
NO_HEALTHY = (
    "no healthy record: noise levels were read between the lines of the other records, and between their impacts; "
    "structure_noise_rms may hold part of the impacts' energy"
)
SHORT_S = 0.2
"""Records shorter than this, s, do not resolve a mode of a few tenths of a per cent of damping."""
QUICK_SEGMENT_S = 0.08
"""Aimed length of a segment where intervals are not asked for, s: half of the usual one, at a third of its time."""
MISFIT = 4.0
"""Deviance over scatter beyond which the healthy spectrum is taken to be something else than one mode and a floor."""
OTHER_DAMPING = 0.25
"""Log ratio of dampings from which lines and what lies between them are taken to disagree."""
SURE_SHARE = 0.9
"""Part of the fitted structure noise below which what was taken away is more than scatter of the fit."""
SAME_PLACE = 0.1
"""Log ratio of frequencies up to which two modes are taken to be one."""
ADDED_DAMPING = 0.003, 0.25
"""Dampings between which what defects add is taken for a mode: sharper is a tone, broader some other noise."""
ELSEWHERE = 0.3
"""Of what a mode explains of what defects add: the healthy records' own explains less where another one rings."""
MOST_RECORDS = 300
"""Records used of each state: beyond this the intervals hardly shrink."""


def identify_phenomenological(
    spec: TwinSpec, records: RecordSet, rng: np.random.Generator, *, level: float, method: str, report: Report
) -> Outcome:
    """Identify what `spec` leaves free: mode, noise levels, scale, impact amplitudes. See `identify`."""
    if method not in METHODS:
        raise TwingapError(f"method {method!r}", where="identification", mend=f"use one of {', '.join(METHODS)}")
    root = root_entropy(rng)
    records, notes = _chosen(records)
    records = _in_blocks(records, notes)
    healthy = _is(records, "healthy")
    faults = [fault for fault in FAULTS[1:] if _is(records, fault).any()]
    everything = np.ones(len(records), bool)
    baseline = healthy if healthy.any() else everything
    if not healthy.any():
        notes.append(NO_HEALTHY)
    if len(_groups(records, baseline)) == 1:
        notes.append(
            "all records that the noise was fitted to are of one group: intervals hold the scatter within it only"
        )
    for name in COLOURING:
        if name in spec.effects:
            notes.append(f"the twin's {name} was not undone: resonance, damping and noise levels describe the records")
    if silent := [name for name in spec.effects if not spec.parameters.get(name)]:
        notes.append(
            f"{', '.join(silent)}: the twin file gives no value, and spectra alone do not tell it: defaults were kept "
            "(`twingap gap` finds such values itself)"
        )
    report("spectra", 0.0)
    problem = _Problem(spec, records, spectra(records), method, ~everything)
    report("resonance and noise", 0.0)
    problem, fit = problem.begin(baseline, notes)
    if not healthy.any():
        problem, fit = problem.between_impacts(fit, root)
    amplitudes = {
        fault: _Amplitude.of(problem, fault, fit, root)
        for fault in faults
        if f"impact_amplitude.{fault}" not in problem.given
    }
    names = [*problem.coordinates(fit), *(f"impact_amplitude.{fault}" for fault in amplitudes)]

    def estimate(keep: Mask, start: HealthyFit) -> Array:
        """Coordinates of everything, with the fit on these baseline records and the amplitudes on all faulty ones."""
        own = problem.refit(keep, baseline, start)
        scale = problem.levels(own)["scale"]
        powers = [a.power(own, keep & healthy, everything) / scale**2 for a in amplitudes.values()]
        return np.array([*problem.coordinates(own).values(), *powers])

    at = estimate(everything, fit)
    if method == "eq8":
        notes.append("eq. 8 reads one peak and its decay: values without intervals")
        estimates = {name: Estimate(value) for name, value in problem.values(fit).items()}
        for name, power in zip(names[len(estimates) :], at[len(estimates) :], strict=True):
            estimates[name] = Estimate(float(np.sqrt(max(power, 0.0))))
    else:
        estimates = _with_intervals(problem, fit, healthy, baseline, amplitudes, estimate, at, level, notes, report)
    for fault in FAULTS[1:]:
        if fault not in faults and f"impact_amplitude.{fault}" not in problem.given:
            notes.append(f"no record of fault {fault!r}: its impact amplitude keeps the default")
    return Outcome(estimates, _fits(problem, fit, healthy, baseline, amplitudes), tuple(notes))


def _with_intervals(
    problem: _Problem,
    fit: HealthyFit,
    healthy: Mask,
    baseline: Mask,
    amplitudes: Mapping[str, _Amplitude],
    estimate: Callable[[Mask, HealthyFit], Array],
    at: Array,
    level: float,
    notes: list[str],
    report: Report,
) -> dict[str, Estimate]:
    """Values with jackknife intervals: over the records of the fit, and for amplitudes over the faulty ones as well."""
    places = np.flatnonzero(baseline)
    of = clusters([str(problem.records.conditions[p].group) for p in places])
    done = 0

    def without(keep: Mask) -> Array:
        nonlocal done
        report("intervals", done / (of.max() + 1))
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
            f"records shorter than {SHORT_S:g} s do not tell a sharp mode from a line, and what may be either lies at "
            "the resonance: values without intervals, and the damping may be too high"
        )
        return {name: Estimate(value) for name, value in problem.values(fit).items()} | bare
    spread = jackknife(without, of)
    out = {}
    values = problem.values(fit)
    for name, (lo, hi) in zip(values, spread.interval(at, level), strict=False):
        out[name] = Estimate(values[name], problem.interval(name, lo, hi))
    if problem.mode_from.any():
        # A mode read off lines is biased by where they lie, by more than its scatter; what rests on it is, too.
        notes.append("a resonance read off the faults' lines has no interval, nor has what rests on it")
        sound = ("white_noise_rms", "scale")
        return {name: e if name in sound else Estimate(e.value) for name, e in out.items()} | bare
    if problem.noise_share < SURE_SHARE:
        notes.append(
            f"{1 - problem.noise_share:.0%} of what looks like structure noise between the lines was told from it by "
            "time: noise levels, scale and impact amplitudes have no intervals"
        )
        sound = ("resonance_hz", "damping_ratio")
        return {name: e if name in sound else Estimate(e.value) for name, e in out.items()} | bare
    scale = problem.levels(fit)["scale"]
    for place, (fault, amplitude) in enumerate(amplitudes.items(), start=len(values)):
        own = spread.at(place) + amplitude.spread(fit, healthy, scale)
        lo, hi = own.interval(at[place : place + 1], level)[0]
        if lo <= 0:
            notes.append(f"the impacts of fault {fault!r} do not stand out of the healthy energy around the resonance")
        # An excess below zero is chance: the interval then reaches as far up as if it were zero.
        hi = max(hi, hi - at[place])
        value, lo, hi = (float(np.sqrt(max(v, 0.0))) for v in (at[place], lo, hi))
        out[f"impact_amplitude.{fault}"] = Estimate(value, (lo, hi))
    return out


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
    notes: list[str] = []
    root = root_entropy(rng)
    healthy = _is(records, "healthy")
    everything = np.ones(len(records), bool)
    baseline = healthy if healthy.any() else everything
    if not healthy.any():
        notes.append(NO_HEALTHY)
    problem = _Problem(spec, records, spectra(records, QUICK_SEGMENT_S), "whittle", ~everything)
    problem, fit = problem.begin(baseline, notes)
    if not healthy.any():
        problem, fit = problem.between_impacts(fit, root)
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
    whole = flat(dataclasses.asdict(model_parameters(spec))) | values
    return replace(spec, parameters=nested(flat(spec.parameters) | {k: float(v) for k, v in whole.items()})), notes


@dataclass(frozen=True)
class _Problem:
    """Records seen as spectra, what is fixed, and where the mode is read."""

    spec: TwinSpec
    records: RecordSet
    measured: list[Spectra]
    method: str
    mode_from: Mask  # records other than the baseline that show the mode, when the baseline does not
    mode_start: HealthyFit | None = None
    mode_above: bool = False  # read off what they add to the baseline
    mode_unknown: bool = False
    noise_share: float = 1.0  # of the structure noise that is fitted: the rest is impacts

    @property
    def given(self) -> Mapping[str, float]:
        """Values that the spec fixes, dotted."""
        return flat(self.spec.parameters)

    @property
    def twin(self) -> PhenomenologicalTwin:
        """The twin as it stands before identification."""
        twin = build_twin(self.spec, self.records.bearing, self.records.unit)
        assert isinstance(twin, PhenomenologicalTwin)
        return twin

    @property
    def fixed(self) -> Fixed:
        """Of the healthy model, in record units."""
        given = self.given
        scale = given.get("scale")
        rms = [
            None if scale is None or name not in given else scale * given[name]
            for name in ("structure_noise_rms", "white_noise_rms")
        ]
        return Fixed(given.get("resonance_hz"), given.get("damping_ratio"), *rms)

    def of(self, keep: Mask) -> list[Spectra]:
        """Spectra of some records."""
        taken = [s.take(keep) for s in self.measured]
        return [s for s in taken if s.places.size]

    def mode_may_be_masked(self, fit: HealthyFit, baseline: Mask) -> bool:
        """Whether bins at the resonance were left out as a line, in records too short to tell it from a sharp mode."""
        lengths = [c.duration_s for c, own in zip(self.records.conditions, baseline, strict=True) if own]
        if min(lengths) >= SHORT_S or self.mode_unknown or self.mode_from.any():
            return False
        for one in self.of(baseline):
            reach = 2 * fit.damping_ratio * fit.resonance_hz + 2 * one.fs_hz / one.segment
            if not one.clean[:, np.abs(one.f_hz - fit.resonance_hz) < reach].all():
                return True
        return False

    def begin(self, baseline: Mask, notes: list[str]) -> tuple[_Problem, HealthyFit]:
        """Settle where the mode is read, and fit from a grid; `notes` grows by what could not be found."""
        fit = whittle(self.of(baseline), fixed=self.fixed)
        settled = self
        if {"resonance_hz", "damping_ratio"} <= self.given.keys():
            return settled, fit
        if self.method == "whittle" and not _is(self.records, "healthy").any():
            return self._struck_only(fit, baseline, notes)
        poor = fit.misfit > MISFIT
        why = (
            f"healthy spectra are not one mode and white noise (misfit {fit.misfit:.0f} times scatter)"
            if poor
            else "no resonance stands out of healthy noise"
        )
        struck = self._struck_elsewhere(fit, baseline) if self.method == "whittle" else None
        if struck is not None:
            if fit.stands_out and not poor:
                why = f"what defects add rings elsewhere than at the {fit.resonance_hz:.0f} Hz of healthy spectra"
            notes.append(f"{why}: resonance and damping were read off the faulty records, off what they add")
            settled = replace(self, mode_from=~baseline, mode_start=struck, mode_above=True)
            return settled, settled.refit(np.ones(len(self.records), bool), baseline, struck)
        if self.method == "whittle" and (poor or not fit.stands_out):
            others = self.of(~baseline)
            shown = whittle(others, lines=True) if others else fit
            if others and shown.stands_out:
                notes.append(f"{why}: resonance and damping were read off the faulty records")
                settled, fit = replace(self, mode_from=~baseline, mode_start=shown), shown
            elif not fit.stands_out:
                notes.append("no resonance stands out of the noise: resonance_hz and damping_ratio keep their defaults")
                settled = replace(self, mode_unknown=True)
            else:
                notes.append(f"spectra are not one mode and white noise (misfit {fit.misfit:.0f} times scatter)")
        return settled, settled.refit(np.ones(len(self.records), bool), baseline, fit)

    def _struck_elsewhere(self, fit: HealthyFit, baseline: Mask) -> HealthyFit | None:
        """The mode that rings in what defects add to healthy spectra, where that is hardly the one of `fit`.

        Noise in a band and strikes from elsewhere are in healthy records, too, and may stand higher than the mode.
        """
        if "resonance_hz" in self.given:
            return None
        struck, quiet = self._beside(~baseline, baseline)
        if not struck:
            return None
        shown = whittle(struck, lines=True, beneath=quiet)
        apart = abs(math.log(shown.resonance_hz / fit.resonance_hz)) > SAME_PLACE
        if not (apart and shown.stands_out and ADDED_DAMPING[0] < shown.damping_ratio < ADDED_DAMPING[1]):
            return None
        here = Fixed(fit.resonance_hz, fit.damping_ratio)
        there = whittle(struck, lines=True, beneath=quiet, fixed=here, start=fit)
        return shown if there.deviance < ELSEWHERE * shown.deviance else None

    def _beside(self, keep: Mask, baseline: Mask) -> tuple[list[Spectra], list[Spectra]]:
        """Spectra of these records, and of the baseline at the same rates."""
        quiet = {s.fs_hz: s for s in self.of(baseline)}
        own = [s for s in self.of(keep) if s.fs_hz in quiet]
        return own, [quiet[s.fs_hz] for s in own]

    def _struck_only(self, fit: HealthyFit, baseline: Mask, notes: list[str]) -> tuple[_Problem, HealthyFit]:
        """Where every record is of a defect: the mode shows between lines or, where they leave too little, in them."""
        shown = whittle(self.of(baseline), lines=True)
        apart = abs(math.log(shown.damping_ratio / fit.damping_ratio))
        # Lines elsewhere than the mode are not of impacts: a hum, say, or a mesh.
        here = abs(math.log(shown.resonance_hz / fit.resonance_hz)) < SAME_PLACE
        settled = self
        if not (fit.stands_out or shown.stands_out):
            notes.append("no resonance stands out of the noise: resonance_hz and damping_ratio keep their defaults")
            settled = replace(self, mode_unknown=True)
        elif shown.stands_out and ((apart > OTHER_DAMPING and here) or not fit.stands_out):
            notes.append(
                f"the lines of the spectra show a damping of {shown.damping_ratio:.3f}, what lies between them "
                f"{fit.damping_ratio:.3f}: resonance and damping were read off the lines"
            )
            settled, fit = replace(self, mode_from=baseline, mode_start=shown), shown
        elif fit.misfit > MISFIT:
            notes.append(f"spectra are not one mode and white noise (misfit {fit.misfit:.0f} times scatter)")
        return settled, settled.refit(np.ones(len(self.records), bool), baseline, fit)

    def between_impacts(self, fit: HealthyFit, root: int) -> tuple[_Problem, HealthyFit]:
        """The same with the part of the fitted structure noise that is always there, where no record is healthy."""
        if "structure_noise_rms" in self.given or self.mode_unknown:
            return self, fit
        faults = [fault for fault in FAULTS[1:] if _is(self.records, fault).any()]
        places = [np.flatnonzero(_is(self.records, fault))[: max(MOST // len(faults), 2)] for fault in faults]
        struck = [self.records[int(place)] for own in places for place in own]
        share = noise_share(self.twin, fit, struck, root)
        structure = math.sqrt(share) * fit.structure_noise_rms
        return replace(self, noise_share=share), replace(fit, structure_noise_rms=structure)

    def refit(self, keep: Mask, baseline: Mask, start: HealthyFit) -> HealthyFit:
        """The fit on these records, from a good start."""
        measured, mode = self.of(keep & baseline), None
        if self.method == "eq8":
            mode = equation_8(measured)
        elif self.mode_from.any():
            struck, quiet = (
                self._beside(keep & self.mode_from, baseline)
                if self.mode_above
                else (self.of(keep & self.mode_from), [])
            )
            mode = whittle(struck, lines=True, start=self.mode_start, beneath=quiet)
        elif self.mode_unknown:
            own = model_parameters(self.spec)
            mode = replace(start, resonance_hz=own.resonance_hz, damping_ratio=own.damping_ratio)
        fixed = self.fixed
        if mode is not None:
            known = (fixed.resonance_hz, fixed.damping_ratio)
            f, zeta = (
                k if k is not None else m for k, m in zip(known, (mode.resonance_hz, mode.damping_ratio), strict=True)
            )
            fixed = replace(fixed, resonance_hz=f, damping_ratio=zeta)
        fit = whittle(measured, start=start, fixed=fixed)
        return replace(fit, structure_noise_rms=math.sqrt(self.noise_share) * fit.structure_noise_rms)

    def levels(self, fit: HealthyFit) -> dict[str, float]:
        """Noise levels in multiples of scale, and scale, by the twin's convention: healthy RMS = scale where free."""
        given, structure, white = self.given, fit.structure_noise_rms, fit.white_noise_rms
        asked = (given.get("structure_noise_rms"), given.get("white_noise_rms"))
        if "scale" in given:
            scale = given["scale"]
        elif asked[0] and asked[1]:
            scale = math.hypot(structure, white) / math.hypot(asked[0], asked[1])
        elif asked[0]:
            scale = structure / asked[0]
        elif asked[1]:
            scale = white / asked[1]
        else:
            scale = math.hypot(structure, white)
        relative = [
            float(rms / scale if level is None else level) for level, rms in zip(asked, (structure, white), strict=True)
        ]
        return {"structure_noise_rms": relative[0], "white_noise_rms": relative[1], "scale": float(scale)}

    @property
    def conventional(self) -> bool:
        """Whether the two relative noise levels are tied by structure^2 + white^2 = 1."""
        return not {"scale", "structure_noise_rms", "white_noise_rms"} & self.given.keys()

    def values(self, fit: HealthyFit) -> dict[str, float]:
        """The healthy parameters that are free."""
        found = {"resonance_hz": fit.resonance_hz, "damping_ratio": fit.damping_ratio, **self.levels(fit)}
        kept = self.given.keys() | ({"resonance_hz", "damping_ratio"} if self.mode_unknown else set())
        return {name: value for name, value in found.items() if name not in kept}

    def coordinates(self, fit: HealthyFit) -> dict[str, float]:
        """The same on scales where errors are nearly normal: logarithms, and the logit of a share of power."""
        tied = ("structure_noise_rms", "white_noise_rms") if self.conventional else ()
        return {
            name: float(logit(np.clip(value**2, 1e-12, 1 - 1e-12)) if name in tied else np.log(max(value, 1e-12)))
            for name, value in self.values(fit).items()
        }

    def interval(self, name: str, lo: float, hi: float) -> tuple[float, float]:
        """Back from coordinates."""
        if self.conventional and name in ("structure_noise_rms", "white_noise_rms"):
            return float(np.sqrt(expit(lo))), float(np.sqrt(expit(hi)))
        # Beyond e^40 an interval says "unknown" as well.
        low, high = (float(np.exp(np.clip(v, -40, 40))) for v in (lo, hi))
        return low, min(high, 1.0) if name == "damping_ratio" else high


@dataclass(frozen=True)
class _Amplitude:
    """What one fault adds: measured and unit-impact energies in the mode's band, per rate."""

    problem: _Problem
    fault: str
    sides: tuple[tuple[Spectra, Mask, Array, Array], ...]  # spectra, band, unit PSDs, gain at the first fit

    @classmethod
    def of(cls, problem: _Problem, fault: str, fit: HealthyFit, root: int) -> _Amplitude:
        """Gather them."""
        sides = []
        for s in problem.of(_is(problem.records, fault)):
            speeds = [problem.records.conditions[int(place)].speed_rpm for place in s.places]
            inside = band(s, fit, problem.twin.bearing.fault_order(fault) * max(speeds) / 60)
            unit = unit_spectra(problem.twin, fit, s, problem.records, root)
            sides.append((s, inside, unit, impact_gain(s, fit)))
        return cls(problem, fault, tuple(sides))

    def power(self, fit: HealthyFit, healthy: Mask, keep: Mask) -> float:
        """Amplitude squared in record units, not clipped, from these healthy and these faulty records."""
        above, unit = 0.0, 0.0
        for s, inside, template, gain in self.sides:
            own = keep[s.places]
            if not own.any():
                continue
            floor = float(band_energy(s, self.floor(s, fit, healthy), inside))
            weights = s.averages[own]
            above += float(weights @ (band_energy(s, s.psd[own], inside) - floor))
            moved = template[own] * (impact_gain(s, fit) / gain)
            unit += float(weights @ band_energy(s, moved, inside))
        return above / unit

    def floor(self, spectra: Spectra, fit: HealthyFit, healthy: Mask) -> Array:
        """PSD without the fault: measured where there are healthy records at this rate, fitted otherwise."""
        same = [s for s in self.problem.of(healthy) if s.fs_hz == spectra.fs_hz] if healthy.any() else []
        return same[0].mean(lines=True)[0] if same else fit.psd(spectra)

    def spread(self, fit: HealthyFit, healthy: Mask, scale: float) -> Spread:
        """Of the amplitude squared in multiples of scale, from the scatter of the faulty records."""
        places = np.concatenate([s.places for s, *_ in self.sides])

        def without(keep: Mask) -> Array:
            mask = np.zeros(len(self.problem.records), bool)
            mask[places[keep]] = True
            return np.array([self.power(fit, healthy, mask) / scale**2])

        return jackknife(without, clusters([str(self.problem.records.conditions[p].group) for p in places]))


def _is(records: RecordSet, fault: str) -> Mask:
    return np.array([c.fault == fault for c in records.conditions])


def _groups(records: RecordSet, keep: Mask) -> set[str]:
    return {str(c.group) for c, k in zip(records.conditions, keep, strict=True) if k}


def _chosen(records: RecordSet) -> tuple[RecordSet, list[str]]:
    """At most `MOST_RECORDS` of each state, evenly spread over the set."""
    places: dict[str | None, list[int]] = {}
    for place, condition in enumerate(records.conditions):
        places.setdefault(condition.fault, []).append(place)
    kept: list[int] = []
    notes = []
    for fault, own in places.items():
        if len(own) > MOST_RECORDS:
            notes.append(
                f"{MOST_RECORDS} of {len(own)} records of state {fault or 'unknown'!r} were used, evenly spread"
            )
            own = [own[i] for i in np.linspace(0, len(own) - 1, MOST_RECORDS).round().astype(int)]
        kept += own
    return records.take(sorted(kept)), notes


def _in_blocks(records: RecordSet, notes: list[str], count: int = 4) -> RecordSet:
    """States of which there is one record only have it cut in blocks, so that its scatter can be seen."""
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
                mend=f"bring {count * SHORTEST} samples, or two records",
            )
        notes.append(f"one record of state {condition.fault or 'unknown'!r}: its intervals hold its own scatter only")
        samples = records[place].samples
        for i in range(count):
            block = replace(condition, name=f"{condition.name} block {i + 1}", n_samples=size)
            made.append(Record(block, samples[i * size : (i + 1) * size]))
    return RecordSet.from_records(records.name, records.unit, records.bearing, made)


def _fits(
    problem: _Problem, fit: HealthyFit, healthy: Mask, baseline: Mask, amplitudes: Mapping[str, _Amplitude]
) -> tuple[Fit, ...]:
    """Measured spectra beside fitted ones."""
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
