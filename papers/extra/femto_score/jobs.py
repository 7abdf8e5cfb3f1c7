"""Predictions at cuts of the FEMTO runs, each from the five other runs, by `twingap rul` and its rivals.

snapshots --five indicators--> runs --OnlineLife--> growth at cuts and along the run ---+
lives and loads of the other runs ------------------------------------------------------+--> quantiles at each cut
indicators at cuts of the other runs --forests, Cox-------------------------------------+

Nothing of the bearing that is predicted enters its prediction but its rows up to the cut, and its load. Forests and Cox
are trained at cuts of the other runs in the same band of life, so they know where cuts lie. `twingap rul` does not.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from papers.arrays import Array
from papers.extra.femto import rivals
from papers.extra.femto.jobs import Features, Prediction, at_least
from papers.framework import Inputs, Work
from papers.paper1_rul_varying_speed.methods.metrics import phm2012_accuracy
from twingap.data import load
from twingap.prognosis.life_law import law_of, log_normal
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import LOAD_EXPONENT, Outcome, prior_from
from twingap.prognosis.past_errors import PastIntervals
from twingap.prognosis.prior import Prior, quantiles_of
from twingap.provenance import digest_of_value
from twingap.signal.envelope import envelope

_TRIED: Final = np.linspace(0.02, 1.0, 99)  # shares of the life so far that are tried


def best_point(lives: Array) -> float:
    """Prediction with the highest expected score, among equally likely remaining lives [n]."""
    kept = lives[lives > 0]
    if not kept.size:
        return 0.0
    return float(kept[int(np.argmax([phm2012_accuracy(kept, np.full(kept.size, value)).mean() for value in kept]))])


def best_share(ratios: Sequence[float]) -> float:
    """Share of the life so far with the highest mean score, where remaining over past life has these ratios."""
    true = np.asarray(ratios)
    return float(max(_TRIED, key=lambda share: phm2012_accuracy(true, np.full(true.size, share)).mean()))


def within(lives: Array, lived: float, band: tuple[float, float]) -> Array:
    """Remaining lives [n] whose cut lies in a band of life; the closest that does where none is."""
    low, high = lived * (1 / band[1] - 1), lived * (1 / band[0] - 1)
    kept = lives[(lives >= low) & (lives <= high)]
    return kept if kept.size else np.clip([np.median(lives)], low, high)


SHARES: Final = tuple(float(v) for v in (np.arange(40) + 0.5) / 40)
"""Quantiles by which a prediction's law is kept."""
INDICATORS: Final = ("peak to peak", "rms", "envelope", "strongest band", "spectral distance")
METHODS: Final = (
    "twingap rul --prior", "twingap rul, indicator chosen", "lives of other runs", "lives, loads ignored",
    "constant life", "constant share of the life so far", "exponential", "particle filter", "random forest",
    "survival forest", "Cox",
)  # fmt: skip
OURS, CHOSEN, LIVES, UNLOADED, CONSTANT, SHARE, EXPONENTIAL, FILTER, FOREST, SURVIVAL, COX = METHODS
DRAWN: Final = (FILTER, FOREST, SURVIVAL)
TRAINED_AT: Final = 36  # cuts of each other run by which rivals are trained
_HEALTHY: Final = 60
_BANDS: Final = 64


@dataclass(frozen=True)
class Size:
    cuts: int
    seeds: int


@dataclass(frozen=True)
class Options:
    band: tuple[float, float]
    test: dict[str, tuple[int, int]]
    profiles: dict[str, Size]


@dataclass(frozen=True)
class Growth:
    """Which run is followed by which indicator, with how many cuts."""

    bearing: str
    indicator: str
    cuts: tuple[int, ...]


@dataclass(frozen=True)
class Run:
    """Indicators [rows, INDICATORS] of a run, seconds between rows, speed and load; its first row is at time 0."""

    indicators: Array
    step_s: float
    speed_rpm: float
    load_n: float

    @property
    def last(self) -> int:
        """Row of the last snapshot, which ends the run."""
        return len(self.indicators) - 1

    @property
    def life_s(self) -> float:
        return self.step_s * self.last

    @property
    def life(self) -> float:
        """Life in revolutions."""
        return self.life_s * self.speed_rpm / 60

    @property
    def per_row(self) -> float:
        """Revolutions from row to row."""
        return self.life / self.last

    def followed(self, indicator: int = 0, rows: int | None = None) -> Iterator[tuple[int, OnlineLife]]:
        """Each of the first rows, and the online estimator that has taken it."""
        life = OnlineLife()
        for row, value in enumerate(self.indicators[:rows, indicator]):
            life.take(row * self.step_s, self.speed_rpm, float(value))
            yield row, life


