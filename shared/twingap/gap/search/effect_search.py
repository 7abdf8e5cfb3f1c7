"""Search for the effects that the twin lacks: detectors propose them, simulations with them added confirm them.

features --detectors--> proposed effects --estimators--> values --add, recalibrate, simulate--> new features
   ^                                                                                                 |
   +-------- propose more effects; leave one out and test whether it is missing; test the rest ------+

Detectors use features of the held-out part, and pooled features of both parts where calibration hardly affects them
(`pooled_features`). Values are estimated on the fit part (trends over speed and time, and places of lines, on both
parts) and optimised on its distance. That distance also rejects effects that increase it, and adds effects that
decrease it although their detectors score low. Reported closures are measured separately, on the held-out part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.special import expit, logit

from twingap.effects import Effect, catalogue, trainable
from twingap.effects.observations import Observations
from twingap.effects.subsynchronous import lacking_line
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.knowledge.score_calibration import Outcome
from twingap.gap.search import unlearnt
from twingap.gap.search.evidence import Compared, Evidence
from twingap.gap.search.harmonics import with_measured_harmonics
from twingap.gap.search.initial_values import better_initial, observations
from twingap.gap.search.measured_forms import with_measured_forms
from twingap.gap.search.optimise import at_estimates, closest, not_farther, optimise, validation_distance
from twingap.gap.search.parameter_prior import Key, Prior
from twingap.gap.search.parameter_scale import coordinates, to_effect, to_number, to_value
from twingap.records import Array

Progress = Callable[[str, float], None]

ROUNDS: Final = 4
"""Largest number of rounds of the stepwise search. A larger number may find more effects and takes longer."""
ALPHA: Final = 0.05
"""Level of the test for a gap to a twin. A larger value finds weaker gaps and gives more false alarms."""
CAUTIOUS_ALPHA: Final = 0.03
"""Level of the test for a gap to the user's own simulator where there are too few groups of records for an exchange
test (`exchange_test`) and no effect is certainly missing. A larger value gives more false alarms."""
SURE: Final = 0.75
"""Probability from which an effect is certainly missing. A larger value has more gaps confirmed by the exchange
test."""
ALPHA_REST: Final = 0.1
"""Level of the test for a rest. A larger value leaves more gaps partly explained."""
MOST_EFFECTS: Final = 7
"""Largest number of effects that a search adds. A larger number takes longer where the rest stays large."""
LEVEL: Final = 0.9
"""Joint probability of a confidence set. A larger value gives larger sets."""
_UNCERTAIN: Final = 0.003
"""Probability from which an effect is uncertain (symmetric about one half). A smaller value gives larger confidence
sets."""
_MOST_OPEN: Final = 13
"""Largest number of uncertain effects in confidence sets. Each more doubles the number of sets that are compared."""
THRESHOLD: Final = 0.3
"""Log odds from which an effect is tried, unless training found another threshold. A larger value tries fewer
effects."""
KEEPS: Final = 0.5
"""Decrease of the log odds below the threshold at which a tried effect is still kept. A larger value drops fewer
effects."""
HELPS: Final = 0.25
"""Part of the fit part's distance that an improbable effect has to close. A larger value adds fewer such effects."""
WORSE: Final = 1.03
"""Factor on the fit part's distance above which an added effect counts as harmful. A larger value tolerates more."""
DOUBT: Final = 2.0
"""Log odds by which a harmful effect has to exceed the threshold. A larger value drops more of them."""
MODELLED_PRIOR_WEIGHT: Final = 10.0
"""Factor on the prior of the values of modelled effects. A larger value keeps them closer to their estimates, so
that they do not compensate for effects that are missing."""
SHOWN_P: Final = 0.01
"""Part of the machines without a gap, at most, of which features show one by an effect (`Effect.shows_gap`)."""
CERTAIN: Final = 3.0
"""Least log odds of an effect that features show beyond doubt. A larger value gives it a larger probability."""
LEAST_GAIN: Final = 0.01
"""Part of the distance of held-out records that a named effect closes at least. A larger value drops more effects."""
WITHOUT_GAIN: Final = math.log(0.1)
"""Log odds that an effect gains where it closes less: of effects named with a probability of about three quarters that
close nothing, three of four are false. A smaller value drops more probable ones."""
TREND_WEIGHT: Final = 10.0
"""Factor on the priors of effects that a trend over speed or time shows: it is estimated on all records, while the
distance sees those of the fit part, which may all be near one speed or time. A larger value keeps them closer to it."""
UNLIKELY: Final = -2.5
"""Log odds below which an effect is never tried. A larger value saves simulations and may miss effects."""


