"""The PHM 2012 score against hand values, and the study of it on made runs in FEMTO's layout."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from papers.extra.femto.jobs import Features
from papers.extra.femto_score import jobs
from papers.extra.femto_score.jobs import best_point, best_share, within
from papers.extra.femto_score.study import STUDY
from papers.paper1_rul_varying_speed.methods.metrics import phm2012_accuracy
from twingap.prognosis.online import OnlineLife

ROWS = {"Bearing1_1": 150, "Bearing1_2": 130, "Bearing2_1": 140, "Bearing2_2": 125, "Bearing3_1": 135}


def test_score_against_hand_values() -> None:
    """Half for 5 % late or 20 % early, and never above 1."""
    predicted = np.array([100.0, 105.0, 80.0, 110.0, 0.0, 60.0])
    expected = [1, 0.5, 0.5, 0.25, 0.5**5, 0.25]
    np.testing.assert_allclose(phm2012_accuracy(np.full(6, 100.0), predicted), expected)


def test_the_best_point_is_early() -> None:
    lives = np.exp(np.random.default_rng(0).normal(5, 0.3, 400))
    tried = np.linspace(lives.min(), lives.max(), 300)
    best = max(phm2012_accuracy(lives, np.full(lives.size, v)).mean() for v in tried)
    point = best_point(lives)
    assert point < np.median(lives)
    assert phm2012_accuracy(lives, np.full(lives.size, point)).mean() == pytest.approx(best, abs=0.01)
    assert best_share([0.25] * 3) == pytest.approx(0.25)


def test_a_band_of_cuts_bounds_what_remains() -> None:
    lives = np.array([1.0, 10.0, 40.0, 70.0])
    np.testing.assert_array_equal(within(lives, 100.0, (0.6, 0.95)), [10.0, 40.0])
    assert within(np.array([1.0]), 100.0, (0.6, 0.95)) == pytest.approx(100 / 0.95 - 100)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five short runs whose amplitude grows from three fifths of life on."""
    folder = tmp_path_factory.mktemp("data")
    (folder / "femto").mkdir()
    rng = np.random.default_rng(0)
    for name, rows in ROWS.items():
        level = np.exp(np.maximum(np.arange(rows) - 0.6 * rows, 0) * 2.5 / (0.4 * rows))
        x = (level[:, None] * rng.normal(size=(rows, 2560))).astype(np.float32)
        np.savez(folder / "femto" / f"{name}.npz", horizontal_g=x, start_time_of_day_s=10.0 * np.arange(rows))
    return folder


@pytest.mark.skipif(importlib.util.find_spec("sksurv") is None, reason="scikit-survival is not installed")
def test_every_method_has_a_number_at_every_cut(root: Path, tmp_path: Path) -> None:
    work = STUDY.run("smoke", out=tmp_path, root=root, backend="sequential", draw=False)
    every, means = work.tables["femto_score_bearings"], work.tables["femto_score"]
    assert set(means["method"]) == set(jobs.METHODS) and len(every) == len(ROWS) * len(jobs.METHODS)
    assert (every["no_number"] == 0).all() and every["score"].between(0, 1).all()
    by_method = means.set_index("method")["score_band_known"]
    assert by_method[jobs.OURS] > by_method[jobs.SHARE]
    # As the estimator itself gives it, row by row.
    name, runs, cuts = "Bearing2_1", work["runs"], work["cuts"]
    others = {n: other for n, other in runs.items() if n != name}
    life = OnlineLife(prior=jobs.prior_of(runs[name], others, work["grown"], "peak to peak"))
    found = {r.job.method: r.value for r in work["predict"] if r.job.bearing == name}[jobs.OURS]
    for row, value in enumerate(runs[name].indicators[: cuts[name][-1] + 1, 0]):
        life.take(10.0 * row, runs[name].speed_rpm, float(value))
        if row in cuts[name]:
            expected = found["quantiles"][cuts[name].index(row)]
            np.testing.assert_allclose(life.quantiles(jobs.SHARES), expected, rtol=1e-6)


def test_the_end_of_the_run_that_is_predicted_changes_nothing(root: Path) -> None:
    name, cut = "Bearing1_1", 100
    runs = {n: jobs.Run(*jobs.measure(Features(n), root=root).values()) for n in ("Bearing1_1", "Bearing2_1")}
    louder = runs[name].indicators.copy()
    louder[cut + 1 :] *= 3
    changed = runs | {name: jobs.Run(louder, *(getattr(runs[name], k) for k in ("step_s", "speed_rpm", "load_n")))}
    at = [jobs.follow(jobs.Growth(name, "peak to peak", (cut,)), runs=r)["at"] for r in (runs, changed)]
    assert at[0] == at[1]
    np.testing.assert_array_equal(*(jobs.covariates(r[name], [cut]) for r in (runs, changed)))
