"""The closest twin: everything that brings the twin closer, whether or not it can be named.

verdict's twin --values that records of single units show--> --spectra: path, background--> --effects one by one, best
               first--> --joint search of all values--> --other forms, effects that are missing now--> --spectra again,
               lines--> units: path, background, impacts of their own--> closest twin, kept where other random streams
               confirm it

Effects stand in for each other: in a real machine several of them, none of which can be named, may close a gap
together. What the closest twin closes, and which group of effects closes it, is measured on held-out records.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from twingap.effects import Effect, Stage, catalogue, make_effect
from twingap.effects.by_state import ByState, unit_of
from twingap.effects.registry import irregular_impacts, look_alikes, measured_from_spectra
from twingap.errors import TwingapError
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.search.effect_search import Explanation, estimate
from twingap.gap.search.evidence import Compared, Evidence
from twingap.gap.search.free_spectra import BACKGROUND, LINES, PATH, By, Chain, by_fault_or_all, measured
from twingap.gap.search.initial_values import observations
from twingap.gap.search.joint import fitted_together
from twingap.gap.search.optimise import optimise, validation_distance
from twingap.gap.search.path_delays import with_delays
from twingap.gap.search.read_by_unit import read_by_unit
from twingap.gap.search.unit_impacts import effects_on_impacts, unit_distance, with_impacts_by_unit
from twingap.twins.simulator import Simulator, TwinSimulator
from twingap.twins.twin_file import TwinSpec

Progress = Callable[[str, float], None]

MOST: Final = 12
"""Largest number of effects that are added. Each adds values to the joint search."""
WORTH: Final = 0.985
"""Factor on the misfit that an added effect has to reach. Closer to 1, more are added for a smaller gain."""
READ: Final = 0.997
"""Factor on the misfit that values read off the records have to reach: they are known, not fitted, so that little is
asked. Closer to 1, values are set that make no difference."""
SIMPLER: Final = 0.97
"""Factor on the distance, with other random streams, that a later stage of the search has to reach. Closer to 1, more
of what chance made is kept."""
_JOINT: Final = (60, 160)
"""Smallest and largest number of trials of the joint search. More fit values better and take longer."""
_MUCH: Final = 0.5
"""Part of the bare twin's distance from which the effects that help are fitted together. A smaller value does so more
often, which takes minutes with large records."""
_CLEAR: Final = 0.3
"""Smallest distance, in standard deviations, from which they are: what is left of weak gaps is mostly chance."""
_WIDE: Final = (7, 320)
"""Trials of that search, as a multiple of those of one search for values, and at most. More fit values better."""
_HALF: Final = 0.5
"""Part of the strength that an effect has by itself at which it begins there: others take over a part of it."""
OWN_WORTH: Final = 0.93
"""Factor on the misfit that spectra by fault have to reach where records are few, and spectra of all faults where
they are enough. Closer to 1, chance decides more often."""
_WEAK: Final = (0.5, 0.15)
"""Parts of an effect's default strength at which it is tried. More take a simulation each."""
_FORM_STRENGTHS: Final = (1.0, 0.5, 0.25)
"""Parts of an effect's strength at which its other forms are tried. More take a simulation each."""
_NEAR: Final = 1.2
"""Factor on the misfit up to which another form gets values of its own. A larger value takes longer."""
_OTHER: Final = 5
"""Replicate with which kinds of random impacts are compared: nothing is fitted to it."""
_RULED_OUT: Final = 0.003
"""Probability below which an effect is not tried. A smaller value takes longer."""
_LIKELY: Final = 0.3
"""Probability from which an effect that acts at random moments is tried. A smaller value fits chance more often."""
_TRIED: Final = 2
"""Trials of single effects, as a multiple of those of one search for values. A smaller number may leave some out."""


@dataclass(frozen=True)
class _Twin:
    """A twin and its misfit on the trial records."""

    simulator: Simulator
    effects: Chain
    misfit: float
    by: By = "all"

    @property
    def names(self) -> frozenset[str]:
        return frozenset(effect.name for effect in self.effects)


