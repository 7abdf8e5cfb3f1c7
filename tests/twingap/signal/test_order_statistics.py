"""Order statistics by bins of leading bits, against sorting."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from twingap.signal.order_statistics import order_statistics

FINITE = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=True)


@settings(deadline=None)
@given(arrays(np.float64, st.integers(1, 200), elements=FINITE), st.data())
def test_equals_sorting(x, data):
    ranks = np.array(data.draw(st.lists(st.integers(0, x.size - 1), min_size=1, max_size=30)))
    np.testing.assert_array_equal(order_statistics(x, ranks), np.sort(x)[ranks])


@pytest.mark.parametrize(
    "x",
    [
        np.random.default_rng(0).standard_normal(20000),
        np.random.default_rng(1).standard_cauchy(5000) * 1e200,
        np.round(np.random.default_rng(2).standard_normal(5000), 1),  # a coarse converter: few values, many of each
        np.random.default_rng(3).standard_normal(5000).astype(np.float32)[::2],
        np.r_[np.zeros(300), 1e-30, -1e-30, 1.0],  # 100 octaves apart
    ],
    ids=["noise", "heavy tails", "coarse", "float32, strided", "dropout"],
)
def test_of_records(x):
    ranks = np.unique(np.linspace(0, x.size - 1, 40).astype(int))[::-1]
    np.testing.assert_array_equal(order_statistics(x, ranks), np.sort(x.astype(float))[ranks])
    np.testing.assert_array_equal(order_statistics(np.abs(x), ranks), np.sort(np.abs(x).astype(float))[ranks])
