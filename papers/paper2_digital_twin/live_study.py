"""Configuration, machines and results of the study of live updating.

live.toml --read_live--> LiveStudyOptions;  Scenario, the jobs;  LiveStudy, all that tables and figures show
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import BEARINGS
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.rigs.drifting import COOLED, WEARS
from twingap.sweep import Result

if TYPE_CHECKING:
    import pandas as pd


Array = NDArray[np.float64]
CONFIG: Final = Path(__file__).with_name("live.toml")
DATA: Final = "virtual machine"


@dataclass(frozen=True)
class Line:
    """How messages arrive; see `twingap.rigs.drifting.arrivals`."""

    delay_s: float
    late: float
    late_s: float
    lost: float
    repeated: float


@dataclass(frozen=True)
class LiveProfile:
    """How much is run.

    Parameters
    ----------
    seeds, steady : int
        Machines that drift, and that do not.
    steady_hours : float
        How long the latter run.
    """

    seeds: int
    steady: int
    steady_hours: float


@dataclass(frozen=True)
class LiveStudyOptions:
    """The study; every entry is explained in live.toml."""

    bearing: str
    preset: Literal["physical", "paper"]
    hours: float
    snapshot_period_s: float
    state_period_s: float
    snapshot_s: float
    fs_hz: float
    lateness_s: float
    false_alarms: float
    halved: float
    most_ms: float
    poor_line: Line
    profiles: dict[str, LiveProfile]


@dataclass(frozen=True)
class Scenario:
    """One machine, and everything that is decided about it."""

    seed: int
    drift: float
    hours: float
    bearing: str
    preset: str
    snapshot_period_s: float
    state_period_s: float
    snapshot_s: float
    fs_hz: float
    lateness_s: float
    false_alarms: float
    line: Line
    arms: tuple[str, ...]


@dataclass(frozen=True)
class LiveStudy:
    """What came out.

    Parameters
    ----------
    options : LiveStudyOptions
    drifting, steady : list[Result[Scenario]]
    tables : dict[str, pandas.DataFrame]
    """

    options: LiveStudyOptions
    drifting: list[Result[Scenario]]
    steady: list[Result[Scenario]]
    tables: dict[str, pd.DataFrame]


def read_live(path: Path = CONFIG) -> LiveStudyOptions:
    """Read the configuration; errors name file, key, value and what was expected."""
    options = build(LiveStudyOptions, read_toml(path), path)
    if options.bearing not in BEARINGS:
        known = ", ".join(BEARINGS)
        raise TwingapError(f"unknown bearing {options.bearing!r}", where=f"{path}: bearing", mend=f"use one of {known}")
    return options


def phase_of(time_s: Array, hours: float) -> list[str]:
    """What the machine goes through at these times, in words."""
    part = np.asarray(time_s) / (3600 * hours)
    words = np.full(part.size, "as commissioned", dtype=object)
    words[part >= WEARS[0]] = "wearing"
    words[part >= WEARS[1]] = "worn"
    for on, off in COOLED:
        words[(part >= on) & (part < off)] = "cooled"
    return [str(w) for w in words]
