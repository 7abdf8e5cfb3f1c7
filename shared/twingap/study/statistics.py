"""Plain summary statistics of records: the input of the rival methods.

record --moments, quantiles, band powers, lines at shaft and fault orders--> [statistics]
measured and simulated sets --means, spreads, slopes over speed and time--> one vector per world

They share no code with the signatures of the diagnosis, to which the rivals are compared.
"""

from __future__ import annotations

import warnings
from functools import cache
from typing import Final

import numpy as np
from scipy import signal
from scipy.stats import kurtosis, skew

from twingap.bearing import Bearing
from twingap.records import Array, Record, RecordSet

BANDS: Final = 16
"""Bands of equal width whose power is a statistic each."""
QUANTILES: Final = (0.1, 0.5, 0.9, 0.99, 0.999)
SHAFT_ORDERS: Final = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
_FAULT_OF_HEALTHY: Final = "outer"
"""Fault whose order is used for a record without a fault."""


@cache
def names() -> tuple[str, ...]:
    """Names of the statistics of one record."""
    return (
        "log_rms", "kurtosis", "skewness", "crest_factor",
        *(f"quantile_{q:g}" for q in QUANTILES),
        "repeats", "at_extremes", "levels", "log_rms_spread", "kurtosis_spread",
        *(f"band_{i}" for i in range(BANDS)),
        "spectral_slope", "spectral_flatness", "spectral_centroid",
        *(f"order_{o:g}" for o in SHAFT_ORDERS),
        "integer_orders_6_to_80", "line_50_hz", "line_60_hz", "strongest_line", "ball_pass_line",
        "envelope_fault_1", "envelope_fault_2", "envelope_fault_3", "envelope_decay", "envelope_shift",
        "envelope_width", "envelope_shaft", "envelope_cage", "envelope_shaft_sidebands", "envelope_cage_sidebands",
        "envelope_foreign", "envelope_floor",
    )  # fmt: skip


