"""Makes the table of `calibration` from simulated runs, and checks coverage on others.

law, seed --> simulated run --OnlineLife--> Checked, ... --learn--> table;  Checked, table --> coverage
                                                             --errors of other runs of the law--> wider --> coverage

Run as ``python -m twingap.prognosis.interval_study`` it prints the module `calibration_table`; with ``--check``, the
coverage on runs of other seeds, law by law, among them laws that the table was not made from, without other runs and
with five of the same law whose end is known.
"""

from __future__ import annotations

import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.calibration import TERMS, Posterior, calibrated
from twingap.prognosis.online import LifeOptions, OnlineLife
from twingap.prognosis.past_errors import errors, widened, widening
from twingap.prognosis.simulated_runs import CALIBRATION_LAWS, LAWS, SimulatedRun, simulate_run

Array = NDArray[np.float64]
_TAIL = 0.04
"""Left out at either side where the table is made, for intervals of 90 %: new runs, of laws of which a part was not
used, are covered less often than those that the table was made from."""


@dataclass(frozen=True)
class Checked:
    """One row of a simulated run at which remaining life was estimated.

    Parameters
    ----------
    run : str
    posterior : Posterior
    true : float
        Remaining revolutions.
    """

    run: str
    posterior: Posterior
    true: float


def check_run(run: SimulatedRun, name: str, rows: int = 8) -> list[Checked]:
    """Estimates at evenly spaced rows from the alarm to the end of a run."""
    life = OnlineLife(LifeOptions(limit_ratio=run.limit_ratio))
    asked: set[int] = set()
    left = run.remaining_revolutions
    found = []
    for row in range(run.time_s.size - 1):
        life.take(float(run.time_s[row]), float(run.speed_rpm[row]), float(run.peak_to_peak[row]))
        if life.alarm_row == row:
            asked = {int(v) for v in np.linspace(row, run.time_s.size - 2, rows)}
        if row in asked and life.end_row is None and (posterior := life.posterior()) is not None:
            found.append(Checked(name, posterior, float(left[row])))
    return found


def study(laws: Sequence[str], seeds: Sequence[int], rows: int = 8) -> list[Checked]:
    """`check_run` on runs of these laws and seeds."""
    found = []
    for seed in seeds:
        for law in laws:
            rng = np.random.default_rng([seed, zlib.crc32(law.encode())])
            found += check_run(simulate_run(rng, law), f"{law} {seed}", rows)
    return found


def learn(checked: Sequence[Checked]) -> Array:
    """The table [3, TERMS]: linear quantiles of log life over that since the onset, every run weighing the same."""
    from sklearn.linear_model import QuantileRegressor

    x = np.array([c.posterior.terms for c in checked])
    y = np.array([c.posterior.relative(c.true) for c in checked])
    mean, std = x[:, 1:].mean(axis=0), x[:, 1:].std(axis=0)
    weight = _weights(checked)
    table = np.empty((3, TERMS))
    for row, share in enumerate((_TAIL, 0.5, 1 - _TAIL)):
        fit = QuantileRegressor(quantile=share, alpha=1e-3, solver="highs")
        fit.fit((x[:, 1:] - mean) / std, y, sample_weight=weight / weight.mean())
        table[row, 1:] = fit.coef_ / std
        table[row, 0] = fit.intercept_ - np.sum(fit.coef_ * mean / std)
    return table


def covered(checked: Sequence[Checked], table: Array | None = None) -> tuple[float, float, float, int]:
    """Share of rows covered, below and above the interval, every run weighing the same; and runs."""
    weight = _weights(checked)
    weight = weight / weight.sum()
    ends = np.array([calibrated(c.posterior, table) for c in checked])
    true = np.array([c.true for c in checked])
    below, above = true < ends[:, 0], true > ends[:, 2]
    runs = len({c.run for c in checked})
    return float(weight @ ~(below | above)), float(weight @ below), float(weight @ above), runs


def informed(checked: Sequence[Checked], past: int = 5) -> tuple[float, float]:
    """Coverage with so many other runs whose end is known, and the median factor that they ask for.

    Parameters
    ----------
    checked : sequence of Checked
        Of one law; each run is judged with the `past` runs after it, in a circle.
    past : int
    """
    runs: dict[str, list[Checked]] = {}
    for c in checked:
        runs.setdefault(c.run, []).append(c)
    told = [_errors(own) for own in runs.values()]
    shares, factors = [], []
    for place, own in enumerate(runs.values()):
        factor = widening([told[(place + k) % len(told)] for k in range(1, past + 1)])
        ends = [widened(calibrated(c.posterior), factor, c.posterior.per_row / 2) for c in own]
        shares.append(np.mean([low <= c.true <= high for c, (low, _, high) in zip(own, ends, strict=True)]))
        factors.append(factor)
    return float(np.mean(shares)), float(np.median(factors))


def _errors(run: Sequence[Checked]) -> Array:
    low, middle, high = np.array([calibrated(c.posterior) for c in run]).T
    return errors(middle, low, high, np.array([c.true for c in run]), run[0].posterior.per_row / 2)


def _weights(checked: Sequence[Checked]) -> Array:
    _, inverse, counts = np.unique([c.run for c in checked], return_inverse=True, return_counts=True)
    return np.asarray(1 / counts[inverse])


def main() -> None:
    """Print the module of the table, or with --check the coverage of the one in force."""
    if "--check" in sys.argv:
        for law in LAWS:
            checked = study((law,), range(30_000, 30_060))
            share, below, above, runs = covered(checked)
            with_past, factor = informed(checked)
            kind = "calibrated on" if law in CALIBRATION_LAWS else "not used"
            print(
                f"{law:12s} {kind:13s} {runs} runs: covered {share:.3f}, below {below:.3f}, above {above:.3f}; "
                f"with five of its kind {with_past:.3f}, intervals {factor:.2f} times as wide"
            )
        return
    print('"""Coefficients of `calibration`, made by `interval_study`: 5 %, 50 % and 95 % of log life."""\n')
    print("from typing import Final\n\n# fmt: off\nTABLE: Final = (")
    for row in learn(study(CALIBRATION_LAWS, range(200))):
        print("    (" + ", ".join(f"{v:.4f}" for v in row) + "),")
    print(")\n# fmt: on")


if __name__ == "__main__":
    main()
