"""Configuration and results of the degradation study.

degradation.toml --read_study--> DegradationOptions;  Judged, a run;  Study, all that tables and figures show
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from papers.paper2_digital_twin.degradation_jobs import Analysis, Coverage
from papers.paper2_digital_twin.degradation_runs import StudyRun
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.prognosis import degradation_models
from twingap.prognosis.health_indicator import Indicators
from twingap.prognosis.indicator_criteria import IndicatorCriteria
from twingap.sweep import Result

if TYPE_CHECKING:
    import pandas as pd


Array = NDArray[np.float64]
CONFIG: Final = Path(__file__).with_name("degradation.toml")
NINE: Final = "fusion 9"
OFFLINE: Final = "fusion 9, whole run"
"""The paper's reading: normalised and fused with the whole run known, so each value depends on later records."""
KEPT: Final = "fusion 9, whole run, silent records kept"
CHOSEN: Final = "chosen on other runs"
HINDSIGHT: Final = "own end, known in hindsight"
OTHERS: Final = "median end of other runs"
INDICATORS: Final = ("rms", CHOSEN, NINE, OFFLINE, KEPT)


@dataclass(frozen=True)
class DegradationProfile:
    """How much is run.

    Parameters
    ----------
    ims, femto : int
        Runs of each, from the paper's on.
    curves : int
        Refits per interval.
    coverage_runs : int
        Simulated runs per kind.
    """

    ims: int
    femto: int
    curves: int
    coverage_runs: int


@dataclass(frozen=True)
class DegradationOptions:
    """The study; every entry is explained in degradation.toml."""

    runs_ims: tuple[str, ...]
    runs_femto: tuple[str, ...]
    paper_run: str
    raw_run: str
    healthy_rows_ims: int
    healthy_rows_femto: int
    trend_rows_ims: int
    trend_rows_femto: int
    silent_share: float
    window_samples: int
    indicators: tuple[str, ...]
    primary: tuple[str, ...]
    error: str
    interval_level: float
    simulated_rows: int
    simulated_noise: float
    profiles: dict[str, DegradationProfile]


@dataclass(frozen=True)
class Judged:
    """A run with its candidates.

    Parameters
    ----------
    run : StudyRun
    online : Indicators
    criteria : dict[str, IndicatorCriteria]
        Of the online candidates.
    choice : str or None
        Candidate of highest suitability on other runs; None where there are no others.
    series : dict[str, Array [rows]]
        The indicators that curves are fitted to, by name.
    times : dict[str, Array [rows]]
        Their running time, s.
    """

    run: StudyRun
    online: Indicators
    criteria: dict[str, IndicatorCriteria]
    choice: str | None
    series: dict[str, Array]
    times: dict[str, Array]


@dataclass(frozen=True)
class Study:
    """What came out.

    Parameters
    ----------
    data : str
        Where the runs come from.
    options : DegradationOptions
    runs : list[Judged]
    analyses : list[Result[Analysis]]
    coverage : list[Result[Coverage]]
    tables : dict[str, pandas.DataFrame]
    """

    data: str
    options: DegradationOptions
    runs: list[Judged]
    analyses: list[Result[Analysis]]
    coverage: list[Result[Coverage]]
    tables: dict[str, pd.DataFrame]

    @property
    def shown(self) -> Judged:
        """The run of the paper's figures, or the first where it is not at hand."""
        return next((j for j in self.runs if j.run.name == self.options.paper_run), self.runs[0])

    @property
    def raw(self) -> Judged | None:
        """The run whose records are shown, where there are raw ones."""
        there = [j for j in self.runs if j.run.extremes is not None]
        return next((j for j in there if j.run.name == self.options.raw_run), there[0] if there else None)


def read_study(path: Path = CONFIG) -> DegradationOptions:
    """Read the configuration; errors name file, key, value and what was expected."""
    options = build(DegradationOptions, read_toml(path), path)
    if len(options.primary) != 2 or not set(options.primary) <= set(degradation_models.MODELS):
        known = ", ".join(degradation_models.MODELS)
        raise TwingapError("two models expected", where=f"{path}: primary", mend=f"use two of {known}")
    if "rms" not in options.indicators or not set(options.indicators) <= set(INDICATORS):
        raise TwingapError(
            f"{list(options.indicators)} found", where=f"{path}: indicators",
            mend=f"use rms and any of {', '.join(INDICATORS[1:])}",
        )  # fmt: skip
    if options.error not in ("rest", "next"):
        raise TwingapError(f"{options.error!r} found", where=f"{path}: error", mend="use rest or next")
    return options
