"""Dynamics study, its tables and figures: a normal bearing that settles (5 and 6 of the paper), and injected faults."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from papers.figures import LINE_NAMES, subplots
from papers.framework import Rows, Step, Study, Work, as_input, as_table
from papers.paper2_digital_twin.dynamics import jobs

DATA: Final = "simulated by the contact twin"


@as_table
def balance(work: Work) -> Rows:
    """Where each normal bearing settles against the static Hertz solution, and the rest of the checks. ``settled s`` is
    empty where the ring leaves the stated part of the static displacement in the judged part; ``apart`` is the relative
    RMS difference to SciPy's DOP853, worst of x and y."""
    for r in work["healthy"]:
        v = r.value
        yield {
            "setting": r.job.setting, "speed_rpm": r.job.speed_rpm, "load_n": r.job.load_n,
            "clearance_um": r.job.clearance_um, "x mean um": v["mean_x_um"], "x static um": v["still_x_um"],
            "y mean um": v["mean_y_um"], "y static um": v["still_y_um"],
            "furthest from static %": v["most_off_percent"], "settled s": v["settled_s"],
            "vx rms mm/s": v["speed_rms_mm_s"][0], "vy rms mm/s": v["speed_rms_mm_s"][1],
            "energy residual %": v["energy_residual_percent"],
            "displacement apart %": max(v["apart_percent"][:2]), "velocity apart %": max(v["apart_percent"][2:]),
            "data": DATA,
        }  # fmt: skip


@as_table
def faults(work: Work) -> Rows:
    """Orders found in squared envelope spectra; ``on time`` is the nearest line within the spectrum's resolution."""
    for r in work["faulty"]:
        v = r.value
        yield {
            "setting": r.job.setting, "fault": r.job.fault, "speed_rpm": r.job.speed_rpm, "load_n": r.job.load_n,
            "clearance_um": r.job.clearance_um, "order expected": v["expected"], "order found": v["found"],
            "on time": bool(abs(v["found"] - v["expected"]) <= v["resolution"]), "strongest order": v["strongest"],
            "line over median": v["height"], "rms m/s^2": v["rms"], "rms over healthy": v["rms"] / v["healthy_rms"],
            "data": DATA,
        }  # fmt: skip


ALONG, ACROSS, STATIC, MARK = "#0072B2", "#E69F00", "#444444", "#D55E00"
SHOWN_S: Final = 0.1


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    for setting in work.options.settings:
        yield f"dynamics-normal-{setting}", normal(work, setting)
        yield f"dynamics-reference-{setting}", against_reference(work, setting)
        yield f"dynamics-faults-{setting}", injected(work, setting)


def normal(work: Work, setting: str) -> Figure:
    """Displacement and velocity in x and y from rest at the centre: the counterpart of figure 5."""
    shown = next(r for r in work["healthy"] if r.job.setting == setting)
    t, state = 1e3 * np.asarray(shown.value["t_s"]), np.asarray(shown.value["state"])
    figure, panels = subplots((12, 7), 2, 2, sharex=True)
    for column, (name, colour) in enumerate((("x (across the load)", ACROSS), ("y (along the load)", ALONG))):
        panels[0, column].plot(t, 1e6 * state[column], color=colour, lw=1.2, label="RK4")
        at, still = 1e3 * np.asarray(shown.value["still_t_s"]), np.asarray(shown.value["still"])[column]
        panels[0, column].plot(at, 1e6 * still, "--", color=STATIC, lw=1.6, label="static Hertz solution")
        panels[1, column].plot(t, 1e3 * state[2 + column], color=colour, lw=1.2)
        panels[0, column].set_title(name)
        panels[0, column].legend()
        panels[1, column].set_xlabel("time (ms)")
    panels[0, 0].set_ylabel("displacement (µm)")
    panels[1, 0].set_ylabel("velocity (mm/s)")
    for panel in panels.flat:
        panel.grid(color="0.9")
    figure.suptitle(
        f"Normal bearing settling to balance, {setting} preset: {shown.job.load_n:g} N, "
        f"{shown.job.clearance_um:g} µm clearance, {shown.job.speed_rpm:g} rpm (simulated)"
    )
    return figure


def against_reference(work: Work, setting: str) -> Figure:
    """The first milliseconds beside SciPy's integration of equations written anew: in the place of figure 6."""
    shown = next(r for r in work["healthy"] if r.job.setting == setting)
    theirs = np.asarray(shown.value["theirs"])
    count = theirs.shape[1]
    t, ours = 1e3 * np.asarray(shown.value["t_s"])[:count], np.asarray(shown.value["state"])[:, :count]
    figure, panels = subplots((12, 7), 2, 2, sharex=True)
    labels = ("x (µm)", "y (µm)", "velocity in x (mm/s)", "velocity in y (mm/s)")
    for place, panel in enumerate(panels.flat):
        unit = 1e6 if place < 2 else 1e3
        panel.plot(t, unit * theirs[place], color=MARK, lw=4, alpha=0.45, label="SciPy DOP853, equations written anew")
        panel.plot(t, unit * ours[place], color=ALONG, lw=1.2, label="RK4 kernel of the twin")
        panel.set_ylabel(labels[place])
        panel.grid(color="0.9")
    for panel in panels[1]:
        panel.set_xlabel("time (ms)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.suptitle(f"Two integrations of one model, {setting} preset (simulated)")
    return figure


def injected(work: Work, setting: str) -> Figure:
    """Acceleration with an injected fault, and its envelope spectrum with the theoretical order."""
    wanted = [
        next(r for r in work["faulty"] if (r.job.setting, r.job.fault) == (setting, f)) for f in work.options.faults
    ]
    figure, panels = subplots((13, 3.1 * len(wanted) + 0.8), len(wanted), 2, squeeze=False, sharex="col")
    for row, r in enumerate(wanted):
        samples, fs_hz = np.asarray(r.value["samples"], float), work.options.fs_hz
        count = round(SHOWN_S * fs_hz)
        panels[row, 0].plot(1e3 * np.arange(count) / fs_hz, samples[:count], color=ALONG, lw=0.9)
        title = f"{r.job.fault}: RMS {r.value['rms'] / r.value['healthy_rms']:.3g} times healthy"
        panels[row, 0].set(ylabel="acceleration (m/s²)", title=title)
        lines = np.asarray(r.value["lines"])
        panels[row, 1].plot(np.asarray(r.value["order"]), lines / lines.max(), color=ALONG, lw=1.1, zorder=3)
        panels[row, 1].axvline(r.value["expected"], color=MARK, ls="--", lw=1.6, zorder=1)
        title = f"{LINE_NAMES[r.job.fault]} = {r.value['expected']:.3f} orders, found {r.value['found']:.3f}"
        panels[row, 1].set(title=title, ylabel="envelope line / highest")
        panels[row, 1].grid(color="0.9")
    panels[-1, 0].set_xlabel("time (ms)")
    panels[-1, 1].set_xlabel("order (multiples of shaft speed)")
    figure.suptitle(f"Faults injected into the contact twin, {setting} preset, no noise; dashed: theoretical order")
    return figure


STUDY = Study(
    name="dynamics",
    title="contact dynamics, simulated",
    options=jobs.Options,
    steps=(
        Step("healthy", jobs.settle, lambda work: jobs.cases(work, ("healthy",), work.options.settle_s), as_input),
        Step("faulty", jobs.strike, lambda work: jobs.cases(work, work.options.faults, work.options.fault_s), as_input),
    ),
    tables={"dynamics-balance": balance, "dynamics-faults": faults},
    figures=all_figures,
    headlines=("dynamics-balance", "dynamics-faults"),
)
