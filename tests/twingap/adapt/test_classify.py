"""Classes of unlabelled records: simulated machines, calibrated confidence, what is never read, what is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twingap.adapt import METHODS
from twingap.adapt.classify import Classified, classify
from twingap.adapt.classify_options import NETWORKS, ClassifyOptions
from twingap.adapt.confidence import calibrate_temperature, cross_checked, reliability
from twingap.adapt.network_classifier import criterion_of, matched
from twingap.adapt.order_classifier import shipped_classifier
from twingap.adapt.population import CLASSES, Population, stated
from twingap.adapt.random_fleets import random_fleet
from twingap.adapt.window_length import window_samples
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, flat

BEARING = BEARINGS["6205"]
SPEC = TwinSpec("phenomenological", parameters={"resonance_hz": 2000.0})
TINY = ClassifyOptions("VMD+SVM", machines=4, windows=2, match=False, max_iterations=20)
"""Five turns at 80 turns a second are 500 samples: windows of 512."""
CONDITIONS = tuple(Condition(f"r{i}", 4800.0, 8000.0, 1024, CLASSES[i % 4]) for i in range(4))
SET = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(2000.0)).simulate(CONDITIONS, np.random.default_rng(5))


def population(spec: TwinSpec = SPEC, conditions: tuple[Condition, ...] = CONDITIONS) -> Population:
    return Population(spec, BEARING, "", conditions, stated(spec), 1024)


def with_conditions(conditions: list[Condition]) -> RecordSet:
    return RecordSet(SET.name, SET.unit, SET.bearing, conditions, lambda i: SET[i].samples)


def same(one: Classified, two: Classified) -> bool:
    return one.probabilities.tobytes() == two.probabilities.tobytes() and one.temperature == two.temperature


# -- simulated machines -----------------------------------------------------------------------------------------------


def test_machines_are_drawn_by_class_each_a_group_and_the_same_for_one_seed() -> None:
    one, two = (population().records(3, np.random.default_rng(1)) for _ in range(2))
    assert [c.fault for c in one.conditions] == list(CLASSES) * 3
    assert len(set(one.groups)) == 12 and len({c.speed_rpm for c in one.conditions}) == 12
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(one, two, strict=True))
    other = population().records(3, np.random.default_rng(2))
    assert not np.array_equal(one[0].samples, other[0].samples)


def test_the_faults_of_the_real_records_are_not_read() -> None:
    hidden = tuple(replace(c, fault=None) for c in CONDITIONS)
    one = population().records(1, np.random.default_rng(1))
    two = population(conditions=hidden).records(1, np.random.default_rng(1))
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(one, two, strict=True))


def test_impacts_have_the_power_that_was_drawn() -> None:
    values = {"impact_amplitude": {"outer": 1.0}, "structure_noise_rms": 0.6, "white_noise_rms": 0.8}
    values |= {"damping_ratio": 0.05, "resonance_hz": 2000.0}
    condition = Condition("o", 1200.0, 20000.0, 40000, "outer")
    snr_db = 7.0
    level = population().impact_levels(values, condition, snr_db)["impact_amplitude"]["outer"]
    quiet = PhenomenologicalParameters(2000.0, 0.05, {"outer": level}, 1e-6, 1e-6)
    (record,) = PhenomenologicalTwin(BEARING, quiet).simulate([condition], np.random.default_rng(0))
    assert 10 * np.log10(record.samples.var()) == pytest.approx(snr_db, abs=0.3)


def test_what_is_stated_varies_less_than_what_is_left_open() -> None:
    def log_sd(spec: TwinSpec) -> float:
        drawn, rng = population(spec), np.random.default_rng(0)
        return float(np.std([np.log(_resonance(drawn, rng)) for _ in range(60)]))

    def _resonance(drawn: Population, rng: np.random.Generator) -> float:
        twin = drawn._drawn(CONDITIONS[0], rng)
        assert isinstance(twin, PhenomenologicalTwin)
        return twin.parameters.resonance_hz

    assert log_sd(SPEC) == pytest.approx(0.1, rel=0.4)
    assert log_sd(TwinSpec("phenomenological")) == pytest.approx(0.4, rel=0.4)


def test_a_twin_that_cannot_ring_at_the_records_rate_is_refused_at_once() -> None:
    with pytest.raises(TwingapError, match="above half the sampling rate"):
        population(TwinSpec("phenomenological", parameters={"resonance_hz": 4500.0}))


# -- confidence -------------------------------------------------------------------------------------------------------


def predicted(n: int, sharper: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities `sharper` than the truth that the labels are drawn from."""
    rng = np.random.default_rng(seed)
    truth = rng.dirichlet(np.full(4, 0.6), n)
    labels = np.array([rng.choice(4, p=p) for p in truth])
    stated_ = truth**sharper
    return stated_ / stated_.sum(axis=1, keepdims=True), labels


