"""Parameters as numbers on a scale that is common to machines: relative to sampling rate or run, or absolute.

effect on a machine <--> one number per parameter, on a log scale where the parameter is positive and wide-ranging
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from twingap.effects import Effect, catalogue, make_effect, trainable
from twingap.effects.base import within_allowed
from twingap.errors import TwingapError
from twingap.records import Condition

_MOST_OF_NYQUIST: Final = 0.48
"""Upper bound of estimated frequencies below Nyquist, as a part of the sampling rate."""
_LARGEST_LOG: Final = 60.0
"""Largest logarithm of an estimate; it keeps numbers finite."""


@dataclass(frozen=True)
class Setting:
    """Sampling rate, run and speed of a set of records: the reference of comparable numbers."""

    fs_hz: float
    begin_s: float  # begin and duration of the run, s; the duration is 1 where there is no run
    span_s: float
    speed_rpm: float  # median speed

    @classmethod
    def of(cls, conditions: Sequence[Condition]) -> Setting:
        """Setting of a set of records."""
        times = [c.time_s for c in conditions if c.time_s is not None]
        speeds = sorted(c.speed_rpm for c in conditions)
        begin, span = (min(times), max(times) - min(times)) if times else (0.0, 0.0)
        return cls(max(c.fs_hz for c in conditions), begin, span or 1.0, speeds[len(speeds) // 2])


def coordinates() -> tuple[tuple[str, str], ...]:
    """(effect, parameter) of all parameters that are estimated."""
    return _coordinates(tuple(catalogue().items()))


def trained_coordinates() -> tuple[tuple[str, str], ...]:
    """(effect, parameter) of the parameters for which estimators are trained."""
    return _coordinates(tuple(trainable().items()))


@cache
def _coordinates(effects: tuple[tuple[str, type[Effect]], ...]) -> tuple[tuple[str, str], ...]:
    return tuple((name, field.name) for name, kind in effects for field in kind.parameters() if _estimated(field))


def to_number(effect: Effect, parameter: str, setting: Setting) -> float:
    """The parameter's value as a comparable number; its logarithm for parameters with a log scale."""
    field = _field(type(effect), parameter)
    value = float(getattr(effect, parameter)) / _unit(field, setting) - _origin(field, setting)
    return math.log(max(value, 1e-12)) if field.metadata["log_estimate"] else value


def to_effect(name: str, numbers: Mapping[str, float], setting: Setting) -> Effect:
    """The effect at these comparable numbers, each clipped to its allowed range; others have their defaults."""
    kind, values = catalogue()[name], dict[str, float]()
    for field in kind.parameters():
        if field.metadata["relative_to"] == "speed":
            values[field.name] = setting.speed_rpm
        elif field.name in numbers:
            values[field.name] = to_value(name, field.name, numbers[field.name], setting)
    try:
        return make_effect(name, kind.consistent(values))
    except TwingapError:  # a user's own effect may reject combinations of values; its defaults are always valid
        return make_effect(name)


def with_errors(effect: Effect, error: float, setting: Setting, rng: np.random.Generator) -> Effect:
    """The effect at values with random errors, as estimates have them, of this standard deviation (see `to_number`)."""
    numbers = {}
    for field in effect.parameters():
        if _estimated(field):
            numbers[field.name] = to_number(effect, field.name, setting)
            if not field.metadata["exact"]:
                numbers[field.name] += error * rng.standard_normal()
    return to_effect(effect.name, numbers, setting)


def to_value(name: str, parameter: str, number: float, setting: Setting) -> float:
    """The parameter's value, in its unit and allowed range, from a comparable number."""
    field = _field(catalogue()[name], parameter)
    value = math.exp(min(number, _LARGEST_LOG)) if field.metadata["log_estimate"] else number
    value = (value + _origin(field, setting)) * _unit(field, setting)
    bounded = field.metadata["relative_to"] == "rate" and not field.metadata["above_nyquist"]
    return within_allowed(field, value, _MOST_OF_NYQUIST * setting.fs_hz if bounded else math.inf)


def _estimated(field: dataclasses.Field[Any]) -> bool:
    """Whether a parameter is estimated.

    A reference speed is a convention, absorbed by the impacts' amplitude; nor is a form that neither fitting nor a
    search changes, unless it is right or wrong alone.
    """
    about = field.metadata
    return bool(about["relative_to"] != "speed" and (about["fitted"] or about["searched"] or about["exact"]))


@cache
def _field(kind: type[Effect], parameter: str) -> dataclasses.Field[Any]:
    """Field of a parameter."""
    return next(field for field in kind.parameters() if field.name == parameter)


def _unit(field: dataclasses.Field[Any], setting: Setting) -> float:
    """Divisor of values on the common scale."""
    relative_to, unit = field.metadata["relative_to"], field.metadata["unit"]
    if relative_to == "run":
        return 1 / setting.span_s if unit == "1/s" else setting.span_s
    return setting.fs_hz if relative_to == "rate" else 1.0


def _origin(field: dataclasses.Field[Any], setting: Setting) -> float:
    """Origin of a time within the run, in durations of the run."""
    of_run = field.metadata["relative_to"] == "run" and field.metadata["unit"] != "1/s"
    return setting.begin_s / setting.span_s if of_run else 0.0
