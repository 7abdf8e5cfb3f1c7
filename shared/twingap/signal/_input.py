"""Input checks of all signal functions: finite numbers, time last."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twingap.errors import TwingapError

Array = NDArray[np.float64]

_LARGEST = 1e70
"""Largest magnitude accepted: fourth powers of larger numbers overflow."""


def as_signals(x: ArrayLike, *, where: str, at_least: int = 1) -> Array:
    """`x` as float64 `[..., samples]`; anything but finite numbers is refused.

    Parameters
    ----------
    x : array_like [..., samples]
    where : str
        Name of the calling function, for the message.
    at_least : int
        Smallest number of samples.

    Returns
    -------
    Array [..., samples]
        A view where possible: not to be modified.

    Raises
    ------
    TwingapError
        For text, complex numbers, NaN, infinities, numbers beyond 1e70, a scalar, no signals, or too few samples.
    """
    try:
        given = np.asarray(x)
    except ValueError:
        raise TwingapError("signals of different lengths", where=where, mend="cut them to one length") from None
    if given.dtype.kind not in "biuf":
        raise TwingapError(f"signal of type {given.dtype}, real numbers expected", where=where)
    if given.ndim == 0:
        raise TwingapError("signal is a single number, an array [..., samples] expected", where=where)
    if given.shape[-1] < at_least:
        raise TwingapError(
            f"signal has {given.shape[-1]} samples, at least {at_least} expected",
            where=where,
            mend="use longer records",
        )
    if given.size == 0:
        raise TwingapError(f"no signals: array of shape {given.shape}", where=where)
    signals = np.asarray(given, dtype=np.float64)
    if not np.isfinite(signals).all():
        bad = int(np.count_nonzero(~np.isfinite(signals)))
        raise TwingapError(
            f"signal holds {bad} values that are NaN or infinite (of {signals.size})",
            where=where,
            mend="cut them out or fill the gaps first",
        )
    if max(-signals.min(), signals.max()) > _LARGEST:
        raise TwingapError(f"signal holds values above {_LARGEST:g}", where=where, mend="check the unit, or the reader")
    return signals


def positive(value: float, name: str, *, where: str) -> float:
    """`value` as float, refused unless it is finite and above zero."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0):
        raise TwingapError(f"{name} = {value!r}, a positive number expected", where=where)
    return number


def whole(value: int, name: str, *, where: str, at_least: int = 1) -> int:
    """`value` as int, refused unless it is an integer of at least `at_least`."""
    try:
        number = int(value)
        wrong = isinstance(value, bool) or number != value or number < at_least
    except (TypeError, ValueError, OverflowError):
        wrong = True
    if wrong:
        raise TwingapError(f"{name} = {value!r}, a whole number of at least {at_least} expected", where=where)
    return number


def band(low_hz: float, high_hz: float, nyquist_hz: float, *, where: str) -> tuple[float, float]:
    """The band, refused unless 0 <= low < high <= nyquist."""
    if not 0 <= low_hz < high_hz <= nyquist_hz * (1 + 1e-12):
        raise TwingapError(
            f"band {low_hz:g} to {high_hz:g} Hz, 0 <= low < high <= {nyquist_hz:g} Hz (half the rate) expected",
            where=where,
        )
    return float(low_hz), min(float(high_hz), nyquist_hz)


def without_mean(signals: Array) -> Array:
    """Signals minus their means; exactly zero for a constant, whose mean has a rounding error."""
    centred = signals - signals.mean(axis=-1, keepdims=True)
    largest = np.abs(signals).max(axis=-1, keepdims=True)
    nothing = np.abs(centred).max(axis=-1, keepdims=True) <= 1e-14 * largest
    return np.where(nothing, 0.0, centred)
