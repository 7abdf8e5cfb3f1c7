"""The scikit-learn estimators: scikit-learn's own checks, pipelines over records, examples in docstrings."""

from __future__ import annotations

import doctest
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.model_selection import cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import parametrize_with_checks

from twingap.adapt import (
    METHODS,
    Alignment,
    Architecture,
    ClassifyOptions,
    DomainAdaptationClassifier,
    FaultClassifier,
    OrderFeatures,
    Training,
    classify,
    shipped_classifier,
)
from twingap.adapt.order_classifier import FEATURES
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

BEARING = BEARINGS["6205"]
STATES = ("healthy", "outer") * 6


# Leaves of 40 rows, the default, hold more than all rows of most checks.
@parametrize_with_checks([FaultClassifier(n_estimators=12, learning_rate=0.3, min_samples_leaf=3, max_features=1.0)])
def test_checks_of_scikit_learn(estimator: Any, check: Callable[[Any], None]) -> None:
    check(estimator)


SMALL = Training(steps=30, checkpoints=1, learning_rate=3e-3)
NETWORK = DomainAdaptationClassifier(Architecture(denoising=False, attention="none"), training=SMALL, device="cpu")
EXPECTED = {"check_methods_subset_invariance": "convolutions of PyTorch round differently with the size of a batch"}


@pytest.mark.slow
@parametrize_with_checks([NETWORK], expected_failed_checks=lambda _: EXPECTED)
def test_checks_of_scikit_learn_for_the_network(estimator: Any, check: Callable[[Any], None]) -> None:
    check(estimator)


@pytest.fixture(scope="module")
def records() -> RecordSet:
    twin = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(2600.0, 0.05, {"outer": 4.0}))
    conditions = [Condition(f"r{i}", 1797.0, 12000.0, 12288, state) for i, state in enumerate(STATES)]
    return twin.simulate(conditions, np.random.default_rng(0))


def blobs(n: int, windows: int) -> tuple[Any, Any]:
    """Rows of three classes that overlap [records, windows, features], and their labels."""
    rng = np.random.default_rng(n)
    labels = rng.choice(["a", "b", "c"], n)
    centres = {"a": 0.0, "b": 1.0, "c": 2.0}
    return rng.standard_normal((n, windows, 4)) + np.array([centres[x] for x in labels])[:, None, None], labels


def test_windows_of_a_record_are_averaged_and_calibrated() -> None:
    small = FaultClassifier(n_estimators=20, min_samples_leaf=5, random_state=0)
    X, y = blobs(120, 2)
    found = clone(small).fit(X, y)
    flat = clone(small).fit(X.reshape(-1, 4), np.repeat(y, 2))
    shown, labels = blobs(90, 5)
    single = flat.predict_proba(shown.reshape(-1, 4))
    np.testing.assert_array_equal(found.predict_proba(shown), single.reshape(90, 5, 3).mean(axis=1))
    assert found.reliability_ is None
    found.calibrate(shown, labels)
    after = found.predict_proba(shown)
    assert found.calibration_.records == 90 and found.reliability_.records == 90
    assert np.abs(after - single.reshape(90, 5, 3).mean(axis=1)).max() > 0.02
    np.testing.assert_array_equal(found.predict(shown), found.classes_[after.argmax(axis=1)])
    assert found.score(shown, labels) > 0.8
    with pytest.raises(ValueError, match="labels d are not among"):
        found.calibrate(shown[:2], ["a", "d"])
    assert found.fit(X, y).calibration_ is None, "a new fit needs a new temperature"


def test_a_pipeline_over_records_is_what_classify_predicts(records: RecordSet) -> None:
    pipeline = make_pipeline(OrderFeatures(), shipped_classifier())
    found = classify(records, TwinSpec("phenomenological"), options=ClassifyOptions(match=False))
    probabilities = pipeline.predict_proba(records)
    np.testing.assert_array_equal(
        probabilities[:, np.searchsorted(pipeline.classes_, found.classes)], found.probabilities
    )
    assert tuple(pipeline.predict(records)) == found.predicted == STATES
    hidden = records.without_labels()
    np.testing.assert_array_equal(pipeline.predict_proba(hidden), probabilities)


def test_a_classifier_of_the_users_own_on_order_features(records: RecordSet) -> None:
    own = FaultClassifier(n_estimators=20, min_samples_leaf=2, random_state=0)
    pipeline = make_pipeline(OrderFeatures(BEARING, windows=2), own).fit(records, STATES)
    assert pipeline[-1].n_features_in_ == len(FEATURES) and pipeline.score(records, STATES) == 1
    # Cross-validation takes records out of the set one by one.
    assert tuple(cross_val_predict(pipeline, records, STATES, cv=2)) == STATES
    mean = FunctionTransformer(lambda rows: rows.mean(axis=1))
    rows = make_pipeline(OrderFeatures(), mean, ExtraTreesClassifier(20, random_state=0)).fit(records, STATES)
    assert rows.score(records, STATES) == 1


def test_parameters_of_the_transformer_are_set_and_cloned(records: RecordSet) -> None:
    given = OrderFeatures(BEARING, windows=3)
    assert clone(given).get_params() == {"bearing": BEARING, "windows": 3, "window_samples": None}
    assert given.fit(records) is given
    assert given.transform(records).shape == (12, 3, len(FEATURES))
    pipeline = make_pipeline(given, FaultClassifier()).set_params(orderfeatures__windows=1)
    assert pipeline[0].transform(records).shape == (12, 1, len(FEATURES))
    assert not np.array_equal(pipeline[0].transform(records), OrderFeatures(None, 1, 1024).transform(records))
    with pytest.raises(TwingapError, match=r"pass it: OrderFeatures\(bearing\)"):
        OrderFeatures().transform(list(records))


def test_the_network_adapts_to_target_rows_and_chooses_without_their_labels() -> None:
    rng = np.random.default_rng(0)
    y = np.repeat(["a", "b"], 24)
    X = rng.standard_normal((48, 2, 256)).astype(np.float32)
    X[24:] *= 1 + np.sin(np.arange(256))
    settings, dann = Training(steps=6, checkpoints=3, batch=16), METHODS["DANN"]

    def fitted(alignment: Alignment, **given: Any) -> DomainAdaptationClassifier:
        network = DomainAdaptationClassifier(dann.architecture, alignment, training=settings, random_state=0)
        return network.fit(X, y, groups=np.arange(48) // 4, **given)

    adapted, plain = fitted(dann.alignment, X_target=X + 1), fitted(Alignment(), X_target=X + 1)
    assert set(adapted.criteria_) > {"infomax", "source_accuracy"}
    assert len(adapted.source_accuracy_) == len(adapted.trained_.checkpoints) == 3
    assert (adapted.predict_proba(X) != plain.predict_proba(X)).any(), "the loss between domains changes the weights"
    again = fitted(dann.alignment, X_target=X + 1)
    np.testing.assert_array_equal(again.predict_proba(X), adapted.predict_proba(X))
    alone = fitted(dann.alignment)
    assert list(alone.criteria_) == ["source_accuracy"], "nothing to adapt to"
    assert fitted(dann.alignment, classes=["a", "b", "c"]).predict_proba(X).shape == (48, 3)
    with pytest.raises(ValueError, match="features"):
        adapted.predict(X[:, :1])


@pytest.mark.parametrize("name", ["domain_adaptation", "fault_classifier", "order_transformer"])
def test_examples_run(name: str) -> None:
    done = doctest.testmod(import_module(f"twingap.adapt.{name}"))
    assert done.attempted > 5 and done.failed == 0
