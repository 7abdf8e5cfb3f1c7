"""HIT-SM: 6205 bearings on a SpectraQuest machinery fault simulator at 600, 900 and 1200 rpm.

<root>/hit_sm/IR2_600.mat: one vector of 262,144 samples at 51.2 kHz, under a name that differs per file; unit unknown
"""

from __future__ import annotations

import os

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each
from twingap.data.manifest import manifest_of
from twingap.data.resample import resampled
from twingap.data.root import data_root, not_at_hand
from twingap.records import Condition, RecordSet
from twingap.records.samples import inspect


def load_hit_sm(root: str | os.PathLike[str] | None = None, *, fs_hz: float | None = None) -> RecordSet:
    """Every available recording, one record each.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps 51.2 kHz.

    Returns
    -------
    RecordSet
        Unit unknown (not stated by the authors). `group` is the recording; extra columns defect_arc_deg,
        cantilever_load_kg (a mass on the overhung shaft: the bearing's own load is not given, so `load_n` stays empty)
        and bearing_id (one bearing per state, as far as the authors state).

    Raises
    ------
    NotAtHandError
        When no recording is available.
    TwingapError
        When a file cannot be read or holds more than one vector.
    """
    folder, facts = data_root(root), manifest_of("hit_sm")
    at_hand = [row for row in facts.recordings if (folder / row["file"]).is_file()]
    if not at_hand:
        raise not_at_hand(facts, folder, "no HIT-SM recording")
    vectors = [inspect(folder / row["file"]).find() for row in at_hand]
    conditions = [
        Condition(
            name=row["recording"],
            speed_rpm=float(row["speed_rpm"]),
            fs_hz=float(row["fs_hz"]),
            n_samples=vector.n_samples,
            fault=row["fault"],
            extra={key: row[key] for key in ("defect_arc_deg", "cantilever_load_kg", "bearing_id")},
        )
        for row, vector in zip(at_hand, vectors, strict=True)
    ]
    bearing = BEARINGS[facts.bearing or "6205"]
    records = RecordSet("hit_sm", facts.unit, bearing, conditions, Each(tuple(vector.load for vector in vectors)))
    return resampled(records, fs_hz)
