"""Drift detector: two-sided cumulative sums on several charts, with a false-alarm rate that is computed.

Page's sums (1954, doi:10.1093/biomet/41.1-2.100), S+ = max(0, S+ + z - k), raise an alarm at S > h. Their mean run
length without drift is found by Brook and Evans' Markov chain (1972, doi:10.1093/biomet/59.3.539). The mean against
which residuals are taken is itself an average of some snapshots: its error, which lets sums climb, is averaged over.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import ndtr

from twingap import TwingapError

CELLS: Final = 80  # states of the Markov chain: run lengths to about one percent
NODES: Final = 16  # of the quadrature over the baseline's error
HIGHEST: Final = 100.0  # threshold, standard deviations, beyond which a detector is of no use
LONGEST: Final = 1e12  # run length, samples, that counts as never


def run_length(threshold: float, allowance: float, offset: float = 0.0) -> float:
    """Mean number of samples until a one-sided sum of normal residuals (mean `offset`, variance 1) passes."""
    width = 2 * threshold / (2 * CELLS - 1)
    states = width * np.arange(CELLS)
    upper = states[None, :] + width / 2 - states[:, None] + allowance - offset
    inside = ndtr(upper)
    step = np.diff(inside, axis=1, prepend=0.0)  # the first cell takes all that falls below it
    found = float(np.linalg.solve(np.eye(CELLS) - step, np.ones(CELLS))[0])
    # Beyond some 1e12 samples the equations are singular to rounding.
    return found if 0 < found < LONGEST else LONGEST


def false_alarms(threshold: float, allowance: float, charts: int, baseline: int | None = None) -> float:
    """Alarms per sample of two-sided charts without drift, at most: added up as if none coincided. `baseline` samples
    make the mean in use; None: it is known."""
    if baseline is None:
        return 2 * charts / run_length(threshold, allowance)
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    rates = [1 / run_length(threshold, allowance, float(v) / np.sqrt(baseline)) for v in nodes]
    return float(2 * charts * (weights @ rates) / weights.sum())


@lru_cache(maxsize=64)
def threshold_for(rate: float, allowance: float, charts: int, baseline: int | None = None) -> float:
    """The threshold at which there are `rate` false alarms per sample; raises `TwingapError` where there is none."""
    if not 0 < rate < 0.5:
        raise TwingapError(f"rate = {rate!r}, between 0 and 0.5 expected", where="drift detector")

    def excess(h: float) -> float:
        return float(np.log(false_alarms(h, allowance, charts, baseline) / rate))

    low, high = 0.1, 0.2
    if excess(low) < 0:
        return low
    while excess(high) > 0:
        low, high = high, 1.5 * high
        if high > HIGHEST:
            raise TwingapError(
                f"no threshold below {HIGHEST:g} has {rate:g} false alarms per sample with a baseline of {baseline}",
                where="drift detector", mend="raise the rate, the allowance or the baseline",
            )  # fmt: skip
    return float(brentq(excess, low, high, xtol=1e-3))


@dataclass(frozen=True)
class Alarm:
    """A chart that has passed its threshold."""

    chart: str
    direction: str  # one of "up", "down"
    sum: float  # where the sum stands, in standard deviations
    threshold: float
    since: int  # samples since its sum last was zero: the likeliest beginning of the drift


class DriftDetector:
    """Two-sided charts, by name: `rate` false alarms per sample, all together; `allowance` k, standard deviations, half
    the drift that should be found soonest; `baseline` samples behind the mean, if it is not known."""

    def __init__(
        self, charts: Sequence[str], rate: float = 0.002, allowance: float = 1.0, baseline: int | None = None
    ) -> None:
        self.charts, self.allowance = tuple(charts), allowance
        self.threshold = threshold_for(rate, allowance, len(self.charts), baseline)
        self.reset()

    def reset(self) -> None:
        self.sums = np.zeros((2, len(self.charts)))
        self._since = np.zeros((2, len(self.charts)), int)

    def push(self, z: ArrayLike) -> Alarm | None:
        """Take one residual per chart [charts]; the alarm whose sum is highest, if any."""
        values = np.asarray(z, dtype=np.float64)
        self.sums = np.maximum(self.sums + np.array([values, -values]) - self.allowance, 0.0)
        self._since = np.where(self.sums > 0, self._since + 1, 0)
        side, chart = (int(v) for v in np.unravel_index(int(self.sums.argmax()), self.sums.shape))
        if self.sums[side, chart] <= self.threshold:
            return None
        return Alarm(
            self.charts[chart], ("up", "down")[side], float(self.sums[side, chart]), self.threshold,
            int(self._since[side, chart]),
        )  # fmt: skip
