"""What is asked of all records that there are, of both parts together: what calibration hardly moves.

outlines of both parts, measured and simulated --lines of mean spectra, combs of second strikes, levels--> features

No parameter of a twin's baseline makes a line or a trend within a fault. A mode that calibration missed by a tenth of
its frequency looks a little like a comb, and learning has met such; all else is asked of the part that is held out.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.impacts import impact_pair_comb as two_strikes
from twingap.gap.features.impacts.impulse_response import PLACES, Struck
from twingap.gap.features.pooled import lines as pooled
from twingap.gap.features.pooled import trends
from twingap.gap.features.pooled.trends import Levels
from twingap.gap.features.spectrum.record_summary import Outline

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Whole:
    """Records that are asked together.

    Parameters
    ----------
    outlines : tuple of Outline
        One of each record.
    """

    outlines: tuple[Outline, ...]

    @cached_property
    def pooled(self) -> Array:
        """[pooled.NAMES] Lines of the mean spectra."""
        found = pooled.measure([outline.whitened for outline in self.outlines], self.outlines[0].frame.bearing)
        return np.array([found[name] for name in pooled.NAMES])

    @cached_property
    def noise(self) -> Array:
        """[answer.PLACES] ln of the mean spectrum of healthy records, of all without any, over the yardstick."""
        healthy = [o for o in self.outlines if o.condition.fault == "healthy"] or self.outlines
        logs = [np.log(np.maximum(o.smooth * o.fs_hz / o.frame.scale**2, 1e-30)) for o in healthy]
        ends = np.linspace(0, logs[0].size, PLACES + 1).astype(int)
        return np.asarray(np.add.reduceat(np.mean(logs, axis=0), ends[:-1]) / np.diff(ends))

    @cached_property
    def struck(self) -> list[Struck]:
        """Of records with impacts."""
        return [outline.struck for outline in self.outlines if outline.struck is not None]


def feature_names() -> Sequence[str]:
    """Names of what `compare` returns, in its order."""
    return (
        *(f"comb|{name}" for name in two_strikes.NAMES), *(f"trend|{name}" for name in trends.NAMES),
        *(f"pooled|{name}" for name in pooled.NAMES), *(f"pooled|{name}.diff" for name in pooled.NAMES),
    )  # fmt: skip


def levels(real: Whole, simulated: Whole) -> Levels:
    """Of records that both sides have, in the order of the first."""
    theirs = {outline.condition.name: outline for outline in simulated.outlines}
    ours = [outline for outline in real.outlines if outline.condition.name in theirs]
    return Levels.of(ours, [theirs[outline.condition.name] for outline in ours])


def compare(real: Whole, simulated: Whole, over: Levels) -> Array:
    """[features] What tells measured records from simulated ones; NaN where nobody knows.

    Parameters
    ----------
    real, simulated : Whole
    over : Levels
        What trends are asked of: see `levels`.
    """
    bearing = real.outlines[0].frame.bearing
    combs = two_strikes.compare(real.struck, simulated.struck, bearing, real.noise - simulated.noise)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # means of nothing are NaN, and meant so
        courses = over.trends()
    told = [*(combs[name] for name in two_strikes.NAMES), *(courses[name] for name in trends.NAMES)]
    return np.concatenate((told, real.pooled, real.pooled - simulated.pooled))
