"""Jobs of the degradation study: one run and one indicator, or one kind of simulated run.

Analysis --fit whole, plain and robust; fit each first tenth--> criteria, errors on later records, remaining life
Coverage --simulated runs of a known curve--> how often the interval of the life holds the true one
KnownLaw --simulated runs of a known curve--> how often the claim's two models are told apart, and rightly

Used in: Paper 2, section 4.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from scipy.signal import lfilter

from papers.arrays import Array
from papers.framework import Inputs, Work
from papers.paper2_digital_twin.degradation import candidates
from papers.paper2_digital_twin.degradation.candidates import INDICATORS
from papers.paper2_digital_twin.degradation.runs import Reading, StudyRun, study_runs
from twingap import TwingapError
from twingap.prognosis.degradation_forecast import TENTHS, out_of_sample, redrawn, remaining_life, rows_until
from twingap.prognosis.degradation_models import MODELS, CurveModel, fit_curve
from twingap.prognosis.information import criteria

Series = Mapping[str, tuple[Array, Array]]


@dataclass(frozen=True)
class Size:
    ims: int
    femto: int
    curves: int
    coverage_runs: int


@dataclass(frozen=True)
class Options(Reading):
    runs_ims: tuple[str, ...]
    runs_femto: tuple[str, ...]
    paper_run: str
    raw_run: str
    indicators: tuple[str, ...]
    primary: tuple[str, ...]
    error: Literal["rest", "next"]
    interval_level: float
    simulated_rows: int
    simulated_noise: float
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        if len(self.primary) != 2 or not set(self.primary) <= set(MODELS):
            raise TwingapError("two models expected", where="primary", mend=f"use two of {', '.join(MODELS)}")
        if "rms" not in self.indicators or not set(self.indicators) <= set(INDICATORS):
            mend = f"use rms and any of {', '.join(INDICATORS[1:])}"
            raise TwingapError(f"{list(self.indicators)} found", where="indicators", mend=mend)


@dataclass(frozen=True)
class Analysis:
    """One indicator of one run."""

    run: str
    indicator: str
    limits: dict[str, float]  # name -> level at which life ends, in the indicator's unit
    healthy: float  # level at the healthy start: tells from which side a limit is reached
    curves: int  # refits for an interval
    level: float  # of the interval
    seed: int


@dataclass(frozen=True)
class Coverage:
    """Simulated runs of one curve."""

    truth: str  # truth, model: what they are made with, and what is fitted
    model: str
    memory: float  # of the AR(1) noise
    share: float  # of life seen
    runs: int
    rows: int
    curves: int
    noise: float
    level: float
    seed: int


@dataclass(frozen=True)
class KnownLaw:
    """Simulated runs of one curve, fitted by the two models of the claim; entries as in `Coverage`."""

    truth: str
    pair: tuple[str, ...]
    memory: float
    runs: int
    rows: int
    noise: float
    seed: int


TRUTHS: Final = {
    "combined power 3": lambda u: 1 + 4 * u**4,
    "combined power 5": lambda u: 1 + 0.5 * u**0.5 + 3.5 * u**8,
    "exponential with offset": lambda u: 1 + 4 * (np.exp(5 * (u - 1)) - np.exp(-5)) / (1 - np.exp(-5)),
    "polynomial 2": lambda u: 1 + u + 3 * u**2,
}
"""Curves of which simulated runs are made: from 1 to `END` over a life."""
END: Final = 5.0
MEMORIES: Final = (0.0, 0.7)  # of the noise of simulated runs


def analyse(job: Analysis, series: Series) -> dict[str, Any]:
    """All models on one indicator of one run."""
    rng = np.random.default_rng([job.seed, 5])
    return {name: _one_model(job, model, *series[f"{job.run}/{job.indicator}"], rng) for name, model in MODELS.items()}


def _one_model(
    job: Analysis, model: CurveModel, time_s: Array, values: Array, rng: np.random.Generator
) -> dict[str, Any]:
    life = float(time_s[-1] - time_s[0])
    fit, robust = fit_curve(model, time_s, values), fit_curve(model, time_s, values, robust=True)
    found = criteria(fit)
    out: dict[str, Any] = {
        "r2": fit.r2, "rmse": fit.rmse, "robust mae": float(np.median(np.abs(robust.residuals))),
        "mae": float(np.median(np.abs(fit.residuals))),
        "coefficients": fit.coefficients.tolist(), "exponents": list(fit.exponents), "at bound": fit.at_bound,
        "aicc": found.aicc, "bic": found.bic, "aicc ar1": found.aicc_ar1, "bic ar1": found.bic_ar1,
        "memory": found.memory, "memory ar1": found.memory_ar1,
    }  # fmt: skip
    for kind in (False, True):
        errors = out_of_sample(model, time_s, values, robust=kind)
        out["robust errors" if kind else "errors"] = [[e.share, e.rmse_rest, e.rmse_next, e.rows] for e in errors]
    lives: dict[str, list[list[Any]]] = {source: [] for source in job.limits}
    for share in TENTHS:
        rows = rows_until(time_s, share)
        if rows < model.parameters + 2:
            continue
        curves = redrawn(fit_curve(model, time_s[:rows], values[:rows]), job.curves, rng)
        left = float(time_s[-1] - time_s[rows - 1])
        for source, limit in job.limits.items():
            r = remaining_life(curves, limit, rising=limit >= job.healthy, level=job.level)
            # JSON has no infinity: None is "not reached".
            row = [v / life if np.isfinite(v) else None for v in (r.life_s, r.low_s, r.high_s)]
            lives[source].append([share, left / life, *row, r.never])
    out["lives"] = lives
    return out


def cover(job: Coverage) -> dict[str, Any]:
    """Simulate, fit, count."""
    if job.truth not in TRUTHS:
        raise TwingapError(f"no curve {job.truth!r}", where="coverage")
    rng = np.random.default_rng([round(100 * job.memory), round(100 * job.share), job.seed, 7])
    inside, widths, bounded, off = 0, [], 0, []
    for t, values in _simulated(job, rng):
        rows = rows_until(t, job.share)
        true = float(t[-1] - t[rows - 1])
        fit = fit_curve(MODELS[job.model], t[:rows], values[:rows])
        r = remaining_life(redrawn(fit, job.curves, rng), END, level=job.level)
        inside += r.low_s <= true <= r.high_s
        bounded += bool(np.isfinite(r.high_s))
        widths.append((min(r.high_s, 1e9) - min(r.low_s, 1e9)) / t[-1])
        off.append(abs(min(r.life_s, 1e9) - true) / t[-1])
    return {
        "inside": inside / job.runs, "bounded": bounded / job.runs, "width": float(np.median(widths)),
        "error": float(np.median(off)), "true": true / float(t[-1]),
    }  # fmt: skip


def tell(job: KnownLaw) -> dict[str, float]:
    """Shares of the runs in which the first model is preferred, by criterion and by error, as on measured runs."""
    rng = np.random.default_rng([round(100 * job.memory), job.seed, 11])
    criterion, ratios = [], []
    for t, values in _simulated(job, rng):
        first, second = (criteria(fit_curve(MODELS[name], t, values)).bic_ar1 for name in job.pair)
        criterion.append(first < second)
        one, other = ([e.rmse_rest for e in out_of_sample(MODELS[name], t, values)] for name in job.pair)
        ratios.append(np.median(one) / np.median(other))
    return {
        "criterion": float(np.mean(criterion)), "error": float(np.mean(np.array(ratios) < 1)),
        "ratio": float(np.median(ratios)),
    }  # fmt: skip


def _simulated(job: Coverage | KnownLaw, rng: np.random.Generator) -> Iterator[tuple[Array, Array]]:
    """Times and values [rows] of one run after the other: the curve in AR(1) noise."""
    t = 10.0 * np.arange(job.rows, dtype=np.float64)
    curve: Array = TRUTHS[job.truth](t / t[-1])
    for _ in range(job.runs):
        shocks = job.noise * rng.standard_normal(job.rows)
        shocks[1:] *= np.sqrt(1 - job.memory**2)
        yield t, np.asarray(curve + lfilter([1.0], [1.0, -job.memory], shocks))


def runs(work: Work) -> list[StudyRun]:
    """Runs to failure at hand, the paper's first."""
    options, size = work.options, work.size
    names = sorted(options.runs_ims, key=lambda n: f"IMS {n}" != options.paper_run)[: size.ims]
    work.title, found = study_runs(sorted(names), options.runs_femto[: size.femto], options, work.root, work.sweep)
    return found


