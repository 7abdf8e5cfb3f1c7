"""Closure of each effect: the part of the gap that adding it to the twin closes, on records not used to fit it.

held-out part --feature vectors--+
twin, before and after --simulate, replicates--> feature vectors --paired distances--> Candidate: closure, values
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Final

import numpy as np

from twingap.effects import Effect, trainable
from twingap.effects.by_state import ByState
from twingap.errors import TwingapError
from twingap.gap.distance.closure import closure_interval, paired
from twingap.gap.distance.closure_metrics import TrainingSets
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.paired import Paired
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.report.model import Candidate, ParameterValue
from twingap.gap.search.effect_search import Estimated, Explanation, estimate
from twingap.gap.search.evidence import Compared, Evidence, replicates_of
from twingap.twins.simulator import Simulator

_SIMULATED: Final = 220
"""Simulated records of tests and places, all replicates together. A larger number reduces their noise and takes
longer."""
_LIKELY: Final = 0.02
"""Probability below which the baseline is not matched anew for a candidate, and one simulation is used. A smaller
value takes longer."""

_NEVER_ACTS: Final = "none of the values tried lets it act on every record"
"""Why an effect without a detector has no fitted values."""


class HeldOut:
    """The held-out part of the records, compared with simulations of the twin with and without effects."""

    def __init__(self, evidence: Evidence, found: Explanation) -> None:
        self.evidence, self.found = evidence, found
        self.part = evidence.calibrated.held_out
        self.grid = evidence.grid(self.part.conditions)
        self.real = evidence.held_out.vectors
        n = len(self.part)
        simulator = found.before.simulator
        self.most = replicates_of(simulator, self.part.conditions, int(np.clip(np.ceil(_SIMULATED / n), 3, 39)))
        self.fewer = min(self.most, int(np.clip(np.ceil(_SIMULATED / 3 / n), 2, 12)))

    @cached_property
    def fit_vectors(self) -> FeatureVectors:
        """Feature vectors of the fit part, on the bins of the held-out part."""
        return self.evidence.vectors(self.evidence.calibrated.fit, self.grid)

    def replicates(self, simulator: Simulator, effects: tuple[Effect, ...], count: int) -> list[FeatureVectors]:
        """Feature vectors of `count` replicates of the held-out part."""
        return self.evidence.held_out_replicates(simulator, effects, count)

    def training_sets(self, after: Compared | None = None) -> TrainingSets:
        """Further records for training a classifier: the user's simulated records under the conditions of the fit
        part."""
        found = self.found
        if not isinstance(found.before.simulator, ExternalSimulator):
            return None, None
        fit = self.evidence.calibrated.fit.conditions
        after = after or (found.after if found.gap else found.before)
        faults = [str(c.fault) for c in fit]
        made = (self.evidence.simulated(one.simulator, one.effects, fit, 2) for one in (found.before, after))
        first, second = ((self.evidence.vectors(records, self.grid), faults) for records in made)
        return first, second

    def candidates(
        self, learnt: Learnt, floor: float, rng: np.random.Generator, progress: Callable[[float], None]
    ) -> Iterator[Candidate]:
        """Candidates: every effect of the catalogue that the twin lacks, with the gap without and with it.

        Each is evaluated together with the named effects. `floor` is the distance that sampling alone leaves.
        """
        found = self.found
        named = {one.effect.name: one for one in found.effects}
        # Baselines are matched in the same way without and with an effect, so that only effects differ. What was
        # measured from spectra is relative to the baseline, which stays then.
        fixed = any(one.effect.measured for one in named.values())
        after = found.after if fixed else self.evidence.against(found.after.effects)
        base = self._pair(after)
        gap = float(base[1].over_domains(base[1].squares())[0][0])
        names = [name for name in trainable() if name not in self.evidence.modelled]
        names += [name for name in named if name not in names]
        for done, name in enumerate(names):
            progress(done / len(names))
            probability = min(max(found.probability.get(name, 0.0), 0.0), 1.0)
            others = tuple(other for other in named if other != name)
            nothing_fitted = not (name in named or name in found.fitted or learnt.covers(name))
            if name in found.cannot or nothing_fitted:
                values = _values(named[name]) if name in named else {}
                why = found.cannot.get(name, _NEVER_ACTS)
                yield Candidate(name, probability, gap, gap, 0.0, (0.0, 0.0), values, why, others)
                continue
            if not found.gap:  # nothing to close: the report shows no closures then
                values = _values(estimate(name, after.fit, self.evidence, learnt))
                yield Candidate(name, probability, gap, gap, 0.0, (0.0, 0.0), values, None, others)
                continue
            if name in named:
                chain = tuple(named[o].effect for o in others if o not in found.cannot)
                without = Compared(self.evidence, chain, after.simulator) if fixed else self.evidence.against(chain)
                pair = paired(self.real, self._pair(without)[0], base[0])
                value = named[name]
            else:
                fitted = found.fitted.get(name)
                value = Estimated(fitted, {}) if fitted else estimate(name, after.fit, self.evidence, learnt)
                few = base[0][: 1 + (probability > _LIKELY)]
                pair = paired(
                    self.real, few, self._with_effect(after, value.effect, probability * (not fixed), len(few))
                )
            closed = closure_interval(*pair, floor, rng, draws=200)
            gaps = closed.before, closed.after, closed.closure, closed.ci
            yield Candidate(name, probability, *gaps, _values(value), None, others)

    def _pair(self, compared: Compared) -> tuple[list[FeatureVectors], Paired]:
        """Two replicates of the held-out part, and its distance from them."""
        vectors = self.replicates(compared.simulator, compared.effects, min(self.most, 2))
        return vectors, Paired(self.real, vectors)

    def _with_effect(self, after: Compared, effect: Effect, probability: float, count: int) -> list[FeatureVectors]:
        """Feature vectors of the twin with the named effects and one more, baseline matched anew for a likely one."""
        effects = (*after.effects, effect)
        simulator = self.evidence.against(effects).simulator if probability > _LIKELY else after.simulator
        try:
            return self.replicates(simulator, effects, count)
        except TwingapError:  # at these values the effect cannot act on one of the records: it closes nothing
            return self.replicates(after.simulator, after.effects, count)


def _values(found: Estimated) -> Mapping[str, ParameterValue]:
    return values_of_effect(found.effect, found.intervals)


def values_of_effect(effect: Effect, intervals: Mapping[str, tuple[float, float]]) -> Mapping[str, ParameterValue]:
    """Values of an effect by parameter, with unit and, where given, 90 % interval.

    Of spectra, which the closest twin's file holds, their lengths; of other lists each number, as "amplitudes.1".
    """
    base = effect.base if isinstance(effect, ByState) else effect
    values = {
        field.name: ParameterValue(float(getattr(base, field.name)), field.metadata["unit"], intervals.get(field.name))
        for field in base.parameters()
        if field.name not in base.idle_parameters
    }
    for field in base.profiles():
        numbers, unit = base.listed_profiles[field.name], field.metadata["unit"]
        if base.measured:
            values[field.name] = ParameterValue(float(len(numbers)), "values")
        else:
            values |= {f"{field.name}.{k}": ParameterValue(float(v), unit) for k, v in enumerate(numbers, start=1)}
    if isinstance(effect, ByState):
        for state, own in effect.states:
            for field in own.parameters():
                if not state.unit and getattr(own, field.name) != getattr(base, field.name):
                    value = ParameterValue(float(getattr(own, field.name)), field.metadata["unit"])
                    values[f"{field.name} ({state.fault})"] = value
        if units := {state.unit for state, _ in effect.states if state.unit}:
            values["units"] = ParameterValue(float(len(units)), "with values of their own")
    return values
