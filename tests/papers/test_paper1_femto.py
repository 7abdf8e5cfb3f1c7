"""Paper 1's comparison on FEMTO runs, on made ones in FEMTO's layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from papers.extra.femto import jobs as femto
from papers.extra.femto.study import STUDY, errors, pooled
from twingap.errors import TwingapError

RUNS = {"Bearing1_1": 160, "Bearing1_2": 130, "Bearing2_1": 145}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short runs whose amplitude grows exponentially from two thirds of life on."""
    folder = tmp_path_factory.mktemp("data")
    (folder / "femto").mkdir()
    rng = np.random.default_rng(0)
    for name, rows in RUNS.items():
        level = np.exp(np.maximum(np.arange(rows) - 0.6 * rows, 0) * 2.5 / (0.4 * rows))
        x = (level[:, None] * rng.normal(size=(rows, 2560))).astype(np.float32)
        np.savez(folder / "femto" / f"{name}.npz", horizontal_g=x, start_time_of_day_s=10.0 * np.arange(rows))
    return folder


def test_tables_are_whole_and_a_second_run_takes_them_from_the_store(root: Path, tmp_path: Path) -> None:
    first = STUDY.run("smoke", out=tmp_path, root=root, backend="sequential")
    every, won = first.tables["femto"], first.tables["femto_wins"]
    assert len(every) == len(RUNS) * len(femto.METHODS)
    assert list(every["method"][:5]) == list(femto.METHODS)
    assert every["rmse_s"].notna().all() and (every["rows"] > 10).all()
    ours = every[every["method"] == femto.ALONE].set_index("bearing")
    for name, rows in RUNS.items():
        found = ours.loc[name].to_dict()
        assert 0.6 * rows <= found["alarm_row"] <= 0.8 * rows and found["rmse_s"] < 10 * rows / 4
    assert (won["of"] == 3).all()
    means = every.astype({"method": str}).groupby("method")["rmse_s"].mean()[list(femto.RIVALS)]
    named = f"best on average: {means.idxmin()}"
    assert list(won["against"][:5]) == ["best of each bearing", named, *femto.RIVALS]
    by_rmse = won[(won["metric"] == "rmse_s") & (won["method"] == femto.ALONE)].set_index("against")["bearings_won"]
    assert by_rmse[named] == by_rmse[means.idxmin()] >= by_rmse["best of each bearing"]
    again = STUDY.run("smoke", out=tmp_path, root=root, backend="sequential", draw=False)
    pd.testing.assert_frame_equal(every, again.tables["femto"])
    assert first.computed and not again.computed
    assert len(pd.read_csv(tmp_path / "tables" / "femto.csv")) == len(every)
    assert (tmp_path / "figures" / "femto.png").stat().st_size > 10_000


def test_the_bearing_left_out_enters_nothing_that_is_tuned(root: Path) -> None:
    """Its own later snapshots changed, predictions of its earlier ones, weight and priors stay to the last bit."""
    runs = {
        name: femto.Measured(*(np.asarray(found[k], float) for k in ("features", "time_s", "speed_rpm")))
        for name in RUNS
        for found in [femto.take_features(femto.Features(name), root=str(root))]
    }
    kept = 125
    left = runs["Bearing1_1"]
    cut = femto.Measured(left.features[:kept], left.time_s[:kept], left.speed_rpm[:kept])
    other = runs | {"Bearing1_1": cut}
    for method in (femto.ALONE, *femto.RIVALS):
        job = femto.Prediction("Bearing1_1", method, 0)
        whole, part = femto.predict(job, runs=runs), femto.predict(job, runs=other)
        np.testing.assert_array_equal(np.asarray(whole["predicted"])[:kept], part["predicted"])
    alone = {n: femto.predict(femto.Prediction(n, femto.ALONE, 0), runs=runs) for n in RUNS}
    short = alone | {"Bearing1_1": femto.predict(femto.Prediction("Bearing1_1", femto.ALONE, 0), runs=other)}
    whole, part = pooled("Bearing1_1", runs, alone), pooled("Bearing1_1", other, short)
    assert whole["growth_weight"] == part["growth_weight"]
    assert whole["widening"] == part["widening"] != 1.0
    for what in ("predicted", "low", "high"):
        np.testing.assert_allclose(whole[what][:kept], part[what], rtol=1e-12)


def test_too_few_runs_are_refused(root: Path, tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text('[profiles.two]\nbearings = ["Bearing1_1", "Bearing1_2"]\nseeds = 1\n', encoding="utf-8")
    with pytest.raises(TwingapError, match="3 or more"):
        STUDY.run("two", out=tmp_path, root=root, backend="sequential", config=config)


def test_data_at_hand_or_not(root: Path, tmp_path: Path) -> None:
    assert femto.at_hand(root) and not femto.at_hand(tmp_path)
    (tmp_path / "femto").mkdir()
    (tmp_path / "femto" / "Bearing1_1.npz").write_bytes(b"cut short")
    with pytest.raises(TwingapError, match="Bearing1_1"):  # there, and not to be read
        femto.at_hand(tmp_path)


def test_the_figure_shows_every_method_on_every_bearing() -> None:
    rows = [
        {"bearing": bearing, "method": method, "rmse_s": 60.0 * (place + 1)}
        for bearing in ("Bearing1_1", "Bearing2_1")
        for place, method in enumerate(femto.METHODS)
    ]
    (axes,) = errors(pd.DataFrame(rows)).axes
    drawn = {line.get_label(): np.asarray(line.get_ydata(), float).tolist() for line in axes.get_lines()}
    assert drawn == {method: [place + 1.0] * 2 for place, method in enumerate(femto.METHODS)}
