"""Growing arrays: numbers of a run's rows, appended one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Columns:
    """Rows of numbers that grow, each column in one piece: eight bytes a number, its room doubled when it is full.

    Parameters
    ----------
    *names : str
        Of the columns, in the order in which a row is given.
    """

    def __init__(self, *names: str) -> None:
        self._places = {name: place for place, name in enumerate(names)}
        self._room = np.empty((len(names), 64))
        self._rows = 0

    def __len__(self) -> int:
        return self._rows

    def __getitem__(self, name: str) -> Array:
        """A view of a column [rows], to be copied where it is kept beyond the next row."""
        return self._room[self._places[name], : self._rows]

    def append(self, *row: float) -> None:
        """Take a row, a number for each column."""
        if self._rows == self._room.shape[1]:
            more = np.empty((self._room.shape[0], max(self._rows, 64)))
            self._room = np.concatenate((self._room, more), axis=1)
        self._room[:, self._rows] = row
        self._rows += 1

    def keep_last(self, rows: int) -> None:
        """Let go of all rows but the last ones."""
        self._room = self._room[:, max(self._rows - rows, 0) : self._rows].copy()
        self._rows = self._room.shape[1]
