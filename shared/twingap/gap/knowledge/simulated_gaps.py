"""Simulated gaps: machines whose missing effects are known, for training.

machine + random effects --simulate--> records (nominal metadata)   input of a diagnosis
                      |---- names and values of the effects         expected result
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twingap.effects import Draft, Effect, catalogue, make_effect, trainable
from twingap.gap.knowledge.machines import Machine, draw_machine
from twingap.gap.knowledge.outside_catalogue import with_outside_effect
from twingap.gap.search.parameter_scale import Setting, with_errors
from twingap.records import Record, RecordSet
from twingap.twins.twin_file import TwinSpec

HOW_MANY = (0.27, 0.24, 0.2, 0.12, 0.1, 0.07)
"""Probabilities of 0, 1, ... missing effects. A larger first one resolves smaller p-values, with fewer examples of
effects."""
HOW_MANY_OF_FEW = (0.48, 0.34, 0.18)
"""The same where only some effects are learnt, from few machines."""
MODELLING = 0.35
"""Part of the machines whose twin models some effects. A larger value resolves smaller p-values of such twins, with
fewer examples of others."""
OUTSIDE = 0.18
"""Part of the gaps with an effect outside the catalogue. A larger value leaves fewer gaps with catalogued effects
only."""
VARIANT = 0.25
"""Probability that a machine has a variant of an effect. A larger value leaves fewer examples of the catalogue's
form."""


@dataclass(frozen=True)
class SimulatedGap:
    """A gap with known causes."""

    records: RecordSet  # records of the machine, with nominal metadata
    spec: TwinSpec  # the twin to be diagnosed
    sim: RecordSet | None  # records of an external simulator, in place of the twin's
    missing: tuple[Effect, ...]  # effects of the machine that the twin lacks
    modelled: tuple[Effect, ...]  # effects of both, at the machine's values
    outside: bool  # whether the machine also has an effect outside the catalogue


def draw_gap(
    rng: np.random.Generator, own_simulator: bool | None = None, most_records: int = 40, among: Sequence[str] = ()
) -> SimulatedGap:
    """A random simulated gap, with effects from `among`, or from the whole catalogue.

    `own_simulator` is whether the twin is a set of simulated records; None: with probability one third.
    """
    own = bool(rng.random() < 1 / 3) if own_simulator is None else own_simulator
    machine = draw_machine(rng, own, most_records)
    chances = HOW_MANY_OF_FEW if among else HOW_MANY
    count = int(rng.choice(len(chances), p=chances))
    modelled: tuple[Effect, ...] = ()
    effects = draw_effects(rng, machine, count + (int(rng.integers(1, 3)) if rng.random() < MODELLING else 0), among)
    if len(effects) > count:
        kept = rng.permutation(len(effects))
        modelled, effects = tuple(effects[i] for i in kept[count:]), tuple(effects[i] for i in kept[:count])
    # An external simulator models effects exactly as the machine has them; a twin, in the catalogue's form.
    alike = modelled if own else ()
    built = [e if e in alike else maybe_variant(e, machine, rng) for e in (*modelled, *effects)]
    records = simulated(machine, tuple(built), rng)
    outside = bool(rng.random() < OUTSIDE)
    if outside:
        records = with_outside_effect(records, rng)
    nominal = RecordSet.from_records(
        "machine", "", machine.bearing,
        (Record(c, r.samples) for c, r in zip(machine.nominal, records, strict=True)),
    )  # fmt: skip
    sim = None
    if own:
        gain = float(np.exp(rng.normal(0, 0.7))) if rng.random() < 0.7 else 1.0
        sim = simulated(replace(machine, conditions=machine.nominal), modelled, rng, gain)
    values = {effect.name: effect.parameter_values() for effect in _as_known(modelled, machine, rng)}
    spec = TwinSpec("phenomenological", tuple(values), None, values)
    return SimulatedGap(nominal, spec, sim, effects, modelled, outside)


def maybe_variant(effect: Effect, machine: Machine, rng: np.random.Generator) -> Effect:
    """The effect in the catalogue's form or, with probability `VARIANT`, as a variant at the same values.

    Models trained only on the catalogue's form do not transfer to machines whose effects differ from it.
    """
    if type(effect).variant is Effect.variant or rng.random() >= VARIANT:
        return effect
    return effect.variant(machine, rng) or effect


def _as_known(modelled: Sequence[Effect], machine: Machine, rng: np.random.Generator) -> tuple[Effect, ...]:
    """Modelled effects as a twin file gives them: at true values, or at estimates with errors."""
    if rng.random() < 0.5:
        return tuple(modelled)
    setting, error = Setting.of(machine.nominal), 0.12 * rng.random()
    return tuple(with_errors(effect, error, setting, rng) for effect in modelled)


def simulated(machine: Machine, effects: Sequence[Effect], rng: np.random.Generator, gain: float = 1.0) -> RecordSet:
    """Simulated records of the machine under its conditions, multiplied by a gain."""
    return machine.twin(effects, gain).simulate(machine.conditions, rng)


def draw_effects(
    rng: np.random.Generator, machine: Machine, count: int, among: Sequence[str] = ()
) -> tuple[Effect, ...]:
    """Different random effects, at values that this machine's records can show; fewer where these show no more."""
    names = [name for name in trainable() if not among or name in among]
    chances = np.array([catalogue()[name].draw_weight for name in names])
    out: list[Effect] = []
    for place in rng.choice(len(names), len(names), replace=False, p=chances / chances.sum()):
        if len(out) == count:
            break
        name = names[place]
        values = catalogue()[name].draw(machine, rng)
        if values is None:
            continue
        effect = make_effect(name, values)
        if _fits(effect, machine):
            out.append(effect)
    return tuple(out)


def _fits(effect: Effect, machine: Machine) -> bool:
    """Whether every record of the machine can be simulated with the effect."""
    t = np.zeros(2)
    fastest = max(machine.conditions, key=lambda c: c.speed_rpm)
    return effect.cannot_act_on(Draft(fastest, machine.bearing, 1.0, t, t)) is None
