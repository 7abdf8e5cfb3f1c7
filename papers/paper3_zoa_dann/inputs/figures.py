"""Figure of the study of inputs, in colours that colour-blind readers tell apart (Okabe and Ito 2008; cividis)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from papers.figures import LINE_NAMES, subplots
from papers.framework import Work
from papers.paper3_zoa_dann.inputs.options import Options
from papers.paper3_zoa_dann.source import simulate
from twingap.adapt import VIEWS, Windows
from twingap.adapt.views import ORDERS

if TYPE_CHECKING:
    from papers.paper3_zoa_dann.inputs.jobs import TaskResult


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "spectra", spectra(work["results"][0], work.options, work.title)


def spectra(result: TaskResult, options: Options, data: str) -> Figure:
    """Why classes confuse: mean spectra and envelope spectra of simulated and measured windows, class by class."""
    classes = options.target.classes
    source, target = simulate(result.recipe), result.measured.evaluate
    figure, panels = subplots((13.5, 3.0 * len(classes) + 1.2), len(classes), 2, sharex="col", squeeze=False)
    styles = (("simulated (contact twin)", source, "#0072B2", 2.4), (f"measured ({data})", target, "#D55E00", 1.3))
    for place, name in enumerate(classes):
        for label, windows, colour, width in styles:
            assert windows.labels is not None
            own = windows.take(windows.labels == place)
            khz, level = _mean_spectrum(own)
            panels[place, 0].plot(khz, level, color=colour, lw=width, label=label)
            panels[place, 1].plot(ORDERS, VIEWS["envelope_spectrum"](own).mean(axis=0), color=colour, lw=width)
        if name != "healthy":
            order = result.recipe.bearing.fault_order(name)
            for harmonic in range(1, int(ORDERS[-1] / order) + 1):
                panels[place, 1].axvline(harmonic * order, color="0.5", ls=":", lw=1.4, zorder=0)
            panels[place, 1].set_title(f"dotted: {LINE_NAMES[name]} = {order:.2f} orders, and harmonics")
        panels[place, 0].set_ylabel(f"{name}\nPSD (dB re highest)")
        panels[place, 1].set_ylabel("ln(1 + line / median)\n(no unit)")
    panels[0, 0].set_title("mean power spectral density")
    panels[0, 1].set_title("mean envelope spectrum")
    panels[-1, 0].set_xlabel("frequency (kHz)")
    panels[-1, 1].set_xlabel("order (multiples of shaft speed)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.suptitle(f"Windows of unit variance, {result.task.title}")
    return figure


def _mean_spectrum(windows: Windows) -> tuple[Any, Any]:
    x = VIEWS["waveform"](windows)
    power = np.abs(np.fft.rfft(x * np.hanning(x.shape[1]), axis=1)) ** 2
    smooth = np.convolve(power.mean(axis=0), np.full(9, 1 / 9), mode="same")[4:-4]
    khz = np.fft.rfftfreq(x.shape[1], 1e3 / windows.fs_hz[0])[4:-4]
    return khz, 10 * np.log10(smooth / smooth.max())
