"""Averaged spectra of records, and the expectation of the same estimator for a model's autocovariance.

records --(Hann segments, half overlapping)--> PSD per record;  autocovariance --(same taper)--> expected PSD

An averaged PSD is compared with its expectation for the model, including leakage and resolution, so that short records
do not bias the damping (the idea of the debiased Whittle likelihood, Sykulski et al. 2019, doi:10.1093/biomet/asy071).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import correlate, get_window, welch
from scipy.stats import gamma

from twingap.errors import TwingapError
from twingap.records import Record, RecordSet

Array = NDArray[np.float64]

SEGMENT_S = 0.17
"""Desired length of a segment, s. A bin spacing of 6 Hz separates a mode with 0.2 % damping at 3 kHz from a line."""
LINE_S = 1.0
"""Longest segment for the detection of lines, s; in longer ones shaft harmonics spread by speed variation."""
SHORTEST = 64
"""Fewest samples of a record from which a spectrum is taken."""


@dataclass(frozen=True)
class Spectra:
    """One-sided PSDs of records that share a sampling rate.

    Parameters
    ----------
    fs_hz : float
    segment : int
        Samples per segment.
    psd : Array [records, bins]
        Unit squared per Hz.
    clean : NDArray[bool] [records, bins]
        Whether a bin has no line (shaft or fault harmonic, mains).
    averages : Array [records]
        Equivalent number of independent averages of each PSD.
    places : NDArray[int64] [records]
        Indices of the records in their set.
    """

    fs_hz: float
    segment: int
    psd: Array
    clean: NDArray[np.bool_]
    averages: Array
    places: NDArray[np.int64]

    @cached_property
    def f_hz(self) -> Array:
        """Frequency of each bin, Hz."""
        return np.asarray(np.fft.rfftfreq(self.segment, 1 / self.fs_hz), float)

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Bins for fits: without those near zero, where the mean was removed, and those of the anti-aliasing filter."""
        bins = np.arange(self.f_hz.size)
        return (bins >= 3) & (bins <= 0.9 * (self.segment // 2))

    def take(self, keep: NDArray[np.bool_]) -> Spectra:
        """The spectra of some records; `keep` refers to the complete set [records of the set]."""
        own = keep[self.places]
        return replace(
            self, psd=self.psd[own], clean=self.clean[own], averages=self.averages[own], places=self.places[own]
        )

    def mean(self, weights: Array | None = None, *, lines: bool = False) -> tuple[Array, Array]:
        """PSD averaged over records, each weighted by its averages.

        Parameters
        ----------
        weights : Array [records], optional
            Additional weight of each record; 0 excludes it.
        lines : bool
            Whether bins with lines are included; otherwise each bin averages the records without a line there.

        Returns
        -------
        psd, averages : Array [bins]
            Mean PSD, and its equivalent number of independent averages; 0 where every record has a line.
        """
        w = (self.averages if weights is None else self.averages * weights)[:, None]
        w = np.broadcast_to(w, self.psd.shape) if lines else w * self.clean
        total = w.sum(axis=0)
        return np.asarray((w * self.psd).sum(axis=0) / np.maximum(total, 1e-300)), np.asarray(total)

    @cached_property
    def taper(self) -> Array:
        """Autocorrelation of the taper at lags 0 ... segment - 1, 1 at lag 0."""
        w = get_window("hann", self.segment)
        return np.asarray(correlate(w, w, method="fft")[self.segment - 1 :] / (w @ w))

    def expected(self, autocovariance: Array) -> Array:
        """Expected PSD of this estimator for a process with this autocovariance.

        Parameters
        ----------
        autocovariance : Array [..., segment]
            At lags 0 ... segment - 1, unit squared.

        Returns
        -------
        Array [..., bins]
        """
        tapered = autocovariance * self.taper
        tapered[..., 0] /= 2
        return np.asarray(4 / self.fs_hz * np.fft.rfft(tapered, axis=-1).real)


def spectra(records: RecordSet, segment_s: float = SEGMENT_S) -> list[Spectra]:
    """Averaged PSDs of records, one `Spectra` per sampling rate; one record's samples in memory at a time.

    Parameters
    ----------
    records : RecordSet
        Records of at least 64 finite samples each.
    segment_s : float
        Desired length of a segment, s; at most half the shortest record of that rate.

    Raises
    ------
    TwingapError
        For records that are too short, constant, or not finite.
    """
    by_rate: dict[float, list[int]] = {}
    for place, condition in enumerate(records.conditions):
        by_rate.setdefault(condition.fs_hz, []).append(place)
    out = []
    for fs_hz, places in by_rate.items():
        sizes = np.array([records.conditions[p].n_samples for p in places])
        shortest = int(sizes.min())
        if shortest < SHORTEST:
            check(records[places[int(sizes.argmin())]])
        aimed = 2 ** int(np.ceil(np.log2(max(segment_s * fs_hz, SHORTEST))))
        segment = min(aimed, shortest // 4 * 2)
        # Lines are detected at the finest resolution, where a sharp mode is wider than a line.
        fine = int(min(shortest // 2 * 2, max(LINE_S * fs_hz // 2 * 2, segment)))
        psd, finer = [], []
        for place in places:
            record = records[place]
            check(record)
            psd.append(power_density(record.samples, fs_hz, segment))
            finer.append(power_density(record.samples, fs_hz, fine))
        clean = np.empty((len(places), segment // 2 + 1), bool)
        states = [records.conditions[p].fault for p in places]
        for state in set(states):
            # Common lines are detected per state, since lines of a fault are not in healthy records.
            own = np.array([s == state for s in states])
            worth = np.array([_averages(size, fine) for size in sizes[own]])
            clean[own] = ~_lines(np.array(finer)[own], worth, fine, segment)
        averages = np.array([_averages(size, segment) for size in sizes])
        out.append(Spectra(fs_hz, segment, np.array(psd), clean, averages, np.array(places)))
    return out


def power_density(samples: Array, fs_hz: float, segment: int) -> Array:
    """One-sided PSD: Hann segments, half overlapping, the record's mean removed once."""
    centred = samples - samples.mean()
    return np.asarray(welch(centred, fs_hz, nperseg=segment, detrend=False)[1])


def check(record: Record) -> None:
    """Raise for a record from which no spectrum can be computed."""
    where = f"record {record.condition.name!r}"
    if record.samples.size < SHORTEST:
        raise TwingapError(
            f"{record.samples.size} samples found, at least {SHORTEST} expected for identification", where=where
        )
    if not np.isfinite(record.samples).all():
        raise TwingapError("a sample is not a finite number", where=where, mend="remove or repair the record")
    spread = float(np.ptp(record.samples))
    if spread == 0:
        raise TwingapError("all samples are equal", where=where, mend="remove the record")
    if not 1e-30 < spread < 1e30:  # keeps powers and their products finite
        what = f"samples spread over {spread:.3g}, which no accelerometer can measure"
        raise TwingapError(what, where=where, mend="check the unit and how the file was read")


def _averages(samples: int, segment: int) -> float:
    """Equivalent independent averages of half-overlapping Hann segments, with correlation 1/6 (Welch 1967)."""
    k = (samples - segment) // (segment // 2) + 1
    return float(k / (1 + 2 * (k - 1) / k / 36))


def _lines(psd: Array, averages: Array, fine: int, segment: int) -> NDArray[np.bool_]:
    """Bins at resolution `segment` that are affected by lines detected at resolution `fine` [records, bins]."""
    shared = find_lines(averages @ psd / averages.sum(), float(averages.sum()))
    flagged = np.zeros((len(psd), segment // 2 + 1), bool)
    for place, (own, n) in enumerate(zip(psd, averages, strict=True)):
        level = np.maximum(find_lines(own, float(n)), shared)
        for at in np.flatnonzero(level):
            # Hann sidelobes fall with the sixth power of the distance: mask until they are below the floor.
            reach = 1 + int(np.ceil((level[at] * segment / fine) ** (1 / 6)))
            centre = round(at * segment / fine)
            flagged[place, max(0, centre - reach) : centre + reach + 1] = True
    return flagged


def find_lines(psd: Array, averages: float, width: int = 6) -> Array:
    """Height of lines over the running median of neighbouring bins, 0 without a line.

    Parameters
    ----------
    psd : Array [bins]
    averages : float
        Equivalent number of independent averages of `psd`, which determines its scatter.
    width : int
        Half width of the running median, bins.

    Returns
    -------
    Array [bins]
    """
    median = np.maximum(median_filter(psd, 2 * width + 1, mode="nearest"), np.finfo(float).tiny)
    # Level exceeded by scatter in one of a hundred spectra, doubled since a median of few bins scatters too; at least
    # four times the median, since real spectra are not flat within its window.
    limit = 2 * max(2.0, float(gamma.isf(0.01 / psd.size, averages) / gamma.median(averages)))
    return np.where(psd > limit * median, psd / median, 0.0)