def measure(job: Features, *, root: str | Path | None) -> dict[str, Any]:
    """Five positive indicators of every snapshot of a run. Spectral distance is the exponential of the root mean
    square, over 64 bands, of log amplitude relative to the first rows; the strongest band is the largest of these
    ratios over eight bands."""
    records = load("femto", root).select(lambda c: c.group == job.bearing)
    rows, levels = [], []
    for record in records:
        x = record.samples - record.samples.mean()
        power = np.abs(np.fft.rfft(x)[1:]) ** 2
        levels.append(0.5 * np.log(power.reshape(_BANDS, -1).sum(axis=1)))
        rows.append((np.ptp(x), x.std(), envelope(x, record.condition.fs_hz, (4000.0, 12000.0)).std()))
    bands = np.array(levels)
    ratio = bands - np.median(bands[:_HEALTHY], axis=0)
    eight = 0.5 * np.log(np.exp(2 * bands).reshape(len(bands), 8, -1).sum(axis=2))
    strongest = np.exp((eight - np.median(eight[:_HEALTHY], axis=0)).max(axis=1))
    distance = np.exp(np.sqrt((ratio**2).mean(axis=1)))
    first, second = records.conditions[:2]
    assert first.time_s is not None and second.time_s is not None
    return {
        "indicators": np.column_stack((np.array(rows), strongest, distance)), "step_s": second.time_s - first.time_s,
        "speed_rpm": first.speed_rpm, "load_n": first.load_n,
    }  # fmt: skip


