"""Second impact on a defect, seen as a comb over the harmonics of the impact rate in all records of a set together.

power around each harmonic (`ImpactSpectrum`), measured and simulated, of every record
    --mean over the records of a fault, weighted by their clarity--> ratio over harmonics
    --smooth part, and the part that the noise of the same path shows too, taken out-->
    fitted by |1 + r exp(i k a)|^2 --> how much each comb explains, its delay and ratio

A second impact that follows at a fixed angle is a comb over harmonics at any speed, while the path is fixed in Hz. The
part of a few harmonics that a comb explains by chance falls with their number: `score` is scaled by its square root.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
import scipy.fft

from twingap.bearing import Bearing
from twingap.gap.features.impacts.impulse_response import ImpactSpectrum, standing_out
from twingap.gap.features.impacts.smooth_path import CANDIDATES, GRID, OverHarmonics, highest, log_likelihood_ratios
from twingap.records import Array
from twingap.signal.record_transforms import mean_of_five

_KINDS: Final = ("clear", "faint")
NAMES: Final[tuple[str, ...]] = tuple(
    f"{kind}_{name}"
    for kind in _KINDS
    for name in (
        "known", "gain", "score", "same", "opposed", "arc_log", "ratio", "smooth_path_gain", "smooth_path_ratio",
    )
)  # fmt: skip
"""Keys of `compare`: from harmonics that are each well above the noise ("clear"), and from all harmonics in stretches
that are ("faint")."""

_LEAST_PART: Final = 0.01
"""Shortest delay between the two impacts, part of a pass; the longest is half a pass, beyond which combs repeat."""
_RATIOS: Final = (0.1, 0.2, 0.35, 0.6, 0.9)
"""Second impact over first, as tried; beyond 1 combs repeat."""
_NOISE: Final = 0.01
"""Least residual variance of a log ratio, due to jitter: larger, and combs count for less."""
_LEAST_SCORE: Final = 1.5
"""Score from which a delay is reported: a mode that healthy records do not show exactly can reach as much."""
_DROWNED: Final = 2.0
"""Smallest total power of a record, in standard errors, so that records without detectable impacts do not dominate the
mean."""
_STANDING: Final = 4.0
"""Standard deviations above the noise from which a stretch of harmonics counts in full."""
_COUNTED: Final = 0.15
"""Weight below which a harmonic is left out: its logarithm is mostly noise."""
_JITTER: Final = (0.02, 0.01)
"""Least part of a harmonic's power in the minima of a comb (clear, faint ones): larger, and combs are shallower."""
_FEWEST: Final = 6.0
"""Sum of weights below which nothing is reported."""


def compare(
    real: Sequence[ImpactSpectrum], simulated: Sequence[ImpactSpectrum], bearing: Bearing, noise: Array | None = None
) -> dict[str, float]:
    """`NAMES` -> value of combs in the ratio of measured to simulated power over harmonics; NaN where it is not known.

    `known` ln of the number of harmonics; `gain` ln of what is left without a comb over what the best one leaves;
    `score` ln(1 + gain root of known); `same`, `opposed` the gain where the second impact has the sign of the first or
    the other; `arc_log` ln deg, `ratio` signed. `smooth_path_gain` ln(1 + log likelihood ratio) of the best comb where
    the path may be any smooth curve, `smooth_path_ratio` its ratio.

    `noise` [impulse_response.PLACES] is ln of the measured over the simulated spectrum of noise, which passes the same
    path: what the ratio of impacts shares with it is taken out.
    """
    out = dict.fromkeys(NAMES, math.nan)
    faults = sorted({s.fault for s in real} & {s.fault for s in simulated})
    for kind in _KINDS:
        ratios = [(fault, _over_harmonics(real, simulated, noise, fault, faint=kind == "faint")) for fault in faults]
        found = _comb([(fault, ratio) for fault, ratio in ratios if ratio.weight.sum() >= _FEWEST], bearing)
        out |= {f"{kind}_{name}": value for name, value in found.items()}
    return out


def _comb(ratios: Iterable[tuple[str, OverHarmonics]], bearing: Bearing) -> dict[str, float]:
    """Fit of the comb |1 + r exp(i k a)|^2 over harmonics k of a second impact, r times the first.

    All faults share r; each has its own delay.
    """
    before = known = 0.0
    after, over_path = np.zeros((2, 2, len(_RATIOS)))
    found: list[tuple[str, _Explained]] = []
    for fault, ratio in ratios:
        own = _explained(ratio)
        known += float(ratio.weight.sum())
        before += own.energy
        after += own.left
        over_path += log_likelihood_ratios(ratio, np.array(_RATIOS), _LEAST_PART)
        found.append((fault, own))
    if not found:
        return {}
    rest = _NOISE * known
    gain = np.log((before + rest) / (after + rest))
    i, j = (int(v) for v in np.unravel_index(int(np.argmax(gain)), gain.shape))
    best = float(gain[i, j])
    out = {
        "known": math.log(known), "gain": best, "score": math.log1p(max(best, 0.0) * math.sqrt(known)),
        "same": float(gain[0].max()), "opposed": float(gain[1].max()),
    }  # fmt: skip
    way, size = (int(v) for v in np.unravel_index(int(np.argmax(over_path)), over_path.shape))
    out["smooth_path_gain"] = math.log1p(max(float(over_path[way, size]), 0.0))
    out["smooth_path_ratio"] = (1.0 if way == 0 else -1.0) * _RATIOS[size]
    if out["score"] > _LEAST_SCORE:
        # Of the fault whose comb is clearest. A ball defect makes two impacts a turn.
        fault, plainest = max(found, key=lambda of: of[1].energy - of[1].left[i, j])
        per_pass = 180.0 if fault == "ball" else 360 / bearing.n_rollers
        out["arc_log"] = math.log(plainest.part[i, j] * per_pass)
        out["ratio"] = (1.0 if i == 0 else -1.0) * _RATIOS[j]
    return out


