"""What is asked of a world: which effects, how strong, on which kind of machine.

Case (kind, arm, effects, outsiders) --`world.make_world`--> World
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from twingap.errors import TwingapError

ENTRY_EXIT: Final = "entry_exit"
"""The effect that the generator makes with two impacts a pass."""
CATALOGUE: Final = (
    "speed_fluctuation", "mean_slip", "slip_jitter", "impact_scatter", "load_zone", "cage_modulation", ENTRY_EXIT,
    "distributed_roughness", "speed_gain", "damage_growth", "second_resonance", "sensor_rolloff", "shaft_harmonics",
    "looseness", "mains_interference", "drive_interference", "gear_mesh", "foreign_bearing", "coloured_noise",
    "impulsive_noise", "waviness", "clipping", "quantisation", "dropout",
)  # fmt: skip
"""Names of the catalogue of effects, in its order."""

OUTSIDERS: Final = (
    "sensor_asymmetry", "echo", "drifting_resonance", "gain_jumps", "half_rectified", "swelling_noise", "squeal",
    "two_state_impacts", "whirl", "amplitude_beat", "crossover", "interleave",
)  # fmt: skip
"""Effects that the catalogue does not know. See `twingap.rigs.worlds.outsiders`."""

ON_FAULTS: Final = (
    "mean_slip", "slip_jitter", "impact_scatter", "load_zone", "cage_modulation", ENTRY_EXIT, "speed_gain",
    "damage_growth",
)  # fmt: skip
"""Effects that show only where a defect strikes."""

KINDS: Final = ("none", "single", "pair", "crowd", "outside", "outside_plus")
ARMS: Final = ("twin", "contact")
STRENGTHS: Final = ("weak", "medium", "strong")
OUTSIDER_STRENGTHS: Final = ("moderate", "strong")


@dataclass(frozen=True)
class Case:
    """One world of a study, before it is made.

    Parameters
    ----------
    kind : str
        One of `KINDS`; a label, the lists below decide.
    arm : {"twin", "contact"}
        "twin": the base machine is in reach of the phenomenological baseline. "contact": it has contact dynamics,
        and the world brings simulated records of it.
    effects : tuple of (name, strength)
        Of the catalogue, strength "weak", "medium" or "strong".
    outsiders : tuple of (name, strength)
        Not of the catalogue, strength "moderate" or "strong".
    name : str
        Enters the seed, so that cases of one study differ from each other under one seed.
    n_records : int
        At least 4.
    duration_s : float
        Of each record.
    fs_hz : float, optional
        None = drawn.
    bearing : str, optional
        One of `twingap.rigs.worlds.layout.TEST_BEARINGS`; None = drawn.
    faults : tuple of str, optional
        Faults that occur, "healthy" among them or not; None = drawn.
    modelled : tuple of str
        Effects that the machine has and that the twin is said to model already; not part of the gap.

    Raises
    ------
    TwingapError
        For names, strengths or sizes that no world has.
    """

    kind: str
    arm: str = "twin"
    effects: tuple[tuple[str, str], ...] = ()
    outsiders: tuple[tuple[str, str], ...] = ()
    name: str = "world"
    n_records: int = 24
    duration_s: float = 1.0
    fs_hz: float | None = None
    bearing: str | None = None
    faults: tuple[str, ...] | None = None
    modelled: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        where = f"case {self.name!r}"
        checks: list[tuple[str, tuple[str, ...], tuple[str, ...]]] = [
            ("kind", (self.kind,), KINDS),
            ("arm", (self.arm,), ARMS),
            ("effect", tuple(n for n, _ in self.effects) + self.modelled, CATALOGUE),
            ("strength", tuple(s for _, s in self.effects), STRENGTHS),
            ("outsider", tuple(n for n, _ in self.outsiders), OUTSIDERS),
            ("outsider's strength", tuple(s for _, s in self.outsiders), OUTSIDER_STRENGTHS),
            ("fault", self.faults or (), ("healthy", "inner", "outer", "ball")),
        ]
        for what, found, known in checks:
            for name in found:
                if name not in known:
                    raise TwingapError(f"unknown {what} {name!r}", where=where, mend=f"use one of {', '.join(known)}")
        names = [n for n, _ in self.effects + self.outsiders] + list(self.modelled)
        if len(set(names)) < len(names):
            raise TwingapError("names an effect twice", where=where)
        if self.n_records < 4 or not self.duration_s >= 0.1:
            what = f"{self.n_records} records of {self.duration_s:g} s, at least 4 of 0.1 s expected"
            raise TwingapError(what, where=where)

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the catalogued effects."""
        return tuple(name for name, _ in self.effects)

    @property
    def outsider_names(self) -> tuple[str, ...]:
        """Names of the others."""
        return tuple(name for name, _ in self.outsiders)
