"""Amplitudes of harmonics, measured on the lines of records and twin.

twin with a series of harmonics --simulated--> power of each line, records less twin --> amplitude of each harmonic

A supply, a gear or a loose part makes harmonics of any amplitudes; a level and a decay, which are fitted, hold for the
strongest alone. The lines add to whatever else is at their places, so that powers differ by those of the series.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np
from scipy.stats import t as student

from twingap.effects import Draft, Effect, MeanSlip
from twingap.effects.harmonic_series import MeasuredLines
from twingap.gap.search.evidence import Evidence
from twingap.records import Array, Condition, Record
from twingap.signal.record_transforms import tone_spectrum
from twingap.twins.simulator import Simulator

Chain = tuple[Effect, ...]

_SPREAD: Final = 0.004
"""Half width of a line of the shaft over its frequency, as speeds vary within a record and have errors. A larger value
includes neighbours; a smaller one loses part of lines that move."""
_LOBE: Final = 2
"""Bins on either side of a line of constant frequency."""
_SIDE: Final = 30
"""Bins on either side from which the noise beside a line is estimated. Fewer are less certain."""
_APART: Final = 0.4
"""Largest half width over the distance of the next line."""
_BY_CHANCE: Final = 0.1
"""Probability that noise alone makes the series longer. A larger value finds weaker harmonics at its end."""
_BEYOND_DOUBT: Final = 0.001
"""The same probability for the first harmonic of a series with a lower one. A larger value takes other lines for it."""
_LIKELY: Final = 1.0
"""Standard errors by which the power of the harmonics before the last exceeds 0. Larger, and weak ones are left out."""
_OUTLIER: Final = 2.0
"""Standard deviations from the median over records at which a record's power is capped. A larger value lets single
records decide."""
_OTHERS: Final = (4, 5, 6)
"""Replicates of the twin that are measured. More measure fainter lines, and take longer."""


def with_measured_harmonics(
    evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]
) -> tuple[Simulator, Chain] | None:
    """The twin, harmonics of its series with the amplitudes of the fit part; None without a series."""
    chain = tuple(effects)
    own = [effect for effect in chain if isinstance(effect, MeasuredLines)]
    if not own:
        return None
    families = [(effect, *effect.lower()) for effect in own]
    series = [effect for family in families for effect in family]
    fit = evidence.calibrated.fit
    made = [evidence.simulated(simulator, chain, fit.conditions, replicate) for replicate in _OTHERS]
    drafts = [_draft(evidence, chain, c) for c in fit.conditions]
    real, *simulated = (
        [_powers(record, draft, series) for record, draft in zip(records, drafts, strict=True)]
        for records in (fit, *made)
    )
    found = []
    for place, effect in enumerate(series):
        ours, *theirs = ([record[place] for record in of] for of in (real, *simulated))
        found.append(_measured(effect, np.array(ours) - np.mean(theirs, axis=0), simulator.reference_rms))
    for effect, *lower in families:
        (measured, _), *others = found[: 1 + len(lower)]
        del found[: 1 + len(lower)]
        measured = next((other for other, has_first in reversed(others) if has_first), measured)
        chain = tuple(measured if one is effect else one for one in chain)
    return evidence.with_values(simulator, chain), chain


def _measured(effect: MeasuredLines, more: Array, reference_rms: float) -> tuple[MeasuredLines, bool]:
    """The series with the amplitudes that leave no more power in the records than in the twin, and whether its first
    harmonic is there beyond doubt.

    `more` [records, harmonics] are squared amplitudes of the records' lines less those of the twin's, NaN where a
    record does not have the line.
    """
    own = np.zeros(more.shape[1])
    levels = effect.levels[: own.size]
    own[: levels.size] = np.square(levels * reference_rms)
    count = np.isfinite(more).sum(axis=0)
    seen = count > 0
    power, error = own.copy(), np.zeros(own.size)
    if seen.any():
        values = more[:, seen]
        middle = np.nanmedian(values, axis=0)
        spread = 1.4826 * np.nanmedian(np.abs(values - middle), axis=0)
        power[seen] += np.nanmean(np.clip(values, middle - _OUTLIER * spread, middle + _OUTLIER * spread), axis=0)
        error[seen] = spread / np.sqrt(count[seen])
    sure = student.isf(_BY_CHANCE / max(int(np.count_nonzero(seen)), 1), np.maximum(count - 1, 1))
    last = int(np.max(np.flatnonzero(seen & (power > sure * error)), initial=-1))
    there = (power > _LIKELY * error) & (np.arange(own.size) <= last)
    found = np.sqrt(np.where(seen & ~there, 0.0, np.maximum(power, 0.0))) / reference_rms
    first = bool(seen[0] and power[0] > student.isf(_BEYOND_DOUBT, max(int(count[0]) - 1, 1)) * error[0])
    return (effect.at_levels(found) if found.any() else effect), first


def _draft(evidence: Evidence, chain: Chain, condition: Condition) -> Draft:
    """Empty record of a condition, at the cage speed of the twin."""
    t = np.zeros(2)
    draft = Draft(condition, evidence.frame.bearing, 1.0, t, t.copy())
    rng = np.random.default_rng(0)
    for effect in chain:
        if isinstance(effect, MeanSlip):
            effect.apply(draft, rng)
    return draft


def _powers(record: Record, draft: Draft, series: Iterable[MeasuredLines]) -> list[Array]:
    """[series][harmonics] Squared amplitudes of the lines above the noise beside them, NaN beyond the spectrum."""
    c = record.condition
    bin_hz = c.fs_hz / c.n_samples
    power = np.square(np.abs(tone_spectrum(np.asarray(record.samples, float))))
    # The main lobe of a Hann window holds 1.5 times the power of its middle bin, which is half the squared amplitude.
    return [np.array(list(_lines(power, effect, draft, bin_hz))) * (2 / 1.5) for effect in series]


def _lines(power: Array, effect: MeasuredLines, draft: Draft, bin_hz: float) -> Iterator[float]:
    base_hz = effect.base_hz(draft)
    next_hz = min(base_hz, draft.shaft_hz) if effect.spaced_by_shaft else base_hz
    for number in range(1, effect.most_harmonics + 1):
        place, most = number * base_hz / bin_hz, int(_APART * next_hz / bin_hz)
        half = min(_LOBE + math.ceil(_SPREAD * place if effect.turns else 0.0), most)
        low, high = round(place) - half, round(place) + half + 1
        if half < _LOBE or low < 1 or high >= power.size:
            yield math.nan
            continue
        beside = np.concatenate((power[max(low - _SIDE, 1) : low], power[high : high + _SIDE]))
        # Noise of a power spectrum has the mean of its median over log 2.
        yield float(power[low:high].sum()) - (high - low) * float(np.median(beside)) / math.log(2)
