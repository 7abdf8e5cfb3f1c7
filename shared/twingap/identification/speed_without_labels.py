"""Probabilities of the true speeds of records whose faults are unknown, from all lines of all records of a set.

record --envelopes of bands--> heights of lines --sum over each fault's lines--> score [faults, ratios] -+
       --shaft tones------------------------------------------------------------> log density [ratios] --+-> evidence
evidence of all records --common ratio, scatter of the records: integrated out--> probability of each record's ratio

A wrong speed scales all orders alike, so that each fault's lines (harmonics, and sidebands at shaft or cage rate)
explain a record at one ratio of true over stated speed. A chance match of another fault at another ratio explains fewer
lines, and disagrees with the other records, whose ratios are similar as far as they show it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from twingap.bearing import Bearing
from twingap.identification.speed import Samples
from twingap.identification.speed_reading import read_speed
from twingap.records import Condition, RecordSet
from twingap.signal.record_transforms import medians

Array = NDArray[np.float64]

REACH: Final = 0.075
"""Largest relative error of stated speeds that is searched; wider finds larger errors and more chance matches."""
STEP: Final = 0.001
"""Step of the ratios: finer than what a classifier tolerates."""
RATIOS: Final[Array] = np.arange(1 - REACH, 1 + REACH + STEP / 2, STEP)
"""Ratios of true over stated speed."""
FAULTS: Final = ("outer", "inner", "ball")
HARMONICS: Final = 4
ASIDE: Final = 0.5
"""Weight of a sideband, and of a line of the shaft, relative to a harmonic of the fault."""
SEGMENT_TURNS: Final = 64.0
"""Turns in a segment of the envelope. Longer segments resolve orders better, and smear where the speed varies."""
LEAST_TURNS: Final = 3.0
"""Turns of a record from which its lines are searched; in fewer, lines of different faults are one."""
MOST_SAMPLES: Final = 1 << 20
"""Samples of a record that are read, at most."""
FLOOR_BINS: Final = 65
"""Width of the running median that lines are compared with: wider than a line, narrower than the level's changes."""
MAINS_DRIFT: Final = 1e-3
"""Relative deviation of the mains frequency from its nominal value."""
WIDEST_BIN_HZ: Final = 2.5
"""Widest bin of the envelope spectrum up to which lines of mains are left out; wider bins would leave out too much."""
SHARPNESS: Final = 1.0
"""Log probability per unit of score: larger takes weak lines more seriously, chance matches too."""
WRONG_TONES: Final = 0.05
"""Fraction of readings of shaft tones that are other lines."""
OWN_WAY: Final = 0.03
"""Fraction of records whose speed has nothing to do with that of the others."""
NEGLIGIBLE: Final = 0.01
"""Probability of further speeds from which no further candidate is considered."""
SHOWN: Final = 0.9
"""Probability of the speeds within a per cent of the likeliest from which a record is said to show its speed."""
_COMMON_SDS = (0.003, 0.03)  # of the common log ratio, equally likely: speeds stated well, and badly
_SCATTERS = (0.002, 0.004, 0.008, 0.016, 0.04)  # of the records about it, equally likely


@dataclass(frozen=True)
class SpeedProbabilities:
    """Probabilities of ratios of true over stated speed.

    Parameters
    ----------
    weights : Array [records, ratios]
        Of `RATIOS`; each row sums to 1.
    lines : Array [records, faults], optional
        How much higher each fault's lines score at these ratios than at others, in the order of `FAULTS`.
    """

    weights: Array
    lines: Array | None = None

    @property
    def ratio(self) -> Array:
        """Most probable ratio of each record [records], as the mean within a per cent of it."""
        near = np.abs(RATIOS - RATIOS[self.weights.argmax(axis=1), None]) < 0.01
        return np.asarray((self.weights * near) @ RATIOS / (self.weights * near).sum(axis=1))

    @property
    def shown(self) -> NDArray[np.bool_]:
        """Whether each record shows its speed [records]."""
        near = np.abs(RATIOS - self.ratio[:, None]) < 0.01
        return np.asarray((self.weights * near).sum(axis=1) > SHOWN)

    @property
    def notes(self) -> list[str]:
        """For people: how far stated speeds are off."""
        off = 100 * (self.ratio[self.shown] - 1)
        if not off.size or np.abs(off).max() <= 1:
            return []
        return [
            f"true speeds lie {off.min():+.1f} to {off.max():+.1f} % off the stated ones, as lines show, and were used"
        ]

    def corrected(self, records: RecordSet) -> RecordSet:
        """The records with the speeds that they show in their conditions; samples are unchanged."""
        ratios = np.where(self.shown, self.ratio, 1.0)
        conditions = [
            replace(c, speed_rpm=c.speed_rpm * float(r)) for c, r in zip(records.conditions, ratios, strict=True)
        ]
        return RecordSet(records.name, records.unit, records.bearing, conditions, Samples(records))

    def candidates(self, count: int, width: float) -> tuple[Array, Array]:
        """Ratios that stand for the distribution.

        Parameters
        ----------
        count : int
            Most candidates.
        width : float
            Half the range of ratios that a candidate stands for.

        Returns
        -------
        ratios, weights : Array [candidates, records]
            The most probable candidate first; weights sum to 1 over the candidates.
        """
        left = self.weights.copy()
        ratios: list[Array] = []
        weights: list[Array] = []
        while len(ratios) < count and (not ratios or left.sum(axis=1).max() > NEGLIGIBLE):
            summed = np.cumsum(np.pad(left, ((0, 0), (1, 0))), axis=1)
            reach = round(width / STEP)
            low = np.clip(np.arange(RATIOS.size) - reach, 0, None)
            high = np.clip(np.arange(RATIOS.size) + reach + 1, None, RATIOS.size)
            best = (summed[:, high] - summed[:, low]).argmax(axis=1)
            near = np.abs(np.arange(RATIOS.size) - best[:, None]) <= reach
            mass = (left * near).sum(axis=1)
            middle = (left * near) @ RATIOS / np.maximum(mass, 1e-300)
            ratios.append(np.where(mass > 0, middle, RATIOS[best]))
            weights.append(mass)
            left = np.where(near, 0.0, left)
        found = np.array(weights)
        return np.array(ratios), found / found.sum(axis=0)


