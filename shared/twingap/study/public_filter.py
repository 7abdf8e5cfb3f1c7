"""Real records through a drawn filter: is `transfer_path` named, and its gain recovered?

one half of the records --drawn FIR filter--> machine --diagnosed against the other half--> path --gain--> error, dB
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin2, freqz, oaconvolve, welch

from twingap.effects import TransferPath
from twingap.errors import TwingapError
from twingap.records import Record, RecordSet
from twingap.study.tables import grid
from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]

GAINS: Final = 14
"""Gains that are drawn between 0 and half of the sampling rate. More make a filter that needs a finer path."""
LARGEST_DB: Final = 8.0
"""Largest gain. A larger one makes the path easier to find."""
_TAPS: Final = 129
"""Length of the filter. A longer one follows the drawn gains more closely."""
_ENERGY: Final = 0.01
"""Power spectral density over its maximum, from which records have energy. A smaller value adds weak bands."""
_SEGMENT: Final = 1024
"""Samples of a segment of a spectrum. Longer ones resolve narrower bands."""


def drawn_filter(rng: np.random.Generator) -> Array:
    """[taps] Filter of linear phase whose gains are drawn between -`LARGEST_DB` and `LARGEST_DB`."""
    gains_db = rng.uniform(-LARGEST_DB, LARGEST_DB, GAINS)
    return np.asarray(firwin2(_TAPS, np.linspace(0, 1, GAINS), 10 ** (gains_db / 20)))


def filtered(records: RecordSet, taps: Array) -> RecordSet:
    """The records through a filter [taps]."""
    made = [Record(r.condition, oaconvolve(r.samples, taps, mode="same")) for r in records]
    return RecordSet.from_records(f"{records.name}, filtered", records.unit, records.bearing, made)


def filter_row(machine: RecordSet, other: RecordSet, spec: TwinSpec, rng: np.random.Generator) -> dict[str, Any]:
    """Verdict on filtered records against those of the other half, and errors of the recovered gain.

    Returns
    -------
    dict
        refused, status, effects, closure, closure_ci; median_db and ninth_db, median and 90 % quantile of the absolute
        error of the gain where the records have energy, None where no path is named.
    """
    from twingap.gap import diagnose

    begin = time.perf_counter()
    taps = drawn_filter(rng)
    records = filtered(machine, taps)
    try:
        found = diagnose(records, spec, seed=rng, sim=other, quick=True)
    except TwingapError as error:
        return {"refused": str(error)}
    verdict, after = found.report.verdict, found.explanation.after
    path = next((effect for effect in after.effects if isinstance(effect, TransferPath)), None)
    middle, ninth = None, None
    if path is not None:
        off = gain_error_db(path, float(getattr(after.simulator, "gain", 1.0)), records, taps)
        middle, ninth = float(np.median(off)), float(np.quantile(off, 0.9))
    return {
        "refused": "", "status": verdict.status, "effects": list(verdict.effects), "closure": verdict.closure,
        "closure_ci": None if verdict.closure_ci is None else list(verdict.closure_ci), "median_db": middle,
        "ninth_db": ninth, "seconds": time.perf_counter() - begin,
    }  # fmt: skip


def gain_error_db(path: TransferPath, gain: float, records: RecordSet, taps: Array) -> Array:
    """[frequencies] Absolute error of a path's gain, times that of the simulator, where the records have energy."""
    fs_hz = records.conditions[0].fs_hz
    spectra = [welch(r.samples / r.samples.std(), fs_hz, nperseg=_SEGMENT)[1] for r in records]
    f_hz, power = np.fft.rfftfreq(_SEGMENT, 1 / fs_hz), np.mean(spectra, axis=0)
    true = np.abs(freqz(taps, worN=2 * np.pi * f_hz / fs_hz)[1])
    recovered = path.depth * np.interp(f_hz, path.frequencies_hz, path.gains_db) + 20 * np.log10(gain)
    energetic = power > _ENERGY * power.max()
    return np.asarray(np.abs(recovered - 20 * np.log10(true))[energetic])


def filter_section(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Heading, text and table on filtered records."""
    return [
        "## Real records through a drawn filter",
        "One half of the real recordings is used as the simulator; the other half passes a filter whose "
        f"{GAINS} gains are drawn between -{LARGEST_DB:g} and {LARGEST_DB:g} dB. Error: of the path's gain, where the "
        f"spectrum of the records is within {-10 * np.log10(_ENERGY):g} dB of its maximum. It includes what the two "
        "halves differ by.",
        grid(filter_rows(rows)),
    ]


def filter_rows(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """One row of text per halving: verdict, what it closes, and the error of the gain."""
    return [_shown(row) for row in rows]


def _shown(row: Mapping[str, Any]) -> dict[str, str]:
    first = {"set": row["title"], "halving": str(row["split"]), "halved by": row["split_by"]}
    if row["refused"]:
        return {**first, "verdict": f"refused: {row['refused']}"}
    known, low_high = row["median_db"] is not None, row["closure_ci"] or ()
    return {
        **first,
        "verdict": row["status"],
        "named": ", ".join(row["effects"]) or "nothing",
        "closes": "{:.2f} ({:.2f} to {:.2f})".format(row["closure"], *low_high) if low_high else "",
        "error of the gain, dB: median": f"{row['median_db']:.2f}" if known else "",
        "90 %": f"{row['ninth_db']:.2f}" if known else "",
    }  # fmt: skip
