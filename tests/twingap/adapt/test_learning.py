"""The classifier that ships with twingap: its training, its files, and what it predicts of plain faults."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twingap.adapt import order_classifier
from twingap.adapt.classify import Classified, classify
from twingap.adapt.fault_classifier import FaultClassifier
from twingap.adapt.learning import CALIBRATE, FLEETS_PER_PART, LARGEST_FILE, LEARN, train_classifier, write_part
from twingap.adapt.order_classifier import (
    ABOUT_FILE,
    FEATURES,
    SPEEDS,
    TREES_FILE,
    features,
    read_classifier,
    shipped_classifier,
    write_classifier,
)
from twingap.adapt.population import CLASSES
from twingap.adapt.random_fleets import RATES_HZ, SPEEDS_RPM, random_bearing, random_fleet
from twingap.adapt.windows import cut
from twingap.bearing import BEARINGS, PUBLIC_BEARINGS, Bearing
from twingap.effects import make_effect
from twingap.errors import TwingapError
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FaultClassifier]:
    folder = tmp_path_factory.mktemp("learnt")
    return folder, train_classifier(folder, seed=3, jobs=1, fleets=FLEETS_PER_PART)


def plant(bearing: Bearing, fs_hz: float, speed_rpm: float, turns: float = 60.0) -> RecordSet:
    """Two healthy records and two of each race's fault, plain, of one machine."""
    resonance = 0.2 * fs_hz
    decay = 4 * 0.05 * 2 * np.pi * resonance
    faults = ("healthy", "healthy", "inner", "inner", "outer", "outer")
    loud = {
        f: float(np.sqrt(10 * decay / (bearing.fault_order(f) * speed_rpm / 60))) for f in ("inner", "outer", "ball")
    }
    effects = [make_effect("slip_jitter", {"sigma": 0.005}, "test"), make_effect("load_zone", {"depth": 0.6}, "test")]
    twin = PhenomenologicalTwin(bearing, PhenomenologicalParameters(resonance, 0.05, loud), effects)
    n_samples = int(turns * fs_hz * 60 / speed_rpm)
    conditions = [Condition(f"r{i}", speed_rpm, fs_hz, n_samples, f, group=f"r{i}") for i, f in enumerate(faults)]
    return twin.simulate(conditions, np.random.default_rng(2))


# -- training ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_interrupted_training_goes_on_and_ends_in_the_same_bytes_on_two_cores(
    trained: tuple[Path, FaultClassifier], tmp_path: Path
) -> None:
    folder, _ = trained
    assert sorted(p.name for p in folder.iterdir()) == [ABOUT_FILE, TREES_FILE], "parts are gone when all is done"
    write_part(tmp_path / "parts" / f"v{order_classifier.VERSION}-seed3-{LEARN}-0.npz", 3, LEARN, 0)
    heard: list[float] = []
    train_classifier(tmp_path, seed=3, jobs=2, fleets=FLEETS_PER_PART, progress=lambda what, share: heard.append(share))
    assert heard[0] == pytest.approx(0.45), "one of two parts was there"
    assert heard == sorted(heard) and heard[-1] == 1
    for name in (ABOUT_FILE, TREES_FILE):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_machines_are_drawn_from_all_that_twingap_classifies() -> None:
    rng = np.random.default_rng(0)
    bearings = [random_bearing(rng) for _ in range(200)]
    assert {b.name for b in bearings} == {"random", *PUBLIC_BEARINGS}
    assert {b.contact_angle_deg > 0 for b in bearings if b.name == "random"} == {True, False}
    made = [random_fleet(rng, 1, lengths=(1.0, 1.0)) for _ in range(12)]
    sizes = {len(fleet.labels) for fleet in made}
    assert min(sizes) >= 1 and max(sizes) <= 8 and len(sizes) > 3
    turns = np.exp(np.concatenate([f.features[:, 0, FEATURES.index("setting: ln turns in the window")] for f in made]))
    assert turns.min() > 2.9 and turns.max() < 31
    assert RATES_HZ == (8000, 100_000) and SPEEDS_RPM == (300, 3600)