class _Explained(NamedTuple):
    """Weighted squares without a comb; [signs, ratios] with the best one of each kind, and its delay in passes."""

    energy: float
    left: Array
    part: Array


def _explained(ratio: OverHarmonics) -> _Explained:
    """Combs fitted to one fault's ratio, after the path and slow variation over harmonics are removed from both."""
    seen = np.flatnonzero(ratio.weight)
    root, place = np.sqrt(ratio.weight[seen]), (seen + 1) / ratio.weight.size
    smooth = [np.ones(seen.size), place, place**2]
    if np.ptp(ratio.path[seen]) > 0:
        smooth.append(ratio.path[seen])
    basis, _ = np.linalg.qr((np.stack(smooth) * root).T)
    target = root * ratio.log[seen]
    target = target - basis @ (basis.T @ target)
    energy = float(target @ target)
    # ln |1 + r exp(i k a)|^2 = 2 r cos(k a) - r^2 cos(2 k a) + ...: delays where the first term is strong.
    size = scipy.fft.next_fast_len(GRID * ratio.weight.size)
    weighted = np.zeros(size)
    weighted[seen + 1] = root * target
    first = scipy.fft.rfft(weighted).real[: size // 2 + 1]
    least = max(int(np.ceil(_LEAST_PART * size)), 1)
    left, part = np.zeros((2, 2, len(_RATIOS)))
    for row, sign in enumerate((1.0, -1.0)):
        at = least + highest(sign * first[least:], CANDIDATES)
        phase = np.exp(2j * np.pi * np.outer(at / size, seen + 1))
        combs = np.array([np.abs(1 + sign * r * phase) ** 2 for r in _RATIOS])
        combs = root * np.log(combs + ratio.noise[seen])
        slow = combs @ basis
        rest = energy - 2 * combs @ target + (combs**2).sum(axis=-1) - (slow**2).sum(axis=-1)
        best = rest.argmin(axis=1)
        left[row], part[row] = rest[np.arange(len(_RATIOS)), best], at[best] / size
    return _Explained(energy, left, part)


def _over_harmonics(
    real: Sequence[ImpactSpectrum], simulated: Sequence[ImpactSpectrum], noise: Array | None, fault: str, *, faint: bool
) -> OverHarmonics:
    """Ratio of the mean power around the harmonics of one fault.

    With `faint`, a harmonic counts where its neighbours are above the noise: the minima of a comb hold noise alone, and
    are what shows it.
    """
    logs, weights, noises = [], [], []
    for own in (real, simulated):
        power, error = _mean([s for s in own if s.fault == fault])
        about = mean_of_five(np.maximum(power, 0.0))
        noises.append(np.clip(error / np.maximum(about, 0.1 * error + 1e-300), 0.0, 3.0))
        if faint:
            logs.append(np.log(np.maximum(np.maximum(power, error), 1e-12)))
            weights.append(standing_out(about, error, clear=_STANDING))
        else:
            logs.append(np.log(np.maximum(power, 1e-12)))
            weights.append(standing_out(power, error))
    both = min(log.size for log in logs)
    path = np.zeros(both) if noise is None else _on_path([s for s in simulated if s.fault == fault], noise)[:both]
    weight = np.minimum(*(w[:both] for w in weights))
    filled = _JITTER[1] + noises[0][:both] if faint else np.full(both, _JITTER[0])
    return OverHarmonics(logs[0][:both] - logs[1][:both], np.where(weight > _COUNTED, weight, 0.0), filled, path)


def _mean(kept: Sequence[ImpactSpectrum]) -> tuple[Array, Array]:
    """[harmonics] Mean power of records as loud as one another, and its error; as far as half of the records reach.

    Records are weighted by inverse variance, so that records without detectable impacts do not hide the others'.
    """
    most = max(s.power.size for s in kept)
    power, squares, weights, count = np.zeros((4, most))
    for s in kept:
        loud = max(float(s.power.sum()), _DROWNED * float(np.sqrt((s.error**2).sum())), 1e-300)
        weight = 1 / max(float(np.mean((s.error / loud) ** 2)), 1e-12)
        own = slice(0, s.power.size)
        power[own] += weight * s.power / loud
        squares[own] += (weight * s.error / loud) ** 2
        weights[own] += weight
        count[own] += 1
    reached = int((count >= 0.5 * len(kept)).sum())
    return power[:reached] / weights[:reached], np.sqrt(squares[:reached]) / weights[:reached]


def _on_path(simulated: Sequence[ImpactSpectrum], noise: Array) -> Array:
    """[harmonics] ln of what the mean power of simulated impacts would be over what it is, were the path the noise's.

    A harmonic's frequency changes with speed; the path is weighted by the harmonic's power there.
    """
    most = max(s.power.size for s in simulated)
    before, after = np.full((2, most), 1e-300)
    for s in simulated:
        loud = np.maximum(s.power, s.error) / max(float(np.maximum(s.power, s.error).sum()), 1e-300)
        before[: loud.size] += loud
        after[: loud.size] += loud * np.exp(noise[s.places])
    return np.asarray(np.log(after / before))