@pytest.mark.parametrize("sharper", [0.5, 1.0, 3.0])
def test_the_temperature_undoes_what_was_sharpened(sharper: float) -> None:
    shown, labels = predicted(3000, sharper)
    found = calibrate_temperature(shown, labels)
    assert found.temperature == pytest.approx(sharper, rel=0.12)
    fresh, truth = predicted(3000, sharper, 1)
    after, before = reliability(found(fresh), truth), reliability(fresh, truth)
    assert after.confidence == pytest.approx(after.accuracy, abs=0.03)
    assert after.accuracy == before.accuracy, "a temperature changes no class"
    if sharper != 1.0:
        assert abs(before.confidence - before.accuracy) > 0.05


def test_nothing_is_surer_than_the_records_can_show() -> None:
    labels = np.arange(40) % 4
    shown = np.eye(4)[labels]
    found = calibrate_temperature(shown, labels)(shown)
    assert found.max() == pytest.approx(1 - 1 / 42)
    np.testing.assert_allclose(found.sum(axis=1), 1)
    crossed = cross_checked(shown, labels)
    assert crossed.accuracy == 1 and crossed.confidence < 1 - 1 / 42 and crossed.records == 40


def test_a_classifier_that_knows_nothing_is_not_believed() -> None:
    rng = np.random.default_rng(0)
    shown, labels = np.eye(4)[rng.integers(0, 4, 200)] * 0.9 + 0.025, rng.integers(0, 4, 200)
    assert cross_checked(shown, labels).confidence < 0.4


# -- records ----------------------------------------------------------------------------------------------------------


def test_faults_are_never_read_and_a_seed_fixes_the_bytes() -> None:
    one = classify(SET, SPEC, options=TINY)
    turned = [replace(c, fault=CLASSES[(i + 1) % 4]) for i, c in enumerate(SET.conditions)]
    assert same(one, classify(with_conditions(turned), SPEC, options=TINY))
    assert not same(one, classify(SET, SPEC, seed=1, options=TINY))
    assert one.names == ("r0", "r1", "r2", "r3") and one.classes == CLASSES
    np.testing.assert_allclose(one.probabilities.sum(axis=1), 1)
    for row in one.rows():
        assert list(row) == ["record", "predicted", "confidence", *CLASSES]
        assert row["confidence"] == row[str(row["predicted"])] == max(row[c] for c in CLASSES)


def test_records_of_one_group_keep_a_row_each() -> None:
    found = classify(with_conditions([replace(c, group="one") for c in SET.conditions]), SPEC, options=TINY)
    assert same(found, classify(SET, SPEC, options=TINY))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fs_hz": 8001.0}, "one rate for all"),
        ({"n_samples": 300}, "300 samples, at least 512"),
        ({"speed_rpm": 48000.0}, "expected: a fault would cause"),
        ({"speed_rpm": 1.0}, "samples per turn"),
    ],
    ids=["two rates", "too short", "too fast", "too slow"],
)
def test_conditions_that_cannot_be_classified(change: dict[str, Any], message: str) -> None:
    conditions = [replace(CONDITIONS[0], **change), *CONDITIONS[1:]]
    records = RecordSet.from_records("s", "", BEARING, [Record(c, np.arange(c.n_samples) % 2.0) for c in conditions])
    with pytest.raises(TwingapError, match=message):
        classify(records, SPEC, options=TINY)


