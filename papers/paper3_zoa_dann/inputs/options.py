"""The configuration of this paper: typed, frozen, read from config.toml."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from twingap.adapt import CRITERIA, VIEWS, Training
from twingap.config import build, read_toml
from twingap.effects import catalogue
from twingap.errors import TwingapError

CONFIG: Final = Path(__file__).with_name("config.toml")


@dataclass(frozen=True)
class TargetOptions:
    """The machine to be diagnosed.

    Parameters
    ----------
    data_set : str
        Public data set, by its name in `twingap.data`.
    surrogate : str
        Virtual rig that takes its place where the data are not at hand.
    surrogate_seed : int
        Which machine of that kind.
    loads_hp : tuple[int, ...]
        Loads whose recordings are used.
    classes : tuple[str, ...]
        Faults, in the order of their labels.
    window_samples : int
        Length of a window.
    """

    data_set: str
    surrogate: str
    surrogate_seed: int
    loads_hp: tuple[int, ...]
    classes: tuple[str, ...]
    window_samples: int


@dataclass(frozen=True)
class SourceOptions:
    """The simulated records: a population of virtual bearings about the identified twin.

    Parameters
    ----------
    preset : {"physical", "paper"}
        Of the contact twin, for all that is neither identified nor drawn.
    effects : tuple[str, ...]
        Effects beyond the contact model, with their default parameters.
    windows_per_record : int
        Windows cut from a record, whose length follows.
    width_mm : (float, float)
        Range of defect widths, log-uniform.
    depth_share : (float, float)
        Range of depths, as a share of the depth to which a ball sinks into a pit of that width.
    clearance_um, load_n : (float, float)
        Ranges, uniform.
    speed_spread : float
        Half width of the spread of speeds around those of the adaptation recordings, a fraction.
    parameter_spread : float
        Standard deviation of ln stiffness, ln damping and ln mass between virtual bearings.
    snr_db : (float, float)
        Range of the fault's vibration over the noise, uniform in dB.
    resonance_hz, resonance_damping, resonance_gain : (float, float)
        Ranges of a second structural mode that every virtual bearing has, log-uniform.
    """

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
    """The twin's free parameters from unlabelled recordings.

    Parameters
    ----------
    segment_samples : int
        Segment of the averaged spectra that are compared.
    records_per_class : int
        Simulated records per class and evaluation.
    stiffness, damping, white_share : (float, float)
        Search ranges, log scale; N/m^1.5, N s/m, white part of the noise's power.
    """

    segment_samples: int
    records_per_class: int
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    white_share: tuple[float, ...]


@dataclass(frozen=True)
class JudgingOptions:
    """How methods are chosen and judged.

    Parameters
    ----------
    criterion : str
        Label-free criterion of selection, a key of `twingap.adapt.CRITERIA`.
    held_out : float
        Share of the virtual bearings of each class kept from training, for source validation.
    levels : tuple[float, ...]
        Coverage of the intervals over seeds.
    false_alarm : float
        Share of white-noise windows that the analyst's rule calls faulty.
    embedded : int
        Windows per domain in a t-SNE figure.
    """

    criterion: str
    held_out: float
    levels: tuple[float, ...]
    false_alarm: float
    embedded: int


@dataclass(frozen=True)
class Profile:
    """How much is run.

    Parameters
    ----------
    tasks : tuple[str, ...]
        See `papers.paper3_zoa_dann.tasks.make_tasks`.
    inputs : tuple[str, ...]
        What the network is shown: keys of `twingap.adapt.VIEWS`.
    seeds : int
        Trainings per task, input and method.
    steps : int
        Gradient steps of each.
    bearings_per_class : int
        Virtual bearings, each with defect, clearance, load, stiffness, damping, mass, noise, second mode of its own.
    records_per_bearing : int
        Simulated records of each, at other speeds.
    windows_per_recording : int
        Windows cut from each recording of the target.
    evaluations : int
        Of the identification's objective; 0 keeps the preset.
    rig_duration_s : float
        Length of the virtual rig's recordings.
    """

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
    """The whole configuration.

    Parameters
    ----------
    target : TargetOptions
    source : SourceOptions
    identification : IdentificationOptions
    training : Training
        See `twingap.adapt.Training`; its `steps` are the profile's.
    judging : JudgingOptions
    profiles : dict[str, Profile]
        By name.
    """

    target: TargetOptions
    source: SourceOptions
    identification: IdentificationOptions
    training: Training
    judging: JudgingOptions
    profiles: dict[str, Profile]


def read_options(path: Path = CONFIG) -> Options:
    """Read and check a configuration.

    Raises
    ------
    TwingapError
        Naming file, key, value and what was expected.
    """
    options = build(Options, read_toml(path), path)
    check(options, path)
    return options


def check(options: Options, path: Path) -> None:
    """Refuse what the types of the entries allow and the study cannot do."""
    for table, ranges in (
        (
            "source",
            (
                "width_mm",
                "depth_share",
                "clearance_um",
                "load_n",
                "snr_db",
                "resonance_hz",
                "resonance_damping",
                "resonance_gain",
            ),
        ),
        ("identification", ("stiffness", "damping", "white_share")),
    ):
        for name in ranges:
            value = getattr(getattr(options, table), name)
            lowest = float("-inf") if name == "snr_db" else 0.0
            if len(value) != 2 or not lowest < value[0] < value[1]:
                raise TwingapError(
                    f"{list(value)} found, [low, high] with 0 < low < high expected", where=f"{path}: {table}.{name}"
                )
    for effect in options.source.effects:
        _known(effect, catalogue(), f"{path}: source.effects")
    _known(options.judging.criterion, CRITERIA, f"{path}: judging.criterion")
    for name, profile in options.profiles.items():
        for view in profile.inputs:
            _known(view, VIEWS, f"{path}: profiles.{name}.inputs")
        for field in dataclasses.fields(Profile):
            value = getattr(profile, field.name)
            if isinstance(value, int) and value < (0 if field.name == "evaluations" else 1):
                raise TwingapError(f"{value} found, at least 1 expected", where=f"{path}: profiles.{name}.{field.name}")


def _known(value: str, known: Iterable[str], where: str) -> None:
    if value not in (names := list(known)):
        raise TwingapError(f"{value!r} found, one of {', '.join(names)} expected", where=where)
