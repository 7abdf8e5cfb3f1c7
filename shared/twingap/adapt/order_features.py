"""Features of a window at the bearing's orders: lines of envelope spectra, and kurtosis.

windows --> unfiltered | prewhitened | flattened | flattened, most impulsive band
              each --> squared-envelope spectrum over shaft orders --> ln(line over median) at shaft, cage, fault orders
        --> logarithms of kurtosis

The features depend on samples per turn and on the bearing's orders, not on frequencies in Hz, amplitudes or
resonances. They are therefore comparable between all machines whose geometry and speed are known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from twingap.adapt.views import prewhitened, waveform
from twingap.adapt.windows import Windows
from twingap.bearing import Bearing
from twingap.signal.envelope import most_impulsive_band, squared_envelope_spectrum

Array = NDArray[np.float64]

LOWEST_ORDER: Final = 0.3
HIGHEST_ORDER: Final = 20.0
"""Range of the envelope spectrum, shaft orders. A wider range raises the highest line of noise."""
TOLERANCE: Final = 0.012
"""Half width of the search around a line, relative to its order. Bearings slip by about 1 %; a wider search finds
higher maxima in noise."""
NARROWEST: Final = 0.6
"""Smallest half width of the search, bins; it applies to windows of few turns."""
FLATTENED_BINS: Final = 33
"""Width of the running median that flattens a spectrum: wider than a line, narrower than a resonance."""
DEEPEST_LEVEL: Final = 4
"""Deepest level of the kurtogram (16 bands). Deeper levels find narrower bands, with fewer samples each."""
SHORTEST_BAND: Final = 7
"""A window of 2^n samples is cut into no more than 2^(n - 7) bands."""
SPECTRA: Final = ("unfiltered", "whitened", "flattened", "impulsive")
_FLOOR: Final = 1e-3
"""Added to the ratio of line and median before its logarithm; larger makes weak lines less distinct."""


def line_orders(bearing: Bearing) -> dict[str, float]:
    """Names and shaft orders of the lines.

    Parameters
    ----------
    bearing : Bearing

    Returns
    -------
    dict[str, float]
        Three harmonics of the shaft and of each fault, two of the cage, and sidebands: at shaft rate about the inner
        race (and the outer, which has none in theory), at cage rate about all.
    """
    outer, inner, ball, cage = (bearing.fault_order(f) for f in ("outer", "inner", "ball", "cage"))
    found = {f"shaft {k}": float(k) for k in (1, 2, 3)} | {f"cage {k}": k * cage for k in (1, 2)}
    for name, order in (("outer", outer), ("inner", inner), ("ball", ball)):
        found |= {f"{name} {k}": k * order for k in (1, 2, 3)}
    for name, order, aside in (
        ("inner", inner, 1.0), ("twice inner", 2 * inner, 1.0), ("outer", outer, 1.0),
        ("ball", ball, cage), ("outer", outer, cage), ("inner", inner, cage),
    ):  # fmt: skip
        rate = "shaft" if aside == 1.0 else "cage"
        found |= {f"{name} - {rate}": order - aside, f"{name} + {rate}": order + aside}
    return found


def names(bearing: Bearing) -> tuple[str, ...]:
    """Names of the columns of `order_features`; the same for every bearing."""
    lines = (*line_orders(bearing), "highest", "spread", "order of the highest")
    return (
        *(f"{spectrum}: {line}" for spectrum in SPECTRA for line in lines),
        *(f"kurtosis: {s}" for s in SPECTRA[:3]),
    )


def order_features(windows: Windows, bearing: Bearing) -> Array:
    """Features of each window, in the order of `names`.

    Parameters
    ----------
    windows : Windows
        Labels are not used.
    bearing : Bearing

    Returns
    -------
    Array [windows, features]
        Finite. Lines beyond the envelope's range or `HIGHEST_ORDER` are 0.
    """
    return np.asarray(order_features_at(windows, windows.speed_rpm[None], bearing)[0])


def order_features_at(windows: Windows, speeds_rpm: Array, bearing: Bearing) -> Array:
    """Features of each window at several candidates of its speed; spectra are computed once.

    Parameters
    ----------
    windows : Windows
        Labels and speeds are not used.
    speeds_rpm : Array [candidates, windows]
        The first candidate determines the width of the most impulsive band.
    bearing : Bearing

    Returns
    -------
    Array [candidates, windows, features]
    """
    unfiltered = waveform(windows)
    signals = {"unfiltered": unfiltered, "whitened": prewhitened(unfiltered), "flattened": flattened(unfiltered)}
    per_turn = windows.fs_hz * 60 / speeds_rpm
    spectra = [_envelope_spectra(x) for x in signals.values()]
    spectra.append(_impulsive_spectra(signals["flattened"], per_turn[0], bearing))
    kurtosis = np.stack([_log_kurtosis(x) for x in signals.values()], axis=1)
    orders = np.array(list(line_orders(bearing).values()))
    cycles: Array = np.asarray(np.fft.rfftfreq(unfiltered.shape[1]), float)
    return np.stack([np.hstack([*(_lines(one, cycles, p, orders) for one in spectra), kurtosis]) for p in per_turn])


def flattened(x: Array) -> Array:
    """Signals divided by the running median of their amplitude spectrum, which keeps lines [signals, samples]."""
    transform = np.fft.rfft(x, axis=1)
    power = np.log(np.abs(transform) ** 2 + 1e-20)
    # Row by row: SciPy has a fast median filter for one dimension only.
    level = np.stack([median_filter(row, size=FLATTENED_BINS, mode="nearest") for row in power])
    return np.asarray(np.fft.irfft(transform / np.exp(level / 2), x.shape[1], axis=1))


def _envelope_spectra(x: Array, band: tuple[float, float] | None = None) -> Array:
    """Squared-envelope spectra over cycles per sample [signals, bins]; `band` in cycles per sample."""
    return squared_envelope_spectrum(x, 1.0, band, window="hann").values


def _impulsive_spectra(x: Array, samples_per_turn: Array, bearing: Bearing) -> Array:
    """Squared-envelope spectra in the most impulsive band with three harmonics of every fault [signals, bins]."""
    fastest = max(bearing.fault_order(f) for f in ("outer", "inner", "ball"))
    deepest = max(1, min(DEEPEST_LEVEL, math.floor(math.log2(x.shape[1])) - SHORTEST_BAND))
    widest = np.maximum(samples_per_turn / (6 * fastest), 2.0)
    levels = np.clip(np.floor(np.log2(widest)).astype(int), 1, deepest)
    spectra = np.empty((len(x), x.shape[1] // 2 + 1))
    for level in np.unique(levels):
        at = np.flatnonzero(levels == level)
        for row, band in zip(at, most_impulsive_band(x[at], 1.0, max_level=int(level)), strict=True):
            spectra[row] = _envelope_spectra(x[row], (band.low_hz, band.high_hz))
    return spectra


def _lines(spectra: Array, cycles: Array, samples_per_turn: Array, orders: Array) -> Array:
    """ln(line over median) at each order and of the highest line, spread, and order of the highest line.

    Parameters
    ----------
    spectra : Array [signals, bins]
    cycles : Array [bins]
        Frequency in cycles per sample.
    samples_per_turn : Array [signals]
    orders : Array [lines]

    Returns
    -------
    Array [signals, lines + 3]
    """
    out = np.zeros((len(spectra), orders.size + 3))
    for per_turn, at in _alike(samples_per_turn):
        order = cycles * per_turn
        kept = (order > LOWEST_ORDER) & (order < HIGHEST_ORDER)
        order = order[kept]
        if order.size < 2:
            continue
        values = spectra[np.ix_(at, kept)]
        level = np.log(values / np.maximum(np.median(values, axis=1, keepdims=True), 1e-300) + _FLOOR)
        for column, line in enumerate(orders):
            reach = max(TOLERANCE * line, NARROWEST * (order[1] - order[0]))
            low, high = np.searchsorted(order, (line - reach, line + reach))
            if high > low:
                out[at, column] = level[:, low:high].max(axis=1)
        highest = level.argmax(axis=1)
        out[at, orders.size :] = np.column_stack([level.max(axis=1), level.std(axis=1), order[highest]])
    return out


def _alike(samples_per_turn: Array) -> Iterator[tuple[float, NDArray[np.int64]]]:
    for per_turn in np.unique(samples_per_turn):
        yield float(per_turn), np.flatnonzero(samples_per_turn == per_turn)


def _log_kurtosis(x: Array) -> Array:
    centred = x - x.mean(axis=1, keepdims=True)
    return np.asarray(np.log(np.mean(centred**4, axis=1) / np.maximum(np.mean(centred**2, axis=1) ** 2, 1e-300)))
