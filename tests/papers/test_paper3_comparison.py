"""Paper 3's comparison: no leak in any task, target data as stated, exact tests, tables that do not mind the order."""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import os
import random
import re
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from papers.framework import Work
from papers.paper3_zoa_dann.comparison import tables as tables_comparison
from papers.paper3_zoa_dann.comparison.jobs import CONFIG, TaskOutcome, cells, trials
from papers.paper3_zoa_dann.comparison.jobs import read_options as read_comparison
from papers.paper3_zoa_dann.comparison.study import STUDY
from papers.paper3_zoa_dann.comparison.task_files import (
    FOLDER,
    Material,
    TaskFile,
    load_recordings,
    material,
    read_task,
    split,
)
from papers.paper3_zoa_dann.comparison.trial import ALL, ANALYST, CLOSED, OWN, Trial, noisy, run_trial
from papers.paper3_zoa_dann.inputs.options import read_options
from papers.paper3_zoa_dann.significance import holm, sign_flip
from papers.paper3_zoa_dann.source import Recipe, drawn_effect, simulate
from twingap.adapt import CRITERIA, METHODS, Windows
from twingap.bearing import BEARINGS
from twingap.effects import catalogue
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.rigs import make_rig
from twingap.sweep import Result
from twingap.track.folder import FolderTracker

NAMES = ("A1", "A2", "A3", "A4", "B1", "B2", "B3")
TASKS = {name: read_task(name) for name in NAMES}


def fake(task: TaskFile) -> RecordSet:
    """Recordings like those of the task, but of noise; the healthy one at 1 hp comes in pieces, as at hand."""
    conditions: list[Condition] = []
    if task.data_set == "cwru":
        for c in make_rig("virtual_cwru", duration_s=0.5).records(0).conditions:
            if c.fault == "healthy" and c.extra["load_hp"] == 1:
                pieces = [
                    dataclasses.replace(c, name=f"{c.name}_{i}", n_samples=1024, group=c.name, extra=dict(c.extra))
                    for i in range(100)
                ]
                conditions += pieces
            else:
                conditions.append(c)
    else:
        for speed in (600.0, 900.0, 1200.0):
            faulty = [(f"{fault[0].upper()}R{arc}", fault, arc) for fault in ("inner", "outer") for arc in (2, 5, 8)]
            for name, fault, arc in [("Normal", "healthy", 0), *faulty]:
                extra = {"defect_arc_deg": arc, "bearing_id": "healthy" if arc == 0 else name}
                conditions.append(Condition(f"{name}_{speed:g}", speed, task.fs_hz, 6000, fault, extra=extra))

    def noise(i: int) -> Any:
        return np.random.default_rng(i).standard_normal(conditions[i].n_samples)

    return RecordSet(task.data_set, "g", BEARINGS["6205"], conditions, noise)


def check_no_leak(task: TaskFile, records: RecordSet) -> None:
    for unseen in (None, *task.sizes) if task.same_bearings else task.sizes:
        sides, labelled = split(task, records, unseen)
        assert not set(sides.adapt.groups) & set(sides.evaluate.groups)
        assert not {c.name for c in sides.adapt.conditions} & {c.name for c in sides.evaluate.conditions}
        assert all(c.fault is None for c in sides.adapt.conditions)
        for held in (labelled, sides.evaluate):
            assert {c.fault for c in held.conditions} == set(task.classes)
        adapted = {c.extra["bearing_id"] for c in sides.adapt.conditions}
        judged = {c.extra["bearing_id"] for c in sides.evaluate.conditions}
        if unseen is None:
            assert judged == adapted, "the same bearings in other recordings"
        else:
            assert adapted & judged == {"healthy"}, "there is but one healthy bearing"


# -- tasks ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_no_recording_is_on_both_sides(name: str) -> None:
    check_no_leak(TASKS[name], fake(TASKS[name]))


