"""Health indicators of every run: candidates, their criteria, and the choice that other runs make for it."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from papers.arrays import Array
from papers.paper2_digital_twin.degradation.runs import StudyRun
from twingap.prognosis import health_indicator as health
from twingap.prognosis.indicator_criteria import IndicatorCriteria

NINE: Final = "fusion 9"
OFFLINE: Final = "fusion 9, whole run"
"""The paper's reading: normalised and fused with the whole run known, so each value depends on later records."""
KEPT: Final = "fusion 9, whole run, silent records kept"
CHOSEN: Final = "chosen on other runs"
HINDSIGHT: Final = "own end, known in hindsight"
OTHERS: Final = "median end of other runs"
INDICATORS: Final = ("rms", CHOSEN, NINE, OFFLINE, KEPT)
END_ROWS: Final = 5  # records whose mean is the level at a run's end


@dataclass(frozen=True)
class Judged:
    """A run with its candidates."""

    run: StudyRun
    online: health.Indicators
    criteria: dict[str, IndicatorCriteria]  # of the online candidates
    choice: str | None  # candidate of highest suitability on other runs; None where there are no others
    series: dict[str, Array]  # the indicators that curves are fitted to, by name
    times: dict[str, Array]  # their running time, s


def judge_all(runs: Sequence[StudyRun], indicators: Sequence[str] = INDICATORS) -> list[Judged]:
    """Candidates and criteria of every run, the choice that the others of its family make for it, and those of the
    indicators that it has."""
    online = [health.online_indicators(r.run, r.healthy_rows) for r in runs]
    criteria = [
        health.evaluate_candidates(i, r.run.time_s, healthy_rows=r.healthy_rows, window=r.trend_rows)
        for r, i in zip(runs, online, strict=True)
    ]
    found = []
    for k, (r, made) in enumerate(zip(runs, online, strict=True)):
        others = [c for n, c in enumerate(criteria) if n != k and runs[n].family == r.family]
        choice = health.chosen(others) if others else None
        if choice is not None and choice not in made.values:  # test 3 of IMS has fewer features
            choice = health.chosen([{name: c[name] for name in c if name in made.values} for c in others])
        there = {
            "rms": made.values["rms"], CHOSEN: made.values.get(choice or ""), NINE: made.values.get(NINE),
            OFFLINE: health.offline_indicators(r.run).values.get(NINE),
        }  # fmt: skip
        if r.whole.time_s.size > r.run.time_s.size:
            there[KEPT] = health.offline_indicators(r.whole).values.get(NINE)
        series = {name: x for name, x in there.items() if x is not None and name in indicators}
        times = {name: (r.whole if name == KEPT else r.run).time_s for name in series}
        found.append(Judged(r, made, criteria[k], choice, series, times))
    return found


def end_level(values: Array) -> float:
    return float(np.mean(values[-END_ROWS:]))


def limits_of(j: Judged, name: str, found: Sequence[Judged]) -> dict[str, float]:
    """Levels at which life is taken to end: a run's own end, known in hindsight, and the median of other runs' ends,
    for plain features alone, since the axes of fused ones differ from run to run."""
    limits = {HINDSIGHT: end_level(j.series[name])}
    feature = j.choice if name == CHOSEN else name
    others = [o for o in found if o is not j and o.run.family == j.run.family]
    if feature in j.run.run.names and others and all(feature in o.online.values for o in others):
        limits[OTHERS] = float(np.median([end_level(o.online.values[feature]) for o in others]))
    return limits


def digest_of(series: Mapping[str, tuple[Array, Array]]) -> str:
    """Hex sha256 of named series."""
    total = hashlib.sha256()
    for name, (t, x) in series.items():
        total.update(name.encode())
        total.update(np.ascontiguousarray(t, "<f8").tobytes())
        total.update(np.ascontiguousarray(x, "<f8").tobytes())
    return total.hexdigest()