def analyses(work: Work) -> Iterator[Analysis]:
    for j in work["judged"]:
        for name, values in j.series.items():
            limits, healthy = candidates.limits_of(j, name, work["judged"]), float(values[: j.run.healthy_rows].mean())
            level = work.options.interval_level
            yield Analysis(j.run.name, name, limits, healthy, work.size.curves, level, work.seed)


def series(work: Work) -> Inputs:
    """Every indicator over running time, by run and name."""
    found = {f"{j.run.name}/{name}": (j.times[name], x) for j in work["judged"] for name, x in j.series.items()}
    return {"series": (found, candidates.digest_of(found))}


def checks(work: Work) -> Iterator[Coverage]:
    """Kinds of simulated runs: the right model and the wrong one, with and without memory, early and late in life."""
    options, size = work.options, work.size
    pairs = [*((name, name) for name in TRUTHS), options.primary, options.primary[::-1]]
    for (truth, model), memory, share in itertools.product(pairs, MEMORIES, (0.5, 0.7, 0.9)):
        yield Coverage(
            truth, model, memory, share, size.coverage_runs, options.simulated_rows, min(size.curves, 100),
            options.simulated_noise, options.interval_level, work.seed,
        )  # fmt: skip


def known_laws(work: Work) -> Iterator[KnownLaw]:
    """Simulated runs on which the claim can be true: of every curve, with and without memory of the noise."""
    options = work.options
    for truth, memory in itertools.product(TRUTHS, MEMORIES):
        yield KnownLaw(
            truth, options.primary, memory, max(1, work.size.coverage_runs // 4), options.simulated_rows,
            options.simulated_noise, work.seed,
        )  # fmt: skip
