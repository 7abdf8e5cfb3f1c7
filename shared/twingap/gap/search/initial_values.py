"""Initial values of a search for values: a local search from a poor estimate ends in the wrong minimum.

features --Effect.initial_values--> values, each simulated at the matched level --> smallest misfits --+
mean spectra --Effect.spectral_values--> the few with the best fit ----------------------------------+--> best
the estimate, where it increases the distance --Effect.weaker--> reduced strengths ------------------+
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from twingap.effects import Effect
from twingap.effects.observations import HealthySpectrum, Observations, SpectrumRatio
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.features.comparison import feature_names
from twingap.gap.features.spectrum.path import two_modes
from twingap.gap.search.evidence import Evidence, replicates_of
from twingap.gap.search.free_spectra import spectra_of
from twingap.gap.search.parameter_prior import Key, Prior, penalty, penalty_weight
from twingap.gap.search.parameter_scale import to_number
from twingap.identification.baseline import mode_density, state_spectra
from twingap.identification.calibrate import thinned
from twingap.records import Array
from twingap.twins.simulator import Simulator
from twingap.twins.twin_file import flat

_FINALISTS: Final = 4
"""Initial values for which the mode is calibrated too. Each costs one calibration."""
_MANY: Final = 5
"""Simulations per comparison of effects that act at random. With few, the twin without the effect may seem closest."""
_BETTER: Final = 0.99
"""Factor on the misfit below which other initial values replace the estimate. A smaller value keeps more estimates."""
_RECORDS: Final = 6
"""Largest number of healthy records of the mean spectrum. A larger number takes longer and reduces its noise."""


class Initial(NamedTuple):
    """Initial values of an effect."""

    effect: Effect
    read: bool  # True for values read off the records; False for the estimate at a reduced strength


def better_initial(
    evidence: Evidence,
    effects: tuple[Effect, ...],
    name: str,
    features: Array,
    now: float,
    priors: Mapping[Key, Prior] = MappingProxyType({}),
) -> Initial | None:
    """The effect of this name at initial values with a smaller misfit than `now`, that of the given ones, or None.

    `effects` are all effects added to the twin, `features` [features] those of the fit part before the effect was
    added. Priors, from the estimators, penalise reduced strengths.
    """
    (given,) = (effect for effect in effects if effect.name == name)
    others = tuple(effect for effect in effects if effect.name != name)
    seen = observations(evidence, features)
    places, spectral, weaker = (
        _possible(evidence, given, others, proposed)
        for proposed in (given.initial_values(seen), given.spectral_values(seen), given.weaker())
    )
    if not (places or spectral or weaker):
        return None
    misfit_of: Callable[[Simulator, tuple[Effect, ...]], float] = evidence.misfit
    if given.by_chance:
        misfit_of = _averaged_misfit(evidence, effects)
        now = misfit_of(evidence.against(effects).simulator, effects)
    found: list[tuple[float, int, Effect]] = []
    for place in places:
        chain = (*others, place)
        found.append((misfit_of(evidence.matched(chain), chain), len(found), place))
    starts = [Initial(place, True) for place in (*(place for _, _, place in sorted(found)[:_FINALISTS]), *spectral)]
    if weaker and now > misfit_of(evidence.against(others).simulator, others):
        starts += [Initial(place, False) for place in weaker]
    # So far only levels were matched; for the best few the mode is calibrated too, as for the given values.
    least, best = _BETTER * now, None
    for start in starts:
        chain = (*others, start.effect)
        misfit = misfit_of(evidence.against(chain).simulator, chain)
        if not start.read or given.by_chance:
            numbers = {key: to_number(start.effect, key[1], evidence.setting) for key in priors}
            misfit = math.sqrt(misfit**2 + penalty_weight(len(evidence.trial_records)) * penalty(priors, numbers))
        if misfit < least:
            least, best = misfit, start
    return best


def _possible(
    evidence: Evidence, given: Effect, others: tuple[Effect, ...], proposed: Iterable[Effect]
) -> list[Effect]:
    """Proposed values at which all records can be simulated, other than the given ones but for what was read off."""
    places = [place for place in proposed if evidence.fits(place)]
    if not places or not evidence.read_off(given.name):
        return places
    simulator = evidence.against(others).simulator
    read = dict.fromkeys(evidence.at_read_values(place, simulator) for place in places)
    return [place for place in read if place != evidence.at_read_values(given, simulator)]


def _averaged_misfit(
    evidence: Evidence, effects: tuple[Effect, ...]
) -> Callable[[Simulator, tuple[Effect, ...]], float]:
    """Misfit of all records of the fit part, averaged over several simulations of it.

    Its scale is the scatter of simulated records that have these effects: an effect that acts intermittently increases
    the scatter, and the mean of a few records is uncertain.
    """
    conditions = evidence.fit.conditions
    grid = evidence.grid(conditions)

    def made(simulator: Simulator, effects: tuple[Effect, ...]) -> list[FeatureVectors]:
        count = replicates_of(simulator, conditions, _MANY)
        return [evidence.simulated_vectors(simulator, effects, conditions, grid, k) for k in range(count)]

    scale = Paired(evidence.fit.vectors, made(evidence.against(effects).simulator, effects)).scale
    return lambda simulator, effects: Paired(evidence.fit.vectors, made(simulator, effects), scale).misfit()


def observations(evidence: Evidence, features: Array) -> Observations:
    """Observations from which effects propose initial values; `features` as in `comparison.feature_names`."""
    setting, own_mode = evidence.setting, _own_mode(evidence)
    faults = frozenset(str(c.fault) for c in evidence.fit.conditions) - {"healthy"}
    rate_hz = min(c.fs_hz for c in evidence.fit.conditions)
    return Observations(
        features=_by_name(features), held_out=_by_name(evidence.against().held_out),
        bearing=evidence.frame.bearing, faults=faults, fs_hz=setting.fs_hz, begin_s=setting.begin_s,
        span_s=setting.span_s, speed_rpm=setting.speed_rpm, own_mode=own_mode,
        healthy=lambda: _healthy_spectrum(evidence), mode_pairs=lambda: two_modes(evidence.fit.summaries, rate_hz),
        spectrum_ratio=lambda: _spectrum_ratio(evidence),
    )  # fmt: skip


def _by_name(features: Array) -> dict[str, float]:
    """Name of a feature -> value."""
    return dict(zip(feature_names(), (float(value) for value in features), strict=True))


def _spectrum_ratio(evidence: Evidence) -> SpectrumRatio:
    """Mean log spectra of the trial records over those of the given twin."""
    spectra, given = spectra_of(evidence, "all"), evidence.against().simulator
    made = spectra.of(evidence.simulated(given, (), evidence.trial_records.conditions, 3))
    ratios = [spectra.real[state].between - made[state].between for state in spectra.real]
    return SpectrumRatio(np.asarray(spectra.middles_hz, float), np.mean(np.array(ratios, float), axis=0))


def _own_mode(evidence: Evidence) -> tuple[float, float] | None:
    """Frequency, Hz, and damping ratio of the twin's mode; None for a twin without that parameter."""
    spec = evidence.calibrated.spec
    if spec is None or spec.model != "phenomenological":
        return None
    own = flat(spec.parameters)
    return float(own["resonance_hz"]), float(own["damping_ratio"])


def _healthy_spectrum(evidence: Evidence) -> HealthySpectrum | None:
    """Mean spectrum of the healthy records; None where there are none or they are zero."""
    sides = [
        side for side in state_spectra(list(thinned(evidence.calibrated.fit, _RECORDS)), evidence.frame)
        if side.fault == "healthy"
    ]  # fmt: skip
    side = max(sides, key=lambda s: len(s.conditions), default=None)
    if side is None or side.psd.max() <= 0:
        return None
    own_mode = _own_mode(evidence)
    return HealthySpectrum(
        side.psd, side.fs_hz, () if own_mode is None else (own_mode[0], side.peak_hz),
        mode=lambda centre_hz, damping: mode_density(centre_hz, damping, side.fs_hz),
        twin=lambda: evidence.bare_psd(side),
    )  # fmt: skip
