"""Paper 3's first result: no leak between adaptation and judgement, resumable, and every option explained and used."""

import dataclasses
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest
import torch

from papers.framework import Work
from papers.paper3_zoa_dann.inputs import jobs as pipeline
from papers.paper3_zoa_dann.inputs import study as tables
from papers.paper3_zoa_dann.inputs.options import CONFIG, read_options
from papers.paper3_zoa_dann.inputs.study import STUDY
from papers.paper3_zoa_dann.job import Job, Measured, fit
from papers.paper3_zoa_dann.source import FREE, identify, simulate
from papers.paper3_zoa_dann.tasks import Task, load_target, make_tasks
from papers.paper3_zoa_dann.yardsticks import analyst, majority
from twingap.adapt import Windows, cut
from twingap.bearing import BEARINGS
from twingap.cli import main
from twingap.config import read_toml
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.rigs import make_rig
from twingap.track.folder import FolderTracker
from twingap.twins.twin_file import read_twin

TINY = """
[profiles.tiny]
tasks = ["load_0_to_2"]
inputs = ["envelope_spectrum"]
seeds = 2
steps = 8
bearings_per_class = 4
records_per_bearing = 1
windows_per_recording = 4
evaluations = 2
rig_duration_s = 0.6
"""
CLASSES = ("healthy", "inner", "outer", "ball")
VALUES = {"stiffness": 9.3e9, "damping": 400.0, "white_share": 0.3}
TASKS = ("load_0_to_2", "load_2_to_0", "unseen_0.007_0_to_2", "unseen_0.014_0_to_2", "unseen_0.021_0_to_2")


