"""Worlds: a simulated machine, its records, the input of the diagnosis, and the truth.

Case, seed --draws--> Layout, Base, parameters of effects --simulate--> records (and sim);  Truth, to be sealed

The same case and seed give the same bytes. Each effect and each record has its own random stream, so that the same
world with fewer effects (`machine`) differs only in these.
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
from twingap.rigs.worlds.case import CATALOGUE, ENTRY_EXIT, RICH, Case
from twingap.rigs.worlds.layout import Layout, draw_layout
from twingap.rigs.worlds.machine_levels import measure
from twingap.rigs.worlds.recorder import simulate
from twingap.rigs.worlds.rich import draw_rich
from twingap.rigs.worlds.strength import LAST, Params, draw_effect
from twingap.rigs.worlds.truth import Truth
from twingap.rigs.worlds.uncatalogued import draw_uncatalogued
from twingap.streams import Streams


@dataclass(frozen=True)
class World:
    """One world of a study.

    A diagnosis gets `records`, `sim` and `twin`; everything else is truth.

    Parameters
    ----------
    records : RecordSet
        Measured records, with nominal metadata.
    sim : RecordSet or None
        Contact arm: records of the machine without effects at the stated conditions, with other random draws and
        another gain, as from the user's own simulator.
    twin : Mapping[str, Any]
        Content of a TWIN.toml.
    truth : Truth
    case : Case
    seed : int
    layout : Layout
    base : Base
    parameters : Mapping[str, Mapping[str, Any]]
        Parameters of every effect that the records have, catalogued or not.
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
    """All of a world except its samples."""

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
        At least 0.

    Returns
    -------
    World

    Raises
    ------
    TwingapError
        When the case is impossible (an effect on faults without faults, an unknown bearing).
    """
    drawn = _draw(case, seed)
    layout, base = drawn.layout, drawn.base
    rng = Streams(drawn.roots["world"], 0)("given")
    sim = None
    if case.arm == "contact":
        other = replace(base, gain=float(np.exp(rng.uniform(np.log(0.01), np.log(100)))), unit="")
        sim = _record(layout, other, {}, drawn.roots["sim"], layout.stated_rpm)
    twin: dict[str, Any] = {
        "twin": {"model": "phenomenological", "effects": [n for n in case.modelled if n not in RICH]}
    }
    if case.arm == "twin" and rng.random() < 0.2:  # some users know the resonance from a hammer test
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
        strength=dict(case.effects + case.uncatalogued),
        uncatalogued=case.uncatalogued_names,
        bearing=asdict(layout.bearing),
        fs_hz=layout.fs_hz,
        speed_rpm=layout.speed_rpm,
        base=asdict(base),
        notes=tuple(notes),
    )
    records = _record(layout, base, drawn.parameters, drawn.roots["records"], layout.speed_rpm)
    return World(records, sim, twin, truth, case, seed, layout, base, drawn.parameters)


def machine(case: Case, seed: int, with_effects: Iterable[str]) -> RecordSet:
    """The records of `make_world(case, seed)` with some of its effects only; all other draws are the same.

    Parameters
    ----------
    case : Case
    seed : int
    with_effects : iterable of str
        Some of the case's effects, catalogued or not.

    Raises
    ------
    TwingapError
        For an effect that the case does not have.
    """
    drawn = _draw(case, seed)
    kept = _subset(drawn.parameters, with_effects)
    return _record(drawn.layout, drawn.base, kept, drawn.roots["records"], drawn.layout.speed_rpm)


def replay(world: World, *, effects: Iterable[str] | None = None, seed: int = 0, nominal: bool = False) -> RecordSet:
    """New records of the same machine: the same conditions and parameters, with new random draws within records.

    Parameters
    ----------
    world : World
    effects : iterable of str, optional
        Some of the world's effects, catalogued or not; None = the catalogued ones, at their true parameters. The
        distance between these records and the world's is then the floor that a diagnosis can reach.
    seed : int
        Seed of the new draws.
    nominal : bool
        Whether to use the stated speeds instead of the true ones.

    Raises
    ------
    TwingapError
        For an effect that the world does not have.
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
    """`count` entropies of 128 bits for a purpose."""
    if seed < 0 or number < 0:
        raise TwingapError(f"seed = {min(seed, number)}, 0 or more expected", where=f"case {case.name!r}")
    key = (zlib.crc32(case.name.encode()), zlib.crc32(purpose.encode()), number)
    words = np.random.SeedSequence(seed, spawn_key=key).generate_state(2 * count, np.uint64)
    return tuple((int(words[2 * k]) << 64) | int(words[2 * k + 1]) for k in range(count))


def _draw(case: Case, seed: int) -> _Drawn:
    names = ("world", "records", "sim", "levels")
    roots = dict(zip(names, _roots(case, seed, "make", count=len(names)), strict=True))
    draw = Streams(roots["world"], 0)
    layout = draw_layout(case, draw("layout"))
    base = draw_base(case.arm, layout, draw("base"))
    base = _with_own(case, layout, base, draw, roots["levels"])
    parameters = _rich(dict(case.effects), layout, base, draw, roots["levels"])
    early = [(n, s) for n, s in case.effects if n not in LAST and n not in RICH]
    late = [(n, s) for n, s in case.effects if n in LAST]
    if early or case.uncatalogued:
        levels = measure(base, layout, {**base.own, **parameters}, roots["levels"], 1)
        for name, strength in early:
            parameters[name] = draw_effect(name, strength, levels, base, layout, draw(name))
        for name, strength in case.uncatalogued:
            parameters[name] = draw_uncatalogued(name, strength, levels, base, layout, draw(name))
    if late:
        levels = measure(base, layout, {**base.own, **parameters}, roots["levels"], 2)
        for name, strength in late:
            parameters[name] = draw_effect(name, strength, levels, base, layout, draw(name))
    ordered = [n for n in (*CATALOGUE, *RICH) if n in parameters] + list(case.uncatalogued_names)
    return _Drawn(roots, layout, base, {name: parameters[name] for name in ordered})


def _with_own(case: Case, layout: Layout, base: Base, draw: Streams, root: int) -> Base:
    """The base machine with its own effects: those that the twin models, and in the contact arm some mild ones."""
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
    drawn = _rich(own, layout, base, draw, root)
    levels = measure(base, layout, drawn, root, 1)
    for name, strength in own.items():
        if name not in RICH:
            drawn[name] = draw_effect(name, strength, levels, base, layout, draw(f"own {name}"))
    return replace(base, own=drawn)


def _rich(wanted: Mapping[str, str], layout: Layout, base: Base, draw: Streams, root: int) -> dict[str, Params]:
    """Parameters of the wanted effects of rich machines, the path first: other strengths are relative to it."""
    made: dict[str, Params] = {}
    for name in RICH:
        if name in wanted:
            levels = measure(base, layout, {**base.own, **made}, root, 1)
            made[name] = draw_rich(name, wanted[name], levels, base, layout, draw(name))
    return made


def _record(
    layout: Layout, base: Base, effects: Mapping[str, Params], root: int, speeds: tuple[float, ...]
) -> RecordSet:
    """Simulated records with the stated conditions; their names do not depend on the case."""
    present = {**base.own, **effects}
    records = [
        Record(condition, simulate(base, layout, i, speeds[i], present, Streams(root, i)))
        for i, condition in enumerate(layout.conditions())
    ]
    return RecordSet.from_records("machine", base.unit, layout.bearing, records)
