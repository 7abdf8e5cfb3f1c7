"""Parameters as numbers that are comparable between machines: relative to sampling rate, run or nothing.

effect on a machine <--> one number per parameter, logarithmic where the parameter is
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from twingap.effects import Effect, catalogue, make_effect
from twingap.effects.base import within_allowed
from twingap.errors import TwingapError
from twingap.records import Condition

_MOST_OF_NYQUIST: Final = 0.48
"""Of the sampling rate: estimates of frequencies that must lie below half of it end here."""
_LARGEST_LOG: Final = 60.0
"""Logarithms of estimates end here, so that numbers stay finite."""


@dataclass(frozen=True)
class Setting:
    """Sampling rate, run and speed of a set of records, which comparable numbers are relative to.

    Parameters
    ----------
    fs_hz : float
    begin_s, span_s : float
        Of the run, s; span 1 when there is none.
    speed_rpm : float
        Median.
    """

    fs_hz: float
    begin_s: float
    span_s: float
    speed_rpm: float

    @classmethod
    def of(cls, conditions: Sequence[Condition]) -> Setting:
        """Of a set of records."""
        times = [c.time_s for c in conditions if c.time_s is not None]
        speeds = sorted(c.speed_rpm for c in conditions)
        begin, span = (min(times), max(times) - min(times)) if times else (0.0, 0.0)
        return cls(max(c.fs_hz for c in conditions), begin, span or 1.0, speeds[len(speeds) // 2])


def coordinates() -> tuple[tuple[str, str], ...]:
    """(effect, parameter) of all that can be estimated."""
    return _coordinates(tuple(catalogue().items()))


@cache
def _coordinates(effects: tuple[tuple[str, type[Effect]], ...]) -> tuple[tuple[str, str], ...]:
    return tuple((name, field.name) for name, kind in effects for field in kind.parameters() if _estimated(field))


def to_number(effect: Effect, parameter: str, setting: Setting) -> float:
    """The parameter's value as a comparable number."""
    field = _field(type(effect), parameter)
    value = float(getattr(effect, parameter)) / _unit(field, setting) - _origin(field, setting)
    return math.log(max(value, 1e-12)) if field.metadata["log_estimate"] else value


def to_effect(name: str, numbers: Mapping[str, float], setting: Setting) -> Effect:
    """The effect with these values, each moved into its allowed range."""
    kind, values = catalogue()[name], dict[str, float]()
    for field in kind.parameters():
        if field.metadata["relative_to"] == "speed":
            values[field.name] = setting.speed_rpm
        elif field.name in numbers:
            values[field.name] = to_value(name, field.name, numbers[field.name], setting)
    try:
        return make_effect(name, kind.consistent(values))
    except TwingapError:  # a user's own effect may refuse combinations: its defaults are always meaningful
        return make_effect(name)


def a_little_off(effect: Effect, error: float, setting: Setting, rng: np.random.Generator) -> Effect:
    """The effect at values with errors as estimates have them.

    Parameters
    ----------
    effect : Effect
    error : float
        Standard deviation of numbers, see `to_number`.
    setting : Setting
    rng : numpy.random.Generator
    """
    numbers = {}
    for field in effect.parameters():
        if _estimated(field):
            numbers[field.name] = to_number(effect, field.name, setting)
            if not field.metadata["exact"]:
                numbers[field.name] += error * rng.standard_normal()
    return to_effect(effect.name, numbers, setting)


def to_value(name: str, parameter: str, number: float, setting: Setting) -> float:
    """A comparable number as the parameter's value, in its unit and allowed range."""
    field = _field(catalogue()[name], parameter)
    value = math.exp(min(number, _LARGEST_LOG)) if field.metadata["log_estimate"] else number
    value = (value + _origin(field, setting)) * _unit(field, setting)
    bounded = field.metadata["relative_to"] == "rate" and not field.metadata["above_nyquist"]
    return within_allowed(field, value, _MOST_OF_NYQUIST * setting.fs_hz if bounded else math.inf)


def _estimated(field: dataclasses.Field[Any]) -> bool:
    """Whether it is more than a convention: the impacts' amplitude takes up another reference speed."""
    return bool(field.metadata["relative_to"] != "speed")


@cache
def _field(kind: type[Effect], parameter: str) -> dataclasses.Field[Any]:
    return next(field for field in kind.parameters() if field.name == parameter)


def _unit(field: dataclasses.Field[Any], setting: Setting) -> float:
    """What values are divided by to be comparable."""
    relative_to, unit = field.metadata["relative_to"], field.metadata["unit"]
    if relative_to == "run":
        return 1 / setting.span_s if unit == "1/s" else setting.span_s
    return setting.fs_hz if relative_to == "rate" else 1.0


def _origin(field: dataclasses.Field[Any], setting: Setting) -> float:
    """Where a time of the run counts from, in spans."""
    of_run = field.metadata["relative_to"] == "run" and field.metadata["unit"] != "1/s"
    return setting.begin_s / setting.span_s if of_run else 0.0
