"""Records resampled to a common sampling rate on access."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from twingap.errors import TwingapError
from twingap.records import Array, Condition, RecordSet


def resampled(records: RecordSet, fs_hz: float | None) -> RecordSet:
    """The same records at sampling rate `fs_hz`, each resampled on access.

    A zero-phase FIR low-pass (Kaiser window, `scipy.signal.resample_poly`) prevents aliasing: 48 kHz to 12 kHz is
    decimation by 4. Records that have the rate already, or all when `fs_hz` is None, are passed on unchanged.

    Parameters
    ----------
    records : RecordSet
    fs_hz : float or None
        Output sampling rate, Hz.

    Returns
    -------
    RecordSet

    Raises
    ------
    TwingapError
        For a rate that is not positive, or a ratio that needs too long a filter.
    """
    if fs_hz is None or all(c.fs_hz == fs_hz for c in records.conditions):
        return records
    if not (math.isfinite(fs_hz) and fs_hz > 0):
        raise TwingapError(f"fs_hz = {fs_hz!r}, a positive number expected")
    ratios = [_ratio(fs_hz, condition) for condition in records.conditions]
    conditions = [
        replace(c, fs_hz=float(fs_hz), n_samples=-(-c.n_samples * r.numerator // r.denominator))
        for c, r in zip(records.conditions, ratios, strict=True)
    ]
    return RecordSet(records.name, records.unit, records.bearing, conditions, _Resampled(records, tuple(ratios)))


@dataclass(frozen=True)
class _Resampled:
    """Loader of record i at its new rate."""

    records: RecordSet
    ratios: tuple[Fraction, ...]

    def __call__(self, index: int) -> Array:
        samples, ratio = self.records[index].samples, self.ratios[index]
        if ratio == 1:
            return samples
        from scipy.signal import resample_poly  # slow import, not needed for listing and verifying

        # Subtracting a line between the ends of the record avoids ringing at its edges.
        return np.asarray(resample_poly(samples, ratio.numerator, ratio.denominator, padtype="line"), dtype=np.float64)


def _ratio(fs_hz: float, condition: Condition) -> Fraction:
    """Output over input rate as a ratio of small integers."""
    ratio = Fraction(fs_hz).limit_denominator(10**6) / Fraction(condition.fs_hz).limit_denominator(10**6)
    if max(ratio.numerator, ratio.denominator) > 1000:
        raise TwingapError(
            f"{condition.fs_hz:g} Hz cannot be resampled to {fs_hz:g} Hz: {ratio} is no ratio of small numbers",
            where=f"record {condition.name!r}",
            mend="choose a rate that divides it",
        )
    return ratio
