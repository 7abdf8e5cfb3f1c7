"""Impacts of another bearing: the strongest comb of envelope lines at an order that is not this bearing's.

envelopes of four bands, own lines masked --> score of every comb --> order, excess, depth, band

Source: Randall & Antoni 2011, doi:10.1016/j.ymssp.2010.07.017.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.envelope_lines import envelope_lines, explained
from twingap.gap.features.tones.tones import Lines, lines_of
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms

REGIONS: Final = ((0.02, 0.12), (0.12, 0.25), (0.25, 0.48), (0.02, 0.48))
"""Bands for the search, parts of the sampling rate."""
_COMB: Final = 4
"""Number of lines of a comb in its score. More favour combs of many harmonics."""


def measure_foreign_bearing(record: RecordTransforms, out: dict[str, float]) -> None:
    """The strongest comb of envelope lines at an order that is not this bearing's, over four bands."""
    lines = lines_of(record)
    shaft = lines.shaft_hz
    best = (-1.0, 0, 0.0)
    spectra: list[tuple[Lines, Array] | None] = []
    for place, (low, high) in enumerate(REGIONS):
        env = envelope_lines(record.envelope_in(low * record.fs_hz, high * record.fs_hz), shaft)
        if env is None or env.tones.size < 40:
            spectra.append(None)
            continue
        logs = np.log10(np.maximum(env.excess, 1e-2))
        logs[:2] = 0.0
        strong = np.flatnonzero(logs > 0.6)
        own = strong[explained(record, np.asarray(strong * env.df_hz, float), env.df_hz)]
        logs[own] = 0.0
        spectra.append((env, logs))
        score, hz = _comb(record, env, logs, own)
        out[f"foreign_score_{place}"] = score
        if score > best[0]:
            best = (score, place, hz)
    score, place, hz = best
    found = spectra[place]
    if score < 0 or found is None:
        return
    out["foreign_score"] = score
    env, logs = found
    hz = _refined(env, hz)
    # Lines of this bearing may mask the first line of the comb: the comb of the raw spectrum decides.
    raw_hz = lines.unrelated_comb[0]
    if math.isfinite(raw_hz):
        multiple = round(hz / raw_hz)
        if multiple in (2, 3) and abs(hz / raw_hz - multiple) < 0.02:
            hz = raw_hz
    first = max(round(hz / env.df_hz), 2)
    out["foreign_excess"] = float(logs[first - 1 : first + 2].max())
    out["foreign_depth"] = 0.5 * math.log10(max(2 * float(env.tones[first - 1 : first + 2].max()), 1e-12))
    if score > 3.2:
        out["foreign_order"] = hz / shaft
        out["foreign_fs"] = sum(REGIONS[place]) / 2


def _comb(record: RecordTransforms, env: Lines, logs: Array, hidden: NDArray[np.int64]) -> tuple[float, float]:
    """Score and rate of the strongest comb in one envelope spectrum; nothing is known at hidden bins."""
    shaft, df_hz = env.stated_hz, env.df_hz
    wide = logs.copy()
    wide[1:-1] = np.maximum(np.maximum(logs[1:-1], logs[:-2]), logs[2:])
    wide = np.minimum(np.maximum(wide, 0.0), 1.6)
    for k in (-1, 0, 1):
        wide[np.minimum(np.maximum(hidden + k, 0), wide.size - 1)] = np.nan
    top = min(14 * shaft, (wide.size - 3) * df_hz / 2)
    if top <= 1.5 * shaft:
        return 0.0, shaft
    hz = np.arange(1.5 * shaft, top, df_hz / 4)
    bearing = record.bearing
    own_hz = shaft * np.array([bearing.bpfo, bearing.bpfi, 2 * bearing.bsf, bearing.bsf])
    score = _scores(wide, hz, df_hz, shaft, own_hz, 0.025 if record.fault_order is None else 0.01)
    best = int(np.argmax(score))
    return float(score[best]), float(hz[best])


def _scores(wide: Array, hz: Array, df_hz: float, shaft: float, own_hz: Array, tolerance: float) -> Array:
    """[candidates] Score of the comb with its first line at each frequency; NaN in `wide` is not known."""
    places, unknown = hz / df_hz, np.append(wide, np.nan)

    def heights(bins: Array) -> Array:
        return np.asarray(unknown[np.minimum(np.rint(bins).astype(int), wide.size)])

    lines = heights(np.arange(1, _COMB + 1)[:, None] * places)
    known, lines = np.isfinite(lines), np.nan_to_num(lines)
    seen, reached = known.sum(axis=0), known.any(axis=1).sum()
    # The strongest line is no evidence of a comb, the others are. Fewer are required where the band is narrow.
    score = (lines.sum(axis=0) - lines.max(axis=0)) * (_COMB - 1) / np.where(seen > 2, seen - 1, 1)
    score = np.where((seen < 3) & (seen < reached), 0.6 * score, score)
    score = np.where(lines[0] < 0.5, np.where(known[0], 0.5, 0.8) * score, score)
    # A multiple of the true rate has lines of the comb between its own.
    for weight, low, high in ((0.6, 0.5, 1.5), (0.8, 1 / 3, 2 / 3)):
        score = score - weight * np.nan_to_num(np.minimum(heights(low * places), heights(high * places)))
    on_own = (np.abs(hz / own_hz[:, None] - 1) < tolerance + 1.5 * df_hz / own_hz[:, None]).any(axis=0)
    score = np.where(on_own, 0.0, score)
    turns = hz / shaft
    return np.where(np.abs(turns - np.rint(turns)) * shaft < 1.2 * df_hz, 0.6 * score, score)


def _refined(env: Lines, hz: float) -> float:
    """A comb's rate by least squares over its interpolated peaks."""
    k = np.rint(env.peaks.hz / hz)
    own = (k >= 1) & (k <= 8) & (np.abs(env.peaks.hz - k * hz) < 1.2 * env.df_hz + 0.2 * env.df_hz * k)
    if not own.any():
        return hz
    return float((k[own] @ env.peaks.hz[own]) / (k[own] @ k[own]))
