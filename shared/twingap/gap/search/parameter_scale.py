"""Values of effects as numbers that compare between machines: relative to sampling rate, run or nothing.

effect on a machine <--> one number per parameter, logarithmic where the parameter is
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from twingap.effects import Effect, catalogue, make_effect
from twingap.errors import TwingapError
from twingap.records import Condition

_NOT_LEARNT: Final = {("speed_gain", "reference_speed_rpm")}
"""A convention: the impacts' amplitude takes up another reference."""
_BROAD_HZ: Final = 400.0
"""Parameters in Hz that reach beyond this are places in a spectrum, and scale with the sampling rate."""
_EXACT: Final = ("carrier_hz", "order", "teeth", "sideband_order", "mains_hz", "inner", "accumulating")
"""Parameters that estimates have right, or not at all."""


@dataclass(frozen=True)
class Setting:
    """What numbers are relative to: the records' rate and run.

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


@cache
def coordinates() -> tuple[tuple[str, str], ...]:
    """(effect, parameter) of all that can be estimated."""
    return tuple(
        (name, field.name)
        for name, kind in catalogue().items()
        for field in dataclasses.fields(kind)  # type: ignore[arg-type]
        if "plausible" in field.metadata and (name, field.name) not in _NOT_LEARNT
    )


def to_number(effect: Effect, parameter: str, setting: Setting) -> float:
    """The parameter's value as a comparable number."""
    value = float(getattr(effect, parameter))
    value = value / _unit(effect.name, parameter, setting) - _origin(effect.name, parameter, setting)
    return math.log(max(value, 1e-12)) if _log(effect.name, parameter) else value


def to_effect(name: str, numbers: Mapping[str, float], setting: Setting) -> Effect:
    """The effect with these values, each moved into its allowed range."""
    values: dict[str, float] = {}
    for field in dataclasses.fields(catalogue()[name]):  # type: ignore[arg-type]
        if field.name == "reference_speed_rpm":
            values[field.name] = setting.speed_rpm
        if field.name not in numbers:
            continue
        values[field.name] = to_value(name, field.name, numbers[field.name], setting)
    if name == "coloured_noise" and values["low_hz"] >= 0.985 * values["high_hz"]:
        values["low_hz"] = 0.9 * values["high_hz"]
    try:
        return make_effect(name, values)
    except TwingapError:  # a user's own effect may refuse combinations: its defaults are always meaningful
        return make_effect(name)


def a_little_off(effect: Effect, error: float, setting: Setting, rng: np.random.Generator) -> Effect:
    """The effect at values about as wrong as estimates are.

    Parameters
    ----------
    effect : Effect
    error : float
        Standard deviation of numbers, see `to_number`.
    setting : Setting
    rng : numpy.random.Generator
    """
    numbers = {p: to_number(effect, p, setting) for name, p in coordinates() if name == effect.name}
    for parameter in [p for p in numbers if p not in _EXACT]:
        numbers[parameter] += error * rng.standard_normal()
    return to_effect(effect.name, numbers, setting)


def to_value(name: str, parameter: str, number: float, setting: Setting) -> float:
    """A comparable number as the parameter's value, in its unit and allowed range."""
    field = _field(name, parameter)
    value = math.exp(min(number, 60.0)) if _log(name, parameter) else number
    value = (value + _origin(name, parameter, setting)) * _unit(name, parameter, setting)
    low, high = field.metadata["allowed"]
    if name == "mains_interference" and parameter == "mains_hz":
        value = 50.0 if abs(value - 50) < abs(value - 60) else 60.0
    if _place_in_spectrum(field):
        high = min(high, 0.48 * setting.fs_hz) if parameter != "high_hz" and parameter != "corner_hz" else high
    value = float(min(max(value, low), high))
    if field.type in ("bool", bool):
        return bool(value >= 0.5)
    return round(value) if field.type in ("int", int) else value


@cache
def _field(name: str, parameter: str) -> dataclasses.Field[float]:
    return next(f for f in dataclasses.fields(catalogue()[name]) if f.name == parameter)  # type: ignore[arg-type]


def _log(name: str, parameter: str) -> bool:
    return bool(_field(name, parameter).metadata["log"]) or parameter == "teeth"


def _place_in_spectrum(field: dataclasses.Field[float]) -> bool:
    return bool(field.metadata["unit"] == "Hz" and field.metadata["plausible"][1] > _BROAD_HZ)


def _unit(name: str, parameter: str, setting: Setting) -> float:
    field = _field(name, parameter)
    if _place_in_spectrum(field):
        return setting.fs_hz
    return {"rate_per_s": 1 / setting.span_s, "onset_s": setting.span_s}.get(parameter, 1.0)


def _origin(name: str, parameter: str, setting: Setting) -> float:
    return setting.begin_s / setting.span_s if parameter == "onset_s" else 0.0