def as_stated(records: int) -> SpeedProbabilities:
    """Speeds that are taken as stated."""
    return SpeedProbabilities(np.tile(np.abs(RATIOS - 1) < STEP / 2, (records, 1)).astype(float))


def speeds_without_labels(records: RecordSet, bearing: Bearing) -> SpeedProbabilities:
    """Probabilities of the true speeds of records of unknown faults.

    Parameters
    ----------
    records : RecordSet
        Faults are not read. One record's samples in memory at a time.
    bearing : Bearing
        Bearing under test.

    Returns
    -------
    SpeedProbabilities
    """
    scores, evidence = [], []
    for record in records.without_labels():
        x = record.samples[:MOST_SAMPLES]
        scores.append(line_scores(x, record.condition, bearing))
        evidence.append(_evidence(scores[-1], x, record.condition, bearing))
    found = combine(np.array(evidence))
    # A slipping cage moves lines by up to a per cent against the shaft.
    over = maximum_filter1d(np.array(scores), round(2 * 0.01 / STEP) + 1, axis=2)
    over -= np.median(scores, axis=2)[:, :, None]
    return replace(found, lines=np.einsum("rfg,rg->rf", over, found.weights))


def combine(evidence: Array) -> SpeedProbabilities:
    """Probabilities of all records' ratios from the evidence of each.

    Parameters
    ----------
    evidence : Array [records, ratios]
        Log likelihood of each ratio, up to a constant of the record.
    """
    likelihood = np.exp(evidence - evidence.max(axis=1, keepdims=True))
    logs = np.log(RATIOS)
    uniform = np.full(RATIOS.size, 1 / RATIOS.size)
    prior = np.mean([np.exp(-0.5 * (logs / sd) ** 2) / sd for sd in _COMMON_SDS], axis=0)
    log_evidence, given = [], []
    for scatter in _SCATTERS:
        about = np.exp(-0.5 * ((logs[None, :] - logs[:, None]) / scatter) ** 2)
        about = (1 - OWN_WAY) * about / about.sum(axis=1, keepdims=True) + OWN_WAY * uniform
        each = about @ likelihood.T  # [common ratios, records]
        log_evidence.append(np.log(each).sum(axis=1) + np.log(prior))
        given.append((about, each))
    weights = np.exp(np.array(log_evidence) - np.max(log_evidence))
    weights /= weights.sum()
    found = sum(
        likelihood * ((w[:, None] / each).T @ about) for w, (about, each) in zip(weights, given, strict=True)
    )  # fmt: skip
    return SpeedProbabilities(np.asarray(found) / np.sum(found, axis=1, keepdims=True))


def _evidence(scores: Array, x: Array, condition: Condition, bearing: Bearing) -> Array:
    """Log likelihood of each ratio [ratios]: lines of the likeliest faults, and tones of the shaft."""
    scores = SHARPNESS * scores
    highest = scores.max()
    found = highest + np.log(np.exp(scores - highest).mean(axis=0))
    tones = read_speed(x, condition, bearing)
    if math.isfinite(tones.shaft_sigma):
        sd = max(tones.shaft_sigma, STEP)
        at = np.exp(-0.5 * ((np.log(RATIOS) - tones.shaft) / sd) ** 2)
        found = found + np.log((1 - WRONG_TONES) * at / at.sum() + WRONG_TONES / RATIOS.size)
    return np.asarray(found)


