"""Simulated amplitudes of runs to failure by many growth laws, for calibration and evaluation of intervals.

law, speed profile, scatter, end level --> time, speed, peak to peak [rows], row at which life ends

Only amplitudes are simulated, since the estimator uses nothing else of a record. Runs deviate from their law: rates
vary slowly, amplitude scatters with a long tail and autocorrelation, and damage may begin with a jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Law = Callable[[Array, np.random.Generator], Array]


@dataclass(frozen=True)
class SimulatedRun:
    """Simulated run from its healthy beginning to its end of life.

    Parameters
    ----------
    law : str
    time_s, speed_rpm, peak_to_peak : Array [rows]
        The last row is the first whose normalised amplitude reaches `limit_ratio`.
    onset_row : int
        First row with damage.
    limit_ratio : float
        Amplitude at the end of life relative to the healthy one at the same speed.
    revolutions : Array [rows]
        Revolutions since the first row.
    """

    law: str
    time_s: Array
    speed_rpm: Array
    peak_to_peak: Array
    onset_row: int
    limit_ratio: float
    revolutions: Array

    @property
    def remaining_revolutions(self) -> Array:
        """Remaining revolutions [rows], 0 at the last row."""
        return np.asarray(self.revolutions[-1] - self.revolutions)


def _exponential(share: Array, rng: np.random.Generator) -> Array:
    """Exponential growth, eq. 12 of paper 1."""
    return share


def _bent(share: Array, rng: np.random.Generator) -> Array:
    """Growth rate as a power of damage: d(log D)/du ~ D^q, q from linear to accelerating growth."""
    q, span = rng.uniform(-1.0, 2.0), rng.uniform(1.5, 3.5)
    if abs(q) < 0.02:
        return share
    return np.asarray(-np.log1p(-share * -np.expm1(-q * span)) / (q * span))


def _power(share: Array, rng: np.random.Generator) -> Array:
    """Amplitude 1 + c t^b."""
    top, b = rng.uniform(3.0, 30.0), rng.uniform(0.7, 6.0)
    return np.asarray(np.log1p(top * share**b) / np.log1p(top))


def _two_phases(share: Array, rng: np.random.Generator) -> Array:
    """Slow and then fast exponential growth, as of a spall that spreads to the next roller."""
    turn, height = rng.uniform(0.4, 0.85), rng.uniform(0.15, 0.6)
    return np.asarray(np.interp(share, [0, turn, 1], [0, height, 1]))


def _paris(share: Array, rng: np.random.Generator) -> Array:
    """Paris' law: growth rate of a spall as a power of its length, on top of the healthy amplitude."""
    m, ratio = rng.uniform(1.2, 3.0), rng.uniform(5.0, 40.0)
    start = 0.05 * ratio
    p = 1 - m
    length = (start**p + share * (ratio**p - start**p)) ** (1 / p)
    return np.asarray(np.log1p(length - start) / np.log1p(ratio - start))


def _steps(share: Array, rng: np.random.Generator) -> Array:
    """Growth in bursts."""
    count = int(rng.integers(4, 12))
    places, sizes = np.sort(rng.uniform(0.0, 1.0, count)), rng.dirichlet(np.ones(count))
    burst = np.clip((share[:, None] - places) / 0.05, 0, 1) @ sizes
    return np.asarray(0.6 * share + 0.4 * burst / max(burst[-1], 1e-9))


def _logistic(share: Array, rng: np.random.Generator) -> Array:
    """A rise that slows down while the edges of the spall are rolled out, then further growth."""
    middle, width = rng.uniform(0.2, 0.5), rng.uniform(0.05, 0.15)
    rise = 1 / (1 + np.exp(-(share - middle) / width))
    rise = (rise - rise[0]) / (rise[-1] - rise[0])
    part = rng.uniform(0.3, 0.6)
    return np.asarray(part * rise + (1 - part) * share ** rng.uniform(1.5, 4.0))


def _plateau(share: Array, rng: np.random.Generator) -> Array:
    """A rise, a long plateau that may decrease, and an abrupt end, as in most of the public FEMTO runs."""
    height, rise, end = rng.uniform(0.15, 0.6), rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.15)
    rest = height * rng.uniform(0.6, 1.2)
    return np.asarray(np.interp(share, [0, rise, 1 - end, 1], [0, height, rest, 1]))


LAWS: Final[dict[str, Law]] = {
    "exponential": _exponential, "bent": _bent, "power": _power, "two phases": _two_phases, "plateau": _plateau,
    "paris": _paris, "steps": _steps, "logistic": _logistic,
}  # fmt: skip
CALIBRATION_LAWS: Final = ("exponential", "bent", "power", "two phases", "plateau")
"""Laws on which intervals are calibrated; the others are used for evaluation only."""


