"""Configuration and results of the comparison of methods.

comparison.toml --read_comparison--> ComparisonOptions;  TaskOutcome, a task;  Comparison, all that is shown
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from papers.paper3_zoa_dann.task_files import Material, TaskFile
from papers.paper3_zoa_dann.trial import ALL, Trial
from twingap.adapt import ModeInputs, Training
from twingap.config import build, read_toml
from twingap.effects import catalogue
from twingap.errors import TwingapError
from twingap.sweep import Result

if TYPE_CHECKING:
    import pandas as pd

CONFIG: Final = Path(__file__).with_name("comparison.toml")
Key = tuple[str, float | None]
"""State of the unlabelled data, and the size left out."""


@dataclass(frozen=True)
class Published:
    """The paper's figures of one data set, per cent and points.

    Parameters
    ----------
    mean : float
        Accuracy of the proposed method.
    lead, lead_high_noise : float
        Over the best of the rivals, without noise and at -5 dB.
    """

    mean: float
    lead: float
    lead_high_noise: float


@dataclass(frozen=True)
class Size:
    """How much is run.

    Parameters
    ----------
    tasks : tuple[str, ...]
        Names of files in tasks/.
    available : tuple[str, ...]
        States of the unlabelled data.
    seeds : int
        Trainings per task, state and method, without noise.
    strict_seeds : int
        Of those that leave bearings out where the task itself does not; a seed leaves out one size, in turn.
    noise_seeds : tuple[int, ...]
        At each noise level, balanced data alone: no more than without noise.
    snr_db : tuple[float, ...]
        Noise levels.
    steps : int
        Gradient steps of a training.
    bearings_per_class, records_per_bearing : int
        Simulated.
    evaluations : int
        Of the identification's objective.
    rig_duration_s : float
        Length of the virtual rig's recordings.
    """

    tasks: tuple[str, ...]
    available: tuple[str, ...]
    seeds: int
    strict_seeds: int
    noise_seeds: tuple[int, ...]
    snr_db: tuple[float, ...]
    steps: int
    bearings_per_class: int
    records_per_bearing: int
    evaluations: int
    rig_duration_s: float


@dataclass(frozen=True)
class ComparisonOptions:
    """The comparison; every entry is explained in comparison.toml."""

    references: tuple[str, ...]
    rivals: tuple[str, ...]
    low_noise_db: float
    high_noise_db: float
    embedded: int
    closed: dict[str, tuple[str, ...]]
    published: dict[str, Published]
    inputs: ModeInputs
    training: Training
    profiles: dict[str, Size]


def read_comparison(path: Path = CONFIG) -> ComparisonOptions:
    """Read the configuration; errors name file, key, value and what was expected."""
    options = build(ComparisonOptions, read_toml(path), path)
    for name, methods in (("references", options.references), ("rivals", options.rivals)):
        for method in methods:
            if method not in ALL:
                known = ", ".join(ALL)
                raise TwingapError(f"unknown method {method!r}", where=f"{path}: {name}", mend=f"use {known}")
    for family, names in options.closed.items():
        for effect in names:
            if effect not in catalogue():
                raise TwingapError(f"unknown effect {effect!r}", where=f"{path}: closed.{family}")
    for name, size in options.profiles.items():
        where = f"{path}: profiles.{name}"
        if min(size.seeds, size.steps, size.bearings_per_class, size.records_per_bearing) < 1:
            raise TwingapError("seeds, steps, bearings and records are at least 1", where=where)
        if len(size.noise_seeds) != len(size.snr_db) or not all(0 <= count <= size.seeds for count in size.noise_seeds):
            found = f"noise_seeds = {list(size.noise_seeds)}"
            raise TwingapError(f"{found}, one of 0 to seeds = {size.seeds} for each of snr_db expected", where=where)
    return options


@dataclass(frozen=True)
class TaskOutcome:
    """All that came out of one task.

    Parameters
    ----------
    task : TaskFile
    data : str
        What stands beside every number.
    materials : Mapping[Key, Material]
    identified : Mapping[Key, Mapping[str, float]]
    trials : Sequence[Result[Trial]]
    """

    task: TaskFile
    data: str
    materials: Mapping[Key, Material]
    identified: Mapping[Key, Mapping[str, float]]
    trials: Sequence[Result[Trial]]


@dataclass(frozen=True)
class Comparison:
    """What came out.

    Parameters
    ----------
    options : ComparisonOptions
    outcomes : list[TaskOutcome]
    missing : tuple[str, ...]
        Tasks whose data are not at hand.
    tables : dict[str, pandas.DataFrame]
    computed : int
        Trials that ran now; the others came from the store.
    """

    options: ComparisonOptions
    outcomes: list[TaskOutcome]
    missing: tuple[str, ...]
    tables: dict[str, pd.DataFrame]
    computed: int

    @property
    def core_hours(self) -> float:
        """What all trials took, those from the store in the run that computed them."""
        return sum(t.seconds for outcome in self.outcomes for t in outcome.trials) / 3600