@dataclass(frozen=True)
class Estimated:
    """An effect at its estimated values."""

    effect: Effect
    intervals: Mapping[str, tuple[float, float]]  # 90 % intervals of its parameters, in their units
    # Priors of the parameters from the estimators; they stay when values are optimised.
    priors: Mapping[Key, Prior] = field(default_factory=dict)


@dataclass(frozen=True)
class Explanation:
    """Result of a search."""

    p_value: float  # of no gap
    gap: bool  # whether there is a gap at the level of the test
    effects: tuple[Estimated, ...]  # effects named as missing, the most certain first
    probability: Mapping[str, float]  # probability that each effect of the catalogue is missing
    # Sets of effects that the data do not distinguish, the most probable first.
    confidence_set: tuple[tuple[str, ...], ...]
    rest_p: float  # of no rest once the effects are added
    before: Compared  # the twin as given, and the twin with those named effects that its simulator can add
    after: Compared
    cannot: Mapping[str, str]  # effects that the simulator cannot add, and the reason
    # Effects without a detector, at the values that were fitted to the twin, named or not.
    fitted: Mapping[str, Effect] = field(default_factory=dict)
    by_lines: bool = False  # whether lines alone show the gap, of which the distance sees little
    # Shaft orders of a line that most records of every state share, and the twin with the effects does not have.
    line_order: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects named as missing."""
        return tuple(found.effect.name for found in self.effects)


@dataclass(frozen=True)
class Searched:
    """A finished search, before probabilities are calibrated."""

    search: _Search
    p_value: float  # of no gap
    rest_p: float  # of no rest
    outcomes: Mapping[str, Outcome]  # outcome of every effect that the given twin does not have


def search(
    evidence: Evidence,
    learnt: Learnt,
    progress: Progress = lambda what, part: None,
    held: Mapping[str, Estimated] = MappingProxyType({}),
) -> Searched:
    """Stepwise search: add effects that seem missing, drop those that are not confirmed, until nothing changes.

    Effects in `held`, which have no detectors, are added first and never dropped.
    """
    found = _Search(evidence, learnt)
    progress("the twin as given", 0.0)
    p_value = learnt.p_value(evidence.against().held_out, evidence.modelled)
    gap = p_value <= level_of_gap(evidence) or bool(held)
    found.hold(held)
    for turn in range(ROUNDS):
        progress("which effects", 0.2 + 0.2 * turn)
        # An effect once dropped stays out: otherwise the search could cycle.
        more = found.probable() or (found.helpful() if gap and turn else [])
        if not more and turn:
            break

        def adding(name: str, part: float, turn: int = turn) -> None:
            progress(f"{name.replace('_', ' ')} added", 0.2 + 0.2 * (turn + 0.7 * part))

        found.add(more, adding)
        progress("effects left out one by one", 0.2 + 0.2 * (turn + 0.7))
        found.drop_weakest()
    rest_p = found.rest_p(p_value)
    named = len(found.values) - len(held)
    outcomes = {
        name: Outcome(odds, found.first[name], name in found.values, named, p_value, rest_p)
        for name, odds in found.certainty().items()
    }
    return Searched(found, p_value, rest_p, outcomes)


def explain(evidence: Evidence, learnt: Learnt, progress: Progress) -> Explanation:
    """Search for the effects that the twin lacks, with calibrated probabilities and optimised values."""
    ended = search(evidence, learnt, progress)
    own = [name for name in trainable() if not learnt.covers(name) and name not in ended.search.already]
    tested: dict[str, unlearnt.Gain] = {}
    fitted: dict[str, Effect] = {}
    if own:
        ended, tested, fitted = _with_unlearnt(evidence, learnt, ended, own, progress)
    found, p_value = ended.search, ended.p_value
    progress("confidence", 0.9)
    calibration = learnt.calibration
    probability = {
        name: _probability(outcome.certainty) if calibration is None else calibration.probability(outcome)
        for name, outcome in ended.outcomes.items()
    } | {name: unlearnt.probability(gain.p_value) for name, gain in tested.items()}
    gap = p_value <= level_of_gap(evidence, max((probability[n] for n in ended.outcomes), default=0.0))
    by_lines = not gap and found.shows_gap()
    if by_lines:  # Bonferroni: two tests
        gap, p_value = True, min(p_value, 2 * SHOWN_P)
    sure = [name for name, gain in tested.items() if gain.p_value <= unlearnt.LEVEL / len(own)]
    if not gap:
        # A twin is never calibrated perfectly: an effect that makes up for that is no effect that is missing.
        sure = [name for name in sure if tested[name].obvious]
        if sure:  # Bonferroni: a test of the learnt models, and one of each effect
            gap, p_value = True, min(1.0, 2 * len(own) * min(tested[name].p_value for name in sure))
    names = [*sure, *to_name({name: probability[name] for name in ended.outcomes}, learnt.named_from)]
    found.keep([name for name in found.values if name in names])
    if gap:
        found.add([name for name in names if name not in found.values])
        progress("effects without a gain", 0.91)
        probability |= found.drop_without_gain(probability, learnt.named_from)
    rest_p, line_order = found.rest_p(p_value), line_order_of(evidence, found.now)
    progress("values", 0.92)
    before, after = found.optimised(gap)
    sets = confidence_set(probability, learnt.set_level if calibration is None else LEVEL)
    named = found.strongest_first() if gap else []
    return Explanation(
        p_value, gap, tuple(found.values[name] for name in named),
        probability | dict.fromkeys(found.already, 0.0), sets if gap else ((), *filter(None, sets)), rest_p,
        before, after, found.cannot, fitted, by_lines, line_order,
    )  # fmt: skip


def _with_unlearnt(
    evidence: Evidence, learnt: Learnt, plain: Searched, own: Sequence[str], progress: Progress
) -> tuple[Searched, dict[str, unlearnt.Gain], dict[str, Effect]]:
    """Search with effects that have no detector, the gains by these effects, and the effects at fitted values.

    Each effect is fitted to the twin as given. One that significantly reduces the distance of held-out records is held,
    and the search is repeated with it, because the first search may have named a surrogate for it. The effect stays if
    leaving it out increases the distance significantly, and if the twin is closer to the held-out records than with the
    effects of the previous search.
    """
    level, bare = unlearnt.LEVEL / len(own), evidence.against()
    tested, held, best = dict.fromkeys(own, unlearnt.Gain(1.0)), dict[str, Estimated](), plain
    fitted: dict[str, Effect] = {}
    for name in [name for name in own if name not in plain.search.cannot]:
        progress(f"fit of {name}", 0.8)
        others = tuple(one.effect for one in held.values())
        effect = unlearnt.fitted(evidence, name, bare.fit, others)
        if effect is None:
            continue
        fitted[name] = effect
        tested[name] = unlearnt.gain(evidence, (*others, effect), others)
        if tested[name].p_value > level:
            continue
        again = search(evidence, learnt, progress, held | {name: Estimated(effect, {})})
        chain = again.search.added()
        without = tuple(one for one in chain if one.name != name)
        tested[name] = unlearnt.gain(evidence, chain, without)
        if best.search.added() not in ((), without):
            tested[name] = max(tested[name], unlearnt.gain(evidence, chain, best.search.added()))
        if tested[name].p_value <= level:
            held, best = held | {name: again.search.values[name]}, again
    return best, tested, fitted


def level_of_gap(evidence: Evidence, surest: float = 0.0) -> float:
    """Level of the test for a gap, where `surest` is the largest probability of a missing effect."""
    exchange_test_follows = not evidence.against().simulator.makes_waveforms or evidence.exchangeable
    return ALPHA if exchange_test_follows or surest >= SURE else CAUTIOUS_ALPHA


def line_order_of(evidence: Evidence, compared: Compared) -> float | None:
    """Shaft orders of a line that most records of every state share and a twin does not have, if any."""
    line = lacking_line(observations(evidence, compared.held_out))
    return None if line is None else line.order


def with_line_order(evidence: Evidence, found: Explanation, former: Explanation) -> Explanation:
    """The explanation with the line that its twin still lacks, where effects were added to a former one's."""
    if former.line_order is None or found.after is former.after:
        return found
    return replace(found, line_order=line_order_of(evidence, found.after))