@pytest.mark.data
@pytest.mark.skipif("TWINGAP_DATA" not in os.environ, reason="needs real records: set TWINGAP_DATA")
@pytest.mark.parametrize("name", NAMES)
def test_no_real_recording_is_on_both_sides(name: str) -> None:
    target = load_recordings(TASKS[name], None, read_options().target, 0.5)
    assert target is not None and not target.title.startswith("virtual")
    check_no_leak(TASKS[name], target.records)


@pytest.mark.parametrize("name", NAMES)
def test_windows_are_as_many_of_each_class_as_stated(name: str) -> None:
    task, records = TASKS[name], fake(TASKS[name])
    fault = {str(c.group): c.fault for c in records.conditions}
    bearing = {str(c.group): c.extra["bearing_id"] for c in records.conditions}
    for available, unseen in itertools.product(task.available, (None, task.sizes[1])):
        if unseen is None and not task.same_bearings:
            continue
        own = material(task, records, available, unseen)
        assert own.adapt.labels is None
        assert Counter(fault[g] for g in own.adapt.group) == task.available[available]
        assert own.evaluate.labels is not None
        assert Counter(task.classes[i] for i in own.evaluate.labels) == task.judged
        for windows in (own.adapt, own.evaluate):
            each = Counter(windows.group)
            for one in task.classes:
                counts = [n for g, n in each.items() if fault[g] == one]
                assert max(counts) - min(counts) <= 1, "no recording outweighs another of its class"
        # The strict column: bearings of which nothing was adapted to, and all of those.
        assert not {bearing[g] for g in own.adapt.group} & set(own.bearing[own.unseen])
        healthy = np.array([fault[g] == "healthy" for g in own.evaluate.group])
        np.testing.assert_array_equal(own.unseen, np.zeros_like(healthy) if unseen is None else ~healthy)


def test_states_of_the_target_data_are_what_their_names_say() -> None:
    for task in TASKS.values():
        balanced, imbalanced, scarce = (task.available[name] for name in ("balanced", "imbalanced", "scarce"))
        assert len(set(balanced.values())) == len(set(scarce.values())) == 1
        assert sum(imbalanced.values()) == sum(balanced.values()) == 10 * sum(scarce.values())
        assert imbalanced["healthy"] == pytest.approx(0.7 * sum(imbalanced.values()))
        assert len(set(task.judged.values())) == 1


def test_a_recording_in_pieces_gives_windows_from_all_over_it() -> None:
    own = material(TASKS["A2"], fake(TASKS["A2"]), "balanced", None)
    healthy = own.evaluate.samples[own.evaluate.labels == 0]
    assert healthy.shape == (60, 1024) and len(np.unique(healthy[:, 0])) == 60


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("A1", "\nadapt_at = [2]", "\nadapt_at = [0]", "faulty recordings of one condition"),
        ("A1", "healthy_adapt_at = [2]", "healthy_adapt_at = [0]", "healthy recordings of one condition"),
        ("B1", "outer = 6\n", "ball = 6\n", "scarce: at least 1 window"),
        ("A1", 'name = "A1"', 'name = "A9"', "calls itself 'A9'"),
        ("A1", "sizes = [0.007", "sizes = [0.009", "no ball, inner, outer recording to judge on"),
    ],
)
def test_a_task_that_leaks_or_misspells_is_refused(tmp_path: Path, name: str, old: str, new: str, message: str) -> None:
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / f"{name}.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(TwingapError, match=message):
        task = read_task(name, tmp_path)
        split(task, fake(task), task.sizes[0])


def test_a_task_without_a_bearing_to_leave_out_is_refused() -> None:
    with pytest.raises(TwingapError, match="some bearings must be left out"):
        split(TASKS["B1"], fake(TASKS["B1"]), None)
    with pytest.raises(TwingapError, match="use one of A1, A2"):
        read_task("A7")


# -- trials -----------------------------------------------------------------------------------------------------------

RECIPE = Recipe(
    9e9, 400.0, 0.3, (1797.0,), 12000.0, BEARINGS["6205"], ("healthy", "inner"), read_options().source, 2, 1, 512, 0
)