def test_one_part_is_the_same_for_one_seed_and_no_other(tmp_path: Path) -> None:
    rngs = [np.random.default_rng([seed, 41, CALIBRATE, 0]) for seed in (0, 0, 1)]
    one, two, other = (random_fleet(rng, 2, lengths=(1.0, 6.0)) for rng in rngs)
    np.testing.assert_array_equal(one.features, two.features)
    assert one.features.shape != other.features.shape or not np.array_equal(one.features, other.features)


def test_confidence_is_calibrated_at_all_likely_speeds() -> None:
    rng = np.random.default_rng(5)
    made = [random_fleet(rng, 2, lengths=(3.0, 6.0), wrong_speeds=True) for _ in range(4)]
    for fleet in made:
        assert fleet.features.shape[1] == fleet.weights.shape[1] == 2 * SPEEDS
        np.testing.assert_allclose(fleet.weights.sum(axis=1), 2)
    assert any((fleet.weights > 0).sum() > 2 * len(fleet.labels) for fleet in made), "some speeds are not certain"


def test_too_few_fleets_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="5 fleets in 1 processes, at least 20 in 1"):
        train_classifier(tmp_path, seed=0, jobs=1, fleets=5)


# -- files ------------------------------------------------------------------------------------------------------------


def test_what_is_stored_is_read_back_to_the_bit(trained: tuple[Path, FaultClassifier]) -> None:
    folder, made = trained
    read = read_classifier(folder)
    for name, array in made.trees_.arrays().items():
        np.testing.assert_array_equal(read.trees_.arrays()[name], array)
    assert (read.calibration_, read.reliability_) == (made.calibration_, made.reliability_)
    assert read.get_params() == made.get_params() and read.n_features_in_ == made.n_features_in_
    rows = np.random.default_rng(0).standard_normal((5, 6, len(FEATURES)))
    np.testing.assert_array_equal(read.predict_proba(rows), made.predict_proba(rows))
    np.testing.assert_array_equal(read.predict(rows), made.predict(rows))


def _change(key: str, value: object) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        about = json.loads((folder / ABOUT_FILE).read_text())
        about[key] = value
        (folder / ABOUT_FILE).write_text(json.dumps(about))

    return change


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_change("features", [*FEATURES[:-1], "another"]), "other features or classes"),
        (_change("version", order_classifier.VERSION + 1), "other features or classes"),
        (_change("classes", ["healthy", "broken"]), "other features or classes"),
        (_change("calibration", {}), "is no classifier"),
        (lambda folder: (folder / ABOUT_FILE).write_text("{"), "is no classifier"),
        (lambda folder: (folder / TREES_FILE).write_bytes(b"PK"), "is no classifier"),
        (lambda folder: (folder / TREES_FILE).unlink(), "is missing"),
    ],
)
def test_files_that_do_not_match_are_refused_in_one_line(
    trained: tuple[Path, FaultClassifier], tmp_path: Path, damage: Callable[[Path], None], message: str
) -> None:
    write_classifier(trained[1], tmp_path, {"seed": 3})
    damage(tmp_path)
    with pytest.raises(TwingapError, match=message) as caught:
        read_classifier(tmp_path)
    assert "\n" not in str(caught.value) and "twingap train" in str(caught.value)


def test_the_shipped_classifier_is_small_and_about_these_features() -> None:
    found = shipped_classifier()  # refuses other features
    folder = order_classifier.shipped_folder()
    assert sum(p.stat().st_size for p in folder.iterdir()) <= LARGEST_FILE
    assert found.calibration_ is not None and (shown := found.reliability_) is not None
    assert shown.accuracy > 0.8 and abs(shown.accuracy - shown.confidence) < 0.05
    made = json.loads((folder / ABOUT_FILE).read_text())["made"]
    assert shown.records == found.calibration_.records == made["calibration_recordings"]
    assert sorted(found.classes_) == list(found.classes_) == sorted(CLASSES)
    found.fit(np.random.default_rng(0).standard_normal((8, 2)), ["a", "b"] * 4)
    assert shipped_classifier().n_features_in_ == len(FEATURES), "each caller has a copy"


