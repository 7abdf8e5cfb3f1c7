"""pdm-bench's scenarios: the splits are those published, indicators have known values, labels are seen last."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from papers.extra.pdm_bench import jobs
from papers.extra.pdm_bench.study import STUDY
from twingap.bearing import BEARINGS
from twingap.data import manifest_of
from twingap.data.paderborn import N_SAMPLES
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet

OPTIONS = STUDY.read()


@lru_cache
def paderborn() -> RecordSet:
    """Conditions of every recording that can be read."""
    made = [
        Condition(
            f"{setting}_{row['bearing_id']}_{number}", 1500.0, 64e3, N_SAMPLES, row.get("fault"),
            extra={key: row[key] for key in ("bearing_id", "damage", "origin")} | {"condition": setting},
        )
        for row in manifest_of("paderborn").recordings
        for setting in ("N15_M07_F10", "N09_M07_F10", "N15_M01_F10", "N15_M07_F04")
        for number in range(1, 21)
        if (setting, row["bearing_id"], number) != ("N15_M01_F10", "KA08", 2)
    ]  # fmt: skip
    return RecordSet("paderborn", "", BEARINGS["6203-PU"], made, lambda place: np.zeros(N_SAMPLES))


@pytest.mark.parametrize("name", [name for name, own in OPTIONS.scenarios.items() if own.data == "paderborn"])
def test_paderborn_splits_are_those_published(name: str) -> None:
    own = jobs.split(name, OPTIONS.scenarios[name], paderborn(), STUDY.config)
    assert (len(own.train), len(own.judge)) == own.scenario.published
    bearings = [
        {own.records.conditions[place].extra["bearing_id"] for place in part} for part in (own.train, own.judge)
    ]
    assert (bearings[0] & bearings[1] == set()) == (name != "pu_cross_operating_condition")
    assert ("inner+outer" in own.classes) == (name != "pu_cross_damage_provenance")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"train": "size ==== 1"}, "cannot be asked"),
        ({"judge": "bearing_id == 'K007'"}, "no recording at hand has"),
        ({"judge": "bearing_id == 'K002'"}, "teaches and is judged"),
        ({"train": "bearing_id == 'K002'"}, "nothing teaches a class"),
    ],
)
def test_a_wrong_split_is_one_line(changes: dict[str, str], said: str) -> None:
    scenario = dataclasses.replace(OPTIONS.scenarios["pu_cross_bearing_instance"], **changes)  # type: ignore[arg-type]
    with pytest.raises(TwingapError, match=said) as caught:
        jobs.split("wrong", scenario, paderborn(), STUDY.config)
    assert "scenarios.wrong" in str(caught.value) and "\n" not in str(caught.value)


def test_indicators_of_two_tones() -> None:
    t = np.arange(2048) / 12000
    low, high = 12000 * 64 / 2048, 12000 * 256 / 2048
    x = np.sin(2 * np.pi * low * t) + np.sin(2 * np.pi * high * t)
    (found,) = jobs.indicators(x[None], 12000.0)
    mean, square = (low + high) / 2, (low**2 + high**2) / 2
    centre = square / mean
    spread = np.sqrt(((low - centre) ** 2 + (high - centre) ** 2) / 2)
    np.testing.assert_allclose(found[7:], [mean, centre, np.sqrt(square), spread], rtol=0.01)
    np.testing.assert_allclose(found[:3], [1.0, 1.0, 2.25], rtol=1e-6)


def test_the_virtual_rig_stands_in_and_labels_are_seen_last(tmp_path: Path) -> None:
    text = STUDY.config.read_text(encoding="utf-8")
    for name, small in (("rig_duration_s = 0.6", "rig_duration_s = 0.35"), ("fleets = 6", "fleets = 2")):
        assert name in text
        text = text.replace(name, small)
    config = tmp_path / "small.toml"
    config.write_text(text, encoding="utf-8")
    work = STUDY.run(out=tmp_path, backend="sequential", config=config)
    means = work.tables["pdm_bench-mean"].set_index(["source", "features", "method"])
    assert len(means) == 3 * 6
    assert means.loc[("real labels", "orders", "Random forest"), "accuracy"] > 0.8
    shares = 12 * means["recordings"].to_numpy()
    np.testing.assert_allclose(shares, shares.round(), atol=1e-9)
    (about,) = work.tables["pdm_bench-scenarios"].to_dict("records")
    assert (about["data"], about["teach"], about["judged"]) == ("virtual rig", 24, 12)
    first = work["results"][0]
    train, judge, _ = work["rows"]["cwru_cross_fault_instance"]
    other = jobs.run_trial(first.job, train, {**judge, "label": (judge["label"] + 1) % 3})
    assert {name: own["setting"] for name, own in other.items()} == {
        name: own["setting"] for name, own in first.value.items()
    }


def test_without_data_the_error_says_where_to_get_them(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="no CWRU recording"):
        STUDY.run("full", out=tmp_path / "out", root=tmp_path, backend="sequential")
