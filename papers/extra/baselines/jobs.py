"""Shallow domain adaptation by skada on order features, under the protocol of paper 3's comparison.

task --prepared--> cell: adapt (no labels) | judge; recipe
    source: contact twin | simulated fleets | real labels --order_features--> labelled rows
    labelled rows + adapt --method, each setting--> label-free choice of the setting --> judge (other recordings)

Tasks, split, windows, identification and criterion are the comparison's. "Real labels" teaches with the true labels of
the recordings adapted to: no method may do so, and it shows what the features allow at all.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.framework import Result, Work
from papers.paper3_zoa_dann.comparison.jobs import Prepared, cells, prepared
from papers.paper3_zoa_dann.comparison.task_files import Material, windows_to_adapt_to
from papers.paper3_zoa_dann.comparison.trial import fleet_examples
from papers.paper3_zoa_dann.inputs.options import read_options as read_common
from papers.paper3_zoa_dann.source import Recipe, simulate
from twingap import Bearing, TwingapError
from twingap.adapt import CRITERIA, Evidence, Outputs, Windows
from twingap.adapt.order_features import names, order_features

Labels = NDArray[np.int64]

SOURCES: Final = ("contact twin", "simulated fleets", "real labels")
PLAIN: Final = "No adaptation"
SETTINGS: Final[Mapping[str, tuple[Any, ...]]] = {
    PLAIN: (0.01, 0.1, 1.0),
    "CORAL": ("auto", 0.1, 0.5),
    "Subspace alignment": (5, 10, 20),
    "LinOT": (0.001, 0.01, 0.1),
    "JDOT": (0.1, 0.5, 0.9),
}
"""Method -> settings to choose from without target labels: inverse penalty of the classifier, shrinkage of the
covariances, components, ridge of the covariances, weight of the labels in the transport's cost."""
PENALTY: Final = 0.1
"""Inverse penalty of the logistic regression behind every adaptation; smaller makes flatter probabilities."""
MOST: Final = 1000  # most source rows; the transport of JDOT takes time in proportion


@dataclass(frozen=True)
class Trial:
    """Every method on a task, taught by one source; `seed` draws the source."""

    task: str
    unseen: float | None  # size whose bearings are left out of adaptation
    source: str  # one of `SOURCES`
    seed: int
    criterion: str  # label-free, key of `twingap.adapt.CRITERIA`
    recipe: Recipe  # of the simulated windows


def trials(ready: Prepared, task: str, criterion: str) -> Iterator[Trial]:
    """Every source at each seed of a cell."""
    for seed in ready.cell.seeds:
        recipe = dataclasses.replace(ready.recipe, seed=seed)
        for source in SOURCES:
            yield Trial(task, ready.cell.unseen, source, seed, criterion, recipe)


def results(work: Work) -> Iterator[tuple[str, Result[Trial]]]:
    """Every trial with the title of its data; balanced data, no noise added."""
    criterion = read_common().judging.criterion
    for task, target in work["tasks"]:
        chosen = [cell for cell in cells(task, work.size, work.seed) if cell.available == "balanced"]
        for ready in prepared(work, task, target, chosen):
            labelled = windows_to_adapt_to(task, target.records, "balanced", ready.cell.unseen)
            made = work.sweep(
                run_trial, trials(ready, task.name, criterion),
                ready.inputs | {"labelled": (labelled, None)},
                lambda job: f"{job.task}, {job.source}, unseen {job.unseen}, seed {job.seed}", f"task {task.name}",
            )  # fmt: skip
            yield from ((target.title, own) for own in made)


def run_trial(job: Trial, material: Material, labelled: Windows) -> dict[str, dict[str, Any]]:
    """Fit every method with each of its settings, choose the setting without target labels, judge: method -> `scores`
    of all judged windows, ``unseen`` (those of bearings not adapted to, or None) and the setting. `labelled`, the
    windows adapted to with their labels, are for the source "real labels" alone."""
    bearing, real = job.recipe.bearing, job.source == "real labels"
    rows, labels = _rows(labelled, bearing) if real else _simulated(job.source, job.recipe)
    target, truth = order_features(material.adapt, bearing), material.evaluate.labels
    judged, seen = order_features(material.evaluate, bearing), material.unseen
    assert truth is not None
    found: dict[str, dict[str, Any]] = {}
    for method in (PLAIN,) if real else SETTINGS:
        place, fitted = chosen(method, rows, labels, target, job.criterion)
        # Only from here on are target labels looked at.
        told = [each(judged) for each in fitted]
        found[method] = _at(place, told, truth) | {
            "unseen": _at(place, [p[seen] for p in told], truth[seen]) if seen.any() else None,
            "setting": str(SETTINGS[method][place]),
        }
    return found