def with_fitted_values(evidence: Evidence, learnt: Learnt, names: Sequence[str]) -> tuple[Effect, ...]:
    """Modelled effects at the values, near their estimates, that bring the twin closest to the fit part.

    `evidence` is of a twin without these effects. Effects that act on none of the records are left out. Priors are
    strong (`MODELLED_PRIOR_WEIGHT`), because other effects may be missing and these values must not compensate for
    them.
    """
    found = _Search(evidence, learnt, MODELLED_PRIOR_WEIGHT)
    found.add(names)
    return found.optimised(gap=True)[1].effects


class _Search:
    """State of a search: effects found so far, and the twin that has them."""

    def __init__(self, evidence: Evidence, learnt: Learnt, prior_weight: float = 1.0) -> None:
        self.evidence, self.learnt, self.prior_weight = evidence, learnt, prior_weight
        self.cannot = {n: why for n in catalogue() if (why := evidence.can_add(n)) is not None}
        self.already = set(evidence.modelled)
        self.now = evidence.against()
        self._known: dict[tuple[Compared, bool], dict[str, float]] = {}
        self.first = self.odds(self.now)
        self.values: dict[str, Estimated] = {}
        self.missed: dict[str, float] = {}
        self.errors = learnt.errors
        self.tried: set[str] = set()
        self.helped: set[str] = set()
        self.held: set[str] = set()

    def hold(self, effects: Mapping[str, Estimated]) -> None:
        """Add effects that are never dropped."""
        self.values.update(effects)
        self.held |= set(effects)
        if effects:
            self.now = self.evidence.against(self.added())
            self.refine(list(effects))

    def shows_gap(self) -> bool:
        """Whether features show a gap by an effect, or by another line, that the given twin lacks."""
        seen = observations(self.evidence, self.evidence.against().held_out)
        return any(catalogue()[name].shows_gap(seen) for name in self.first) or lacking_line(seen) is not None

    def odds(self, compared: Compared, *, left_out: bool = False) -> dict[str, float]:
        """Log odds that the twin lacks each effect; effects of the given twin are left out.

        `left_out` selects the calibration of a first evaluation for a twin from which a tried effect was removed. That
        of later evaluations is for further effects only: few are missing once others have been added.
        """
        key = compared, bool(compared.effects) and not left_out
        if key not in self._known:
            found = self.learnt.log_odds(compared.held_out, later=key[1])[0]
            pairs = zip(self.learnt.effects, found, strict=True)
            seen = observations(self.evidence, compared.held_out)
            self._known[key] = {
                name: _shown(catalogue()[name], float(value), seen)
                for name, value in pairs if name not in self.already and self.learnt.covers(name)
            }  # fmt: skip
        return self._known[key]

    def probable(self) -> list[str]:
        """Effects not yet tried whose log odds exceed their threshold, in decreasing order."""
        odds = self.odds(self.now)
        limit = self.learnt.thresholds
        found = [n for n in _strongest(odds) if odds[n] > limit.get(n, THRESHOLD) and n not in self.tried]
        return found[: max(MOST_EFFECTS - len(self.values), 0)]

    def helpful(self) -> list[str]:
        """The improbable effect that reduces the distance most, where the rest is significant."""
        # Without any effect, all of the gap is rest.
        if self.rest_p(0.0) > ALPHA_REST or len(self.values) >= MOST_EFFECTS:
            return []
        odds, gap = self.odds(self.now), self._gap()
        best = (1.0, "")
        for name in [n for n in _strongest(odds) if n not in self.tried and n not in self.cannot][:4]:
            if odds[name] < UNLIKELY:
                continue
            value = estimate(name, self.now.fit, self.evidence, self.learnt)
            if not self.evidence.fits(value.effect):
                continue
            added = (*self.added(), value.effect)
            left = self.evidence.gap(self.evidence.against(added).simulator, added) / max(gap, 1e-9)
            # The more probable an effect, the smaller the reduction that it needs.
            best = min(best, (left / (1 - HELPS * _probability(-odds[name])), name))
        self.helped |= {best[1]} - {""}
        return [best[1]] if best[1] else []

    def _gap(self) -> float:
        """Distance of the fit part from the current twin."""
        added = self.added()
        return self.evidence.gap(self.evidence.with_values(self.now.simulator, added), added)

    def refine(self, names: Sequence[str]) -> None:
        """Optimise the values of these effects on the fit part."""
        found = optimise(
            self.evidence, self.now.simulator, self.added(), self.errors,
            moved=names, baseline=False, passes=1, priors=self._priors(self.added()), prior_weight=self.prior_weight,
        )  # fmt: skip
        self._store_values(found.effects)
        self.now = self.evidence.against(self.added())

    def optimised(self, gap: bool) -> tuple[Compared, Compared]:
        """The twin as given, and the twin with the effects found where there is a gap, both with optimised values.

        The baseline is optimised in both, so that what the baseline alone can close is not credited to effects.
        """
        bare = optimise(self.evidence, self.evidence.against().simulator, (), {})
        before = Compared(self.evidence, (), bare.simulator)
        if not gap or not self.added():
            return before, before
        # Lines show the amplitudes of harmonics: without them, levels are fitted to a decay that no supply or gear has.
        start = self.now.simulator, self.added()
        simulator, effects = with_measured_harmonics(self.evidence, *start) or start
        priors = self._priors(effects)
        found = optimise(self.evidence, simulator, effects, self.errors, priors=priors, prior_weight=self.prior_weight)
        # Values that a search has moved far from their estimates may be in a wrong minimum.
        estimates = at_estimates(effects, priors, self.evidence.setting)
        if estimates != tuple(effects) and all(self.evidence.fits(effect) for effect in estimates):
            anew = optimise(
                self.evidence, self.evidence.against(estimates).simulator, estimates, self.errors,
                priors=priors, prior_weight=self.prior_weight, grid=False,
            )  # fmt: skip
            found = closest(self.evidence, (found, anew), priors, self.prior_weight)
        found = not_farther(self.evidence, found, bare, self.errors, priors=priors, prior_weight=self.prior_weight)
        last = found.simulator, found.effects
        again = with_measured_harmonics(self.evidence, *last)
        if again and validation_distance(self.evidence, *again) <= validation_distance(self.evidence, *last):
            last = again
        last = with_measured_forms(self.evidence, *last)
        self._store_values(last[1])
        return before, Compared(self.evidence, last[1], last[0])

    def _store_values(self, effects: Sequence[Effect]) -> None:
        """Store optimised values; intervals are extended to include them."""
        for effect in effects:
            known, values = self.values[effect.name], effect.parameter_values()
            reaching = {
                p: (min(low, float(values[p])), max(high, float(values[p])))
                for p, (low, high) in known.intervals.items()
            }
            self.values[effect.name] = replace(known, effect=effect, intervals=reaching)

    def _priors(self, effects: Sequence[Effect]) -> dict[Key, Prior]:
        """Priors of the values of these effects; none where records showed them."""
        measured = {effect.name for effect in effects if effect.measured_parameters}
        values = (value for name, value in self.values.items() if name not in measured)
        return {key: prior for value in values for key, prior in value.priors.items()}

    def add(self, names: Sequence[str], progress: Progress = lambda what, part: None) -> None:
        """Add effects at the values estimated from features of the fit part against the current twin."""
        features = self.now.fit
        for name in names:
            self.tried.add(name)
            value = estimate(name, features, self.evidence, self.learnt)
            if name in self.cannot or self.evidence.fits(value.effect):
                self.values[name] = value
        self.now = self.evidence.against(self.added())
        here = [name for name in names if name in self.values and name not in self.cannot]
        for done, name in enumerate(here):
            progress(name, done / len(here))
            self.improve_initial(name, features)
        if here:
            self.refine(here)

    def improve_initial(self, name: str, features: Array) -> None:
        """Replace the values of an effect by other initial values where these have a smaller misfit."""
        added = self.added()
        priors = self.values[name].priors
        now = self.evidence.misfit(self.now.simulator, added)
        found = better_initial(self.evidence, added, name, features, now, priors)
        if found is not None:
            self._store_values([found.effect])
            if found.read:  # other values: the prior moves there
                numbers = {key: to_number(found.effect, key[1], self.evidence.setting) for key in priors}
                anew = {key: one._replace(number=numbers[key]) for key, one in priors.items()}
                self.values[name] = replace(self.values[name], priors=anew)
            self.now = self.evidence.against(self.added())

    def drop_weakest(self) -> None:
        """Backward elimination: drop the weakest effect while its log odds, with it left out, are below its limit."""
        while len(self.values) > len(self.held):
            self.missed, slack, gap = {}, {}, self._gap()
            for name in [name for name in self.values if name not in self.held]:
                others = self.added(without=name)
                without = self.evidence.against(others)
                self.missed[name] = self.odds(without, left_out=True)[name]
                # A missing effect cannot increase the distance when added: one that does needs higher log odds.
                worse = name not in self.cannot and gap > WORSE * self.evidence.gap(without.simulator, others)
                least = UNLIKELY if name in self.helped else self.learnt.thresholds.get(name, THRESHOLD) - KEEPS
                slack[name] = self.missed[name] - least - DOUBT * worse
            weakest = min(slack, key=lambda name: slack[name])
            if slack[weakest] > 0:
                return
            del self.values[weakest]
            self.now = self.evidence.against(self.added())

    def drop_without_gain(self, probability: Mapping[str, float], named_from: float) -> dict[str, float]:
        """Drop named effects without which the twin is as close to held-out records; their new probabilities.

        The least probable is left out first: of two effects that stand in for each other, the other is then needed.
        Those that lines show stay, because distances hardly see lines.
        """
        seen = observations(self.evidence, self.evidence.against().held_out)
        dropped: dict[str, float] = {}
        for name in sorted(self.values, key=lambda name: probability[name]):
            revised = float(expit(logit(probability[name]) + WITHOUT_GAIN))
            if revised >= named_from or name in self.held or name in self.cannot or catalogue()[name].certain(seen):
                continue
            others = self.added(without=name)
            gained = unlearnt.gain(self.evidence, self.added(), others)
            if gained.after > 0 and gained.after >= (1 - LEAST_GAIN) * gained.before:
                dropped[name] = revised
                del self.values[name]
                self.now = self.evidence.against(others)
        return dropped

    def certainty(self) -> dict[str, float]:
        """Log odds of every effect: of a named one with that effect left out, of any other against the current twin."""
        now = self.odds(self.now)
        return {name: self.missed.get(name, now[name]) if name in self.values else now[name] for name in now}

    def rest_p(self, p_value: float) -> float:
        """P-value of no rest for the current twin; `p_value`, that of no gap, where no effect was added."""
        if not self.values:
            return p_value
        return self.learnt.rest_p(self.now.held_out, {*self.already, *(effect.name for effect in self.added())})

    def keep(self, names: Sequence[str]) -> None:
        """Drop all effects but these."""
        if set(names) != set(self.values):
            self.values = {name: value for name, value in self.values.items() if name in names}
            self.now = self.evidence.against(self.added())

    def strongest_first(self) -> list[str]:
        """Named effects in order of decreasing certainty, those without a detector first."""
        return sorted(
            self.values,
            key=lambda name: (name not in self.held, -(self.missed.get(name, 0.0) + self.first.get(name, 0.0))),
        )

    def added(self, without: str = "") -> tuple[Effect, ...]:
        """The effects found that the simulator can add."""
        return tuple(v.effect for n, v in self.values.items() if n != without and n not in self.cannot)


