"""Registry of features: the modules that measure them, in the order of the feature vector.

one record   --RECORD_FEATURES--> values per record --group_statistics--> differences, z, levels, spreads, trends --+
two sets     --SET_FEATURES-----> values per pair of sets ----------------------------------------------------------+
both parts   --pooled.features--> values of lines, combs and trends over all records -------------------------------+
                                                                    comparison.compare: one vector of named features

How to add a feature:

1. A number of one record: add its name to `NAMES` of the module that measures its kind and fill it in `measure`. A new
   kind gets a module of its own with `NAMES` and `measure(record) -> {name: value}`, and a line in `RECORD_FEATURES`.
   `group_statistics` makes the differences, z values, spreads and trends from it; nothing else is needed.
2. A number of two sets of records (a ratio of mean spectra, say): write a module with `NAMES` and
   `compare(...) -> {name: value}`, and add a line to `SET_FEATURES`.
3. NaN means "does not apply" or "not known"; values are dimensionless, best as logarithms, so that differences between
   measured and simulated records mean the same on every machine.
4. Add the feature to `features` of the effects that it can indicate: a detector uses the features of its effect only.
5. A number of both parts together (lines, combs and trends over all records): add it to `pooled.features`.
6. Models that were learnt know features by name. They go on without the new one; `twingap train` makes use of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features import distances
from twingap.gap.features.acquisition import features as acquisition
from twingap.gap.features.impacts import features as impacts
from twingap.gap.features.impacts import impulse_response
from twingap.gap.features.measured import Pair
from twingap.gap.features.spectrum import change, difference, path
from twingap.gap.features.spectrum import features as spectrum
from twingap.gap.features.tones import features as tones
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms


@dataclass(frozen=True)
class RecordFeatures:
    """Features of one record that one module measures."""

    prefix: str  # a feature is called "prefix.name"
    names: tuple[str, ...]
    measure: Callable[[RecordTransforms], Mapping[str, float]]  # record -> name -> value, NaN where it does not apply
    # Whether they are measured on the impacts of a defect. Means are then over records of each fault, otherwise over
    # healthy and faulty records.
    of_impacts: bool = False


@dataclass(frozen=True)
class SetFeatures:
    """Features of a pair of sets, measured and simulated: named "prefix|name", NaN where one is not known."""

    prefix: str
    names: tuple[str, ...]
    compare: Callable[[Pair], Mapping[str, float]]


RECORD_FEATURES: Final = (
    RecordFeatures("impacts", impacts.NAMES, impacts.measure, of_impacts=True),
    RecordFeatures("lines", tones.NAMES, tones.measure),
    RecordFeatures("background", spectrum.NAMES, spectrum.measure),
    RecordFeatures("converter", acquisition.NAMES, acquisition.measure),
    RecordFeatures("impulse_response", impulse_response.NAMES, impulse_response.measure, of_impacts=True),
)
"""In the order of `NAMES`."""

_PATH_NAMES: Final = (*path.NAMES, *(f"{name}.diff" for name in path.NAMES))


def _impulse_response(pair: Pair) -> Mapping[str, float]:
    real, simulated = pair.real.pooled, pair.simulated.pooled
    return impulse_response.compare(real.impact_spectra, simulated.impact_spectra, real.noise - simulated.noise)


def _path(pair: Pair) -> Mapping[str, float]:
    real, simulated = pair.real.spectral_fit, pair.simulated.spectral_fit
    return dict(zip(_PATH_NAMES, (*real, *(real - simulated)), strict=True))


SET_FEATURES: Final = (
    SetFeatures("shape", difference.NAMES, lambda p: difference.compare(p.real.summaries, p.simulated.summaries)),
    SetFeatures("impulse_response", impulse_response.COMPARED, _impulse_response),
    SetFeatures("change", change.NAMES, lambda p: change.compare(p.real.summaries, p.simulated.summaries, p.external)),
    SetFeatures("distance", distances.NAMES, lambda p: distances.compare(p.real.vectors, p.simulated.vectors)),
    SetFeatures("path", _PATH_NAMES, _path),
)
"""In the order of the feature vector, behind the statistics of record features."""

NAMES: Final[tuple[str, ...]] = tuple(f"{kind.prefix}.{name}" for kind in RECORD_FEATURES for name in kind.names)
"""Names of what `measure` returns, in its order."""

OF_IMPACTS: Final[NDArray[np.bool_]] = np.array([kind.of_impacts for kind in RECORD_FEATURES for _ in kind.names])
"""[features] Which of them are measured on impacts."""


def measure(record: RecordTransforms) -> Array:
    """[features] All features of one record, in the order of `NAMES`; NaN where one does not apply."""
    values = []
    for kind in RECORD_FEATURES:
        found = kind.measure(record)
        values += [found[name] for name in kind.names]
    array = np.array(values, float)
    return np.where(np.isfinite(array), np.clip(array, -1e6, 1e6), np.nan)
