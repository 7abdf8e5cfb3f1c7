"""Paper 1: nothing after now reaches training, an interrupted run ends in the same tables, options are explained."""

import dataclasses
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from scipy.signal import lfilter

from papers.framework import Work
from papers.paper1_rul_varying_speed import cases
from papers.paper1_rul_varying_speed.cases import Case, Known, Target, load_target, read_case
from papers.paper1_rul_varying_speed.job import fit
from papers.paper1_rul_varying_speed.lives import jobs, tables
from papers.paper1_rul_varying_speed.lives.options import CONFIG, Options, read_options
from papers.paper1_rul_varying_speed.lives.study import STUDY
from papers.paper1_rul_varying_speed.methods import adaptive_twin
from papers.paper1_rul_varying_speed.methods.architecture import MODELS
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.track.folder import FolderTracker

FS_HZ, LENGTH, DT_S = 50_000.0, 8192, 20.0
TINY = """
[profiles.tiny]
bearings = ["A148"]
variants = ["printed", "closed"]
models = ["CNN", "Proposed model 3"]
seeds = 2
steps = 6
copies = 1
most_records = 120
"""


def ringing(f_hz: float, damping: float) -> tuple[list[float], list[float]]:
    w = 2 * np.pi * f_hz / FS_HZ
    r, turn = np.exp(-damping * w), np.sqrt(1 - damping**2) * w
    return [0.0, r * np.sin(turn)], [1.0, -2 * r * np.cos(turn), r * r]


