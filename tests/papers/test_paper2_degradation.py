"""Paper 2's degradation study: tables against what they are made of, choices that read no own record, resumable."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from papers.framework import Work
from papers.paper2_digital_twin.degradation import runs as degradation_runs
from papers.paper2_digital_twin.degradation.candidates import (
    CHOSEN,
    HINDSIGHT,
    OFFLINE,
    OTHERS,
    end_level,
    judge_all,
    limits_of,
)
from papers.paper2_digital_twin.degradation.jobs import TRUTHS, Coverage, KnownLaw, cover, tell
from papers.paper2_digital_twin.degradation.runs import (
    STAND_INS,
    Reading,
    StudyRun,
    running_time,
    study_runs,
    table_features,
)
from papers.paper2_digital_twin.degradation.study import STUDY
from papers.paper2_digital_twin.degradation.tables import shown
from twingap.errors import TwingapError
from twingap.prognosis.degradation_models import MODELS, fit_curve
from twingap.prognosis.health_indicator import Run, offline_indicators, running
from twingap.sweep import Result, sweep

OF_KNOWN_CURVES = ("degradation-coverage", "degradation-known-law")
TINY = """
[profiles.tiny]
ims = 1
femto = 1
curves = 10
coverage_runs = 2
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "degradation.toml"
    text = re.sub(r"(?m)^simulated_rows = .*$", "simulated_rows = 60", STUDY.config.read_text(encoding="utf-8"))
    text = re.sub(r"(?s)indicators = \[.*?\]\n", 'indicators = ["rms", "fusion 9, whole run"]\n', text)
    path.write_text(text.replace("healthy_rows_femto = 60", "healthy_rows_femto = 30") + TINY, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def study(config: Path, folder: Path) -> Work:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("TWINGAP_DATA", raising=False)
        short = degradation_runs.simulated_runs(2, 80)
        patch.setattr(degradation_runs, "simulated_runs", lambda: short)
        return STUDY.run("tiny", out=folder, backend="sequential", config=config)


def fake(name: str, seed: int, family: str = "made", rows: int = 80) -> StudyRun:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((rows, 10)) + 5
    x[:, seed % 10] += np.linspace(0, 30, rows)
    one = Run(name, 10.0 * np.arange(rows, dtype=np.float64), ("rms", *"abcdefghi"), np.abs(x) + 1)
    return StudyRun(one, one, "simulated", family, 30, 5)


def test_every_table_and_figure_says_that_runs_are_simulated(study: Work, folder: Path) -> None:
    assert study.title == "simulated runs, neither IMS nor FEMTO"
    for name, table in study.tables.items():
        assert set(table["data"]) == {"simulated" if name in OF_KNOWN_CURVES else study.title}
    assert {p.stem for p in (folder / "tables").iterdir()} == set(study.tables)
    shown = {p.stem for p in (folder / "figures").iterdir()}
    numbered = {name.split("-")[1] for name in shown if name.split("-")[1].isdigit()}
    assert numbered == {"13", "14", "15", "16", "17", "18", "19"}
    assert "degradation-errors" in shown


def test_tables_are_what_the_fits_say(study: Work) -> None:
    j = shown(study)
    fits = study.tables["degradation-fits"]
    here = fits[(fits["run"] == j.run.name) & (fits["indicator"] == "rms")].set_index("model")
    assert list(here.index) == list(MODELS)
    alone = fit_curve(MODELS["combined power 3"], j.times["rms"], j.series["rms"])
    assert here.loc["combined power 3", "R2"] == pytest.approx(alone.r2)
    for name in ("aicc", "bic", "aicc ar1", "bic ar1"):
        assert here[f"{name} above best"].min() == 0
    errors = study.tables["degradation-errors"]
    pairs = study.tables["degradation-pairs"]
    pair = pairs[(pairs["indicator"] == "rms") & (pairs["fit"] == "squares") & (pairs["run"] == j.run.name)].iloc[0]
    for kind in ("combined", "exponential"):
        own = errors[(errors["run"] == j.run.name) & (errors["indicator"] == "rms") & (errors["fit"] == "squares")]
        own = own[own["model"] == pair[kind]]
        assert len(own) == 9
        assert pair[f"rest: {kind} median"] == pytest.approx(own["rest / range"].median())
    lives = study.tables["degradation-lives"]
    assert lives["true"].between(0, 1).all() and set(lives["limit"]) <= {HINDSIGHT, OTHERS}
    at = lives[(lives["share of life"] == 0.5) & (lives["run"] == j.run.name)]["true"]
    assert at.to_numpy() == pytest.approx(0.5, abs=0.02)


def test_claims_follow_from_their_numbers(study: Work) -> None:
    claims = study.tables["degradation-claims"]
    assert set(claims["verdict"]) <= {"confirmed", "not confirmed"}
    # Two simulated runs cannot confirm what is said of IMS and six FEMTO bearings.
    about_femto = claims[claims["claim"].str.contains("FEMTO")]
    assert len(about_femto) and set(about_femto["verdict"]) == {"not confirmed"}


def test_an_interrupted_study_goes_on_and_ends_with_the_same_tables(
    study: Work, folder: Path, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    short = degradation_runs.simulated_runs(2, 80)
    monkeypatch.setattr(degradation_runs, "simulated_runs", lambda: short)
    before = {p.name: p.read_bytes() for p in (folder / "tables").iterdir()}
    again = STUDY.run("tiny", out=folder, backend="sequential", config=config, draw=False)
    assert again.finished and not again.computed
    assert {p.name: p.read_bytes() for p in (folder / "tables").iterdir()} == before
    assert study.tables.keys() == again.tables.keys()


def test_a_choice_for_a_run_reads_nothing_of_it() -> None:
    runs = [fake(f"r{k}", 3) for k in range(3)] + [fake("alone", 1, family="other")]
    found = judge_all(runs)
    assert found[0].choice == found[1].choice == "c" and found[3].choice is None and CHOSEN not in found[3].series
    other = judge_all([fake("r0", 7), *runs[1:]])
    assert other[0].choice == "c"  # though its own rising feature is now another
    assert limits_of(found[0], CHOSEN, found)[OTHERS] == pytest.approx(
        np.median([end_level(found[k].online.values["c"]) for k in (1, 2)])
    )
    assert limits_of(found[0], "fusion 9", found).keys() == {HINDSIGHT}


def test_silent_records_and_pauses() -> None:
    whole = fake("r", 0).run
    rows = whole.features.copy()
    rows[-2:, 0] = 0.01
    stopped = Run("r", whole.time_s, whole.names, rows)
    assert np.flatnonzero(~running(stopped, 30, 0.2)).tolist() == [78, 79]
    clock = np.array([0.0, 600, 1200, 500_000, 500_600])
    assert running_time(clock).tolist() == [0, 600, 1200, 1800, 2400]
    assert running_time(np.zeros(1)).tolist() == [0]


def test_table_features_are_named_for_what_they_are() -> None:
    rms = np.array([1.0, 2.0])
    part = pd.DataFrame({"rms": rms, "mean": 0.0, "std": rms, "max": 3 * rms, "kurt": [0.0, 1.0], "skew": 0.0})
    names, values, there = table_features(part)
    assert there == () and len(names) == 8
    table = dict(zip(names, values.T, strict=True))
    assert table["kurtosis"].tolist() == [3, 4] and table["crest_factor"].tolist() == [3, 3]
    assert table["energy"].tolist() == [20480, 81920]
    more = part.assign(**dict.fromkeys((*STAND_INS, "shape_factor", "impulse_factor", "clearance_factor"), 1.0))
    assert len(table_features(more)[0]) == 15 and table_features(more)[2] == STAND_INS


def reading() -> Reading:
    return Reading(3, 3, 2, 2, 0.2, 128)


def swept(function: Callable[..., Any], jobs: Sequence[Any], inputs: Any) -> list[Result[Any]]:
    """Jobs one after the other, nothing stored."""
    bound = partial(function, **{name: value for name, (value, _) in inputs.items()})
    return sweep(bound, jobs, backend="sequential", data={name: digest for name, (_, digest) in inputs.items()})


def test_ims_is_read_from_tables_or_from_raw_snapshots_when_they_are_there(tmp_path: Path) -> None:
    """The same two records: six features of the tables, fifteen of the samples, and the RMS of both."""
    folder = tmp_path / "ims" / "2nd_test"
    folder.mkdir(parents=True)
    names = [f"2004.02.12.10.{k}2.39" for k in range(6)]
    rng = np.random.default_rng(0)
    columns = [np.round((k + 1) * rng.standard_normal((20480, 4)), 3) for k in range(6)]
    rows: list[dict[str, object]] = []
    for name, x in zip(names, columns, strict=True):
        one = x[:, 0]
        rows.append({
            "file_index": len(rows), "timestamp": "", "filename": name, "Bearing1_ch1_rms": np.sqrt(np.mean(one**2)),
            "Bearing1_ch1_mean": one.mean(), "Bearing1_ch1_std": one.std(), "Bearing1_ch1_max": np.abs(one).max(),
            "Bearing1_ch1_kurt": 0.0, "Bearing1_ch1_skew": 0.0,
        })  # fmt: skip
    pd.DataFrame(rows).to_csv(tmp_path / "ims" / "set2_time_features.csv", index=False)
    read = partial(study_runs, ["2 bearing 1"], [], reading(), tmp_path, swept)
    data, (table,) = read()
    assert data == "IMS" and table.source == "feature table" and len(table.run.names) == 8 and table.extremes is None
    for name, x in zip(names, columns, strict=True):
        pd.DataFrame(x).to_csv(folder / name, sep="\t", header=False, index=False)
    data, (raw,) = read()
    assert raw.source == "raw records" and len(raw.run.names) == 15 and raw.name == table.name == "IMS 2 bearing 1"
    assert raw.run.time_s == pytest.approx(table.run.time_s) and raw.run.time_s.tolist() == [
        600.0 * k for k in range(6)
    ]
    rms = [r.run.features[:, r.run.names.index("rms")] for r in (raw, table)]
    assert rms[0] == pytest.approx(rms[1])
    assert raw.extremes is not None and raw.extremes.shape == (6, 2)
    assert raw.kurtosis_map is not None and [len(raw.kurtosis_map[k]) for k in range(2)] == [6, 65]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("femto/Bearing1_1.npz", "cut short", "Bearing1_1"),
        ("ims/set2_time_features.csv", "file_index\n0\n", "'filename' is missing"),
        ("ims/set2_shape_spectral_features.csv", "file_index\n0\n", "set2_time_features.csv: does not exist"),
        ("ims/2nd_test/2004.02.12.10.32.39", "cut short", "2004.02.12.10.32.39"),
    ],
)
def test_runs_that_cannot_be_read_are_not_taken_for_absent(
    name: str, content: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One run is there, whose error would be kept quiet."""
    path = tmp_path / name
    path.parent.mkdir(parents=True)
    path.write_text(content, encoding="utf-8")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=re.escape(said)):
        study_runs(["2 bearing 1"], ["Bearing1_1"], reading(), None, swept)


def test_coverage_is_counted_on_curves_from_one_to_five() -> None:
    for name in TRUTHS:
        curve: Callable[[Any], Any] = TRUTHS[name]
        assert curve(np.array([0.0, 1.0])) == pytest.approx([1, 5])
    found = cover(Coverage("polynomial 2", "polynomial 2", 0.0, 0.7, 40, 120, 60, 0.1, 0.9, 0))
    assert 0.75 <= found["inside"] <= 1 and found["true"] == pytest.approx(0.3, abs=0.01)
    wrong = cover(Coverage("polynomial 2", "constant", 0.0, 0.7, 5, 120, 60, 0.1, 0.9, 0))
    assert wrong["inside"] == 0 and wrong["bounded"] == 0


def test_models_are_told_apart_where_the_law_is_known() -> None:
    pair = ("combined power 3", "exponential with offset")
    found = [tell(KnownLaw(truth, pair, 0.0, 3, 150, 0.02, 0)) for truth in pair]
    assert [own["criterion"] for own in found] == [1, 0]
    assert [own["error"] for own in found] == [1, 0] and found[0]["ratio"] < 1 < found[1]["ratio"]


def test_offline_reading_of_fusion_nine_is_what_the_study_fits(study: Work) -> None:
    for j in study["judged"]:
        assert list(j.series) == ["rms", OFFLINE]
        assert np.array_equal(j.series[OFFLINE], offline_indicators(j.run.run).values["fusion 9"])


def test_wrong_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="no run to failure is at hand"):
        STUDY.run(out=tmp_path / "out", root=tmp_path, backend="sequential")
    bad = tmp_path / "bad.toml"
    bad.write_text(STUDY.config.read_text(encoding="utf-8").replace('"combined power 3", ', ""), encoding="utf-8")
    with pytest.raises(TwingapError, match="two models expected"):
        STUDY.read(bad)
    bad.write_text(STUDY.config.read_text(encoding="utf-8").replace('    "rms", ', '    "rums", '), encoding="utf-8")
    with pytest.raises(TwingapError, match="use rms and any of"):
        STUDY.read(bad)
