"""Specification of a world: its effects, their strength and the kind of machine.

Case (kind, arm, effects, uncatalogued) --`world.make_world`--> World
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from twingap.errors import TwingapError

ENTRY_EXIT: Final = "entry_exit"
"""Name of the effect with two impacts per pass, which several draws have to treat apart."""
CATALOGUE: Final = (
    "speed_fluctuation", "mean_slip", "slip_jitter", "impact_scatter", "load_zone", "cage_modulation", ENTRY_EXIT,
    "distributed_roughness", "speed_gain", "damage_growth", "second_resonance", "sensor_rolloff", "shaft_harmonics",
    "looseness", "mains_interference", "drive_interference", "gear_mesh", "foreign_bearing", "coloured_noise",
    "impulsive_noise", "waviness", "clipping", "quantisation", "dropout",
)  # fmt: skip
"""Names of the catalogued effects, in the order of the catalogue."""

RICH: Final = ("transfer_path", "line_spectrum")
"""Names of the catalogued effects of rich machines; see `twingap.rigs.worlds.rich`."""

UNCATALOGUED: Final = (
    "sensor_asymmetry", "echo", "drifting_resonance", "gain_jumps", "half_rectified", "swelling_noise", "squeal",
    "two_state_impacts", "whirl", "amplitude_beat", "crossover", "interleave",
)  # fmt: skip
"""Effects outside the catalogue; see `twingap.rigs.worlds.uncatalogued`."""

ON_FAULTS: Final = (
    "mean_slip", "slip_jitter", "impact_scatter", "load_zone", "cage_modulation", ENTRY_EXIT, "speed_gain",
    "damage_growth",
)  # fmt: skip
"""Effects on the impacts of a defect, which healthy records cannot show."""

KINDS: Final = ("none", "single", "pair", "crowd", "outside", "outside_plus")
RICH_KINDS: Final = ("path", "lines", "rich", "rich_none")
"""Kinds of rich machines: the path is missing, the lines are missing, some effects are missing, nothing is missing."""
ARMS: Final = ("twin", "contact")
STRENGTHS: Final = ("weak", "medium", "strong")
UNCATALOGUED_STRENGTHS: Final = ("moderate", "strong")


@dataclass(frozen=True)
class Case:
    """Specification of one world of a study.

    Parameters
    ----------
    kind : str
        One of `KINDS` or `RICH_KINDS`: a label for tables. What the world has is given by the lists below.
    arm : {"twin", "contact"}
        "twin": the phenomenological baseline can represent the base machine. "contact": the base machine has contact
        dynamics, and the world includes simulated records of it.
    effects : tuple of (name, strength)
        Catalogued effects, strength "weak", "medium" or "strong".
    uncatalogued : tuple of (name, strength)
        Effects outside the catalogue, strength "moderate" or "strong".
    name : str
        Part of the seed, so that cases of one study differ.
    n_records : int
        Number of records, at least 4.
    duration_s : float
        Length of each record, s, at least 0.1.
    fs_hz : float, optional
        Sampling rate, Hz; None = drawn at random.
    bearing : str, optional
        One of `twingap.rigs.worlds.layout.TEST_BEARINGS`; None = drawn at random.
    faults : tuple of str, optional
        Faults that occur, with or without "healthy"; None = drawn at random.
    modelled : tuple of str
        Effects that the machine has and that the twin file lists as modelled; not part of the gap. Those of `RICH`
        are in the simulated records of the contact arm, and not possible in the other.

    Raises
    ------
    TwingapError
        For an unknown name or strength, an effect given twice, an effect that the twin cannot model, or too few or too
        short records.
    """

    kind: str
    arm: str = "twin"
    effects: tuple[tuple[str, str], ...] = ()
    uncatalogued: tuple[tuple[str, str], ...] = ()
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
            ("kind", (self.kind,), (*KINDS, *RICH_KINDS)),
            ("arm", (self.arm,), ARMS),
            ("effect", tuple(n for n, _ in self.effects) + self.modelled, (*CATALOGUE, *RICH)),
            ("strength", tuple(s for _, s in self.effects), STRENGTHS),
            ("effect outside the catalogue", tuple(n for n, _ in self.uncatalogued), UNCATALOGUED),
            (
                "strength of an effect outside the catalogue",
                tuple(s for _, s in self.uncatalogued),
                UNCATALOGUED_STRENGTHS,
            ),
            ("fault", self.faults or (), ("healthy", "inner", "outer", "ball")),
        ]
        for what, found, known in checks:
            for name in found:
                if name not in known:
                    raise TwingapError(f"unknown {what} {name!r}", where=where, mend=f"use one of {', '.join(known)}")
        names = [n for n, _ in self.effects + self.uncatalogued] + list(self.modelled)
        if len(set(names)) < len(names):
            raise TwingapError("names an effect twice", where=where)
        if self.arm == "twin" and set(self.modelled) & set(RICH):
            raise TwingapError(
                "the built-in twin has no values for a path or lines", where=where, mend="use arm contact"
            )
        if self.n_records < 4 or not self.duration_s >= 0.1:
            what = f"{self.n_records} records of {self.duration_s:g} s, at least 4 of 0.1 s expected"
            raise TwingapError(what, where=where)

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the catalogued effects."""
        return tuple(name for name, _ in self.effects)

    @property
    def uncatalogued_names(self) -> tuple[str, ...]:
        """Names of the effects outside the catalogue."""
        return tuple(name for name, _ in self.uncatalogued)