@pytest.fixture(autouse=True)
def _no_data(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    if "data" not in request.keywords:
        monkeypatch.delenv("TWINGAP_DATA", raising=False)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("paper3") / "config.toml"
    text = CONFIG.read_text(encoding="utf-8")
    for name, small in {"checkpoints": 2, "records_per_class": 1, "windows_per_record": 2}.items():
        text = re.sub(rf"(?m)^{name} = \d+", f"{name} = {small}", text)
    path.write_text(text + TINY, encoding="utf-8")
    return path


def rig_records(seed: int = 0) -> RecordSet:
    return make_rig("virtual_cwru", duration_s=0.3).records(seed)


def relabelled(records: RecordSet, seed: int) -> RecordSet:
    """The same recordings with their faults dealt out anew."""
    faults = [c.fault for c in records.conditions]
    dealt = np.random.default_rng(seed).permutation(len(faults))
    conditions = [dataclasses.replace(c, fault=faults[i]) for c, i in zip(records.conditions, dealt, strict=True)]
    return RecordSet(records.name, records.unit, records.bearing, conditions, lambda i: records[i].samples)


# -- tasks ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", make_tasks(TASKS, rig_records()), ids=lambda t: t.name)
def test_judged_recordings_are_never_adapted_to(task: Task) -> None:
    assert not set(task.adapt.groups) & set(task.evaluate.groups)
    assert not {c.name for c in task.adapt.conditions} & {c.name for c in task.evaluate.conditions}
    assert all(c.fault is None for c in task.adapt.conditions)
    assert {c.fault for c in task.evaluate.conditions} == set(CLASSES)
    if task.name.startswith("unseen"):
        adapted = {c.extra["bearing_id"] for c in task.adapt.conditions}
        judged = {c.extra["bearing_id"] for c in task.evaluate.conditions}
        assert adapted & judged == {"healthy"}, "there is but one healthy bearing"
        assert len(task.adapt) == 7 and len(task.evaluate) == 4


def test_a_task_that_leaks_is_refused() -> None:
    records = rig_records()
    with pytest.raises(TwingapError, match="are adapted to and judged on"):
        Task("leak", "leak", records.without_labels(), records)
    with pytest.raises(TwingapError, match="carry labels"):
        Task("labels", "labels", records[:2], records[2:])
    windows = cut(records[:2], 2048, 1)
    with pytest.raises(AssertionError):
        Measured(windows, windows)
    for name in ("load_0_2", "unseen_x_0_to_2", "nonsense"):
        with pytest.raises(TwingapError, match="unknown task"):
            make_tasks([name], records)


def test_target_labels_do_not_reach_training(config: Path) -> None:
    """Faults dealt out anew leave every byte of training as it was."""
    options, sizes = read_options(config), read_options(config).profiles["tiny"]
    states, windows = [], []
    for seed in (None, 1):
        records = rig_records() if seed is None else relabelled(rig_records(), seed)
        (task,) = make_tasks(["load_0_to_2"], records)
        measured = pipeline._measured(task, options, sizes)
        windows.append(measured.adapt)
        recipe = pipeline._recipe(VALUES, task, options, sizes, BEARINGS["6205"], 0)
        for job in pipeline._jobs(task, recipe, options, sizes, 0):
            if job.method == "dann" and job.seed == 0:
                trained, _ = fit(job, measured.adapt)
                states.append((measured.evaluate.labels, trained.checkpoints[-1].state))
    (true, one), (other, two) = states
    assert not np.array_equal(true, other)
    assert all(torch.equal(one[name], two[name]) for name in one)
    # Identification, the other step that sees the target, is given these windows and nothing else.
    np.testing.assert_array_equal(windows[0].samples, windows[1].samples)
    assert windows[0].labels is None


# -- source and yardsticks --------------------------------------------------------------------------------------------


def test_simulated_windows_come_again_and_differ_by_class(config: Path) -> None:
    options = read_options(config)
    records = rig_records()
    (task,) = make_tasks(["load_0_to_2"], records)
    recipe = pipeline._recipe(VALUES, task, options, options.profiles["tiny"], BEARINGS["6205"], 0)
    one = simulate(recipe)
    simulate.cache_clear()
    two = simulate(recipe)
    np.testing.assert_array_equal(one.samples, two.samples)
    assert np.bincount(one.labels).tolist() == [8] * 4  # type: ignore[arg-type]
    assert len(set(one.group)) == 16
    simulate.cache_clear()
    other = simulate(dataclasses.replace(recipe, seed=1))
    assert not np.array_equal(one.samples, other.samples)
    speeds = {c.speed_rpm for c in task.adapt.conditions}
    assert abs(one.speed_rpm / np.mean(list(speeds)) - 1).max() < 0.02


def test_identification_brings_the_spectra_closer(config: Path) -> None:
    options = read_options(config)
    measured = cut(rig_records(), 2048, 1)
    found = identify(measured, BEARINGS["6205"], CLASSES, options.source, options.identification, 4)
    kept = identify(measured, BEARINGS["6205"], CLASSES, options.source, options.identification, 0)
    assert found["rmse_db"] <= found["rmse_db_before"] == kept["rmse_db"]
    assert found["stiffness"] == float(f"{found['stiffness']:.4g}"), "rounded, so that keys are the same elsewhere"
    assert set(FREE) < set(found)


def combs(order: float, n: int, length: int, speed_rpm: float = 1800.0) -> Windows:
    rng = np.random.default_rng(0)
    t = np.arange(length) / 12_000.0 + rng.random((n, 1))
    since = np.mod(t, 1 / (order * speed_rpm / 60))
    x = np.exp(-700 * since) * np.sin(2 * np.pi * 3000 * since) + 0.05 * rng.standard_normal(t.shape)
    names = np.array([str(i) for i in range(n)])
    return Windows(x, np.full(n, 12_000.0), np.full(n, speed_rpm), names)


@pytest.mark.parametrize("band", ["whole", "impulsive"])
@pytest.mark.parametrize("fault", ["inner", "outer", "ball"])
def test_the_analyst_reads_fault_orders(fault: str, band: Literal["whole", "impulsive"]) -> None:
    bearing = BEARINGS["6205"]
    called = analyst(combs(bearing.fault_order(fault), 10, 4096), bearing, CLASSES, 0.01, band)
    assert (called.argmax(axis=1) == CLASSES.index(fault)).mean() >= 0.9


def test_the_most_impulsive_band_shuts_out_a_hum_that_beats_at_another_fault() -> None:
    bearing = BEARINGS["6205"]
    windows, t = combs(bearing.fault_order("outer"), 10, 4096), np.arange(4096) / 12_000.0
    beat = 1 + 0.9 * np.cos(2 * np.pi * bearing.fault_order("inner") * 30 * t)
    hum = dataclasses.replace(windows, samples=windows.samples + 2 * beat * np.sin(2 * np.pi * 900 * t))
    right = {
        band: (analyst(hum, bearing, CLASSES, 0.01, band).argmax(axis=1) == CLASSES.index("outer")).mean()
        for band in ("whole", "impulsive")
    }
    assert right["impulsive"] >= 0.9 > 0.2 > right["whole"]


@pytest.mark.parametrize("band", ["whole", "impulsive"])
def test_the_analyst_raises_false_alarms_as_often_as_told(band: Literal["whole", "impulsive"]) -> None:
    noise = np.random.default_rng(99).standard_normal((600, 2048))
    names = np.array([str(i) for i in range(600)])
    windows = Windows(noise, np.full(600, 12_000.0), np.full(600, 1800.0), names)
    alarms = 1 - analyst(windows, BEARINGS["6205"], CLASSES, 0.05, band)[:, 0].mean()
    assert alarms == pytest.approx(0.05, abs=0.035)


def test_majority() -> None:
    assert majority(np.array([0, 1, 1, 3]), 4) == 0.5


def test_records_that_cannot_be_read_are_not_taken_for_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cwru").mkdir()
    (tmp_path / "cwru" / "105.mat").write_bytes(b"cut short")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=r"105\.mat"):
        load_target(read_options().target, None, 0.3)
    (tmp_path / "cwru" / "105.mat").unlink()
    assert load_target(read_options().target, None, 0.3).title == "virtual rig, not CWRU"


