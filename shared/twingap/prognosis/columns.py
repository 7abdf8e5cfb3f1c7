"""Table of numbers that grows by rows, for the rows of a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Columns:
    """Table that grows by rows and gives its columns as contiguous arrays.

    Parameters
    ----------
    *names : str
        Names of the columns, in the order of a row.
    """

    def __init__(self, *names: str) -> None:
        self._places = {name: place for place, name in enumerate(names)}
        self._room = np.empty((len(names), 64))
        self._rows = 0

    def __len__(self) -> int:
        return self._rows

    def __getitem__(self, name: str) -> Array:
        """View of a column [rows]; copy it where it is used after a further `append`."""
        return self._room[self._places[name], : self._rows]

    def append(self, *row: float) -> None:
        """Append a row, one number for each column."""
        if self._rows == self._room.shape[1]:
            more = np.empty((self._room.shape[0], max(self._rows, 64)))
            self._room = np.concatenate((self._room, more), axis=1)
        self._room[:, self._rows] = row
        self._rows += 1

    def keep_last(self, rows: int) -> None:
        """Remove all rows except the last ones."""
        self._room = self._room[:, max(self._rows - rows, 0) : self._rows].copy()
        self._rows = self._room.shape[1]
