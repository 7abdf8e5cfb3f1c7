"""The configuration of this paper: typed, frozen, read from config.toml."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from papers.options import expect, read
from papers.paper1_rul_varying_speed.methods.adaptive_twin import Adaptation
from papers.paper1_rul_varying_speed.methods.architecture import MODELS
from papers.paper1_rul_varying_speed.methods.simulated_lives import SignalModel
from papers.paper1_rul_varying_speed.methods.training import CRITERIA, LifeTraining
from twingap import TwingapError

CONFIG: Final = Path(__file__).with_name("config.toml")


@dataclass(frozen=True)
class TargetOptions:
    """The machine whose bearings wear out; explained in config.toml."""

    data_set: str
    surrogate_seed: int
    interval_s: float
    profile: str
    fault: str
    window_samples: int


@dataclass(frozen=True)
class Variant:
    """A twin, and what training knows of it; explained in config.toml."""

    signal: SignalModel
    alike: bool


@dataclass(frozen=True)
class JudgingOptions:
    """How models are chosen and judged; explained in config.toml."""

    criterion: str
    printed: bool
    levels: tuple[float, ...]
    alpha: float


@dataclass(frozen=True)
class Profile:
    bearings: tuple[str, ...]
    variants: tuple[str, ...]
    models: tuple[str, ...]
    seeds: int
    steps: int
    copies: int
    most_records: int


@dataclass(frozen=True)
class Options:
    target: TargetOptions
    adaptation: Adaptation
    variants: dict[str, Variant]
    training: LifeTraining
    judging: JudgingOptions
    profiles: dict[str, Profile]


def read_options(path: Path = CONFIG) -> Options:
    return read(Options, check, path)


def check(options: Options, path: Path) -> None:
    """Refuse what the types of the entries allow and the study cannot do."""
    expect(options.judging.criterion, CRITERIA, f"{path}: judging.criterion")
    for level in options.judging.levels:
        if not 0 < level < 1:
            raise TwingapError(f"{level} found, between 0 and 1 expected", where=f"{path}: judging.levels")
    for name, profile in options.profiles.items():
        where = f"{path}: profiles.{name}"
        for model in profile.models:
            expect(model, MODELS, f"{where}.models")
        for variant in profile.variants:
            expect(variant, options.variants, f"{where}.variants")
        for field, value in dataclasses.asdict(profile).items():
            if (value < 1) if isinstance(value, int) else not value:
                raise TwingapError(f"{value!r} found, 1 or more expected", where=f"{where}.{field}")
