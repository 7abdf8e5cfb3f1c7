"""Order tracking: resampling from equal times to equal shaft angles.

speed or tacho -> turns(t) -> resample x at turns = 0, 1/n, 2/n, ... -> spectrum over orders, average over turns

Components tied to the shaft become sharp lines at their orders, even if the speed varies within the record.
Source: Fyfe and Munck, Analysis of computed order tracking, MSSP 11 (1997) 187, doi:10.1006/mssp.1996.0056.
"""

from __future__ import annotations

import math
import warnings
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal as sps
from scipy.interpolate import CubicSpline, PchipInterpolator

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, positive, whole
from twingap.signal.spectrum import Spectrum, amplitude_spectrum
from twingap.signal.tacho import repaired_tacho

_FINER = 4
"""Oversampling before cubic interpolation, which is accurate only well below half the rate; larger is slower."""
_HALF_LENGTH = 64
"""Half length of the anti-aliasing filter in angle steps: passes 0.92 of half the rate; longer is steeper."""


def turns_from_speed(speed_rpm: ArrayLike, fs_hz: float) -> Array:
    """Shaft angle from a speed profile, by the trapezoidal rule.

    Parameters
    ----------
    speed_rpm : array_like [..., samples]
        Speed at each sample, rev/min, positive.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    Array [..., samples]
        Turns since the first sample.

    Raises
    ------
    TwingapError
        For NaN, infinities, or a speed that is not positive.
    """
    speed = as_signals(speed_rpm, where="turns_from_speed")
    rate = positive(fs_hz, "fs_hz", where="turns_from_speed")
    if speed.min() <= 0:
        raise TwingapError(
            f"speed_rpm falls to {speed.min():g}", where="turns_from_speed", mend="cut out where the shaft stands"
        )
    turns = np.zeros_like(speed)
    np.cumsum((speed[..., 1:] + speed[..., :-1]) / (120 * rate), axis=-1, out=turns[..., 1:])
    return turns


def turns_from_tacho(
    pulse_times_s: ArrayLike,
    samples: int,
    fs_hz: float,
    *,
    pulses_per_turn: int = 1,
    repair: Literal["refuse", "repair", "keep"] = "refuse",
) -> Array:
    """Shaft angle at each sample from the times of tacho pulses.

    Monotone cubic interpolation between pulses; before the first and after the last, the speed of the outermost pair.

    Parameters
    ----------
    pulse_times_s : array_like [pulses]
        Ascending, in s from the first sample; at least 2.
    samples : int
        Length of the record.
    fs_hz : float
        Sampling rate, Hz.
    pulses_per_turn : int
    repair : {"refuse", "repair", "keep"}
        What is done about missing and double pulses, which put the angle off by whole pulses: an error that names the
        first; repair by `repaired_tacho`, with a warning that counts them; or nothing, where intervals really vary that
        much.

    Returns
    -------
    Array [samples]
        Turns since the first pulse (negative before it).

    Raises
    ------
    TwingapError
        For fewer than two pulses, times that do not ascend, and missing or double pulses unless they are repaired.
    """
    where = "turns_from_tacho"
    times = as_signals(pulse_times_s, where=where, at_least=2)
    if times.ndim != 1 or np.any(np.diff(times) <= 0):
        raise TwingapError("pulse times are not one ascending row", where=where, mend="sort them, drop repeated ones")
    if repair != "keep":
        pulses_found = repaired_tacho(times)
        if pulses_found.notes and repair == "refuse":
            faults = "; ".join(note.rpartition(":")[0] for note in pulses_found.notes)
            mend = 'pass repair="repair", or repair="keep" where the shaft really turns so unevenly'
            raise TwingapError(faults, where=where, mend=mend)
        for note in pulses_found.notes:
            warnings.warn(f"tacho: {note}", stacklevel=2)
        times = pulses_found.times_s
    t = np.arange(whole(samples, "samples", where=where)) / positive(fs_hz, "fs_hz", where=where)
    pulses = np.arange(times.size) / whole(pulses_per_turn, "pulses_per_turn", where=where)
    turns = np.empty(t.size)
    before, after = t < times[0], t > times[-1]
    inside = ~(before | after)
    turns[inside] = PchipInterpolator(times, pulses)(t[inside])
    turns[before] = (t[before] - times[0]) * (pulses[1] - pulses[0]) / (times[1] - times[0])
    turns[after] = pulses[-1] + (t[after] - times[-1]) * (pulses[-1] - pulses[-2]) / (times[-1] - times[-2])
    return turns