def follow(job: Growth, *, runs: dict[str, Run]) -> dict[str, Any]:
    """A run by growth alone, in revolutions: `at` each cut (since the onset, per row, 5 %, 50 %, 95 %) or None without
    an anomaly; `along` the run rows (lived, since the onset, 5 %, 50 %, 95 %); rows of alarm and onset; life after
    it."""
    run = runs[job.bearing]
    at, along = {}, []
    every = max(len(run.indicators) // 60, 1)
    for row, life in run.followed(INDICATORS.index(job.indicator)):
        if row not in job.cuts and row % every:
            continue
        found = None
        if life.alarm_row is not None and not life.timeless:
            since = life.revolutions - life.revolutions_at_onset
            found = (since, run.per_row, *life.quantiles())
            if row % every == 0 and row < run.last:
                along.append((life.revolutions, since, *life.quantiles()))
        if row in job.cuts:
            at[row] = found
    onset = life.revolutions_at_onset
    kept = [row for row in along if life.onset_row is not None and row[0] >= onset]
    return {
        "at": [at[row] for row in job.cuts], "along": kept, "alarm": life.alarm_row, "onset": life.onset_row,
        "after": None if life.onset_row is None else life.revolutions - onset,
    }  # fmt: skip


def outcome(name: str, run: Run, grown: dict[str, Any]) -> Outcome:
    """What a run that ended says of others."""
    rows, past = np.array(grown["along"], float), None
    if rows.size:
        past = PastIntervals(rows[:, 2:], rows[:, 0], rows[:, 1], run.life - rows[:, 0], run.per_row).thinned()
    return Outcome(name, run.life, grown["after"], None, past, load_n=run.load_n)


def joined(run: Run, cuts: Sequence[int], grown: dict[str, Any], prior: Prior) -> Array:
    """Quantiles [cuts, SHARES] of remaining revolutions as `OnlineLife` with a prior gives them."""
    found = []
    for row, at in zip(cuts, grown["at"], strict=True):
        if at is None:
            found.append(prior.before(row * run.per_row, SHARES))
        elif at[4] == 0:  # the end level is reached
            found.append((0.0,) * len(SHARES))
        else:
            found.append(prior.joined(tuple(at[2:]), row * run.per_row, at[0], at[1], SHARES))
    return np.array(found)


def predict(
    job: Prediction, *, runs: dict[str, Run], cuts: dict[str, list[int]], grown: dict[tuple[str, str], dict[str, Any]],
    band: tuple[float, float],
) -> dict[str, Any]:  # fmt: skip
    """Remaining revolutions of a run at its cuts, from the other runs: `point` [cuts], `quantiles` [cuts, SHARES] (all
    equal where a method gives no law) and `indicator`."""
    run, own = runs[job.bearing], cuts[job.bearing]
    others = {name: other for name, other in runs.items() if name != job.bearing}
    lived = np.array(own) * run.life / run.last
    indicator = INDICATORS[0]
    law, point = None, None
    if job.method in (OURS, CHOSEN):
        if job.method == CHOSEN:
            indicator = choose(others, cuts, grown)
        law = joined(run, own, grown[job.bearing, indicator], prior_of(run, others, grown, indicator))
    elif job.method in (LIVES, UNLOADED, CONSTANT):
        of_lives = law_by(job.method, [(other.life, other.load_n) for other in others.values()], run.load_n)
        law = np.array([of_lives.remaining(u, SHARES) for u in lived])
        if job.method == CONSTANT:
            point = np.maximum(np.exp(np.mean([np.log(other.life) for other in others.values()])) - lived, 0.0)
    elif job.method == SHARE:
        point = lived * best_share([(1 - at) / at for at in np.linspace(*band, TRAINED_AT)])
    elif job.method in (EXPONENTIAL, FILTER):
        point, law = _by_growth(job, run, others, own)
    else:
        law = lived[:, None] * _learnt(job, run, others, own, band)
    if law is None:
        assert point is not None
        law = np.repeat(point[:, None], len(SHARES), axis=1)
    return {"point": np.median(law, axis=1) if point is None else point, "quantiles": law, "indicator": indicator}


def law_by(method: str, ended: Iterable[tuple[float, float]], load_n: float) -> Any:
    """Law of life by a method that needs no vibration, from lives and loads of runs that ended."""
    exponent = LOAD_EXPONENT if method == LIVES else 0.0
    return (log_normal if method == CONSTANT else law_of)(
        [life * (own_n / load_n) ** exponent for life, own_n in ended]
    )


def prior_of(run: Run, others: dict[str, Run], grown: dict[tuple[str, str], dict[str, Any]], indicator: str) -> Prior:
    return prior_from([outcome(n, other, grown[n, indicator]) for n, other in others.items()], run.load_n)


def choose(runs: dict[str, Run], cuts: dict[str, list[int]], grown: dict[tuple[str, str], dict[str, Any]]) -> str:
    """Indicator with the smallest error of log life at cuts, each run predicted from the others of these runs."""

    def error(indicator: str) -> float:
        each = []
        for name, run in runs.items():
            rest = {n: other for n, other in runs.items() if n != name}
            law = joined(run, cuts[name], grown[name, indicator], prior_of(run, rest, grown, indicator))
            left = run.life - np.array(cuts[name]) * run.per_row
            each.append(np.mean(np.abs(np.log((np.median(law, axis=1) + run.per_row) / (left + run.per_row)))))
        return float(np.mean(each))

    return min(INDICATORS, key=error)


def _by_growth(job: Prediction, run: Run, others: dict[str, Run], cuts: list[int]) -> tuple[Array, Array | None]:
    """A rival that follows peak to peak from the onset on; before the alarm, what is left of a usual life."""
    usual = float(np.exp(np.mean([np.log(other.life) for other in others.values()])))
    ended = [list(other.followed())[-1][1] for other in others.values()]
    after = [life.revolutions - life.revolutions_at_onset for life in ended if life.onset_row is not None]
    usual_after = float(np.exp(np.mean(np.log(after)))) if after else usual
    seen = {}
    for row, life in run.followed(rows=cuts[-1] + 1):
        if row in cuts and life.alarm_row is not None and life.onset_row is not None:
            rows, turns, logs = life.amplitudes
            first = int(np.searchsorted(rows, life.onset_row))
            seen[row] = rivals.Growth(
                turns[first:] - turns[first], logs[first:], life.scatter, len(turns) - first - 1, life.end_level,
                usual_after,
            )  # fmt: skip
    bounds = {row: (max(usual - row * run.per_row, 0.0),) * 3 for row in cuts if row not in seen}
    if job.method == EXPONENTIAL:
        bounds |= {row: (float(rivals.exponential_extrapolation(g)[-1]),) * 3 for row, g in seen.items()}
    else:
        bounds |= _filtered(seen, job.seed)
    each = [bounds[row] for row in cuts]
    law = [quantiles_of((low, middle, high), run.per_row / 2, SHARES) for middle, low, high in each]
    return np.array([middle for middle, _, _ in each]), None if job.method == EXPONENTIAL else np.array(law)


def _filtered(seen: dict[int, rivals.Growth], seed: int) -> dict[int, tuple[float, float, float]]:
    """Median and interval of the particle filter at cuts; those of one anomaly share a filter."""
    anomalies: dict[tuple[float, ...], list[int]] = {}
    for row, growth in seen.items():
        anomalies.setdefault(tuple(growth.log_amplitude[:3]), []).append(row)
    found = {}
    for rows in anomalies.values():
        places = [seen[row].first for row in rows]
        whole = dataclasses.replace(seen[rows[-1]], first=min(places))
        every = np.column_stack(rivals.particle_filter(whole, np.random.default_rng([seed, 7])))
        for row, (middle, low, high) in zip(rows, every[places], strict=True):
            found[row] = (float(middle), float(min(low, middle)), float(max(high, middle)))
    return found


def covariates(run: Run, cuts: Sequence[int]) -> Array:
    """Covariates [cuts, 2 INDICATORS + 1] from rows up to each cut: logarithms of indicators relative to the first
    rows and to the rows just before, and of revolutions at the load."""
    logs = np.log(np.maximum(run.indicators, 1e-12))
    base = np.median(logs[:_HEALTHY], axis=0)
    found = []
    for cut in cuts:
        now = np.median(logs[cut + 1 - max(cut // 33, 10) : cut + 1], axis=0)
        before = np.median(logs[int(0.8 * cut) : int(0.95 * cut)], axis=0)
        age = np.log(max(cut, 1) * run.per_row * (run.load_n / 4000) ** LOAD_EXPONENT)
        found.append([*(now - base), *(now - before), age])
    return np.array(found)


def _learnt(job: Prediction, run: Run, others: dict[str, Run], cuts: list[int], band: tuple[float, float]) -> Array:
    """Quantiles [cuts, SHARES] of remaining over past life by a method that is trained at cuts of the other runs."""
    x, y = [], []
    for other in others.values():
        at = [round(share * other.last) for share in np.linspace(*band, TRAINED_AT)]
        x.append(covariates(other, at))
        y.append([(other.last - row) / row for row in at])
    train, target, own = np.concatenate(x), np.concatenate(y), covariates(run, cuts)
    mean, std = train.mean(axis=0), np.maximum(train.std(axis=0), 1e-9)
    train, own = (train - mean) / std, (own - mean) / std
    if job.method == FOREST:
        logs = [(part, np.log(values)) for part, values in zip(np.split(train, len(others)), y, strict=True)]
        middle, low, high = (np.exp(v) for v in rivals.random_forest(logs, own, job.seed))
        return np.array([quantiles_of(bounds, 0.0, SHARES) for bounds in zip(low, middle, high, strict=True)])
    from sksurv.ensemble import RandomSurvivalForest
    from sksurv.linear_model import CoxPHSurvivalAnalysis

    events = np.array([(True, value) for value in target], dtype=[("event", bool), ("time", float)])
    if job.method == COX:
        model = CoxPHSurvivalAnalysis(alpha=10.0)
    else:
        model = RandomSurvivalForest(200, min_samples_leaf=15, random_state=job.seed, n_jobs=1)
    model.fit(train, events)
    times = np.asarray(model.unique_times_)
    alive = np.asarray(model.predict_survival_function(own, return_array=True))
    places = [np.searchsorted(1 - curve, SHARES).clip(max=times.size - 1) for curve in alive]
    return np.array([times[place] for place in places])


def bearings(work: Work) -> list[Features]:
    return at_least(load("femto", work.root).groups, 5)


def measured(work: Work) -> dict[str, Run]:
    names = ("step_s", "speed_rpm", "load_n")
    values = {r.job.bearing: r.value for r in work["measure"]}
    return {n: Run(np.asarray(v["indicators"]), *(float(v[k]) for k in names)) for n, v in values.items()}


def cuts_of(work: Work) -> dict[str, list[int]]:
    """Rows at which each run is cut, in increasing order."""
    low, high = work.options.band
    found = {}
    for place, (name, run) in enumerate(work["runs"].items()):
        drawn = np.random.default_rng([work.seed, place]).uniform(low, high, work.size.cuts)
        found[name] = sorted(round(share * run.last) for share in drawn)
    return found


def growths(work: Work) -> Iterator[Growth]:
    for name, indicator in itertools.product(work["runs"], INDICATORS):
        yield Growth(name, indicator, tuple(work["cuts"][name]))


def predictions(work: Work) -> Iterator[Prediction]:
    """Every run by every method, those that draw lots with several seeds."""
    for name, method in itertools.product(work["runs"], METHODS):
        for seed in range(work.seed, work.seed + (work.size.seeds if method in DRAWN else 1)):
            yield Prediction(name, method, seed)


def of_growth(work: Work) -> Inputs:
    """All runs, their cuts and their growth."""
    plain = {"cuts": work["cuts"], "band": work.options.band}
    made = {"runs": work.keyed("runs", "measure"), "grown": work.keyed("grown", "follow")}
    return made | {name: (value, digest_of_value(value)) for name, value in plain.items()}
