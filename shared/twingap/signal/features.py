"""Features of complete records, used as condition indicators.

Paper 2 uses "11 time-domain features including mean, standard deviation, and skewness" and "four features of spectrum
kurtosis such as mean, and skewness" without naming the others. The MathWorks example "Wind turbine high-speed bearing
prognosis" has exactly 11 + 4 with these among them, in wording and order; `PAPER2_FEATURES` are those. Two definitions
differ. The example's peak is max(x), which depends on the sensor's sign; here it is max |x|. The example's margin
factor max(x) / (mean |x|)^2 depends on the unit; here it is the usual clearance factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, without_mean
from twingap.signal.kurtosis import spectral_kurtosis

TIME_FEATURES: Final = (
    "mean", "std", "rms", "mean_abs", "peak", "peak_to_peak", "skewness", "kurtosis", "crest_factor", "shape_factor",
    "impulse_factor", "clearance_factor", "energy",
)  # fmt: skip
SPECTRAL_KURTOSIS_FEATURES: Final = ("sk_mean", "sk_std", "sk_skewness", "sk_kurtosis")
PAPER2_FEATURES: Final = (
    "mean", "std", "skewness", "kurtosis", "peak_to_peak", "rms", "crest_factor", "shape_factor", "impulse_factor",
    "clearance_factor", "energy", *SPECTRAL_KURTOSIS_FEATURES,
)  # fmt: skip


@dataclass(frozen=True)
class FeatureTable:
    """Features of records, by name.

    Parameters
    ----------
    names : tuple of str
        One per column.
    values : Array [..., features]
    """

    names: tuple[str, ...]
    values: Array

    def __getitem__(self, name: str) -> Array:
        """One feature of all records, `[...]`."""
        column: Array = self.values[..., self._place(name)]
        return column

    def select(self, names: tuple[str, ...]) -> FeatureTable:
        """The features of these names, in this order."""
        return FeatureTable(tuple(names), self.values[..., [self._place(name) for name in names]])

    def joined(self, other: FeatureTable) -> FeatureTable:
        """These features and then another table's, of the same records."""
        return FeatureTable(self.names + other.names, np.concatenate((self.values, other.values), axis=-1))

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise TwingapError(f"no feature {name!r}", where="features", mend=f"known: {', '.join(self.names)}")
        return self.names.index(name)


def time_features(x: ArrayLike) -> FeatureTable:
    """Time-domain features of each record.

    Parameters
    ----------
    x : array_like [..., samples]
        Unit u.

    Returns
    -------
    FeatureTable
        mean, std (divided by n), rms, mean_abs = mean |x|, peak = max |x|, peak_to_peak: u.
        skewness, kurtosis: standardised third and fourth moment (kurtosis is 3 for Gaussian noise, nothing subtracted).
        crest_factor = peak / rms, shape_factor = rms / mean_abs, impulse_factor = peak / mean_abs,
        clearance_factor (also: margin factor) = peak / (mean sqrt|x|)^2: dimensionless.
        energy: sum of x^2, u^2.
        Where a denominator is 0 (a signal of zeros; the moments of a constant), the feature is 0.

    Raises
    ------
    TwingapError
        For NaN, infinities or no samples.
    """
    signals = as_signals(x, where="time_features")
    size, centred = np.abs(signals), without_mean(signals)
    std = _rms(centred)
    standard = _over(centred, std[..., None])
    rms, mean_abs, peak = _rms(signals), size.mean(axis=-1), size.max(axis=-1)
    columns = {
        "mean": signals.mean(axis=-1),
        "std": std,
        "rms": rms,
        "mean_abs": mean_abs,
        "peak": peak,
        "peak_to_peak": np.ptp(signals, axis=-1),
        "skewness": (standard**3).mean(axis=-1),
        "kurtosis": (standard**4).mean(axis=-1),
        "crest_factor": _over(peak, rms),
        "shape_factor": _over(rms, mean_abs),
        "impulse_factor": _over(peak, mean_abs),
        "clearance_factor": _over(peak, np.sqrt(size).mean(axis=-1) ** 2),
        "energy": (signals**2).sum(axis=-1),
    }
    return FeatureTable(TIME_FEATURES, np.stack([columns[name] for name in TIME_FEATURES], axis=-1))


def spectral_kurtosis_features(
    x: ArrayLike, fs_hz: float, *, window_samples: int = 128, overlap: float = 0.75
) -> FeatureTable:
    """Mean, standard deviation, skewness and kurtosis of the spectral kurtosis over frequency.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float
        Sampling rate, Hz.
    window_samples, overlap : int, float
        As `spectral_kurtosis`.

    Returns
    -------
    FeatureTable
        sk_mean, sk_std, sk_skewness, sk_kurtosis (nothing subtracted); dimensionless.

    Raises
    ------
    TwingapError
        As `spectral_kurtosis`.
    """
    sk = spectral_kurtosis(x, fs_hz, window_samples=window_samples, overlap=overlap).values
    table = time_features(sk).select(("mean", "std", "skewness", "kurtosis"))
    return FeatureTable(SPECTRAL_KURTOSIS_FEATURES, table.values)


def paper2_features(x: ArrayLike, fs_hz: float, *, window_samples: int = 128) -> FeatureTable:
    """The 11 time-domain and 4 spectral-kurtosis features of paper 2, as interpreted in this module.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float
        Sampling rate, Hz.
    window_samples : int
        As `spectral_kurtosis`.

    Returns
    -------
    FeatureTable
        `PAPER2_FEATURES`.

    Raises
    ------
    TwingapError
        As `spectral_kurtosis`.
    """
    both = time_features(x).joined(spectral_kurtosis_features(x, fs_hz, window_samples=window_samples))
    return both.select(PAPER2_FEATURES)


def _rms(signals: Array) -> Array:
    root: Array = np.sqrt(np.mean(signals**2, axis=-1))
    return root


def _over(above: Array, below: Array) -> Array:
    """Quotient; 0 where the denominator is 0."""
    above, below = np.broadcast_arrays(above, below)
    return np.divide(above, below, out=np.zeros(above.shape), where=below > 0)
