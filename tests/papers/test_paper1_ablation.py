"""Why DANN is not beaten everywhere: lives about the true end, an encoding at a time, tables beside DANN."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from papers.framework import Work
from papers.paper1_rul_varying_speed.ablation import jobs as ablation
from papers.paper1_rul_varying_speed.ablation.jobs import ADVERSARIAL, DANN, SIMULATED, TRUE, Size, with_true_lives
from papers.paper1_rul_varying_speed.ablation.study import STUDY, tables_of
from papers.paper1_rul_varying_speed.cases import Case, Target, load_target
from papers.paper1_rul_varying_speed.job import simulate
from papers.paper1_rul_varying_speed.lives.options import Options, TargetOptions, read_options
from papers.paper1_rul_varying_speed.methods.adaptive_twin import NoLifeError
from papers.paper1_rul_varying_speed.methods.architecture import MODELS
from papers.paper1_rul_varying_speed.methods.metrics import rmse
from tests.papers import test_paper1
from twingap.config import to_toml
from twingap.errors import TwingapError

records, root, config, case = test_paper1.records, test_paper1.root, test_paper1.config, test_paper1.case


@pytest.fixture(scope="module")
def options(config: Path) -> Options:
    return read_options(config)


def run(size: Size, lives: Path, out: Path, root: Path) -> Work:
    """The study with one profile, on the twin of that configuration."""
    config = out / "ablation.toml"
    config.write_text(to_toml({"lives": str(lives), "profiles": {"smoke": vars(size)}}), encoding="utf-8")
    return STUDY.run("smoke", out=out, root=root, backend="sequential", config=config)


def error(case: Case) -> float:
    return rmse(case.true_min, case.minutes(case.mean_of_lives()))


def test_true_lives_are_nearer_to_the_truth_and_still_know_nothing_of_later_records(
    case: Case, options: Options
) -> None:
    true = with_true_lives(case, options.adaptation)
    assert error(true) < error(case)
    assert true.known.real is case.known.real and true.known.twin.now_row == case.known.twin.now_row
    assert all(life.end_row > case.known.twin.now_row for life in true.known.twin.lives)
    assert len(true.known.twin.lives) == len(case.known.twin.lives)


def test_records_of_other_lives_are_made_anew(case: Case, options: Options) -> None:
    (job, *_) = ablation.trainings_of(case, options, Size(("A148",), 1, 4, 60, 1), 0)
    other = with_true_lives(case, options.adaptation)
    made = simulate(job, case.known, case.digest)[0]
    changed = simulate(job, other.known, other.digest)[0]
    assert case.digest == other.digest
    assert made.revolutions is not None and changed.revolutions is not None
    assert made.revolutions.max() != changed.revolutions.max()


def test_models_differ_by_an_encoding_at_a_time() -> None:
    assert ADVERSARIAL[DANN] == MODELS[DANN] and ADVERSARIAL["Proposed model 3"] == MODELS["Proposed model 3"]
    assert {(a.sequence, a.speed) for a in ADVERSARIAL.values()} == {(s, v) for s in (0, 1) for v in (0, 1)}
    assert all(a.adversarial for a in ADVERSARIAL.values())


def test_tables_stand_beside_dann() -> None:
    rows = [
        {"data": "d", "lives": SIMULATED, "bearing": b, "model": m, "seed": s, "rmse_min": v, "bias_min": 0.0,
         "lives_rmse_min": 2.0, "lives_bias_min": 1.0}
        for m, errors in ((DANN, (4.0, 8.0)), ("Proposed model 3", (2.0, 9.0)))
        for b, v in zip("AB", errors, strict=True)
        for s in (0, 1)
    ]  # fmt: skip
    made = tables_of(rows)["ablation_summary"].set_index("model")
    assert made.loc[DANN, "over_dann"] == 1 and made.loc[DANN, "better_than_dann"] == 0
    best = made.loc["Proposed model 3"]
    assert best["over_dann"] == pytest.approx(11 / 12) and best["better_than_dann"] == 1 and best["bearings"] == 2
    assert best["low_90"] == best["high_90"] == pytest.approx(11 / 12)


def test_the_study_goes_on_from_its_store(root: Path, config: Path, tmp_path: Path) -> None:
    size = Size(("A148",), 1, 4, 60, 1)
    first = run(size, config, tmp_path, root)
    every = first.tables["ablation"]
    assert set(every["lives"]) == {SIMULATED, TRUE} and len(every) == 8 and first.computed == 8
    assert every.groupby("lives")["lives_rmse_min"].first()[TRUE] < every["lives_rmse_min"].max()
    assert np.isfinite(every["rmse_min"]).all()
    again = run(size, config, tmp_path, root)
    assert not again.computed
    pd.testing.assert_frame_equal(every, again.tables["ablation"])
    assert len(pd.read_csv(tmp_path / "tables" / "ablation_summary.csv")) == 8


def test_a_run_for_which_no_life_can_be_simulated_is_left_out_and_named(
    root: Path, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = ablation.read_case
    kind: type[TwingapError] = NoLifeError

    def of_one(target: Target, name: str, *rest: Any) -> Case:
        if name == "A150":
            raise kind("no life could be simulated before the run's end", where=f"run {name}")
        return real(target, "A148", *rest)

    monkeypatch.setattr(ablation, "read_case", of_one)
    monkeypatch.setattr(ablation, "load_target", lambda options, where, names: load_target(options, where, ["A148"]))
    for bearings in (("A148", "A150"), ("A150",)):
        given = (Size(bearings, 1, 4, 60, 1, (DANN,), (SIMULATED,)), config, tmp_path, root)
        if len(bearings) == 1:
            with pytest.raises(TwingapError, match="no run can be trained for: run A150: no life"):
                run(*given)
            continue
        made = run(*given).tables
        assert list(made["ablation"]["bearing"]) == ["A148"] and made["ablation_summary"]["bearings"].eq(1).all()
        kind = TwingapError  # what cannot be read is not left out
        with pytest.raises(TwingapError, match=r"^run A150: no life"):
            run(*given)
        kind = NoLifeError
        (row,) = made["ablation_left_out"].to_dict("records")
        assert row["bearing"] == "A150" and "no life could be simulated" in row["why"]


def test_a_question_may_be_asked_of_some_models_and_lives_on_another_bench(
    root: Path, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two models, lives as simulated; which bench is asked for is seen where the rig is made."""
    asked: list[int] = []

    def watched(options: TargetOptions, *rest: Any, **more: Any) -> Target:
        asked.append(options.surrogate_seed)
        return load_target(options, *rest, **more)

    monkeypatch.setattr(ablation, "load_target", watched)
    models = (DANN, "DANN + speed")
    made = run(Size(("A148",), 1, 4, 60, 1, models, (SIMULATED,), bench=5), config, tmp_path, root)
    every, summary = made.tables["ablation"], made.tables["ablation_summary"]
    assert list(every["model"]) == list(models) == list(summary["model"]) and set(every["lives"]) == {SIMULATED}
    assert asked == [5] and made.computed == 2
    confirm = STUDY.read().profiles["confirm"]
    assert confirm.bench not in (None, read_options().target.surrogate_seed) and DANN in confirm.models