def planned(name: str, profile: str) -> list[Trial]:
    options, common = read_comparison(), read_options()
    size, task = options.profiles[profile], TASKS[name]
    return [t for c in cells(task, size, 0) for t in trials(task, c, RECIPE, options, common, size, 0)]


@pytest.mark.parametrize("name", NAMES)
def test_core_is_a_part_of_full_and_nothing_runs_twice(name: str) -> None:
    core, full = planned(name, "core"), planned(name, "full")
    assert set(core) < set(full) and len(set(full)) == len(full) == len({t.words for t in full})
    for trial in full:
        if trial.unseen is not None:
            assert trial.unseen == TASKS[name].unseen(trial.seed), "the seed says which bearings are left out"
    # Every seed meets every method in every state: pairs are complete.
    states: dict[tuple[Any, ...], set[str]] = {}
    for t in full:
        states.setdefault((t.available, t.unseen, t.snr_db, t.seed), set()).add(t.method)
    assert all(methods == set(ALL) for methods in states.values())


def test_a_closed_gap_changes_the_source_and_nothing_else() -> None:
    own = [t for t in planned("A3", "core") if t.seed == 0 and t.snr_db is None and t.unseen is None]
    of = {t.method: t for t in own}
    for closed, plain in CLOSED.items():
        assert of[closed].recipe.closed == read_comparison().closed["A"] and not of[plain].recipe.closed
        bare = dataclasses.replace(of[closed], method=plain, recipe=of[plain].recipe)
        assert dataclasses.replace(bare, embedded=of[plain].embedded) == of[plain]


@pytest.mark.parametrize("name", catalogue())
def test_every_effect_can_be_drawn(name: str) -> None:
    drawn = [drawn_effect(name, 12000.0, np.random.default_rng(seed)) for seed in range(30)]
    for field in dataclasses.fields(drawn[0]):
        if not field.metadata.get("fitted", True) or "plausible" not in field.metadata:
            continue
        values = [getattr(effect, field.name) for effect in drawn]
        low, high = field.metadata["plausible"]
        assert low <= min(values) < max(values) <= high
        if field.type in (bool, "bool"):
            assert set(values) == {True, False}


def test_effects_of_a_closed_gap_are_plausible_and_some_bearings_have_them() -> None:
    rng = np.random.default_rng(0)
    drawn = [drawn_effect("drive_interference", 12000.0, rng) for _ in range(200)]
    carriers = np.array([getattr(effect, "carrier_hz") for effect in drawn])  # noqa: B009
    assert carriers.min() >= 500 and 4500 < carriers.max() <= 5400, "no more than 0.45 of the sampling rate"
    closed = dataclasses.replace(RECIPE, closed=("shaft_harmonics",), bearings_per_class=6)
    made, plain = simulate(closed), simulate(dataclasses.replace(closed, closed=()))
    changed = changed_by(made, plain)
    assert 0 < len(changed) < len(set(made.group)), "by lot, and all else is as it was"
    numbers = {fault: {g.split("-")[1] for g in changed if g.startswith(fault)} for fault in RECIPE.classes}
    assert numbers["healthy"] != numbers["inner"], "each class has lots of its own"
    other = dataclasses.replace(closed, seed=1)
    assert changed_by(simulate(other), simulate(dataclasses.replace(other, closed=()))) != changed, "as has each seed"


def changed_by(made: Windows, plain: Windows) -> set[str]:
    """Virtual bearings whose windows differ."""
    return {str(g) for g, a, b in zip(made.group, made.samples, plain.samples, strict=True) if not np.allclose(a, b)}


