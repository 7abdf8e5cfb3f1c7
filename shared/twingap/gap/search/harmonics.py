"""Amplitudes of harmonics, measured on the lines of records and twin.

twin with a series of harmonics --simulated--> power of each line, records less twin --> amplitude of each harmonic

A supply, a gear or a loose part makes harmonics of any amplitudes; a level and a decay, which are fitted, hold for the
strongest alone. The lines add to whatever else is at their places, so that powers differ by those of the series.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from twingap.effects import Draft, Effect, MeanSlip
from twingap.effects.harmonic_series import HarmonicSeries
from twingap.gap.search.evidence import Evidence
from twingap.records import Array, Condition, Record
from twingap.signal.record_transforms import tone_spectrum
from twingap.twins.simulator import Simulator

Chain = tuple[Effect, ...]

_SPREAD: Final = 0.004
"""Half width of a line over its frequency, as speeds vary within a record and have errors. A larger value includes
neighbours; a smaller one loses part of lines that move."""
_LOBE: Final = 2
"""Bins on either side of a line of constant frequency."""
_SIDE: Final = 30
"""Bins on either side from which the noise beside a line is estimated. Fewer are less certain."""
_APART: Final = 0.4
"""Largest half width over the distance of the next line."""
_SURE: Final = 3.0
"""Standard errors by which the power of a harmonic exceeds 0 where it is there."""
_OTHER: Final = 4
"""Replicate of the twin that is measured."""
_FUNDAMENTAL: Final = 0.3
"""Amplitude of the first harmonic, over the level so far, from which it is the level."""


def with_measured_harmonics(
    evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]
) -> tuple[Simulator, Chain] | None:
    """The twin, harmonics of its series with the amplitudes of the fit part; None without a series."""
    chain = tuple(effects)
    series = [effect for effect in chain if isinstance(effect, HarmonicSeries)]
    if not series:
        return None
    fit = evidence.calibrated.fit
    made = evidence.simulated(simulator, chain, fit.conditions, _OTHER)
    drafts = [_draft(evidence, chain, c) for c in fit.conditions]
    real, simulated = (
        [_powers(record, draft, series) for record, draft in zip(records, drafts, strict=True)]
        for records in (fit, made)
    )
    for place, effect in enumerate(series):
        more = np.array([own[place] - other[place] for own, other in zip(real, simulated, strict=True)])
        found = _measured(effect, more, simulator.reference_rms)
        chain = tuple(found if one is effect else one for one in chain)
    return evidence.with_values(simulator, chain), chain


def _measured(effect: HarmonicSeries, more: Array, reference_rms: float) -> HarmonicSeries:
    """The series with the amplitudes that leave no more power in the records than in the twin.

    `more` [records, harmonics] are squared amplitudes of the records' lines less those of the twin's, NaN where a
    record does not have the line.
    """
    level: float = effect.level  # type: ignore[attr-defined]
    own = np.zeros(more.shape[1])
    levels = effect.levels[: own.size]
    own[: levels.size] = np.square(levels * reference_rms)
    seen = np.isfinite(more).sum(axis=0) > 0
    with np.errstate(all="ignore"):
        change = np.where(seen, np.nanmedian(np.where(seen, more, 0.0), axis=0), 0.0)
        spread = 1.4826 * np.nanmedian(np.abs(np.where(seen, more, 0.0) - change), axis=0)
    error = 1.25 * spread / np.sqrt(np.maximum(np.isfinite(more).sum(axis=0), 1))
    power = own + change
    power = np.where(seen, np.where(power > _SURE * error, power, 0.0), own)
    amplitudes = np.sqrt(np.maximum(power, 0.0)) / (level * reference_rms)
    there = np.flatnonzero(amplitudes)
    if not there.size:
        return effect
    amplitudes = amplitudes[: there[-1] + 1]
    if amplitudes[0] > _FUNDAMENTAL:
        level, amplitudes = level * float(amplitudes[0]), amplitudes / amplitudes[0]
    return replace(effect, level=level, amplitudes=tuple(float(f"{a:.6g}") for a in amplitudes))  # type: ignore[call-arg]


def _draft(evidence: Evidence, chain: Chain, condition: Condition) -> Draft:
    """Empty record of a condition, at the cage speed of the twin."""
    t = np.zeros(2)
    draft = Draft(condition, evidence.frame.bearing, 1.0, t, t.copy())
    rng = np.random.default_rng(0)
    for effect in chain:
        if isinstance(effect, MeanSlip):
            effect.apply(draft, rng)
    return draft


def _powers(record: Record, draft: Draft, series: Iterable[HarmonicSeries]) -> list[Array]:
    """[series][harmonics] Squared amplitudes of the lines above the noise beside them, NaN beyond the spectrum."""
    c = record.condition
    bin_hz = c.fs_hz / c.n_samples
    power = np.square(np.abs(tone_spectrum(np.asarray(record.samples, float))))
    # The main lobe of a Hann window holds 1.5 times the power of its middle bin, which is half the squared amplitude.
    return [np.array(list(_lines(power, effect, draft, bin_hz))) * (2 / 1.5) for effect in series]


def _lines(power: Array, effect: HarmonicSeries, draft: Draft, bin_hz: float) -> Iterator[float]:
    base_hz = effect.base_hz(draft)
    next_hz = min(base_hz, draft.shaft_hz) if effect.spaced_by_shaft else base_hz
    for number in range(1, effect.most_harmonics + 1):
        place, most = number * base_hz / bin_hz, int(_APART * next_hz / bin_hz)
        half = min(_LOBE + math.ceil(_SPREAD * place), most)
        low, high = round(place) - half, round(place) + half + 1
        if half < _LOBE or low < 1 or high >= power.size:
            yield math.nan
            continue
        beside = np.concatenate((power[max(low - _SIDE, 1) : low], power[high : high + _SIDE]))
        # Noise of a power spectrum has the mean of its median over log 2.
        yield float(power[low:high].sum()) - (high - low) * float(np.median(beside)) / math.log(2)