def chosen(
    method: str, rows: Array, labels: Labels, target: Array, criterion: str
) -> tuple[int, list[Callable[[Array], Array]]]:
    """Fit a method with each of its settings; place of the one chosen without target labels, and `adapted` of each."""
    fitted = [adapted(method, setting, rows, labels, target) for setting in SETTINGS[method]]
    evidence = [Evidence(_outputs(each, rows), labels, _outputs(each, target)) for each in fitted]
    return int(np.argmax([CRITERIA[criterion](own) for own in evidence])), fitted


def _at(place: int, told: Sequence[Array], truth: Labels) -> dict[str, Any]:
    every = [scores(probabilities, truth) for probabilities in told]
    return every[place] | {"oracle": max(own["accuracy"] for own in every)}


def adapted(method: str, setting: Any, rows: Array, labels: Labels, target: Array) -> Callable[[Array], Array]:
    """Fit one method of `SETTINGS` to labelled rows and unlabelled target rows [rows, features]: a function from target
    rows to probabilities [rows, classes]."""
    import sklearn
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    if method == PLAIN:
        model = make_pipeline(StandardScaler(), LogisticRegression(C=setting, max_iter=2000)).fit(rows, labels)
        return lambda x: np.asarray(model.predict_proba(x))
    # skada changes scikit-learn's settings for the whole process.
    with sklearn.config_context(enable_metadata_routing=True):
        try:
            import skada
        except ModuleNotFoundError:
            raise TwingapError(f"{method} needs skada", mend='pip install "twingap[papers]"') from None
        base = LogisticRegression(C=PENALTY, max_iter=2000)
        adapters: dict[str, Callable[[], tuple[Any, ...]]] = {
            "CORAL": lambda: (skada.CORALAdapter(reg=setting), base),
            "Subspace alignment": lambda: (
                skada.SubspaceAlignmentAdapter(min(setting, *target.shape), random_state=0), base,
            ),
            "LinOT": lambda: (skada.LinearOTMappingAdapter(reg=setting), base),
            "JDOT": lambda: (skada.JDOTClassifier(base, alpha=setting),),
        }  # fmt: skip
        pipeline = skada.make_da_pipeline(StandardScaler(), *adapters[method]())
        domain = np.repeat([1, -2], [len(rows), len(target)])
        masked = np.concatenate([labels, np.full(len(target), -1)])
        pipeline.fit(np.concatenate([rows, target]), masked, sample_domain=domain)

    def probabilities(x: Array) -> Array:
        with sklearn.config_context(enable_metadata_routing=True):
            return np.asarray(pipeline.predict_proba(x))

    return probabilities


def scores(probabilities: Array, labels: Labels) -> dict[str, float]:
    """Accuracy, macro-F1 and macro-AUROC (one against the rest), over the classes that are among the labels."""
    from sklearn.metrics import f1_score, roc_auc_score

    present, predicted = np.unique(labels), probabilities.argmax(axis=1)
    return {
        "accuracy": float(np.mean(predicted == labels)),
        "macro_f1": float(f1_score(labels, predicted, labels=present, average="macro", zero_division=0)),
        "auroc": float(np.mean([roc_auc_score(labels == c, probabilities[:, c]) for c in present])),
    }


def _outputs(probabilities: Callable[[Array], Array], rows: Array) -> Outputs:
    told = np.log(np.maximum(probabilities(rows), 1e-12)).astype(np.float32)
    return Outputs(told, rows.astype(np.float32))


@lru_cache(maxsize=4)
def _simulated(source: str, recipe: Recipe) -> tuple[Array, Labels]:
    """Labelled rows of simulated machines, at most `MOST`."""
    rng = np.random.default_rng([recipe.seed, 62])
    if source == "simulated fleets":
        shown = fleet_examples(recipe, recipe.seed, recipe.bearings_per_class)
        chosen = rng.permutation(len(shown))[:MOST]
        return shown.features[chosen, : len(names(recipe.bearing))], shown.labels[chosen]
    windows = simulate(recipe)
    windows = windows.take(rng.permutation(len(windows))[:MOST])
    return _rows(windows, recipe.bearing)


def _rows(windows: Windows, bearing: Bearing) -> tuple[Array, Labels]:
    assert windows.labels is not None
    return order_features(windows, bearing), windows.labels
