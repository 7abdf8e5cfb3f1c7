"""Degradation study: which indicator, which curve, and the remaining life that each predicts.

runs to failure --> features --> candidates (healthy start) --> criteria --> chosen on other runs; fusion feature 9
indicator of a run --job--> eight curves: criteria, errors on records after each tenth of life, remaining life
simulated runs of known curves --job--> how often the intervals hold

Used in: Paper 2, section 4 and figures 13 to 19. Run as part of the paper, or alone:
python -m papers.paper2_digital_twin.degradation --profile full --out DIR
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from papers.paper2_digital_twin import degradation_jobs as jobs_module
from papers.paper2_digital_twin.degradation_jobs import TRUTHS, Analysis, Coverage, analyse, cover
from papers.paper2_digital_twin.degradation_runs import Reading, StudyRun, study_runs
from papers.paper2_digital_twin.degradation_study import (
    CHOSEN,
    CONFIG,
    HINDSIGHT,
    INDICATORS,
    KEPT,
    NINE,
    OFFLINE,
    OTHERS,
    Judged,
    Study,
    read_study,
)
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.prognosis import degradation_forecast, degradation_models, information
from twingap.prognosis.health_indicator import chosen, evaluate_candidates, offline_indicators, online_indicators
from twingap.provenance import digest_of_code
from twingap.sweep import Result, sweep

if TYPE_CHECKING:
    from twingap.track import Run as Log

Array = NDArray[np.float64]
END_ROWS: Final = 5
"""Records whose mean is the level at a run's end."""


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Log | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> Study:
    """Run the study; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without IMS and FEMTO simulated runs are taken, and every table says so.
    seed : int
        Of the draws behind intervals and of the simulated runs on which they are checked.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figures go there as well.
    progress : callable
    config : Path
    draw : bool
        Make the figures.
    """
    options = read_study(config)
    sizes = profile_of(options.profiles, profile, config)
    names = sorted(options.runs_ims, key=lambda n: f"IMS {n}" != options.paper_run)[: sizes.ims]
    step = Count("degradation", sizes.ims + sizes.femto, progress)
    reading = Reading(
        options.healthy_rows_ims, options.healthy_rows_femto, options.trend_rows_ims, options.trend_rows_femto,
        options.silent_share, options.window_samples,
    )  # fmt: skip
    store = out / "results"
    data, runs = study_runs(
        sorted(names), list(options.runs_femto[: sizes.femto]), reading, root, store=store, backend=backend,
        address=address, on_result=step,
    )  # fmt: skip
    found = judge_all(runs, options.indicators)
    analyses = [
        Analysis(
            j.run.name, name, _limits(j, name, found), _healthy(j, name), sizes.curves, options.interval_level, seed
        )
        for j in found
        for name in j.series
    ]
    checks = [
        Coverage(
            truth, model, memory, share, sizes.coverage_runs, options.simulated_rows, min(sizes.curves, 100),
            options.simulated_noise, options.interval_level, seed,
        )
        for truth, model in [(name, name) for name in TRUTHS] + [tuple(options.primary), tuple(options.primary[::-1])]
        for memory in (0.0, 0.7)
        for share in (0.5, 0.7, 0.9)
    ]  # fmt: skip
    step.total = step.done + len(analyses) + len(checks)
    series = {f"{j.run.name}/{name}": (j.times[name], x) for j in found for name, x in j.series.items()}
    code = digest_of_code(jobs_module, degradation_models, degradation_forecast, information)
    swept = functools.partial(sweep, store=store, backend=backend, address=address, version=code, on_result=step)
    analysed: list[Result[Analysis]] = swept(
        functools.partial(analyse, series=series), analyses, data={"series": _digest(series)}
    )
    covered: list[Result[Coverage]] = swept(cover, checks)
    from papers.paper2_digital_twin import degradation_tables as tables

    study = Study(data, options, found, analysed, covered, {})
    study.tables.update(tables.all_tables(study))
    keep_tables(study.tables, out, log, data)
    if draw:
        from papers.paper2_digital_twin import degradation_figures as figures

        keep_figures(figures.all_figures(study), out, log)
    return study


def judge_all(runs: Sequence[StudyRun], indicators: Sequence[str] = INDICATORS) -> list[Judged]:
    """Candidates and criteria of every run, the choice that the others of its family make for it, and those of the
    indicators that it has."""
    online = [online_indicators(r.run, r.healthy_rows) for r in runs]
    criteria = [
        evaluate_candidates(i, r.run.time_s, healthy_rows=r.healthy_rows, window=r.trend_rows)
        for r, i in zip(runs, online, strict=True)
    ]
    found = []
    for k, (r, made) in enumerate(zip(runs, online, strict=True)):
        others = [c for n, c in enumerate(criteria) if n != k and runs[n].family == r.family]
        choice = chosen(others) if others else None
        if choice is not None and choice not in made.values:  # test 3 of IMS has fewer features
            shared = [{name: c[name] for name in c if name in made.values} for c in others]
            choice = chosen(shared)
        series, times = {"rms": made.values["rms"]}, {"rms": r.run.time_s}
        if choice is not None:
            series[CHOSEN] = made.values[choice]
        if NINE in made.values:
            series[NINE] = made.values[NINE]
        offline = offline_indicators(r.run).values
        if NINE in offline:
            series[OFFLINE] = offline[NINE]
        times |= dict.fromkeys(series, r.run.time_s)
        if r.whole.time_s.size > r.run.time_s.size:
            kept = offline_indicators(r.whole).values
            if NINE in kept:
                series[KEPT], times[KEPT] = kept[NINE], r.whole.time_s
        series = {name: x for name, x in series.items() if name in indicators}
        found.append(Judged(r, made, criteria[k], choice, series, times))
    return found


def end_level(values: Array) -> float:
    """Mean of the last records."""
    return float(np.mean(values[-END_ROWS:]))


def _healthy(j: Judged, name: str) -> float:
    return float(np.mean(j.series[name][: j.run.healthy_rows]))


def _limits(j: Judged, name: str, found: Sequence[Judged]) -> dict[str, float]:
    """Levels at which life is taken to end.

    A run's own end is what no one knows before; the median of other runs' ends is what a user has. The latter only for
    plain features, in healthy standard deviations: the axes of fused ones differ from run to run.
    """
    limits = {HINDSIGHT: end_level(j.series[name])}
    feature = j.choice if name == CHOSEN else name
    others = [o for o in found if o is not j and o.run.family == j.run.family]
    if feature in j.run.run.names and others and all(feature in o.online.values for o in others):
        limits[OTHERS] = float(np.median([end_level(o.online.values[feature]) for o in others]))
    return limits


def _digest(series: dict[str, tuple[Array, Array]]) -> str:
    total = hashlib.sha256()
    for name, (t, x) in series.items():
        total.update(name.encode())
        total.update(np.ascontiguousarray(t, "<f8").tobytes())
        total.update(np.ascontiguousarray(x, "<f8").tobytes())
    return total.hexdigest()


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    names = ("degradation-claims", "degradation-pairs", "degradation-lives-summary", "degradation-coverage")
    command(
        run, "Degradation curves of paper 2: tables and figures.",
        lambda study: {f"{name} ({study.data})": study.tables[name] for name in names},
        arguments, takes=("root", "seed"),
    )  # fmt: skip


if __name__ == "__main__":
    # Workers look functions up by module, and this one is called __main__ here.
    from papers.paper2_digital_twin.degradation import main as start

    start()
