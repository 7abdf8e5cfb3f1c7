"""Shallow adaptation beside paper 3, and probes of its network's layers: they adapt, choose without labels, add up."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest

from papers.extra.baselines import jobs
from papers.extra.baselines import study as tables
from papers.extra.layers import jobs as layers
from papers.extra.layers.study import STUDY as LAYERS
from papers.paper3_zoa_dann.comparison.task_files import Material
from papers.paper3_zoa_dann.comparison.trial import Trial
from papers.paper3_zoa_dann.inputs.options import read_options
from papers.paper3_zoa_dann.source import Recipe, simulate
from twingap.adapt import ModeInputs, Training, Windows
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.sweep import Result

CLASSES = ("healthy", "inner", "outer")


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    return Recipe(
        9.3e9, 400.0, 0.3, (1750.0,), 12000.0, BEARINGS["6205"], CLASSES, read_options().source, 3, 1, 512, 0
    )  # fmt: skip


@pytest.fixture(scope="module")
def material(recipe: Recipe) -> Material:
    """Windows of another population of the same twin: the bearings of one group are not adapted to."""
    made = simulate(dataclasses.replace(recipe, seed=5, bearings_per_class=2))
    known = np.char.endswith(made.group, "-0")
    return Material(made.take(known).unlabelled(), made.take(~known), ("0",), np.repeat(["1"], (~known).sum()))


@pytest.fixture(scope="module")
def labelled(recipe: Recipe) -> Windows:
    made = simulate(dataclasses.replace(recipe, seed=5, bearings_per_class=2))
    return made.take(np.char.endswith(made.group, "-0"))


def test_every_method_undoes_a_linear_change_of_the_features() -> None:
    rng = np.random.default_rng(0)
    means = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 5.0]])

    def rows(count: int) -> tuple[np.ndarray, np.ndarray]:
        labels = np.repeat(np.arange(3), count)
        return means[labels] + 0.5 * rng.standard_normal((3 * count, 2)), labels

    change, moved = np.diag([1.2, 0.9]), 4.0
    (source, labels), (target, _), (judged, truth) = rows(60), rows(60), rows(40)
    right = {
        method: [
            jobs.scores(
                jobs.adapted(method, setting, source, labels, target @ change + moved)(judged @ change + moved), truth
            )
            for setting in settings
        ]
        for method, settings in jobs.SETTINGS.items()
    }
    best = {method: max(own["accuracy"] for own in each) for method, each in right.items()}
    assert best[jobs.PLAIN] < 0.9 and all(own == 1.0 for method, own in best.items() if method != jobs.PLAIN), best


def test_scores_are_those_of_the_classes_present() -> None:
    told = np.array([[0.1, 0.8, 0.1], [0.1, 0.2, 0.7], [0.2, 0.3, 0.5], [0.6, 0.3, 0.1]])
    found = jobs.scores(told, np.array([1, 1, 2, 2]))
    assert found["accuracy"] == 0.5
    assert found["macro_f1"] == pytest.approx((2 / 3 + 0.5) / 2)
    assert found["auroc"] == pytest.approx((0.5 + 0.375) / 2)


def test_the_choice_does_not_see_the_labels_of_the_target(
    recipe: Recipe, material: Material, labelled: Windows
) -> None:
    job = jobs.Trial("B1", None, "contact twin", 0, "infomax", recipe)
    found = jobs.run_trial(job, material, labelled)
    assert set(found) == set(jobs.SETTINGS)
    turned = dataclasses.replace(material.evaluate, labels=(material.evaluate.labels + 1) % 3)  # type: ignore[operator]
    other = jobs.run_trial(job, dataclasses.replace(material, evaluate=turned), labelled)
    for method, own in found.items():
        assert own["setting"] == other[method]["setting"]
        assert own["unseen"]["accuracy"] == own["accuracy"] <= own["oracle"], "all judged bearings are unseen"
    (real,) = jobs.run_trial(dataclasses.replace(job, source="real labels"), material, labelled)
    assert real == jobs.PLAIN


def test_tests_are_of_pairs_of_task_and_seed() -> None:
    rows = pd.DataFrame(
        {
            "held_out": "recordings", "data": "CWRU", "source": "contact twin", "task": task, "seed": seed,
            "method": method, "accuracy": base + 0.1 * (method == "CORAL"), "oracle": 1.0, "macro_f1": 0.5,
            "auroc": 0.5,
        }
        for base, (task, seed) in zip((0.1, 0.3, 0.5, 0.7), (("A1", 0), ("A1", 1), ("A2", 0), ("A2", 1)), strict=True)
        for method in (jobs.PLAIN, "CORAL")
    )  # fmt: skip
    (row,) = tables.tests(rows).to_dict("records")
    assert row["gain"] == pytest.approx(10) and (row["pairs"], row["won"]) == (4, 4) and row["p"] == 2 / 16
    means = tables.means(rows).set_index("method")
    assert means.loc["CORAL", "accuracy"] == pytest.approx(0.5) and means.loc["CORAL", "trials"] == 4


def test_probes_and_checkpoints_add_up(recipe: Recipe, material: Material, labelled: Windows) -> None:
    training = Training(steps=2, batch=4, checkpoints=2, vary=True)
    inputs = ModeInputs(n_modes=2, max_iterations=10)
    jobs_of = [
        Trial("A3", "balanced", None, method, 0, None, training, inputs, "infomax", 0.3, 0.01, recipe)
        for method in ("Proposed", "Non-DN")
    ]
    values = [layers.probe(job, material, labelled) for job in jobs_of]
    assert list(values[0]["layers"]) == ["modes", *layers.LAYERS[:3], *layers.LAYERS[4:]]
    assert list(values[1]["layers"]) == ["modes", *layers.LAYERS[3:]]
    assert values[0]["layers"]["modes"] == values[1]["layers"]["modes"], "what comes before the network is the same"
    assert all(len(value["checkpoints"]) == 2 for value in values)
    found = [("made", Result(job, value, "", "", 0.0, "")) for job, value in zip(jobs_of, values, strict=True)]
    made = LAYERS.tables({"results": found})  # type: ignore[arg-type]
    every = pd.concat(made.values())
    np.testing.assert_allclose(every["all"], (every["healthy"] + 2 * every["faults"]) / 3)
    assert made["layers-checkpoints"].groupby("method")["chosen"].sum().eq(1).all()


def test_a_method_without_a_network_has_no_layers() -> None:
    options = LAYERS.read()
    with pytest.raises(TwingapError, match=r"'VMD\+SVM' found, one of"):
        dataclasses.replace(options, methods=("VMD+SVM",))
