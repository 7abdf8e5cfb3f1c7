"""Tones of a spectrum and their combs, computed once a record.

spectrum / local floor --> peaks --> fault comb, mains, unrelated comb --> shaft rate --> levels

Frequencies of peaks are interpolated between the bins of the Hann window: Grandke 1983, Interpolation algorithms for
discrete Fourier transforms, doi:10.1109/TIM.1983.4315077.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit
from twingap.records import Array
from twingap.signal.record_transforms import RecordTransforms, between_blocks, medians, once_a_record

SEARCH: Final = 0.055
"""Largest relative error of the stated speed. A larger one finds worse speeds, and more chance matches."""
SLIP: Final = 0.035
"""Largest relative slip of the cage, with the same trade-off."""
PEAK: Final = 20.0
"""Power over the floor's median from which a bin is a peak. A smaller value takes more noise for peaks."""
_MOST_PEAKS: Final = 150
"""Largest number of peaks, the strongest. More take time and add faint ones."""
HIGHEST_ORDER: Final = 120
"""Highest shaft order of lines that count as the shaft's; higher lines are near some order at any speed."""
LOCKED: Final = 0.7
"""Lock strength from which the shaft's rate is taken from the lines rather than as stated."""


@dataclass(frozen=True)
class Peaks:
    """Peaks of a spectrum: tones above its floor."""

    hz: Array  # [peaks] interpolated frequencies, rising
    power: Array  # [peaks] a^2 / 2 of each tone of amplitude a, unit squared
    excess: Array  # [peaks] power over the median floor about it

    def __len__(self) -> int:
        return int(self.hz.size)

    def of(self, chosen: NDArray[np.bool_]) -> Peaks:
        """Some of them."""
        return Peaks(self.hz[chosen], self.power[chosen], self.excess[chosen])


