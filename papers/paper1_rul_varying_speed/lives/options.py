"""The configuration of this paper: typed, frozen, read from config.toml."""

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

    def __post_init__(self) -> None:
        expect(self.criterion, CRITERIA, "criterion")
        if not all(0 < level < 1 for level in self.levels):
            raise TwingapError(f"{list(self.levels)} found, between 0 and 1 expected", where="levels")


@dataclass(frozen=True)
class Size:
    """What every study of trainings has in a profile."""

    bearings: tuple[str, ...]
    seeds: int
    steps: int
    most_records: int


@dataclass(frozen=True)
class Profile(Size):
    variants: tuple[str, ...]
    models: tuple[str, ...]
    copies: int

    def __post_init__(self) -> None:
        for model in self.models:
            expect(model, MODELS, "models")
        for field, value in dataclasses.asdict(self).items():
            if (value < 1) if isinstance(value, int) else not value:
                raise TwingapError(f"{value!r} found, 1 or more expected", where=field)


@dataclass(frozen=True)
class Options:
    target: TargetOptions
    adaptation: Adaptation
    variants: dict[str, Variant]
    training: LifeTraining
    judging: JudgingOptions
    profiles: dict[str, Profile]

    def __post_init__(self) -> None:
        for name, profile in self.profiles.items():
            for variant in profile.variants:
                expect(variant, self.variants, f"profiles.{name}.variants")


def read_options(path: Path = CONFIG) -> Options:
    return read(Options, path)
