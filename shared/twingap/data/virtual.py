"""Virtual rigs as data sets: simulated when asked for, by `twingap.rigs`; nothing lies under the data root."""

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
        Taken so that all readers are called alike; no data root is needed.
    seed : int
        Which machine and bearings; the same seed gives the same bytes.
    duration_s : float
        Length of each recording, s.
    fs_hz : float or None
        Rate to which records are brought; None keeps the rig's 12 kHz.

    Returns
    -------
    RecordSet
        As `twingap.rigs.VirtualCwru.records`.

    Raises
    ------
    TwingapError
        For a negative seed or a length that the rig does not make.
    """
    if seed < 0:
        raise TwingapError(f"seed = {seed}, a whole number of at least 0 expected", where="data set virtual_cwru")
    return resampled(make_rig("virtual_cwru", duration_s=duration_s).records(seed), fs_hz)
