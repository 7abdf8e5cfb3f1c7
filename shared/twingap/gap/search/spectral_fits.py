"""Values of effects that spectra tell in closed form, for searches to begin at.

healthy spectrum --low-pass x mode; noise band + mode + white noise, all over a grid--> the likeliest few
spectra --two modes, with or against each other--> the likeliest

A low-pass of the wrong order is made up for by a mode of the wrong damping, and a band of noise by a wide mode: no
single step leads out of that, so they are sought together with the mode that goes with them.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import ColouredNoise, Effect, SecondResonance, SensorRolloff
from twingap.gap.features.spectrum.path import two_modes
from twingap.identify.baseline import BANDS, Side, mode_density, sides_of
from twingap.identify.calibrate import thinned
from twingap.twins.twin_file import flat

if TYPE_CHECKING:
    from twingap.gap.search.evidence import Evidence

Array = NDArray[np.float64]

_ORDERS: Final = (1, 2, 3, 5)
_CORNERS: Final = np.geomspace(0.02, 0.8, 14)
"""Of the sampling rate."""
_BACKGROUNDS: Final = (0.0, 0.8, 0.95, 0.985, 1.0)
_PLACES: Final = (-0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1)
"""Of the mode, about where it was calibrated to be and about the highest peak: logarithms."""
_WIDTHS: Final = (0.01, 0.018, 0.03, 0.05, 0.09, 0.16)
"""Damping ratios of the mode."""
_LOWS: Final = np.geomspace(0.004, 0.42, 16)
_HIGHS: Final = np.geomspace(0.02, 0.5, 16)
"""Ends of bands of noise, of the sampling rate."""
_SLOPES: Final = (-1.0, 0.0, 1.0, 2.0)
_LIKELIEST: Final = 5


def likeliest_losses(evidence: Evidence, given: SensorRolloff) -> list[Effect]:
    """The low-passes that explain the healthy spectra best, each with the mode and the levels that suit it.

    The spectrum of a twin with a low-pass is known in closed form: loss times (structure noise through its mode, and
    the part of the white noise that the sensor hears), plus white noise behind it; that of a simulator of the user's
    own, loss times what it has. What other effects add is not in it.
    """
    spec = evidence.calibrated.spec
    side = _healthiest(evidence)
    if side is None:
        return []
    inside = slice(2, int(0.92 * BANDS))
    f = (np.arange(BANDS) + 0.5) / (2 * BANDS)
    wanted = side.psd[inside] * side.fs_hz
    wanted = np.maximum(wanted, 1e-9 * wanted.max())  # a band in which a coarse converter shows nothing
    if spec is not None and spec.model == "phenomenological":
        centres = (float(flat(spec.parameters)["resonance_hz"]), side.peak_hz)
        modes = np.array([
            mode_density(centre * math.exp(shift), width, side.fs_hz)[inside] * side.fs_hz
            for centre in centres for shift in _PLACES for width in _WIDTHS
        ])  # fmt: skip
    else:  # waveforms that are finished, or another model's: whatever is in them passes the sensor
        modes = None
        bare = np.maximum(evidence.bare_psd(side)[inside] * side.fs_hz, 1e-300)
    scored: list[tuple[float, int, float, float]] = []
    for order in _ORDERS:
        for corner in _CORNERS:
            loss = 1 / (1 + (f[inside] / corner) ** (2 * order))
            if modes is None:
                scored.append((_misfit_at_any_level(bare * loss, wanted), order, float(corner), given.background))
                continue
            for background in _BACKGROUNDS:
                white = 2 * (background * loss + 1 - background)
                scored.append((_misfit(modes * loss, white, wanted), order, float(corner), background))
    return [
        dataclasses.replace(given, order=order, corner_hz=corner * side.fs_hz, background=background)
        for _, order, corner, background in sorted(scored)[:_LIKELIEST]
    ]


def likeliest_noises(evidence: Evidence, given: ColouredNoise) -> list[ColouredNoise]:
    """The bands and slopes of noise that explain the healthy spectra best, beside a mode and white noise to suit.

    A simulator of the user's own has one level in their place.
    """
    side = _healthiest(evidence)
    if side is None:
        return []
    inside = slice(1, int(0.92 * BANDS))
    f = ((np.arange(BANDS) + 0.5) / (2 * BANDS))[inside]
    wanted = np.maximum(side.psd[inside] * side.fs_hz, 1e-9 * side.psd[inside].max() * side.fs_hz)
    spec = evidence.calibrated.spec
    if spec is not None and spec.model == "phenomenological":
        centres = (float(flat(spec.parameters)["resonance_hz"]), side.peak_hz)
        white = np.full(f.size, 2.0)
        own = [
            np.stack([side.fs_hz * mode_density(centre * math.exp(shift), width, side.fs_hz)[inside], white])
            for centre in centres for shift in (-0.03, 0.0, 0.03) for width in _WIDTHS
        ]  # fmt: skip
    else:
        bare = np.maximum(evidence.bare_psd(side)[inside], 1e-300)
        own = [2 * bare[None] / bare.mean()]
    scored: list[tuple[float, float, float, float, float]] = []
    for low, high in itertools.product(_LOWS, _HIGHS):
        if high < 1.2 * low:
            continue
        for slope in _SLOPES:
            shape = np.where((f >= low) & (f <= high), f**-slope, 0.0)
            if not shape.any():
                continue
            band = 2 * shape / (shape.sum() / (2 * BANDS) * 2)
            found, powers = _least_misfit(np.stack([np.concatenate((rest, band[None])) for rest in own]), wanted)
            if powers[-1] > 0 and powers[:-1].sum() > 0:
                scored.append((found, float(low), float(high), slope, math.sqrt(powers[-1] / powers[:-1].sum())))
    return [
        dataclasses.replace(given, level=level, slope=slope, low_hz=low * side.fs_hz, high_hz=high * side.fs_hz)
        for _, low, high, slope, level in sorted(scored)[:_LIKELIEST]
    ]


def _least_misfit(basis: Array, wanted: Array) -> tuple[float, Array]:
    """Of sums of spectra `basis` [choices, spectra, bands]: least mean square log ratio of `wanted`, and its powers.

    Powers [spectra] by least squares of relative errors; choices in which one would be negative are none.
    """
    a = basis / wanted
    size = np.sqrt((a**2).sum(axis=2, keepdims=True)) + 1e-300
    a = a / size
    square = a @ a.transpose(0, 2, 1) + 1e-9 * np.eye(basis.shape[1])
    powers = np.linalg.solve(square, a.sum(axis=2)[:, :, None])[:, :, 0]
    rest = np.log(np.maximum(np.einsum("cs,csb->cb", powers, a), 1e-6))
    misfit = np.where((powers >= 0).all(axis=1), np.minimum(rest**2, 1.0).mean(axis=1), np.inf)
    best = int(np.argmin(misfit))
    found = powers[best] / size[best, :, 0]
    return float(misfit[best]), found if np.isfinite(misfit[best]) else np.zeros(basis.shape[1])


def _healthiest(evidence: Evidence) -> Side | None:
    """Spectra of the healthy records, where there are any with something in them."""
    sides = [s for s in sides_of(list(thinned(evidence.calibrated.fit, 6)), evidence.frame) if s.fault == "healthy"]
    side = max(sides, key=lambda s: len(s.conditions), default=None)
    return side if side is not None and side.psd.max() > 0 else None


def likeliest_modes(evidence: Evidence, given: SecondResonance) -> list[SecondResonance]:
    """The second modes that explain the spectra best, in step with the first and opposed; either may be the twin's."""
    spec = evidence.calibrated.spec
    if spec is None or spec.model != "phenomenological":
        return []
    fs_hz = min(c.fs_hz for c in evidence.fit.conditions)
    out = []
    for pair in two_modes(evidence.fit.outlines):
        for place, damping, gain in zip(pair.places, pair.dampings, (1 / pair.gain, pair.gain), strict=True):
            one = dataclasses.replace(
                given, frequency_hz=place * fs_hz, damping_ratio=damping, gain=abs(gain), opposed=gain < 0
            )
            out += [one] if evidence.fits(one) else []
    return out