def test_the_own_method_sees_one_judged_recording_at_a_time() -> None:
    task = TASKS["A3"]
    own = material(task, fake(task), "scarce", None)
    recipe = dataclasses.replace(RECIPE, classes=task.classes, window_samples=2048, bearings_per_class=1)
    base = next(t for t in planned("A3", "core") if t.method == OWN and t.snr_db is None)
    trial = dataclasses.replace(base, recipe=recipe)
    whole = run_trial(trial, own)["probabilities"]
    first = own.evaluate.group == own.evaluate.group[0]
    alone = dataclasses.replace(own, evaluate=own.evaluate.take(first), bearing=own.bearing[first])
    np.testing.assert_allclose(run_trial(trial, alone)["probabilities"], whole[first], atol=1e-6)
    # What is told of a window is told of that window, wherever it stands,
    turned = np.arange(len(own.evaluate))[::-1]
    backwards = dataclasses.replace(own, evaluate=own.evaluate.take(turned), bearing=own.bearing[turned])
    np.testing.assert_allclose(run_trial(trial, backwards)["probabilities"], whole[turned], atol=1e-6)
    assert np.unique(whole, axis=0).shape[0] > 1
    # and beside the recordings that were adapted to: the louder it is than those, the likelier it has a fault.
    quiet = dataclasses.replace(own.adapt, samples=0.1 * own.adapt.samples)
    louder = run_trial(trial, dataclasses.replace(own, adapt=quiet))["probabilities"]
    healthy = task.classes.index("healthy")
    assert louder[:, healthy].mean() < whole[:, healthy].mean()


def test_noise_is_the_same_for_all_methods_and_at_the_stated_ratio() -> None:
    own = material(TASKS["A3"], fake(TASKS["A3"]), "balanced", None).evaluate
    first = planned("A3", "full")[0]
    at = [dataclasses.replace(first, method=method, snr_db=-5.0) for method in ("DANN", "Proposed")]
    one, two = (noisy(own, trial, 4).samples for trial in at)
    np.testing.assert_array_equal(one, two)
    assert noisy(own, first, 4) is own and first.snr_db is None
    ratio = 10 * np.log10(np.var(own.samples) / np.var(one - own.samples))
    assert ratio == pytest.approx(-5.0, abs=0.1)
    other = noisy(own, dataclasses.replace(at[0], seed=1), 4).samples
    assert abs(np.corrcoef((one - own.samples).ravel(), (other - own.samples).ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("snr_db", [-5.0, 10.0])
def test_noise_has_the_stated_ratio_in_each_recording(snr_db: float) -> None:
    level = np.repeat([0.1, 5.0], 40)
    x = level[:, None] * np.random.default_rng(0).standard_normal((80, 512)) + 3.0
    windows = Windows(x, np.full(80, 12e3), np.full(80, 1800.0), np.repeat(["a", "b"], 40), None)
    noise = noisy(windows, dataclasses.replace(planned("A3", "full")[0], snr_db=snr_db), 4).samples - x
    for part in (slice(0, 40), slice(40, 80)):
        ratio = 10 * np.log10(x[part].var() / noise[part].var())
        assert ratio == pytest.approx(snr_db, abs=0.15)
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1])) < 0.02 * noise.var(), "white"


# -- significance -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_sign_flips_agree_with_counting_them_all(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(5):
        differences = np.round(rng.normal(0.03, 0.05, n), 2)  # ties and zeros among them
        units = np.rint(differences * 100).astype(int)
        sums = [abs(int(np.dot(signs, units))) for signs in itertools.product((-1, 1), repeat=n)]
        assert sign_flip(differences) == pytest.approx(np.mean(np.array(sums) >= abs(units.sum())), abs=1e-12)


def test_sign_flips_at_their_limits() -> None:
    assert sign_flip([]) == sign_flip([0.0, 0.0]) == 1.0
    assert sign_flip([0.1] * 42) == pytest.approx(2.0**-41, rel=1e-9), "exact where flips cannot be counted one by one"
    assert sign_flip([0.1, -0.1]) == 1.0


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([]) == []


# -- tables -----------------------------------------------------------------------------------------------------------