def of_record(record: Record, bearing: Bearing | None) -> Array:
    """[statistics] Statistics of one record, in the order of `names`; those at orders are NaN without a bearing."""
    condition = record.condition
    fs, shaft = condition.fs_hz, condition.speed_rpm / 60
    x = np.asarray(record.samples, float)
    x = x - x.mean()
    rms = max(float(np.sqrt(np.mean(x**2))), 1e-300)
    size = np.abs(x) / rms
    moving = float(np.ptp(x)) > 1e-9 * float(np.abs(record.samples).max())
    steps = np.diff(record.samples)
    parts = [p for p in np.array_split(x, 8) if p.size > 3]
    levels = np.array([np.sqrt(np.mean(p**2)) for p in parts]) / rms
    kurt = np.array([kurtosis(p) if p.std() > 1e-9 * rms else 0.0 for p in parts])
    out = [
        np.log(rms), np.log1p(max(float(kurtosis(x)), -0.99)) if moving else 0.0, float(skew(x)) if moving else 0.0,
        float(size.max()),
        *np.quantile(size, QUANTILES),
        float(np.mean(steps == 0)), float(np.mean(size > 0.999 * size.max())),
        np.log(np.unique(record.samples).size / x.size), float(np.std(np.log(levels + 1e-9))),
        float(np.log1p(kurt.std())),
    ]  # fmt: skip

    nperseg = int(min(x.size, 2048))
    f, psd = signal.welch(x, fs, nperseg=nperseg)
    bands = np.array([float(b.mean()) for b in np.array_split(psd[1:], BANDS)])
    shares = np.log(bands / max(float(bands.sum()), 1e-300) + 1e-12)
    inside = psd[1:] + max(1e-12 * float(psd.max()), 1e-300)
    slope = np.polyfit(np.log(f[1:]), np.log(inside), 1)[0]
    flat = float(np.mean(np.log(inside)) - np.log(np.mean(inside)))
    out += [*shares, float(slope), flat, float((f * psd).sum() / max(float(psd.sum()), 1e-300) / fs)]

    n = x.size
    power = np.abs(np.fft.rfft(x * np.hanning(n))) ** 2
    spectrum_lines = Lines(power, fs / n)
    out += [spectrum_lines.at(o * shaft) for o in SHAFT_ORDERS]
    orders = np.arange(6, 81)
    out.append(float(np.nanmax([spectrum_lines.at(o * shaft) for o in orders if o * shaft < 0.45 * fs], initial=0.0)))
    out += [spectrum_lines.at(50.0), spectrum_lines.at(60.0), spectrum_lines.strongest()]

    fault = condition.fault if condition.fault not in (None, "healthy") else _FAULT_OF_HEALTHY
    order = bearing.fault_order(str(fault)) if bearing is not None else np.nan
    cage = bearing.ftf if bearing is not None else np.nan
    out.append(spectrum_lines.at(bearing.bpfo * shaft) if bearing is not None else np.nan)
    analytic = signal.hilbert(signal.sosfiltfilt(_high_pass(fs), x)) if n > 64 else x.astype(complex)
    envelope = np.abs(analytic) ** 2
    envelope = envelope / max(float(envelope.mean()), 1e-300) - 1
    spectrum = np.abs(np.fft.rfft(envelope * np.hanning(n))) ** 2
    envelope_lines = Lines(spectrum, fs / n)
    at = [envelope_lines.at(k * order * shaft, 0.03) for k in (1, 2, 3)]
    peak_hz, width = envelope_lines.peak(order * shaft, 0.05)
    out += [
        *at, at[2] - at[0], peak_hz / (order * shaft) - 1 if bearing is not None else np.nan, width,
        envelope_lines.at(shaft), envelope_lines.at(cage * shaft),
        envelope_lines.at((order - 1) * shaft, 0.01) + envelope_lines.at((order + 1) * shaft, 0.01),
        envelope_lines.at((order - cage) * shaft, 0.01) + envelope_lines.at((order + cage) * shaft, 0.01),
        envelope_lines.strongest(), float(np.log(np.median(spectrum[1 : max(n // 20, 2)]) + 1e-300)),
    ]  # fmt: skip
    return np.asarray(out, float)


class Lines:
    """Heights of spectral lines over the local median of a periodogram [bins]."""

    def __init__(self, power: Array, df_hz: float) -> None:
        self.power, self.df_hz = power, df_hz

    def at(self, frequency_hz: float, tolerance: float = 0.005) -> float:
        """Log of the largest power near a frequency over the median around it; NaN outside the spectrum."""
        if not np.isfinite(frequency_hz) or frequency_hz <= 0:
            return float("nan")
        place, half = frequency_hz / self.df_hz, max(2, round(tolerance * frequency_hz / self.df_hz))
        if not half < place < self.power.size - half - 1:
            return float("nan")
        own, around = round(place), 4 * half + 10
        near = self.power[max(own - around, 1) : own + around + 1]
        return float(np.log((self.power[own - half : own + half + 1].max() + 1e-300) / (np.median(near) + 1e-300)))

    def peak(self, frequency_hz: float, tolerance: float) -> tuple[float, float]:
        """Frequency of the largest power near a frequency, Hz, and the log of its share of the power in three bins."""
        place = frequency_hz / self.df_hz
        half = max(3, round(tolerance * place)) if np.isfinite(place) else 0
        if not half < place < self.power.size - half - 1:
            return float("nan"), float("nan")
        near = self.power[round(place) - half : round(place) + half + 1]
        top = int(near.argmax())
        share = near[max(top - 1, 0) : top + 2].sum() / max(float(near.sum()), 1e-300)
        return (round(place) - half + top) * self.df_hz, float(np.log(share + 1e-12))

    def strongest(self) -> float:
        """Log of the power of the strongest line over the median of its eighth of the spectrum."""
        parts = [p for p in np.array_split(self.power[2:], 8) if p.size]
        return float(max(np.log((p.max() + 1e-300) / (np.median(p) + 1e-300)) for p in parts))


def table(records: RecordSet) -> Array:
    """[records, statistics] Statistics of all records of a set."""
    return np.array([of_record(record, records.bearing) for record in records])


def of_world(real: RecordSet, simulated: RecordSet) -> Array:
    """[4 statistics] Difference between measured and simulated sets: mean, log spread, slopes over log speed and time.

    NaN where undefined; the methods that use it fill these in.
    """
    ours, theirs = table(real), table(simulated)
    return from_tables(ours, theirs, real, simulated)


def from_tables(ours: Array, theirs: Array, real: RecordSet, simulated: RecordSet) -> Array:
    """The same as `of_world`, from tables computed before."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # means of empty slices are NaN by intent
        means = np.nanmean(ours, axis=0) - np.nanmean(theirs, axis=0)
        spreads = np.log(np.nanstd(ours, axis=0) + 1e-3) - np.log(np.nanstd(theirs, axis=0) + 1e-3)
        slopes = [_slopes(ours, real, key) - _slopes(theirs, simulated, key) for key in ("speed_rpm", "time_s")]
    out = np.concatenate([means, spreads, *slopes])
    return np.where(np.isfinite(out), out, np.nan)


def world_names() -> tuple[str, ...]:
    """Names of the elements of `of_world`."""
    return tuple(f"{name}|{kind}" for kind in ("mean", "spread", "on_speed", "on_time") for name in names())


def _slopes(values: Array, records: RecordSet, key: str) -> Array:
    """[statistics] Correlation with log speed or time; NaN where that is constant."""
    x = np.array([np.nan if getattr(c, key) is None else getattr(c, key) for c in records.conditions], float)
    x = np.log(x) if key == "speed_rpm" else x
    x = x - x.mean()
    if not np.isfinite(x).all() or x.std() == 0:
        return np.full(values.shape[1], np.nan)
    own = values - np.nanmean(values, axis=0)
    return np.asarray(np.nanmean(own * x[:, None], axis=0) / (x.std() * (np.nanstd(values, axis=0) + 1e-3)))


@cache
def _high_pass(fs_hz: float) -> Array:
    """High-pass at a sixteenth of the sampling rate, above shaft and mains frequencies."""
    return np.asarray(signal.butter(4, fs_hz / 16, "highpass", fs=fs_hz, output="sos"))
