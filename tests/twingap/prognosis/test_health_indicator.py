"""Health indicators: criteria by hand and by property, fusion against NumPy's SVD, no later record read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.prognosis.fusion import constant, learn_fusion
from twingap.prognosis.health_indicator import (
    Run,
    chosen,
    evaluate_candidates,
    features_of,
    offline_indicators,
    online_indicators,
    running,
)
from twingap.prognosis.indicator_criteria import IndicatorCriteria, causal_trend, evaluate_indicator
from twingap.records import Condition, Record, RecordSet
from twingap.signal.features import PAPER2_FEATURES, paper2_features

Array = NDArray[np.float64]
T: Array = 10.0 * np.arange(200, dtype=np.float64)


def features(seed: int = 0) -> Run:
    """Five features, of which the third follows from the first two and the last grows."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((200, 5)) * [1, 10, 1, 0.1, 1] + [0, 100, 0, 5, 0]
    x[:, 2] = x[:, 0] - 0.1 * x[:, 1]
    x[:, 4] += 8 * (T / T[-1]) ** 3
    return Run("made", T, ("a", "b", "follows", "c", "grows"), x)


def records(values: list[float], times: list[float | None]) -> RecordSet:
    made = []
    for k, (size, time_s) in enumerate(zip(values, times, strict=True)):
        x = size * np.random.default_rng(k).standard_normal(1024)
        made.append(Record(Condition(f"r{k}", 1800.0, 25600.0, 1024, time_s=time_s, group="one"), x))
    return RecordSet.from_records("run", "g", BEARINGS["PRONOSTIA"], made)


def test_a_monotone_indicator_has_monotonicity_one_and_a_line_trendability_one() -> None:
    for x in (T**3, -np.sqrt(T), np.log1p(T)):
        assert evaluate_indicator(x, T, healthy_rows=20).monotonicity == 1
    line = evaluate_indicator(3 - 2 * T, T, healthy_rows=20)
    assert line.trendability == pytest.approx(1) and line.robustness == 1 and line.suitability == pytest.approx(1)
    zigzag = evaluate_indicator(np.arange(200) % 2.0, T, healthy_rows=20)
    assert zigzag.monotonicity == pytest.approx(1 / 199) and zigzag.trendability < 0.02
    assert evaluate_indicator(np.ones(200), T, healthy_rows=20) == IndicatorCriteria(0, 0, 0, 0)


def test_criteria_by_hand() -> None:
    x = np.array([0.0, 2.0, 1.0, 3.0, 7.0])
    found = evaluate_indicator(x, np.arange(5.0), healthy_rows=2)
    assert found.monotonicity == pytest.approx(2 / 4)
    assert found.trendability == pytest.approx(np.corrcoef(x, np.arange(5))[0, 1])
    assert found.sensitivity == pytest.approx(6 / np.std([0, 2], ddof=1))
    two = evaluate_indicator(x, np.arange(5.0), healthy_rows=2, window=2)  # trend 0, 1, 1.5, 2, 5
    assert two.monotonicity == 1
    assert two.robustness == pytest.approx(np.mean(np.exp(-np.array([0, 1, 0.5, 1, 2]) / 5)))


def test_criteria_do_not_depend_on_unit_zero_or_sign() -> None:
    x = np.random.default_rng(0).standard_normal(200) + (T / T[-1]) ** 2 * 10
    a = evaluate_indicator(x, T, healthy_rows=50, window=10)
    b = evaluate_indicator(7 - 3 * x, T / 60, healthy_rows=50, window=10)
    for name in ("monotonicity", "trendability", "robustness", "sensitivity"):
        assert getattr(a, name) == pytest.approx(getattr(b, name))


def test_the_trend_is_a_mean_of_rows_up_to_now() -> None:
    x = np.random.default_rng(1).standard_normal((50, 2))
    trend = causal_trend(x, 7)
    for k in (0, 3, 6, 20, 49):
        assert trend[k] == pytest.approx(x[max(k - 6, 0) : k + 1].mean(axis=0))
    assert causal_trend(x, 1) == pytest.approx(x)
    assert np.ptp(causal_trend(np.full(1000, 0.1), 30)) < 1e-15
    with pytest.raises(TwingapError, match="1 or more"):
        causal_trend(x, 0)


def test_fusion_is_the_svd_of_what_is_normalised() -> None:
    x = features().features[:, [0, 1, 3, 4]]
    made = learn_fusion(x)
    z = (x - x.mean(axis=0)) / x.std(axis=0, ddof=1)
    u, s, vt = np.linalg.svd(z, full_matrices=False)
    assert made.variance == pytest.approx(s**2 / 199)
    assert np.abs(np.sum(made.axes * vt, axis=1)) == pytest.approx(1)
    assert np.abs(made.fused(x)) == pytest.approx(np.abs(u * s), abs=1e-9)
    upwards = learn_fusion(x, order="ascending")
    assert upwards.fused(x) == pytest.approx(made.fused(x)[:, ::-1])
    ranged = learn_fusion(x, scaling="range").normalised(x)
    assert ranged.min(axis=0) == pytest.approx(0) and ranged.max(axis=0) == pytest.approx(1)


