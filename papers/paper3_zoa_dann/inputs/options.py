"""The configuration of this paper: typed, frozen, read from config.toml."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from papers.options import expect, read
from twingap import TwingapError
from twingap.adapt import CRITERIA, VIEWS, Training
from twingap.effects import catalogue

CONFIG: Final = Path(__file__).with_name("config.toml")
LEAST: Final = {
    "seeds": 1, "steps": 1, "bearings_per_class": 1, "records_per_bearing": 1, "windows_per_recording": 1,
    "evaluations": 0,
}  # fmt: skip


def _check_ranges(options: Any) -> None:
    """Refuse entries [low, high] that are no range; only levels in dB may be negative."""
    for name, value in vars(options).items():
        lowest = float("-inf") if name == "snr_db" else 0.0
        if isinstance(value, tuple) and name != "effects" and not (len(value) == 2 and lowest < value[0] < value[1]):
            raise TwingapError(f"{list(value)} found, [low, high] with 0 < low < high expected", where=name)


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

    def __post_init__(self) -> None:
        _check_ranges(self)
        for effect in self.effects:
            expect(effect, catalogue(), "effects")


@dataclass(frozen=True)
class IdentificationOptions:
    """The twin's free parameters from unlabelled recordings; explained in config.toml."""

    segment_samples: int
    records_per_class: int
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    white_share: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_ranges(self)


@dataclass(frozen=True)
class JudgingOptions:
    """How methods are chosen and judged; explained in config.toml."""

    criterion: str
    held_out: float
    levels: tuple[float, ...]
    false_alarm: float

    def __post_init__(self) -> None:
        expect(self.criterion, CRITERIA, "criterion")


@dataclass(frozen=True)
class Size:
    """What every study of trainings has in a profile."""

    tasks: tuple[str, ...]
    seeds: int
    steps: int
    bearings_per_class: int
    records_per_bearing: int
    evaluations: int
    rig_duration_s: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name in LEAST and value < LEAST[name]:
                raise TwingapError(f"{value} found, at least {LEAST[name]} expected", where=name)


@dataclass(frozen=True)
class Profile(Size):
    inputs: tuple[str, ...]
    windows_per_recording: int

    def __post_init__(self) -> None:
        super().__post_init__()
        for view in self.inputs:
            expect(view, VIEWS, "inputs")


@dataclass(frozen=True)
class Options:
    target: TargetOptions
    source: SourceOptions
    identification: IdentificationOptions
    training: Training
    judging: JudgingOptions
    profiles: dict[str, Profile]


def read_options(path: Path = CONFIG) -> Options:
    return read(Options, path)
