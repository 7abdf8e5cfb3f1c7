"""Simulated runs to failure of many growth laws: amplitudes only, for calibration and checks of intervals.

law, speed profile, scatter, end level --> time, speed, peak to peak [rows], row at which life ends

They are simulated runs, not vibration: what the estimator sees of a record is its amplitude. None of the laws is
followed exactly: rates wander, amplitude scatters with a long tail and with memory, damage may begin with a jump.
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
    """One run, from its healthy beginning to its end of life.

    Parameters
    ----------
    law : str
    time_s, speed_rpm, peak_to_peak : Array [rows]
        The last row is the first whose normalised amplitude reaches `limit_ratio`.
    onset_row : int
        Where damage begins.
    limit_ratio : float
        Amplitude at the end of life over the healthy one at the same speed.
    revolutions : Array [rows]
        Since the first row.
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
        """At every row, 0 at the last."""
        return np.asarray(self.revolutions[-1] - self.revolutions)


def _exponential(share: Array, rng: np.random.Generator) -> Array:
    """Eq. 12 of paper 1."""
    return share


def _bent(share: Array, rng: np.random.Generator) -> Array:
    """Powers of damage: log amplitude 0 .. 1 by d(log D)/du ~ D^q, q from linear growth to runaway."""
    q, span = rng.uniform(-1.0, 2.0), rng.uniform(1.5, 3.5)
    if abs(q) < 0.02:
        return share
    return np.asarray(-np.log1p(-share * -np.expm1(-q * span)) / (q * span))


def _power(share: Array, rng: np.random.Generator) -> Array:
    """Amplitude 1 + c t^b."""
    top, b = rng.uniform(3.0, 30.0), rng.uniform(0.7, 6.0)
    return np.asarray(np.log1p(top * share**b) / np.log1p(top))


def _two_phases(share: Array, rng: np.random.Generator) -> Array:
    """Slow exponential growth, then fast: a spall that spreads to the next roller."""
    turn, height = rng.uniform(0.4, 0.85), rng.uniform(0.15, 0.6)
    return np.asarray(np.interp(share, [0, turn, 1], [0, height, 1]))


def _paris(share: Array, rng: np.random.Generator) -> Array:
    """Length of a spall whose growth rate is a power of its length; amplitude 1 + its length over the healthy floor."""
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
    """A rise that slows as the spall is rolled flat, before it goes on."""
    middle, width = rng.uniform(0.2, 0.5), rng.uniform(0.05, 0.15)
    rise = 1 / (1 + np.exp(-(share - middle) / width))
    rise = (rise - rise[0]) / (rise[-1] - rise[0])
    part = rng.uniform(0.3, 0.6)
    return np.asarray(part * rise + (1 - part) * share ** rng.uniform(1.5, 4.0))


def _plateau(share: Array, rng: np.random.Generator) -> Array:
    """A rise, a long rest that may even sink, and an abrupt end: what most of the public FEMTO runs look like."""
    height, rise, end = rng.uniform(0.15, 0.6), rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.15)
    rest = height * rng.uniform(0.6, 1.2)
    return np.asarray(np.interp(share, [0, rise, 1 - end, 1], [0, height, rest, 1]))


LAWS: Final[dict[str, Law]] = {
    "exponential": _exponential, "bent": _bent, "power": _power, "two phases": _two_phases, "plateau": _plateau,
    "paris": _paris, "steps": _steps, "logistic": _logistic,
}  # fmt: skip
CALIBRATION_LAWS: Final = ("exponential", "bent", "power", "two phases", "plateau")
"""Those on which intervals are calibrated; the others are kept for checking."""


def simulate_run(
    rng: np.random.Generator, law: str, *, rows: int | None = None, varying: bool | None = None
) -> SimulatedRun:
    """Draw a run of this law.

    Parameters
    ----------
    rng : Generator
    law : str
        Key of `LAWS`.
    rows : int, optional
        Rows from the onset to the end that the law foresees; 15 to 1500 when absent, log-uniform.
    varying : bool, optional
        Speed in steps of 100 rpm from 1000 to 2000 and back, at a resonance of its own, instead of constant. When
        absent, every third run.

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
    # Wear counts revolutions, at a rate that wanders: an Ornstein-Uhlenbeck process in log rate.
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
    if beyond_limit.size == 0:  # the wear wandered too slowly for the rows drawn
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
    """Draw runs of this law on one bench: one row a revolution on average, lives about a usual one of 30 to 500 rows.

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
    """First-order autoregression of unit memory in rows."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1 / max(memory, 1e-3)))
    noise = rng.normal(size=n) * std * np.sqrt(1 - keep**2)
    start = rng.normal() * std
    return np.asarray(lfilter([1.0], [1.0, -keep], noise, zi=[keep * start])[0])
