"""Worlds of the blind study: simulated machines with known effects, independent of twins and diagnosis.

cases(n, seed) --> Case --make_world(case, seed)--> World: records, sim, twin for the diagnosis; truth to be sealed

Dynamics, effects and ranges are written from physics and from the catalogue's one-line descriptions. Nothing of the
simulators, the effects or the diagnosis is imported; a test verifies this.
"""

from twingap.rigs.worlds.case import (
    ARMS,
    CATALOGUE,
    KINDS,
    ON_FAULTS,
    RICH,
    RICH_KINDS,
    STRENGTHS,
    UNCATALOGUED,
    UNCATALOGUED_STRENGTHS,
    Case,
)
from twingap.rigs.worlds.layout import TEST_BEARINGS
from twingap.rigs.worlds.plan import cases
from twingap.rigs.worlds.truth import Truth, open_seal, seal
from twingap.rigs.worlds.world import World, machine, make_world, replay

__all__ = [
    "ARMS",
    "CATALOGUE",
    "KINDS",
    "ON_FAULTS",
    "RICH",
    "RICH_KINDS",
    "STRENGTHS",
    "TEST_BEARINGS",
    "UNCATALOGUED",
    "UNCATALOGUED_STRENGTHS",
    "Case",
    "Truth",
    "World",
    "cases",
    "machine",
    "make_world",
    "open_seal",
    "replay",
    "seal",
]  # fmt: skip
