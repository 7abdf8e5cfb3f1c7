"""Configuration, jobs and results of the identification study.

identification.toml --read_study--> StudyOptions;  Search, Comparison, Recovery, the jobs;  Study, all that is shown
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from twingap.bearing import Bearing
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.sweep import Result
from twingap.twins.contact_parameters import PRESETS

if TYPE_CHECKING:
    import pandas as pd


CONFIG: Final = Path(__file__).with_name("identification.toml")
WORDS: Final = {
    "zoa": "ZOA, R = 0.1",
    "zoa-ports": "ZOA, R = 0.01",
    "differential-evolution": "differential evolution",
    "random": "random search",
}


@dataclass(frozen=True)
class StudyProfile:
    """How much is spent.

    Parameters
    ----------
    seeds : int
        Runs of each optimiser.
    evaluations : int
        Of the objective, the same for all.
    machines : int
        Simulated machines per fault.
    """

    seeds: int
    evaluations: int
    machines: int


@dataclass(frozen=True)
class StudyOptions:
    """The study; every entry is explained in identification.toml."""

    fault_size_inch: float
    load_hp: int
    faults: tuple[str, ...]
    settings: tuple[Literal["physical", "paper"], ...]
    empirical: tuple[float, ...]
    printed: tuple[float, ...]
    published_drops: tuple[float, ...]
    window_samples: int
    snr_db: float
    machine_stiffness: tuple[float, ...]
    machine_damping: tuple[float, ...]
    machine_duration_s: float
    profiles: dict[str, StudyProfile]


def read_study(path: Path = CONFIG) -> StudyOptions:
    """Read the configuration; errors name file, key, value and what was expected."""
    options = build(StudyOptions, read_toml(path), path)
    for setting in options.settings:
        for fault in options.faults:
            if fault not in PRESETS[setting].defect_depth_um:
                raise TwingapError(f"no contact model for fault {fault!r}", where=f"{path}: faults")
    return options


@dataclass(frozen=True)
class Search:
    """One run of one optimiser on one recording."""

    fault: str
    setting: str
    optimiser: str
    seed: int
    evaluations: int


@dataclass(frozen=True)
class Comparison:
    """One pair of stiffness and damping, simulated and compared."""

    fault: str
    setting: str
    twin: str
    stiffness: float
    damping: float
    window_samples: int


@dataclass(frozen=True)
class Recovery:
    """One simulated machine whose parameters are sought again."""

    fault: str
    seed: int
    snr_db: float
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    duration_s: float


@dataclass(frozen=True)
class Study:
    """What came out.

    Parameters
    ----------
    data : str
        Where the records come from.
    options : StudyOptions
    searches : list[Result[Search]]
    comparisons : list[Result[Comparison]]
    recoveries : list[Result[Recovery]]
    tables : dict[str, pandas.DataFrame]
    bearing : Bearing
    """

    data: str
    options: StudyOptions
    searches: list[Result[Search]]
    comparisons: list[Result[Comparison]]
    recoveries: list[Result[Recovery]]
    tables: dict[str, pd.DataFrame]
    bearing: Bearing
