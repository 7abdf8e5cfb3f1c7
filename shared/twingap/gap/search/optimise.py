"""Optimisation of values, of effects and of the baseline, that bring a twin closest to the fit part.

twin, effects at estimated values --grid, steps of each value, Gauss-Newton steps of all--> smallest misfit

Estimators read values off features, which are the same for all machines; here the twin itself is simulated. Random
streams are fixed, so that two trials differ by their values only. The objective is the root of the squared misfit of a
few records plus the penalty of the priors of values (see `parameter_prior`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np

from twingap.effects import Effect, make_effect
from twingap.effects.base import WEAKER
from twingap.effects.by_state import ByState
from twingap.errors import TwingapError
from twingap.gap.distance.paired import Paired
from twingap.gap.search.evidence import Evidence, level_of
from twingap.gap.search.parameter_prior import Key, Prior, penalty, penalty_weight
from twingap.gap.search.parameter_scale import Setting, coordinates, to_effect, to_number
from twingap.records import Array
from twingap.twins.simulator import Simulator, TwinSimulator
from twingap.twins.twin_file import all_parameters, flat

PASSES: Final = 3
"""Largest number of rounds, each with steps of single values and of all values together. More rounds take longer."""
_PLACES: Final = 7
"""Grid points over a value's plausible range. A larger number finds narrower minima and takes more trials."""
_LEAST_STEP: Final = 0.005
"""Smallest first step, as a part of a value's plausible range. A larger step overshoots in narrow ranges."""
_LOUDER: Final = 3.0
"""Factor on the upper end of plausible levels, which are relative to a healthy vibration that may be very weak."""
_FARTHEST: Final = 8.0
"""Largest distance, in first steps, that a value moves in one line search."""
_CLEARLY: Final = 0.98
"""Factor on the misfit below which a grid point replaces the estimate. A smaller value keeps more estimates."""
_BASELINE_STEPS: Final = {"resonance_hz": 0.02, "damping_ratio": 0.2, "impact_amplitude": 0.1}
"""First steps of baseline parameters, as logarithms. A larger step overshoots, a smaller one takes more trials."""
_LEVELS: Final = ("scale", "structure_noise_rms", "white_noise_rms")
"""Baseline parameters that are levels."""
_LEVEL_STEP: Final = 0.1
"""First step of a level, as a logarithm."""
_CALIBRATED_WITHIN: Final = {"resonance_hz": 0.03, "damping_ratio": 0.2, "impact_amplitude": 0.1}
"""Bounds on the error of nine of ten calibrated parameters, as logarithms. A larger value weakens their priors."""
_LEVEL_WITHIN: Final = 0.06
"""Bound on the error of nine of ten calibrated levels, as a logarithm. A larger value lets the search move levels,
which calibration estimates better from the spectra of whole records, with a weaker penalty."""
_DAMPINGS: Final = (0.003, 0.1, 1.0, 10.0)
"""Levenberg-Marquardt damping factors of steps of all values together, the longest step first."""
_SHRINKS: Final = 2
"""Number of times that these steps are shortened after they no longer reduce the misfit."""
_SETTLED: Final = 0.985
"""Factor on the misfit above which a round ends the search. Closer to 1, the search goes on for a smaller gain."""
_OTHERS: Final = (5, 6, 7)
"""Replicates for validation: no value is fitted to them."""


@dataclass(frozen=True)
class Optimised:
    """Result of an optimisation."""

    simulator: Simulator  # with the optimised values of its effects and its baseline
    effects: tuple[Effect, ...]
    before: float  # objective on the fit part at the start and at the end, penalties included
    misfit: float


