"""Worlds for the blind study: machines with known effects, made without knowledge of twins and diagnosis.

cases(n, seed) --> Case --make_world(case, seed)--> World: records, sim, twin for the diagnosis; truth to be sealed

Everything here is written from physics and from the catalogue's one-line descriptions: own dynamics, own effects, own
ranges. Nothing of the simulators, the effects or the diagnosis is imported, and a test keeps it so.
"""

from twingap.rigs.worlds.case import ARMS, CATALOGUE, KINDS, ON_FAULTS, OUTSIDER_STRENGTHS, OUTSIDERS, STRENGTHS, Case
from twingap.rigs.worlds.layout import TEST_BEARINGS
from twingap.rigs.worlds.plan import cases
from twingap.rigs.worlds.truth import Truth, open_seal, seal
from twingap.rigs.worlds.world import World, machine, make_world, replay

__all__ = [
    "ARMS", "CATALOGUE", "KINDS", "ON_FAULTS", "OUTSIDERS", "OUTSIDER_STRENGTHS", "STRENGTHS", "TEST_BEARINGS", "Case",
    "Truth", "World", "cases", "machine", "make_world", "open_seal", "replay", "seal",
]  # fmt: skip
