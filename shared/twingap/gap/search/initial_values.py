"""Where to begin looking for an effect's values: estimates may be far off, and a search goes to the nearest valley.

features --read off--> places that a signature names by itself -----------------------+
second strikes over a pass, knocks rare and frequent --------------------------------+
healthy spectrum --low-pass x mode, in closed form, all over a grid--> the likeliest --+--each simulated--> least misfit
spectra --two modes, with or against each other--> the likeliest ----------------------+
the estimate, where it drives records and twin apart --weaker and weaker--> places -------+

Knocks may ring in the machine's own mode, and rare strong ones have the spectrum of frequent weak ones; what spectra
tell by themselves is in `likeliest`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.effects import (
    ColouredNoise,
    Effect,
    EntryExit,
    ForeignBearing,
    ImpulsiveNoise,
    Looseness,
    SecondResonance,
    SensorRolloff,
    SlipJitter,
    make_effect,
)
from twingap.gap.distance.feature_vectors import Grid, Views
from twingap.gap.distance.paired import Paired
from twingap.gap.features.comparison import feature_names
from twingap.gap.features.spectrum.impulsive_noise import KNOCKS_AT_LEAST
from twingap.gap.search.evidence import replicates_of, values_of
from twingap.gap.search.parameter_prior import Key, Said, pull, strain
from twingap.gap.search.parameter_scale import Setting, coordinates, to_effect, to_number
from twingap.gap.search.spectral_fits import likeliest_losses, likeliest_modes, likeliest_noises
from twingap.twins.twin_file import flat

if TYPE_CHECKING:
    from twingap.bearing import Bearing
    from twingap.gap.search.evidence import Evidence
    from twingap.twins.simulator import Simulator

Array = NDArray[np.float64]

_DAMPINGS: Final = (0.02, 0.06)
_GAINS: Final = (0.1, 0.4, 1.6)
_FINALISTS: Final = 4
WEAKER: Final = (0.5, 0.25, 0.12, 0.06)
"""Factors on an effect's strength where the estimate is too much: with a baseline that makes room for it, no single
step leads back."""
_RATES: Final = (0.06, 0.25, 4.0)
"""Factors on how often it knocks: rare strong knocks and frequent weak ones have one spectrum."""
_EVEN_LEVELS: Final = (0.55, 0.8)
"""Factors on the strength of knocks that are as many as estimated, but alike."""
_MANY: Final = 5
"""Simulations by which rare knocks are judged: by two, none at all may seem nearest."""
_STRENGTHS: Final = frozenset((
    "level", "level_1x", "level_2x", "level_3x", "gain", "sigma", "depth", "exponent", "exit_ratio", "slip",
    "rate_per_s", "step",
))  # fmt: skip
_LN_10: Final = math.log(10)
_EVEN: Final = 0.3
"""Spread of knocks of one loose part: their mean is twice what lies above a threshold that hides few of them."""
_ORDERS: Final = ("lines.comb_order|all", "background.foreign_order|all", "background.foreign_order|healthy")
"""What names the order of strikes from elsewhere."""
_SAME_ORDER: Final = 0.003
"""Part by which two readings of an order differ and are one place to begin at."""
_DELAYS: Final = (0.06, 0.11, 0.17, 0.24, 0.32, 0.41)
"""Second strikes are tried so many parts of a pass after the first."""
_BETTER: Final = 0.99
"""Factor on the misfit from which another place is a better one to begin at."""


class Start(NamedTuple):
    """Where to begin.

    Parameters
    ----------
    effect : Effect
    read : bool
        Whether these values were read off the records, other than the estimate; else they are its own, weaker.
    """

    effect: Effect
    read: bool


def better_start(
    evidence: Evidence,
    effects: tuple[Effect, ...],
    name: str,
    features: Array,
    now: float,
    said: Mapping[Key, Said] = MappingProxyType({}),
) -> Start | None:
    """The effect at values that come nearer to the fit part than the given ones do; None where there are none.

    Parameters
    ----------
    evidence : Evidence
    effects : tuple of Effect
        All that are added to the twin.
    name : str
        The one to look for.
    features : Array [features]
        Of the fit part, before it was added.
    now : float
        Misfit with the given values.
    said : Mapping[(effect, parameter), Said], optional
        What estimates say: a weaker effect is strained by it.
    """
    (given,) = (effect for effect in effects if effect.name == name)
    others = tuple(effect for effect in effects if effect.name != name)
    misfit_of: Callable[[Simulator, tuple[Effect, ...]], float] = evidence.misfit
    if isinstance(given, ImpulsiveNoise):
        misfit_of = _by_many(evidence, effects)
        now = misfit_of(evidence.against(effects).simulator, effects)
    found: list[tuple[float, int, Effect]] = []
    for place in places(given, features, evidence):
        if evidence.fits(place):
            chain = (*others, place)
            found.append((misfit_of(evidence.matched(chain), chain), len(found), place))
    finalists = [*(place for _, _, place in sorted(found)[:_FINALISTS]), *told_by_spectra(given, evidence)]
    starts = [Start(place, True) for place in finalists]
    if now > misfit_of(evidence.against(others).simulator, others):
        starts += [Start(place, False) for place in weaker(given) if evidence.fits(place)]
    # Levels alone were matched so far; the few that came nearest are given a mode of their own, as the given one was.
    least, best = _BETTER * now, None
    for start in starts:
        chain = (*others, start.effect)
        misfit = misfit_of(evidence.against(chain).simulator, chain)
        if not start.read or isinstance(given, ImpulsiveNoise):
            numbers = {key: to_number(start.effect, key[1], evidence.setting) for key in said}
            misfit = math.sqrt(misfit**2 + pull(evidence.records_tried) * strain(said, numbers))
        if misfit < least:
            least, best = misfit, start
    return best


def told_by_spectra(given: Effect, evidence: Evidence) -> list[Effect]:
    """Values that are the likeliest by healthy spectra; none for effects of which those do not tell."""
    if isinstance(given, SensorRolloff):
        return list(likeliest_losses(evidence, given))
    if isinstance(given, ColouredNoise):
        return list(likeliest_noises(evidence, given))
    if isinstance(given, SecondResonance):
        return list(likeliest_modes(evidence, given))
    return []


def _by_many(evidence: Evidence, effects: tuple[Effect, ...]) -> Callable[[Simulator, tuple[Effect, ...]], float]:
    """The misfit of the whole fit part from so many simulations of it that chance hardly decides.

    Measured by how much records scatter that have these effects: one that knocks now and then scatters more than the
    twin does, and of few records the mean lies anywhere.
    """
    conditions = evidence.fit.conditions
    grid = Grid.of(conditions, evidence.frame.bearing)

    def made(simulator: Simulator, effects: tuple[Effect, ...]) -> list[Views]:
        count = replicates_of(simulator, conditions, _MANY)
        return [evidence.views(evidence.simulated(simulator, effects, conditions, k), grid) for k in range(count)]

    yardstick = Paired(evidence.fit.views, made(evidence.against(effects).simulator, effects)).scale
    return lambda simulator, effects: Paired(evidence.fit.views, made(simulator, effects), None, yardstick).misfit()


def places(given: Effect, features: Array, evidence: Evidence) -> Iterator[Effect]:
    """Where else the effect's values may be."""
    found = dict(zip(feature_names(), features, strict=True))
    for numbers in _read(given.name, found, evidence.frame.bearing):
        yield (place := _moved(given, numbers, evidence.setting))
        if isinstance(given, ForeignBearing):  # at a level that was estimated for another order, none comes nearer
            yield from weaker(place)
    if isinstance(given, SlipJitter):  # of a random walk, strikes a little apart differ less, and those far apart more
        for factor in (1.0, 0.5, 0.25):
            yield dataclasses.replace(given, sigma=factor * given.sigma, accumulating=not given.accumulating)
    if isinstance(given, Looseness):
        for factor in (1.0, 2.0, 4.0):
            yield dataclasses.replace(given, level=factor * given.level, in_phase=not given.in_phase)
    if isinstance(given, EntryExit):
        faults = {c.fault for c in evidence.fit.conditions}
        passes = [360 / evidence.frame.bearing.n_rollers] if faults - {"ball", "healthy"} else []
        for arc_deg in [part * one for one in passes + [180.0] * ("ball" in faults) for part in _DELAYS]:
            for ratio in (0.5, 1.8):
                for turned in (False, True):
                    yield EntryExit(arc_deg=arc_deg, exit_ratio=ratio, turned=turned)
    if given.name in ("foreign_bearing", "impulsive_noise"):
        yield from _knocks(given, evidence)
    if isinstance(given, SecondResonance):
        for opposed in (False, True):
            for damping in _DAMPINGS:
                for gain in _GAINS:
                    yield dataclasses.replace(given, opposed=opposed, damping_ratio=damping, gain=gain)


