"""Missing effects of which nothing was learnt: fitted by simulation, tested on held-out records.

plausible values, excess of the records' spectrum --least misfits--> values --moved--> effect, on the fit part
held-out records --distance without and with the effect, record by record--> sign-flip test --> p-value, probability

A user's own effect, or one whose definition was edited, has no detector and no estimator. Distances need neither.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks
from scipy.stats import permutation_test, qmc

from twingap.effects import Effect, catalogue
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired
from twingap.gap.search.evidence import Evidence, replicates_of
from twingap.gap.search.initial_values import observations
from twingap.gap.search.optimise import bring_nearest
from twingap.identification.calibrate import thinned
from twingap.records import Record
from twingap.signal import power_spectral_density
from twingap.twins.simulator import Simulator

Array = NDArray[np.float64]

LEVEL: Final = 0.02
"""P-value up to which an effect is named, divided by the number of effects that are tested."""
_PLACES: Final = 32
"""Points of the plausible ranges that are tried first. More find narrow valleys more often, at one simulation each."""
_PEAKS: Final = 6
"""Highest peaks of the spectrum's excess that a frequency is tried at."""
_SEGMENT: Final = 8192
"""Samples of a segment of these spectra."""
_BEST: Final = 4
"""Points whose frequencies are moved to these peaks."""
_FINALISTS: Final = 3
"""Points from which values are moved."""
_REPLICATES: Final = 4
"""Simulations of every held-out record that a test averages."""
_DRAWS: Final = 9999
"""Sign flips of a test, where there are that many."""
_LARGE: Final = 16.0
"""Square, in standard deviations, beyond which squares grow with their logarithm, so that no single bin decides."""

Chain = tuple[Effect, ...]


def fitted(evidence: Evidence, name: str, features: Array, others: Sequence[Effect] = ()) -> Effect | None:
    """The effect at the values that bring the twin nearest to the fit part; None where no value can act on the records.

    Parameters
    ----------
    evidence : Evidence
    name : str
    features : Array [features]
        Of the fit part, without the effect.
    others : sequence of Effect
        Added to the twin already.
    """
    others, tried = tuple(others), dict[Effect, float]()

    def best_of(places: Iterable[Effect], count: int) -> list[Effect]:
        for place in places:
            if place not in tried and evidence.fits(place):
                tried[place] = evidence.misfit(evidence.matched((*others, place)), (*others, place))
        return sorted(tried, key=lambda place: tried[place])[:count]

    first = best_of(_places(evidence, name, features), _BEST)
    finalists = best_of(_at_peaks(first, _excess_hz(evidence, others)) if first else (), _FINALISTS)
    best: tuple[float, Effect] | None = None
    for effect in finalists:
        chain = (*others, effect)
        moved = bring_nearest(evidence, evidence.against(chain).simulator, chain, {}, moved=[name], baseline=False)
        if best is None or moved.misfit < best[0]:
            best = moved.misfit, next(one for one in moved.effects if one.name == name)
    return None if best is None else best[1]


def p_value(evidence: Evidence, chain: Chain, without: Chain) -> float:
    """P-value of held-out records being no nearer to the twin with one chain of effects than with the other.

    Signs of the differences in squared distance are flipped group by group; an effect that is absent, at values fitted
    to other records, makes distances larger on average.

    Parameters
    ----------
    evidence : Evidence
    chain, without : tuple of Effect
        Of which every value was found on the fit part.
    """
    part = evidence.calibrated.held_out
    grid = Grid.of(part.conditions, evidence.frame.bearing)
    real = evidence.vectors(part, grid)

    def pair(effects: Chain, scale: Array | None) -> Paired:
        simulator = evidence.against(effects).simulator
        count = replicates_of(simulator, part.conditions, _REPLICATES)
        made = [evidence.simulated(simulator, effects, part.conditions, 2 + k) for k in range(count)]
        return Paired(real, [evidence.vectors(records, grid) for records in made], None, scale)

    before = pair(without, None)
    after = pair(chain, before.scale)
    gain = _squared(before) - _squared(after)
    groups = np.array([c.group or c.name for c in part.conditions])
    means = np.array([gain[groups == group].mean() for group in dict.fromkeys(groups)])
    if len(means) < 2 or not np.ptp(np.abs(means)):
        return 1.0
    found = permutation_test(
        (means,), np.mean, permutation_type="samples", alternative="greater", n_resamples=_DRAWS,
        rng=np.random.default_rng([evidence.root % 2**32, len(means)]),
    )  # fmt: skip
    return float(found.pvalue)


def probability(p: float) -> float:
    """Largest probability that the effect is missing which a p-value allows, at even odds before.

    Sellke, Bayarri and Berger 2001, doi:10.1198/000313001300339950.
    """
    if p >= math.exp(-1):
        return 0.5
    return 1 / (1 - math.e * p * math.log(max(p, 1e-300)))


def _squared(pair: Paired) -> Array:
    """[records] Squared distance of each record from the mean of its simulations, over all domains."""
    squares = (pair.difference / pair.scale) ** 2
    tempered = np.where(squares > _LARGE, _LARGE * (1 + np.log(np.maximum(squares, _LARGE) / _LARGE)), squares)
    return np.asarray(tempered @ pair.real.weight)


def _places(evidence: Evidence, name: str, features: Array) -> Iterator[Effect]:
    """Values: the default, what the effect itself proposes, and points spread over all plausible ranges."""
    default = catalogue()[name]()
    yield default
    yield from default.initial_values(observations(evidence, features))
    fields = [field for field in default.parameters() if field.metadata["fitted"]]
    for place in qmc.Sobol(max(len(fields), 1), rng=np.random.default_rng(0)).random(_PLACES):
        values: dict[str, float] = {}
        for field, part in zip(fields, place, strict=False):
            low, high = field.metadata["plausible"]
            if field.metadata["log"] and low > 0:
                values[field.name] = low ** (1 - part) * high**part
            else:
                values[field.name] = low + part * (high - low)
        yield default.moved(**values)


def _at_peaks(effects: Sequence[Effect], peaks_hz: Sequence[float]) -> Iterator[Effect]:
    """The effects with each frequency moved to where the records' spectrum exceeds the twin's: a valley that is as
    narrow as a line is found in no other way."""
    for effect in effects:
        for field in effect.parameters():
            low, high = field.metadata["plausible"]
            if field.metadata["fitted"] and field.metadata["unit"] == "Hz":
                yield from (effect.moved(**{field.name: hz}) for hz in peaks_hz if low <= hz <= high)


def _excess_hz(evidence: Evidence, others: Chain) -> list[float]:
    """Frequencies, Hz, at which the records' mean spectrum most exceeds the twin's."""
    few = list(thinned(evidence.calibrated.fit, 3))
    simulator: Simulator = evidence.against(others).simulator
    made = list(evidence.simulated(simulator, others, [record.condition for record in few], 3))
    rate = few[0].condition.fs_hz
    length = min(_SEGMENT, *(record.samples.size for record in few))

    def mean(records: Sequence[Record]) -> tuple[Array, Array]:
        spectra = [
            power_spectral_density(r.samples, rate, segment_samples=length)
            for r in records
            if r.condition.fs_hz == rate
        ]
        return spectra[0].frequency, np.mean([np.log(s.values + 1e-300) for s in spectra], axis=0)

    frequency, real = mean(few)
    excess = real - mean(made)[1]
    at, about = find_peaks(excess, prominence=1.0)
    return [float(frequency[i]) for i in at[np.argsort(-about["prominences"])][:_PEAKS]]
