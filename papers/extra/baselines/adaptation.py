"""Shallow domain adaptation of feature rows by skada, with a setting chosen without target labels, and scores."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from twingap import TwingapError
from twingap.adapt import CRITERIA, Evidence, Outputs

Labels = NDArray[np.int64]

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


def skada_at_hand(root: Path | None) -> bool:
    return find_spec("skada") is not None


def chosen(
    method: str, rows: Array, labels: Labels, target: Array, criterion: str
) -> tuple[int, list[Callable[[Array], Array]]]:
    """Fit a method with each of its settings; place of the one chosen without target labels, and `adapted` of each."""
    fitted = [adapted(method, setting, rows, labels, target) for setting in SETTINGS[method]]
    evidence = [Evidence(_outputs(each, rows), labels, _outputs(each, target)) for each in fitted]
    return int(np.argmax([CRITERIA[criterion](own) for own in evidence])), fitted


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