def _knocks(given: Effect, evidence: Evidence) -> Iterator[Effect]:
    """As given or ringing in the machine's own mode, and the same power in fewer and stronger knocks, or in more."""
    spec, values = evidence.calibrated.spec, values_of(given)
    rings = [values]
    if spec is not None and spec.model == "phenomenological":
        own = flat(spec.parameters)
        rings.append(values | {name: float(own[name]) for name in ("resonance_hz", "damping_ratio")})
        yield make_effect(given.name, rings[1])
    if isinstance(given, ImpulsiveNoise):
        for ring in rings:
            for factor in _RATES:
                rarer = {"rate_hz": factor * given.rate_hz, "level": given.level / math.sqrt(factor)}
                yield make_effect(given.name, ring | rarer)
            for factor in _EVEN_LEVELS:
                yield make_effect(given.name, ring | {"level": factor * given.level, "spread": _EVEN})


def weaker(given: Effect) -> list[Effect]:
    """The effect at parts of its strength; none where its strength is not one factor."""
    return [one for factor in WEAKER if (one := weakened(given, factor)) != given]


def weakened(given: Effect, factor: float) -> Effect:
    """The effect at this part of its strength; as it is where its strength is not one factor."""
    strengths = {f.name: getattr(given, f.name) for f in dataclasses.fields(given) if f.name in _STRENGTHS}  # type: ignore[arg-type]
    return make_effect(given.name, values_of(given) | {name: factor * value for name, value in strengths.items()})


