"""A dozen order statistics of each record, which every view of a gap asks for, against NumPy's sort and partition."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import Measurement, Target, in_turn, ratio
from twingap.signal.order_statistics import order_statistics

Array = NDArray[np.float64]

QUANTILES = np.array([0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 1.0])


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Moduli of one-second records at 12 and 51.2 kHz, noise and impacts; every record another one.

    The same record again and again would be sorted by a branch predictor that knows it by heart.
    """
    records, rounds = (8, 3) if quick else (100, 5)
    rows: list[dict[str, Any]] = []
    least, against = float("inf"), "np.sort"
    for samples in (12_000, 51_200):
        ranks = np.ceil(QUANTILES * samples).astype(int) - 1
        made = _records(records, samples, np.random.default_rng(seed))
        rivals: dict[str, Callable[[], object]] = {
            against: partial(_each, lambda x, r=ranks: np.sort(x)[r], made),
            "np.partition": partial(_each, lambda x, r=ranks: np.partition(x, r)[r], made),
            "a pass over the samples": partial(_each, np.max, made),
            "twingap": partial(_each, lambda x, r=ranks: order_statistics(x, r), made),
        }
        if not all(np.array_equal(order_statistics(x, ranks), np.sort(x)[ranks]) for x in made):
            raise AssertionError("order statistics differ from those of sorted samples")
        seconds = in_turn(rivals, rounds)
        least = min(least, ratio(seconds[against], seconds["twingap"]))
        rows += [
            {
                "samples": samples,
                "rival": name,
                "us per record": 1e6 * statistics.median(took) / records,
                f"times {against}": ratio(seconds[against], took),
            }
            for name, took in seconds.items()
        ]
    notes = ["floor: one pass over the samples; three are made here, and one that writes as much as half of them"]
    return Measurement(
        f"{QUANTILES.size} order statistics of each of {records} records", rows,
        (Target(f"times {against}, the slower size", least, 2.0),), notes,
    )  # fmt: skip


def _each(function: Callable[[Array], object], records: list[Array]) -> None:
    for x in records:
        function(x)


def _records(count: int, samples: int, rng: np.random.Generator) -> list[Array]:
    """Moduli of noise, every second with a hundred impacts as high as twenty times its rms."""
    made = []
    for number in range(count):
        x = rng.standard_normal(samples)
        if number % 2:
            x[rng.integers(0, samples, 100)] *= 20 * rng.random(100)
        made.append(np.abs(x))
    return made