def made_up(names: tuple[str, ...] = ("A1", "A3", "B2"), profile: str = "core") -> list[TaskOutcome]:
    """Outcomes with results drawn at random; Proposed is 10 points above DANN, which is the best rival."""
    outcomes = []
    for name in names:
        task = TASKS[name]
        records, results = fake(task), []
        materials: dict[Any, Material] = {}
        for trial in planned(name, profile):
            key = (trial.available, trial.unseen)
            if key not in materials:
                materials[key] = material(task, records, *key)
            rng = np.random.default_rng([trial.seed, NAMES.index(name), trial.snr_db is None])
            base = float(rng.uniform(0.4, 0.6))
            value = base + {"Proposed": 0.1, "DANN": 0.0}.get(trial.method, -0.01 * (1 + ALL.index(trial.method)))
            part = {"accuracy": value - 0.2, "oracle_accuracy": value, "recordings_right": 1, "recordings": 3}
            results.append(
                Result(
                    trial,
                    {
                        "accuracy": value, "balanced_accuracy": value, "oracle_accuracy": value + 0.05,
                        "confusion": rng.integers(0, 9, (len(task.classes),) * 2), "recordings_right": 2,
                        "recordings": 4, "accuracy_by_checkpoint": [value], "history": [], "device": "cpu",
                        "accuracy_by_criterion": {} if trial.method in (ANALYST, "VMD+SVM") else {"infomax": value},
                        "unseen": None if trial.unseen is None else part,
                        "source_accuracy": None if trial.method == ANALYST else 0.9,
                    },
                    trial.words, "", 1.0, "",
                )
            )  # fmt: skip
        identified = {key: {"stiffness": 1e10} for key in materials}
        outcomes.append(TaskOutcome(task, f"made up {task.family}", materials, identified, results))
    return outcomes


@pytest.fixture(scope="module")
def outcomes() -> list[TaskOutcome]:
    return made_up()


def tables_of(outcomes: list[TaskOutcome]) -> dict[str, pd.DataFrame]:
    return tables_comparison.tables_of(read_comparison(), read_options(), outcomes)


@pytest.fixture(scope="module")
def tables(outcomes: list[TaskOutcome]) -> dict[str, pd.DataFrame]:
    return tables_of(outcomes)


def test_tables_do_not_depend_on_the_order_of_trials(
    outcomes: list[TaskOutcome], tables: dict[str, pd.DataFrame]
) -> None:
    dealer, dealt = random.Random(0), []
    for outcome in dealer.sample(outcomes, len(outcomes)):
        shuffled = dealer.sample(list(outcome.trials), len(outcome.trials))
        turned = dict(reversed(list(outcome.materials.items())))
        dealt.append(dataclasses.replace(outcome, trials=shuffled, materials=turned))
    assert [outcome.task.name for outcome in dealt] != [outcome.task.name for outcome in outcomes]
    for name, table in tables_of(dealt).items():
        pd.testing.assert_frame_equal(table, tables[name], check_exact=True)


def test_tables_say_what_was_put_in(tables: dict[str, pd.DataFrame]) -> None:
    made = tables
    for name, table in made.items():
        assert "data" in table.columns, f"{name}: every row says whose data it is of"
    by_task = made["comparison-accuracy"].set_index(["task", "method"])
    assert (by_task["oracle"] - by_task["accuracy"]).to_numpy() == pytest.approx(0.05)
    assert by_task["strict_seeds"].eq(3).all(), "from trials of their own for A, from the same for B"
    same = by_task.loc["B2"]
    assert (same["accuracy"] - same["strict"]).to_numpy() == pytest.approx(0.2)
    found = made["comparison-published"].set_index(["data", "figure"])
    leads = found.loc[[i for i in found.index if i[1].startswith("lead of Proposed")]]
    assert leads["ours"].to_numpy() == pytest.approx(10.0)
    assert leads["paper"].tolist() == [2.27, 13.12, 3.83, 11.65] and leads["ours, oracle"].isna().all()
    assert found["paper"].dropna().tolist()[:1] == [81.09]
    tests = made["comparison-tests"].set_index(["family", "noise", "reference", "method"])
    row = tests.loc[[("A", "no noise added", "Proposed", "DANN")]].iloc[0]
    assert (row["pairs"], row["won"], row["lost"]) == (6, 6, 0)
    assert row["lead"] == pytest.approx(10.0)
    assert row["p"] == pytest.approx(2 / 2**6) and row["p_holm"] == pytest.approx((len(ALL) - 1) * 2 / 2**6)
    noisy = made["comparison-high-noise"]
    assert set(noisy["method"]) == set(ALL) and made["comparison-low-noise"].empty, "core has no low noise"


