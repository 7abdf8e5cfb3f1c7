"""Pooled features: lines, impact combs, level trends, a hump and a rail over all records of both parts together.

summaries of both parts, measured and simulated
    --lines of mean spectra, entry-exit combs, trends of levels, a hump, a rail--> features

Only features that calibration hardly affects are pooled: no parameter of a twin's baseline produces a line, a trend
within a fault, a narrow hump far from its own mode, or a level that is reached again and again and never exceeded. All
other features are compared on one part at a time.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from twingap.gap.features.impacts import impact_pair_comb
from twingap.gap.features.impacts.impulse_response import PLACES, ImpactSpectrum
from twingap.gap.features.pooled import faint, lines, trends
from twingap.gap.features.pooled.trends import Levels
from twingap.gap.features.spectrum import hump
from twingap.gap.features.spectrum.record_summary import RecordSummary
from twingap.gap.features.tones import subsynchronous
from twingap.records import Array
from twingap.signal.rails import best_rail


@dataclass(frozen=True)
class PooledRecords:
    """Records for pooled measurements, by their summaries."""

    summaries: tuple[RecordSummary, ...]

    @cached_property
    def lines(self) -> Array:
        """[lines.NAMES] Lines of the mean spectra."""
        found = lines.measure([summary.whitened for summary in self.summaries], self.summaries[0].frame.bearing)
        found["pair_level"] -= math.log(max(self.summaries[0].frame.scale, 1e-300))
        return np.array([found[name] for name in lines.NAMES])

    @cached_property
    def faint(self) -> Array:
        """[faint.NAMES] Lines that are faint in each record."""
        found = faint.measure([summary.whitened for summary in self.summaries], self.summaries[0].frame.scale)
        return np.array([found[name] for name in faint.NAMES])

    @cached_property
    def below(self) -> Array:
        """[subsynchronous.NAMES] The line below the shaft's order that records share."""
        return np.array(subsynchronous.measure([summary.whitened for summary in self.summaries]))

    @cached_property
    def noise(self) -> Array:
        """[impulse_response.PLACES] ln of the mean spectrum of healthy records (of all without any) over scale^2."""
        healthy = [s for s in self.summaries if s.condition.fault == "healthy"] or self.summaries
        logs = [np.log(np.maximum(s.smooth * s.fs_hz / s.frame.scale**2, 1e-30)) for s in healthy]
        ends = np.linspace(0, logs[0].size, PLACES + 1).astype(int)
        return np.asarray(np.add.reduceat(np.mean(logs, axis=0), ends[:-1]) / np.diff(ends))

    @cached_property
    def rail(self) -> float:
        """Evidence of a rail that the records share, see `signal.rails`."""
        return best_rail([extreme for summary in self.summaries for extreme in summary.extremes]).evidence

    @cached_property
    def impact_spectra(self) -> list[ImpactSpectrum]:
        """Impact spectra of the records with impacts."""
        return [summary.impact_spectrum for summary in self.summaries if summary.impact_spectrum is not None]


def feature_names() -> Sequence[str]:
    """Names of what `compare` returns, in its order."""
    return (
        *(f"comb|{name}" for name in impact_pair_comb.NAMES), *(f"trend|{name}" for name in trends.NAMES),
        *(f"pooled|{name}" for name in lines.NAMES), *(f"pooled|{name}.diff" for name in lines.NAMES),
        *(f"pooled|{name}" for name in faint.NAMES), *(f"pooled|{name}.diff" for name in faint.NAMES),
        *(f"pooled|{name}" for name in subsynchronous.NAMES), *(f"pooled|{name}.diff" for name in subsynchronous.NAMES),
        *(f"pooled|{name}" for name in hump.NAMES), "pooled|rail", "pooled|rail.diff",
    )  # fmt: skip


def levels(real: PooledRecords, simulated: PooledRecords) -> Levels:
    """Levels of the records that are in both sets, in the order of the first."""
    theirs = {summary.condition.name: summary for summary in simulated.summaries}
    ours = [summary for summary in real.summaries if summary.condition.name in theirs]
    return Levels.of(ours, [theirs[summary.condition.name] for summary in ours])


def compare(real: PooledRecords, simulated: PooledRecords, over: Levels) -> Array:
    """[features] Differences between measured and simulated records, with trends of `levels`; NaN where not known."""
    bearing = real.summaries[0].frame.bearing
    combs = impact_pair_comb.compare(
        real.impact_spectra, simulated.impact_spectra, bearing, real.noise - simulated.noise
    )
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # means of empty sets are NaN on purpose
        slopes = over.trends()
    first = [*(combs[name] for name in impact_pair_comb.NAMES), *(slopes[name] for name in trends.NAMES)]
    theirs = simulated.faint if _has_faint_lines(real.faint) else np.full(len(faint.NAMES), np.nan)
    ours = real.lines, real.lines - simulated.lines, real.faint, real.faint - theirs
    humps = hump.compare(real.summaries, simulated.summaries)
    last = [*(humps[name] for name in hump.NAMES), real.rail, real.rail - simulated.rail]
    return np.concatenate((first, *ours, real.below, real.below - simulated.below, last))


def _has_faint_lines(found: Array) -> bool:
    """Whether any kind of faint line stands out; where none does, nobody asks for the twin's."""
    named = dict(zip(faint.NAMES, found, strict=True))
    return any(named[f"faint_{kind}"] >= named[f"faint_{kind}_rival"] + 1 for kind in faint.KINDS)