def estimate(name: str, features: Array, evidence: Evidence, learnt: Learnt) -> Estimated:
    """An effect at the values estimated from features [features] of the fit part, with 90 % intervals.

    Parameters without an estimator have their defaults and no interval, values that the records show exactly no
    interval.
    """
    setting = evidence.setting
    default = catalogue()[name]()
    least_spread = {field.name: field.metadata["least_spread"] for field in default.parameters()}
    numbers, intervals, within = {}, {}, {}
    for effect, parameter in coordinates():
        if effect != name:
            continue
        found = learnt.estimators.get((name, parameter))
        if found is None:
            numbers[parameter] = to_number(default, parameter, setting)
            continue
        number = float(found.estimate(features[None, :])[0])
        numbers[parameter] = number
        off = float(found.within(features[None, :])[0])
        ends = [to_value(name, parameter, number + sign * off, setting) for sign in (-1, 1)]
        least = least_spread[parameter]
        within[parameter] = off
        intervals[parameter] = (min(ends) * (1 - least), max(ends) * (1 + least))
    made = to_effect(name, numbers, setting)
    shown = made.shown(observations(evidence, features))
    errors: dict[str, float] = {}
    if shown and evidence.fits(made.moved(**shown)):
        made = made.moved(**shown)
        numbers = {parameter: to_number(made, parameter, setting) for parameter in numbers}
        errors = {p: off for p, off in made.shown_errors().items() if p in shown}
        intervals = {p: own for p, own in intervals.items() if p not in shown}
        for p, off in errors.items():
            around = [to_value(name, p, numbers[p] + sign * off, setting) for sign in (-1, 1)]
            intervals[p] = min(around), max(around)
        within = {p: off for p, off in within.items() if p not in shown} | errors
    # Values at which no record can be simulated, such as a frequency above Nyquist: halve the way to the defaults.
    for _ in range(6):
        if evidence.fits(made):
            break
        numbers = {p: 0.5 * (n + to_number(default, p, setting)) for p, n in numbers.items()}
        made = to_effect(name, numbers, setting)
    read = evidence.read_off(name)
    made = evidence.at_read_values(made, evidence.against().simulator)
    intervals = {p: ends for p, ends in intervals.items() if p not in read}
    # From more records, or from finer bands, than the distance.
    known = within.keys() if default.trends else errors.keys()
    priors = {
        (name, p): Prior(to_number(made, p, setting), off, TREND_WEIGHT if p in known else 1.0)
        for p, off in within.items() if p not in read
    }  # fmt: skip
    return Estimated(made, intervals, priors)


