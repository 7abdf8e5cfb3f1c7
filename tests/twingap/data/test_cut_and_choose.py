"""Cutting, resampling and choosing records."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.data import cut, resampled, where
from twingap.data.lazy import Latest
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet


def record(name: str, n: int = 1000, fs_hz: float = 100.0, **own: object) -> Record:
    samples = np.random.default_rng(len(name) + n).normal(size=n)
    return Record(Condition(name, 600.0, fs_hz, n, **own), samples)  # type: ignore[arg-type]


def records(*held: Record) -> RecordSet:
    return RecordSet.from_records("test", "g", None, held)


@given(n=st.integers(1, 400), length=st.integers(1, 120), step=st.integers(1, 150) | st.none())
@settings(deadline=None, max_examples=60)
def test_pieces_are_the_recording(n: int, length: int, step: int | None) -> None:
    whole = records(record("a", n, group="G", time_s=5.0), record("b", 400))
    pieces = cut(whole, n_samples=length, step=step)
    of_a = [p for p in pieces if p.condition.group == "G"]
    assert len(of_a) == max(0, (n - length) // (step or length) + 1)
    for i, piece in enumerate(of_a):
        start = i * (step or length)
        np.testing.assert_array_equal(piece.samples, whole[0].samples[start : start + length])
        assert piece.condition.time_s == pytest.approx(5.0 + start / 100.0)
    assert set(pieces.groups) <= set(whole.groups)


def test_pieces_in_seconds_follow_each_record_s_rate() -> None:
    pieces = cut(records(record("a", 1000, 100.0), record("b", 1000, 250.0)), duration_s=2.0)
    assert [c.n_samples for c in pieces.conditions] == [200] * 5 + [500] * 2


@pytest.mark.parametrize(
    "lengths",
    [{}, {"n_samples": 10, "duration_s": 1.0}, {"n_samples": 0}, {"duration_s": -1.0}, {"n_samples": 5, "step": 0}],
)
def test_impossible_lengths_are_refused(lengths: dict[str, float]) -> None:
    with pytest.raises(TwingapError):
        cut(records(record("a")), **lengths)  # type: ignore[arg-type]


def test_records_that_are_all_too_short_are_refused() -> None:
    with pytest.raises(TwingapError, match="longest record has 1000 samples"):
        cut(records(record("a")), n_samples=1001)


def test_a_recording_is_read_once_for_its_neighbouring_pieces() -> None:
    reads: list[int] = []

    def load(index: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        reads.append(index)
        return np.arange(100.0)

    whole = RecordSet("x", "", None, [Condition("a", 60, 10, 100), Condition("b", 60, 10, 100)], load)
    for piece in cut(whole, n_samples=10):
        piece.samples[:] = 0  # a piece is the caller's own
    assert reads == [0, 1]
    assert list(cut(whole, n_samples=10)[3].samples) == list(range(30, 40))


def test_latest_holds_one_value() -> None:
    calls: list[int] = []
    latest = Latest(lambda key: calls.append(key) or key)
    assert [latest(k) for k in (1, 1, 2, 1)] == [1, 1, 2, 1]
    assert calls == [1, 2, 1]


@pytest.mark.parametrize(("fs_hz", "n"), [(50.0, 500), (25.0, 250), (150.0, 1500), (30.0, 300)])
def test_resampling_keeps_a_slow_tone_in_place(fs_hz: float, n: int) -> None:
    t = np.arange(1000) / 100
    tone = Record(Condition("a", 600, 100.0, 1000), 3.0 + np.sin(2 * np.pi * 2.0 * t + 0.3))
    [out] = resampled(records(tone), fs_hz)
    assert out.condition.n_samples == len(out.samples) == n
    assert out.condition.fs_hz == fs_hz
    wanted = 3.0 + np.sin(2 * np.pi * 2.0 * np.arange(n) / fs_hz + 0.3)
    inside = slice(n // 10, -n // 10)
    np.testing.assert_allclose(out.samples[inside], wanted[inside], atol=0.02)


def test_resampling_does_not_ring_at_the_ends_of_an_offset() -> None:
    flat = Record(Condition("a", 600, 100.0, 1000), np.full(1000, 3.0))
    np.testing.assert_allclose(resampled(records(flat), 25.0)[0].samples, 3.0, atol=1e-3)


def test_resampling_leaves_the_right_rate_alone() -> None:
    whole = records(record("a"), record("b", fs_hz=200.0))
    assert resampled(whole, None) is whole
    mixed = resampled(whole, 100.0)
    np.testing.assert_array_equal(mixed[0].samples, whole[0].samples)
    assert mixed.conditions[1].n_samples == 500


LOADED = records(
    record("a", fault="inner", extra={"load_hp": 2, "place": "DE"}),
    record("b", fault="outer", extra={"load_hp": 2.0, "place": "FE"}),
    record("c", extra={"load_hp": 0}),
)


@pytest.mark.parametrize(
    ("conditions", "names"),
    [
        (["load_hp=2"], ["a", "b"]),
        (["load_hp = 2.0", "fault=inner"], ["a"]),
        (["load_hp=2,fault=outer"], ["b"]),
        (["fault="], ["c"]),
        (["place='FE'"], ["b"]),
        (["record=c"], ["c"]),
        (["speed_rpm=600"], ["a", "b", "c"]),
        ([], ["a", "b", "c"]),
    ],
)
def test_conditions_choose(conditions: list[str], names: list[str]) -> None:
    assert [c.name for c in where(LOADED, conditions).conditions] == names


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("load=2", "no column 'load'; columns: record, speed_rpm"),
        ("load_hp=two", "load_hp = 'two', a number expected; load_hp takes 2, 0"),
        ("load_hp=nan", "a number expected"),
        ("load_hp=3", "no record of test has load_hp=3"),
        ("fault=cage", "fault takes inner, outer"),
        ("load_hp", "is no condition; write column=value"),
        ("load_hp>=2", "is no condition"),
        ("=2", "is no condition"),
        ("", "is no condition"),
    ],
)
def test_wrong_conditions_are_one_line(condition: str, said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        where(LOADED, [condition])