def test_means_are_over_tasks_first(outcomes: list[TaskOutcome], tables: dict[str, pd.DataFrame]) -> None:
    means = tables["comparison-mean"]
    own = means[(means["family"] == "A") & (means["available"] == "all") & (means["method"] == "DANN")]
    each = [
        [t.value["accuracy"] for t in o.trials if (t.job.method, t.job.snr_db, t.job.unseen) == ("DANN", None, None)]
        for o in outcomes[:2]
    ]
    assert own["accuracy"].item() == pytest.approx(np.mean(each))
    assert own["accuracy_std"].item() == pytest.approx(np.mean(each, axis=0).std(ddof=1))


# -- the whole --------------------------------------------------------------------------------------------------------

TINY = """
[profiles.tiny]
tasks = ["A3", "B1"]
available = ["balanced"]
seeds = 1
strict_seeds = 0
noise_seeds = [1]
snr_db = [-5.0]
steps = 2
bearings_per_class = 2
records_per_bearing = 1
evaluations = 0
rig_duration_s = 0.3
"""


def tiny(folder: Path) -> tuple[Path, Path]:
    """Configuration and task files of a run of seconds."""
    config, tasks = folder / "comparison.toml", folder / "tasks"
    text = CONFIG.read_text(encoding="utf-8")
    for name, small in {"checkpoints": "2", "embedded": "6", "n_modes": "2", "batch": "4"}.items():
        text = re.sub(rf"(?m)^{name} = \d+", f"{name} = {small}", text)
    text = text.replace('quantity = "modes"', 'max_iterations = 10\nquantity = "modes"')
    config.write_text(text + TINY, encoding="utf-8")
    shutil.copytree(FOLDER, tasks)
    task = (tasks / "A3.toml").read_text(encoding="utf-8").replace("= 2048", "= 512")
    task = re.sub(r"(?m)^(healthy|inner|outer|ball) = \d+", r"\1 = 3", task)
    (tasks / "A3.toml").write_text(task, encoding="utf-8")
    return config, tasks


def tiny_run(folder: Path, out: Path, **more: Any) -> Work:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("TWINGAP_DATA", raising=False)
        config = folder / "comparison.toml"
        return STUDY.run("tiny", out=out, backend="sequential", config=config, device="cpu", **more)


def test_a_run_is_tracked_and_taken_up_again(tmp_path: Path) -> None:
    tiny(tmp_path)
    with FolderTracker(tmp_path / "runs").run("paper3") as log:
        whole = tiny_run(tmp_path, tmp_path / "one", log=log, draw=False)
    assert whole.computed == 1 + 2 * len(ALL) and whole.missing == ("B1",), "HIT-SM has no stand-in"
    assert set(whole.tables["comparison-trials"]["data"]) == {"virtual rig, not CWRU"}
    trials_run = [t for o in whole["outcomes"] for t in o.trials]
    assert {t.job.method for t in trials_run} == {*METHODS, *CLOSED, OWN, ANALYST}
    for t in trials_run:
        assert set(t.value["accuracy_by_criterion"]) in (set(), set(CRITERIA))
        assert t.value["oracle_accuracy"] >= t.value["accuracy"] - 1e-12
    metrics = list((tmp_path / "runs").rglob("metrics.csv"))
    assert len(metrics) == 1 + len(ALL) + 2 * len(ALL), "the whole, methods, and a run each for seed and noise"
    # An interruption loses what was not done: those, and only those, are run again, and the tables are the same.
    shutil.copytree(tmp_path / "one" / "results", tmp_path / "two" / "results")
    lost = {t.key for t in trials_run[3:6]}
    for path in list((tmp_path / "two" / "results").rglob("*")):
        if path.is_file() and path.stem in lost:
            path.unlink()
    again = tiny_run(tmp_path, tmp_path / "two")
    assert again.computed == len(lost)
    for path in (tmp_path / "one" / "tables").iterdir():
        assert (tmp_path / "two" / "tables" / path.name).read_bytes() == path.read_bytes()
    figures = {p.stem for p in (tmp_path / "two" / "figures").iterdir()}
    assert figures == {
        "comparison-accuracy-balanced", "comparison-noise", "comparison-confusion-A3-clean",
        "comparison-confusion-A3-noisy", "comparison-tsne-A3-clean", "comparison-tsne-A3-noisy",
    }  # fmt: skip