def _misfit(modes: Array, white: Array, wanted: Array) -> float:
    """Least mean square log ratio of `wanted` [bands] to sums of a row of `modes` [modes, bands] and of white noise."""
    weight = 1 / wanted
    a, b = modes * weight, white * weight
    aa, ab, bb = (a * a).sum(axis=1), a @ b, float(b @ b)
    sa, sb = a.sum(axis=1), float(b.sum())
    determinant = np.maximum(aa * bb - ab**2, 1e-300)
    structure, noise = (sa * bb - sb * ab) / determinant, (sb * aa - sa * ab) / determinant
    # Neither power is negative: where one would be, the other stands alone.
    structure, noise = (
        np.where(noise < 0, sa / aa, np.maximum(structure, 0.0)),
        np.where(structure < 0, sb / bb, np.maximum(noise, 0.0)),
    )
    model = structure[:, None] * a + noise[:, None] * b
    return float(np.minimum(np.log(np.maximum(model, 1e-6)) ** 2, 1.0).mean(axis=1).min())


def _misfit_at_any_level(model: Array, wanted: Array) -> float:
    """Mean square log ratio [bands] of `wanted` to the multiple of `model` that most bands suit."""
    rest = np.log(wanted / model)
    return float(np.minimum((rest - np.median(rest)) ** 2, 1.0).mean())