@pytest.mark.parametrize(("value", "message"), [(np.nan, "not a finite number"), (0.0, "all samples are equal")])
def test_samples_that_cannot_be_classified(value: float, message: str) -> None:
    records = RecordSet.from_records("s", "", BEARING, [Record(CONDITIONS[0], np.full(1024, value))])
    with pytest.raises(TwingapError, match=message):
        classify(records, SPEC, options=TINY)


def test_no_bearing_no_class_and_unknown_methods() -> None:
    with pytest.raises(TwingapError, match=r"\[bearing\]"):
        classify(RecordSet.from_records("s", "", None, list(SET)), SPEC, options=TINY)
    with pytest.raises(TwingapError, match="unknown method 'guess'; use one of"):
        ClassifyOptions("guess")
    assert set(NETWORKS) == set(METHODS)
    with pytest.raises(TwingapError, match="machines = 3"):
        ClassifyOptions(machines=3)


def test_windows_hold_five_turns_or_what_there_is() -> None:
    def length(speed_rpm: float, n_samples: int) -> int:
        condition = Condition("a", speed_rpm, 12000.0, n_samples)
        return window_samples(
            RecordSet.from_records("s", "", BEARING, [Record(condition, np.zeros(n_samples))]), BEARING
        )

    assert length(1797.0, 120_000) == 2048 and length(1000.0, 120_000) == 4096
    assert length(1500.0, 3000) == 2048, "4.3 turns"


def test_the_contact_twin_and_a_method_that_adapts() -> None:
    conditions = tuple(Condition(f"r{i}", 1797.0, 12000.0, 2048) for i in range(2))
    rng = np.random.default_rng(0)
    records = RecordSet.from_records("s", "g", BEARING, [Record(c, rng.standard_normal(2048)) for c in conditions])
    options = ClassifyOptions("Proposed", machines=4, steps=2, windows=1, max_iterations=10)
    found = classify(records, TwinSpec("contact"), options=options)
    assert found.probabilities.shape == (2, 4) and found.window_samples == 2048
    assert criterion_of(options) == "infomax" and criterion_of(ClassifyOptions("Non-DA")) == "source_accuracy"
    assert len(found.notes) == 1 and "twingap identify" in found.notes[0]


@pytest.mark.slow
def test_stated_confidence_is_the_accuracy_on_fleets_that_nothing_was_learnt_from() -> None:
    """What is stated of machines that training has not drawn is what comes true, within three standard errors."""
    rng, trees = np.random.default_rng(99), shipped_classifier()
    simulated = trees.reliability_
    assert simulated is not None
    made = [random_fleet(rng, 6, lengths=(1.0, 6.0)) for _ in range(25)]
    shown, truth = np.concatenate([f.features for f in made]), np.concatenate([f.labels for f in made])
    p = trees.predict_proba(shown)[:, np.searchsorted(trees.classes_, CLASSES)]
    got, sure = reliability(p, truth), p.max(axis=1)
    # Both the judged recordings and those that the temperature was fitted on are a sample.
    error = np.sqrt(np.mean(sure * (1 - sure)) * (1 / got.records + 1 / simulated.records))
    assert abs(got.confidence - got.accuracy) < 3 * error
    assert abs(simulated.confidence - simulated.accuracy) < 3 * error
    assert got.accuracy > 0.6, "four classes; a guess is right a quarter of the time"


def test_a_twin_is_matched_without_labels() -> None:
    conditions = [Condition(f"r{i}", 4800.0, 8000.0, 4096) for i in range(3)]
    made = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(2000.0, 0.04)).simulate(
        [replace(c, fault="healthy") for c in conditions], np.random.default_rng(5)
    )
    notes: list[str] = []
    _, spec, known = matched(made.without_labels(), TwinSpec("phenomenological"), BEARING, 0, notes)
    assert flat(spec.parameters)["resonance_hz"] == pytest.approx(2000, rel=0.05)
    assert "resonance_hz" in known and not any(k.startswith("impact_amplitude") for k in known) and notes == []
