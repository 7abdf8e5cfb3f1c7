"""Configuration, cases and results of the dynamics study.

dynamics.toml --read_dynamics--> DynamicsOptions;  Case, the jobs;  Dynamics, all that tables and figures show
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from twingap.bearing import BEARINGS, Bearing
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.sweep import Result
from twingap.twins.contact_parameters import PRESETS

if TYPE_CHECKING:
    import pandas as pd


CONFIG: Final = Path(__file__).with_name("dynamics.toml")


@dataclass(frozen=True)
class DynamicsProfile:
    """Operating points.

    Parameters
    ----------
    speeds_rpm, loads_n, clearances_um : tuple[float, ...]
        Every combination of them; the "paper" preset keeps its own load and clearance.
    """

    speeds_rpm: tuple[float, ...]
    loads_n: tuple[float, ...]
    clearances_um: tuple[float, ...]


@dataclass(frozen=True)
class DynamicsOptions:
    """The study; every entry is explained in dynamics.toml."""

    settings: tuple[Literal["physical", "paper"], ...]
    bearing: str
    faults: tuple[str, ...]
    fs_hz: float
    settle_s: float
    fault_s: float
    reference_s: float
    settled_part: float
    within: float
    profiles: dict[str, DynamicsProfile]


@dataclass(frozen=True)
class Case:
    """One bearing at one operating point."""

    setting: str
    bearing: str
    fault: str
    speed_rpm: float
    load_n: float
    clearance_um: float
    fs_hz: float
    duration_s: float
    reference_s: float
    settled_part: float
    within: float


@dataclass(frozen=True)
class Dynamics:
    """What came out.

    Parameters
    ----------
    options : DynamicsOptions
    healthy, faulty : list[Result[Case]]
        The first of each setting is the one that figures show.
    tables : dict[str, pandas.DataFrame]
    bearing : Bearing
    """

    options: DynamicsOptions
    healthy: list[Result[Case]]
    faulty: list[Result[Case]]
    tables: dict[str, pd.DataFrame]
    bearing: Bearing


def read_dynamics(path: Path = CONFIG) -> DynamicsOptions:
    """Read the configuration; errors name file, key, value and what was expected."""
    options = build(DynamicsOptions, read_toml(path), path)
    if options.bearing not in BEARINGS:
        known = ", ".join(BEARINGS)
        raise TwingapError(f"unknown bearing {options.bearing!r}", where=f"{path}: bearing", mend=f"use one of {known}")
    for setting, fault in itertools.product(options.settings, options.faults):
        if fault not in PRESETS[setting].defect_depth_um:
            raise TwingapError(f"no contact model for fault {fault!r}", where=f"{path}: faults")
    return options