def to_angle(x: ArrayLike, turns: ArrayLike, samples_per_turn: int) -> Array:
    """Resample records at equal increments of shaft angle, without aliasing.

    Where the shaft turns slowly, samples at equal angles lie far apart in time, and high frequencies would alias. The
    angle is therefore first sampled as finely as the slowest part of the record requires, then filtered (linear phase,
    no delay) and decimated: orders below samples_per_turn / 2 remain at any speed.

    Parameters
    ----------
    x : array_like [..., samples]
        At least 8 samples at equal times.
    turns : array_like [samples] or [..., samples]
        Shaft angle at each sample, in turns, strictly increasing.
    samples_per_turn : int
        Twice the highest order wanted, plus a tenth for the filter's transition band.

    Returns
    -------
    Array [..., angles]
        From the first sample on; all records have the length of the one with the fewest turns. Where the filter is
        needed, up to 64 samples at either end are affected by the record's edges.

    Raises
    ------
    TwingapError
        For NaN, infinities, an angle that does not increase, inconsistent shapes, or less than one turn.
    """
    where = "to_angle"
    signals, angle = as_signals(x, where=where, at_least=8), as_signals(turns, where=where, at_least=8)
    per_turn = whole(samples_per_turn, "samples_per_turn", where=where, at_least=2)
    samples = signals.shape[-1]
    if angle.shape[-1] != samples or angle.shape not in ((samples,), signals.shape):
        raise TwingapError(
            f"turns of shape {angle.shape} for signals of shape {signals.shape}",
            where=where,
            mend="give the angle of each sample, for one record or for all",
        )
    steps = np.diff(angle, axis=-1)
    if steps.min() <= 0:
        raise TwingapError("turns do not increase", where=where, mend="cut out where the shaft stands")
    span = float((angle[..., -1] - angle[..., 0]).min())
    if span < 1:
        raise TwingapError(f"records span {span:g} turns, at least 1 expected", where=where)
    # An angle step is at most one sampling step, even at the lowest speed.
    finer = max(1, math.ceil(1 / (per_turn * float(steps.min())) - 1e-9))
    count = math.floor(span * per_turn * (1 + 1e-12)) + 1
    rows = signals.reshape(-1, samples)
    angles = np.broadcast_to(angle, signals.shape).reshape(-1, samples)
    places = np.arange((count - 1) * finer + 1) / (per_turn * finer)
    taps = sps.firwin(2 * _HALF_LENGTH * finer + 1, min(0.96 / finer, 0.99), window=("kaiser", 8.0))
    out = np.empty((rows.shape[0], count))
    for row, own, result in zip(rows, angles, out, strict=True):
        when = CubicSpline(own - own[0], np.arange(samples))(places)
        # Mirrored, a record is periodic without a jump, so that zero-padding its spectrum interpolates it.
        dense = sps.resample(np.concatenate((row, row[::-1])), 2 * samples * _FINER)[: (samples - 1) * _FINER + 1]
        fine = CubicSpline(np.arange(dense.size) / _FINER, dense)(np.clip(when, 0, samples - 1))
        if finer > 1:
            fine = sps.resample_poly(fine, 1, finer, window=taps, padtype="line")  # type: ignore[call-overload]
        result[:] = fine[:count]
    return out.reshape(*signals.shape[:-1], count)


def order_spectrum(x: ArrayLike, turns: ArrayLike, samples_per_turn: int, *, window: str = "hann") -> Spectrum:
    """Amplitude spectrum over orders.

    Parameters
    ----------
    x, turns, samples_per_turn
        As `to_angle`.
    window : str
        As `amplitude_spectrum`.

    Returns
    -------
    Spectrum
        Orders (multiples of shaft speed); peak amplitude in the unit of x. Records are cut to whole turns, so that
        shaft harmonics lie on bins.

    Raises
    ------
    TwingapError
        As `to_angle`.
    """
    angular = to_angle(x, turns, samples_per_turn)
    whole_turns = angular.shape[-1] // samples_per_turn * samples_per_turn
    return amplitude_spectrum(angular[..., :whole_turns], samples_per_turn, window=window)


def synchronous_average(x: ArrayLike, samples_per_period: int) -> Array:
    """Synchronous average: mean over periods; components not tied to the shaft fall as 1/sqrt(periods).

    Parameters
    ----------
    x : array_like [..., angles]
        Sampled at equal shaft angles (`to_angle`); at least one period. An incomplete last period is left out.
    samples_per_period : int
        Samples per turn, or per several turns for components with a longer period.

    Returns
    -------
    Array [..., samples_per_period]

    Raises
    ------
    TwingapError
        For NaN, infinities, or less than a period.
    """
    period = whole(samples_per_period, "samples_per_period", where="synchronous_average")
    signals = as_signals(x, where="synchronous_average", at_least=period)
    periods = signals.shape[-1] // period
    mean: Array = signals[..., : periods * period].reshape(*signals.shape[:-1], periods, period).mean(axis=-2)
    return mean


def without_average(x: ArrayLike, samples_per_period: int) -> Array:
    """Residual of a signal over angle after subtraction of its synchronous average: bearing signal and noise.

    Parameters
    ----------
    x, samples_per_period
        As `synchronous_average`.

    Returns
    -------
    Array [..., angles]

    Raises
    ------
    TwingapError
        As `synchronous_average`.
    """
    mean = synchronous_average(x, samples_per_period)
    signals = np.asarray(x, dtype=np.float64)
    return signals - mean[..., np.arange(signals.shape[-1]) % samples_per_period]
