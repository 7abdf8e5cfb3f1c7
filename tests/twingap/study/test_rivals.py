"""Rivals: fair tests, readings that exist, learning what can be learnt; not more."""

from pathlib import Path

import numpy as np
import pytest
from study_standins import EFFECTS, tiny_worlds

from twingap.bearing import BEARINGS
from twingap.effects import catalogue
from twingap.records import Condition, Record
from twingap.study import rivals, statistics
from twingap.study.distortions import LEVEL, DistortionTests
from twingap.study.neural import NeuralPosterior
from twingap.study.verdicts import Found


def noise_record(x: np.ndarray, fs_hz: float = 8000.0) -> Record:
    return Record(Condition("r", 1500.0, fs_hz, x.size, "outer"), x)


def test_every_statistic_has_a_reading_in_the_catalogue() -> None:
    for name in statistics.names():
        assert rivals.read_importance(name) in catalogue()


def test_statistics_do_not_know_the_unit_but_for_the_level() -> None:
    x = np.random.default_rng(0).standard_normal(8000)
    one, many = (statistics.of_record(noise_record(g * x), BEARINGS["6205"]) for g in (1.0, 40.0))
    level = statistics.names().index("log_rms")
    assert many[level] - one[level] == pytest.approx(np.log(40))
    np.testing.assert_allclose(np.delete(many, level), np.delete(one, level), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "hz"), [("order_1", 25.0), ("order_2", 50.0), ("line_60_hz", 60.0), ("order_0.5", 12.5)]
)
def test_a_tone_stands_in_its_line(name: str, hz: float) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(16000) / 8000
    quiet, loud = (
        statistics.of_record(noise_record(rng.standard_normal(t.size) + a * np.sin(2 * np.pi * hz * t)), None)
        for a in (0.0, 1.0)
    )
    place = statistics.names().index(name)
    assert loud[place] - quiet[place] > 3
    assert np.isnan(quiet[statistics.names().index("envelope_cage")])  # no bearing, no order to look at


def test_constant_and_short_records_give_numbers_or_nan() -> None:
    for x in (np.zeros(2000), np.ones(100), np.random.default_rng(0).standard_normal(70)):
        values = statistics.of_record(noise_record(x), BEARINGS["6205"])
        assert values.shape == (len(statistics.names()),) and not np.isinf(values).any()


def test_two_sample_test_keeps_its_level_and_sees_a_shift(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rivals, "TREES", 20)
    rng = np.random.default_rng(5)
    width = len(statistics.names())
    null = [rivals.two_sample(*rng.standard_normal((2, 8, width)), rng, 19).gap for _ in range(3)]
    assert sum(null) <= 1  # P(more | 5 %) = 0.007
    moved = rng.standard_normal((8, width))
    moved[:, statistics.names().index("repeats")] += 8
    found = rivals.two_sample(moved, rng.standard_normal((8, width)), rng, 19)
    assert found.gap and found.effects == ("dropout",) and not found.outside


@pytest.fixture(scope="module")
def learnt() -> tuple[rivals.Examples, rivals.Examples]:
    train = rivals.examples(tiny_worlds(40, np.random.default_rng(0)), EFFECTS)
    return train, rivals.examples(tiny_worlds(16, np.random.default_rng(1)), EFFECTS)


def test_detectors_learn_what_can_be_learnt(learnt: tuple[rivals.Examples, rivals.Examples]) -> None:
    train, test = learnt
    detectors = rivals.Detectors()
    detectors.fit(train, np.random.default_rng(0))
    predicted = [set(f.effects) for f in detectors.predict(test.x)]
    true = [{e for e, there in zip(EFFECTS, row, strict=True) if there} for row in test.present]
    assert sum(s == t for s, t in zip(predicted, true, strict=True)) >= 13
    assert all(f.status == ("explained" if f.effects else "no_gap") for f in detectors.predict(test.x))