def closest_twin(
    evidence: Evidence, found: Explanation, learnt: Learnt, progress: Progress = lambda what, part: None
) -> Compared:
    """The twin with all effects that bring it closer to the fit part, their values fitted together.

    The effects of `found` stay; estimators of `learnt` give initial values. It is the verdict's twin where nothing
    brings it closer.
    """
    begin = found.after if found.gap else found.before
    bare = evidence.without_added(begin.simulator)
    start = _with_read_values(evidence, _Twin(bare, begin.effects, evidence.misfit(bare, begin.effects)), found)
    progress("spectra of path and background", 0.0)
    now = _with_first_spectra(evidence, start, found)
    every = measured_from_spectra()
    known = tuple(name for name in every if name in {*now.names, LINES})
    now = _with_spectra(evidence, now, (known, every), now.by)
    now = _in_other_forms(evidence, now, start.names)
    stages = [start, now]
    more = "effects that bring it closer"
    most = len(begin.effects) + MOST
    now = _with_more(evidence, now, found, learnt, most, lambda part: progress(more, 0.05 + 0.4 * part))
    now = _without_idle(evidence, now)
    stages.append(now)
    progress("values fitted together", 0.5)
    trials = min(max(evidence.trials // 2, _JOINT[0]), _JOINT[1])
    joint = fitted_together(
        evidence, now.simulator, now.effects, trials, lambda part: progress("values fitted together", 0.5 + 0.3 * part)
    )
    now = _Twin(*joint, now.by)
    now = _settled(evidence, now, learnt)
    now = _settled_elsewhere(evidence, now, learnt, start.names)
    progress(more, 0.9)
    # Once the values fit, others bring the twin closer, and some no longer do.
    other = _with_more(evidence, _without_idle(evidence, now), found, learnt, most)
    if other.names != now.names:
        other = _settled(evidence, other, learnt)
        now = other if other.misfit < WORTH * now.misfit else now
    now = _all_together(evidence, now, stages[1], found, learnt)
    spectra = tuple(name for name in every if name in now.names)
    with_lines = spectra, (*spectra, LINES), every
    last = _with_spectra(evidence, now, with_lines, now.by)
    if LINES in last.names and (rest := _without_lines(now, begin.effects)) != now.effects:
        given = _Twin(now.simulator, rest, evidence.misfit(now.simulator, rest), now.by)
        other = _with_spectra(evidence, given, with_lines, now.by)
        last = other if other.misfit < last.misfit else last
    stages.append(last)
    # What was fitted to chance is farther from other simulations of all records; the simplest of equals is kept.
    best, least = start, validation_distance(evidence, start.simulator, start.effects)
    for one in stages[1:]:
        if one is not best and (left := validation_distance(evidence, one.simulator, one.effects)) < SIMPLER * least:
            best, least = one, left
    on_impacts = [name for name in effects_on_impacts() if _addable(name, evidence, found)]
    best = _with_units(evidence, best, least, learnt, on_impacts)
    return Compared(evidence, best.effects, best.simulator)


def closest_spec(compared: Compared) -> TwinSpec | None:
    """Twin file of a twin with these effects and values; None for a simulator without one."""
    if not isinstance(compared.simulator, TwinSimulator):
        return None
    spec = compared.simulator.spec
    names = dict.fromkeys((*spec.effects, *(effect.name for effect in compared.effects)))
    values = {**spec.parameters, **{effect.name: effect.parameter_values() for effect in compared.effects}}
    return replace(spec, effects=tuple(names), parameters=values)


def _with_read_values(evidence: Evidence, now: _Twin, found: Explanation) -> _Twin:
    """The twin with values that the records of single units show exactly, where these bring it closer."""
    for name in catalogue():
        if not (name in now.names or _addable(name, evidence, found)):
            continue
        if (chain := read_by_unit(evidence, now.simulator, now.effects, name)) is not None:
            tried = _Twin(now.simulator, chain, evidence.misfit(now.simulator, chain))
            now = tried if tried.misfit < READ * now.misfit else now
    return now


def _with_first_spectra(evidence: Evidence, start: _Twin, found: Explanation) -> _Twin:
    """The twin with path and background as first measured, and the kind of random impacts that is closest then."""
    preferred = by_fault_or_all(evidence)
    sides: tuple[By, By] = ("fault", "all")
    now, least = start, math.inf
    for given in _rhythms(evidence, start, found):
        best = given
        for by in sides:
            choices = ((PATH,), (BACKGROUND,), (PATH, BACKGROUND)) if by == "all" else ((PATH, BACKGROUND),)
            one = _with_spectra(evidence, given, choices, by)
            noisier = by != preferred and best.by == preferred
            best = one if one.misfit < (OWN_WORTH if noisier else WORTH) * best.misfit else best
        if evidence.against().simulator.makes_waveforms:
            one = _with_spectra(evidence, given, ((PATH,), (PATH, BACKGROUND)), "all", all_samples=True)
            best = one if one.misfit < WORTH * best.misfit else best
        # Trial records are shortened, and regular impacts stand out the more the longer a record is.
        left = evidence.gap(best.simulator, best.effects, _OTHER)
        if left < WORTH * least:
            now, least = best, left
    return now


def _rhythms(evidence: Evidence, start: _Twin, found: Explanation) -> Iterator[_Twin]:
    """The twin, and the twin with random impacts of a few kinds.

    Strictly regular impacts are lines, irregular ones lie between: without the right kind, no path fits the spectra.
    """
    yield start
    for names in irregular_impacts():
        more = tuple(make_effect(name, values) for name, values in names.items() if name not in start.names)
        able = all(_addable(one.name, evidence, found) and evidence.fits(one) for one in more)
        if more and able:
            chain = (*start.effects, *more)
            yield _Twin(start.simulator, chain, evidence.misfit(start.simulator, chain))


def _with_spectra(
    evidence: Evidence, now: _Twin, choices: Sequence[tuple[str, ...]], by: By, *, all_samples: bool = False
) -> _Twin:
    """The twin with the choice of measured spectra that brings it closest."""
    best = now
    for names in choices:
        made = measured(evidence, now.simulator, now.effects, names, by=by, all_samples=all_samples) if names else None
        if made is None:
            continue
        made = with_delays(evidence, *made)
        one = _Twin(*made, evidence.misfit(*made), by)
        if one.misfit < (WORTH if best is now else 1.0) * best.misfit:
            best = one
    return best


def _with_units(evidence: Evidence, now: _Twin, left: float, learnt: Learnt, on_impacts: Sequence[str]) -> _Twin:
    """The twin with path, background and impacts by unit, where a fault has several and these bring it closer.

    One twin of all units may be close to the mean of all records and far from each unit. The distances of single units
    therefore count beside that of the means.
    """
    units = {(c.fault, unit_of(c)) for c in evidence.calibrated.fit.conditions}
    names = [name for name in (PATH, BACKGROUND) if name in now.names]
    if not names or len(units) == len({fault for fault, _ in units}):
        return now
    made = measured(evidence, now.simulator, now.effects, names, by="unit")
    if made is None:
        return now
    made = with_impacts_by_unit(evidence, *made, on_impacts)
    # Values of other effects made up for what the units have in their own paths and impacts now.
    moved = optimise(evidence, *made, learnt.errors, passes=2)
    last = moved.simulator, moved.effects
    before = math.hypot(left, unit_distance(evidence, now.simulator, now.effects))
    if math.hypot(validation_distance(evidence, *last), unit_distance(evidence, *last)) >= SIMPLER * before:
        return now
    return _Twin(*last, evidence.misfit(*last), "unit")


def _without_lines(now: _Twin, kept: Chain) -> Chain:
    """The effects without those whose lines a list may hold as well; those of `kept` stay."""
    alike, own = look_alikes(LINES), {effect.name for effect in kept}
    return tuple(effect for effect in now.effects if effect.name in own or effect.name not in alike)


def _without_idle(evidence: Evidence, now: _Twin) -> _Twin:
    """The twin without effects that keep it apart from the records, such as a mode at a place that the path has now."""
    for effect in now.effects:
        if effect.measured:
            continue
        kept = tuple(other for other in now.effects if other.name != effect.name)
        tried = _made(evidence, now, kept, moved=effect.stage <= Stage.PATH)
        if tried is not None and tried.misfit < now.misfit:
            now = tried
    return now


def _with_more(
    evidence: Evidence, now: _Twin, found: Explanation, learnt: Learnt, most: int,
    progress: Callable[[float], None] = lambda part: None,
) -> _Twin:  # fmt: skip
    """The twin with those effects added that bring it closer, up to a number in all."""
    for effect in _ranked(evidence, now, found, learnt, progress):
        tried = _tried(evidence, now, effect, rounds=2) if len(now.effects) < most else None
        now = tried if tried is not None and tried.misfit < WORTH * now.misfit else now
    return now


def _settled(evidence: Evidence, now: _Twin, learnt: Learnt) -> _Twin:
    """The twin at the nearest minimum of its values."""
    local = optimise(evidence, now.simulator, now.effects, learnt.errors, passes=2)
    return _Twin(local.simulator, local.effects, evidence.misfit(local.simulator, local.effects), now.by)


def _in_other_forms(evidence: Evidence, now: _Twin, kept: Collection[str]) -> _Twin:
    """The twin with its effects in other forms, where these are closer.

    A form was chosen before the path was measured, and what a wrong path left may have decided.
    """
    for name in _with_forms(now):
        other = _best_form(evidence, now, name, lambda effect: list(effect.forms())[1:], kept)
        now = other if other is not None and other.misfit < WORTH * now.misfit else now
    return now


def _all_together(evidence: Evidence, now: _Twin, begun: _Twin, found: Explanation, learnt: Learnt) -> _Twin:
    """The twin, or where much is left `begun` with all effects that help by themselves, where that is closer.

    These are fitted together: where many effects differ at once, those that are added one by one make up for others.
    """
    bare = validation_distance(evidence, found.before.simulator, found.before.effects)
    if validation_distance(evidence, now.simulator, now.effects) < max(_MUCH * bare, _CLEAR):
        return now
    helpful = (effect.weakened(_HALF) for effect in _ranked(evidence, begun, found, learnt, lambda part: None))
    chain = (*begun.effects, *(effect for effect in helpful if evidence.fits(effect)))
    trials = min(_WIDE[0] * evidence.trials, _WIDE[1])
    # The misfit of the joint search has a scale of its own.
    simulator, effects, _ = fitted_together(evidence, begun.simulator, chain, trials)
    made = _pruned(evidence, _Twin(simulator, effects, evidence.misfit(simulator, effects), begun.by), begun.names)
    if made.misfit < _NEAR * now.misfit:
        made = _pruned(evidence, _settled(evidence, made, learnt), begun.names)
    return made if made.misfit < WORTH * now.misfit else now


def _pruned(evidence: Evidence, now: _Twin, kept: Collection[str]) -> _Twin:
    """The twin without effects that make no difference, but for those that are `kept`."""
    while free := [effect for effect in now.effects if effect.name not in kept]:
        rests = [tuple(other for other in now.effects if other is not effect) for effect in free]
        misfits = [evidence.misfit(now.simulator, rest) for rest in rests]
        least = min(misfits)
        if least >= now.misfit / READ:
            break
        now = _Twin(now.simulator, rests[misfits.index(least)], least, now.by)
    return now


def _settled_elsewhere(evidence: Evidence, now: _Twin, learnt: Learnt, kept: Collection[str]) -> _Twin:
    """The twin with its switches in the other position, and one path for all faults, where that is closer in the end.

    With all values fitted to one form, another form is first farther: each that is near gets values of its own.
    """
    for name in _with_forms(now):
        other = _best_form(evidence, now, name, lambda effect: effect.switched(), kept)
        if other is not None and other.misfit < _NEAR * now.misfit:
            other = _settled(evidence, other, learnt)
            now = other if other.misfit < WORTH * now.misfit else now
    if now.by == "fault":
        names = [name for name in measured_from_spectra() if name in now.names]
        made = measured(evidence, now.simulator, now.effects, names, by="all") if names else None
        if made is not None and (misfit := evidence.misfit(*made)) < _NEAR * now.misfit:
            other = _settled(evidence, _Twin(*made, misfit, "all"), learnt)
            now = other if other.misfit < now.misfit else now
    return now


def _with_forms(now: _Twin) -> list[str]:
    """Names of the effects that may have another form."""
    return [effect.name for effect in now.effects if not (effect.measured or isinstance(effect, ByState))]


def _best_form(
    evidence: Evidence, now: _Twin, name: str, forms: Callable[[Effect], Iterable[Effect]], kept: Collection[str]
) -> _Twin | None:
    """The twin with the form and strength of an effect that are closest; None where it has none, or not the effect.

    What looks alike may have been added to make up for the wrong form: all is tried without it, too, but for the
    effects that are `kept`.
    """
    effect = next((one for one in now.effects if one.name == name), None)
    if effect is None:
        return None
    best = None
    for form in forms(effect):
        for factor in _FORM_STRENGTHS:
            if not evidence.fits(other := form.weakened(factor)):
                continue
            chain = tuple(other if one.name == name else one for one in now.effects)
            alone = tuple(one for one in chain if one.name in kept or one.name not in effect.look_alikes)
            for tried in dict.fromkeys((chain, alone)):
                one = _made(evidence, now, tried, moved=effect.stage <= Stage.PATH)
                best = one if one is not None and (best is None or one.misfit < best.misfit) else best
    return best


def _tried(evidence: Evidence, now: _Twin, effect: Effect, rounds: int = 1) -> _Twin | None:
    """The twin with one more effect; None where it cannot be simulated."""
    return _made(evidence, now, (*now.effects, effect), rounds, moved=effect.stage <= Stage.PATH)


def _made(evidence: Evidence, now: _Twin, chain: Chain, rounds: int = 1, *, moved: bool) -> _Twin | None:
    """The twin with other effects; path and background are as they are, or measured anew where that is closer.

    They are measured anew only where what acts before them has changed. What is measured matches mean spectra, which
    may be farther in all domains together.
    """
    names = [name for name in (PATH, BACKGROUND) if name in now.names and moved]
    try:
        made = [(now.simulator, chain)]
        if names and (again := measured(evidence, now.simulator, chain, names, rounds, by=now.by)) is not None:
            made.append(again)
        return min((_Twin(*one, evidence.misfit(*one), now.by) for one in made), key=lambda twin: twin.misfit)
    except TwingapError:
        return None


def _ranked(
    evidence: Evidence, now: _Twin, found: Explanation, learnt: Learnt, progress: Callable[[float], None]
) -> list[Effect]:
    """Effects that bring the twin closer, each at the best of its trial values, the most helpful first.

    Those on the excitation, which change what is measured of the path, are tried first: with large records or a contact
    twin the number of trials is small.
    """
    names = _others(evidence, now, found)
    names.sort(key=lambda name: catalogue()[name].stage is not Stage.EXCITATION)
    best: list[tuple[float, Effect]] = []
    left = _TRIED * evidence.trials
    for number, name in enumerate(names):
        progress(number / len(names))
        places = [effect for effect in dict.fromkeys(_values(name, evidence, learnt)) if evidence.fits(effect)]
        left -= len(places)
        tried = [(one.misfit, effect) for effect in places if (one := _tried(evidence, now, effect)) is not None]
        if tried and (least := min(tried, key=lambda row: row[0]))[0] < now.misfit:
            best.append(least)
        if left <= 0:
            break
    return [effect for _, effect in sorted(best, key=lambda row: row[0])]


def _others(evidence: Evidence, now: _Twin, found: Explanation) -> list[str]:
    """Effects that the twin does not have and that may be there."""
    out = {*now.names, *measured_from_spectra()}
    return [n for n in catalogue() if n not in out and _possible(n, found) and _addable(n, evidence, found)]


def _addable(name: str, evidence: Evidence, found: Explanation) -> bool:
    """Whether an effect can be added to the twin, which does not have it yet."""
    return name not in evidence.modelled and name not in found.cannot and evidence.can_add(name) is None


def _possible(name: str, found: Explanation) -> bool:
    """Whether an effect may be there: on the excitation always, by chance if likely, others unless ruled out."""
    kind, probability = catalogue()[name], found.probability.get(name, 1.0)
    if kind.by_chance:  # a few random moments of a record fit anything
        return probability >= _LIKELY and name in found.probability
    return kind.stage is Stage.EXCITATION or probability >= _RULED_OUT


def _values(name: str, evidence: Evidence, learnt: Learnt) -> Iterator[Effect]:
    """Values at which an effect is tried: as estimated, and weak ones."""
    default = make_effect(name)
    if learnt.covers(name):
        features = evidence.against().fit
        given = estimate(name, features, evidence, learnt).effect
        yield given
        yield from list(given.spectral_values(observations(evidence, features)))[:1]
    for factor in _WEAK:
        yield default.weakened(factor)
