"""Paper 1's gap by stage and speed: records and the twin's beside them, what is added to lives, tables."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from papers.extra.life_gap import diagnoses
from papers.extra.life_gap import jobs as life_gap
from papers.extra.life_gap.diagnoses import LATER, SEEN, SPEEDS, Asked
from papers.extra.life_gap.study import STUDY, gaps, summary, verdicts
from papers.paper1_rul_varying_speed.cases import Case
from papers.paper1_rul_varying_speed.job import Added, simulate, train_and_judge
from papers.paper1_rul_varying_speed.lives.options import read_options
from tests.papers import test_paper1
from twingap.config import to_toml
from twingap.errors import TwingapError

records, root, config, case = test_paper1.records, test_paper1.root, test_paper1.config, test_paper1.case

pytestmark = pytest.mark.usefixtures("few_trials")

HUM = Added((("mains_interference", (("level", 1.0),)),), 0.3)


def test_each_simulated_record_has_speed_and_height_of_a_measured_one(case: Case, config: Path) -> None:
    signal = read_options(config).variants["printed"].signal
    for stage in diagnoses.STAGES:
        real, made = diagnoses.pair_of(Asked("rig", stage, "slow", ("A148",), 0), [case], signal)
        assert len(made) == diagnoses.COPIES * len(real) and len(real) <= diagnoses.RECORDS
        low, high = SPEEDS["slow"]
        assert all(low <= c.speed_rpm < high for c in real.conditions)
        assert {c.fault for c in real.conditions} == {c.fault for c in made.conditions}
        if stage == "healthy":
            continue
        heights = {c.name: float(np.ptp(r.samples)) for c, r in zip(real.conditions, real, strict=True)}
        for record in made:
            wanted = heights[record.condition.name.rsplit("-", 1)[0]]
            # Noise alone may be higher than a quiet record; a louder one is met.
            assert np.ptp(record.samples) >= 0.998 * wanted
            if stage == LATER:
                assert np.ptp(record.samples) == pytest.approx(wanted, rel=2e-3)


def test_stages_part_at_now_and_a_speed_without_records_is_refused(case: Case, config: Path) -> None:
    signal = read_options(config).variants["printed"].signal
    now = case.known.twin.now_row - case.known.twin.onset_row
    assert diagnoses.stage_of(case, SEEN).position.max() <= now < diagnoses.stage_of(case, LATER).position.min()
    assert diagnoses.stage_of(case, LATER).revolutions is None
    few = dataclasses.replace(case.known, healthy=case.known.healthy.take(np.arange(1)))
    with pytest.raises(TwingapError, match="2 or more"):
        diagnoses.pair_of(
            Asked("rig", "healthy", "fast", ("A148",), 0), [dataclasses.replace(case, known=few)], signal
        )  # fmt: skip


def test_effects_are_added_to_lives_and_leave_peak_to_peak_and_labels(case: Case, config: Path) -> None:
    options = read_options(config)
    plain, more = list(life_gap.trainings_of(case, options, HUM, life_gap.Size(("A148",), 1, 4, 40)))[::2]
    assert plain.added is None and more.added == HUM and plain.model == more.model == "CNN"
    (before, _), (after, held) = simulate(plain, case.known), simulate(more, case.known)
    np.testing.assert_array_equal(before.revolutions, after.revolutions)
    np.testing.assert_allclose(np.ptp(before.samples, axis=1), np.ptp(after.samples, axis=1), rtol=1e-5)
    at = np.abs(np.fft.rfftfreq(before.samples.shape[1], 1 / case.known.fs_hz) - 50).argmin()
    hum = [np.abs(np.fft.rfft(part.samples, axis=1))[:, at].mean() for part in (before, after)]
    assert hum[1] > 3 * hum[0] and len(held)
    assert "rmse_min" in train_and_judge(more, case)


def test_a_diagnosis_becomes_a_row_and_its_effects_a_training(root: Path, config: Path) -> None:
    asked = Asked("rig", SEEN, "all", ("A148",), 0)
    row = diagnoses.diagnosed(asked, root=str(root), config=str(config))
    assert not row["refused"] and row["before"] > 0 and 0 <= row["p_value"] <= 1
    assert set(row["added"]) <= set(row["effects"])
    more = life_gap.added(row)
    assert (more is None) == (not row["added"])
    found = [SimpleNamespace(job=asked, value=value) for value in (row, {"refused": "too few", "records": 1})]
    table = verdicts("stand-in", found)
    assert list(table["verdict"]) == [row["status"], "too few"] and (table["data"] == "stand-in").all()


def test_runs_without_a_named_effect_count_as_unchanged() -> None:
    rows = [
        {"data": "d", "bearing": b, "model": "CNN", "seed": s, "added": a, "rmse_min": v, "oracle_min": v}
        for b, a, v in (("A", "", 4.0), ("B", "", 8.0), ("B", "hum", 2.0))
        for s in (0, 1)
    ]
    short = summary(pd.DataFrame(rows)).iloc[0]
    assert short["before_min"] == 6 and short["after_min"] == 3 and short["ratio"] == 0.5
    assert short["runs_better"] == 1 and short["runs"] == 2
    none = summary(pd.DataFrame([row for row in rows if not row["added"]])).iloc[0]
    assert none["ratio"] == none["low_90"] == none["high_90"] == 1 and none["runs_better"] == 0


def test_every_stage_speed_run_and_condition_is_asked_once() -> None:
    asked = list(life_gap.questions(("A148", "A150"), ("Bearing1_1", "Bearing1_2", "Bearing3_1"), 0))
    assert len(asked) == len(set(asked)) == 9 + 2 + 4
    assert {q.bearings for q in asked if q.data == "femto" and q.speed == "1"} == {("Bearing1_1", "Bearing1_2")}


def test_the_figure_has_a_panel_per_set_and_a_mark_per_diagnosis_of_all_bearings() -> None:
    # As the study asks: FEMTO condition by condition, so that stages alternate.
    asked = [("rig", stage, speed) for stage in ("early", "late") for speed in ("slow", "fast")]
    asked += [("FEMTO", stage, condition) for condition in "12" for stage in ("early", "late")]
    rows = [
        {"data": data, "bearings": "6 bearings", "stage": stage, "speed": speed, "gap_before": k + 2.0,
         "gap_after": 1.0, "floor": 0.1}
        for k, (data, stage, speed) in enumerate(asked)
    ]  # fmt: skip
    alone = [{**rows[0], "bearings": "A148", "speed": "all"}, {**rows[0], "gap_before": np.nan}]
    rig, other = gaps(pd.DataFrame(rows + alone)).axes
    assert [t.get_text() for t in rig.get_xticklabels()] == ["slow", "fast"] * 2
    assert [t.get_text() for t in other.get_xticklabels()] == ["cond. 1", "cond. 2"] * 2
    assert list(other.lines[0].get_xdata()) == [0, 1, 3, 4] and list(other.lines[0].get_ydata()) == [6, 8, 7, 9]


def test_the_study_writes_its_tables_and_goes_on_from_its_store(
    root: Path, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(life_gap, "STAGES", (SEEN,))
    monkeypatch.setattr(life_gap, "SPEEDS", {"slow": SPEEDS["slow"]})
    small = tmp_path / "life_gap.toml"
    profile = vars(life_gap.Size(("A148",), 1, 4, 40))
    small.write_text(to_toml({"lives": str(config), "profiles": {"smoke": profile}}), encoding="utf-8")
    given = {"out": tmp_path, "root": root, "backend": "sequential", "config": small}
    said: list[str] = []
    first = STUDY.run("smoke", **given, progress=lambda what, done, total: said.append(what))
    assert {"life_gap, diagnoses", "life_gap, training, A148"} <= set(said)
    assert len(first.tables["life_gap"]) == 2 and set(first.tables["life_gap_rmse"]["model"]) == set(life_gap.MODELS)
    for name in first.tables:
        assert len(pd.read_csv(tmp_path / "tables" / f"{name}.csv")) == len(first.tables[name])
    assert (tmp_path / "figures" / "life_gap.png").exists()
    again = STUDY.run("smoke", **given, draw=False)
    assert first.computed and not again.computed
    for name, table in first.tables.items():
        pd.testing.assert_frame_equal(table, again.tables[name])
