"""Columns of a growing run: what went in comes out, in little more room than the numbers need."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from twingap.prognosis.columns import Columns

NUMBERS = st.floats(allow_nan=False)


@given(st.lists(st.tuples(NUMBERS, NUMBERS), max_size=200), st.integers(0, 250), st.lists(NUMBERS, max_size=80))
def test_rows_come_back_as_they_were_given(rows: list[tuple[float, float]], last: int, more: list[float]) -> None:
    columns = Columns("a", "b")
    for row in rows:
        columns.append(*row)
    assert len(columns) == len(rows) == columns["a"].size
    columns.keep_last(last)
    kept = rows[len(rows) - min(last, len(rows)) :]
    for number in more:
        columns.append(number, -number)
    kept += [(number, -number) for number in more]
    np.testing.assert_array_equal(columns["a"], [a for a, _ in kept])
    np.testing.assert_array_equal(columns["b"], [b for _, b in kept])
    assert len(columns) == len(kept) and columns["b"].flags.c_contiguous
