"""Plan of a blind study: its cases, balanced over kinds, effects and strengths, in random order.

number of worlds, seed --> kinds by share --> effects, strengths and arms in turn --> shuffled cases
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from twingap.errors import TwingapError
from twingap.rigs.worlds.case import (
    CATALOGUE,
    KINDS,
    RICH,
    RICH_KINDS,
    STRENGTHS,
    UNCATALOGUED,
    UNCATALOGUED_STRENGTHS,
    Case,
)

SHARES: Final = {"none": 60, "single": 90, "pair": 50, "crowd": 40, "outside": 30, "outside_plus": 30}
"""Number of each kind in 300 worlds. Among 90 singles every effect has every strength, a quarter of them twice."""

RICH_SHARES: Final = dict(zip(RICH_KINDS, (40, 40, 50, 20), strict=True))
"""Number of each kind in 150 rich worlds."""

COMPANY_OF_RICH: Final = tuple(
    name
    for name in CATALOGUE
    if name not in ("second_resonance", "sensor_rolloff", "shaft_harmonics", "looseness", "mains_interference",
                    "drive_interference", "gear_mesh", "waviness")
)  # fmt: skip
"""Effects that occur in rich worlds: without those that a path or lines contain, which could not be told apart."""

TWIN_ARM_ONLY: Final = ("mean_slip", "distributed_roughness")
"""Effects that are no singles in the contact arm, since contact machines may have them already."""

ONE_OF: Final = (frozenset({"shaft_harmonics", "looseness"}),)
"""Effects that do not occur together: looseness contains all shaft harmonics, so the two could not be told apart."""


def cases(n: int, seed: int = 0, rich: int = 0) -> list[Case]:
    """A balanced plan.

    Parameters
    ----------
    n : int
        Worlds of `KINDS`, at least 6: one of each kind.
    seed : int
    rich : int
        Worlds of `RICH_KINDS` in addition; the others do not depend on it.

    Returns
    -------
    list of Case
        In random order, named w0000, w0001, ... in that order; then the rich ones, named r0000, r0001, ...

    Raises
    ------
    TwingapError
        For fewer than 6 worlds.
    """
    if n < len(KINDS):
        raise TwingapError(f"{n} worlds, at least {len(KINDS)} expected", where="plan of the study")
    rng = np.random.default_rng([seed, 7])
    made: list[Case] = []
    effects, uncatalogued = _deck(CATALOGUE, rng), _uncatalogued_deck(rng)
    for kind, count in _counts(n, SHARES, 1.0).items():
        singles = _singles(rng) if kind == "single" else iter(())
        start = int(rng.integers(0, 3))
        owed = 0
        for k in range(count):
            owed += (k + start) % 3 == 0  # a third of the worlds is of the contact arm
            chosen: tuple[tuple[str, str], ...] = ()
            extra: tuple[tuple[str, str], ...] = ()
            if kind == "single":
                chosen = (next(singles),)
            elif kind == "pair":
                chosen = _deal(effects, 2, STRENGTHS, (0.25, 0.4, 0.35), rng)
            elif kind == "crowd":
                chosen = _deal(effects, int(rng.integers(3, 6)), STRENGTHS[1:], (0.5, 0.5), rng)
            elif kind == "outside":
                extra = (next(uncatalogued),)
            elif kind == "outside_plus":
                extra = (next(uncatalogued),)
                if rng.random() < 0.4:
                    extra += (next(o for o in uncatalogued if o[0] != extra[0][0]),)
                chosen = _deal(effects, int(rng.integers(1, 3)), STRENGTHS[1:], (0.5, 0.5), rng)
            contact = owed > 0 and not (kind == "single" and chosen[0][0] in TWIN_ARM_ONLY)
            owed -= contact
            made.append(Case(kind, "contact" if contact else "twin", chosen, extra))
    order = rng.permutation(len(made))
    return [replace(made[j], name=f"w{k:04d}") for k, j in enumerate(order)] + _rich_cases(rich, seed)


def _rich_cases(n: int, seed: int) -> list[Case]:
    """Worlds of rich machines. In the contact arm, some have path and lines in the simulated records, too."""
    rng = np.random.default_rng([seed, 8])
    company = _deck(COMPANY_OF_RICH, rng)
    made: list[Case] = []
    for kind, count in _counts(n, RICH_SHARES, 0.0).items():
        start = int(rng.integers(0, 6))
        for k in range(start, start + count):
            strength = STRENGTHS[1 + k % 2]
            if kind in ("path", "lines"):
                effect = RICH[kind == "lines"]
                made.append(Case(kind, "contact" if k % 3 == 0 else "twin", ((effect, strength),)))
                continue
            chosen: tuple[tuple[str, str], ...] = ()
            if kind == "rich":
                chosen = _deal(company, int(rng.integers(1, 3)), STRENGTHS[1:], (0.5, 0.5), rng)
            if kind == "rich_none" or k % 2:
                made.append(Case(kind, "contact", chosen, modelled=RICH))
            else:
                made.append(Case(kind, "twin", (*chosen, *((effect, strength) for effect in RICH))))
    return [replace(made[j], name=f"r{k:04d}") for k, j in enumerate(rng.permutation(n))]


def _counts(n: int, shares: Mapping[str, int], least: float) -> dict[str, int]:
    """Number of worlds of each kind: at least `least`, the others by largest remainders."""
    total = sum(shares.values())
    wanted = {kind: max(least, n * share / total) for kind, share in shares.items()}
    counts = {kind: int(w) for kind, w in wanted.items()}
    while sum(counts.values()) != n:
        gap = {kind: wanted[kind] - counts[kind] for kind in counts}
        if sum(counts.values()) < n:
            counts[max(gap, key=gap.__getitem__)] += 1
        else:
            counts[min((k for k in counts if counts[k] > 1), key=gap.__getitem__)] -= 1
    return counts


def _deck(names: Sequence[str], rng: np.random.Generator) -> Iterator[str]:
    """All names in random order, repeatedly."""
    while True:
        yield from (str(name) for name in rng.permutation(list(names)))


def _uncatalogued_deck(rng: np.random.Generator) -> Iterator[tuple[str, str]]:
    """All effects outside the catalogue in random order, repeatedly; their strengths alternate."""
    turn = 0
    while True:
        for k, name in enumerate(rng.permutation(list(UNCATALOGUED))):
            yield str(name), UNCATALOGUED_STRENGTHS[(k + turn) % 2]
        turn += 1


def _singles(rng: np.random.Generator) -> Iterator[tuple[str, str]]:
    """Every effect at every strength once before any repeats; strengths alternate."""
    while True:
        names = [str(name) for name in rng.permutation(list(CATALOGUE))]
        for turn in range(3):
            for k, name in enumerate(names):
                yield name, STRENGTHS[(k + turn) % 3]


def _deal(
    deck: Iterator[str], count: int, strengths: Sequence[str], chance: Sequence[float], rng: np.random.Generator
) -> tuple[tuple[str, str], ...]:
    """The next `count` different effects that can be told apart, each with a random strength."""
    names: list[str] = []
    for name in deck:
        if name not in names and not any(len(group & {*names, name}) > 1 for group in ONE_OF):
            names.append(name)
        if len(names) == count:
            break
    return tuple((name, str(rng.choice(list(strengths), p=list(chance)))) for name in names)
