"""Simulation study that computes the table of `calibration` and evaluates the coverage of intervals.

law, seed --> simulated run --OnlineLife--> Checked, ... --learn--> table;  Checked, table --> coverage
law, spread of lives --> bench of six runs --> Checked, ... --Prior from the five others--> coverage

``python -m twingap.prognosis.interval_study`` prints the module `calibration_table`. With ``--check`` it prints the
coverage by law on runs of other seeds, including laws that were not used for the table: without other runs, and with
the five others of a bench, as `twingap rul --prior`.
"""

from __future__ import annotations

import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.calibration import TERMS, Posterior, calibrated
from twingap.prognosis.estimate import LifeOptions
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import Outcome, prior_from
from twingap.prognosis.past_errors import PastIntervals
from twingap.prognosis.simulated_runs import CALIBRATION_LAWS, LAWS, SimulatedRun, simulate_bench, simulate_run

Array = NDArray[np.float64]
_TAIL = 0.04
"""Tail probability on either side for which the table is fitted. Less than 5 %, since new runs, partly of other laws,
are covered less often than those of the fit; smaller widens intervals."""
SPREADS = (0.15, 0.35, 0.7, 1.2)
"""Standard deviations of log life on simulated benches: 0.15 as on the virtual rig, 1.2 as of a Weibull slope of
1.1."""


@dataclass(frozen=True)
class Checked:
    """Estimate at one row of a simulated run, with the true remaining life.

    Parameters
    ----------
    run : str
    posterior : Posterior
    true : float
        True remaining revolutions.
    lived : float
        Revolutions since the first row.
    """

    run: str
    posterior: Posterior
    true: float
    lived: float


def check_run(run: SimulatedRun, name: str, rows: int = 8) -> list[Checked]:
    """Estimates at evenly spaced rows from the alarm to the end of a run."""
    life = OnlineLife(LifeOptions(limit_ratio=run.limit_ratio))
    wanted: set[int] = set()
    left = run.remaining_revolutions
    found = []
    for row in range(run.time_s.size - 1):
        life.take(float(run.time_s[row]), float(run.speed_rpm[row]), float(run.peak_to_peak[row]))
        if life.alarm_row == row:
            wanted = {int(v) for v in np.linspace(row, run.time_s.size - 2, rows)}
        if row in wanted and life.end_row is None and (posterior := life.posterior()) is not None:
            found.append(Checked(name, posterior, float(left[row]), life.revolutions))
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
    """Table [3, TERMS] of quantile regression of log relative life, with equal weight for every run."""
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
    """Fraction of rows covered, below and above the interval, with equal weight for every run; and number of runs."""
    weight = _weights(checked)
    weight = weight / weight.sum()
    ends = np.array([calibrated(c.posterior, table) for c in checked])
    true = np.array([c.true for c in checked])
    below, above = true < ends[:, 0], true > ends[:, 2]
    runs = len({c.run for c in checked})
    return float(weight @ ~(below | above)), float(weight @ below), float(weight @ above), runs


def check_bench(law: str, spread: float, seed: int, rows: int = 20) -> list[list[Checked]]:
    """`check_run` of the runs of a bench, without runs that have no estimate."""
    rng = np.random.default_rng([seed, zlib.crc32(law.encode()), round(100 * spread)])
    found = [
        check_run(run, f"{law} {spread} {seed} {place}", rows)
        for place, run in enumerate(simulate_bench(rng, law, spread))
    ]
    return [own for own in found if own]


def with_other_runs(bench: Sequence[Sequence[Checked]]) -> Array:
    """Coverage and error of estimates with a prior from the other runs of a bench.

    Returns
    -------
    Array [runs, 3]
        Fraction of rows covered; mean absolute error of log life, with and without the others.
    """
    ended = [_outcome(own) for own in bench]
    found = []
    for place, own in enumerate(bench):
        prior = prior_from([*ended[:place], *ended[place + 1 :]])
        past = ended[place].past
        assert past is not None
        both = np.array([
            prior.joined(calibrated(c.posterior), c.lived, c.posterior.since_onset, c.posterior.per_row) for c in own
        ])  # fmt: skip
        inside = (both[:, 0] <= past.left) & (past.left <= both[:, 2])
        found.append((float(inside.mean()), past.log_error(both), past.log_error(past.growth)))
    return np.array(found)


def _outcome(run: Sequence[Checked]) -> Outcome:
    """Outcome of an ended run."""
    growth = np.array([calibrated(c.posterior) for c in run])
    lived, left, since = np.array([(c.lived, c.true, c.posterior.since_onset) for c in run]).T
    past = PastIntervals(growth, lived, since, left, run[-1].posterior.per_row)
    return Outcome(run[0].run, float(lived[-1] + left[-1]), float(since[-1] + left[-1]), None, past)


def _weights(checked: Sequence[Checked]) -> Array:
    _, inverse, counts = np.unique([c.run for c in checked], return_inverse=True, return_counts=True)
    return np.asarray(1 / counts[inverse])


def main() -> None:
    """Print the module of the table, or with --check the coverage of the shipped table."""
    if "--check" in sys.argv:
        for law in LAWS:
            share, below, above, runs = covered(study((law,), range(30_000, 30_060)))
            kind = "calibrated on" if law in CALIBRATION_LAWS else "not used"
            print(f"{law:12s} {kind:13s} {runs} runs: covered {share:.3f}, below {below:.3f}, above {above:.3f}")
        print("With the five other runs of a bench:")
        every = {
            (law, spread): np.concatenate(
                [with_other_runs(check_bench(law, spread, seed)) for seed in range(40_000, 40_003)]
            )
            for law in LAWS
            for spread in SPREADS
        }
        for shared in (*LAWS, *SPREADS):
            own = np.concatenate([found for about, found in every.items() if shared in about])
            share, error, alone = own.mean(axis=0)
            print(f"{shared!s:12s} {len(own)} runs: covered {share:.3f}, log life {error:.3f} off, {alone:.3f} alone")
        return
    print('"""Coefficients of `calibration`, made by `interval_study`: 5 %, 50 % and 95 % of log life."""\n')
    print("from typing import Final\n\n# fmt: off\nTABLE: Final = (")
    for row in learn(study(CALIBRATION_LAWS, range(200))):
        print("    (" + ", ".join(f"{v:.4f}" for v in row) + "),")
    print(")\n# fmt: on")


if __name__ == "__main__":
    main()
