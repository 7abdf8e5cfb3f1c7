"""Diagnosis by data availability: folds that share nothing, labels as counted, a study that resumes."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from papers.framework import Work
from papers.paper2_digital_twin.availability import jobs as availability_jobs
from papers.paper2_digital_twin.availability.jobs import CONFIG, NetworkJob, baseline_of, network, read_options
from papers.paper2_digital_twin.availability.records import (
    ALL,
    RIG,
    SPLITS,
    Measured,
    at_hand,
    counts_of,
    judged,
    labelled,
    load,
    measure,
)
from papers.paper2_digital_twin.availability.source import (
    Background,
    Plant,
    SourceOptions,
    healthy_recordings,
    simulate,
)
from papers.paper2_digital_twin.availability.study import STUDY
from papers.paper2_digital_twin.methods.inception import InceptionTraining
from papers.paper2_digital_twin.methods.residual_head import HeadOptions, ResidualHead, fit_residual_head
from papers.paper2_digital_twin.methods.scalograms import ImageOptions
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError

TINY = """
[profiles.tiny]
seeds = 1
machines = 5
ablation_seeds = 1
steps = 4
check_machines = 1
rig_duration_s = 0.8
smoke = true
"""
IMAGE = ImageOptions(turns=4, carriers=8)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "availability.toml"
    text = CONFIG.read_text(encoding="utf-8")
    for name, value in {
        "counts": "[1, 2]", "turns": "4", "carriers": "8", "pooled": "[1, 2]", "epochs": "2", "checkpoints": "2",
        "false_alarm": "0.1", "ablation": '["bare"]',
    }.items():  # fmt: skip
        text = re.sub(rf"(?m)^{name} = .*$", f"{name} = {value}", text)
    path.write_text(text + TINY, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def data() -> Measured:
    return measure(load("virtual_cwru", None, 0.6), "virtual_cwru", IMAGE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def study(config: Path, folder: Path) -> Work:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("TWINGAP_DATA", raising=False)
        return STUDY.run("tiny", out=folder, backend="sequential", config=config)


@pytest.mark.parametrize("split", SPLITS)
def test_every_recording_is_judged_once_by_what_never_saw_it(data: Measured, split: str) -> None:
    folds = [set(judged(data, split, f, 3, seed=4)) for f in range(3)]  # type: ignore[arg-type]
    assert sorted(r for fold in folds for r in fold) == sorted(data.recordings)
    for fold in folds:
        assert {data.labels[r] for r in fold} == {0, 1, 2, 3}
        assert set(data.healthy()) - fold  # a baseline is left


def test_by_bearing_no_faulty_bearing_is_on_both_sides(data: Measured) -> None:
    sides = []
    for fold in range(3):
        judge = judged(data, "bearing", fold, 3, seed=fold)
        inside = {data.bearings[r] for r in judge if r not in data.healthy()}
        outside = {data.bearings[r] for r in data.recordings if r not in judge and r not in data.healthy()}
        assert not inside & outside
        assert len({data.sizes[r] for r in judge if r not in data.healthy()}) == 1
        sides.append(judged(data, "bearing", fold, 3, seed=99) == judge)
    assert all(sides)  # nothing is left to chance
    assert judged(data, "recording", 0, 3, 0) != judged(data, "recording", 0, 3, 1)


@pytest.mark.parametrize("count", [1, 2, 5, 10])
def test_labels_are_counted_and_spread_over_recordings(data: Measured, count: int) -> None:
    judge = judged(data, "recording", 0, 3, 0)
    learn = [r for r in data.recordings if r not in judge]
    places = labelled(data, learn, count, np.random.default_rng(0), all_healthy=True)
    assert not set(data.recording[places]) & set(judge)
    assert counts_of(data, places) == count
    truth = data.piece_labels()[places]
    for label in (1, 2, 3):
        own = data.recording[places][truth == label]
        there = sum(data.labels[r] == label for r in learn)
        assert len(own) == count
        assert len(set(own)) == min(count, there)
    assert (truth == 0).sum() == len(data.pieces([r for r in learn if r in data.healthy()]))
    few = labelled(data, learn, count, np.random.default_rng(0), all_healthy=False)
    # The rig's healthy recordings are short: no more pieces can be labelled than there are.
    there = len(data.pieces([r for r in learn if r in data.healthy()]))
    assert (data.piece_labels()[few] == 0).sum() == min(count, there)
    every = labelled(data, learn, ALL, np.random.default_rng(0), all_healthy=False)
    assert sorted(every) == sorted(data.pieces(learn))


def test_the_baseline_is_that_of_healthy_recordings_not_judged(data: Measured) -> None:
    judge = judged(data, "recording", 1, 3, 0)
    kept = [h for h in data.healthy() if h not in judge]
    by_hand = np.prod([data.found.power[data.recording == h].mean(axis=0) for h in kept], axis=0) ** (1 / len(kept))
    np.testing.assert_allclose(baseline_of(data, judge), by_hand)


def plant(kind: str, backgrounds: tuple[str, ...] = ()) -> Plant:
    options = read_options().source
    assert isinstance(options, SourceOptions)
    small = {**vars(options), "pooled": (1, 2)}
    return Plant(
        kind, "x", backgrounds, ("healthy", "inner", "outer", "ball"), (1800.0,), 12_000.0, BEARINGS["6205"], 3,  # type: ignore[arg-type]
        SourceOptions(**small), IMAGE, 0,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["bare", "effects", "grafted"])
def test_the_source_is_whole_labelled_and_reproducible(kind: str) -> None:
    rng = np.random.default_rng(0)
    healthy = {"a": Background(0.1 * rng.standard_normal(12_000), 1750.0)}
    made, again = (simulate(plant(kind, ("a",)), healthy) for _ in range(2))
    assert (made["images"] == again["images"]).all()
    assert made["images"].shape == (3 * 4 * 2, 3, 8, IMAGE.orders.size)
    assert np.isfinite(made["images"]).all()
    assert np.bincount(made["labels"]).tolist() == [6, 6, 6, 6]
    assert np.bincount(made["machine"]).tolist() == [8, 8, 8]


def test_a_population_stands_on_its_own_backgrounds_alone() -> None:
    """A healthy recording that is judged must leave no trace: its samples may be anything."""
    rng = np.random.default_rng(1)
    kept = Background(rng.standard_normal(12_000), 1750.0)
    first = simulate(plant("grafted", ("a",)), {"a": kept, "judged": Background(np.ones(12_000), 1800.0)})
    second = simulate(plant("grafted", ("a",)), {"a": kept, "judged": Background(np.full(12_000, np.nan), 1.0)})
    assert (first["images"] == second["images"]).all()


def test_healthy_recordings_are_one_machine_at_one_speed_whose_level_alone_wanders() -> None:
    own = dataclasses.replace(plant("effects"), speeds_rpm=(900.0, 1800.0))
    still = dataclasses.replace(own, options=dataclasses.replace(own.options, remount_db=0.0))
    made, alike = (healthy_recordings(one, 3, 60, 0.5) for one in (own, still))
    assert len({x.size for x in made}) == 1
    change = [20 * np.log10(x.std() / y.std()) for x, y in zip(made, alike, strict=True)]
    assert np.std(change) == pytest.approx(0.25 * own.options.remount_db, rel=0.25)


def test_records_that_cannot_be_read_are_not_taken_for_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cwru").mkdir()
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    names = ("cwru",)
    assert set(at_hand(names, None, 0.6)) == {RIG}
    with pytest.raises(TwingapError, match="no CWRU recording"):
        at_hand(names, tmp_path, 0.6)
    (tmp_path / "cwru" / "105.mat").write_bytes(b"cut short")
    with pytest.raises(TwingapError, match=r"105\.mat"):
        at_hand(names, None, 0.6)


def test_the_study_says_what_it_stands_on_and_judges_every_method(study: Work, folder: Path) -> None:
    found = study.tables["availability-accuracy"]
    assert set(found["data"]) == {"virtual rig, not CWRU"}
    assert set(found["method"]) == {"twin network", "SVM", "SOM-MQE"}
    assert set(found["records a fault"]) == {"0", "1", "2", "all"}
    assert set(found[found["records a fault"] == "0"]["method"]) == {"twin network"}
    assert found["accuracy"].between(0, 1).all()
    choice = study.tables["availability-choice"].set_index(["labels of", "records a fault"])
    assert choice.loc[("any recording", "0"), "chosen"] == "twin network"
    assert choice.loc[("other bearings", "1"), "chosen"] == "corrected network"
    assert all("healthy windows" in why for why in choice["why"])
    sizes = study.tables["availability-size"]
    assert set(sizes["class"]) == {"inner", "outer", "ball"}
    for name in study.tables:
        assert (folder / "tables" / f"{name}.csv").is_file()
        assert "virtual rig, not CWRU" in (folder / "tables" / f"{name}.md").read_text().splitlines()[0]
    pictures = {p.name for p in (folder / "figures").iterdir()}
    assert pictures == {"availability-crossings.png", "availability-severity.png"}


def test_the_head_learns_from_labelled_records_alone_and_the_network_from_none(
    data: Measured, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[np.ndarray, np.ndarray, float]] = []
    told: list[np.ndarray] = []

    def watched(
        logits: np.ndarray, features: np.ndarray, labels: np.ndarray, reference: np.ndarray, options: HeadOptions
    ) -> ResidualHead:
        seen.append((features, reference, options.trust))
        told.append(logits)
        return fit_residual_head(logits, features, labels, reference, options)

    monkeypatch.setattr(availability_jobs, "fit_residual_head", watched)
    rng = np.random.default_rng(0)
    made = simulate(plant("grafted", ("a",)), {"a": Background(0.1 * rng.standard_normal(12_000), 1750.0)})
    training = InceptionTraining(steps=4, batch=8, checkpoints=2, width=4)
    job = NetworkJob("virtual_cwru", "grafted", 0, 3, 0, (1, 2, ALL), "infomax", training, HeadOptions(), IMAGE)
    found = network(job, {"virtual_cwru": data}, {"virtual_cwru grafted 0": made})
    rows = {row.tobytes(): place for place, row in enumerate(data.features)}
    assert len(rows) == len(data.features)
    calls = iter(seen)
    for split in SPLITS:
        judge = judged(data, split, 0, 3, 0)
        assert set(found[split]["rows"]) == {"0", "1", "2", str(ALL)}
        for count in (1, 2, ALL):
            assert set(found[split]["rows"][str(count)]["calls"]) == set(judge)
            for trust in (HeadOptions().trust, 0.0):  # with the network, and without
                features, reference, own = next(calls)
                assert own == trust
                for given in (features, reference):
                    used = {str(data.recording[rows[row.tobytes()]]) for row in given}
                    assert not used & set(judge)
                if count != ALL:
                    assert len(features) < len(reference)
    # The same network, whatever is labelled: its word on a piece is the same in every head of a split.
    for split in range(len(SPLITS)):
        each = told[split * 6 : (split + 1) * 6]
        known = {row.tobytes() for row in each[-1]}
        assert all(row.tobytes() in known for logits in each for row in logits)


def test_a_second_run_takes_all_from_the_store(study: Work, folder: Path, config: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("TWINGAP_DATA", raising=False)
        again = STUDY.run("tiny", out=folder, backend="sequential", config=config, draw=False)
    assert again.finished and not again.computed
    for name, table in study.tables.items():
        assert table.equals(again.tables[name])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('criterion = "infomax"', 'criterion = "oracle"', "criterion"),
        ('data = ["cwru", "hit_sm"]', 'data = ["ims"]', "data"),
        ("pooled = [1, 3, 6]", "pooled = [6, 1]", "pooled"),
        ("folds = 3", "folds = 1", "folds"),
        ("length = 0.5", "length = 0.0", "head: length"),
    ],
)
def test_a_wrong_entry_is_refused_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "availability.toml"
    text = CONFIG.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(TwingapError, match=message):
        read_options(path)
