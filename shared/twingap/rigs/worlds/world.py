"""Worlds: a machine, what its recorder wrote, what the diagnosis is given, and the truth about it.

Case, seed --draws--> Layout, Base, parameters of effects --simulate--> records (and sim);  Truth, to be sealed

Same case and seed, same bytes. Each effect and each record draws from a stream of its own, so that the same world with
fewer effects (`machine`) differs in nothing but these.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from twingap.errors import TwingapError
from twingap.records import Record, RecordSet
from twingap.rigs.worlds.base import OWN, Base, draw_base
from twingap.rigs.worlds.case import CATALOGUE, ENTRY_EXIT, Case
from twingap.rigs.worlds.layout import Layout, draw_layout
from twingap.rigs.worlds.outsiders import draw_outsider
from twingap.rigs.worlds.recorder import simulate
from twingap.rigs.worlds.strength import LAST, Params, draw_effect
from twingap.rigs.worlds.truth import Truth
from twingap.rigs.worlds.yardstick import measure
from twingap.streams import Streams


@dataclass(frozen=True)
class World:
    """One world of a study.

    The diagnosis may see `records`, `sim` and `twin`; all else is truth.

    Parameters
    ----------
    records : RecordSet
        What the recorder wrote, with its nominal metadata.
    sim : RecordSet or None
        Contact arm: records of the machine without effects, as its owner's simulator gives them for the stated
        conditions: other random draws, other gain.
    twin : Mapping[str, Any]
        Content of a TWIN.toml.
    truth : Truth
    case : Case
    seed : int
    layout : Layout
    base : Base
    parameters : Mapping[str, Mapping[str, Any]]
        Of every effect and outsider that the records have.
    """

    records: RecordSet
    sim: RecordSet | None
    twin: Mapping[str, Any]
    truth: Truth
    case: Case
    seed: int
    layout: Layout
    base: Base
    parameters: Mapping[str, Params]


@dataclass(frozen=True)
class _Drawn:
    """Everything about a world but its samples."""

    roots: Mapping[str, int]
    layout: Layout
    base: Base
    parameters: Mapping[str, Params]


def make_world(case: Case, seed: int) -> World:
    """Make a world.

    Parameters
    ----------
    case : Case
    seed : int
        Not negative.

    Returns
    -------
    World

    Raises
    ------
    TwingapError
        When the case cannot be (an effect on faults without faults, an unknown bearing).
    """
    drawn = _draw(case, seed)
    layout, base = drawn.layout, drawn.base
    rng = Streams(drawn.roots["world"], 0)("given")
    sim = None
    if case.arm == "contact":
        other = replace(base, gain=float(np.exp(rng.uniform(np.log(0.01), np.log(100)))), unit="")
        sim = _record(layout, other, {}, drawn.roots["sim"], layout.stated_rpm)
    twin: dict[str, Any] = {"twin": {"model": "phenomenological", "effects": list(case.modelled)}}
    if case.arm == "twin" and rng.random() < 0.2:  # now and then its owner knows the resonance from a hammer test
        twin["parameters"] = {"resonance_hz": float(f"{base.modes[0].frequency_hz:.4g}")}
    notes = []
    if case.arm == "contact":
        notes.append("sim: the same machine without the effects, at the stated speeds, other draws, other gain")
    truth = Truth(
        case=case.name,
        kind=case.kind,
        arm=case.arm,
        seed=seed,
        effects=case.effect_names,
        parameters=drawn.parameters,
        strength=dict(case.effects + case.outsiders),
        outsiders=case.outsider_names,
        bearing=asdict(layout.bearing),
        fs_hz=layout.fs_hz,
        speed_rpm=layout.speed_rpm,
        base=asdict(base),
        notes=tuple(notes),
    )
    records = _record(layout, base, drawn.parameters, drawn.roots["records"], layout.speed_rpm)
    return World(records, sim, twin, truth, case, seed, layout, base, drawn.parameters)


def machine(case: Case, seed: int, with_effects: Iterable[str]) -> RecordSet:
    """The records of `make_world(case, seed)` with some of its effects only, every other draw the same.

    Parameters
    ----------
    case : Case
    seed : int
    with_effects : iterable of str
        Names out of the case's effects and outsiders.

    Raises
    ------
    TwingapError
        For an effect that the case has not.
    """
    drawn = _draw(case, seed)
    kept = _subset(drawn.parameters, with_effects)
    return _record(drawn.layout, drawn.base, kept, drawn.roots["records"], drawn.layout.speed_rpm)


def replay(world: World, *, effects: Iterable[str] | None = None, seed: int = 0, nominal: bool = False) -> RecordSet:
    """The machine run again: the same conditions and parameters, everything random within records drawn anew.

    Parameters
    ----------
    world : World
    effects : iterable of str, optional
        Out of the world's effects and outsiders; None = the catalogued ones, at their true parameters. What is left
        between these records and the world's is the floor that a diagnosis can reach.
    seed : int
        Of the new draws.
    nominal : bool
        At the speeds that the recorder states, not at the true ones.

    Raises
    ------
    TwingapError
        For an effect that the world has not.
    """
    kept = _subset(world.parameters, world.case.effect_names if effects is None else effects)
    (root,) = _roots(world.case, world.seed, "replay", seed)
    speeds = world.layout.stated_rpm if nominal else world.layout.speed_rpm
    return _record(world.layout, world.base, kept, root, speeds)


def _subset(parameters: Mapping[str, Params], names: Iterable[str]) -> dict[str, Params]:
    kept = list(names)
    for name in kept:
        if name not in parameters:
            mend = f"it has {', '.join(parameters) or 'none'}"
            raise TwingapError(f"the world has no effect {name!r}", where="effects", mend=mend)
    return {name: parameters[name] for name in kept}


def _roots(case: Case, seed: int, purpose: str, number: int = 0, count: int = 1) -> tuple[int, ...]:
    """Entropy for a purpose, 128 bits each."""
    if seed < 0 or number < 0:
        raise TwingapError(f"seed = {min(seed, number)}, 0 or more expected", where=f"case {case.name!r}")
    key = (zlib.crc32(case.name.encode()), zlib.crc32(purpose.encode()), number)
    words = np.random.SeedSequence(seed, spawn_key=key).generate_state(2 * count, np.uint64)
    return tuple((int(words[2 * k]) << 64) | int(words[2 * k + 1]) for k in range(count))


def _draw(case: Case, seed: int) -> _Drawn:
    names = ("world", "records", "sim", "yard")
    roots = dict(zip(names, _roots(case, seed, "make", count=len(names)), strict=True))
    draw = Streams(roots["world"], 0)
    layout = draw_layout(case, draw("layout"))
    base = draw_base(case.arm, layout, draw("base"))
    base = _with_own(case, layout, base, draw, roots["yard"])
    parameters: dict[str, Params] = {}
    early = [(n, s) for n, s in case.effects if n not in LAST]
    late = [(n, s) for n, s in case.effects if n in LAST]
    if early or case.outsiders:
        yard = measure(base, layout, base.own, roots["yard"], 1)
        for name, strength in early:
            parameters[name] = draw_effect(name, strength, yard, base, layout, draw(name))
        for name, strength in case.outsiders:
            parameters[name] = draw_outsider(name, strength, yard, base, layout, draw(name))
    if late:
        yard = measure(base, layout, {**base.own, **parameters}, roots["yard"], 2)
        for name, strength in late:
            parameters[name] = draw_effect(name, strength, yard, base, layout, draw(name))
    ordered = [n for n in CATALOGUE if n in parameters] + list(case.outsider_names)
    return _Drawn(roots, layout, base, {name: parameters[name] for name in ordered})


def _with_own(case: Case, layout: Layout, base: Base, draw: Streams, root: int) -> Base:
    """What the machine has of its own: what the twin models, and in the contact arm other mild physics."""
    own = dict.fromkeys(case.modelled, "medium")
    if case.arm == "contact":
        rng = draw("own")
        given = set(case.effect_names)
        for name in OWN:
            strength = str(rng.choice(["weak", "medium"]))
            masks = name == "slip_jitter" and given & {"speed_fluctuation", ENTRY_EXIT, "mean_slip"}
            if rng.random() < 0.5 and name not in given and not masks and (layout.faults or name == "shaft_harmonics"):
                own.setdefault(name, strength)
    if not own:
        return base
    yard = measure(base, layout, {}, root, 1)
    drawn = {n: draw_effect(n, s, yard, base, layout, draw(f"own {n}")) for n, s in own.items()}
    return replace(base, own=drawn)


def _record(
    layout: Layout, base: Base, effects: Mapping[str, Params], root: int, speeds: tuple[float, ...]
) -> RecordSet:
    """Run the machine and write down what the recorder states; names tell nothing about the case."""
    whole = {**base.own, **effects}
    records = [
        Record(condition, simulate(base, layout, i, speeds[i], whole, Streams(root, i)))
        for i, condition in enumerate(layout.conditions())
    ]
    return RecordSet.from_records("machine", base.unit, layout.bearing, records)
