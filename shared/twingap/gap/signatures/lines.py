"""Signatures of tones in the raw spectrum: whose they are, how strong, and what belongs to nobody.

tones / local floor --> peaks --> fault comb, mains --> shaft rate locked --> whole and half orders, gear, waviness
                                                                      |
                                                                      +--> what is left: free tones, pairs about them

Excesses are log10 of power over the local floor, levels log10 of amplitude over the healthy RMS. Frequencies of peaks
are interpolated between the bins of the Hann window. Source: Randall, Vibration-based condition monitoring, Wiley 2011;
interpolation: Grandke 1983, Interpolation algorithms for discrete Fourier transforms, doi:10.1109/TIM.1983.4315077.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twingap.gap.view import RecordView, medians

Array = NDArray[np.float64]

SEARCH: Final = 0.055
"""How far the true speed may lie from the stated one, relative."""

SLIP: Final = 0.035
"""How far the cage may slip, relative."""

_PEAK: Final = 20.0
"""Power over the floor's median that noise passes in about one record of twenty."""

_MOST_PEAKS: Final = 150
_HIGHEST_ORDER: Final = 120
_LOCKED: Final = 0.7
"""Lock strength from which the shaft's rate is read off the lines."""

_WHOLE: Final = (1, 2, 3, 4, 5)
_HALF: Final = (0.5, 1.5, 2.5, 3.5, 4.5)

NAMES: Final[tuple[str, ...]] = (
    "shaft_ratio_log",
    "shaft_lock",
    *(f"order_{k}_excess" for k in _WHOLE),
    *(f"order_{k}_level" for k in _WHOLE),
    *(f"half_{k}_excess" for k in range(1, 6)),
    "half_mean",
    "half_level",
    "whole_high_mean",
    "whole_high_level",
    "whole_decay",
    "mains_50_mean",
    "mains_60_mean",
    *(f"mains_50_{k}_excess" for k in (1, 2, 3)),
    *(f"mains_60_{k}_excess" for k in (1, 2, 3)),
    "mains_peaks_50",
    "mains_peaks_60",
    "mains_level",
    "mains_decay",
    "mains_is_60",
    "gear_score",
    "gear_teeth",
    "gear_level",
    "gear_depth_log",
    "gear_decay",
    *(f"wave_{race}_{what}" for race in ("outer", "inner") for what in ("score", "ratio_log", "level", "decay")),
    "fault_comb_peaks",
    "fault_comb_share",
    "fault_ratio_log",
    "fault_low_excess",
    "comb_score",
    "comb_order",
    "comb_level",
    "free_count_log",
    "free_share",
    *(f"free_{i}_{what}" for i in (1, 2) for what in ("excess", "level", "hz_log", "fs")),
    "pair_score",
    "pair_level",
    "pair_depth_log",
    "pair_hz_log",
    "pair_fs",
    "pair_side_order",
    "pair_off_order",
    "peaks_log",
    "tonal_share",
)
"""Keys of `measure`."""


@dataclass(frozen=True)
class Peaks:
    """Tones that stand out of a spectrum.

    Parameters
    ----------
    hz : Array [peaks]
        Interpolated frequencies, rising.
    power : Array [peaks]
        a^2 / 2 of each tone of amplitude a, unit squared.
    excess : Array [peaks]
        Power over the median floor about it.
    """

    hz: Array
    power: Array
    excess: Array

    def __len__(self) -> int:
        return int(self.hz.size)

    def of(self, chosen: NDArray[np.bool_]) -> Peaks:
        """Some of them."""
        return Peaks(self.hz[chosen], self.power[chosen], self.excess[chosen])