# -- the whole ---------------------------------------------------------------------------------------------------------


def run(config: Path, out: Path, **more: Any) -> Work:
    return STUDY.run("tiny", out=out, config=config, backend="sequential", **more)


@pytest.fixture(scope="module")
def whole(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Work:
    """One whole run on the virtual rig, tracked."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("TWINGAP_DATA", raising=False)
        with FolderTracker(folder / "runs").run("inputs") as log:
            return run(config, folder / "out", log=log)


def test_whole_run_writes_and_tracks_all(whole: Work) -> None:
    assert whole.computed == 1 + 4 and whole["target"].title == "virtual rig, not CWRU", (
        "an identification, and trainings"
    )
    assert set(whole.tables["accuracy"]["data"]) == {"virtual rig, not CWRU"}
    for name in ("accuracy", "adaptation", "confusion", "recordings", "selection", "identification"):
        assert (whole.out / "tables" / f"{name}.md").exists()
        table = pd.read_csv(whole.out / "tables" / f"{name}.csv")
        assert set(table["data"]) == {"virtual rig, not CWRU"}, "every row says which data it is of"
    assert (whole.out / "figures" / "spectra.png").read_bytes()[:4] == b"\x89PNG"
    runs = whole.out.parent / "runs"
    logged = {p.relative_to(runs).as_posix() for p in runs.rglob("*")}
    assert any(p.endswith("twin/twin.toml") for p in logged) and any("figures/spectra.png" in p for p in logged)
    assert sum(p.endswith("metrics.csv") for p in logged) == 1 + 2 + 4, "task, methods, seeds"
    (twin,) = runs.rglob("twin.toml")
    assert read_twin(twin).model == "contact"


def test_an_interrupted_run_is_taken_up_again(config: Path, tmp_path: Path, whole: Work) -> None:
    def stop(what: str, done: int, total: int) -> None:
        if "training" in what and done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(config, tmp_path, progress=stop, draw=False)
    again = run(config, tmp_path, draw=False)
    assert again.computed == 3
    pd.testing.assert_frame_equal(again.tables["accuracy"], whole.tables["accuracy"])


def test_results_computed_elsewhere_are_taken_by_their_keys(config: Path, tmp_path: Path, whole: Work) -> None:
    shutil.copytree(whole.out / "results", tmp_path / "results")
    copied = run(config, tmp_path, draw=False)
    assert copied.computed == 0
    for name in ("accuracy.csv", "confusion.csv", "recordings.csv"):
        assert (copied.out / "tables" / name).read_bytes() == (whole.out / "tables" / name).read_bytes()


def test_rows_add_up(whole: Work) -> None:
    table = whole.tables["accuracy"]
    assert table["method"].tolist() == [
        "Non-DA", "DANN", "chosen by infomax", "majority class", "analyst's rule",
        "analyst's rule, whole recordings",
    ]  # fmt: skip
    trained = table[table["seeds"] > 0]
    assert (trained["oracle"] >= trained["accuracy"] - 1e-12).all()
    assert (trained["low_95"] <= trained["low_90"]).all() and (trained["low_90"] <= trained["accuracy"]).all()
    counts = pd.read_csv(whole.out / "tables" / "confusion.csv").set_index("method")
    called = counts.filter(like="called")
    assert (called.loc["DANN"].to_numpy().sum(), called.loc["analyst's rule"].to_numpy().sum()) == (2 * 40, 40)
    dann = called.loc["DANN"].to_numpy()
    assert np.trace(dann) / dann.sum() == pytest.approx(table["accuracy"][1])
    (gain,) = tables.adaptation(whole).to_dict("records")
    assert gain["gain"] == pytest.approx(table["accuracy"][1] - table["accuracy"][0])


# -- options and command line -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('criterion = "infomax"', 'criterion = "target_accuracy"', "one of infomax"),
        ("snr_db = [-5.0, 15.0]", "snr_db = [15.0, -5.0]", "low < high"),
        ('inputs = ["waveform", "envelope_spectrum"]', 'inputs = ["wavelet"]', "one of waveform"),
        ("batch = 64 ", "bacth = 64 ", "unknown key 'bacth'"),
        ("steps = 240", "steps = 0", "at least 1"),
    ],
)
def test_a_wrong_option_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = CONFIG.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(TwingapError, match=message) as caught:
        read_options(path)
    assert "wrong.toml" in str(caught.value)


def command(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["twingap", "run", *words])
    with pytest.raises(SystemExit) as caught:
        main()
    return int(caught.value.code or 0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["paper1", "--backend", "abacus"], "'abacus' is not one of"),
        (["paper2", "--backend", "abacus"], "'abacus' is not one of"),
        (["paper3", "--root", "nowhere"], "nowhere"),
        (["paper3", "--backend", "abacus"], "'abacus' is not one of"),
    ],
)
def test_mistakes_end_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TWINGAP_HOME", str(tmp_path / "home"))
    assert command(monkeypatch, *words) == 2
    lines = [line for line in capfd.readouterr().err.splitlines() if line.startswith("twingap: ")]
    assert len(lines) == 1 and said in lines[0]


@pytest.mark.data
@pytest.mark.skipif("TWINGAP_DATA" not in os.environ, reason="needs real records: set TWINGAP_DATA")
def test_real_tasks_share_no_recording_and_no_label() -> None:
    target = load_target(read_options().target, None, 0.3)
    assert target.title == "CWRU" and len(target.records) == 20
    for task in make_tasks(TASKS, target.records):
        assert not set(task.adapt.groups) & set(task.evaluate.groups)
        assert {c.fault for c in task.evaluate.conditions} == set(CLASSES)


def test_the_job_says_all_that_a_training_depends_on() -> None:
    """Nothing of the machine: no path, no device, no number of workers."""
    names = {f.name for f in dataclasses.fields(Job)}
    assert names == {"task", "view", "method", "seed", "training", "criterion", "held_out", "recipe"}
    assert "device" not in read_toml(CONFIG)["training"]