def simulate_run(
    rng: np.random.Generator, law: str, *, rows: int | None = None, varying: bool | None = None
) -> SimulatedRun:
    """Random run of a growth law.

    Parameters
    ----------
    rng : Generator
    law : str
        Key of `LAWS`.
    rows : int, optional
        Rows from the onset to the nominal end of the law; log-uniform from 15 to 1500 when absent.
    varying : bool, optional
        Whether speed varies in steps of 100 rpm from 1000 to 2000 and back, with a random resonance. When absent, a
        third of the runs.

    Returns
    -------
    SimulatedRun
    """
    after = int(np.exp(rng.uniform(np.log(15), np.log(1500)))) if rows is None else rows
    before = int(rng.integers(70, 300))
    varying = bool(rng.uniform() < 1 / 3) if varying is None else varying
    n = before + 3 * after
    dt_s = float(np.exp(rng.uniform(np.log(1), np.log(600))))
    if varying:
        hold = int(rng.integers(1, 5))
        steps = np.concatenate((np.arange(1000, 2000, 100), np.arange(2000, 1000, -100)))
        speed = steps[(np.arange(n) // hold) % steps.size].astype(float)
        resonance, width = rng.uniform(900, 2100), rng.uniform(80, 400)
        gain = speed**1.2 * (1 + rng.uniform(0, 3) / (1 + ((speed - resonance) / width) ** 2)) / 3000
    else:
        speed = np.full(n, rng.uniform(300, 6000))
        gain = np.full(n, float(np.exp(rng.normal())))
    # Wear per revolution with a slowly varying rate: an Ornstein-Uhlenbeck process in log rate.
    pace = np.exp(_wander(rng, n, memory=after * rng.uniform(0.03, 0.3), std=rng.uniform(0.0, 0.4)))
    worn = np.cumsum(np.where(np.arange(n) >= before, speed * pace, 0.0))
    worn /= after * float(np.mean(speed))
    ratio = float(np.exp(rng.uniform(np.log(4), np.log(30))))
    share = np.linspace(0, 1, 2001)
    curve = LAWS[law](share, rng)
    slope = max(float(curve[-1] - curve[-101]) / 0.05, 0.5)
    beyond = curve[-1] + slope * np.maximum(worn - 1, 0)
    jump = rng.choice([0.0, rng.uniform(0.0, 0.3)])
    shape = np.where(worn < 1, np.interp(worn, share, curve), beyond)
    level = np.log(ratio) * np.where(worn > 0, jump + (1 - jump) * shape, 0.0)
    std = rng.uniform(0.03, 0.2)
    part = rng.uniform(0.0, 0.5)
    tail = (rng.gumbel(size=n) - np.euler_gamma) * np.sqrt(6) / np.pi
    scatter = std * (np.sqrt(1 - part) * tail + np.sqrt(part) * _wander(rng, n, memory=rng.uniform(1, 5), std=1.0))
    normalised = np.exp(level + scatter)
    beyond_limit = np.flatnonzero((normalised >= ratio) & (np.arange(n) > before))
    if beyond_limit.size == 0:  # wear is too slow for the number of rows
        return simulate_run(rng, law, rows=rows, varying=varying)
    last = int(beyond_limit[0])
    time_s = np.asarray(np.arange(n) * dt_s, float)
    turns = np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * dt_s / 60)))
    cut = slice(0, last + 1)
    return SimulatedRun(
        law,
        time_s[cut],
        np.asarray(speed, float)[cut],
        np.asarray(gain * normalised, float)[cut],
        before,
        ratio,
        turns[cut],
    )


def simulate_bench(rng: np.random.Generator, law: str, spread: float, runs: int = 6) -> list[SimulatedRun]:
    """Random runs of a growth law on one bench, with lives about a common value of 30 to 500 rows.

    There is one row per revolution on average.

    Parameters
    ----------
    rng : Generator
    law : str
        Key of `LAWS`.
    spread : float
        Standard deviation of the logarithm of the life after the onset.
    runs : int
    """
    usual = rng.uniform(np.log(30), np.log(500))
    drawn = []
    for _ in range(runs):
        run = simulate_run(rng, law, rows=max(12, round(np.exp(usual + spread * rng.normal()))))
        per_row = float(run.revolutions[-1]) / (run.revolutions.size - 1)
        drawn.append(replace(run, time_s=run.time_s / per_row, revolutions=run.revolutions / per_row))
    return drawn


def _wander(rng: np.random.Generator, n: int, *, memory: float, std: float) -> Array:
    """First-order autoregressive noise [n] with correlation length `memory`, rows, and standard deviation `std`."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1 / max(memory, 1e-3)))
    noise = rng.normal(size=n) * std * np.sqrt(1 - keep**2)
    start = rng.normal() * std
    return np.asarray(lfilter([1.0], [1.0, -keep], noise, zi=[keep * start])[0])
