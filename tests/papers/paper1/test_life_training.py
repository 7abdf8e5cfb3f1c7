"""Training for remaining life: no label of the real run, the same bytes again, and answers that follow speed."""

import dataclasses

import numpy as np
import pytest
import torch

from papers.paper1_rul_varying_speed.methods.architecture import LifeArchitecture
from papers.paper1_rul_varying_speed.methods.simulated_lives import Snapshots
from papers.paper1_rul_varying_speed.methods.training import (
    CRITERIA,
    LifeEvidence,
    LifeScales,
    LifeTraining,
    TrainedLife,
    choose,
    judge_checkpoints,
    scales_of,
    train_life,
)
from twingap.errors import TwingapError

LENGTH, DT_S = 8192, 20.0
SPEEDS = np.array([1000.0, 1500.0, 2000.0])
SETTINGS = LifeTraining(steps=60, batch=32, checkpoints=3, learning_rate=3e-3)
BOTH = LifeArchitecture(length=LENGTH)


def lives(count: int, seed: int, rows: int = 24) -> Snapshots:
    """Noise that grows with damage and with speed; damage by the revolution, so life depends on all three inputs."""
    rng = np.random.default_rng(seed)
    parts = []
    for number in range(count):
        speed = rng.permutation(np.resize(SPEEDS, rows))
        turns = speed * DT_S / 60
        left = (turns.sum() - np.cumsum(turns)) * (1 + 0.5 * rng.random())
        level = np.exp(2 - 2 * left / 18000) * speed / 1000
        samples = (level[:, None] * rng.standard_normal((rows, LENGTH))).astype(np.float32)
        parts.append(Snapshots(samples, speed, np.arange(1.0, rows + 1), np.full(rows, number), left))
    fields = [np.concatenate([getattr(p, f.name) for p in parts]) for f in dataclasses.fields(Snapshots)]
    return Snapshots(*fields)


@pytest.fixture(scope="module")
def simulated() -> Snapshots:
    return lives(5, 0)


@pytest.fixture(scope="module")
def scales(simulated: Snapshots) -> LifeScales:
    return scales_of(simulated, SPEEDS)


@pytest.fixture(scope="module")
def trained(simulated: Snapshots, scales: LifeScales) -> TrainedLife:
    return train_life(simulated, lives(1, 9).unlabelled(), BOTH, scales, SETTINGS, seed=1)


def test_labels_are_scaled_to_one_and_samples_to_unit_rms(simulated: Snapshots, scales: LifeScales) -> None:
    assert simulated.revolutions is not None
    assert simulated.revolutions.max() / scales.revolutions == 1.0
    assert np.sqrt(np.mean((simulated.samples / scales.sample) ** 2)) == pytest.approx(1.0, rel=1e-3)


def test_a_label_of_the_real_run_never_reaches_training(simulated: Snapshots, scales: LifeScales) -> None:
    labelled = lives(1, 9)
    with pytest.raises(TwingapError, match="labels of the real run may not reach training"):
        train_life(simulated, labelled, BOTH, scales, SETTINGS)
    with pytest.raises(TwingapError, match="without labels"):
        train_life(simulated.unlabelled(), labelled.unlabelled(), BOTH, scales, SETTINGS)


def test_the_same_seed_gives_the_same_bytes(trained: TrainedLife, simulated: Snapshots, scales: LifeScales) -> None:
    real = lives(1, 9).unlabelled()
    again = train_life(simulated, real, BOTH, scales, SETTINGS, seed=1)
    for one, two in zip(trained.checkpoints, again.checkpoints, strict=True):
        assert one.step == two.step and all(torch.equal(one.state[k], two.state[k]) for k in one.state)
    np.testing.assert_array_equal(trained.predict(real), again.predict(real))


def test_a_model_without_adversary_does_not_look_at_real_records(simulated: Snapshots, scales: LifeScales) -> None:
    plain = dataclasses.replace(BOTH, adversarial=False)
    settings = dataclasses.replace(SETTINGS, steps=10, checkpoints=1)
    one, two = (train_life(simulated, lives(1, s).unlabelled(), plain, scales, settings) for s in (9, 10))
    assert all(torch.equal(one.checkpoints[0].state[k], two.checkpoints[0].state[k]) for k in one.checkpoints[0].state)
    first, second = (train_life(simulated, lives(1, s).unlabelled(), BOTH, scales, settings) for s in (9, 10))
    assert not all(
        torch.equal(first.checkpoints[0].state[k], second.checkpoints[0].state[k]) for k in first.checkpoints[0].state
    )


