"""The configuration of this paper: typed, frozen, read from config.toml."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from papers.options import expect, read
from twingap import TwingapError
from twingap.adapt import CRITERIA, VIEWS, Training
from twingap.effects import catalogue

CONFIG: Final = Path(__file__).with_name("config.toml")
RANGES: Final = {
    "source": (
        "width_mm", "depth_share", "clearance_um", "load_n", "snr_db", "resonance_hz", "resonance_damping",
        "resonance_gain",
    ),
    "identification": ("stiffness", "damping", "white_share"),
}  # fmt: skip
"""Entries [low, high] by table."""


@dataclass(frozen=True)
class TargetOptions:
    """The machine to be diagnosed; explained in config.toml."""

    data_set: str
    surrogate: str
    surrogate_seed: int
    loads_hp: tuple[int, ...]
    classes: tuple[str, ...]
    window_samples: int


@dataclass(frozen=True)
class SourceOptions:
    """The simulated records: a population of virtual bearings about the identified twin; explained in config.toml."""

    preset: Literal["physical", "paper"]
    effects: tuple[str, ...]
    windows_per_record: int
    width_mm: tuple[float, ...]
    depth_share: tuple[float, ...]
    clearance_um: tuple[float, ...]
    load_n: tuple[float, ...]
    speed_spread: float
    parameter_spread: float
    snr_db: tuple[float, ...]
    resonance_hz: tuple[float, ...]
    resonance_damping: tuple[float, ...]
    resonance_gain: tuple[float, ...]


@dataclass(frozen=True)
class IdentificationOptions:
    """The twin's free parameters from unlabelled recordings; explained in config.toml."""

    segment_samples: int
    records_per_class: int
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    white_share: tuple[float, ...]


@dataclass(frozen=True)
class JudgingOptions:
    """How methods are chosen and judged; explained in config.toml."""

    criterion: str
    held_out: float
    levels: tuple[float, ...]
    false_alarm: float


@dataclass(frozen=True)
class Profile:
    tasks: tuple[str, ...]
    inputs: tuple[str, ...]
    seeds: int
    steps: int
    bearings_per_class: int
    records_per_bearing: int
    windows_per_recording: int
    evaluations: int
    rig_duration_s: float


@dataclass(frozen=True)
class Options:
    target: TargetOptions
    source: SourceOptions
    identification: IdentificationOptions
    training: Training
    judging: JudgingOptions
    profiles: dict[str, Profile]


def read_options(path: Path = CONFIG) -> Options:
    return read(Options, check, path)


def check(options: Options, path: Path) -> None:
    """Refuse what the types of the entries allow and the study cannot do."""
    for table, ranges in RANGES.items():
        for name in ranges:
            value = getattr(getattr(options, table), name)
            lowest = float("-inf") if name == "snr_db" else 0.0
            if len(value) != 2 or not lowest < value[0] < value[1]:
                raise TwingapError(
                    f"{list(value)} found, [low, high] with 0 < low < high expected", where=f"{path}: {table}.{name}"
                )
    for effect in options.source.effects:
        expect(effect, catalogue(), f"{path}: source.effects")
    expect(options.judging.criterion, CRITERIA, f"{path}: judging.criterion")
    for name, profile in options.profiles.items():
        where = f"{path}: profiles.{name}"
        for view in profile.inputs:
            expect(view, VIEWS, f"{where}.inputs")
        for field, value in dataclasses.asdict(profile).items():
            if isinstance(value, int) and value < (0 if field == "evaluations" else 1):
                raise TwingapError(f"{value} found, at least 1 expected", where=f"{where}.{field}")