def line_scores(x: Array, condition: Condition, bearing: Bearing) -> Array:
    """Summed heights of each fault's lines at each ratio, in the band where they are highest.

    Parameters
    ----------
    x : Array [samples]
    condition : Condition
        With the stated speed.
    bearing : Bearing

    Returns
    -------
    Array [faults, ratios]
        In the order of `FAULTS`; 0 for a record of less than `LEAST_TURNS` turns.
    """
    shaft_hz = condition.speed_rpm / 60
    if shaft_hz * x.size / condition.fs_hz < LEAST_TURNS or not np.ptp(x) > 0:
        return np.zeros((len(FAULTS), RATIOS.size))
    out = np.full((len(FAULTS), RATIOS.size), -np.inf)
    for height, df in _line_heights(x, condition.fs_hz, shaft_hz, bearing):
        bins = height.size - 2
        for number, fault in enumerate(FAULTS):
            score = np.zeros(RATIOS.size)
            for order, weight in _lines_of(fault, bearing):
                at = order * shaft_hz * RATIOS / df
                inside = (at > 2) & (at < bins)
                low = np.where(inside, at, 0).astype(int)
                score += weight * np.where(inside, np.maximum(height[low], height[low + 1]), 0.0)
            out[number] = np.maximum(out[number], score)
    return out


def _lines_of(fault: str, bearing: Bearing) -> list[tuple[float, float]]:
    """Orders and weights of the lines of a fault, sidebands and harmonics of the shaft included."""
    order = bearing.fault_order(fault)
    found = [(k * order, 1.0) for k in range(1, HARMONICS + 1)] + [(float(k), ASIDE) for k in (1, 2, 3)]
    if (aside := bearing.side_line_order(fault)) is not None:
        found += [(k * order + sign * aside, ASIDE) for k in (1, 2, 3) for sign in (-1, 1)]
    return found


def _line_heights(x: Array, fs_hz: float, shaft_hz: float, bearing: Bearing) -> list[tuple[Array, float]]:
    """Heights of lines in the envelope spectra of overlapping bands, and their spacing of bins, Hz.

    A height is ln(1 + e / 3), where e is the log likelihood of a bin's power, averaged over segments, being more than
    noise: it grows slowly, since real spectra have lines without cause.
    """
    highest_hz = shaft_hz * ((HARMONICS + 0.2) * max(bearing.fault_order(f) for f in FAULTS) + 1) * (1 + REACH)
    spectrum = scipy.fft.rfft(x - x.mean())
    df = fs_hz / x.size
    width = min(max(spectrum.size // 6, int(highest_hz / df)), spectrum.size - 1)
    starts = np.unique(np.linspace(1, spectrum.size - width, max(1, 2 * (spectrum.size // width) - 1)).astype(int))
    taper = 1 - np.abs(np.linspace(-1, 1, width)) ** 8
    m = scipy.fft.next_fast_len(2 * width)
    rate_hz = m * df  # of the envelope
    length = min(m, int(SEGMENT_TURNS / shaft_hz * rate_hz))
    count = max(1, 2 * (m // length) - 1)
    begins = np.linspace(0, m - length, count).astype(int)
    window = np.hanning(length)
    independent = 1.0 if count == 1 else 0.6 * count  # half overlapping Hann segments
    top = min(length // 2, int(highest_hz / rate_hz * length) + 4)
    out = []
    kept = ~_of_mains(np.arange(top) * rate_hz / length, rate_hz / length)
    for start in starts:
        padded = np.zeros(m, complex)
        padded[:width] = spectrum[start : start + width] * taper
        z = scipy.fft.ifft(padded)
        squared = z.real**2 + z.imag**2
        squared /= max(float(squared.mean()), 1e-300)
        power = np.zeros(top)
        for begin in begins:
            part = scipy.fft.rfft((squared[begin : begin + length] - 1.0) * window)[:top]
            power += part.real**2 + part.imag**2
        z_power = power / _floor(power, independent)
        over = np.maximum(z_power, 1.0)
        height = np.where(kept, np.log1p(independent * (over - 1 - np.log(over)) / 3), 0.0)
        out.append((height, rate_hz / length))
    return out


def _of_mains(frequency: Array, df: float) -> NDArray[np.bool_]:
    """Bins at harmonics of mains, whose lines say nothing of the shaft; none where bins are too wide for that."""
    found = np.zeros(frequency.size, dtype=bool)
    for mains_hz in (50.0, 60.0) if df < WIDEST_BIN_HZ else ():
        harmonic = np.maximum(np.rint(frequency / mains_hz), 1)
        found |= np.abs(frequency - harmonic * mains_hz) < 1.2 * df + MAINS_DRIFT * frequency
    return found


def _floor(power: Array, averages: float) -> Array:
    """Mean noise level of an averaged periodogram [bins] from running medians."""
    bias = 1 - 1 / (3 * averages) + 0.026 / averages  # median over mean of a gamma distribution
    if power.size < 2 * FLOOR_BINS:
        return np.full(power.size, max(float(medians(power)) / bias, 1e-300))
    step = FLOOR_BINS // 2
    windows = np.lib.stride_tricks.sliding_window_view(power, FLOOR_BINS)[::step]
    places = np.arange(len(windows)) * step + step
    levels = np.maximum(medians(windows), 1e-300)
    return np.asarray(np.exp(np.interp(np.arange(power.size), places, np.log(levels))) / bias)
