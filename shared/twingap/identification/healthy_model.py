"""Healthy part of the phenomenological twin: selection of its records, and fit of mode and noises.

spectra, fixed parameters --> HealthyModel --begin--> records of the mode, first fit --refit--> values for any records

The mode is fitted to healthy records. Where defects excite another mode, or healthy spectra are not one mode and white
noise, it is fitted to the difference of faulty and healthy spectra; without healthy records, to lines of faulty ones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from twingap.bearing import FAULTS
from twingap.identification.impacts import actual_speed, fault_order, silent_twin
from twingap.identification.noise_share import MOST, noise_share
from twingap.identification.resonance import Fixed, HealthyFit, equation_8, whittle
from twingap.identification.spectra import Spectra
from twingap.records import RecordSet
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, build_twin, flat, model_parameters

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHORT_S = 0.2
"""Length below which records do not resolve a mode with damping of a few tenths of a per cent, s."""
MISFIT = 4.0
"""Deviance over scatter above which a healthy spectrum is not one mode and a floor; larger accepts poorer fits."""
OTHER_DAMPING = 0.25
"""Log ratio above which dampings from lines and from between lines disagree."""
SAME_PLACE = 0.1
"""Log ratio of frequencies up to which two modes count as the same."""
ADDED_DAMPING = 0.003, 0.25
"""Range of damping of a mode in what defects add: sharper peaks are tones, broader ones noise."""
ELSEWHERE = 0.3
"""Largest deviance that the healthy mode explains, relative to that of another mode, for the other to be used; larger
uses it more often."""
NOISES = "structure_noise_rms", "white_noise_rms"
LEAST_SHOWN = 0.003
"""Fraction of the healthy RMS below which a noise counts as absent (50 dB below the other one)."""
LINE_REACH = 4
"""Bins on either side of a defect's harmonics that are excluded from noise (main lobe, small errors of speed)."""