def test_scarce_data_alone_and_no_noise_make_tables_and_figures(tmp_path: Path) -> None:
    config, _ = tiny(tmp_path)
    text = config.read_text(encoding="utf-8")
    kept, own = text.split("[profiles.tiny]")
    for old, new in (('["balanced"]', '["scarce"]'), ("[1]", "[]"), ("[-5.0]", "[]")):
        assert own.count(old) == 1
        own = own.replace(old, new)
    config.write_text(kept + "[profiles.tiny]" + own, encoding="utf-8")
    made = tiny_run(tmp_path, tmp_path / "out")
    trials_run = [t.job for o in made["outcomes"] for t in o.trials]
    assert len(trials_run) == len(ALL) and {(t.available, t.snr_db) for t in trials_run} == {("scarce", None)}
    means = made.tables["comparison-mean"]
    assert set(means["method"]) == set(ALL) and set(means["available"]) == {"all"}
    assert {p.stem for p in (tmp_path / "out" / "figures").iterdir()} == {"comparison-accuracy-scarce"}


# -- configuration and command line -----------------------------------------------------------------------------------


def test_every_entry_of_a_task_is_explained() -> None:
    for path in FOLDER.glob("*.toml"):
        for line in path.read_text(encoding="utf-8").split("[judged]")[0].splitlines():
            assert not re.match(r"\w+ =", line) or "#" in line, f"{path.name}: {line}"
    lines = inspect.getsource(TaskFile).splitlines()
    for name in TaskFile.__dataclass_fields__:
        (place,) = (i for i, line in enumerate(lines) if line.strip().startswith(f"{name}: "))
        assert "#" in lines[place] or lines[place - 1].strip().startswith("#") or name.endswith("_samples"), name


def test_records_that_cannot_be_read_are_not_taken_for_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cwru").mkdir()
    (tmp_path / "cwru" / "105.mat").write_bytes(b"cut short")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=r"105\.mat"):
        load_recordings(TASKS["A1"], None, read_options().target, 0.5)


def test_wrong_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="nowhere"):
        STUDY.run(out=tmp_path, root=tmp_path / "nowhere")
    bad = tmp_path / "bad.toml"
    bad.write_text(CONFIG.read_text(encoding="utf-8").replace('"DACD"]', '"CORAL"]'), encoding="utf-8")
    with pytest.raises(TwingapError, match="'CORAL' found, one of"):
        read_comparison(bad)
    for counts in ("[2, 2, 2]", "[2, 2, 2, 4]"):
        text = CONFIG.read_text(encoding="utf-8").replace("noise_seeds = [2, 2, 2, 3]", f"noise_seeds = {counts}")
        bad.write_text(text, encoding="utf-8")
        with pytest.raises(TwingapError, match="one of 0 to seeds = 3 for each of snr_db expected"):
            read_comparison(bad)


def test_noise_levels_have_seeds_of_their_own() -> None:
    found = planned("B1", "balanced")
    assert {snr: sorted({t.seed for t in found if t.snr_db == snr}) for snr in {t.snr_db for t in found}} == {
        None: [0, 1, 2], 10.0: [0, 1], 5.0: [0, 1], 0.0: [0, 1], -5.0: [0, 1, 2],
    }  # fmt: skip
    assert {t.unseen for t in found if t.snr_db == -5.0} == {2.0, 5.0, 8.0}, "every size is left out at the high noise"
