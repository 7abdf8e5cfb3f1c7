"""Paderborn University (KAt-DataCenter): 32 bearings of type 6203, healthy, damaged by a tool, or in lifetime tests.

<root>/paderborn/K001/N15_M07_F10_K001_1.mat: a struct of the file's name; its array Y has an element per channel, by
Name: vibration_1 at 64 kHz, beside phase_current_1, phase_current_2, force, speed, torque and temp_2_bearing_module

N15_M07_F10 is 1500 rpm, a load torque of 0.7 Nm and a radial force of 1000 N. K00x are healthy, KAxx have damage of the
outer race, KIxx of the inner, KBxx of both.
"""

from __future__ import annotations

import os
import re
from functools import partial
from pathlib import Path
from typing import Final

from twingap.bearing import BEARINGS
from twingap.data.lazy import Each
from twingap.data.manifest import manifest_of
from twingap.data.resample import resampled
from twingap.data.root import data_root, not_at_hand
from twingap.errors import TwingapError
from twingap.records import Array, Condition, RecordSet
from twingap.records.samples import load as load_samples

N_SAMPLES: Final = 249_600
"""Samples that are read of each recording, 3.9 s. Recordings have 249,940 to 256,823: to know each length, every file
would have to be opened."""
DAMAGED: Final = frozenset({"N15_M01_F10_KA08_2"})
"""Recordings whose files are damaged at the source."""
_NAME: Final = re.compile(r"(?P<setting>N(\d\d)_M(\d\d)_F(\d\d))_(?P<bearing>K[ABI]?\d+)_(?P<number>\d+)")


def load_paderborn(root: str | os.PathLike[str] | None = None, *, fs_hz: float | None = None) -> RecordSet:
    """The vibration of every available recording, one record each.

    Parameters
    ----------
    root : path-like, optional
        Data root; TWINGAP_DATA when absent. Folders below ``paderborn`` may have any names.
    fs_hz : float or None
        Output sampling rate, Hz; None keeps 64 kHz.

    Returns
    -------
    RecordSet
        Unit unknown (the files state none); speeds are nominal. `fault` is unknown where both races are damaged; column
        damage says "inner+outer" there, and the fault elsewhere. `group` is bearing and condition, since 20 recordings
        of one mounting are near copies; bearing_id is for the stricter split. Further columns: origin ("healthy",
        "artificial" or "lifetime"), cause, extent (1 to 3), condition, torque_nm.

    Raises
    ------
    NotAtHandError
        When no recording is available.
    TwingapError
        On access, when a file cannot be read, lacks the channel, or is shorter than 3.9 s.
    """
    folder, facts = data_root(root), manifest_of("paderborn")
    bearings = {row["bearing_id"]: row for row in facts.recordings}
    found: dict[tuple[str, str, int], tuple[Condition, Path]] = {}
    for path in sorted((folder / "paderborn").rglob("*.mat")):
        name = _NAME.fullmatch(path.stem)
        if name is None or name["bearing"] not in bearings or path.stem in DAMAGED:
            continue
        about, (speed, torque, force) = bearings[name["bearing"]], name.groups()[1:4]
        condition = Condition(
            name=path.stem, speed_rpm=100.0 * int(speed), fs_hz=float(about["fs_hz"]), n_samples=N_SAMPLES,
            fault=about.get("fault"), load_n=100.0 * int(force), group=f"{name['bearing']}_{name['setting']}",
            extra={
                **{key: about.get(key) for key in ("bearing_id", "damage", "origin", "cause", "extent")},
                "condition": name["setting"], "torque_nm": int(torque) / 10,
            },
        )  # fmt: skip
        found.setdefault((name["bearing"], name["setting"], int(name["number"])), (condition, path))
    if not found:
        raise not_at_hand(facts, folder, "no Paderborn recording")
    ordered = [found[key] for key in sorted(found)]
    loads = Each(tuple(partial(_vibration, path) for _, path in ordered))
    records = RecordSet(
        "paderborn", facts.unit, BEARINGS[facts.bearing or "6203-PU"], [condition for condition, _ in ordered], loads
    )
    return resampled(records, fs_hz)


def _vibration(path: Path) -> Array:
    samples = load_samples(path, f"{path.stem}.Y/vibration_1")
    if samples.size < N_SAMPLES:
        raise TwingapError(f"holds {samples.size} samples, at least {N_SAMPLES} expected", where=path)
    return samples[:N_SAMPLES].copy()