def to_name(probability: Mapping[str, float], limit: float) -> list[str]:
    """Effects whose calibrated probability of being missing reaches the limit, whether or not the search kept them."""
    return [name for name, p in probability.items() if p >= limit]


def confidence_set(probability: Mapping[str, float], level: float) -> tuple[tuple[str, ...], ...]:
    """Smallest collection of sets of effects whose joint probability reaches `level`, the most probable first.

    Effects are missing independently, with these probabilities.
    """
    names = list(probability)
    p = np.array([probability[name] for name in names])
    by_doubt = np.argsort(-np.minimum(p, 1 - p))[:_MOST_OPEN]
    open_ = by_doubt[np.minimum(p, 1 - p)[by_doubt] > _UNCERTAIN]
    sure = [i for i in np.flatnonzero(p >= 0.5) if i not in open_]
    picks = (np.arange(2**open_.size)[:, None] >> np.arange(open_.size)) & 1
    weight = np.where(picks, p[open_], 1 - p[open_]).prod(axis=1)
    order = np.argsort(-weight, kind="stable")
    kept = order[: 1 + int(np.searchsorted(np.cumsum(weight[order]), level * weight.sum()))]
    return tuple(tuple(names[i] for i in sorted((*sure, *open_[picks[row] == 1]), key=lambda i: -p[i])) for row in kept)


def _shown(effect: type[Effect], odds: float, seen: Observations) -> float:
    """Log odds of an effect, where features show it, or that it is absent, at least or at most `CERTAIN`."""
    if effect.excluded(seen):
        return min(odds, -CERTAIN)
    return max(odds, CERTAIN) if effect.certain(seen) else odds


def _strongest(odds: Mapping[str, float]) -> list[str]:
    """Names of effects in order of decreasing log odds."""
    return sorted(odds, key=lambda name: -odds[name])


def _probability(log_odds: float) -> float:
    """Logistic function of log odds."""
    return 1 / (1 + math.exp(-max(min(log_odds, 30.0), -30.0)))
