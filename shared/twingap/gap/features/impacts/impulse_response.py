"""Spectrum of the impacts in a record: power around the harmonics of the impact rate, compared between two sets.

record --power around each harmonic of the impact rate, less the noise beneath--> ImpactSpectrum
sets of ImpactSpectrum, measured and simulated --> ratio over frequency, and its relation to the ratio of the noise

Regular impacts are lines, which robust noise spectra leave out. A window one impact rate wide holds one line with its
sidebands, wherever slip has smeared them. What changes the path (another mode, a roll-off) changes this spectrum and
that of the structure's noise alike; added noise leaves it as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twingap.gap.features.tones.tones import lines_of
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, once_a_record

PLACES: Final = 64
"""Equal bands between 0 and half the sampling rate."""
BANDS: Final = 16
"""Bands whose ratios are features."""
MOST_HARMONICS: Final = 400
"""Harmonics that are measured; more cost time and are lost in noise."""
_SHOWN: Final = 4.0
"""Peaks on a comb, beyond chance, from which the impact rate is taken from the lines rather than from geometry."""
_CLEAR: Final = 6.0
"""Standard deviations above the noise from which a harmonic counts in full."""

NAMES: Final = ("power_log", "clear", "centroid_log", "high_log")
"""Keys of `measure`."""

COMPARED: Final[tuple[str, ...]] = (
    *(f"band_{i:02d}" for i in range(BANDS)),
    "level", "rms", "common", "slope", "high", "low",
    "bump", "bump_fs", "bump_noise", "dip", "dip_fs", "dip_noise",
    "noise_bump", "noise_bump_fs", "noise_bump_impacts", "noise_dip", "noise_dip_fs", "noise_dip_impacts",
    "known",
)  # fmt: skip
"""Keys of `compare`."""


class ImpactSpectrum(NamedTuple):
    """Spectrum of the impacts in a record."""

    fault: str
    power: Array  # [harmonics] around each harmonic less the noise beneath, over scale^2; may be negative by chance
    error: Array  # [harmonics] standard error of each
    places: NDArray[np.int64]  # [harmonics] band of each
    density: Array  # [PLACES] mean power density, noise included, over scale^2 and times the sampling rate


def measure(record: RecordTransforms) -> dict[str, float]:
    """`NAMES` -> value of the impacts' spectrum in one record.

    `power_log` log10 of its RMS over scale, `clear` part of its harmonics that stand out of the noise, `centroid_log`
    log10 of their centre as a part of the sampling rate, `high_log` log10 of the power above a quarter of the sampling
    rate over that below.
    """
    out = dict.fromkeys(NAMES, math.nan)
    found = impact_spectrum(record)
    if found is None:
        return out
    weight = standing_out(found.power, found.error)
    power = weight * found.power
    total = float(power.sum())
    out["clear"] = float(weight.mean())
    out["power_log"] = 0.5 * math.log10(max(float(found.power.sum()), 0.0) + 1e-4)
    if weight.sum() >= 3:
        f = (found.places + 0.5) / (2 * PLACES)
        out["centroid_log"] = math.log10(float((power * f).sum()) / max(total, 1e-300) + 1e-6)
        upper = float(power[f > 0.25].sum())
        out["high_log"] = math.log10((upper + 1e-4 * total) / (total - upper + 1e-4 * total + 1e-300))
    return out


@once_a_record
def impact_spectrum(record: RecordTransforms) -> ImpactSpectrum | None:
    """Spectrum of the impacts, computed once a record; None without a known fault, or where the record is too short."""
    if record.fault_order is None or not record.mean_square > 0:
        return None
    lines = lines_of(record)
    power = (record.transform.real**2 + record.transform.imag**2) * (2 / (record.fs_hz * record.x.size))
    power *= record.fs_hz / max(record.frame.scale, 1e-300) ** 2
    df_hz = record.fs_hz / record.x.size
    smooth = record.smooth * (record.fs_hz / max(record.frame.scale, 1e-300) ** 2)
    smooth_at = np.minimum((np.arange(power.size) * smooth.size) // max(power.size - 1, 1), smooth.size - 1)
    # Tones that are not the fault's do not come from impacts.
    own = lines.peaks.of(~lines.fault_comb[2])
    for place in np.rint(own.hz / df_hz).astype(int):
        low, high = max(place - 2, 0), min(place + 3, power.size)
        power[low:high] = np.minimum(power[low:high], smooth[smooth_at[low:high]])
    rate_hz = impact_rate_hz(record)
    width = rate_hz / df_hz
    count = min(int((power.size - 1) / width - 0.5), MOST_HARMONICS)
    if count < 6 or width < 3:
        return None
    edges = (np.arange(1, count + 2) - 0.5) * width
    at = np.arange(power.size + 1)
    total = np.concatenate(([0.0], np.cumsum(power)))
    beneath = np.concatenate(([0.0], np.cumsum(smooth[smooth_at])))
    mean, floor = (np.diff(np.interp(edges, at, summed)) / width for summed in (total, beneath))
    unit = rate_hz / record.fs_hz
    above, error = (mean - floor) * unit, floor / math.sqrt(width) * unit
    centre = np.arange(1, count + 1) * rate_hz
    places = np.minimum((centre / (record.fs_hz / 2) * PLACES).astype(int), PLACES - 1)
    # Around any frequency, one impact rate or one band, whichever is wider.
    half = 0.5 * max(width, power.size / PLACES)
    middle = (np.arange(PLACES) + 0.5) * (power.size / PLACES)
    ends = [np.clip(middle + side * half, 0, power.size) for side in (-1, 1)]
    sums = [np.interp(end, at, total) for end in ends]
    density = (sums[1] - sums[0]) / np.maximum(ends[1] - ends[0], 1.0)
    return ImpactSpectrum(str(record.condition.fault), above, error, places, density)


def impact_rate_hz(record: RecordTransforms) -> float:
    """Impacts per second of a record with a known fault: from its lines where they show it, else from the geometry."""
    if record.fault_order is None:
        raise ValueError("a record without a fault has no impact rate")
    # Slip of the cage moves the hundredth harmonic by more than a spacing, so lines are preferred to geometry.
    # Unrelated tones reach about three peaks beyond chance on some comb.
    ratio, beyond, _ = lines_of(record).fault_comb
    return float(record.fault_order * record.shaft_hz * (ratio if beyond >= _SHOWN else 1.0))


def standing_out(power: Array, error: Array, clear: float = _CLEAR) -> Array:
    """Weights 0 to 1 of power over noise; 1 from about `clear` standard deviations on."""
    return np.asarray(np.clip((power / np.maximum(error, 1e-300) - 1.5) / clear, 0.0, 1.0))


def compare(
    real: Sequence[ImpactSpectrum], simulated: Sequence[ImpactSpectrum], noise: Array | None
) -> dict[str, float]:
    """`COMPARED` -> value of the ratio of measured to simulated impact spectra; NaN where it is not known.

    Ratios are log10, frequencies parts of the sampling rate. `noise` [PLACES] is ln of the measured over the simulated
    spectrum of healthy records.
    """
    out = dict.fromkeys(COMPARED, math.nan)
    faults = sorted({s.fault for s in real} & {s.fault for s in simulated})
    if not faults:
        return out
    ratio, weight = _over_places(real, simulated, faults)
    out["known"] = float((weight > 0.3).mean())
    if weight.sum() >= 3:
        _over_frequency(ratio, weight, noise, out)
    return out


def _over_places(
    real: Sequence[ImpactSpectrum], simulated: Sequence[ImpactSpectrum], faults: Iterable[str]
) -> tuple[Array, Array]:
    """[PLACES] Mean log10 ratio, and how well it is known (0 to 1)."""
    total, known = np.zeros(PLACES), np.zeros(PLACES)
    for fault in faults:
        means, weights = [], []
        for own in (real, simulated):
            kept = [s for s in own if s.fault == fault]
            places = np.concatenate([s.places for s in kept])
            count = np.maximum(np.bincount(places, minlength=PLACES), 1)
            # Power is averaged over records before it is compared with noise: weak impacts show in many records.
            power = np.bincount(places, np.concatenate([s.power for s in kept]), PLACES) / count
            error = np.sqrt(np.bincount(places, np.concatenate([s.error for s in kept]) ** 2, PLACES)) / count
            means.append(np.log10(np.maximum(power, 1e-12)))
            weights.append(standing_out(power, error))
        weight = np.minimum(*weights)
        total += weight * (means[0] - means[1])
        known += weight
    return total / np.maximum(known, 1e-9), np.minimum(known, 1.0)


def _over_frequency(ratio: Array, weight: Array, noise: Array | None, out: dict[str, float]) -> None:
    f = (np.arange(PLACES) + 0.5) / (2 * PLACES)
    weight = np.where(weight > 0.15, weight, 0.0)
    if np.count_nonzero(weight) < 4:
        return
    level = float(np.average(ratio, weights=weight))
    about = ratio - level
    out["level"] = level
    out["rms"] = math.log10(math.sqrt(float(np.average(about**2, weights=weight))) + 1e-3)
    per = PLACES // BANDS
    for i in range(BANDS):
        part = slice(i * per, (i + 1) * per)
        if weight[part].sum() > 0.5:
            out[f"band_{i:02d}"] = float(np.average(about[part], weights=weight[part]))
    x = np.log10(f) - np.average(np.log10(f), weights=weight)
    out["slope"] = float(np.average(about * x, weights=weight) / max(np.average(x**2, weights=weight), 1e-9))
    middle = float(np.average(f, weights=weight))
    for name, side in (("high", f > middle), ("low", f <= middle)):
        if weight[side].sum() > 1:
            out[name] = float(np.average(about[side], weights=weight[side]))
    # Three bands together: one alone may be a matter of where a line falls.
    kernel = np.array([0.5, 1.0, 0.5])
    wide = np.convolve(weight, kernel, "same")
    soft = np.convolve(weight * about, kernel, "same") / np.maximum(wide, 1e-9)
    allowed = (weight > 0) & (wide > 0.6)
    if not allowed.any():
        return
    other = None
    if noise is not None:
        other = noise / math.log(10)
        other = other - float(np.average(other, weights=weight))
        spread = float(np.average(other**2, weights=weight))
        out["common"] = float(np.average(about * other, weights=weight)) / (
            math.sqrt(spread * float(np.average(about**2, weights=weight))) + 4e-4
        )
        smooth = np.convolve(np.pad(other, 1, mode="edge"), kernel / kernel.sum(), "valid")
    for name, sign in (("bump", 1), ("dip", -1)):
        place = int(np.argmax(np.where(allowed, sign * soft, -np.inf)))
        out[name], out[f"{name}_fs"] = float(sign * soft[place]), float(f[place])
        if other is None:
            continue
        out[f"{name}_noise"] = float(sign * smooth[place])
        place = int(np.argmax(np.where(allowed, sign * smooth, -np.inf)))
        out[f"noise_{name}"], out[f"noise_{name}_fs"] = float(sign * smooth[place]), float(f[place])
        out[f"noise_{name}_impacts"] = float(sign * soft[place])