def test_the_discriminator_sees_records_alike_in_age(simulated: Snapshots, scales: LifeScales) -> None:
    """With real records of the first rows alone, later simulated rows are no business of the discriminator's."""
    young = lives(1, 9).unlabelled().take(np.arange(6))
    settings = dataclasses.replace(SETTINGS, steps=30, checkpoints=1)
    told = [
        train_life(simulated, young, BOTH, scales, dataclasses.replace(settings, alike=alike)).checkpoints[0]
        for alike in (True, False)
    ]
    assert not all(torch.equal(told[0].state[k], told[1].state[k]) for k in told[0].state)
    assert told[0].domain_accuracy < told[1].domain_accuracy, "age gives the domain away otherwise"


def test_training_learns_and_the_error_on_new_lives_falls(trained: TrainedLife) -> None:
    new = lives(3, 5)
    assert new.revolutions is not None
    spread = float(np.std(new.revolutions))
    assert np.sqrt(np.mean((trained.predict(new) - new.revolutions) ** 2)) < 0.6 * spread
    assert trained.checkpoints[-1].loss < 0.5 * trained.checkpoints[0].loss
    assert all(0 <= c.domain_accuracy <= 1 for c in trained.checkpoints)


def test_predicted_life_reacts_to_speed(trained: TrainedLife, simulated: Snapshots, scales: LifeScales) -> None:
    """The same vibration at a lower speed is graver: told the speed, the network says so; not told, it cannot."""
    shown = lives(2, 7).unlabelled()
    slow, fast = (dataclasses.replace(shown, speed_rpm=np.full(len(shown), rpm)) for rpm in (1000.0, 2000.0))
    assert np.mean(trained.predict(fast) - trained.predict(slow)) > 0.03 * scales.revolutions
    deaf = dataclasses.replace(BOTH, speed=False, sequence=False, adversarial=False)
    without = train_life(simulated, shown, deaf, scales, dataclasses.replace(SETTINGS, steps=6))
    np.testing.assert_array_equal(without.predict(slow), without.predict(fast))


def test_a_prediction_depends_on_its_own_record_alone(trained: TrainedLife) -> None:
    shown = lives(1, 7).unlabelled()
    whole, part = trained.predict(shown, batch=7), trained.predict(shown.take(np.arange(5)))
    np.testing.assert_allclose(whole[:5], part, rtol=1e-5)
    assert trained.embed(shown).shape == (len(shown), 32) and (whole >= 0).all()


def test_one_whole_life_is_steady(trained: TrainedLife) -> None:
    """Evidence of a network that is right: the revolutions behind and those ahead add up to one number."""
    real = lives(1, 9)
    assert real.revolutions is not None
    evidence = judge_checkpoints(trained, lives(2, 3), real.unlabelled(), DT_S)
    assert len(evidence) == 3
    turned = evidence[0].real_total * trained.scales.revolutions - trained.predict(real, 0)
    np.testing.assert_allclose(np.diff(turned), real.speed_rpm[1:] * DT_S / 60)


def test_criteria_prefer_what_they_say_and_the_latest_of_equals() -> None:
    good, unsteady, wrong = (
        LifeEvidence(np.full(4, error), 1 + np.array([-1, 1, -1, 1]) * swing)
        for error, swing in ((0.1, 0.01), (0.05, 0.3), (0.4, 0.0))
    )
    assert choose([good, unsteady, wrong]) == 0
    assert choose([good, unsteady, wrong], "simulated_error") == 1
    assert choose([good, unsteady, wrong], "steadiness") == 2
    assert choose([good, good]) == 1
    assert set(CRITERIA) == {"error_and_steadiness", "simulated_error", "steadiness"}
    with pytest.raises(TwingapError, match="no criterion"):
        choose([good], "target_error")
