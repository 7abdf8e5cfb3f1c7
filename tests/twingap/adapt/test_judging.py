"""Windows, inputs, label-free criteria, figures of merit and their intervals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from twingap.adapt import (
    CRITERIA,
    DEFAULT,
    VIEWS,
    Evidence,
    Outputs,
    Windows,
    bootstrap_interval,
    cut,
    inputs,
    score,
    select,
    split_by_group,
    t_interval,
)
from twingap.adapt.views import ORDERS
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet

FS_HZ = 12_000.0


def records(*lengths: int, fault: str | None = "inner") -> RecordSet:
    made = [
        Record(Condition(f"r{i}", 1800.0, FS_HZ, n, fault, group=f"g{i}"), np.arange(n, dtype=np.float64))
        for i, n in enumerate(lengths)
    ]
    return RecordSet.from_records("toy", "g", None, made)


def windows(x: np.ndarray, speed_rpm: float = 1800.0, labels: np.ndarray | None = None) -> Windows:
    n = len(x)
    return Windows(x, np.full(n, FS_HZ), np.full(n, speed_rpm), np.array([f"g{i}" for i in range(n)]), labels)


@settings(max_examples=40, deadline=None)
@given(lengths=st.lists(st.integers(10, 300), min_size=1, max_size=4), per=st.integers(1, 12))
def test_cut_covers_each_record_alike(lengths: list[int], per: int) -> None:
    made = cut(records(*lengths), 10, per)
    assert made.samples.shape == (per * len(lengths), 10) and made.labels is None
    for i, n in enumerate(lengths):
        own = made.samples[made.group == f"g{i}"]
        assert own[0, 0] == 0 and own.max() <= n - 1 and len(own) == per
        if per > 1:
            assert own[-1, -1] == n - 1, "windows reach the record's end"
        if per * 10 <= n:
            assert (np.diff(own[:, 0]) >= 10).all(), "windows overlap though there is room"


def test_cut_reads_labels_only_when_asked() -> None:
    assert cut(records(20), 10, 2, ["healthy", "inner"]).labels.tolist() == [1, 1]  # type: ignore[union-attr]
    assert cut(records(20, fault=None), 10, 2).labels is None
    with pytest.raises(TwingapError, match="fault None, one of healthy, inner expected"):
        cut(records(20, fault=None), 10, 2, ["healthy", "inner"])
    with pytest.raises(TwingapError, match="has 20 samples, a window needs 21"):
        cut(records(20), 21, 1)


@settings(max_examples=30, deadline=None)
@given(groups=st.integers(2, 12), share=st.floats(0.1, 0.6), seed=st.integers(0, 99))
def test_split_shares_no_group(groups: int, share: float, seed: int) -> None:
    labels = np.repeat([0, 1], groups * 3)
    group = np.array([f"{c}-{i // 3}" for c in (0, 1) for i in range(groups * 3)])
    whole = Windows(np.zeros((labels.size, 4)), np.ones(labels.size), np.ones(labels.size), group, labels)
    one, two = split_by_group(whole, share, np.random.default_rng(seed))
    assert not set(one.group) & set(two.group) and len(one) + len(two) == len(whole)
    assert set(one.labels) == set(two.labels) == {0, 1}  # type: ignore[arg-type]


@pytest.mark.parametrize("view", sorted(VIEWS))
def test_views_do_not_see_amplitude_or_offset(view: str) -> None:
    x = np.random.default_rng(0).standard_normal((3, 2048))
    one, two = inputs(windows(x), view), inputs(windows(7.0 * x + 3.0), view)
    assert one.dtype == np.float32 and one.shape[:2] == (3, 1) and np.isfinite(one).all()
    np.testing.assert_allclose(one, two, atol=2e-4)


@pytest.mark.parametrize("view", ["envelope_spectrum", "whitened_envelope_spectrum"])
@pytest.mark.parametrize("speed_rpm", [1500.0, 1797.0])
def test_envelope_views_show_the_order_of_impacts(view: str, speed_rpm: float) -> None:
    order, n = 3.585, 2048
    rng = np.random.default_rng(1)
    t = np.arange(n) / FS_HZ
    since = np.mod(t, 1 / (order * speed_rpm / 60))
    x = np.exp(-700 * since) * np.sin(2 * np.pi * 3000 * since) + 0.02 * rng.standard_normal(n)
    seen = inputs(windows(x[None], speed_rpm), view)[0, 0]
    first = (ORDERS > 2.5) & (ORDERS < 4.7)
    assert ORDERS[first][seen[first].argmax()] == pytest.approx(order, abs=0.12)


@pytest.mark.parametrize("view", sorted(VIEWS))
def test_views_bear_a_constant_window(view: str) -> None:
    assert np.isfinite(inputs(windows(np.ones((1, 2048))), view)).all()


def outputs_of(p: np.ndarray) -> Outputs:
    return Outputs(np.log(np.maximum(p, 1e-9)).astype(np.float32), np.zeros((len(p), 2), np.float32))


def evidence(target: np.ndarray, source: np.ndarray | None = None) -> Evidence:
    held = np.eye(4)[[0, 1, 2, 3]] if source is None else source
    return Evidence(outputs_of(held), np.arange(4), outputs_of(target))


def test_criteria_prefer_what_they_say() -> None:
    sure, unsure = np.eye(4)[np.arange(40) % 4], np.full((40, 4), 0.25)
    collapsed = np.tile([1.0, 0, 0, 0], (40, 1))
    assert DEFAULT == "infomax"
    rule = CRITERIA["infomax"]
    assert rule(evidence(sure)) == pytest.approx(np.log(4), abs=1e-3)
    assert rule(evidence(unsure)) == pytest.approx(0, abs=1e-6) == rule(evidence(collapsed))
    assert CRITERIA["target_entropy"](evidence(sure)) > CRITERIA["target_entropy"](evidence(unsure))
    right, wrong = np.eye(4), np.eye(4)[[1, 0, 2, 3]]
    assert CRITERIA["source_accuracy"](evidence(sure, right)) > CRITERIA["source_accuracy"](evidence(sure, wrong))
    dense, sparse = collapsed, np.eye(40)[:, :40]
    density = CRITERIA["soft_neighbourhood_density"]
    assert density(evidence(dense)) > density(Evidence(outputs_of(np.eye(4)), np.arange(4), outputs_of(sparse))) - 1e-9
    assert density(evidence(dense)) == pytest.approx(np.log(39), rel=1e-4)


def test_select_takes_the_best_and_the_latest_of_equals() -> None:
    sure, unsure = np.eye(4)[np.arange(40) % 4], np.full((40, 4), 0.25)
    assert select([evidence(unsure), evidence(sure), evidence(unsure)]) == 1
    assert select([evidence(sure), evidence(sure), evidence(unsure)]) == 1


@settings(max_examples=40, deadline=None)
@given(
    p=hnp.arrays(np.float64, (12, 3), elements=st.floats(0.01, 1)),
    labels=hnp.arrays(np.int64, 12, elements=st.integers(0, 2)),
)
def test_scores_agree_with_scikit_learn(p: np.ndarray, labels: np.ndarray) -> None:
    from sklearn.metrics import confusion_matrix

    group = np.array([f"{c}" for c in labels])
    found = score(p, labels, group)
    predicted = p.argmax(axis=1)
    np.testing.assert_array_equal(found.confusion, confusion_matrix(labels, predicted, labels=[0, 1, 2]))
    assert found.accuracy == pytest.approx(np.trace(found.confusion) / 12)
    recalls = [np.mean(predicted[labels == c] == c) for c in np.unique(labels)]
    assert found.balanced_accuracy == pytest.approx(np.mean(recalls))
    assert 0 <= found.recordings_right <= found.recordings == len(set(group))


def test_a_recording_is_judged_by_its_mean_probability() -> None:
    p = np.array([[0.6, 0.4], [0.6, 0.4], [0.0, 1.0]])
    labels = np.array([1, 1, 1])
    assert score(p, labels, np.array(["a", "a", "a"])).recordings_right == 1


@pytest.mark.parametrize("level", [0.9, 0.95])
@pytest.mark.parametrize("n", [5, 10])
def test_t_interval_covers_what_it_claims(level: float, n: int) -> None:
    rng, trials = np.random.default_rng(0), 4000
    hit = 0
    for values in rng.normal(0.7, 0.05, (trials, n)):
        low, high = t_interval(values, level)
        hit += low <= 0.7 <= high
    assert hit / trials == pytest.approx(level, abs=4 * np.sqrt(level * (1 - level) / trials))


def test_bootstrap_covers_with_many_values_and_says_too_little_with_five() -> None:
    rng = np.random.default_rng(0)
    cover = {}
    for n in (5, 60):
        hits = [
            low <= 0.7 <= high
            for low, high in (
                bootstrap_interval(values, 0.9, rng, draws=400) for values in rng.normal(0.7, 0.05, (400, n))
            )
        ]
        cover[n] = np.mean(hits)
    assert cover[60] == pytest.approx(0.9, abs=0.05)
    assert cover[5] < 0.88, "as the docstring warns"


def test_intervals_need_two_values() -> None:
    assert np.isnan(t_interval([0.5], 0.9)).all()
    assert np.isnan(bootstrap_interval([0.5], 0.9, np.random.default_rng(0))).all()
