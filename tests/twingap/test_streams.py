"""Random streams: the same for the same key, unrelated for any other."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from twingap.streams import Streams, root_entropy


def test_a_stream_depends_on_root_place_and_purpose_alone() -> None:
    first = Streams(5, 1)("white_noise")
    first.random(10)
    np.testing.assert_array_equal(Streams(5, 1)("white_noise").random(10), Streams(5, 1)("white_noise").random(10))
    draws = {Streams(root, i)(p).random() for root in (5, 51) for i in (1, 11) for p in ("a", "b", "1 a", "")}
    assert len(draws) == 16, "no two keys run together"


def test_bytes_are_those_of_every_machine() -> None:
    assert Streams(5, 1)("x").integers(0, 2**63, 2).tolist() == [6458784219366425138, 1680548401234738095]


def test_streams_are_unrelated_and_normal() -> None:
    x = np.stack([Streams(7, i)("noise").standard_normal(2000) for i in range(200)])
    assert abs(x.mean()) < 5 / np.sqrt(x.size)
    assert x.var() == pytest.approx(1, abs=5 * np.sqrt(2 / x.size))
    correlation = np.corrcoef(x)[np.triu_indices(200, 1)] * np.sqrt(2000)
    assert correlation.std() == pytest.approx(1, abs=0.03)
    assert abs(correlation).max() < 6
    firsts = np.array([Streams(7, i)("noise").random() for i in range(4000)])
    assert np.histogram(firsts, 10, (0, 1))[0].std() < 2 * np.sqrt(400)


def test_streams_travel_to_other_processes() -> None:
    there = pickle.loads(pickle.dumps(Streams(5, 1)))
    assert there("x").random() == Streams(5, 1)("x").random()


def test_root_is_one_draw_of_128_bits() -> None:
    rng = np.random.default_rng(0)
    roots = {root_entropy(rng) for _ in range(100)}
    assert len(roots) == 100
    assert max(roots) > 2**120