def test_one_classifier_learns_from_worlds_of_at_most_one_effect(
    learnt: tuple[rivals.Examples, rivals.Examples],
) -> None:
    train, test = learnt
    one = rivals.OneClassifier()
    one.fit(train, np.random.default_rng(0))
    found = one.predict(test.x)
    few = test.present.sum(axis=1) <= 1
    right = [
        f.first == next((e for e, there in zip(EFFECTS, row, strict=True) if there), None)
        for f, row in zip(found, test.present, strict=True)
    ]
    assert np.mean(np.array(right)[few]) >= 0.8
    assert all(len(f.effects) <= 1 for f in found)
    assert all(f.outside == (f.gap and max(f.probability.values()) < 0.5) for f in found)


def test_same_seed_same_answers(learnt: tuple[rivals.Examples, rivals.Examples]) -> None:
    train, test = learnt
    answers = []
    for _ in range(2):
        rival = rivals.Detectors()
        rival.fit(train, np.random.default_rng(4))
        answers.append(rival.predict(test.x[:4]))
    assert answers[0] == answers[1]


def test_detectors_with_two_sample_test_may_say_outside() -> None:
    none, one = Found("no_gap"), Found("explained", ("a",))
    gap = Found("explained", ("b",), p_value=0.02)
    statuses = [f.status for f in rivals.with_two_sample([none, none, one], [none, gap, gap])]
    assert statuses == ["no_gap", "unexplained", "explained"]


def test_distortions_are_just_detectable_and_the_strong_ones_named() -> None:
    rng = np.random.default_rng(2)

    def drawn(n: int, size: float) -> rivals.Examples:
        """Correlated statistics; effects shift three of them each, by an amount that varies."""
        present = rng.random((n, 3)) < 0.25
        x = rng.standard_normal((n, 30)) @ (np.eye(30) + 0.06)
        for k in range(3):
            x[:, 4 * k : 4 * k + 3] += (size * rng.uniform(0.3, 1.7, n) * present[:, k])[:, None]
        return rivals.Examples(x, present, ("a", "b", "c"))

    rival = DistortionTests()
    rival.fit(drawn(500, 4.0), rng)
    strong, weak = drawn(2000, 6.0), drawn(2000, 0.5)
    for test, least, most in ((strong, 0.95, 1.0), (weak, 0.1, 0.5)):
        claimed = np.array([f.gap for f in rival.predict(test.x)])
        with_effect = test.present.any(axis=1)
        assert claimed[~with_effect].mean() < LEVEL + 0.04
        assert least < claimed[with_effect].mean() <= most
    one = strong.present.sum(axis=1) == 1
    right = [f.first == "abc"[int(p.argmax())] for f, p in zip(rival.predict(strong.x), strong.present, strict=True)]
    assert np.mean(np.array(right)[one]) > 0.9
    assert all(0.01 < amplitude < 0.5 for _, amplitude in rival.fitted.tests.values())


def test_neural_posterior_says_why_it_is_skipped_or_learns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rival = NeuralPosterior(epochs=80)
    if reason := rival.skip():
        assert "pip install" in reason
        return
    rng = np.random.default_rng(0)

    def drawn(n: int) -> rivals.Examples:
        present = rng.random((n, 2)) < 0.4
        x = rng.standard_normal((n, 12))
        x[:, :2] += 4 * present
        return rivals.Examples(x, present, EFFECTS)

    rival.fit(drawn(600), rng)
    test = drawn(60)
    found = rival.predict(test.x)
    gap = [f.gap == row.any() for f, row in zip(found, test.present, strict=True)]
    exact = [set(f.effects) == {e for e, p in zip(EFFECTS, row, strict=True) if p}
             for f, row in zip(found, test.present, strict=True)]  # fmt: skip
    assert np.mean(gap) >= 0.85 and np.mean(exact) >= 0.8
    assert found == rival.predict(test.x)
    assert capsys.readouterr().out == ""
    assert not list(tmp_path.iterdir())  # sbi leaves logs unless it gets another tracker
