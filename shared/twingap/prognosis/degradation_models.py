"""Curves for a health indicator along a run, fitted by least squares with bounds.

time_s, indicator --grid of exponents, linear coefficients--> bounded least squares --> CurveFit --> any later time

Paper 2 names "the exponential model, power model, and polynomial model" as common and prefers "the combined power
function", without its form. Two possible forms are included: a t^b + c and a t^b + c t^d + e. Time enters as
u = (t - first) / (last - first), so it begins with the run; only a t^b without offset depends on its origin. All models
are linear except for their exponents (Golub and Pereyra 1973, DOI 10.1137/0710036), so that a grid of exponents gives
reliable initial values.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from twingap.errors import TwingapError

Array = NDArray[np.float64]

AMPLITUDE_LIMIT: Final = 100.0
"""Bound of every linear coefficient, relative to the largest indicator. Without it, two terms of nearly equal exponent
can grow without limit with opposite signs, which makes extrapolation useless."""
LARGEST_ARGUMENT: Final = 300.0
"""Bound of arguments of exp, which keeps values and their squares finite."""
POWERS: Final = (0.05, 60.0)
RATES: Final = (-60.0, 60.0)
"""Bounds of exponents and rates, relative to the duration of the run. At 60 a curve changes only in the last 2 % of
it."""


@dataclass(frozen=True)
class CurveModel:
    """Family of curves: a linear combination of columns that depend on time and on a few exponents.

    Parameters
    ----------
    name, formula : str
    columns : callable
        (u [rows], exponents) -> list of Arrays [rows]. Exponents may be arrays that broadcast with u.
    slopes : callable
        (u, exponents) -> list of (index of the column, its derivative [rows]), one for each exponent.
    starts : tuple of Array
        Grid of each exponent; empty for linear models.
    bounds : (float, float)
        Bounds of each exponent.
    spread : float
        Smallest ratio of the second exponent to the first, where there are two.
    linear : int
        Number of columns.
    """

    name: str
    formula: str
    columns: Callable[[Array, tuple[Any, ...]], list[Array]]
    slopes: Callable[[Array, tuple[Any, ...]], list[tuple[int, Array]]]
    starts: tuple[Array, ...]
    bounds: tuple[float, float]
    linear: int
    spread: float = 1.25

    @property
    def parameters(self) -> int:
        """Number of coefficients and exponents."""
        return self.linear + len(self.starts)

    def design(self, u: Array, exponents: tuple[float, ...]) -> Array:
        """Columns [rows, linear]."""
        return np.stack(self.columns(u, exponents), axis=-1)

    def grid(self) -> list[tuple[float, ...]]:
        """Grid of exponents, in ascending order and without nearly equal ones."""
        combinations = [tuple(float(v) for v in values) for values in itertools.product(*self.starts)]
        return [v for v in combinations if len(v) < 2 or v[1] >= self.spread * v[0]]

    def curve(self, u: Array, coefficients: Array, exponents: tuple[float, ...]) -> Array:
        """Values at u [rows] for coefficients [linear]."""
        value: Array = self.design(u, exponents) @ coefficients
        return value


@dataclass(frozen=True)
class CurveFit:
    """A model fitted to a run.

    Parameters
    ----------
    model : CurveModel
    origin_s, span_s : float
        u = (t - origin) / span.
    coefficients : Array [linear]
        In the unit of the indicator.
    exponents : tuple of float
    time_s, values : Array [rows]
        Times, s, and values of the fit.
    """

    model: CurveModel
    origin_s: float
    span_s: float
    coefficients: Array
    exponents: tuple[float, ...]
    time_s: Array
    values: Array

    def at(self, time_s: ArrayLike) -> Array:
        """Values of the curve at times [...], s."""
        t = np.asarray(time_s, float)
        flat = self.model.curve(self.scaled(t.ravel()), self.coefficients, self.exponents)
        return flat.reshape(t.shape)

    def scaled(self, time_s: ArrayLike) -> Array:
        """Scaled time u of times [...], s."""
        return np.asarray((np.asarray(time_s, float) - self.origin_s) / self.span_s)

    @property
    def residuals(self) -> Array:
        """Indicator minus curve [rows]."""
        return self.values - self.at(self.time_s)

    @property
    def rmse(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def r2(self) -> float:
        """Coefficient of determination; 0 for a constant indicator."""
        spread = float(np.sum((self.values - self.values.mean()) ** 2))
        return 1 - float(np.sum(self.residuals**2)) / spread if spread > 0 else 0.0

    @property
    def at_bound(self) -> bool:
        """Whether a parameter is at its bound, so that the data do not determine it."""
        low, high = self.model.bounds
        limit = AMPLITUDE_LIMIT * float(np.abs(self.values).max())
        ends = [b - low < 1e-3 * (high - low) or high - b < 1e-3 * (high - low) for b in self.exponents]
        return any(ends) or bool((np.abs(self.coefficients) > 0.999 * limit).any())


def _power(u: Array, b: float) -> Array:
    safe = np.where(u > 0, u, 1.0)
    return np.where(u > 0, np.exp(np.minimum(b * np.log(safe), LARGEST_ARGUMENT)), 0.0)


def _log(u: Array) -> Array:
    """log u; 0 for u = 0, where u^b log u is 0."""
    return np.log(np.where(u > 0, u, 1.0))


def _exp(u: Array, b: float) -> Array:
    # Relative to the last row, so that the coefficient has the size of the indicator for every rate.
    return np.exp(np.minimum(b * (u - 1), LARGEST_ARGUMENT))


def _ones(u: Array) -> Array:
    return np.ones_like(u)


def _polynomial(degree: int) -> CurveModel:
    terms = " + ".join(["a", "b t", "c t^2", "d t^3"][: degree + 1])
    return CurveModel(
        f"polynomial {degree}", terms, lambda u, e: [u**k for k in range(degree + 1)], lambda u, e: [], (), (0.0, 1.0),
        degree + 1,
    )  # fmt: skip


_RATE_STARTS: Final = np.concatenate([-np.geomspace(30, 0.3, 8), np.geomspace(0.3, 55, 14)])
_POWER_STARTS: Final = np.geomspace(0.06, 55, 22)
_TWO_STARTS: Final = (np.geomspace(0.06, 30, 10), np.geomspace(0.2, 55, 11))

EXPONENTIAL: Final = CurveModel(
    "exponential", "a exp(b t)", lambda u, e: [_exp(u, e[0])], lambda u, e: [(0, (u - 1) * _exp(u, e[0]))],
    (_RATE_STARTS,), RATES, 1,
)  # fmt: skip
EXPONENTIAL_OFFSET: Final = CurveModel(
    "exponential with offset", "a exp(b t) + c", lambda u, e: [_exp(u, e[0]), _ones(u)],
    lambda u, e: [(0, (u - 1) * _exp(u, e[0]))], (_RATE_STARTS,), RATES, 2,
)  # fmt: skip
POWER: Final = CurveModel(
    "power", "a t^b", lambda u, e: [_power(u, e[0])], lambda u, e: [(0, _log(u) * _power(u, e[0]))],
    (_POWER_STARTS,), POWERS, 1,
)  # fmt: skip
COMBINED_3: Final = CurveModel(
    "combined power 3", "a t^b + c", lambda u, e: [_power(u, e[0]), _ones(u)],
    lambda u, e: [(0, _log(u) * _power(u, e[0]))], (_POWER_STARTS,), POWERS, 2,
)  # fmt: skip
COMBINED_5: Final = CurveModel(
    "combined power 5", "a t^b + c t^d + e", lambda u, e: [_power(u, e[0]), _power(u, e[1]), _ones(u)],
    lambda u, e: [(k, _log(u) * _power(u, e[k])) for k in range(2)], _TWO_STARTS, POWERS, 3,
)  # fmt: skip
CONSTANT: Final = CurveModel("constant", "a", lambda u, e: [_ones(u)], lambda u, e: [], (), (0.0, 1.0), 1)

MODELS: Final[Mapping[str, CurveModel]] = {
    model.name: model
    for model in (
        CONSTANT, EXPONENTIAL, EXPONENTIAL_OFFSET, POWER, _polynomial(2), _polynomial(3), COMBINED_3, COMBINED_5,
    )
}  # fmt: skip
"""Models by name. The constant is the baseline of the comparison. The exponential without offset is `exp1` of MATLAB,
which the paper uses, and the combined power of three parameters its `power2`."""


def fit_curve(model: CurveModel, time_s: ArrayLike, values: ArrayLike, *, robust: bool = False) -> CurveFit:
    """Least-squares fit of a model, with bounds on every parameter.

    Parameters
    ----------
    model : CurveModel
    time_s : array_like [rows]
        Not decreasing, s.
    values : array_like [rows]
        Indicator.
    robust : bool
        Whether outliers get less weight, by a soft L1 loss that becomes linear at 1.345 robust standard deviations
        (Huber's constant) of the residuals.

    Returns
    -------
    CurveFit

    Raises
    ------
    TwingapError
        For NaN, times that decrease, or fewer rows than parameters plus two.
    """
    t, y = checked(time_s, values, at_least=model.parameters + 2)
    origin, span = float(t[0]), float(t[-1] - t[0])
    u = (t - origin) / span
    size = float(np.abs(y).max())
    if size == 0:
        return CurveFit(model, origin, span, np.zeros(model.linear), _first(model), t, y)
    start, exponents = _start(model, u, y / size)
    parameters = np.concatenate([start, exponents])
    if model.starts:
        parameters = polished(model, u, y / size, parameters)
    if robust:
        for _ in range(2):  # the scale is estimated again from the robust curve, since outliers widen the first
            off = y / size - model.curve(u, parameters[: model.linear], tuple(parameters[model.linear :]))
            scale = 1.345 * 1.4826 * float(np.median(np.abs(off - np.median(off))))
            if scale > 1e-12:
                parameters = polished(model, u, y / size, parameters, scale=scale)
    return CurveFit(
        model, origin, span, parameters[: model.linear] * size, tuple(map(float, parameters[model.linear :])), t, y
    )


def polished(
    model: CurveModel, u: Array, y: Array, parameters: Array, *, scale: float | None = None, memory: float = 0.0
) -> Array:
    """Bounded least squares from initial values.

    Parameters
    ----------
    model : CurveModel
    u, y : Array [rows]
        Scaled time; indicator over its largest value.
    parameters : Array [linear + exponents]
        Initial values.
    scale : float or None
        Scale of the soft L1 loss; None for squares.
    memory : float
        Correlation of neighbouring rows by which residuals are whitened, as for an AR(1) process.
    """
    low, high = model.bounds
    count = len(model.starts)
    limits = (
        np.array([-AMPLITUDE_LIMIT] * model.linear + [low] * count),
        np.array([AMPLITUDE_LIMIT] * model.linear + [high] * count),
    )

    def residuals(p: Array) -> Array:
        return whitened(model.curve(u, p[: model.linear], tuple(p[model.linear :])) - y, memory)

    def slope(p: Array) -> Array:
        coefficients, exponents = p[: model.linear], tuple(p[model.linear :])
        parts = [
            (coefficients[column] * each)[:, None]
            for column, each in model.slopes(u, exponents)
        ]  # fmt: skip
        return whitened(np.concatenate([model.design(u, exponents), *parts], axis=1), memory)

    inside = np.clip(parameters, limits[0] + 1e-9, limits[1] - 1e-9)
    found = least_squares(
        residuals, inside, jac=slope, bounds=limits, x_scale="jac", max_nfev=60, xtol=1e-8, ftol=1e-9, gtol=1e-9,
        loss="linear" if scale is None else "soft_l1", f_scale=1.0 if scale is None else scale,
    )  # fmt: skip
    return np.asarray(found.x, float)


def whitened(x: Array, memory: float) -> Array:
    """Rows minus `memory` times the row before; the first row is scaled to the same variance."""
    if memory == 0:
        return x
    return np.concatenate([x[:1] * np.sqrt(1 - memory**2), x[1:] - memory * x[:-1]])


def checked(time_s: ArrayLike, values: ArrayLike, *, at_least: int) -> tuple[Array, Array]:
    """Times and values as arrays [rows]; raises where no curve can be fitted."""
    t, y = np.asarray(time_s, float), np.asarray(values, float)
    where = "degradation curve"
    if t.ndim != 1 or t.shape != y.shape:
        raise TwingapError(f"shapes {t.shape} and {y.shape}, one time per value expected", where=where)
    if t.size < at_least:
        raise TwingapError(f"{t.size} rows, at least {at_least} expected", where=where, mend="give more records")
    if not (np.isfinite(t).all() and np.isfinite(y).all()):
        raise TwingapError("contains NaN or infinity", where=where, mend="leave these rows out")
    if (np.diff(t) < 0).any() or t[0] == t[-1]:
        raise TwingapError("times do not increase", where=where, mend="sort the rows by time")
    return t, y


def _first(model: CurveModel) -> tuple[float, ...]:
    return model.grid()[0] if model.starts else ()


def _start(model: CurveModel, u: Array, y: Array) -> tuple[Array, tuple[float, ...]]:
    """Coefficients and exponents of the best grid point, with coefficients within their bound."""
    found: tuple[float, Array, tuple[float, ...]] | None = None
    spare: tuple[float, Array, tuple[float, ...]] | None = None
    highest = 0.99 * AMPLITUDE_LIMIT
    for exponents in model.grid():
        design = model.design(u, exponents)
        coefficients: Array = np.asarray(np.linalg.lstsq(design, y, rcond=1e-10)[0], float)
        rss = float(np.sum((y - design @ coefficients) ** 2))
        if np.abs(coefficients).max() <= highest:
            if found is None or rss < found[0]:
                found = rss, coefficients, exponents
        elif spare is None or rss < spare[0]:
            spare = rss, np.asarray(np.clip(coefficients, -highest, highest), float), exponents
    best = found or spare
    assert best is not None
    return best[1], best[2]
