"""`twingap rul` on the virtual rig's runs: tables, the store, and that a run judged has no part in what is learnt."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from papers.extra.rig_lives import jobs
from papers.extra.rig_lives import study as tables
from papers.extra.rig_lives.jobs import Bench, Size
from papers.extra.rig_lives.study import ALONE, STUDY, TOGETHER
from twingap.config import to_toml
from twingap.rigs.smart_maintenance import END_OF_LIFE_G, RUNS, SmartMaintenanceRig, truth

Runs = dict[tuple[int, str], dict[str, np.ndarray]]
SMALL = Size((3,), ("A148", "A154", "A150"), 60.0, 0.05)


@pytest.fixture(scope="module")
def runs() -> Runs:
    asked = [Bench(3, bearing, SMALL.interval_s, SMALL.duration_s) for bearing in SMALL.bearings]
    return {(job.seed, job.bearing): jobs.amplitudes(job) for job in asked}


def test_tables_are_whole_and_a_second_run_takes_them_from_the_store(tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(to_toml({"profiles": {"smoke": vars(SMALL)}}), encoding="utf-8")
    first = STUDY.run("smoke", out=tmp_path, backend="sequential", config=config)
    every, mean = first.tables["rig_lives"], first.tables["rig_lives_means"]
    assert list(every["method"]) == [ALONE, TOGETHER] * 3 and (every["rows"] > 10).all()
    assert every["coverage"].between(0, 1).all() and (every["width"] > 0).all() and every["rmse_min"].notna().all()
    assert (mean["bearings"] == 3).all() and len(mean) == 2
    alone = every[every["method"] == ALONE]
    assert mean.loc[0, "coverage"] == pytest.approx(alone["coverage"].mean())
    assert mean.loc[0, "least_coverage"] == alone["coverage"].min()
    assert (every["onset_late_percent"] > 0).all() and (every["onset_late_percent"] < every["alarm_late_percent"]).all()
    assert mean.loc[0, "latest_alarm_percent"] == alone["alarm_late_percent"].max()
    assert mean.loc[0, "earliest_onset_percent"] == alone["onset_late_percent"].min()
    again = STUDY.run("smoke", out=tmp_path, backend="sequential", config=config)
    pd.testing.assert_frame_equal(every, again.tables["rig_lives"])
    assert first.computed == 3 and not again.computed
    assert "virtual Smart Maintenance rig (surrogate)" in (tmp_path / "tables" / "rig_lives.md").read_text()


def test_runs_end_at_the_limit_and_estimates_need_no_later_rows(runs: Runs) -> None:
    run = runs[3, "A148"]
    assert run["peak_to_peak_g"][-1] > END_OF_LIFE_G > np.median(run["peak_to_peak_g"])
    kept = run["time_s"].size - 15
    whole = tables.take(run)
    part = tables.take({name: values[:kept] for name, values in run.items()})
    np.testing.assert_array_equal(
        [e.revolutions for e in whole.estimates[:kept]], [e.revolutions for e in part.estimates]
    )


def test_half_of_what_remains_is_half_of_the_revolutions(runs: Runs) -> None:
    """At the row's own speed the time that remains jumps, and the last row above its half is none at half."""
    run = runs[3, "A148"]
    taken = tables.take(run)
    told = [row for row, e in enumerate(taken.estimates[:-1]) if e.anomaly and np.isfinite(e.revolutions)]
    left = taken.lived[-1] - taken.lived[told]
    half = told[int(np.flatnonzero(left >= left[0] / 2)[-1])]
    error = taken.estimates[half].revolutions / (taken.lived[-1] - taken.lived[half]) - 1
    assert tables.judge(taken)["alpha_lambda_half"] == float(abs(error) <= tables.ALPHA)
    spoilt = list(taken.estimates)
    for wrong in (False, True):
        spoilt[half] = dataclasses.replace(
            spoilt[half], revolutions=(3.0 if wrong else 1.0) * float(taken.lived[-1] - taken.lived[half])
        )
        judged = tables.judge(dataclasses.replace(taken, estimates=tuple(spoilt)))
        assert judged["alpha_lambda_half"] == float(not wrong)


def test_lateness_is_of_the_first_alarm_against_the_rigs_own_onset(runs: Runs) -> None:
    time_s = np.arange(0.0, 1001.0, 10.0)
    late = tables.lateness((62, 66), time_s, 600.0)
    assert late == {"onset_late_percent": pytest.approx(2.0), "alarm_late_percent": pytest.approx(6.0)}
    assert tables.lateness((55, 59), time_s, 600.0)["alarm_late_percent"] == pytest.approx(-1.0)
    assert all(np.isnan(v) for v in tables.lateness(None, time_s, 600.0).values())
    run = runs[3, "A148"]
    taken = tables.take(run)
    true = truth(SmartMaintenanceRig(SMALL.interval_s, SMALL.duration_s, bearings=("A148",)), 3)["A148"]
    assert true.onset_s == 60 * RUNS["A148"].onset_min
    row = next(row for row, e in enumerate(taken.estimates) if e.anomaly)
    expected = 100 * (run["time_s"][row] - true.onset_s) / run["time_s"][-1]
    found = tables.table({(3, "A148"): run, (3, "A154"): runs[3, "A154"]})
    assert found.loc[0, "alarm_late_percent"] == pytest.approx(expected)
    # One that was taken back counts: healthy rows, shaken for a while, long before the onset.
    shaken = dict(run)
    shaken["peak_to_peak_g"] = run["peak_to_peak_g"].copy()
    shaken["peak_to_peak_g"][61:67] *= 3
    assert tables.take(shaken).alarm == (61, 65)


def test_the_run_judged_has_no_part_in_its_own_width(runs: Runs) -> None:
    found = tables.table(runs).set_index(["bearing", "method"])["widening"]
    changed = dict(runs)
    own = dict(runs[3, "A148"])
    own["peak_to_peak_g"] = own["peak_to_peak_g"] ** 1.5
    changed[3, "A148"] = own
    other = tables.table(changed).set_index(["bearing", "method"])["widening"]
    assert other["A148", TOGETHER] == found["A148", TOGETHER] != 1.0
    assert other["A154", TOGETHER] != found["A154", TOGETHER]
