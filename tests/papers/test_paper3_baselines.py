"""Baselines beside paper 3, and probes of its network's layers: they adapt, choose without labels, add up."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from papers.extra.baselines import jobs, population_twin
from papers.extra.baselines import study as tables
from papers.extra.baselines.adaptation import PLAIN, SETTINGS, adapted, scores
from papers.extra.layers import jobs as layers
from papers.extra.layers.study import STUDY as LAYERS
from papers.paper3_zoa_dann.comparison.task_files import Material
from papers.paper3_zoa_dann.comparison.trial import Trial
from papers.paper3_zoa_dann.inputs.options import read_options
from papers.paper3_zoa_dann.source import Recipe
from papers.paper3_zoa_dann.source import simulate as simulate_contact
from twingap import Condition, RecordSet, simulate
from twingap.adapt import ModeInputs, Training, Windows
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.sweep import Result
from twingap.twins.population import machines
from twingap.twins.twin_file import TwinSpec

CLASSES = ("healthy", "inner", "outer")


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    return Recipe(
        9.3e9, 400.0, 0.3, (1750.0,), 12000.0, BEARINGS["6205"], CLASSES, read_options().source, 3, 1, 512, 0
    )  # fmt: skip


@pytest.fixture(scope="module")
def material(recipe: Recipe) -> Material:
    """Windows of another population of the same twin: the bearings of one group are not adapted to."""
    made = simulate_contact(dataclasses.replace(recipe, seed=5, bearings_per_class=2))
    known = np.char.endswith(made.group, "-0")
    return Material(made.take(known).unlabelled(), made.take(~known), ("0",), np.repeat(["1"], (~known).sum()))


@pytest.fixture(scope="module")
def labelled(recipe: Recipe) -> Windows:
    made = simulate_contact(dataclasses.replace(recipe, seed=5, bearings_per_class=2))
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
            scores(
                adapted(method, setting, source, labels, target @ change + moved)(judged @ change + moved),
                truth,
            )
            for setting in settings
        ]
        for method, settings in SETTINGS.items()
    }
    best = {method: max(own["accuracy"] for own in each) for method, each in right.items()}
    assert best[PLAIN] < 0.9 and all(own == 1.0 for method, own in best.items() if method != PLAIN), best


def test_scores_are_those_of_the_classes_present() -> None:
    told = np.array([[0.1, 0.8, 0.1], [0.1, 0.2, 0.7], [0.2, 0.3, 0.5], [0.6, 0.3, 0.1]])
    found = scores(told, np.array([1, 1, 2, 2]))
    assert found["accuracy"] == 0.5
    assert found["macro_f1"] == pytest.approx((2 / 3 + 0.5) / 2)
    assert found["auroc"] == pytest.approx((0.5 + 0.375) / 2)


TWIN = {
    "model": "phenomenological",
    "effects": ["transfer_path"],
    "parameters": {
        "resonance_hz": 3000.0,
        "transfer_path": {
            "frequencies_hz": [500.0, 3000.0, 5500.0], "gains_db": [0.0, 0.0, 0.0],
            "outer": {"units": {"a": {"gains_db": [20.0, 0.0, 0.0]}, "b": {"gains_db": [-20.0, 0.0, 0.0]}}},
        },
    },
}  # fmt: skip


def trial_of(source: str, recipe: Recipe) -> jobs.Trial:
    inputs = ModeInputs(n_modes=2, max_iterations=10, quantity="envelope_spectrum")
    return jobs.Trial("B1", None, source, 0, "infomax", recipe, Training(steps=2, batch=4, checkpoints=2), inputs, 0.3)


@pytest.mark.parametrize("source", [jobs.CONTACT, jobs.POPULATION])
def test_the_choice_does_not_see_the_labels_of_the_target(
    recipe: Recipe, material: Material, labelled: Windows, source: str
) -> None:
    job = trial_of(source, recipe)
    found = jobs.run_trial(job, material, labelled, TWIN)
    assert set(found) == {*SETTINGS, jobs.NETWORK}
    turned = dataclasses.replace(material.evaluate, labels=(material.evaluate.labels + 1) % 3)  # type: ignore[operator]
    other = jobs.run_trial(job, dataclasses.replace(material, evaluate=turned), labelled, TWIN)
    for method, own in found.items():
        assert own["setting"] == other[method]["setting"]
        assert own["unseen"]["accuracy"] == own["accuracy"] <= own["oracle"], "all judged bearings are unseen"


def test_real_labels_teach_without_adaptation_alone(recipe: Recipe, material: Material, labelled: Windows) -> None:
    found = jobs.run_trial(trial_of(jobs.REAL, recipe), material, labelled, TWIN)
    assert list(found) == [PLAIN, jobs.NETWORK]


@pytest.mark.parametrize("source", [jobs.CONTACT, jobs.FLEETS, jobs.POPULATION])
def test_windows_of_a_simulated_source_are_of_every_class_and_come_again(
    recipe: Recipe, labelled: Windows, source: str
) -> None:
    job = trial_of(source, recipe)
    made, again = (jobs.source_windows(job, labelled, TWIN) for _ in range(2))
    assert made.labels is not None and set(made.labels) == {0, 1, 2}
    np.testing.assert_array_equal(made.samples, again.samples)
    pairs = set(zip(made.group, made.labels, strict=True))
    assert len(pairs) == len(set(made.group)), "a group has one class"
    other = jobs.source_windows(dataclasses.replace(job, recipe=dataclasses.replace(recipe, seed=1)), labelled, TWIN)
    assert not np.array_equal(made.samples, other.samples)


def low_part(windows: Windows) -> np.ndarray:
    """Part of the power below 1 kHz, by group, of windows of outer-race faults."""
    power = np.abs(np.fft.rfft(windows.samples, axis=1)) ** 2
    part = power[:, np.fft.rfftfreq(512, 1 / 12000.0) < 1000.0].sum(axis=1) / power.sum(axis=1)
    return np.array([part[windows.group == g].mean() for g in np.unique(windows.group[windows.labels == 2])])


def test_machines_of_a_population_differ_as_its_recordings_do(recipe: Recipe, labelled: Windows) -> None:
    job = trial_of(jobs.POPULATION, dataclasses.replace(recipe, bearings_per_class=8))
    values = {**TWIN["parameters"]["transfer_path"], "outer": {"gains_db": [0.0, 0.0, 0.0]}}  # type: ignore[index]
    single = TWIN | {"parameters": {**TWIN["parameters"], "transfer_path": values}}  # type: ignore[dict-item]
    drawn, same = (np.log(low_part(jobs.source_windows(job, labelled, twin))) for twin in (TWIN, single))
    assert drawn.size == same.size == 8
    assert drawn.std() > 3 * same.std(), "one machine where no fault has values of several recordings"


def recordings(seed: int = 0) -> RecordSet:
    """A healthy recording, and two of the outer race with paths of their own, as a rig names them."""
    bearing = BEARINGS["6205"]
    made = []
    for fault, hz in (("healthy", 3000.0), ("outer", 2000.0), ("outer", 4000.0)):
        parameters = {"resonance_hz": hz, "impact_amplitude": {"outer": 20.0}, "white_noise_rms": 1.0}
        spec = TwinSpec("phenomenological", ("slip_jitter",), None, parameters, bearing)
        name = f"{fault} {hz:g}"
        asked = Condition(name, 1750.0, 12000.0, 24000, fault, group=name, extra={"bearing_id": fault})
        made += list(simulate([asked], spec, seed=seed))
    return RecordSet.from_records("rig", "m/s^2", bearing, made)


def test_a_population_twin_is_fitted_to_records_that_do_not_tell_their_fault() -> None:
    every = recordings()
    own = population_twin.pieces(every)
    assert [c.fault for c in own.conditions] == [None] * 3
    assert [dict(c.extra) for c in own.conditions] == [{"unit": name} for name in every.groups], "no other column"
    states = jobs.states_without_labels(every, ("healthy", "inner", "outer"))
    assert states == {c.group: c.fault for c in every.conditions}, "plain faults are read right"
    assert states == jobs.states_without_labels(every.without_labels(), ("healthy", "inner", "outer"))
    assert set(jobs.states_without_labels(every, ("healthy", "inner")).values()) <= {"healthy", "inner"}


def test_the_fit_has_values_by_recording() -> None:
    own = population_twin.pieces(recordings())
    job = population_twin.Fit("own", ("healthy", "outer", "outer"), 0)
    found = population_twin.fit_population(job, {"own": own})
    assert found == json.loads(json.dumps(found))
    spec = TwinSpec(found["model"], tuple(found["effects"]), None, found["parameters"])
    one, two = (machine.parameters for _, machine in machines(spec, 2, np.random.default_rng(0)))
    assert one != two


def test_tests_are_of_pairs_of_task_and_seed() -> None:
    rows = pd.DataFrame(
        {
            "held_out": "recordings", "data": "CWRU", "source": "contact twin", "task": task, "seed": seed,
            "method": method, "accuracy": base + 0.1 * (method == "CORAL"), "oracle": 1.0, "macro_f1": 0.5,
            "auroc": 0.5,
        }
        for base, (task, seed) in zip((0.1, 0.3, 0.5, 0.7), (("A1", 0), ("A1", 1), ("A2", 0), ("A2", 1)), strict=True)
        for method in (PLAIN, "CORAL")
    )  # fmt: skip
    (row,) = tables.tests(rows).to_dict("records")
    assert (
        row["against"] == PLAIN
        and row["gain"] == pytest.approx(10)
        and (row["pairs"], row["won"]) == (4, 4)
        and row["p"] == 2 / 16
    )
    other = rows.assign(source=jobs.POPULATION, accuracy=rows["accuracy"] - 0.05)
    *_, last, against = tables.tests(pd.concat([rows, other])).to_dict("records")
    assert [(r["source"], r["method"], r["against"]) for r in (last, against)] == [
        (jobs.POPULATION, method, jobs.CONTACT) for method in (PLAIN, "CORAL")
    ]
    assert against["gain"] == pytest.approx(-5) and (against["lost"], against["p_holm"]) == (4, 2 * 2 / 16)
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
