"""Paper 1's twin of lives on FEMTO's runs, on made ones in FEMTO's layout: what it may know, twins, tables, figure."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from papers.extra.femto_lives import jobs as femto_lives
from papers.extra.femto_lives.study import AS_PRINTED, CLOSED, NAMED, STUDY, errors, lives, summary, twin_of
from papers.framework import Work
from papers.paper1_rul_varying_speed.cases import Case
from papers.paper1_rul_varying_speed.job import Added, train_and_judge
from papers.paper1_rul_varying_speed.lives.options import CONFIG, Options, read_options
from tests.papers import test_paper1_femto
from twingap.config import to_toml
from twingap.data import load
from twingap.errors import TwingapError
from twingap.records import RecordSet

root = test_paper1_femto.root
RUN = "Bearing1_1"
TINY = femto_lives.Size((RUN,), 1, 4, 40, (2.0, 10.0))


def run(size: femto_lives.Size, out: Path, root: Path, draw: bool = True) -> Work:
    """The study with one profile."""
    config = out / "femto_lives.toml"
    config.write_text(to_toml({"lives": str(CONFIG), "profiles": {"smoke": vars(size)}}), encoding="utf-8")
    return STUDY.run("smoke", out=out, root=root, backend="sequential", config=config, draw=draw)


@pytest.fixture(scope="module")
def records(root: Path) -> RecordSet:
    return load("femto", root)


@pytest.fixture(scope="module")
def options() -> Options:
    return read_options(CONFIG)


@pytest.fixture(scope="module")
def case(records: RecordSet, options: Options) -> Case:
    return femto_lives.read_case(records, RUN, 2.0, options)


@pytest.mark.parametrize("later_peaks", [77.0, 0.01])
def test_the_twin_knows_no_row_after_now_and_the_judge_the_time_to_the_last(
    case: Case, records: RecordSet, options: Options, monkeypatch: pytest.MonkeyPatch, later_peaks: float
) -> None:
    twin, rows = case.known.twin, test_paper1_femto.RUNS[RUN]
    assert 0.6 * rows <= twin.onset_row <= 0.75 * rows and twin.now_row == twin.anomaly.alarm_row + 12
    assert case.known.real.position.max() == twin.now_row - twin.onset_row < case.judged.position.max()
    np.testing.assert_allclose(case.true_min, np.arange(rows - 2 - twin.onset_row, -1, -1) / 6)
    real = femto_lives.read_run

    def spoilt(own: RecordSet) -> object:
        run = real(own)
        later = np.arange(run.time_s.size) > twin.now_row
        return dataclasses.replace(run, peak_to_peak=np.where(later, later_peaks, run.peak_to_peak))

    monkeypatch.setattr(femto_lives, "read_run", spoilt)
    other = femto_lives.read_case(records, RUN, 2.0, options).known.twin
    assert other.damage == twin.damage and other.now_row == twin.now_row
    for one, two in zip(other.lives, twin.lives, strict=True):
        np.testing.assert_array_equal(one.remaining_revolutions, two.remaining_revolutions)


def test_a_run_that_ends_before_the_wait_is_over_is_refused(records: RecordSet, options: Options) -> None:
    with pytest.raises(TwingapError, match=r"Bearing1_1.*ends within 10 min of the alarm"):
        femto_lives.read_case(records, RUN, 10.0, options)


def test_trainings_differ_in_twin_and_model_alone(case: Case, options: Options) -> None:
    hum = Added((("mains_interference", (("level", 1.0),)),), 0.3)
    jobs = list(femto_lives.trainings_of(case, options, hum, TINY))
    assert [(twin_of(j), j.model) for j in jobs] == [
        (twin, model) for twin in (AS_PRINTED, NAMED, CLOSED) for model in femto_lives.MODELS
    ]
    assert len(list(femto_lives.trainings_of(case, options, None, TINY))) == 4
    for job in jobs[1::2]:
        assert np.isfinite(train_and_judge(job, case)["rmse_min"]).all()


def test_the_summary_compares_each_twin_with_the_printed_one() -> None:
    rows = [
        {"data": "FEMTO", "bearing": b, "wait_min": 2.0, "twin": twin, "model": "CNN", "seed": s, "rmse_min": v,
         "oracle_min": v}
        for b, twin, v in (("A", AS_PRINTED, 4.0), ("B", AS_PRINTED, 8.0), ("B", NAMED, 2.0), ("A", CLOSED, 6.0),
                           ("B", CLOSED, 12.0))
        for s in (0, 1)
    ]  # fmt: skip
    named, closed = summary(pd.DataFrame(rows)).to_dict("records")
    assert (named["twin"], named["ratio"], named["runs_better"]) == (NAMED, 0.5, 1)
    assert (closed["twin"], closed["ratio"], closed["runs_better"], closed["runs"]) == (CLOSED, 1.5, 0, 2)


def test_the_study_writes_its_tables_and_goes_on_from_its_store(root: Path, tmp_path: Path) -> None:
    first = run(TINY, tmp_path, root)
    runs, every = first.tables["femto_lives"], first.tables["femto_lives_rmse"]
    assert list(runs["wait_min"]) == [2.0, 10.0] and "10 min" in runs["refused"].iloc[1]
    assert runs["verdict"].notna().tolist() == [True, False]
    assert {AS_PRINTED, CLOSED} <= set(every["twin"]) and (every["oracle_min"] <= every["rmse_min"]).all()
    for name in first.tables:
        assert len(pd.read_csv(tmp_path / "tables" / f"{name}.csv")) == len(first.tables[name])
    assert (tmp_path / "figures" / "femto_lives.png").stat().st_size > 10_000
    again = run(TINY, tmp_path, root, draw=False)
    assert first.computed and not again.computed
    for name, table in first.tables.items():
        pd.testing.assert_frame_equal(table, again.tables[name])


def test_no_run_that_can_be_predicted_is_told(root: Path, tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="ends within 10 min"):
        run(dataclasses.replace(TINY, waits_min=(10.0,)), tmp_path, root)


def test_the_figure_has_a_panel_per_wait_and_model_and_a_mark_per_run() -> None:
    rows = [
        {"bearing": b, "wait_min": w, "twin": t, "model": m, "seed": s, "rmse_min": 1.0 + s}
        for b in ("Bearing1_1", "Bearing2_1") for w in (10.0, 2.0) for t in (AS_PRINTED, NAMED, CLOSED)
        for m in ("CNN", "Proposed model 3") for s in (0, 1)
    ]  # fmt: skip
    runs = [
        {"bearing": b, "wait_min": w, "lives_rmse_min": v}
        for b, w, v in (("Bearing1_1", 10.0, 3.0), ("Bearing2_1", 10.0, np.nan), ("Bearing1_1", 2.0, 3.0),
                        ("Bearing2_1", 2.0, 5.0))
    ]  # fmt: skip
    panels = lives(pd.DataFrame(rows), pd.DataFrame(runs)).axes
    assert len(panels) == 4
    assert [len(axes.get_lines()[0].get_ydata()) for axes in panels] == [1, 1, 2, 2]
    assert list(panels[2].get_lines()[0].get_ydata()) == [1.5, 1.5]
    assert list(panels[2].get_lines()[3].get_ydata()) == [3, 5]
    assert errors({"trained": []}).empty