class Lines:
    """Tones of one spectrum and their combs, each step computed once.

    `tones` [bins] is a Hann power spectrum, a sine of amplitude a at a^2 / 2, with bins `df_hz` apart. Rates of shaft,
    fault (impacts) and races (ball passes), Hz, are as stated; lines above half the sampling rate `fs_hz` fold back.
    """

    def __init__(
        self,
        tones: Array,
        df_hz: float,
        shaft_hz: float,
        fault_hz: float | None,
        race_hz: tuple[float, ...] = (),
        fs_hz: float | None = None,
    ) -> None:
        self.tones, self.df_hz, self.stated_hz = tones, df_hz, max(shaft_hz, 1e-6)
        self.stated_fault_hz = fault_hz if fault_hz and fault_hz > 0 else None
        self.race_hz, self.fs_hz = race_hz, fs_hz
        self.floor = block_floor(tones)

    @cached_property
    def excess(self) -> Array:
        """[bins] Power over the floor."""
        return self.tones / self.floor

    @cached_property
    def peaks(self) -> Peaks:
        """The strongest tones."""
        e = self.excess
        if e.size < 8:
            return Peaks(np.empty(0), np.empty(0), np.empty(0))
        at = np.flatnonzero(e[2:-2] > PEAK) + 2
        at = at[(e[at] >= e[at - 1]) & (e[at] > e[at + 1])]
        # Side lobes of a strong tone (-31 dB and falling) are no peaks.
        strongest = np.sort(at[np.argsort(e[at])[::-1][:_MOST_PEAKS]])
        p = self.tones
        about = p[np.clip(strongest[:, None] + np.arange(-6, 7), 0, p.size - 1)]
        at = strongest[p[strongest] > 2e-2 * about.max(axis=1)]
        left, middle, right = (np.sqrt(p[at + k]) for k in (-1, 0, 1))
        up = right > left
        ratio = np.where(up, right, left) / np.maximum(middle, 1e-300)
        shift = np.where(up, 1.0, -1.0) * np.clip((2 * ratio - 1) / (ratio + 1), -0.5, 0.5)
        # The main lobe's bins together hold 1.5 times a tone's power, wherever it lies between bins.
        power = (p[at - 1] + p[at] + p[at + 1] + np.where(up, p[at + 2], p[at - 2])) / 1.5
        return Peaks((at + shift) * self.df_hz, power, e[at])

    @cached_property
    def weights(self) -> Array:
        """[peaks] Weight of each peak in a comb: log10 of its excess over the threshold, capped."""
        return np.asarray(np.minimum(0.3 + np.log10(self.peaks.excess / PEAK), 1.5))

    @cached_property
    def widths(self) -> Array:
        """[peaks] Largest error of a peak's frequency, Hz."""
        return self.df_hz * (0.12 + 0.8 / np.sqrt(self.peaks.excess))

    def on_comb(self, base_hz: float, widths: Array | None = None, highest: float = math.inf) -> NDArray[np.bool_]:
        """Which peaks lie on multiples of a frequency; without a highest one, folded ones count too."""
        k = np.rint(self.peaks.hz / base_hz)
        off = np.abs(self.peaks.hz - k * base_hz)
        if self.fs_hz is not None and math.isinf(highest):
            # Impacts have lines beyond half the sampling rate, which fold back.
            beyond = self.fs_hz - self.peaks.hz
            off = np.minimum(off, np.abs(beyond - np.rint(beyond / base_hz) * base_hz))
        return np.asarray((k >= 1) & (k <= highest) & (off < 2.5 * (self.widths if widths is None else widths)))

    @cached_property
    def mains(self) -> tuple[float, float]:
        """Peaks' weights on multiples 1 to 10 of 50 and of 60 Hz, those of both (300 Hz, 600 Hz) left out."""
        both = self.on_comb(300.0)
        fifty, sixty = (self.on_comb(hz, highest=10) & ~both for hz in (50.0, 60.0))
        return float(self.weights[fifty].sum()), float(self.weights[sixty].sum())

    @cached_property
    def of_mains(self) -> NDArray[np.bool_]:
        """[peaks] Those of the mains, where at least two multiples stand."""
        out = np.zeros(len(self.peaks), bool)
        for hz in (50.0, 60.0):
            own = self.on_comb(hz, highest=24)
            if np.count_nonzero(own & (self.peaks.hz < 6.5 * hz)) >= 2:
                out |= own
        return out

    @cached_property
    def fault_comb(self) -> tuple[float, float, NDArray[np.bool_]]:
        """Fault rate over its stated place, number of peaks on its comb beyond chance, and which they are."""
        none = np.zeros(len(self.peaks), bool)
        if self.stated_fault_hz is None or len(self.peaks) < 4:
            return math.nan, 0.0, none
        # The step moves the highest peak by a third of a bin.
        top = float(self.peaks.hz[-1])
        count = int(np.clip(6 * SEARCH * top / self.df_hz, 50, 6000))
        ratios = np.linspace(1 - SEARCH - SLIP / 2, 1 + SEARCH + SLIP / 2, count)
        widths = np.maximum(self.widths, 0.3 * self.df_hz)
        score = comb_scores(self.peaks.hz, self.weights, widths, ratios * self.stated_fault_hz, 1e9, False)
        best = float(ratios[int(np.argmax(score))])
        own = self.on_comb(best * self.stated_fault_hz, widths)
        direct = self.on_comb(best * self.stated_fault_hz, widths, 1e9)
        if direct.any():  # least squares over its peaks
            k = np.rint(self.peaks.hz[direct] / (best * self.stated_fault_hz))
            best = float((k @ self.peaks.hz[direct]) / (k @ k)) / self.stated_fault_hz
            own = self.on_comb(best * self.stated_fault_hz, widths)
        chance = float(medians(score)) / max(float(self.weights.sum()), 1e-9) * len(self.peaks)
        beyond = float(np.count_nonzero(own)) - chance - 2.0
        if beyond < 2:
            return math.nan, max(beyond, 0.0), none
        return best, beyond, own

    @cached_property
    def lock(self) -> tuple[float, float]:
        """Shaft rate over the stated one, and its evidence (0 none; from 1 on, two lines or more)."""
        use = ~(self.fault_comb[2] | self.of_mains) & (self.peaks.hz < HIGHEST_ORDER * self.stated_hz)
        use &= ~self.unrelated_comb[2]
        first = self._locked_with(use)
        # Waviness may lie on integer orders of a wrong speed by chance: the comb that explains more is used.
        rival = np.zeros(len(self.peaks), bool)
        for base_hz in self.race_hz:
            ratio, score = self.wave(base_hz, SEARCH + SLIP / 2, use)
            if score > max(first[1], 0.6):
                rival |= self.on_comb(ratio * base_hz, highest=10)
        return self._locked_with(use & ~rival) if rival.any() else first

    @cached_property
    def unrelated_comb(self) -> tuple[float, float, NDArray[np.bool_]]:
        """Rate, strength and peaks of a comb that is neither the shaft's nor the fault's, as of another bearing.

        Between one and a half and fourteen shaft orders; it has to explain more than the shaft does.
        """
        none = np.zeros(len(self.peaks), bool)
        use = ~(self.fault_comb[2] | self.of_mains)
        if np.count_nonzero(use) < 5:
            return math.nan, 0.0, none
        hz, weights = self.peaks.hz[use], self.weights[use]
        widths = np.maximum(self.widths[use], 0.25 * self.df_hz)
        count = int(np.clip(2.3 * float(hz[-1]) / (0.5 * self.df_hz), 200, 16000))
        bases = np.geomspace(1.5, 14.0, count) * self.stated_hz
        score = comb_scores(hz, weights, widths, bases, 1e9, False)
        # Narrow combs catch more by chance: as many as a line's width is of their spacing.
        score = score - 5 * float(widths.mean()) * float(weights.sum()) / bases
        best = int(np.argmax(score))
        base = float(bases[best])
        own = use & self.on_comb(base, np.maximum(self.widths, 0.25 * self.df_hz), 1e9)
        if np.count_nonzero(own) < 4:
            return math.nan, 0.0, none
        k = np.rint(self.peaks.hz[own] / base)
        for multiple in (2, 3):
            if not np.any(k % multiple):
                base, k = base * multiple, k / multiple
        # A comb needs neighbouring multiples: single ones fit by chance.
        if np.count_nonzero(np.diff(k) == 1) < 2:
            return math.nan, 0.0, none
        base = float((k @ self.peaks.hz[own]) / (k @ k))
        strength = float(score[best] - self.weights[own].max())
        # The shaft's comb by the same measure: a gear's lines lie on it, however high their orders.
        shaft = np.linspace(1 - SEARCH, 1 + SEARCH, int(np.clip(6 * SEARCH * float(hz[-1]) / self.df_hz, 41, 4001)))
        rival = float(comb_scores(hz, weights, widths, shaft * self.stated_hz, 1e9, False).max())
        rival -= 5 * float(widths.mean()) * float(weights.sum()) / self.stated_hz
        # Of two combs that explain as much, the sparser one is less likely to do so by chance.
        if strength < 1.0 or float(score[best]) < 0.95 * rival:
            return math.nan, 0.0, none
        if any(self.wave(race_hz, SEARCH + SLIP / 2, use)[1] > 0.85 * strength for race_hz in self.race_hz):
            return math.nan, 0.0, none
        return base, strength, use & self.on_comb(base, np.maximum(self.widths, 0.25 * self.df_hz))

    def wave(self, base_hz: float, reach: float, use: NDArray[np.bool_]) -> tuple[float, float]:
        """Rate of the comb about `base_hz` that holds most of the peaks, over `base_hz`, and their weight."""
        if not use.any():
            return 1.0, 0.0
        count = int(np.clip(10 * reach * 8 * base_hz / self.df_hz, 41, 4001)) | 1
        ratios = np.linspace(1 - reach, 1 + reach, count)
        score = comb_scores(self.peaks.hz[use], self.weights[use], self.widths[use], ratios * base_hz, 10, True)
        best = int(np.argmax(score - 0.05 * np.abs(np.log(ratios)) / reach))
        return float(ratios[best]), float(score[best])

    def _locked_with(self, use: NDArray[np.bool_]) -> tuple[float, float]:
        if np.count_nonzero(use) < 2:
            return 1.0, 0.0
        hz, widths = self.peaks.hz[use], self.widths[use]
        # Beyond about thirty orders any tone lies near an integer order at some speed.
        weights = self.weights[use] / (1 + hz / (30 * self.stated_hz))
        count = int(np.clip(8 * SEARCH * float(hz[-1]) / self.df_hz, 41, 4001)) | 1
        ratios = np.linspace(1 - SEARCH, 1 + SEARCH, count)
        score = comb_scores(hz, weights, widths, ratios * self.stated_hz, HIGHEST_ORDER, False)
        preferred = score - 0.15 * np.abs(np.log(ratios)) / SEARCH
        best = float(ratios[int(np.argmax(preferred))])
        k = np.rint(hz / (best * self.stated_hz))
        own = (k >= 1) & (np.abs(hz - k * best * self.stated_hz) < 2.5 * widths)
        # One line lies on some comb at any speed: only what the others add is evidence.
        strength = float(score[int(np.argmax(preferred))] - (weights[own].max() if own.any() else 0.0))
        if own.any() and strength > 0.3:
            trust = 1 / widths[own] ** 2
            best = float((trust * k[own]) @ hz[own] / ((trust * k[own]) @ k[own])) / self.stated_hz
        return best, strength

    @property
    def locked(self) -> bool:
        """Whether the lines show the shaft's rate."""
        return self.lock[1] >= LOCKED

    @property
    def shaft_hz(self) -> float:
        """Shaft rate: from its lines where they show it, else as stated."""
        return self.stated_hz * (self.lock[0] if self.locked else 1.0)

    def at(self, hz: Array, relative: float = 0.0, without: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """[k], [k] Largest power within `relative` of each frequency and one bin, peaks `without` [peaks] ignored.

        log10 of its excess over what noise alone would show in as many bins, and the power of a tone there; NaN beyond
        the spectrum.
        """
        logs, power = np.full(hz.size, np.nan), np.full(hz.size, np.nan)
        tones, size = self.tones, self.tones.size
        if without is not None and without.any():
            tones = tones.copy()
            places = np.rint(self.peaks.hz[without] / self.df_hz).astype(int)
            for k in range(-3, 4):
                at = np.clip(places + k, 0, size - 1)
                tones[at] = np.minimum(tones[at], self.floor[at])
        look_up(tones, self.floor, hz / self.df_hz, relative, logs, power)
        return logs, power


@once_a_record
def lines_of(record: RecordTransforms) -> Lines:
    """Tones of a record, computed once."""
    fault_hz = None if record.fault_order is None else record.fault_order * record.shaft_hz
    races = (record.bearing.bpfo * record.shaft_hz, record.bearing.bpfi * record.shaft_hz)
    return Lines(record.tones, record.df_hz, record.shaft_hz, fault_hz, races, record.fs_hz)


def block_floor(power: Array) -> Array:
    """[bins] The level between lines: medians of blocks, the middle of each three, interpolated in the logarithm."""
    n, block = power.size, 32
    if n < 4 * block:
        return np.full(n, max(float(medians(power)), 1e-300))
    count = n // block
    middles = medians(power[: count * block].reshape(count, block))
    # Where lines fill a block, its neighbours replace it; mean rather than median keeps the slope of a resonance.
    padded = np.concatenate((middles[:1], middles, middles[-1:]))
    around = np.minimum(np.maximum(padded[:-2], padded[2:]), 1e300)
    logs = np.log(np.maximum(np.minimum(2 * around, middles), 1e-300))
    padded = np.concatenate((logs[:1], logs, logs[-1:]))
    smooth = 0.25 * padded[:-2] + 0.5 * logs + 0.25 * padded[2:]
    floor = between_blocks(smooth, block, n)
    return np.asarray(np.exp(floor, out=floor))


def comb_scores(hz: Array, weights: Array, widths: Array, bases: Array, highest: float, based: bool) -> Array:
    """[candidates] Sum of the weights of the lines that lie on multiples of each base, less by their distance.

    With `based` a comb without its first line counts nothing.
    """
    out, first = np.zeros((2, bases.size))
    _add_comb_scores(hz, weights, widths, bases, float(highest), based, out, first)
    return out


@njit()
def _add_comb_scores(hz, weights, widths, bases, highest, based, out, first):  # type: ignore[no-untyped-def]  # pragma: no cover
    # Candidates are the inner loop, and nothing in it branches: so it is done eight at a time.
    for i in range(hz.size):
        line, weight, width = hz[i], weights[i], 2.5 * widths[i]
        for c in range(bases.size):
            k = np.floor(line / bases[c] + 0.5)
            off = abs(line - k * bases[c]) / width
            hit = (off < 1.0) & (k >= 1.0) & (k <= highest)
            out[c] += weight * (1 - off * off) if hit else 0.0
            if based:
                first[c] = 1.0 if hit & (k == 1.0) else first[c]
    if based:
        for c in range(bases.size):
            out[c] = out[c] if first[c] > 0 else 0.0


@njit()
def look_up(tones, floor, places, relative, logs, power):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Fill what `Lines.at` returns; places are frequencies in bins."""
    for i in range(places.size):
        place = places[i]
        reach = 1 + relative * place
        low, high = round(place - reach), round(place + reach) + 1
        if high > tones.size - 2 or place < 1.5:
            continue
        low = 1 if low < 1 else low
        best = low
        for k in range(low + 1, high):
            best = k if tones[k] > tones[best] else best
        # Neighbouring bins of a Hann window share a third of their noise.
        expected = (math.log((high - low) / 1.3) + 0.577) / math.log(2)
        excess = tones[best] / floor[best] / expected
        logs[i] = math.log10(1e-3 if excess < 1e-3 else excess)
        power[i] = (tones[best - 1] + tones[best] + tones[best + 1]) / 1.5
