"""Roll-off and coloured noise in the form that the records show, beside the regular form that a search fits.

twin with these effects --simulated--> spectra of records over those of the twin --monotone--> gain of a roll-off
                                       spectra of healthy records less those of the twin ----> density of a noise

Real sensors are no Butterworth filters and real noise has no sharp band. Corner, order, slope and band stay what they
were fitted to; what is simulated is what was measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import isotonic_regression

from twingap.effects import ColouredNoise, Effect, SensorRolloff
from twingap.effects.by_state import State
from twingap.gap.search.evidence import Evidence
from twingap.gap.search.free_spectra import Spectra, StateLevels, spectra_of
from twingap.gap.search.optimise import validation_distance
from twingap.twins.simulator import Simulator

Chain = tuple[Effect, ...]

_ROUNDS: Final = 3
"""Simulations by which a form is corrected. More reduce what other effects of the twin leave."""
_STREAM: Final = 3
"""Replicate of the twin that is measured."""
_LARGEST_STEP: Final = 1.5
"""Largest correction of a log power in one round."""
_SMOOTH: Final = 1.0
"""Bands over which corrections are smoothed. A larger value has less noise and loses sharp edges."""
_BEYOND: Final = 1.6
"""Factor on the ends of the fitted band beyond which a noise has no power: what is there has other causes."""
_FAINTEST: Final = 1e-4
"""Least density over the largest one."""
_CLOSER: Final = 0.97
"""Factor on the distance of the fit part below which the measured form is kept."""
_HEALTHY: Final = State("healthy")
_NEPERS_PER_DB: Final = math.log(10) / 10
"""Logarithms of power in a dB."""


def with_measured_forms(evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]) -> tuple[Simulator, Chain]:
    """The twin whose roll-off and coloured noise have the form of the records, where it is closer to the fit part."""
    chain = tuple(effects)
    least = math.nan
    for place, effect in enumerate(chain):
        if not isinstance(effect, (SensorRolloff, ColouredNoise)):
            continue
        if math.isnan(least):
            least = validation_distance(evidence, simulator, chain)
        measure = _rolloff if isinstance(effect, SensorRolloff) else _noise
        other = (*chain[:place], measure(evidence, simulator, chain, place), *chain[place + 1 :])
        again = evidence.with_values(simulator, other)
        if (now := validation_distance(evidence, again, other)) < _CLOSER * least:
            simulator, chain, least = again, other, now
    return simulator, chain


def _rolloff(evidence: Evidence, simulator: Simulator, chain: Chain, place: int) -> Effect:
    """The roll-off with the gain that leaves the twin's spectra as those of the records: falling with frequency."""
    spectra, own = spectra_of(evidence, "all"), chain[place]
    assert isinstance(own, SensorRolloff)
    gain = _NEPERS_PER_DB * own.gain_db(spectra.middles_hz)
    for _ in range(_ROUNDS):
        made = _spectra_of_twin(evidence, simulator, (*chain[:place], own, *chain[place + 1 :]), spectra)
        off = np.mean([spectra.real[state].all - made[state].all for state in spectra.states], axis=0)
        gain = gain + gaussian_filter1d(np.clip(off, -_LARGEST_STEP, _LARGEST_STEP), _SMOOTH, mode="nearest")
        falling = isotonic_regression(gain, increasing=False).x
        gain = np.asarray(np.maximum(falling - falling[0], -80 * _NEPERS_PER_DB))
        own = replace(
            own,
            frequencies_hz=_places(spectra),
            gains_db=tuple(np.minimum(gain / _NEPERS_PER_DB, 0.0).round(3).tolist()),
        )
    return own


def _noise(evidence: Evidence, simulator: Simulator, chain: Chain, place: int) -> Effect:
    """The noise with the density that healthy records have more than the twin without it."""
    spectra, own = spectra_of(evidence, "all"), chain[place]
    assert isinstance(own, ColouredNoise)
    places, unit = spectra.middles_hz, simulator.reference_rms**2
    inside = (places > own.low_hz / _BEYOND) & (places < own.high_hz * _BEYOND)
    density = own.level**2 * own.density(places, 2 * spectra.top_hz)
    width = np.diff(spectra.edges_hz)
    for _ in range(_ROUNDS):
        made = _spectra_of_twin(evidence, simulator, (*chain[:place], own, *chain[place + 1 :]), spectra)
        wanted, now = (np.exp(of[_HEALTHY].between) / unit for of in (spectra.real, made))
        found = np.where(inside, np.maximum(wanted - np.maximum(now - density, 0.0), 0.0), 0.0)
        found = gaussian_filter1d(found, _SMOOTH / 2, mode="nearest")
        if not found.any():
            return chain[place]
        density = np.maximum(found, _FAINTEST * found.max())
        power = float(density @ width)
        levels = 10 * np.log10(density / power)
        own = replace(
            own, level=math.sqrt(power), frequencies_hz=_places(spectra), densities_db=tuple(levels.round(3).tolist())
        )
    return own


def _spectra_of_twin(
    evidence: Evidence, simulator: Simulator, chain: Chain, spectra: Spectra
) -> dict[State, StateLevels]:
    """Mean log spectra of the twin under the conditions of the trial records."""
    simulator = evidence.with_values(simulator, chain)
    return spectra.of(evidence.simulated(simulator, chain, spectra.records.conditions, _STREAM))


def _places(spectra: Spectra) -> tuple[float, ...]:
    """Middles of the bands, Hz."""
    return tuple(float(f) for f in spectra.middles_hz)
