"""Diagnoses in the tracker: what is needed to compare them is there."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from twingap.gap.report.files import read_report, write_report
from twingap.gap.report.model import ClosestEffect, ClosestTwin, EffectShare, GapReport, GroupShare, Metric
from twingap.gap.report.tracking import track_report
from twingap.track import FolderTracker, MlflowTracker

MakeReport = Callable[..., GapReport]
NewDatabase = Callable[[Path], str]


def test_a_diagnosis_is_kept_with_all_that_is_compared(make_report: MakeReport, tmp_path: Path) -> None:
    tracker = FolderTracker(tmp_path / "runs")
    first, second = make_report("explained"), make_report("no_gap", records="other")
    track_report(tracker, first, write_report(first, tmp_path / "out"))
    track_report(tracker, second)
    one, two = sorted((tmp_path / "runs").iterdir())
    parameters = [json.loads((run / "parameters.json").read_text(encoding="utf-8")) for run in (one, two)]
    assert [p["status"] for p in parameters] == ["explained", "no_gap"]
    assert parameters[0]["effects"] == "second_resonance, slip_jitter"
    assert json.loads(parameters[0]["confidence_set"])[1] == ["second_resonance", "speed_fluctuation"]
    assert parameters[0]["twin_model"] == "phenomenological" and parameters[1]["records"] == "other"
    assert parameters[0]["seed"] == "3" and "runtime_s" not in parameters[0]
    with (one / "metrics.csv").open(encoding="utf-8") as stream:
        found = {row[0]: float(row[2]) for row in csv.reader(stream) if row[0] != "metric"}
    assert found["p_value"] == 0.0005 and found["closure"] == 0.93 and found["runtime_s"] == 41.2
    assert found["before/accuracy"] == 0.61 and found["after/accuracy"] == 0.95 and found["floor/accuracy"] == 0.97
    assert found["probability/slip_jitter"] == 0.93 and found["candidate_closure/second_resonance"] == 0.62
    assert "closure/nothing to close" not in found
    tags = json.loads((one / "tags.json").read_text(encoding="utf-8"))
    assert tags["kind"] == "gap" and "closure/nothing to close" in tags["not_measured"]
    assert "ab" * 32 in tags.values()
    assert read_report(one / "gap.json") == first
    assert (one / "report.html").read_bytes() == (tmp_path / "out" / "report.html").read_bytes()
    tables = {f"{table}.{kind}" for table in ("where", "which", "shrink") for kind in ("csv", "json")}
    assert {p.name for p in (one / "tables").iterdir()} == tables
    with (one / "tables" / "where.csv").open(encoding="utf-8") as stream:
        assert json.loads(list(csv.DictReader(stream))[-1]["condition"])["fault"] == "<i>inner</i>"
    assert "\n\nNominal <speeds>" in (one / "verdict.md").read_text(encoding="utf-8")


def test_the_closest_twin_is_kept_apart_from_the_verdict(make_report: MakeReport, tmp_path: Path) -> None:
    report = make_report("partly_explained")
    metrics = (Metric("accuracy", 0.61, 0.99, 0.97, (0.9, 1.0), higher_is_better=True),)
    shares = (GroupShare("path", (EffectShare("a", 0.6),), 0.6, (0.5, 0.7), 0.01),)
    near = ClosestTwin((ClosestEffect("a"), ClosestEffect("b")), 0.6, (0.5, 0.7), shares, metrics=metrics)
    track_report(FolderTracker(tmp_path), dataclasses.replace(report, closest=near))
    (run,) = tmp_path.iterdir()
    assert json.loads((run / "parameters.json").read_text(encoding="utf-8"))["closest"] == "a, b"
    with (run / "metrics.csv").open(encoding="utf-8") as stream:
        found = {row[0]: float(row[2]) for row in csv.reader(stream) if row[0] != "metric"}
    assert found["closest_closure"] == found["share/path"] == 0.6 and found["closest/accuracy"] == 0.99
    assert found["closure"] == 0.93 and found["after/accuracy"] == 0.95


def test_a_quick_diagnosis_is_told_from_a_full_one(make_report: MakeReport, tmp_path: Path) -> None:
    for quick in (True, False):
        report = make_report(records="rig")
        report = dataclasses.replace(report, provenance={**report.provenance, "quick": quick, "twin": "twin.toml"})
        track_report(FolderTracker(tmp_path / str(quick)), report)
        (run,) = (tmp_path / str(quick)).iterdir()
        tags = json.loads((run / "tags.json").read_text(encoding="utf-8"))
        assert tags["name"] == "rig · twin.toml · seed 3" + " · quick" * quick
        assert json.loads((run / "parameters.json").read_text(encoding="utf-8"))["quick"] == str(quick).lower()


def test_an_empty_report_is_tracked_too(make_report: MakeReport, tmp_path: Path) -> None:
    bare = dataclasses.replace(make_report("no_gap"), places=(), candidates=(), metrics=(), calibration={}, tests=())
    track_report(FolderTracker(tmp_path), bare)
    (run,) = tmp_path.iterdir()
    assert (run / "verdict.md").is_file()


@pytest.mark.slow
def test_mlflow_takes_every_name(make_report: MakeReport, new_database: NewDatabase, tmp_path: Path) -> None:
    report = make_report()
    uri = new_database(tmp_path / "mlflow.db")
    track_report(MlflowTracker(uri), report, write_report(report, tmp_path / "out"))
    import mlflow

    (run,) = mlflow.MlflowClient(uri).search_runs(
        [mlflow.MlflowClient(uri).get_experiment_by_name("twingap").experiment_id], "params.status = 'explained'"
    )
    assert run.data.metrics["probability/second_resonance"] == 0.99
    assert {f.path for f in mlflow.MlflowClient(uri).list_artifacts(run.info.run_id)} >= {"gap.json", "report.html"}
