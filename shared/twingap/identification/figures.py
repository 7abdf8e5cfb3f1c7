"""Figures of a fit: measured and fitted spectra, one panel per state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twingap.files import replacing
from twingap.identification.result import Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito 2008: distinct with any colour vision, and in grey by lightness and line style.
MEASURED, FITTED, MARK, BAND = "#8a8a8a", "#0072B2", "#D55E00", "#f0e9c8"
MOST_PANELS = 8


def figure_of_fit(fits: Sequence[Fit]) -> Figure:
    """Measured and fitted power spectral densities, with the resonance marked.

    Parameters
    ----------
    fits : sequence of Fit
        At least one; the first eight are drawn.

    Returns
    -------
    Figure
    """
    from matplotlib.figure import Figure

    shown = list(fits)[:MOST_PANELS]
    columns = 1 if len(shown) == 1 else 2
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(5.6 * columns, 3.3 * rows), layout="constrained", dpi=150)
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis, fit in zip(axes.flat, shown, strict=False):
        inside = slice(1, -1)
        f = fit.f_hz[inside] / 1000
        axis.semilogy(f, fit.measured[inside], color=MEASURED, linewidth=0.8, label="measured")
        if fit.band:
            low, high = fit.f_hz[np.flatnonzero(fit.used)[[0, -1]]] / 1000
            axis.axvspan(low, high, color=BAND, linewidth=0, label="band of the fit")
        elif not fit.used[inside].all():
            left = np.where(fit.used, np.nan, fit.measured)[inside]
            axis.semilogy(f, left, ".", color="black", markersize=2, label="lines, not in the fit")
        axis.semilogy(f, fit.fitted[inside], color=FITTED, linewidth=1.6, label="fitted twin")
        label = f"resonance, {fit.resonance_hz:.0f} Hz"
        axis.axvline(fit.resonance_hz / 1000, color=MARK, linestyle="--", linewidth=1, label=label)
        axis.set_title(fit.title, fontsize=10)
        axis.set_xlabel("frequency, kHz")
        axis.set_ylabel(f"PSD, {_psd_unit(fit.unit)}")
        axis.set_xlim(0, fit.f_hz[-1] / 1000)
        high = fit.measured[inside].max()
        axis.set_ylim(max(fit.measured[inside].min() / 2, high * 1e-9), 2 * high)
        axis.legend(fontsize=7, frameon=False, loc="best")
    for axis in axes.flat[len(shown) :]:
        axis.remove()
    return figure


def write_figure(path: Path, fits: Sequence[Fit]) -> None:
    """Draw the fit into a file, whole or not at all; the same fit gives the same bytes."""
    figure = figure_of_fit(fits)
    with replacing(path) as temporary:
        figure.savefig(temporary, metadata={"Software": "twingap"})


def _psd_unit(unit: str) -> str:
    """Of a power spectral density."""
    return {"m/s^2": "(m/s²)²/Hz", "g": "g²/Hz"}.get(unit, "unit²/Hz")