def optimise(
    evidence: Evidence,
    simulator: Simulator,
    effects: Sequence[Effect],
    errors: Mapping[Key, float],
    *,
    moved: Sequence[str] | None = None,
    baseline: bool = True,
    passes: int = PASSES,
    priors: Mapping[Key, Prior] = MappingProxyType({}),
    prior_weight: float = 1.0,
    grid: bool = True,
) -> Optimised:
    """Optimise values on the fit part; the result is kept if it also holds with other random streams.

    `errors` of estimates, on the scale of `parameter_scale`, set the first steps. In at most `passes` rounds, values of
    the effects in `moved` (None: of all) are optimised and, with `baseline`, the twin's own levels, mode and impacts,
    except those fixed by the twin file. Values without one of the `priors` are free; calibrated baseline parameters
    always have one. `prior_weight`, a factor on all penalties, is larger where effects may be missing for which values
    must not compensate. Without `grid`, values move from where they are by steps alone.
    """
    search = ValueSearch(evidence, simulator, tuple(effects), evidence.trials, dict(priors), prior_weight)
    search.gather_effects([e for e in effects if moved is None or e.name in moved], errors)
    if baseline and isinstance(simulator, TwinSimulator) and simulator.spec.model == "phenomenological":
        search.gather_baseline(simulator)
    elif baseline:
        search.gather_level()
    begin = search.initial_objective()
    if search.at:
        if grid:
            if _PLACES * len(search.ends) > search.left / 2:
                search.gauss_newton()  # with large records, the grid over many values would use up all trials
            search.grid_search()
        for _ in range(passes):
            least = search.least
            for key in [key for key in search.at if key[0]]:  # joint steps converge to the nearest minimum only
                search.line_search(key)
            search.gauss_newton()
            if search.least > _SETTLED * least:
                break
    built = search.built(search.at)
    if built is not None and search.validated(*built):
        return Optimised(*built, begin, search.least)
    own = [effect for effect in effects if moved is None or effect.name in moved]
    if not any(effect.by_chance for effect in own):
        return Optimised(simulator, tuple(effects), begin, begin)
    # Values of effects that act at random may have been fitted to these simulations; the other values may still be
    # valid.
    names = [effect.name for effect in own if not effect.by_chance]
    return optimise(
        evidence, simulator, effects, errors,
        moved=names, baseline=baseline, passes=passes, priors=priors, prior_weight=prior_weight, grid=grid,
    )  # fmt: skip


def not_farther(
    evidence: Evidence,
    found: Optimised,
    bare: Optimised,
    errors: Mapping[Key, float],
    *,
    priors: Mapping[Key, Prior] = MappingProxyType({}),
    prior_weight: float = 1.0,
) -> Optimised:
    """The optimised twin, or a closer one where its distance is larger than that of `bare`, without the effects.

    In that case the search ended in the wrong local minimum. A second search begins at the twin without the effects,
    with a small strength of each, and the closer of both results is kept, penalised by the priors. Other arguments as
    for `optimise`.
    """

    without = validation_distance(evidence, bare.simulator, ())
    if validation_distance(evidence, found.simulator, found.effects) <= without:
        return found
    little = [tuple(effect.weakened(factor) for effect in found.effects) for factor in WEAKER]
    begin = min(little, key=lambda effects: evidence.misfit(bare.simulator, effects))
    again = optimise(evidence, bare.simulator, begin, errors, priors=priors, prior_weight=prior_weight)
    return closest(evidence, (found, again), priors, prior_weight)


def closest(
    evidence: Evidence, found: Sequence[Optimised], priors: Mapping[Key, Prior], prior_weight: float = 1.0
) -> Optimised:
    """The result of the smallest distance, penalised by the priors, from the fit part."""

    def penalised(one: Optimised) -> float:
        weight = prior_weight * penalty_weight(len(evidence.trial_records))
        apart = validation_distance(evidence, one.simulator, one.effects)
        return math.sqrt(apart**2 + weight * penalty(priors, _numbers(one.effects, priors, evidence.setting)))

    return min(found, key=penalised)


def at_estimates(effects: Sequence[Effect], priors: Mapping[Key, Prior], setting: Setting) -> tuple[Effect, ...]:
    """The effects, those of which a value is beyond the error of its estimate at their estimates."""
    made = []
    for effect in effects:
        own = {key[1]: prior for key, prior in priors.items() if key[0] == effect.name}
        numbers = {name: to_number(effect, name, setting) for of, name in coordinates() if of == effect.name}
        if any(abs(numbers[name] - prior.number) > prior.within for name, prior in own.items()):
            numbers |= {name: prior.number for name, prior in own.items()}
            effect = to_effect(effect.name, numbers, setting)
        made.append(effect)
    return tuple(made)


