"""Missing effects without a detector: fitted by simulation, tested on held-out records.

plausible values, excess of the records' spectrum --smallest misfits--> values --optimised--> effect, on the fit part
held-out records --distance without and with the effect, record by record--> sign-flip test --> p-value, probability

A user's own effect, or one whose definition was edited, has neither detector nor estimator. Distances need neither.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import qmc

from twingap.effects import Effect, catalogue
from twingap.gap.distance.paired import Paired
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.initial_values import observations
from twingap.gap.search.optimise import optimise
from twingap.gap.search.sign_flips import p_of_gain
from twingap.identification.calibrate import thinned
from twingap.records import Array, Record
from twingap.signal import power_spectral_density
from twingap.twins.simulator import Simulator

LEVEL: Final = 0.02
"""Level at which an effect is named, divided by the number of tested effects. A larger value names more of them."""
OBVIOUS: Final = 0.5
"""Standard deviations, and part of the distance, by which an effect has to bring held-out records closer to be a gap
where the learnt models see none. Smaller values take effects that make up for an imperfect calibration for missing
ones."""
_PLACES: Final = 32
"""Initial points in the plausible ranges. A larger number finds narrow minima more often, at one simulation each."""
_PEAKS: Final = 6
"""Highest peaks of the spectrum's excess at which a frequency is tried. A larger number takes more simulations."""
_SEGMENT: Final = 8192
"""Segment length of these spectra, samples. Longer segments resolve closer lines."""
_BEST: Final = 4
"""Points whose frequencies are moved to these peaks. A larger number takes more simulations."""
_FINALISTS: Final = 3
"""Points whose values are optimised. A larger number misses fewer minima and takes longer."""
_REPLICATES: Final = 4
"""Simulations of every held-out record that a test averages. A larger number gives the test more power."""

Chain = tuple[Effect, ...]


def fitted(evidence: Evidence, name: str, features: Array, others: Sequence[Effect] = ()) -> Effect | None:
    """The effect at the values that bring the twin closest to the fit part; None where no value acts on the records.

    `features` [features] are those of the fit part without the effect, `others` the effects already added to the twin.
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
        moved = optimise(evidence, evidence.against(chain).simulator, chain, {}, moved=[name], baseline=False)
        if best is None or moved.misfit < best[0]:
            best = moved.misfit, next(one for one in moved.effects if one.name == name)
    return None if best is None else best[1]


class Gain(NamedTuple):
    """How much closer held-out records are to the twin with an effect."""

    p_value: float  # of no gain, see `p_of_gain`
    before: float = 0.0  # distance without it, standard deviations
    after: float = 0.0

    @property
    def obvious(self) -> bool:
        """Whether the effect closes more than an imperfect calibration leaves."""
        return self.before - self.after >= OBVIOUS * max(self.before, 1.0)


def gain(evidence: Evidence, chain: Chain, without: Chain) -> Gain:
    """Gain on held-out records of the twin with `chain` over the one with the effects `without`.

    Values are those of the fit part: an absent effect, at values fitted to other records, increases distances on
    average.
    """

    def pair(effects: Chain, scale: Array | None) -> Paired:
        made = evidence.held_out_replicates(evidence.against(effects).simulator, effects, _REPLICATES)
        return Paired(evidence.held_out.vectors, made, scale)

    before = pair(without, None)
    after = pair(chain, before.scale)
    distances = (float(each.over_domains(each.squares())[0][0]) for each in (before, after))
    return Gain(p_of_gain(before, after, evidence.root), *distances)


def probability(p: float) -> float:
    """Upper bound, at least 0.5, of the probability that an effect is missing, from a p-value and even prior odds.

    Sellke, Bayarri and Berger 2001, doi:10.1198/000313001300339950.
    """
    if p >= math.exp(-1):
        return 0.5
    return 1 / (1 - math.e * p * math.log(max(p, 1e-300)))


def _places(evidence: Evidence, name: str, features: Array) -> Iterator[Effect]:
    """Initial values: the default, the effect's own proposals, and quasi-random points in the plausible ranges."""
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
    """The effects with each frequency moved to peaks of the excess, where a minimum is as narrow as a line."""
    for effect in effects:
        for field in effect.parameters():
            low, high = field.metadata["plausible"]
            if field.metadata["fitted"] and field.metadata["unit"] == "Hz":
                yield from (effect.moved(**{field.name: hz}) for hz in peaks_hz if low <= hz <= high)


def _excess_hz(evidence: Evidence, others: Chain) -> list[float]:
    """Frequencies, Hz, with the largest excess of the records' mean spectrum over the twin's."""
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