@dataclass(frozen=True)
class HealthyModel:
    """Spectra of records, fixed parameters, and the records from which the mode is estimated."""

    spec: TwinSpec
    records: RecordSet
    measured: list[Spectra]
    method: str
    mode_from: Mask  # records from which the mode is estimated instead of the baseline
    mode_start: HealthyFit | None = None
    mode_above: bool = False  # the mode is that of their difference to the baseline
    mode_unknown: bool = False
    noise_share: float = 1.0  # fraction of the fitted structure noise; the rest is impacts

    @property
    def given(self) -> Mapping[str, float]:
        """Values that the spec fixes, by dotted name."""
        return flat(self.spec.parameters)

    @property
    def twin(self) -> PhenomenologicalTwin:
        """The twin before identification."""
        twin = build_twin(self.spec, self.records.bearing, self.records.unit)
        assert isinstance(twin, PhenomenologicalTwin)
        return twin

    @property
    def fixed(self) -> Fixed:
        """Fixed values of the healthy model, in record units."""
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
        """Whether bins at the resonance were excluded as a line although they may belong to a sharp mode."""
        lengths = [c.duration_s for c, own in zip(self.records.conditions, baseline, strict=True) if own]
        if min(lengths) >= SHORT_S or self.mode_unknown or self.mode_from.any():
            return False
        for one in self.of(baseline):
            reach = 2 * fit.damping_ratio * fit.resonance_hz + 2 * one.fs_hz / one.segment
            if not one.clean[:, np.abs(one.f_hz - fit.resonance_hz) < reach].all():
                return True
        return False

    def between_lines(self) -> HealthyModel:
        """Model without bins at harmonics of the records' defects, for sets without healthy records.

        The spectrum of a short record is a single average, in which lines cannot be detected reliably; harmonics of
        known defects are therefore excluded explicitly.
        """
        fit = whittle(self.measured, fixed=self.fixed)
        silent = silent_twin(self.twin, fit)
        masked = []
        for one in self.measured:
            clean = one.clean.copy()
            for row, place in zip(clean, one.places, strict=True):
                record = self.records[int(place)]
                if record.condition.fault not in FAULTS[1:]:
                    continue
                rate_hz = fault_order(silent, record.condition) * actual_speed(silent, fit, record) / 60
                apart = rate_hz * one.segment / one.fs_hz
                reach = min(LINE_REACH, int(apart / 4))  # at least half of the bins remain
                for line in np.arange(apart, row.size, apart) if reach else ():
                    row[max(0, round(line) - reach) : round(line) + reach + 1] = False
            masked.append(replace(one, clean=clean))
        return replace(self, measured=masked)

    def begin(self, baseline: Mask, notes: list[str]) -> tuple[HealthyModel, HealthyFit]:
        """Select the records of the mode and fit from a grid; adds notes on what could not be determined."""
        fit = whittle(self.of(baseline), fixed=self.fixed)
        settled = self
        if {"resonance_hz", "damping_ratio"} <= self.given.keys():
            return settled, fit
        if self.method == "whittle" and not is_of(self.records, "healthy").any():
            return self._all_faulty(fit, baseline, notes)
        poor = fit.misfit > MISFIT
        why = (
            f"healthy spectra are not one mode and white noise (misfit {fit.misfit:.0f} times scatter)"
            if poor
            else "no resonance stands out of healthy noise"
        )
        added = self._mode_of_defects(fit, baseline) if self.method == "whittle" else None
        if added is not None:
            if fit.stands_out and not poor:
                why = f"defects excite another resonance than the {fit.resonance_hz:.0f} Hz of healthy spectra"
            notes.append(
                f"{why}: resonance and damping were estimated from the difference of faulty and healthy spectra"
            )
            settled = replace(self, mode_from=~baseline, mode_start=added, mode_above=True)
            return settled, settled.refit(np.ones(len(self.records), bool), baseline, added)
        if self.method == "whittle" and (poor or not fit.stands_out):
            others = self.of(~baseline)
            shown = whittle(others, lines=True) if others else fit
            if others and shown.stands_out:
                notes.append(f"{why}: resonance and damping were estimated from the faulty records")
                settled, fit = replace(self, mode_from=~baseline, mode_start=shown), shown
            elif not fit.stands_out:
                notes.append("no resonance stands out of the noise: resonance_hz and damping_ratio keep their defaults")
                settled = replace(self, mode_unknown=True)
            else:
                notes.append(f"spectra are not one mode and white noise (misfit {fit.misfit:.0f} times scatter)")
        return settled, settled.refit(np.ones(len(self.records), bool), baseline, fit)

    def _mode_of_defects(self, fit: HealthyFit, baseline: Mask) -> HealthyFit | None:
        """Mode of what defects add to healthy spectra, where it differs from that of `fit`; else None.

        Band noise and impacts from other sources are also in healthy records and may exceed the mode.
        """
        if "resonance_hz" in self.given:
            return None
        faulty, quiet = self._beside(~baseline, baseline)
        if not faulty:
            return None
        shown = whittle(faulty, lines=True, beneath=quiet)
        apart = abs(math.log(shown.resonance_hz / fit.resonance_hz)) > SAME_PLACE
        if not (apart and shown.stands_out and ADDED_DAMPING[0] < shown.damping_ratio < ADDED_DAMPING[1]):
            return None
        here = Fixed(fit.resonance_hz, fit.damping_ratio)
        there = whittle(faulty, lines=True, beneath=quiet, fixed=here, start=fit)
        return shown if there.deviance < ELSEWHERE * shown.deviance else None

    def _beside(self, keep: Mask, baseline: Mask) -> tuple[list[Spectra], list[Spectra]]:
        """Spectra of these records, and of the baseline at the same rates."""
        quiet = {s.fs_hz: s for s in self.of(baseline)}
        own = [s for s in self.of(keep) if s.fs_hz in quiet]
        return own, [quiet[s.fs_hz] for s in own]

    def _all_faulty(self, fit: HealthyFit, baseline: Mask, notes: list[str]) -> tuple[HealthyModel, HealthyFit]:
        """Select the records of the mode where all are faulty, and fit between lines or, with few bins, to lines."""
        shown = whittle(self.of(baseline), lines=True)
        apart = abs(math.log(shown.damping_ratio / fit.damping_ratio))
        # Lines at other frequencies than the mode are not of impacts, but for instance of mains or a gear.
        here = abs(math.log(shown.resonance_hz / fit.resonance_hz)) < SAME_PLACE
        settled = self
        if not (fit.stands_out or shown.stands_out):
            notes.append("no resonance stands out of the noise: resonance_hz and damping_ratio keep their defaults")
            settled = replace(self, mode_unknown=True)
        elif shown.stands_out and ((apart > OTHER_DAMPING and here) or not fit.stands_out):
            notes.append(
                f"the damping is {shown.damping_ratio:.3f} by lines of the spectra, {fit.damping_ratio:.3f} between "
                "them: resonance and damping were estimated from the lines"
            )
            settled, fit = replace(self, mode_from=baseline, mode_start=shown), shown
        elif fit.misfit > MISFIT:
            notes.append(f"spectra are not one mode and white noise (misfit {fit.misfit:.0f} times scatter)")
        return settled, settled.refit(np.ones(len(self.records), bool), baseline, fit)

    def between_impacts(self, fit: HealthyFit, root: int) -> tuple[HealthyModel, HealthyFit]:
        """Model and fit without impacts in the structure noise, for sets without healthy records."""
        if "structure_noise_rms" in self.given or self.mode_unknown:
            return self, fit
        faults = [fault for fault in FAULTS[1:] if is_of(self.records, fault).any()]
        places = [np.flatnonzero(is_of(self.records, fault))[: max(MOST // len(faults), 2)] for fault in faults]
        faulty = [self.records[int(place)] for own in places for place in own]
        share = noise_share(self.twin, fit, faulty, root)
        structure = math.sqrt(share) * fit.structure_noise_rms
        return replace(self, noise_share=share), replace(fit, structure_noise_rms=structure)

    def refit(self, keep: Mask, baseline: Mask, start: HealthyFit) -> HealthyFit:
        """Fit to some records, from initial values."""
        measured, mode = self.of(keep & baseline), None
        if self.method == "eq8":
            mode = equation_8(measured)
        elif self.mode_from.any():
            faulty, quiet = (
                self._beside(keep & self.mode_from, baseline)
                if self.mode_above
                else (self.of(keep & self.mode_from), [])
            )
            mode = whittle(faulty, lines=True, start=self.mode_start, beneath=quiet)
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
        stated = (given.get("structure_noise_rms"), given.get("white_noise_rms"))
        if "scale" in given:
            scale = given["scale"]
        elif stated[0] and stated[1]:
            scale = math.hypot(structure, white) / math.hypot(stated[0], stated[1])
        elif stated[0]:
            scale = structure / stated[0]
        elif stated[1]:
            scale = white / stated[1]
        else:
            scale = math.hypot(structure, white)
        relative = [
            float(rms / scale if level is None else level)
            for level, rms in zip(stated, (structure, white), strict=True)
        ]
        return {"structure_noise_rms": relative[0], "white_noise_rms": relative[1], "scale": float(scale)}

    def no_scale(self, fit: HealthyFit) -> str | None:
        """Reason why scale does not follow from the only fixed noise level, or None."""
        stated = [name for name in NOISES if self.given.get(name)]
        if "scale" in self.given or len(stated) != 1:
            return None
        shown = getattr(fit, stated[0]) / math.hypot(fit.structure_noise_rms, fit.white_noise_rms)
        if shown >= LEAST_SHOWN:
            return None
        return f"the records have no {stated[0].removesuffix('_rms').replace('_', ' ')}, from which scale would follow"

    @property
    def conventional(self) -> bool:
        """Whether the two relative noise levels are tied by structure^2 + white^2 = 1."""
        return not {"scale", "structure_noise_rms", "white_noise_rms"} & self.given.keys()

    def values(self, fit: HealthyFit) -> dict[str, float]:
        """Values of the free healthy parameters."""
        found = {"resonance_hz": fit.resonance_hz, "damping_ratio": fit.damping_ratio, **self.levels(fit)}
        kept = self.given.keys() | ({"resonance_hz", "damping_ratio"} if self.mode_unknown else set())
        return {name: value for name, value in found.items() if name not in kept}

    def coordinates(self, fit: HealthyFit) -> dict[str, float]:
        """Free values on scales with nearly normal errors: logarithms, and the logit of a fraction of power."""
        tied = ("structure_noise_rms", "white_noise_rms") if self.conventional else ()
        return {
            name: float(logit(np.clip(value**2, 1e-12, 1 - 1e-12)) if name in tied else np.log(max(value, 1e-300)))
            for name, value in self.values(fit).items()
        }

    def interval(self, name: str, lo: float, hi: float) -> tuple[float, float]:
        """Interval converted back from coordinates."""
        if self.conventional and name in ("structure_noise_rms", "white_noise_rms"):
            return float(np.sqrt(expit(lo))), float(np.sqrt(expit(hi)))
        # An interval beyond e^40 means "unknown"; scale may have any unit.
        low, high = (float(np.exp(np.clip(v, -690, 40))) for v in (lo, hi))
        most = {"damping_ratio": 1.0, "resonance_hz": max(c.fs_hz for c in self.records.conditions) / 2}
        return low, min(high, most.get(name, math.inf))


def is_of(records: RecordSet, fault: str) -> Mask:
    """[records] Whether each is of this fault."""
    return np.array([c.fault == fault for c in records.conditions])
