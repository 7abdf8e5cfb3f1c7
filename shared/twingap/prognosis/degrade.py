"""Degradation analysis of one run, from features to forecast; used by `twingap health`.

Run --healthy start--> candidates --criteria--> indicator --> every model: fit, criteria, errors, band, remaining life
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.prognosis.degradation_forecast import (
    Curves,
    OutOfSample,
    RemainingLife,
    out_of_sample,
    redrawn,
    remaining_life,
)
from twingap.prognosis.degradation_models import MODELS, CurveFit, fit_curve
from twingap.prognosis.equation import Equation, equation_of
from twingap.prognosis.health_indicator import Indicators, Run, chosen, evaluate_candidates, online_indicators
from twingap.prognosis.indicator_criteria import IndicatorCriteria, causal_trend
from twingap.prognosis.information import Criteria, criteria

Array = NDArray[np.float64]

FEWEST_LATER = 10
"""Fewest rows after the healthy start to fit a curve to."""
_TOGETHER: Final = 5
"""Rows whose median is the level of an indicator, so that a spike does not determine its direction; more are slower to
follow."""
_CLEAR: Final = 5.0
"""Change of an indicator over the run, in healthy standard deviations, from which its direction counts as clear."""


@dataclass(frozen=True)
class DegradeOptions:
    """Options of the degradation analysis.

    Parameters
    ----------
    healthy_rows : int
        First records, assumed healthy. The number is fixed, so that the indicator does not depend on later rows.
    indicator : str or None
        Name of a candidate; None = the one of highest suitability on this run.
    limit : float or None
        Level at which life ends, in the unit of the feature if the indicator is one, else in that of the indicator.
    trend_rows : int
        Rows of the causal moving average of the criteria.
    robust : bool
        Whether to fit by soft L1.
    curves : int
        Number of refits for an interval; more make its ends less noisy.
    level : float
        Coverage of the intervals.
    """

    healthy_rows: int = 30
    indicator: str | None = None
    limit: float | None = None
    trend_rows: int = 10
    robust: bool = False
    curves: int = 200
    level: float = 0.9


@dataclass(frozen=True)
class Model:
    """Fit, criteria and forecast of one curve model."""

    fit: CurveFit
    criteria: Criteria
    errors: list[OutOfSample]
    curves: Curves
    life: RemainingLife | None

    @property
    def error(self) -> float | None:
        """Median over tenths of the run of the error on all later records; None where no tenth could be fitted."""
        return float(np.median([e.rmse_rest for e in self.errors])) if self.errors else None


@dataclass(frozen=True)
class Degradation:
    """Result of the degradation analysis of a run.

    Parameters
    ----------
    run : Run
    options : DegradeOptions
    candidates : Indicators
    candidate_criteria : dict[str, IndicatorCriteria]
    indicator : str
        Name of the selected candidate.
    values, trend : Array [rows]
        The indicator and its moving average.
    models : dict[str, Model]
        Models in ascending order of BIC with AR(1) residuals.
    limit : float or None
        In the unit of the indicator.
    rising : bool
        Whether the limit is reached from below.
    notes : tuple of str
        How the direction of the limit was determined, where the run leaves it open.
    equations : dict[str, Equation]
        Equation of every model, in the feature's unit where the indicator is a feature.
    """

    run: Run
    options: DegradeOptions
    candidates: Indicators
    candidate_criteria: dict[str, IndicatorCriteria]
    indicator: str
    values: Array
    trend: Array
    models: dict[str, Model]
    limit: float | None
    rising: bool
    notes: tuple[str, ...] = ()
    equations: dict[str, Equation] = field(default_factory=dict)

    @property
    def preferred(self) -> str:
        """The model of lowest BIC with AR(1) residuals."""
        return next(iter(self.models))

    def candidate_rows(self) -> list[dict[str, Any]]:
        """One row per candidate, most suitable first."""
        names = sorted(self.candidate_criteria, key=lambda name: -self.candidate_criteria[name].suitability)
        return [
            {
                "candidate": name, "monotonicity": c.monotonicity, "trendability": c.trendability,
                "robustness": c.robustness, "suitability": c.suitability, "sensitivity": c.sensitivity,
                "chosen": int(name == self.indicator),
            }
            for name in names
            for c in [self.candidate_criteria[name]]
        ]  # fmt: skip

    def model_rows(self) -> list[dict[str, Any]]:
        """One row per model; criteria are differences to the lowest, remaining times are empty without a limit."""
        least = {
            name: min(getattr(m.criteria, name) for m in self.models.values())
            for name in ("aicc", "bic", "aicc_ar1", "bic_ar1")
        }
        rows = []
        for name, m in self.models.items():
            life = m.life
            rows.append({
                "model": name, "equation": self.equations[name].text(), "r2": m.fit.r2, "rmse": m.fit.rmse,
                **{f"{key}_above_least": _difference(getattr(m.criteria, key), value) for key, value in least.items()},
                "residual_memory": m.criteria.memory, "rmse_later_records": m.error,
                "at_bound": int(m.fit.at_bound),
                "remaining_time_s": None if life is None else _finite(life.life_s),
                "remaining_time_s_lo": None if life is None else _finite(life.low_s),
                "remaining_time_s_hi": None if life is None else _finite(life.high_s),
                "never_reached": None if life is None else life.never,
            })  # fmt: skip
        return rows

    def indicator_rows(self) -> list[dict[str, float]]:
        """One row per record."""
        return [
            {"time_s": float(t), "indicator": float(x), "trend": float(s)}
            for t, x, s in zip(self.run.time_s, self.values, self.trend, strict=True)
        ]


def degrade(
    run: Run,
    options: DegradeOptions,
    rng: np.random.Generator,
    *,
    progress: Callable[[str], None] = lambda what: None,
) -> Degradation:
    """Indicator, curve models and forecasts of one run.

    Parameters
    ----------
    run : Run
    options : DegradeOptions
    rng : Generator
        Generator of the draws of intervals.
    progress : callable
        Called with the name of each model after its fit.

    Returns
    -------
    Degradation

    Raises
    ------
    TwingapError
        For too few rows, constant features, an unknown indicator, a limit that is not finite or from which the
        indicator moves away.
    """
    rows, needed = run.time_s.size, options.healthy_rows + FEWEST_LATER
    if rows < needed:
        few = f"{rows} record" if rows == 1 else f"{rows} records"
        raise TwingapError(
            f"{few}, at least {needed} expected: {options.healthy_rows} healthy ones and {FEWEST_LATER} more",
            where=run.name, mend="give more records, or fewer healthy ones (--healthy)",
        )  # fmt: skip
    candidates = online_indicators(run, options.healthy_rows)
    found = evaluate_candidates(candidates, run.time_s, healthy_rows=options.healthy_rows, window=options.trend_rows)
    name = options.indicator or chosen([found])
    if name not in candidates.values:
        known = ", ".join(candidates.values)
        raise TwingapError(f"no indicator {name!r}", where=run.name, mend=f"use one of {known}")
    values = candidates.values[name]
    limit = options.limit
    if limit is not None and not np.isfinite(limit):
        raise TwingapError(f"limit {limit!r}, a finite number expected", where="--limit")
    rising, notes = True, tuple[str, ...]()
    if limit is not None:
        centre, scale, unit = _unit_of(name, run, candidates)
        rising, notes = _direction(name, centre + scale * values, limit, options.healthy_rows, unit)
        limit = float((limit - centre) / scale)
    models: dict[str, Model] = {}
    for title, model in MODELS.items():
        fit = fit_curve(model, run.time_s, values, robust=options.robust)
        curves = redrawn(fit, options.curves, rng)
        life = None if limit is None else remaining_life(curves, limit, rising=rising, level=options.level)
        errors = out_of_sample(model, run.time_s, values, robust=options.robust)
        models[title] = Model(fit, criteria(fit), errors, curves, life)
        progress(title)
    ordered = dict(sorted(models.items(), key=lambda item: item[1].criteria.bic_ar1))
    trend = causal_trend(values, options.trend_rows)
    centre, scale, _ = _unit_of(name, run, candidates) if name in run.names else (0.0, 1.0, "")
    equations = {title: equation_of(model.fit, name, centre, scale) for title, model in ordered.items()}
    return Degradation(run, options, candidates, found, name, values, trend, ordered, limit, rising, notes, equations)


def _unit_of(name: str, run: Run, candidates: Indicators) -> tuple[float, float, str]:
    """Centre and scale that convert an indicator to the unit of its limit, and the name of that unit.

    The unit is that of the feature itself; for a fusion feature it is its own healthy standard deviation.
    """
    varying = [n for n in run.names if n not in candidates.constant]
    if name not in varying:
        own = float(candidates.fusion.variance[int(name.removeprefix("fusion ")) - 1])
        return 0.0, 1 / np.sqrt(own), "healthy standard deviations"
    place = varying.index(name)
    return float(candidates.fusion.centre[place]), float(candidates.fusion.scale[place]), "the feature"


def _direction(name: str, values: Array, limit: float, healthy_rows: int, unit: str) -> tuple[bool, tuple[str, ...]]:
    """Whether the indicator reaches the limit from below, by its change in this run; a note where that is unclear.

    Parameters
    ----------
    name : str
    values : Array [rows]
        Indicator in the unit of the limit.
    limit : float
    healthy_rows : int
    unit : str
        Name of the unit, for the message.

    Raises
    ------
    TwingapError
        When the indicator moves away from the limit, so that the healthy rows are already beyond it.
    """
    healthy, later = values[:healthy_rows], values[healthy_rows:]
    level = float(healthy.mean())
    moves = np.median(np.lib.stride_tricks.sliding_window_view(later, _TOGETHER), axis=-1) - level
    end, above = float(moves[-1]), limit > level
    clear = abs(end) > _CLEAR * float(healthy.std(ddof=1)) and not (np.sign(end) * moves < -abs(end)).any()
    if not clear:
        side, way = ("above", "rises") if above else ("below", "falls")
        return above, (
            f"{name} does not move clearly away from its healthy {level:.4g} in this run: the limit {limit:g} is "
            f"{side} that, so life is assumed to end where it {way} to it",
        )
    rising = end > 0
    if rising != above or limit == level:
        way, mend = (
            ("rises", "raise the limit")
            if rising
            else ("falls", "include running in among the healthy rows (--healthy) or lower the limit")
        )
        raise TwingapError(
            f"healthy rows already have {name} {level:.4g}, and it {way} from there, to {level + end:.4g}",
            where=f"limit {limit:g}", mend=f"{mend}, in the unit of {unit}",
        )  # fmt: skip
    return rising, ()


def _difference(value: float, least: float) -> float | None:
    """Difference of a criterion to the lowest; None relative to -inf, the criterion of an exact fit."""
    return 0.0 if value == least else _finite(value - least)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
