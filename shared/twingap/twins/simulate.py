"""Simulation of a twin's records for given conditions."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.records.conditions import read_conditions
from twingap.twins.population import conditions_of, machines
from twingap.twins.twin_file import TwinSpec, build_twin, read_twin, scaled_for

FilePath = str | os.PathLike[str]


def simulate(
    records: RecordSet | Sequence[Condition] | FilePath,
    twin: TwinSpec | FilePath,
    *,
    seed: int | np.random.Generator = 0,
    population: int | None = None,
    device: str = "cpu",
    progress: Callable[[str, float], None] | None = None,
) -> RecordSet:
    """Simulate a twin's records.

    Parameters
    ----------
    records : RecordSet, sequence of Condition, or path-like
        Conditions to simulate (speed, fault, load, time, rate, length): those of a record set, of a table, or given.
    twin : TwinSpec or path-like
        What is modelled, or its twin file.
    seed : int or numpy.random.Generator
        Same seed, same samples.
    population : int, optional
        Number of machines to draw from the spread of the twin's values over units (`twingap.twins.population`); each
        has a record per condition. None for the twin itself.
    device : {"cpu", "cuda"}
        "cuda": on an NVIDIA GPU, many records at once, the same within rounding (`Twin.on`).
    progress : callable, optional
        Called with the current step and the fraction done, 0 to 1.

    Returns
    -------
    RecordSet
        One record per condition (and machine), in the twin's own unit where its file states one, else in that of the
        conditions, else in m/s^2.

    Raises
    ------
    TwingapError
        When a file cannot be read, the bearing is not known, an effect cannot act on a condition, or there is no GPU.
    """
    spec = twin if isinstance(twin, TwinSpec) else read_twin(twin)
    unit: str | None = None
    bearing: Bearing | None = None
    if isinstance(records, RecordSet):
        conditions, unit, bearing = tuple(records.conditions), records.unit, records.bearing
    elif isinstance(records, (str, os.PathLike)):
        stated = read_conditions(Path(records))
        conditions, unit, bearing = tuple(stated.conditions), stated.unit, stated.bearing
    else:
        conditions = tuple(records)
    if spec.identified is not None:
        unit = spec.identified.unit
    unit = "m/s^2" if unit is None else unit
    bearing = bearing or spec.bearing
    if bearing is None:
        raise TwingapError("the bearing is not known", where="simulate", mend="add [bearing] to the twin file")
    made: list[Record] = []
    total = len(conditions) * (population or 1)
    for record in simulated(scaled_for(spec, unit)[0], conditions, bearing, unit, seed, population, device):
        made.append(record)
        if progress is not None:
            progress("simulate", len(made) / total)
    return RecordSet.from_records(f"{spec.model} twin", unit, bearing, made)


def simulated(
    spec: TwinSpec,
    conditions: Sequence[Condition],
    bearing: Bearing,
    unit: str,
    seed: int | np.random.Generator = 0,
    population: int | None = None,
    device: str = "cpu",
) -> Iterator[Record]:
    """Records of a twin, or of machines drawn from it, one at a time; see `simulate` for the parameters."""
    rng = np.random.default_rng(seed)
    if population is None:
        yield from build_twin(spec, bearing, unit).on(device).stream(conditions, rng)
        return
    drawing, noise = rng.spawn(2)
    for name, machine in machines(spec, population, drawing):
        yield from build_twin(machine, bearing, unit).on(device).stream(conditions_of(conditions, name), noise)
