"""Configuration and results of the availability study.

availability.toml --read_study--> StudyOptions;  Study, all that tables and figures show
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from papers.paper2_digital_twin.availability_jobs import AlarmJob, CheckJob, NetworkJob, ShallowJob
from papers.paper2_digital_twin.availability_records import TITLES, Measured
from papers.paper2_digital_twin.availability_source import Kind, SourceOptions
from papers.paper2_digital_twin.methods.inception import InceptionTraining
from papers.paper2_digital_twin.methods.residual_head import HeadOptions
from papers.paper2_digital_twin.methods.scalograms import ImageOptions
from papers.paper2_digital_twin.methods.severity import MapOptions
from twingap.adapt.selection import CRITERIA
from twingap.config import build, read_toml
from twingap.errors import TwingapError
from twingap.sweep import Result

if TYPE_CHECKING:
    import pandas as pd


CONFIG: Final = Path(__file__).with_name("availability.toml")


@dataclass(frozen=True)
class StudyProfile:
    """How much is run.

    Parameters
    ----------
    seeds : int
        Shuffles of recordings, choices of labels, trainings.
    machines : int
        Virtual machines of each source.
    ablation_seeds : int
        Seeds of the other sources.
    steps : int
        Of a training.
    check_machines : int
        Simulated machines on which false alarms are counted.
    rig_duration_s : float
        Length of the virtual rig's recordings.
    smoke : bool
        The first data set and the first fold alone.
    """

    seeds: int
    machines: int
    ablation_seeds: int
    steps: int
    check_machines: int
    rig_duration_s: float
    smoke: bool


@dataclass(frozen=True)
class StudyOptions:
    """The study; every entry is explained in availability.toml."""

    data: tuple[str, ...]
    counts: tuple[int, ...]
    folds: int
    false_alarm: float
    criterion: str
    ablation: tuple[Kind, ...]
    image: ImageOptions
    map: MapOptions
    source: SourceOptions
    training: InceptionTraining
    head: HeadOptions
    profiles: dict[str, StudyProfile]


@dataclass(frozen=True)
class Study:
    """What came out.

    Parameters
    ----------
    options : StudyOptions
    data : dict[str, Measured]
    networks : list[Result[NetworkJob]]
    shallows : list[Result[ShallowJob]]
    alarms : list[Result[AlarmJob]]
    checks : list[Result[CheckJob]]
    tables : dict[str, pandas.DataFrame]
    """

    options: StudyOptions
    data: dict[str, Measured]
    networks: list[Result[NetworkJob]]
    shallows: list[Result[ShallowJob]]
    alarms: list[Result[AlarmJob]]
    checks: list[Result[CheckJob]]
    tables: dict[str, pd.DataFrame]

    @property
    def title(self) -> str:
        """Where the records come from."""
        return ", ".join(TITLES[name] for name in self.data)


def read_study(path: Path = CONFIG) -> StudyOptions:
    """Read the configuration; errors name file, key, value and what was expected."""
    options = build(StudyOptions, read_toml(path), path)
    if options.criterion not in CRITERIA:
        raise TwingapError(f"criterion = {options.criterion!r}, one of {', '.join(CRITERIA)} expected", where=path)
    if any(name not in TITLES for name in options.data) or not options.data:
        raise TwingapError(f"data = {list(options.data)}, some of {', '.join(TITLES)} expected", where=path)
    if options.folds < 2 or any(count < 1 for count in options.counts):
        raise TwingapError("two folds or more and counts of 1 or more expected", where=path)
    if max(options.source.pooled) != options.source.pooled[-1]:
        raise TwingapError(f"source.pooled = {list(options.source.pooled)}, rising numbers expected", where=path)
    return options
