"""The study's machinery: sealed before it is diagnosed, blind, resumable, checked when opened."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import study_standins as standins

from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.rigs.worlds import Case, make_world
from twingap.study import run_study, write_study
from twingap.study.blind import blinded
from twingap.study.rivals import OneClassifier
from twingap.study.tracking import track_blind
from twingap.sweep import SweepError
from twingap.track import MlflowTracker

CASES = [
    Case("none", name="w0", n_records=4, duration_s=0.2, fs_hz=12000.0),
    Case("single", "twin", (("clipping", "strong"),), name="w1", n_records=4, duration_s=0.2, fs_hz=12000.0),
    Case("outside", "contact", (), (("echo", "strong"),), name="w2", n_records=4, duration_s=0.2, fs_hz=12000.0),
]


def small_study(
    out: Path, diagnose: Any = standins.by_level, seed: int = 3, cases: list[Case] = CASES, training_count: int = 0
) -> Any:
    return run_study(
        out, cases, seed, diagnose=diagnose, prepare=standins.noisy_copy, training=standins.tiny_worlds,
        training_count=training_count, rivals=(OneClassifier(),), permutations=2, jobs=1,
    )  # fmt: skip


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    out = tmp_path_factory.mktemp("study")
    study = small_study(out, training_count=12)
    write_study(study, out)
    return study, out


def test_rows_hold_truth_and_answer_of_the_same_world(finished: tuple[Any, Path]) -> None:
    study, _ = finished
    for rows in study.rows.values():
        assert [r.was.case for r in rows] == ["w0", "w1", "w2"]
    clipped = study.rows["diagnosis"][1]
    assert clipped.was.effects == ("clipping",) and clipped.found.effects == ("clipping",)
    assert clipped.was.closure is not None and 0.5 < clipped.was.closure < 1.5  # the truth closes its own gap
    assert clipped.was.left is not None
    assert study.rows["diagnosis"][0].was.closure is None and study.rows["diagnosis"][0].was.left is None


def test_what_is_written_is_whole_and_plain(finished: tuple[Any, Path]) -> None:
    _, out = finished
    table = json.loads((out / "study.json").read_text(encoding="utf-8"))
    assert table["schema"] == "twingap.study/1" and len(table["worlds"]) == 3
    assert table["provenance"]["seed"] == 3 and table["provenance"]["frozen"] is True
    assert {"score", "among", "value", "low", "high", "n", "target", "met", "k"} == set(table["scores"][0])
    for name in ("scores", "confusion", "by_effect", "rivals", "reliability"):
        assert (out / f"{name}.png").stat().st_size > 5000
    page = (out / "study.md").read_text(encoding="utf-8")
    assert "false alarms" in page and "two-sample test" in page and "w1" not in page


@pytest.mark.slow
def test_a_study_is_a_run_with_its_scores_and_one_inside_for_each_rival(
    finished: tuple[Any, Path], tmp_path: Path, new_database: Callable[[Path], str]
) -> None:
    study, out = finished
    uri = new_database(tmp_path / "runs.db")
    track_blind(MlflowTracker(uri, "study blind"), study.table, [out / "study.json", out / "scores.png"])
    import mlflow

    client = mlflow.MlflowClient(uri)
    runs = client.search_runs([client.get_experiment_by_name("study blind").experiment_id])
    of = {run.data.params["method"]: run for run in runs}
    assert of.keys() == {"diagnosis", *study.table["rivals"]} and len(of) == len(runs) > 1
    parent = of.pop("diagnosis")
    assert {run.data.tags["mlflow.parentRunId"] for run in of.values()} == {parent.info.run_id}
    assert parent.data.params["cases"] == "3" and parent.data.params["seed"] == "3"
    for run, rows in ((parent, study.table["scores"]), *((of[m], r) for m, r in study.table["rivals"].items())):
        (false,) = (row for row in rows if row["score"] == "false alarms")
        assert run.data.metrics["false alarms/none"] == false["value"]
        assert run.data.metrics["high/false alarms/none"] == false["high"]
    assert {file.path for file in client.list_artifacts(parent.info.run_id)} >= {"study.json", "scores.png"}


def test_seals_can_be_checked_by_anyone(finished: tuple[Any, Path]) -> None:
    from twingap.rigs.worlds import open_seal

    _, out = finished
    sealed, opened = (json.loads((out / f"{n}.json").read_text()) for n in ("sealed", "opened"))
    for name, held in opened.items():
        truth = open_seal(sealed["worlds"][name]["seal"], held["truth"], held["nonce"])
        assert truth.case == name
    with pytest.raises(TwingapError, match="not those that were sealed"):
        open_seal(sealed["worlds"]["w0"]["seal"], opened["w1"]["truth"], opened["w0"]["nonce"])
    text = (out / "sealed.json").read_text()
    assert "clipping" not in text and "echo" not in text


def test_a_diagnosis_finds_no_truth_in_what_it_is_given(tmp_path: Path) -> None:
    study = small_study(tmp_path, standins.suspicious)
    assert [r.found.effects for r in study.rows["diagnosis"]] == [(), (), ()]


def test_the_search_for_truth_would_find_it() -> None:
    """The test above would fail if a world were handed over as it is, or under its own names."""
    world = make_world(CASES[1], 3)
    blind = blinded(world)
    spec, rng = blind.twin, np.random.default_rng(0)
    revealing = [replace(c, extra={"made_with": "clipping"}) for c in world.records.conditions]
    open_records = RecordSet(
        "machine", "", world.records.bearing, revealing, lambda i: np.asarray(world.records[i].samples)
    )
    found = standins.suspicious(open_records, spec, seed=rng)["verdict"]["effects"]
    assert {"World", "Truth", "Case", "clipping"} <= set(found)
    assert not standins.suspicious(blind.records, spec, seed=rng)["verdict"]["effects"]


def test_the_closest_twin_is_sought_where_it_is_asked_for(tmp_path: Path) -> None:
    study = run_study(
        tmp_path, CASES[1:2], 3, diagnose=standins.closing, prepare=standins.noisy_copy, permutations=0,
        training_count=0, closest=True, jobs=1,
    )  # fmt: skip
    (row,) = study.rows["diagnosis"]
    assert row.found.closest == pytest.approx(0.8) and study.table["provenance"]["closest"]
    (score,) = (s for s in study.table["scores"] if s["score"].startswith("closest twin's closure"))
    assert row.was.closure is not None and score["value"] == pytest.approx(0.8 / min(row.was.closure, 1.0))


def test_blind_records_are_the_same_samples_under_other_names() -> None:
    world = make_world(CASES[2], 3)
    blind = blinded(world)
    assert blind.sim is not None and world.sim is not None
    for ours, theirs in ((blind.records, world.records), (blind.sim, world.sim)):
        assert len(ours) == len(theirs) and len(ours.groups) == len(theirs.groups)
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a.samples, b.samples)
            assert (a.condition.speed_rpm, a.condition.fault) == (b.condition.speed_rpm, b.condition.fault)


def test_an_interrupted_study_goes_on(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="light went out"):
        small_study(tmp_path, standins.interrupted)
    kept = {p.name: p.stat().st_mtime_ns for p in (tmp_path / "work" / "diagnoses").glob("*.json")}
    assert len(kept) == 2
    seals = (tmp_path / "sealed.json").read_bytes()
    with pytest.raises(SweepError):
        small_study(tmp_path, standins.interrupted)
    again = {p.name: p.stat().st_mtime_ns for p in (tmp_path / "work" / "diagnoses").glob("*.json")}
    assert again == kept and (tmp_path / "sealed.json").read_bytes() == seals
    assert not (tmp_path / "opened.json").exists()  # nothing is opened before all are diagnosed


def test_a_folder_keeps_to_its_study(finished: tuple[Any, Path]) -> None:
    _, out = finished
    with pytest.raises(TwingapError, match="another seed"):
        small_study(out, seed=4)
    with pytest.raises(TwingapError, match="another case"):
        small_study(out, cases=CASES[:2])


def test_a_changed_truth_is_found(tmp_path: Path) -> None:
    small_study(tmp_path, cases=CASES[:2])
    sealed = json.loads((tmp_path / "sealed.json").read_text())
    sealed["worlds"]["w1"]["seal"] = sealed["worlds"]["w0"]["seal"]
    (tmp_path / "sealed.json").write_text(json.dumps(sealed))
    with pytest.raises(TwingapError, match="not those that were sealed"):
        small_study(tmp_path, cases=CASES[:2])


def test_same_seed_same_verdicts(finished: tuple[Any, Path], tmp_path: Path) -> None:
    study, _ = finished
    again = small_study(tmp_path, training_count=12)
    for method, rows in study.rows.items():
        first = [(r.was, r.found.status, r.found.effects, r.found.p_value) for r in rows]
        assert first == [(r.was, r.found.status, r.found.effects, r.found.p_value) for r in again.rows[method]]