def _numbers(effects: Sequence[Effect], priors: Mapping[Key, Prior], setting: Setting) -> dict[Key, float]:
    """Values of effects that have a prior, as comparable numbers."""
    keys = ((effect, (effect.name, name)) for effect in effects for name in effect.parameter_values())
    return {key: to_number(effect, key[1], setting) for effect, key in keys if key in priors}


def validation_distance(evidence: Evidence, simulator: Simulator, effects: Sequence[Effect]) -> float:
    """Mean distance of the fit part over replicates to which no value was fitted."""
    return sum(evidence.gap(simulator, effects, replicate) for replicate in _OTHERS) / len(_OTHERS)


@dataclass
class ValueSearch:
    """State of an optimisation: values, steps, priors and the number of trials left."""

    evidence: Evidence
    simulator: Simulator
    effects: tuple[Effect, ...]
    left: int
    priors: dict[Key, Prior]
    prior_weight: float
    at: dict[Key, float] = field(default_factory=dict)
    step: dict[Key, float] = field(default_factory=dict)
    ends: dict[Key, tuple[float, float]] = field(default_factory=dict)
    integers: set[Key] = field(default_factory=set)
    least: float = 0.0
    begin: float = 0.0
    scale: Array | None = None

    @property
    def setting(self) -> Setting:
        """Reference of comparable numbers."""
        return self.evidence.setting

    def initial_objective(self) -> float:
        """Objective at the initial values."""
        self.priors = {key: one for key, one in self.priors.items() if key in self.at}
        here = self.evidence.tried(self.simulator, self.effects)
        self.scale = Paired(here.real, here.sims).scale
        self.begin = self.least = self.objective(self.measured(here).misfit(), self.at)
        return self.begin

    def tried(self, simulator: Simulator, effects: tuple[Effect, ...]) -> Paired:
        """The trial records paired with simulations at these values."""
        return self.measured(self.evidence.tried(simulator, effects))

    def measured(self, pair: Paired) -> Paired:
        """The pair with the scale of the initial twin, effects included.

        Effects such as impulsive noise and dropouts act at random: the mean of a few records is uncertain, and on the
        scale of a twin without them this scatter would be fitted.
        """
        return Paired(pair.real, pair.sims, self.scale)

    def objective(self, misfit: float, at: Mapping[Key, float]) -> float:
        """Objective: the misfit with the penalty of these values."""
        return math.sqrt(misfit**2 + self.penalty_weight * penalty(self.priors, at))

    @cached_property
    def penalty_weight(self) -> float:
        """Weight of the penalties, see `parameter_prior.penalty_weight`."""
        return self.prior_weight * penalty_weight(len(self.evidence.trial_records))

    def gather_effects(self, effects: Sequence[Effect], errors: Mapping[Key, float]) -> None:
        """Add the parameters of effects as numbers, with first steps and plausible ranges."""
        for effect in effects:
            if isinstance(effect, ByState):  # measured by fault or unit
                continue
            for key in coordinates():
                if key[0] != effect.name:
                    continue
                kind = next(field for field in effect.parameters() if field.name == key[1])
                fixed = {*self.evidence.read_off(effect.name), *effect.idle_parameters, *effect.measured_parameters}
                if not kind.metadata["searched"] or key[1] in fixed:
                    continue
                self.at[key] = to_number(effect, key[1], self.setting)
                integer = kind.type in ("int", int, "bool", bool)
                if integer:
                    self.integers.add(key)
                low, high = kind.metadata["plausible"]
                high *= _LOUDER if key[1].startswith("level") else 1.0
                plausible = [_end(effect, key[1], value, self.setting) for value in (low, high)]
                ends, least = [value for value in plausible if value is not None], 0.02
                if len(ends) == 2 and not integer:
                    self.ends[key] = (min(ends), max(ends))
                    least = min(least, _LEAST_STEP * (max(ends) - min(ends)))
                self.step[key] = 1.0 if integer else max(0.5 * errors.get(key, 0.6), least)

    def gather_baseline(self, simulator: TwinSimulator) -> None:
        """Add the baseline parameters that the twin file leaves free, as logarithms."""
        fixed = set(flat(self.evidence.spec.parameters))
        for name, value in flat(all_parameters(simulator.spec)).items():
            family = name.split(".")[0]
            known = family in _BASELINE_STEPS or name in _LEVELS
            if not known or name in fixed or not float(value) > 0:
                continue
            self.at["", name] = math.log(float(value))
            self.step["", name] = _BASELINE_STEPS.get(family, _LEVEL_STEP)
            self.priors["", name] = Prior(self.at["", name], _CALIBRATED_WITHIN.get(family, _LEVEL_WITHIN))

    def gather_level(self) -> None:
        """Add the level, as a logarithm, of a simulator that has no other free baseline parameter."""
        level = level_of(self.simulator, self.evidence.spec)
        if level is not None:
            self.at["", level[0]] = math.log(level[1])
            self.step["", level[0]] = _LEVEL_STEP

    def built(self, at: Mapping[Key, float]) -> tuple[Simulator, tuple[Effect, ...]] | None:
        """The twin and its effects at these values; None where a record cannot be simulated with them."""
        effects = []
        for effect in self.effects:
            numbers = {p: at[n, p] for n, p in at if n == effect.name}
            if not numbers:
                effects.append(effect)
                continue
            kept = {p: to_number(effect, p, self.setting) for n, p in coordinates() if n == effect.name}
            made = to_effect(effect.name, kept | numbers, self.setting)
            lists = {f.name: own for f in effect.profiles() if (own := getattr(effect, f.name))}
            effects.append(replace(cast(Any, made), **lists) if lists else made)
        if not all(self.evidence.fits(effect) for effect in effects):
            return None
        levels = {name: math.exp(value) for (of, name), value in at.items() if not of}
        try:
            simulator = self.evidence.with_values(self.simulator, effects, levels)
            read = [self.evidence.at_read_values(effect, simulator) for effect in effects]
            if read != effects:  # a level has moved, to which they are relative
                simulator = self.evidence.with_values(self.simulator, read, levels)
            return simulator, tuple(read)
        except TwingapError:
            return None

    def misfit(self, key: Key, value: float) -> float:
        """Objective with one value changed; infinite outside its range or when no trial is left."""
        low, high = self.ends.get(key, (-math.inf, math.inf))
        # An estimate outside the plausible range may move towards it but not further away.
        if not min(low, self.at[key]) <= value <= max(high, self.at[key]):
            return math.inf
        return self.misfit_at({key: value})

    def grid_search(self) -> None:
        """Grid search of each value over its plausible range, for estimates beyond the reach of steps."""
        for key, (low, high) in self.ends.items():
            for value in np.linspace(low, high, _PLACES):
                found = self.misfit(key, float(value))
                if found < _CLEARLY * self.least:
                    self.least, self.at[key] = found, float(value)

    def gauss_newton(self) -> None:
        """Gauss-Newton steps of all continuous values: levels and widths can compensate for each other."""
        shrunk = 0
        while shrunk < _SHRINKS and self.left > 0:
            self.left -= 1
            here = self.tried(*(self.built(self.at) or (self.simulator, self.effects)))
            base, weight = here.residuals(), np.sqrt(here.counts())
            columns = {key: self._derivative(key, base) for key in self.at if key not in self.integers}
            moved = {key: (column * weight).ravel() for key, column in columns.items() if column is not None}
            if not moved:
                return
            keys, jacobian = list(moved), np.stack(list(moved.values()), axis=1)
            springs = [self._penalty_derivatives(key) for key in keys]
            wanted = jacobian.T @ (base * weight).ravel() + np.array([spring[0] for spring in springs])
            square = jacobian.T @ jacobian + np.diag([spring[1] for spring in springs])
            begin = self.least
            for damping in _DAMPINGS:
                damped = square + damping * np.diag(np.diag(square)) + 1e-12 * np.eye(len(keys))
                steps = np.clip(np.linalg.solve(damped, -wanted), -_FARTHEST, _FARTHEST)
                pairs = zip(keys, steps, strict=True)
                there = {key: self._clipped(key, self.at[key] + float(n) * self.step[key]) for key, n in pairs}
                found = self.misfit_at(there)
                if found < self.least:
                    self.least = found
                    self.at |= there
                    break
            if self.least > _SETTLED * begin:
                shrunk += 1
                for key in keys:
                    self.step[key] *= 0.4

    def _penalty_derivatives(self, key: Key) -> tuple[float, float]:
        """Gradient and curvature of a value's penalty, per step."""
        if key not in self.priors:
            return 0.0, 0.0
        prior, step = self.priors[key], self.step[key]
        curvature = self.penalty_weight * prior.stiffness(self.at[key]) * step
        return curvature * (self.at[key] - prior.number), curvature * step

    def validated(self, simulator: Simulator, effects: tuple[Effect, ...]) -> bool:
        """Whether the result is no farther from the fit part than the initial values, with other random streams."""
        if not isinstance(simulator, TwinSimulator) or self.least == self.begin:
            return True
        now, then = (
            validation_distance(self.evidence, s, e) for s, e in ((simulator, effects), (self.simulator, self.effects))
        )
        return now <= then

    def _derivative(self, key: Key, base: Array) -> Array | None:
        """[strata + slopes, bins] Change of residuals per step of a value; None where the value cannot be moved."""
        for sign in (0.5, -0.5):
            value = self._clipped(key, self.at[key] + sign * self.step[key])
            if self.left <= 0 or value == self.at[key]:
                continue
            self.left -= 1
            built = self.built({**self.at, key: value})
            try:
                pair = self.tried(*built) if built else None
            except TwingapError:
                continue
            if pair is not None:
                return np.asarray((pair.residuals() - base) * (self.step[key] / (value - self.at[key])))
        return None

    def _clipped(self, key: Key, value: float) -> float:
        """Value clipped to its plausible range, extended to the current value."""
        low, high = self.ends.get(key, (-math.inf, math.inf))
        return float(np.clip(value, min(low, self.at[key]), max(high, self.at[key])))

    def misfit_at(self, there: Mapping[Key, float]) -> float:
        """Objective with several values changed; infinite when no trial is left."""
        if self.left <= 0:
            return math.inf
        self.left -= 1
        at = {**self.at, **there}
        built = self.built(at)
        try:
            return self.objective(self.tried(*built).misfit(), at) if built else math.inf
        except TwingapError:
            return math.inf

    def line_search(self, key: Key) -> None:
        """Line search: double the step while the objective decreases, else go to the vertex of a parabola and
        shorten the step."""
        begin, step = self.at[key], self.step[key]
        found = {0.0: self.least, 1.0: self.misfit(key, begin + step), -1.0: self.misfit(key, begin - step)}
        best = min(found, key=lambda turn: found[turn])
        if best:
            turn = 2 * best
            while abs(turn) <= _FARTHEST:
                found[turn] = self.misfit(key, begin + turn * step)
                if found[turn] >= found[best]:
                    break
                best, turn = turn, 2 * turn
            self.step[key] = step * abs(best)
        else:
            bend = found[1.0] - 2 * found[0.0] + found[-1.0]
            vertex = 0.5 * (found[-1.0] - found[1.0]) / bend if 0 < bend < math.inf else 0.0
            if abs(vertex) > 0.08:
                found[vertex] = self.misfit(key, begin + vertex * step)
                best = min(found, key=lambda turn: found[turn])
            self.step[key] = 0.4 * step
        if found[best] < self.least:
            self.least, self.at[key] = found[best], begin + best * step


def _end(effect: Effect, parameter: str, value: float, setting: Setting) -> float | None:
    """An end of a plausible range as a number; None where it is invalid with the other parameters."""
    try:
        return to_number(make_effect(effect.name, effect.parameter_values() | {parameter: value}), parameter, setting)
    except TwingapError:
        return None