class Lines:
    """What `measure` and its neighbours need to know of a record's tones; each step computed once.

    Parameters
    ----------
    tones : Array [bins]
        Hann power spectrum, a sine of amplitude a at a^2 / 2.
    df_hz : float
        Distance of its bins, Hz.
    shaft_hz : float
        As stated.
    fault_hz : float or None
        Where a fault's impacts should lie at the stated speed.
    race_hz : tuple of float
        Ball-pass rates of the races at the stated speed.
    fs_hz : float or None
        Sampling rate, about half of which lines may have folded.
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
        at = np.flatnonzero(e[2:-2] > _PEAK) + 2
        at = at[(e[at] >= e[at - 1]) & (e[at] > e[at + 1])]
        # The side lobes of a strong tone are no peaks: -31 dB and falling, within a few bins.
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
        """[peaks] What each peak counts for in a comb: log10 of its excess over the threshold, capped."""
        return np.asarray(np.minimum(0.3 + np.log10(self.peaks.excess / _PEAK), 1.5))

    @cached_property
    def widths(self) -> Array:
        """[peaks] How far a peak's frequency may be off, Hz."""
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
        chance = float(np.median(score)) / max(float(self.weights.sum()), 1e-9) * len(self.peaks)
        beyond = float(np.count_nonzero(own)) - chance - 2.0
        if beyond < 2:
            return math.nan, max(beyond, 0.0), none
        return best, beyond, own

    @cached_property
    def lock(self) -> tuple[float, float]:
        """Shaft rate over the stated one, and how much speaks for it (0 nothing, 1 and more: two lines or more)."""
        use = ~(self.fault_comb[2] | self.of_mains) & (self.peaks.hz < _HIGHEST_ORDER * self.stated_hz)
        use &= ~self.alien_comb[2]
        first = self._locked_with(use)
        # Waviness may sit on whole orders of a wrong speed by chance: whose comb explains more?
        rival = np.zeros(len(self.peaks), bool)
        for base_hz in self.race_hz:
            ratio, score = self.wave(base_hz, SEARCH + SLIP / 2, use)
            if score > max(first[1], 0.6):
                rival |= self.on_comb(ratio * base_hz, highest=10)
        return self._locked_with(use & ~rival) if rival.any() else first

    @cached_property
    def alien_comb(self) -> tuple[float, float, NDArray[np.bool_]]:
        """Rate, strength and peaks of a comb that is neither the shaft's nor the fault's: impacts of something else.

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
        # A rate is proven by neighbouring multiples, not by any numbers that happen to fit.
        if np.count_nonzero(np.diff(k) == 1) < 2:
            return math.nan, 0.0, none
        base = float((k @ self.peaks.hz[own]) / (k @ k))
        strength = float(score[best] - self.weights[own].max())
        # By the same count: a gear's lines lie on the shaft's comb, however high their orders.
        shaft = np.linspace(1 - SEARCH, 1 + SEARCH, int(np.clip(6 * SEARCH * float(hz[-1]) / self.df_hz, 41, 4001)))
        rival = float(comb_scores(hz, weights, widths, shaft * self.stated_hz, 1e9, False).max())
        rival -= 5 * float(widths.mean()) * float(weights.sum()) / self.stated_hz
        # Of two combs that explain as much, the sparser one does not do so by chance.
        if strength < 1.0 or float(score[best]) < 0.95 * rival:
            return math.nan, 0.0, none
        if any(self.wave(race_hz, SEARCH + SLIP / 2, use)[1] > 0.85 * strength for race_hz in self.race_hz):
            return math.nan, 0.0, none
        return base, strength, use & self.on_comb(base, np.maximum(self.widths, 0.25 * self.df_hz))

    def wave(self, base_hz: float, reach: float, use: NDArray[np.bool_]) -> tuple[float, float]:
        """Rate of the comb about `base_hz` that holds most of the peaks, over `base_hz`, and how much it holds."""
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
        # Beyond some thirty orders any tone lies near a whole one at some speed.
        weights = self.weights[use] / (1 + hz / (30 * self.stated_hz))
        count = int(np.clip(8 * SEARCH * float(hz[-1]) / self.df_hz, 41, 4001)) | 1
        ratios = np.linspace(1 - SEARCH, 1 + SEARCH, count)
        score = comb_scores(hz, weights, widths, ratios * self.stated_hz, _HIGHEST_ORDER, False)
        preferred = score - 0.15 * np.abs(np.log(ratios)) / SEARCH
        best = float(ratios[int(np.argmax(preferred))])
        k = np.rint(hz / (best * self.stated_hz))
        own = (k >= 1) & (np.abs(hz - k * best * self.stated_hz) < 2.5 * widths)
        # One line lies on some comb at any speed: what the others add is what speaks for it.
        strength = float(score[int(np.argmax(preferred))] - (weights[own].max() if own.any() else 0.0))
        if own.any() and strength > 0.3:
            trust = 1 / widths[own] ** 2
            best = float((trust * k[own]) @ hz[own] / ((trust * k[own]) @ k[own])) / self.stated_hz
        return best, strength

    @property
    def locked(self) -> bool:
        """Whether the lines tell the shaft's rate."""
        return self.lock[1] >= _LOCKED

    @property
    def shaft_hz(self) -> float:
        """The shaft's rate: off its lines where they tell, else as stated."""
        return self.stated_hz * (self.lock[0] if self.locked else 1.0)

    def at(self, hz: Array, relative: float = 0.0, without: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """Largest power within `relative` of each frequency and one bin.

        Parameters
        ----------
        hz : Array [k]
        relative : float
            Half the width searched, as a part of the frequency.
        without : NDArray[bool] [peaks], optional
            Peaks to look past.

        Returns
        -------
        (Array [k], Array [k])
            log10 of its excess over what noise alone would show in as many bins, and the power of a tone there. NaN
            beyond the spectrum.
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


_LINES: WeakKeyDictionary[RecordView, Lines] = WeakKeyDictionary()


def lines_of(view: RecordView) -> Lines:
    """The tones of a record, found once however many ask."""
    found = _LINES.get(view)
    if found is None:
        fault_hz = None if view.fault_order is None else view.fault_order * view.shaft_hz
        races = (view.bearing.bpfo * view.shaft_hz, view.bearing.bpfi * view.shaft_hz)
        found = _LINES[view] = Lines(view.tones, view.df_hz, view.shaft_hz, fault_hz, races, view.fs_hz)
    return found


def measure(view: RecordView) -> dict[str, float]:
    """Signatures of tones.

    Parameters
    ----------
    view : RecordView

    Returns
    -------
    dict[str, float]
        `NAMES` -> value, NaN where it does not apply.
    """
    out = dict.fromkeys(NAMES, math.nan)
    if view.x.size < 64 or not np.isfinite(view.mean_square) or view.mean_square <= 0:
        return out
    lines, scale = lines_of(view), max(view.frame.scale, 1e-300)
    out["shaft_ratio_log"] = math.log(lines.lock[0]) if lines.locked else 0.0
    out["shaft_lock"] = lines.lock[1]
    base, strength, alien = lines.alien_comb
    out["comb_score"] = strength
    if strength > 0:
        out["comb_order"] = base / lines.shaft_hz
        out["comb_level"] = _level(float(lines.peaks.power[alien].sum()), scale)
    known = lines.fault_comb[2] | lines.of_mains | alien
    waves = _waviness(view, lines, scale, out)
    _orders(lines, scale, out, known | waves)
    _mains(lines, scale, out)
    known |= waves
    taken = known | (lines.on_comb(lines.shaft_hz / 2, highest=42) if lines.locked else _near_orders(lines))
    taken |= _gear(lines, scale, out, known)
    _pair(lines, view.fs_hz, scale, out, taken)
    total = max(view.mean_square, 1e-300)
    ratio, beyond, own = lines.fault_comb
    out["fault_comb_peaks"] = math.log1p(beyond) if view.fault_order is not None else math.nan
    if view.fault_order is not None:
        out["fault_comb_share"] = min(float(lines.peaks.power[own].sum()) / total, 1.0)
        out["fault_ratio_log"] = math.log(ratio) if math.isfinite(ratio) else math.nan
        base = view.fault_order * lines.stated_hz * (ratio if math.isfinite(ratio) else 1.0)
        out["fault_low_excess"] = _mean(lines.at(base * np.arange(1.0, 4.0), 0.002)[0])
    free = lines.peaks.of(~taken)
    out["free_count_log"] = math.log1p(len(free))
    out["free_share"] = min(float(free.power.sum()) / total, 1.0)
    strongest = np.argsort(free.power)[::-1]
    for i in (1, 2):
        if len(free) >= i:
            place = int(strongest[i - 1])
            out[f"free_{i}_excess"] = math.log10(free.excess[place])
            out[f"free_{i}_level"] = _level(free.power[place], scale)
            out[f"free_{i}_hz_log"] = math.log10(free.hz[place])
            out[f"free_{i}_fs"] = float(free.hz[place]) / view.fs_hz
        else:
            out[f"free_{i}_excess"] = math.log10(_PEAK)
    out["peaks_log"] = math.log1p(len(lines.peaks))
    out["tonal_share"] = min(float(lines.peaks.power.sum()) / total, 1.0)
    return out


def _near_orders(lines: Lines) -> NDArray[np.bool_]:
    """Peaks that the first three shaft orders may explain while the speed is only known to `SEARCH`."""
    order = lines.peaks.hz / lines.stated_hz
    k = np.clip(np.rint(order), 1, 3)
    return np.asarray(np.abs(order / k - 1) < 0.01)


def _orders(lines: Lines, scale: float, out: dict[str, float], without: NDArray[np.bool_]) -> None:
    """Whole and half orders of the shaft."""
    relative = 0.001 if lines.locked else SEARCH
    whole = np.arange(1.0, 11.0)
    logs, p = lines.at(whole * lines.shaft_hz, relative, without)
    levels = _levels(p, scale)
    for k in _WHOLE:
        out[f"order_{k}_excess"], out[f"order_{k}_level"] = float(logs[k - 1]), float(levels[k - 1])
    out["whole_high_mean"] = _mean(logs[3:])
    out["whole_high_level"] = _mean(levels[3:])
    strong = np.isfinite(logs) & (logs > 0.6)
    if np.count_nonzero(strong) >= 4:
        out["whole_decay"] = float(10 ** np.polyfit(whole[strong], levels[strong], 1)[0])
    logs, p = lines.at(np.array(_HALF) * lines.shaft_hz, relative if lines.locked else 0.02, without)
    for k, value in enumerate(logs, start=1):
        out[f"half_{k}_excess"] = float(value)
    out["half_mean"] = _mean(logs)
    out["half_level"] = _mean(_levels(p, scale))


def _mains(lines: Lines, scale: float, out: dict[str, float]) -> None:
    """Multiples of 50 and of 60 Hz."""
    k = np.arange(1.0, 7.0)
    means, found = [], []
    # What belongs to the shaft or the fault is no hum, unless it is the hum that looks like them.
    without = (lines.fault_comb[2] | (lines.on_comb(lines.shaft_hz / 2, highest=42) & lines.locked)) & ~lines.of_mains
    for hz in (50, 60):
        logs, p = lines.at(hz * k, 0.0, without)
        for i in (1, 2, 3):
            out[f"mains_{hz}_{i}_excess"] = float(logs[i - 1])
        own = _mean(logs[: 5 if hz == 50 else 4])
        out[f"mains_{hz}_mean"] = own
        means.append(own)
        found.append((logs, p))
    out["mains_peaks_50"], out["mains_peaks_60"] = lines.mains
    out["mains_is_60"] = means[1] - means[0]
    logs, p = found[int(means[1] > means[0])]
    levels = _levels(p, scale)
    out["mains_level"] = float(levels[0])
    strong = np.isfinite(logs) & (logs > 0.8)
    if np.count_nonzero(strong) >= 3:
        out["mains_decay"] = float(10 ** np.polyfit(k[strong], levels[strong], 1)[0])


def _waviness(view: RecordView, lines: Lines, scale: float, out: dict[str, float]) -> NDArray[np.bool_]:
    """Multiples of the ball-pass orders of both races."""
    taken = np.zeros(len(lines.peaks), bool)
    reach = SLIP if lines.locked else SEARCH + SLIP / 2
    free = ~(lines.of_mains | lines.alien_comb[2])
    if lines.locked:
        free &= ~lines.on_comb(lines.shaft_hz / 2, highest=42)
    for race, order in (("outer", view.bearing.bpfo), ("inner", view.bearing.bpfi)):
        # The fault's own comb has the lines of its race, which nobody can tell from waviness.
        own = view.condition.fault == race
        base = order * lines.shaft_hz
        ratio, strength = lines.wave(base, reach, free if own else free & ~lines.fault_comb[2])
        found = strength > 0.2
        out[f"wave_{race}_score"] = strength
        if found:
            out[f"wave_{race}_ratio_log"] = math.log(ratio)
        if strength > 0.6:
            taken |= lines.on_comb(base * ratio, highest=10)
        k = np.arange(1.0, 5.0)
        without = None if own else lines.fault_comb[2]
        logs, p = lines.at(k * base * (ratio if found else 1.0), 0.0 if found else reach / 3, without)
        levels = _levels(p, scale)
        out[f"wave_{race}_level"] = float(levels[0])
        strong = np.isfinite(logs) & (logs > 0.8)
        if np.count_nonzero(strong) >= 2:
            out[f"wave_{race}_decay"] = float(10 ** np.polyfit(k[strong], levels[strong], 1)[0])
    return taken


def _gear(lines: Lines, scale: float, out: dict[str, float], taken: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A whole order with a neighbour on either side and none two orders or half an order away."""
    none = np.zeros(len(lines.peaks), bool)
    top = int(min(_HIGHEST_ORDER, (lines.tones.size - 4) * lines.df_hz / lines.shaft_hz)) - 3
    if top < 11:
        return none
    order = lines.peaks.hz / lines.shaft_hz
    half = np.rint(2 * order)
    # Half of a bin and what an unlocked speed leaves.
    near = np.abs(lines.peaks.hz - half * lines.shaft_hz / 2) < 2.5 * lines.widths + lines.df_hz * 0.2
    near &= ~taken
    ladder, power = np.zeros(2 * top + 8), np.zeros(2 * top + 8)
    places = half[near].astype(int)
    inside = (places > 0) & (places < ladder.size)
    np.maximum.at(ladder, places[inside], np.log10(lines.peaks.excess[near][inside] / _PEAK) + 0.3)
    np.maximum.at(power, places[inside], lines.peaks.power[near][inside])
    z = np.arange(9, top + 1)
    capped = np.minimum(ladder, 2.5)
    side = capped[2 * z - 2] + capped[2 * z + 2]
    against = capped[2 * z - 4] + capped[2 * z + 4] + capped[2 * z - 1] + capped[2 * z + 1]
    double = np.where(4 * z < ladder.size, capped[np.minimum(4 * z, ladder.size - 1)], 0.0)
    score = np.where(capped[2 * z] > 0, capped[2 * z] + side - against + 0.5 * double, 0.0)
    # Side lines are never stronger than what they stand about.
    score -= 2.0 * (power[2 * z] < 0.9 * np.maximum(power[2 * z - 2], power[2 * z + 2]))
    best = int(np.argmax(score))
    out["gear_score"] = max(float(score[best]), 0.0) * min(lines.lock[1] / _LOCKED, 1.0)
    if out["gear_score"] < 0.8 or min(capped[2 * z[best] - 2], capped[2 * z[best] + 2]) <= 0:
        return none
    teeth = int(z[best])
    out["gear_teeth"] = float(teeth)
    out["gear_level"] = _level(power[2 * teeth], scale)
    sides = 0.5 * (math.sqrt(power[2 * teeth - 2]) + math.sqrt(power[2 * teeth + 2]))
    out["gear_depth_log"] = math.log10(max(2 * sides / math.sqrt(power[2 * teeth]), 1e-3))
    p = lines.at(np.array([2.0 * teeth * lines.shaft_hz]))[1]
    if np.isfinite(p[0]):
        out["gear_decay"] = float(np.sqrt(p[0] / power[2 * teeth]))
    whole = half / 2
    k = np.rint(whole / teeth)
    return np.asarray(near & (k >= 1) & (np.abs(whole - k * teeth) <= 1))


def _pair(lines: Lines, fs_hz: float, scale: float, out: dict[str, float], taken: NDArray[np.bool_]) -> None:
    """The strongest tone with two equal ones at equal distances: a modulated carrier, at whatever frequency."""
    out["pair_score"] = 0.0
    use = ~taken
    use &= lines.peaks.hz > 6 * lines.shaft_hz
    own, widths = lines.peaks.of(use), lines.widths[use]
    if len(own) < 3:
        return
    best, found = 0.0, (0, 0, 0)
    for centre in np.argsort(own.power)[::-1][:5]:
        distance = own.hz - own.hz[centre]
        above = np.flatnonzero((distance > 0.4 * lines.shaft_hz) & (distance < 12 * lines.shaft_hz))
        below = np.flatnonzero((distance < -0.4 * lines.shaft_hz) & (distance > -12 * lines.shaft_hz))
        if not above.size or not below.size:
            continue
        miss = np.abs(distance[above][:, None] + distance[below][None, :])
        allowed = 2.0 * np.hypot(widths[above][:, None], widths[below][None, :])
        unlike = np.abs(np.log(own.power[above][:, None] / own.power[below][None, :]))
        weaker = np.minimum(own.excess[above][:, None], own.excess[below][None, :])
        score = np.where((miss < allowed) & (unlike < 2.0), np.log10(weaker / _PEAK) + 0.3 - 0.2 * unlike, 0.0)
        # A carrier is not weaker than its side lines.
        score *= own.power[centre] > 0.7 * np.minimum(own.power[above][:, None], own.power[below][None, :])
        # Side lines of one modulation stand alone; those of a comb go on at twice the distance.
        spacing = 0.5 * (distance[above][:, None] - distance[below][None, :])
        onward = np.zeros(score.shape)
        for sign in (2.0, -2.0):
            target = own.hz[centre] + sign * spacing
            at = np.clip(np.searchsorted(own.hz, target), 1, len(own) - 1)
            nearest = np.minimum(np.abs(own.hz[at] - target), np.abs(own.hz[at - 1] - target))
            onward += nearest < 1.5 * lines.df_hz
        score = np.where(onward > 0, 0.3 * score / (1 + onward), score)
        place = int(np.argmax(score))
        i, j = divmod(place, below.size)
        value = float(score[i, j]) + 0.3 * math.log10(own.excess[centre] / _PEAK) if score[i, j] > 0 else 0.0
        if value > best:
            best, found = value, (int(centre), int(above[i]), int(below[j]))
    if best <= 0:
        return
    centre, high, low = found
    out["pair_score"] = best
    out["pair_level"] = _level(own.power[centre], scale)
    sides = math.sqrt(own.power[high]) + math.sqrt(own.power[low])
    out["pair_depth_log"] = math.log10(sides / math.sqrt(own.power[centre]))
    out["pair_hz_log"] = math.log10(own.hz[centre])
    out["pair_fs"] = float(own.hz[centre]) / fs_hz
    out["pair_side_order"] = float(own.hz[high] - own.hz[low]) / 2 / lines.shaft_hz
    order = float(own.hz[centre]) / lines.shaft_hz
    out["pair_off_order"] = abs(order - round(order))


def block_floor(power: Array, block: int = 32) -> Array:
    """[bins] The level between lines: medians of blocks, the middle of each three, interpolated in the logarithm."""
    n = power.size
    if n < 4 * block:
        return np.full(n, max(float(np.median(power)), 1e-300))
    count = n // block
    middles = medians(power[: count * block].reshape(count, block))
    floor = _between(middles, n, block)
    return np.asarray(np.exp(floor, out=floor))


@njit(cache=True, nogil=True, error_model="numpy")
def _between(middles, n, block):  # type: ignore[no-untyped-def]  # pragma: no cover
    """[n] Logarithm of smoothed medians of blocks, interpolated between their middles."""
    last = middles.size - 1
    logs, smooth = np.empty(middles.size), np.empty(middles.size)
    for i in range(middles.size):
        # Where lines fill a block, its neighbours speak for it; mean rather than median keeps the slope of a resonance.
        around = min(max(middles[max(i - 1, 0)], middles[min(i + 1, last)]), 1e300)
        logs[i] = math.log(max(min(middles[i], 2 * around), 1e-300))
    for i in range(middles.size):
        smooth[i] = 0.25 * logs[max(i - 1, 0)] + 0.5 * logs[i] + 0.25 * logs[min(i + 1, last)]
    out = np.empty(n)
    half = block // 2
    out[:half], out[half + last * block :] = smooth[0], smooth[last]
    for i in range(last):
        step = (smooth[i + 1] - smooth[i]) / block
        for j in range(block):
            out[half + i * block + j] = smooth[i] + step * j
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def comb_scores(hz, weights, widths, bases, highest, based):  # type: ignore[no-untyped-def]  # pragma: no cover
    """[candidates] Sum of the weights of the lines that lie on multiples of each base, less by their distance.

    With `based` a comb without its first line counts nothing.
    """
    out, first = np.zeros(bases.size), np.zeros(bases.size)
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
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def look_up(tones, floor, places, relative, logs, power):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Fill what `Lines.at` returns; places are frequencies in bins."""
    for i in range(places.size):
        place = places[i]
        reach = 1 + relative * place
        low, high = max(int(np.rint(place - reach)), 1), int(np.rint(place + reach)) + 1
        if high > tones.size - 2 or place < 1.5:
            continue
        best = low + int(np.argmax(tones[low:high]))
        # Neighbouring bins of a Hann window share a third of their noise.
        expected = (math.log((high - low) / 1.3) + 0.577) / math.log(2)
        logs[i] = math.log10(max(tones[best] / floor[best] / expected, 1e-3))
        power[i] = (tones[best - 1] + tones[best] + tones[best + 1]) / 1.5


def _levels(power: Array, scale: float) -> Array:
    return np.asarray(np.log10(np.sqrt(2 * np.maximum(power, 1e-300)) / scale))


def _level(power: float, scale: float) -> float:
    return math.log10(max(math.sqrt(2 * power) / scale, 1e-9))


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else math.nan