def surrogate(spoil_after: int | None = None) -> list[Record]:
    """A run in the form of the Smart Maintenance set, by other means than the twin: damage grows by the revolution."""
    rng, made, wear, k = np.random.default_rng(0), [], 0.0, 0
    bpfi = BEARINGS["6205"].bpfi
    while True:
        rpm = 1000.0 + 100 * (k // 3 % 11)
        gain = rpm / 1000 * (1 + 0.5 / (1 + ((rpm - 1500) / 120) ** 2))
        force = 0.35 * gain * rng.standard_normal(LENGTH)
        wear += rpm * DT_S / 60 if k > 150 else 0.0
        strikes = (np.arange(40) + rng.random()) / bpfi * 60 / rpm
        at = np.round(strikes * FS_HZ).astype(int)
        hard = (np.exp(2.2 * wear / 38000) - 1) * 4 * gain * (1 + 0.6 * np.cos(2 * np.pi * strikes * rpm / 60))
        np.add.at(force, at[at < LENGTH], hard[at < LENGTH])
        x = 0.1 * sum(
            weight * lfilter(*ringing(f, z), force) for f, z, weight in ((3200, 0.04, 1.0), (1100, 0.06, 0.5))
        )
        x = x + 0.02 * rng.standard_normal(LENGTH)
        condition = Condition(f"A148_{k:05d}", rpm, FS_HZ, LENGTH, None, 9000.0, DT_S * k, "A148")
        over = bool(np.ptp(x) >= 15)
        made.append(Record(condition, x if spoil_after is None or k <= spoil_after else 1.7 * x))
        k += 1
        if over:
            return made


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return surrogate()


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, records: list[Record]) -> Path:
    """The run where the reader of the real set finds it."""
    folder = tmp_path_factory.mktemp("data")
    place = folder / "smart_maintenance" / "A148"
    place.mkdir(parents=True)
    rows = []
    for k, record in enumerate(records):
        np.save(place / f"{k:05d}.npy", record.samples)
        rows.append({"file": f"{k:05d}.npy", "time_s": DT_S * k, "speed_rpm": record.condition.speed_rpm})
    pd.DataFrame(rows).to_csv(place / "measurements.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("paper1") / "config.toml"
    text = CONFIG.read_text(encoding="utf-8")
    for name, small in {"window_samples": LENGTH, "checkpoints": 2, "mode_records": 8, "lives": 3}.items():
        text = re.sub(rf"(?m)^{name} = \d+", f"{name} = {small}", text)
    path.write_text(text + TINY, encoding="utf-8")
    return path


def case_of(records: list[Record], options: Options) -> Case:
    runs = RecordSet.from_records("smart_maintenance", "g", BEARINGS["6205"], records)
    return read_case(Target(runs, "stand-in", {}), "A148", options.target, options.adaptation)


@pytest.fixture(scope="module")
def case(records: list[Record], config: Path) -> Case:
    return case_of(records, read_options(config))


# -- what training may know -------------------------------------------------------------------------------------------


def test_nothing_after_now_reaches_training(case: Case, config: Path) -> None:
    """Later records, and with them the end of life and every label, are changed: training is the same, to the byte."""
    options = read_options(config)
    other = case_of(surrogate(spoil_after=case.known.twin.now_row), options)
    assert len(other.judged) < len(case.judged), "the run ends earlier"
    assert not np.array_equal(other.judged.revolutions[:5], case.judged.revolutions[:5])  # type: ignore[index]
    for job in jobs._jobs(case, options, options.profiles["tiny"], 0):
        if job.model == "Proposed model 3" and job.seed == 0:
            one, two = fit(job, case.known)[0], fit(job, other.known)[0]
            assert one.scales == two.scales
            for a, b in zip(one.checkpoints, two.checkpoints, strict=True):
                assert all(torch.equal(a.state[name], b.state[name]) for name in a.state)


def test_a_case_that_leaks_is_refused(case: Case) -> None:
    fields = {f.name: getattr(case.known, f.name) for f in dataclasses.fields(Known)}
    for leak in (case.judged, case.judged.unlabelled()):
        with pytest.raises(AssertionError, match="neither labels nor records after now"):
            Known(**(fields | {"real": leak}))
    assert len(case.known.real) + case.later.sum() == len(case.judged)


def test_true_life_falls_with_slope_minus_one_at_constant_speed_and_reacts_to_speed(case: Case) -> None:
    same = np.diff(case.judged.speed_rpm) == 0
    np.testing.assert_allclose(np.diff(case.true_min)[same] * 60 / DT_S, -1.0)
    assert case.true_min[-1] == 0
    # Remaining revolutions all but stand still from one row to the next, so remaining time goes as 1 / speed.
    assert tables.reaction(np.full(50, 7.0), np.resize([1000.0, 1500.0], 50)) == 0
    speed = np.resize([1000.0, 1500.0, 2000.0], 60)
    assert tables.reaction(30000 / speed, speed) == pytest.approx(-1.0)
    assert np.isnan(tables.reaction(np.full(5, 7.0), np.full(5, 1500.0)))


# -- the whole ---------------------------------------------------------------------------------------------------------


def run(config: Path, root: Path, out: Path, **more: Any) -> Work:
    return STUDY.run("tiny", out=out, root=root, config=config, backend="sequential", **more)


@pytest.fixture(scope="module")
def whole(config: Path, root: Path, tmp_path_factory: pytest.TempPathFactory) -> Work:
    folder = tmp_path_factory.mktemp("whole")
    with FolderTracker(folder / "runs").run("lives") as log:
        return run(config, root, folder / "out", log=log)


def test_whole_run_writes_and_tracks_all(whole: Work) -> None:
    assert whole.computed == 8 and whole.title == "Smart Maintenance"
    for name in ("errors", "table5", "comparison", "gap", "runs", "network", "selection", "predictions"):
        table = pd.read_csv(whole.out / "tables" / f"{name}.csv")
        assert set(table["data"]) == {"Smart Maintenance"} and len(table), "every row says which data it is of"
    drawn = {p.stem for p in (whole.out / "figures").glob("*.png")}
    wanted = {"figure03_04", "figure05_10", "figure06_12", "figure07", "figure08", "figure09", "figure11", "figure13",
              "figure14", "table5"}  # fmt: skip
    assert {name.partition("-")[0] for name in drawn} == wanted
    runs = whole.out.parent / "runs"
    assert sum(p.name == "metrics.csv" for p in runs.rglob("*")) == 1 + 4 + 8, "bearing, models and twins, seeds"


def test_rows_add_up(whole: Work) -> None:
    table = whole.tables["errors"]
    assert table["model"].tolist() == ["CNN", "Proposed model 3", tables.LIVES] * 2
    trained = table[table["seeds"] > 0]
    assert (trained["oracle_min"] <= trained["rmse_min"] + 1e-9).all()
    compared = pd.read_csv(whole.out / "tables" / "comparison.csv")
    of = trained[trained["twin"] == "printed"].set_index("model")["rmse_min"]
    per_seed = [
        [t.value["rmse_min"][t.value["place"]] for t in whole["results"][0].of(m)] for m in ("Proposed model 3", "CNN")
    ]
    assert np.mean(per_seed[1]) == pytest.approx(of["CNN"])
    assert compared["ratio"][0] == pytest.approx(np.mean(np.divide(*per_seed)), rel=1e-4)
    assert compared["runs_won"][0] == int(of["Proposed model 3"] < of["CNN"])
    gap = pd.read_csv(whole.out / "tables" / "gap.csv").set_index("model")
    assert gap.loc["CNN", "rmse_min, printed twin"] == pytest.approx(of["CNN"], rel=1e-4)


def test_an_interrupted_run_is_taken_up_again(config: Path, root: Path, tmp_path: Path, whole: Work) -> None:
    """Interrupted once, with six of the eight trainings finished before."""
    shutil.copytree(whole.out / "results", tmp_path / "results")
    for finished in sorted((tmp_path / "results").glob("[!.]*.json"))[:2]:
        finished.unlink()

    def stop(what: str, done: int, total: int) -> None:
        if done == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(config, root, tmp_path, progress=stop, draw=False)
    again = run(config, root, tmp_path, draw=False)
    assert again.computed == 1
    for name in ("errors.csv", "comparison.csv", "predictions.csv"):
        assert (tmp_path / "tables" / name).read_bytes() == (whole.out / "tables" / name).read_bytes()


def test_who_names_data_wants_those_used(config: Path, tmp_path: Path) -> None:
    with pytest.raises(TwingapError):
        load_target(read_options(config).target, tmp_path, ["A148"])


# -- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('criterion = "error_and_steadiness"', 'criterion = "true_life"', "one of error_and_steadiness"),
        ('models = ["CNN", "DANN",', 'models = ["RNN", "DANN",', "one of CNN"),
        ('variants = ["printed", "closed"]', 'variants = ["open"]', "one of printed"),
        ("seeds = 2", "seeds = 0", "1 or more"),
        ("batch = 16 ", "bacth = 16 ", "unknown key 'bacth'"),
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


def test_the_smoke_run_has_all_models_and_the_full_one_all_runs() -> None:
    options = read_options()
    assert list(options.profiles["smoke"].models) == list(options.profiles["full"].models) == list(MODELS)
    assert set(options.profiles["full"].bearings) == set(tables.PUBLISHED) and options.profiles["full"].seeds == 5


@pytest.mark.parametrize(
    ("where", "said"),
    [("run", "run A1: what; mend"), (None, "run A1: what; mend"), ("rule", "run A1, rule: what; mend")],
)
def test_a_run_of_which_nothing_can_be_predicted_is_named_once(
    where: str | None, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*given: object) -> None:
        raise TwingapError("what", where=where, mend="mend")

    monkeypatch.setattr(adaptive_twin, "read_mode", lambda *given: None)
    monkeypatch.setattr(adaptive_twin, "adapt_when_possible", refuse)
    nothing: Any = None
    with pytest.raises(TwingapError) as told:
        cases.adapted(nothing, nothing, "A1", nothing)
    assert str(told.value) == said
