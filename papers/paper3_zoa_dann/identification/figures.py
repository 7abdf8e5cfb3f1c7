"""Figures of the identification study, in colours that colour-blind readers tell apart (Okabe and Ito 2008)."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from papers.arrays import Array
from papers.figures import LINE_NAMES, name_axes, subplots
from papers.framework import Work
from papers.paper3_zoa_dann.identification.agreement import aligned
from papers.paper3_zoa_dann.identification.jobs import WORDS
from twingap import RecordSet
from twingap.signal.envelope import squared_envelope_spectrum

LINES: Final = {
    "zoa": ("#D55E00", "-"),
    "zoa-ports": ("#E69F00", "--"),
    "differential-evolution": ("#0072B2", "-."),
    "random": ("#666666", ":"),
}
MEASURED, SIMULATED, MARK = "#444444", "#0072B2", "#D55E00"
SHOWN_S: Final = 0.1  # length of the waveforms shown, s: three turns
HIGHEST_HZ: Final = 520.0


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    yield "identification-convergence", convergence(work)
    for setting in work.options.settings:
        yield f"identification-signals-{setting}", signals(work, work["halves"][1], setting)


def convergence(work: Work) -> Figure:
    """Least cost against evaluations, median over seeds and the range of the middle half."""
    options = work.options
    rows, columns = len(options.settings), len(options.faults)
    figure, panels = subplots((4.6 * columns, 3.9 * rows + 1.2), rows, columns, squeeze=False, sharex=True)
    for row, setting in enumerate(options.settings):
        for column, fault in enumerate(options.faults):
            panel = panels[row, column]
            here = [r for r in work["searches"] if (r.job.fault, r.job.setting) == (fault, setting)]
            for optimiser in dict.fromkeys(r.job.optimiser for r in here):
                curves = np.array([r.value["best"] for r in here if r.job.optimiser == optimiser])
                low, middle, high = np.quantile(curves, [0.25, 0.5, 0.75], axis=0)
                colour, style = LINES.get(optimiser, ("#009E73", "-"))
                at = np.arange(1, middle.size + 1)
                panel.fill_between(at, low, high, color=colour, alpha=0.15, lw=0)
                panel.plot(at, middle, style, color=colour, lw=2.4, label=WORDS.get(optimiser, optimiser))
            least = min(float(r.value["best"][-1]) for r in here)
            start = np.quantile([r.value["best"][min(15, len(r.value["best"]) - 1)] for r in here], 0.9)
            panel.set(ylim=(least - 0.04 * (start - least), start), title=f"{fault}, {setting} setting")
            panel.grid(color="0.9")
    name_axes(panels, "evaluations", "relative error of spectra")
    runs = len({r.job.seed for r in work["searches"]})
    figure.suptitle(f"Search for stiffness and damping, {work.title}: median and middle half of {runs} runs")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def signals(work: Work, judge: RecordSet, setting: str) -> Figure:
    """Waveforms and envelope spectra, measured and simulated, with the theoretical fault frequencies."""
    faults = work.options.faults
    wanted = f"identified, {WORDS['differential-evolution']}"
    figure, panels = subplots((14.5, 3.9 * len(faults) + 1.2), len(faults), 2, squeeze=False, width_ratios=(1, 1.25))
    for row, fault in enumerate(faults):
        (found,) = (
            r for r in work["comparisons"] if (r.job.fault, r.job.setting, r.job.twin) == (fault, setting, wanted)
        )
        record = judge[[c.fault for c in judge.conditions].index(fault)]
        simulated, fs_hz = np.asarray(found.value["simulated"], float), record.condition.fs_hz
        _waveforms(panels[row, 0], record.samples, simulated, fs_hz)
        name, shaft_hz = LINE_NAMES[fault], record.condition.speed_rpm / 60
        fault_hz = work["halves"][0].bearing.fault_order(fault) * record.condition.speed_rpm / 60
        _envelopes(panels[row, 1], record.samples, simulated, fs_hz, fault_hz, shaft_hz, name)
        title = f"{fault}: K = {found.job.stiffness:.2e} N/m$^{{1.5}}$, c = {found.job.damping:.0f} N s/m"
        panels[row, 0].set_title(title)
        panels[row, 1].set_title(f"{name} = {fault_hz:.1f} Hz")
    panels[-1, 0].set_xlabel("time (ms)")
    panels[-1, 1].set_xlabel("frequency (Hz)")
    figure.legend(*panels[0, 1].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    size = f"{work.options.fault_size_inch:g} in"
    figure.suptitle(f"{work.title}, {size}, the half of the recording that was not fitted; {setting} setting")
    return figure


def _waveforms(panel: Any, measured: Array, simulated: Array, fs_hz: float) -> None:
    """One above the other, each in units of its own RMS, the simulated one shifted in time to where it fits best."""
    count = round(SHOWN_S * fs_hz)
    top = measured[:count] / measured.std()
    # The best stretch of the simulated record: its phase is nobody's prediction.
    low = aligned(np.pad(top, (0, simulated.size - count))[None], simulated[None])[0][:count] / simulated.std()
    gap = 1.1 * (np.abs(top).max() + np.abs(low).max())
    at = 1e3 * np.arange(count) / fs_hz
    panel.plot(at, top + gap, color=MEASURED, lw=1.0)
    panel.plot(at, low, color=SIMULATED, lw=1.0)
    panel.set_yticks([0, gap], ["simulated", "measured"], rotation=90, va="center")
    panel.set(xlim=(0, at[-1]), ylabel="acceleration / RMS")


def _envelopes(
    panel: Any, measured: Array, simulated: Array, fs_hz: float, fault_hz: float, shaft_hz: float, name: str
) -> None:
    """Squared-envelope spectra, measured upwards and simulated downwards, theoretical lines between them."""
    for samples, sign, colour, label in (
        (measured, 1, MEASURED, "measured (upwards)"),
        (simulated, -1, SIMULATED, "simulated (downwards)"),
    ):
        spectrum = squared_envelope_spectrum(samples, fs_hz)
        inside = (spectrum.frequency > 2) & (spectrum.frequency < HIGHEST_HZ)
        hz, values = spectrum.frequency[inside], spectrum.values[inside]
        panel.plot(hz, sign * values / values.max(), color=colour, lw=1.3, label=label, zorder=3)
    harmonics = range(1, int(HIGHEST_HZ / fault_hz) + 1)
    marks = [(n * fault_hz, f"{n if n > 1 else ''} {name}".strip(), "--") for n in harmonics]
    marks.append((shaft_hz, "$f_r$", ":"))
    for place, (at, text, style) in enumerate(marks):
        panel.axvline(at, color=MARK, ls=style, lw=1.5, zorder=1, label="theoretical frequency" if place == 0 else None)
        panel.annotate(
            text.replace("2 2 BSF", "4 BSF").replace("3 2 BSF", "6 BSF"), (at, 1.2), ha="center", va="bottom",
            color=MARK, fontsize=13, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
        )  # fmt: skip
    panel.set(ylim=(-1.1, 1.5), xlim=(0, HIGHEST_HZ))
    panel.set_yticks([-1, 0, 1], ["1", "0", "1"])
    panel.set_ylabel("envelope line / highest")
