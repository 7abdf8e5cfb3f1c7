"""Paper 3's identification study: metrics against hand computations, equal evaluations, resumable, small."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from papers.framework import Work
from papers.paper3_zoa_dann.identification.agreement import (
    agreement,
    aligned,
    amplitude_spectra,
    mmd,
    prd,
    rmse,
    windows,
)
from papers.paper3_zoa_dann.identification.jobs import recordings
from papers.paper3_zoa_dann.identification.study import STUDY
from twingap.errors import TwingapError
from twingap.identification import contact_bottom
from twingap.identification.optimise import OPTIMISERS

TINY = """
[profiles.tiny]
seeds = 1
evaluations = 16
machines = 1
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "identification.toml"
    text = STUDY.config.read_text(encoding="utf-8")
    for name, value in {
        "faults": '["outer"]', "settings": '["paper"]', "machine_duration_s": "1.0", "window_samples": "1024",
    }.items():  # fmt: skip
        text = re.sub(rf"(?m)^{name} = .*$", f"{name} = {value}", text)
    path.write_text(text + TINY, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module", autouse=True)
def few_trajectories() -> Iterator[None]:
    """Values of the machines are not tested here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contact_bottom, "TRAJECTORIES", contact_bottom.SETS)
        yield


@pytest.fixture(scope="module")
def study(config: Path, folder: Path) -> Work:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("TWINGAP_DATA", raising=False)
        return STUDY.run("tiny", out=folder, backend="sequential", config=config)


def test_metrics_by_hand() -> None:
    x, y = np.array([[3.0, 4.0]]), np.array([[0.0, 4.0]])
    assert prd(x, y) == pytest.approx(60.0)  # 100 * 3 / 5
    assert rmse(x, y) == pytest.approx(3 / np.sqrt(2))
    # Rows at distance 1, both simulated ones upon the first: kernel means (1 + e) / 2, 1, (1 + e) / 2, e = exp(-1/2).
    e = np.exp(-0.5)
    rows = np.array([[0.0], [1.0]])
    assert mmd(rows, np.zeros((2, 1))) == pytest.approx(np.sqrt((1 + e) / 2 + 1 - (1 + e)))
    assert mmd(rows, rows) == 0.0


def test_windows_are_of_unit_rms_and_a_shift_is_found_again() -> None:
    x = windows(3 + 5 * np.random.default_rng(0).standard_normal(4100), 1024)
    assert x.shape == (4, 1024)
    assert np.allclose(x.mean(axis=1), 0) and np.allclose((x**2).mean(axis=1), 1)
    assert np.array_equal(aligned(x, np.roll(x, 37, axis=1)), x)
    tone = np.sqrt(2) * np.cos(2 * np.pi * 100 * np.arange(1024) / 1024)
    assert amplitude_spectra(tone[None]).argmax() == 99


def test_a_signal_agrees_with_itself() -> None:
    x = np.random.default_rng(0).standard_normal(8192)
    assert agreement(x, x, 1024) == pytest.approx(dict.fromkeys(agreement(x, x, 1024), 0.0), abs=1e-7)


def test_all_optimisers_spend_the_same_and_every_table_says_whose_data(study: Work) -> None:
    assert {r.job.optimiser for r in study["searches"]} == set(OPTIMISERS)
    assert {len(r.value["best"]) for r in study["searches"]} == {16}
    for name, table in study.tables.items():
        expected = "simulated machines" if "recovery" in name else "virtual rig, not CWRU"
        assert set(table["data"]) == {expected}
    found = study.tables["identification-agreement"]
    assert list(dict.fromkeys(found["twin"]))[:2] == ["empirical", "paper preset"]
    # What is lower than before by p percent has dropped by p percent.
    alone = found[found["reading"] == "contact alone"].set_index("twin")["spectrum mmd"]
    drops = study.tables["identification-drops"]
    row = drops[(drops["reading"] == "contact alone") & (drops["to"] == "paper preset") & (drops["of"] == "spectrum")]
    assert row["mmd %"].item() == pytest.approx(100 * (1 - alone["paper preset"] / alone["empirical"]))


def test_an_interrupted_study_goes_on_and_ends_with_the_same_tables(
    study: Work, folder: Path, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    before = {p.name: p.read_bytes() for p in (folder / "tables").iterdir()}
    kept = sorted((folder / "results").glob("*.json"))
    assert len(before) == 8 and len(kept) > 8
    assert {p.name for p in (folder / "figures").iterdir()} == {
        "identification-convergence.png", "identification-signals-paper.png",
    }  # fmt: skip
    for lost in kept[::5]:
        lost.unlink()
    again = STUDY.run("tiny", out=folder, backend="sequential", config=config, draw=False)
    computed = [r.key for part in (again["searches"], again["comparisons"], again["recoveries"]) for r in part if r.why]
    assert sorted(computed) == [lost.stem for lost in kept[::5]]
    assert {p.name: p.read_bytes() for p in (folder / "tables").iterdir()} == before


def test_the_half_that_is_judged_on_is_not_the_half_that_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    _, (fit, judge) = recordings(STUDY.read(), None)
    assert [c.fault for c in fit.conditions] == [c.fault for c in judge.conditions] == ["inner", "outer", "ball"]
    for first, second in zip(fit, judge, strict=True):
        assert not np.array_equal(first.samples, second.samples)


def test_records_that_cannot_be_read_are_not_taken_for_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cwru").mkdir()
    (tmp_path / "cwru" / "105.mat").write_bytes(b"cut short")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=r"105\.mat"):
        recordings(STUDY.read(), None)


def test_wrong_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(TwingapError):
        STUDY.run(out=tmp_path, root=tmp_path / "nowhere")
    bad = tmp_path / "bad.toml"
    bad.write_text(STUDY.config.read_text(encoding="utf-8").replace('"ball"]', '"cage"]'), encoding="utf-8")
    with pytest.raises(TwingapError, match="faults: 'cage' found, one of"):
        STUDY.read(bad)
