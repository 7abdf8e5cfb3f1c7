"""Numbers, names and conditions as a reader sees them, in plain text.

All of it is escaped later, by the page's templates.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from twingap.effects.base import HEALTHY_RMS
from twingap.gap.report.model import ParameterValue

_SUFFIXES: Final[Mapping[str, str]] = {"Hz": "_hz", "rpm": "_rpm", "s": "_s", "N": "_n", "deg": "_deg", "1/s": "_per_s"}
_WIDEST: Final = 1.2
"""Width of the interval of a closure from which the closure is not stated. A larger value states more of them."""
_IN_LIST: Final = re.compile(r"(.+)\.[0-9]+")
"""Key of a number of a list."""


def name(text: str) -> str:
    """A name from the code, without underscores."""
    return text.replace("_", " ")


def quantity(parameter: str, unit: str) -> str:
    """A parameter's name without the unit at its end, which stands beside the value."""
    return name(parameter.removesuffix(_SUFFIXES.get(unit, "")))


def number(value: float, unit: str = "") -> str:
    """Four digits with unit."""
    shown = f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"
    return (shown if unit in ("", "1") else f"{shown}\u00a0{unit}").replace("-", "−", int(value < 0))


def value(parameter: ParameterValue) -> str:
    """A number with unit and interval."""
    text = number(parameter.value, parameter.unit)
    return text if parameter.ci is None else f"{text} ({number(parameter.ci[0])} to {number(parameter.ci[1])})"


def parameters(values: Mapping[str, ParameterValue], reference: ParameterValue | None = None) -> tuple[str, ...]:
    """One line for each parameter or list: name = value, and in the unit of the records if it is relative to
    `reference`."""

    def absolute(one: ParameterValue) -> str:
        if reference is None or one.unit != HEALTHY_RMS:
            return ""
        return f", that is {number(one.value * reference.value, reference.unit)}"

    lists: dict[str, list[ParameterValue]] = {}
    for key, one in values.items():
        of_list = _IN_LIST.fullmatch(key)
        lists.setdefault(of_list[1] if of_list else key, []).append(one)
    return tuple(
        f"{quantity(key, own[0].unit)} = {value(own[0])}{absolute(own[0])}"
        if key in values
        else f"{quantity(key, own[0].unit)} = {', '.join(number(p.value) for p in own)} {own[0].unit}".strip()
        for key, own in lists.items()
    )


def percent(part: float, interval: tuple[float, float] | None = None) -> str:
    """A part with its interval in per cent, breaking before the interval only; rounded, so that nothing reads "-0"."""
    shown, *ends = (round(100 * v) for v in (part, *(interval or ())))
    text = f"{shown} %" + (f" ({ends[0]} to {ends[1]} %)" if ends else "")
    return text.replace("-", "−").replace(" ", "\u00a0").replace("\u00a0(", " (")


def closure(part: float, interval: tuple[float, float] | None = None) -> str:
    """A closure with its interval in per cent; in words where it is not determined or the gap more than doubles."""
    if interval is not None and undetermined(interval):
        return "not determined"
    if part < -1:
        return "widens the gap"
    return percent(part, interval if interval is None else (max(interval[0], -1.0), interval[1]))


def undetermined(interval: tuple[float, float]) -> bool:
    """Whether the interval of a closure holds too much to tell anything, as that of an effect that acts by chance."""
    return interval[0] < 0 and interval[1] - max(interval[0], -1.0) > _WIDEST


def p_value(value: float) -> str:
    """A p-value with two digits; permutations give none below 0.001."""
    return f"{value:.2g}" if value > 0.001 * (1 + 1e-6) else "≤ 0.001"


def plain(value: Any) -> str:
    """An entry of the provenance."""
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {plain(v)}" for k, v in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(map(plain, value)) or "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
