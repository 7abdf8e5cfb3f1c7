"""Equation of a fitted degradation curve in the feature's unit and physical time, as it is printed and stored.

CurveFit in scaled time, normalised indicator --centre, scale, span--> a exp(b t) + c, t since the first record
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.prognosis.degradation_models import CurveFit

Array = NDArray[np.float64]

_UNITS_S: Final = {"s": 1.0, "h": 3600.0, "d": 86400.0}
"""Units of time, in s; the first in which all coefficients are numbers that a computer can hold is taken."""
_LARGEST: Final = 1e250


@dataclass(frozen=True)
class Equation:
    """A curve over time since the first record.

    Parameters
    ----------
    quantity : str
        What it gives.
    formula : str
        With letters for the coefficients, `t` for the time.
    coefficients : dict[str, float]
        By letter.
    fixed : tuple of str
        Letters of coefficients that were not fitted: the healthy mean, where the model has no offset of its own.
    origin_s : float
        `time_s` at t = 0.
    time_unit : str
        Of t: s, h or d.
    """

    quantity: str
    formula: str
    coefficients: dict[str, float]
    fixed: tuple[str, ...]
    origin_s: float
    time_unit: str

    def at(self, time_s: ArrayLike) -> Array:
        """The curve at these times [...], s, evaluated from formula and coefficients alone."""
        t = (np.asarray(time_s, float) - self.origin_s) / _UNITS_S[self.time_unit]
        total = np.zeros_like(t)
        for term in self.formula.split(" + "):
            letters = term.split(" ")
            c = self.coefficients
            value = c[letters[0]] * np.ones_like(t)
            for factor in letters[1:]:
                if factor.startswith("exp("):
                    value = value * np.exp(c[factor[4:]] * t)
                elif factor.startswith("t"):
                    power = factor.removeprefix("t").removeprefix("^") or "1"
                    value = value * t ** (c[power] if power in c else float(power))
            total = total + value
        return total

    def text(self) -> str:
        """The equation with its numbers and units, in a line."""
        shown = f" {self.formula} "
        for letter, value in self.coefficients.items():
            number = f"{value:.8g}"
            shown = shown.replace(f" {letter} ", f" {number} ").replace(f"({letter} ", f"({number} ")
            shown = shown.replace(f"^{letter} ", f"^{number} ")
        shown = shown.replace("+ -", "- ").strip()
        since = "time_s" if self.origin_s == 0 else f"time_s - {self.origin_s:.12g}"
        unit = "" if self.time_unit == "s" else f" / {_UNITS_S[self.time_unit]:g}"
        since = f"({since})" if unit and self.origin_s else since
        return f"{self.quantity} = {shown}, t = {since}{unit} in {self.time_unit}"

    def about(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "equation": self.text(), "quantity": self.quantity, "formula": self.formula,
            "coefficients": self.coefficients, "not_fitted": list(self.fixed), "origin_s": self.origin_s,
            "time_unit": self.time_unit,
        }  # fmt: skip


def equation_of(fit: CurveFit, quantity: str, centre: float = 0.0, scale: float = 1.0) -> Equation:
    """Equation of a fit.

    Parameters
    ----------
    fit : CurveFit
        Of an indicator that is (feature - centre) / scale.
    quantity : str
        Name of the feature.
    centre, scale : float

    Returns
    -------
    Equation
    """
    found = {unit: _in_unit(fit, centre, scale, fit.span_s / seconds) for unit, seconds in _UNITS_S.items()}
    fits = [unit for unit, (_, values, _) in found.items() if all(map(_can_be_held, values.values()))]
    unit = fits[0] if fits else "d"
    return Equation(quantity, *found[unit], fit.origin_s, unit)


def _can_be_held(value: float) -> bool:
    """Whether a coefficient, or a product with it, does not overflow or vanish."""
    return value == 0 or 1 / _LARGEST < abs(value) < _LARGEST


def _in_unit(fit: CurveFit, centre: float, scale: float, span: float) -> tuple[str, dict[str, float], tuple[str, ...]]:
    """Formula and coefficients with the run's span given in the unit of time."""
    linear = [float(v) * scale for v in fit.coefficients]
    terms = fit.model.formula.split(" + ")
    coefficients: dict[str, float] = {}
    exponents = list(fit.exponents)
    has_offset = False
    for term, value in zip(terms, linear, strict=True):
        letter, *factors = term.split(" ")
        if not factors:
            coefficients[letter] = value + centre
            has_offset = True
        elif factors[0].startswith("exp("):
            b = exponents.pop(0)
            coefficients[letter] = value * _exp(-b)  # the fit counts from the last row
            coefficients[factors[0][4:]] = b / span
        else:
            power = factors[0].removeprefix("t").removeprefix("^") or "1"
            b = exponents.pop(0) if power.isalpha() else float(power)
            coefficients[letter] = value * _exp(-b * math.log(span))
            if power.isalpha():
                coefficients[power] = b
    if has_offset or centre == 0:
        return fit.model.formula, coefficients, ()
    letter = next(c for c in "abcdef" if c not in coefficients)
    return f"{fit.model.formula} + {letter}", coefficients | {letter: centre}, (letter,)


def _exp(value: float) -> float:
    return math.exp(value) if value < 700 else math.inf
