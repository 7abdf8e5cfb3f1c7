"""What an analyst reads of a window: lines of the envelope where the bearing puts them, and how impulsive it is.

windows --> as they are | whitened | flattened | flattened, most impulsive band
              each --> squared-envelope spectrum over shaft orders --> ln(line over median) at shaft, cage, fault orders
        --> logarithms of kurtosis

The numbers keep their meaning on any machine whose geometry and speed are known: no frequency in Hz, no amplitude and
no resonance is in them, which is what simulated and measured records differ in most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
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
TOLERANCE: Final = 0.012
"""Half width of the search around a line, as a part of its order: bearings slip by a per cent."""
NARROWEST: Final = 0.6
"""The same in bins, for short windows."""
FLATTENED_BINS: Final = 33
"""Width of the running median that flattens a spectrum: wider than a line, narrower than a resonance."""
DEEPEST_LEVEL: Final = 4
"""Of the kurtogram: sixteen bands."""
SHORTEST_BAND: Final = 7
"""A window of 2^n samples is cut into no more than 2^(n - 7) bands."""
SPECTRA: Final = ("whole", "whitened", "flattened", "impulsive")
_FLOOR: Final = 1e-3


def places(bearing: Bearing) -> dict[str, float]:
    """Names and shaft orders of the lines that are read.

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
    """Of the columns of `order_features`."""
    lines = (*places(bearing), "highest", "spread", "order of the highest")
    return (
        *(f"{spectrum}: {line}" for spectrum in SPECTRA for line in lines),
        *(f"kurtosis: {s}" for s in SPECTRA[:3]),
    )


def order_features(windows: Windows, bearing: Bearing) -> Array:
    """What `names` lists, of each window.

    Parameters
    ----------
    windows : Windows
        Labels are not read.
    bearing : Bearing

    Returns
    -------
    Array [windows, features]
        Finite; lines beyond the envelope's range or `HIGHEST_ORDER` read 0.
    """
    whole = waveform(windows)
    shown = {"whole": whole, "whitened": prewhitened(whole), "flattened": flattened(whole)}
    lines = places(bearing)

    def read(x: Array) -> Reader:
        return lambda at, fs_hz, turn_hz: _lines(x[at], fs_hz, turn_hz, lines)

    parts = [_by_speed(windows, read(x)) for x in shown.values()]

    def impulsive(at: NDArray[np.int64], fs_hz: float, turn_hz: float) -> Array:
        return _impulsive(shown["flattened"][at], fs_hz, turn_hz, bearing, lines)

    parts.append(_by_speed(windows, impulsive))
    return np.hstack([*parts, np.stack([_log_kurtosis(x) for x in shown.values()], axis=1)])


def flattened(x: Array) -> Array:
    """Divide by the running median of the amplitude spectrum: resonances go, lines stay [signals, samples]."""
    transform = np.fft.rfft(x, axis=1)
    level = median_filter(np.log(np.abs(transform) ** 2 + 1e-20), size=(1, FLATTENED_BINS), mode="nearest")
    return np.asarray(np.fft.irfft(transform / np.exp(level / 2), x.shape[1], axis=1))


Reader = Callable[[NDArray[np.int64], float, float], Array]


def _by_speed(windows: Windows, read: Reader) -> Array:
    """Rows of windows of one rate and speed are read together."""
    rows: Array | None = None
    for at, fs_hz, turn_hz in _alike(windows):
        found = read(at, fs_hz, turn_hz)
        rows = np.empty((len(windows), found.shape[1])) if rows is None else rows
        rows[at] = found
    return np.empty((0, 0)) if rows is None else rows


def _alike(windows: Windows) -> Iterator[tuple[NDArray[np.int64], float, float]]:
    pairs = np.stack([windows.fs_hz, windows.speed_rpm], axis=1)
    found, which = np.unique(pairs, axis=0, return_inverse=True)
    for number, (fs_hz, speed_rpm) in enumerate(found):
        yield np.flatnonzero(which.ravel() == number), float(fs_hz), float(speed_rpm) / 60


def _lines(
    x: Array, fs_hz: float, turn_hz: float, lines: dict[str, float], band_hz: tuple[float, float] | None = None
) -> Array:
    """ln(line over median) of each place, and of the highest line anywhere [signals, places + 3]."""
    hz, values = squared_envelope_spectrum(x, fs_hz, band_hz, window="hann")
    order = hz / turn_hz
    kept = (order > LOWEST_ORDER) & (order < HIGHEST_ORDER)
    order, values = order[kept], values[:, kept]
    if order.size < 2:
        return np.zeros((len(x), len(lines) + 3))
    level = np.log(values / np.maximum(np.median(values, axis=1, keepdims=True), 1e-300) + _FLOOR)
    found = np.zeros((len(x), len(lines)))
    for column, line in enumerate(lines.values()):
        reach = max(TOLERANCE * line, NARROWEST * (order[1] - order[0]))
        low, high = np.searchsorted(order, (line - reach, line + reach))
        if high > low:
            found[:, column] = level[:, low:high].max(axis=1)
    highest = level.argmax(axis=1)
    return np.column_stack([found, level.max(axis=1), level.std(axis=1), order[highest]])


def _impulsive(x: Array, fs_hz: float, turn_hz: float, bearing: Bearing, lines: dict[str, float]) -> Array:
    """Each signal in the band of its kurtogram that is most impulsive, wide enough for three harmonics of a fault."""
    widest = fs_hz / 2 / (3 * turn_hz * max(bearing.fault_order(f) for f in ("outer", "inner", "ball")))
    deepest = min(DEEPEST_LEVEL, math.floor(math.log2(x.shape[1])) - SHORTEST_BAND)
    level = max(1, min(math.floor(math.log2(max(widest, 2.0))), deepest))
    bands = most_impulsive_band(x, fs_hz, max_level=level)
    rows = [
        _lines(row[None], fs_hz, turn_hz, lines, (band.low_hz, band.high_hz))
        for row, band in zip(x, bands, strict=True)
    ]
    return np.concatenate(rows)


def _log_kurtosis(x: Array) -> Array:
    centred = x - x.mean(axis=1, keepdims=True)
    return np.asarray(np.log(np.mean(centred**4, axis=1) / np.maximum(np.mean(centred**2, axis=1) ** 2, 1e-300)))