def test_features_that_follow_from_others_leave_no_fusion_feature_of_rounding() -> None:
    run = features()
    made = offline_indicators(run)
    assert len(made.fusion.variance) == 4
    assert "fusion 4" in made.values and "fusion 5" not in made.values


def test_an_online_indicator_reads_no_later_row() -> None:
    """Values of the first rows, and their fusion, are the same bytes whatever follows; offline they are not."""
    run = features()
    later = run.features.copy()
    later[120:] = 1e3 * np.random.default_rng(2).standard_normal((80, 5))
    changed = replace(run, features=later)
    a, b, short = (online_indicators(r, 50) for r in (run, changed, run.until(120)))
    for name, values in a.values.items():
        assert np.array_equal(values[:120], b.values[name][:120])
        assert short.values[name] == pytest.approx(values[:120], abs=1e-12)
    off = offline_indicators(run).values["a"], offline_indicators(changed).values["a"]
    assert not np.allclose(off[0][:120], off[1][:120])


def test_what_grows_is_chosen_and_a_choice_on_other_runs_needs_names_in_common() -> None:
    runs = [features(seed) for seed in range(3)]
    found = [evaluate_candidates(online_indicators(r, 50), r.time_s, healthy_rows=50, window=10) for r in runs]
    assert chosen(found[1:]) in ("grows", "fusion 1", "fusion 2", "fusion 3", "fusion 4")
    plain = [{k: c for k, c in f.items() if not k.startswith("fusion")} for f in found]
    assert chosen(plain) == "grows"
    assert chosen([{"a": found[0]["a"], "grows": found[0]["grows"]}, {"a": found[0]["a"]}]) == "a"
    with pytest.raises(TwingapError, match="all runs"):
        chosen([{"a": found[0]["a"]}, {"b": found[0]["b"]}])


def test_constant_features_are_left_out_and_only_constant_ones_refused() -> None:
    run = features()
    flat = run.features.copy()
    flat[:, 3] = 5.0
    assert online_indicators(replace(run, features=flat), 50).constant == ("c",)
    assert constant(flat).tolist() == [False, False, False, True, False]
    with pytest.raises(TwingapError, match="all 5 features are constant"):
        online_indicators(replace(run, features=np.ones((200, 5))), 50)
    with pytest.raises(TwingapError, match="does not vary"):
        learn_fusion(flat)
    with pytest.raises(TwingapError, match="fewer than all"):
        online_indicators(run, 200)


def test_features_of_records_are_sorted_by_time_and_the_papers_fifteen() -> None:
    run = features_of(records([1, 2, 3], [20.0, 0.0, 10.0]))
    assert run.names == PAPER2_FEATURES and run.time_s.tolist() == [0, 10, 20]
    rms = run.features[:, run.names.index("rms")]
    assert rms == pytest.approx([2, 3, 1], rel=0.1)
    alone = paper2_features(np.random.default_rng(0).standard_normal(1024), 25600.0).values
    assert run.features[2] == pytest.approx(alone)
    assert run.only(("std", "rms")).features[:, 1] == pytest.approx(rms)


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ([0.0, None, 10.0, 20.0], "no time_s"),
        ([0.0, 0.0, 10.0, 10.0], "2 of 4 rows have the time of another row, the first are 'r0' and 'r1'"),
    ],
)
def test_records_that_are_no_run_are_refused(times: list[float | None], said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        features_of(records([1, 1, 1, 1], times))


def test_a_repeated_time_and_a_clock_set_back_are_noted() -> None:
    notes: list[str] = []
    run = features_of(records([1, 2, 3, 4], [0.0, 10.0, 10.0, 5.0]), notes=notes)
    assert run.time_s.tolist() == [0, 5, 10, 10]
    assert any("time_s goes back 1 time" in note for note in notes)
    assert any("1 row has the time of the row before" in note for note in notes)


@pytest.mark.parametrize(
    ("time_s", "value", "said"), [([1.0, 0.0], 1.0, "times decrease"), ([0.0, 1.0], np.nan, "NaN")]
)
def test_a_run_is_checked(time_s: list[float], value: float, said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        Run("x", np.array(time_s), ("a",), np.array([[1.0], [value]]))


@pytest.mark.parametrize(("still", "level"), [(20, 0.0), (20, 0.01), (40, 0.0)])
def test_rows_before_the_machine_runs_are_silent(still: int, level: float) -> None:
    rms = np.where(np.arange(90) < still, level, 1.0)
    found = running(Run("late", np.arange(90.0), ("rms",), rms[:, None]), 30)
    assert found.tolist() == (np.arange(90) >= still).tolist()
    assert running(Run("never", np.arange(90.0), ("rms",), np.zeros((90, 1))), 30).all(), "then it is no rms"
