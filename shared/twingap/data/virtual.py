"""Virtual rigs as data sets: simulated on access by `twingap.rigs`, without files under the data root."""

from __future__ import annotations

import os

from twingap.data.resample import resampled
from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.rigs import make_rig


def load_virtual_cwru(
    root: str | os.PathLike[str] | None = None,
    *,
    seed: int = 0,
    duration_s: float = 10.0,
    fs_hz: float | None = None,
) -> RecordSet:
    """Records of the virtual CWRU-like stand.

    Parameters
    ----------
    root : ignored
        Accepted for a signature common to all readers.
    seed : int
        Selects machine and bearings; the same seed gives the same bytes.
    duration_s : float
        Length of each recording, s.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps the rig's 12 kHz.

    Returns
    -------
    RecordSet
        See `twingap.rigs.VirtualCwru.records`.

    Raises
    ------
    TwingapError
        For a negative seed or an unsupported length.
    """
    if seed < 0:
        raise TwingapError(f"seed = {seed}, a whole number of at least 0 expected", where="data set virtual_cwru")
    return resampled(make_rig("virtual_cwru", duration_s=duration_s).records(seed), fs_hz)
