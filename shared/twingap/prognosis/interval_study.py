"""Makes the table of `calibration` from simulated runs, and checks coverage on others.

law, seed --> simulated run --OnlineLife--> Checked, ... --learn--> table;  Checked, table --> coverage

Run as ``python -m twingap.prognosis.interval_study``: prints the module `calibration_table` and, on standard error, the
coverage on runs of other seeds, and on those of laws that the table was not made from.
"""

from __future__ import annotations

import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.prognosis.calibration import PROGRESS, ROWS, Posterior, calibrated
from twingap.prognosis.online import LifeOptions, OnlineLife
from twingap.prognosis.simulated_runs import CALIBRATION_LAWS, LAWS, SimulatedRun, simulate_run

Array = NDArray[np.float64]
_FEWEST = 60
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
    """The table: lower stretch, shift of the median, upper stretch by stage [rows, progress, 3]."""
    _, inverse, counts = np.unique([c.run for c in checked], return_inverse=True, return_counts=True)
    weight = 1 / counts[inverse]
    stage = np.array([c.posterior.stage for c in checked])
    error = np.array([c.posterior.in_log(c.true) - c.posterior.in_log(c.posterior.middle) for c in checked])
    down, up = np.array([c.posterior.half_widths for c in checked]).T
    table = np.ones((len(ROWS) + 1, len(PROGRESS) + 1, 3))
    for row, column in np.ndindex(*table.shape[:2]):
        here = (stage[:, 0] == row) & (stage[:, 1] == column)
        if here.sum() < _FEWEST:
            here = stage[:, 1] == column
        w = weight[here]
        table[row, column] = (
            max(-_quantile(error[here] / down[here], w, _TAIL), 0.0),
            _quantile(error[here], w, 0.5),
            max(_quantile(error[here] / up[here], w, 1 - _TAIL), 0.0),
        )
    return table


def covered(checked: Sequence[Checked]) -> tuple[float, float, float, int]:
    """Share of rows covered, below and above the interval, every run the same; and runs."""
    _, inverse, counts = np.unique([c.run for c in checked], return_inverse=True, return_counts=True)
    weight = 1 / counts[inverse] / counts.size
    ends = np.array([calibrated(c.posterior) for c in checked])
    true = np.array([c.true for c in checked])
    below, above = true < ends[:, 0], true > ends[:, 2]
    return float(weight @ ~(below | above)), float(weight @ below), float(weight @ above), int(counts.size)


def _quantile(values: Array, weights: Array, share: float) -> float:
    order = np.argsort(values, kind="stable")
    places = (np.cumsum(weights[order]) - weights[order] / 2) / weights.sum()
    return float(np.interp(share, places, values[order]))


def main() -> None:
    """Print the table; its coverage goes to standard error."""
    table = learn(study(CALIBRATION_LAWS, range(150)))
    print(
        '"""Corrections of `calibration`, made by `interval_study`: lower stretch, shift, upper stretch by stage."""\n'
    )
    print("from typing import Final\n\n# fmt: off\nTABLE: Final = (")
    for row in table:
        print("    (" + ", ".join("(" + ", ".join(f"{v:.3f}" for v in cell) + ")" for cell in row) + "),")
    print(")\n# fmt: on")


def coverage_by_law(seeds: Sequence[int]) -> dict[str, tuple[float, float, float, int]]:
    """`covered` for each law of `LAWS`, with the table in force."""
    return {law: covered(study((law,), seeds)) for law in LAWS}


if __name__ == "__main__":
    if "--check" in sys.argv:
        for law, (share, below, above, runs) in coverage_by_law(range(10_000, 10_060)).items():
            kind = "calibrated on" if law in CALIBRATION_LAWS else "not used"
            print(f"{law:12s} {kind:13s} {runs} runs: covered {share:.3f}, below {below:.3f}, above {above:.3f}")
    else:
        main()
