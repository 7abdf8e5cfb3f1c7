"""Paper 2's study of live updating: the updated twin wins where something drifts, tables are honest, runs resume."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from papers.framework import Work
from papers.paper2_digital_twin.live import study as tables_live
from papers.paper2_digital_twin.live.jobs import ARMS, Scenario, live_through, machine_of, messages_of
from papers.paper2_digital_twin.live.study import DRIFT, STUDY, WHOLE, by_phase, phase_of
from papers.paper2_digital_twin.live_twin import twin
from papers.paper2_digital_twin.live_twin.drift import Alarm, DriftDetector
from papers.paper2_digital_twin.live_twin.messages import Snapshot
from papers.paper2_digital_twin.live_twin.refit import Fit, refit
from twingap.errors import TwingapError
from twingap.sweep import Result
from twingap.track import FolderTracker

TINY = """
[profiles.tiny]
seeds = 1
steady = 1
steady_hours = 3.0
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "live.toml"
    text = STUDY.config.read_text(encoding="utf-8")
    for name, value in {"hours": "10.0", "snapshot_s": "0.5"}.items():
        text = re.sub(rf"(?m)^{name} = \S+", f"{name} = {value}", text)
    path.write_text(text + TINY, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def study(config: Path, folder: Path) -> Work:
    with FolderTracker(folder / "runs").run("live") as log:
        return STUDY.run("tiny", out=folder, backend="sequential", config=config, log=log)


def test_the_updated_twin_halves_the_frozen_ones_error_under_drift(study: Work) -> None:
    (first,) = study["drifting"]
    error = {arm: by_phase(first, arm) for arm in ARMS}
    assert error["live"][DRIFT] < 0.5 * error["frozen"][DRIFT]
    assert error["live"][WHOLE] < 0.5 * error["laws alone"][WHOLE]
    assert error["live"]["cooled"] < error["identification alone"]["cooled"]  # what the laws are for
    assert error["live"]["worn"] < 1.5 * float(first.value["chance"])


def test_all_twins_are_the_same_until_they_are_commissioned_and_what_they_do_is_what_they_may(study: Work) -> None:
    arms = study["drifting"][0].value["arms"]
    kinds = {name: set(value["updates"]["kind"]) for name, value in arms.items()}
    assert kinds["frozen"] == {"commissioning"} and kinds["laws alone"] == {"commissioning", "law"}
    assert "law" not in kinds["identification alone"] and {"law", "drift"} <= kinds["live"]
    first = {name: value["judged"]["error"][0] for name, value in arms.items()}
    assert first["frozen"] == first["identification alone"] and first["laws alone"] == first["live"]


def test_tables_name_the_virtual_machine_and_say_what_was_missed(study: Work) -> None:
    assert set(study.tables) == {
        "live-errors", "live-targets", "live-false-alarms", "live-messages", "live-cost",
    }  # fmt: skip
    for table in study.tables.values():
        assert set(table["data"]) == {"virtual machine"}
    targets = study.tables["live-targets"].set_index("target")
    row = targets.loc[f"frozen over live, error, {DRIFT}"]
    assert row["met"] == (row["worst machine"] >= row["at least"])
    (alarms,) = study.tables["live-false-alarms"].to_dict("records")
    assert alarms["low_95"] <= alarms["rate"] <= alarms["high_95"] and alarms["stated"] == 0.002
    cases = set(study.tables["live-messages"]["case"])
    assert {"accepted", "out of order", "repeated", "missing"} <= cases


@pytest.mark.parametrize("refused", [True, False])
def test_an_alarm_counts_also_where_nothing_better_is_found(
    study: Work, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every fit made one that finds nothing, or fails once the twin is commissioned: all updates are "kept"."""
    alarms: list[Alarm] = []
    push = DriftDetector.push

    def told(own: DriftDetector, z: np.ndarray) -> Alarm | None:
        found = push(own, z)
        alarms.extend([found] if found else [])
        return found

    def in_vain(*given: Any, **more: Any) -> Fit:
        if refused and alarms:
            raise TwingapError("cannot be simulated")
        found = refit(*given, **more)
        return dataclasses.replace(found, after=found.before)

    monkeypatch.setattr(DriftDetector, "push", told)
    monkeypatch.setattr(twin, "refit", in_vain)
    job = dataclasses.replace(study["drifting"][0].job, arms=("live",))
    value = live_through(job, study.options)
    updates = value["arms"]["live"]["updates"]
    assert set(updates["kind"]) == {"law", "kept"} and alarms
    result = dataclasses.replace(study["drifting"][0], job=job, value=value)
    assert tables_live.false_alarms(study.options, [result])["alarms"].item() == len(alarms)
    # Every update but the commissioning costs what the target is about.
    spent = [s for s, kind in zip(updates["seconds"], updates["kind"], strict=True) if kind == "kept"][1:]
    tight = dataclasses.replace(study.options, most_ms=1e3 * max(spent) * 0.99)
    assert "cost of an update" in tables_live.targets(study.options, [_beside_frozen(result)])["target"].iloc[-1]
    assert not tables_live.targets(tight, [_beside_frozen(result)])["met"].iloc[-1]


def _beside_frozen(result: Result[Scenario]) -> Result[Scenario]:
    """With the other arm that targets compare with."""
    arms = {"frozen": result.value["arms"]["live"], **result.value["arms"]}
    return dataclasses.replace(result, value=result.value | {"arms": arms})


def test_ratios_by_hand(study: Work) -> None:
    (first,) = study["drifting"]
    value = first.value["arms"]["live"]
    t, e = (np.array(value["judged"][c])[value["commissioning"] :] for c in ("time_s", "error"))
    assert by_phase(first, "live")[DRIFT] == pytest.approx(e[t >= 0.35 * 36000].mean())
    assert phase_of(np.array([0.0, 0.2, 0.5, 0.9, 0.99]) * 36000, 10.0) == [
        "as commissioned", "cooled", "wearing", "cooled", "worn",
    ]  # fmt: skip


def test_the_kept_back_snapshot_is_predicted_before_it_is_seen(study: Work) -> None:
    first = study["drifting"][0]
    arrived = messages_of(first.job, machine_of(first.job, study.options), study.options.poor_line)
    last = max(m.time_s for m in arrived if isinstance(m, Snapshot))
    for value in first.value["arms"].values():
        assert value["judged"]["time_s"][-1] == last
        apart = np.linalg.norm(np.asarray(value["predicted"]) - np.asarray(first.value["measured"]))
        size = np.linalg.norm(np.asarray(first.value["measured"]))
        assert value["judged"]["error"][-1] == pytest.approx(apart / size, rel=0.02)


def test_taken_up_again_with_the_same_tables(study: Work, folder: Path, config: Path) -> None:
    before = {p.name: p.read_bytes() for p in (folder / "tables").iterdir()}
    assert {p.stem for p in (folder / "figures").iterdir()} == {"live-drift"}
    again = STUDY.run("tiny", out=folder, backend="sequential", config=config, draw=False)
    assert again.finished == 2 and not again.computed
    assert {p.name: p.read_bytes() for p in (folder / "tables").iterdir()} == before


def test_the_same_machine_makes_the_same_twin(study: Work) -> None:
    (steady,) = study["steady"]
    again = live_through(steady.job, study.options)
    assert again["arms"]["live"]["judged"] == steady.value["arms"]["live"]["judged"]


def test_a_bearing_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "live.toml"
    path.write_text(STUDY.config.read_text(encoding="utf-8").replace('"6205"', '"9999"'), encoding="utf-8")
    with pytest.raises(TwingapError, match="'9999' found, one of"):
        STUDY.read(path)