def _read(name: str, found: Mapping[str, float], bearing: Bearing) -> Iterator[dict[str, float]]:
    """Comparable numbers that single signatures give, see `training.parameters`."""
    if name == "entry_exit":
        arcs = [found["comb|clear_arc_log"], found["comb|faint_arc_log"], found["events.arc_log|all.level"]]
        part = found["events.cycle_rise_part|all.level"]
        if part > 0:
            arcs += [math.log(part * 360 / bearing.n_rollers), math.log(part * 180)]
        for arc in (arc for arc in arcs if math.isfinite(arc)):
            yield from ({"arc_deg": arc, "exit_ratio": 0.0, "turned": turned} for turned in (0.0, 1.0))
    if name == "speed_gain":
        for trend in ("trend|speed_strikes", "trend|speed_alone", "trend|speed_answer"):
            if math.isfinite(found[trend]):
                yield from ({"exponent": found[trend], "on_noise": part} for part in (0.0, 1.0))
    if name == "damage_growth":
        for trend in ("trend|time_strikes", "trend|time_alone", "trend|time_answer"):
            if found[trend] > 0:
                yield {"rate_per_s": math.log(found[trend]), "onset_s": 0.0}
    if name == "mean_slip" and math.isfinite(found["context|slip_seen"]):
        shares = [1.0, 0.0, found["context|slip_rollers"]]
        yield from ({"slip": found["context|slip_seen"], "of_rollers": s} for s in shares if math.isfinite(s))
    if name == "foreign_bearing":
        read = [found[f"{place}.level"] for place in _ORDERS]
        yield from ({"order": order} for order in _apart([*read, math.exp(found["pooled|foreign_order"])]))
    if name == "impulsive_noise":
        for of in ("all", "healthy"):
            yield from _knocks_read(found, of)


def _apart(orders: Sequence[float]) -> list[float]:
    """Those that were read and differ."""
    kept: list[float] = []
    for order in orders:
        if order > 0 and all(abs(order / other - 1) > _SAME_ORDER for other in kept):
            kept.append(order)
    return kept


def _knocks_read(found: Mapping[str, float], of: str) -> Iterator[dict[str, float]]:
    """How often it knocks, as counted and with those that noise hides; how strongly, and what rings."""
    level, place, damping = (found[f"background.knock_{what}|{of}.level"] for what in ("level", "fs", "damping_log"))
    for counted in ("count_log", "rate_log"):
        rate_hz = 10 ** found[f"background.knock_{counted}|{of}.level"] - KNOCKS_AT_LEAST
        if min(rate_hz, place) > 0 and math.isfinite(level + damping):
            ring = {"resonance_hz": math.log(place), "damping_ratio": damping * _LN_10}
            for spread, louder in ((1.0, 1.0), (_EVEN, 2.0)):
                strength = level * _LN_10 + math.log(louder)
                yield {"level": strength, "rate_hz": math.log(rate_hz), "spread": spread, **ring}


def _moved(given: Effect, numbers: Mapping[str, float], setting: Setting) -> Effect:
    kept = {p: to_number(given, p, setting) for name, p in coordinates() if name == given.name}
    return to_effect(given.name, kept | dict(numbers), setting)