# -- predictions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bearing", "fs_hz", "speed_rpm"),
    [
        (BEARINGS["6205"], 12_000.0, 1797.0),
        (BEARINGS["ZA-2115"], 20_000.0, 2000.0),
        (Bearing("made up", 11, 6.0, 33.0, 15.0), 48_800.0, 2900.0),
    ],
)
def test_plain_faults_of_any_bearing_are_found_without_training(
    bearing: Bearing, fs_hz: float, speed_rpm: float
) -> None:
    records = plant(bearing, fs_hz, speed_rpm)
    found = classify(records, TwinSpec("phenomenological"))
    assert found.predicted == tuple(c.fault for c in records.conditions)
    assert found.simulated == shipped_classifier().reliability_ and (found.confidence > 0.5).all()


def test_predictions_of_the_shipped_classifier_stay_the_same() -> None:
    found = classify(plant(BEARINGS["6205"], 12_000.0, 1797.0), TwinSpec("phenomenological"))
    expected = [
        [0.9615680788957939, 0.01886150629455119, 0.012314619501840984, 0.007255795307814051],
        [0.9420924794156054, 0.030601621718356935, 0.008239940510745022, 0.019065958355292616],
        [0.0006430774736592102, 0.9987137271838575, 0.00032168257782331047, 0.00032151276465971834],
        [0.0006428553864413711, 0.9987138207092937, 0.00032179652804651375, 0.0003215273762184467],
        [0.0006439246878781528, 0.000342491287440377, 0.9986899807725829, 0.000323603252098648],
        [0.0006437374745075591, 0.0003370188787307103, 0.9986963851133457, 0.00032285853341587666],
    ]
    np.testing.assert_allclose(found.probabilities, expected, rtol=1e-9)


def test_neither_the_twin_nor_the_seed_nor_the_unit_changes_what_the_trees_predict() -> None:
    records = plant(BEARINGS["6205"], 12_000.0, 1797.0)
    one = classify(records, TwinSpec("phenomenological"))
    other = TwinSpec("phenomenological", parameters={"resonance_hz": 1234.0})
    for again in (classify(records, other), classify(records, other, seed=5)):
        np.testing.assert_array_equal(again.probabilities, one.probabilities)
    louder = RecordSet.from_records("s", "", BEARINGS["6205"], [replace(r, samples=100 * r.samples) for r in records])
    np.testing.assert_allclose(classify(louder, other).probabilities, one.probabilities, atol=1e-9)


def test_a_healthy_machine_may_be_impulsive() -> None:
    """Impulses without a rhythm, in the quietest record of its machine, are no fault of a ball."""
    loud = plant(BEARINGS["6205"], 12_000.0, 1797.0)
    noise = make_effect(
        "impulsive_noise", {"level": 4.0, "rate_hz": 60.0, "resonance_hz": 2400.0, "spread": 0.5}, "test"
    )
    healthy = [replace(c, name=f"h{i}", fault="healthy") for i, c in enumerate(loud.conditions[:2])]
    twin = PhenomenologicalTwin(BEARINGS["6205"], PhenomenologicalParameters(2400.0, 0.05), [noise])
    impulsive = list(twin.simulate(healthy, np.random.default_rng(3)))
    records = RecordSet.from_records("s", "", BEARINGS["6205"], [*impulsive, *list(loud)[2:]])
    found = classify(records, TwinSpec("phenomenological"))
    assert found.predicted[:2] == ("healthy", "healthy")


def test_progress_is_reported_and_labels_are_not_read() -> None:
    records = plant(BEARINGS["6205"], 12_000.0, 1797.0)
    heard: list[tuple[str, float]] = []

    def run(given: RecordSet) -> Classified:
        return classify(given, TwinSpec("phenomenological"), progress=lambda what, share: heard.append((what, share)))

    first = run(records)
    assert [share for _, share in heard] == sorted(share for _, share in heard) and heard
    np.testing.assert_array_equal(run(records.without_labels()).probabilities, first.probabilities)


def test_settings_are_of_the_window_and_the_operating_point() -> None:
    records = plant(BEARINGS["6205"], 12_000.0, 1800.0)
    found = features(cut(records, 2048, 2), BEARINGS["6205"])
    assert found.shape == (12, len(FEATURES)) and found.dtype == np.float32 and np.isfinite(found).all()
    turns, per_turn, compared = found[:, -3:].T
    np.testing.assert_allclose(np.exp(turns), 2048 / 400, rtol=1e-5)
    np.testing.assert_allclose(np.exp(per_turn), 400, rtol=1e-5)
    assert (compared == 6).all() and len(CLASSES) == 4
