"""Dynamics study, and its tables."""

from collections.abc import Sequence

import pandas as pd

from papers.framework import Rows, Step, Study, Work, as_table
from papers.options import as_input
from papers.paper2_digital_twin.dynamics import figures, jobs
from twingap.sweep import Result


def all_tables(work: Work) -> dict[str, pd.DataFrame]:
    found = {"dynamics-balance": balance(work["healthy"]), "dynamics-faults": faults(work["faulty"])}
    return {name: table.assign(data="simulated by the contact twin") for name, table in found.items()}


@as_table
def balance(healthy: Sequence[Result[jobs.Case]]) -> Rows:
    """Where each normal bearing settles against the static Hertz solution, and the rest of the checks. ``settled s`` is
    empty where the ring leaves the stated part of the static displacement in the judged part; ``apart`` is the relative
    RMS difference to SciPy's DOP853, worst of x and y."""
    for r in healthy:
        v = r.value
        yield {
            "setting": r.job.setting, "speed_rpm": r.job.speed_rpm, "load_n": r.job.load_n,
            "clearance_um": r.job.clearance_um, "x mean um": v["mean_x_um"], "x static um": v["still_x_um"],
            "y mean um": v["mean_y_um"], "y static um": v["still_y_um"],
            "furthest from static %": v["most_off_percent"], "settled s": v["settled_s"],
            "vx rms mm/s": v["speed_rms_mm_s"][0], "vy rms mm/s": v["speed_rms_mm_s"][1],
            "energy residual %": v["energy_residual_percent"],
            "displacement apart %": max(v["apart_percent"][:2]), "velocity apart %": max(v["apart_percent"][2:]),
        }  # fmt: skip


@as_table
def faults(faulty: Sequence[Result[jobs.Case]]) -> Rows:
    """Orders found in squared envelope spectra; ``on time`` is the nearest line within the spectrum's resolution."""
    for r in faulty:
        v = r.value
        yield {
            "setting": r.job.setting, "fault": r.job.fault, "speed_rpm": r.job.speed_rpm, "load_n": r.job.load_n,
            "clearance_um": r.job.clearance_um, "order expected": v["expected"], "order found": v["found"],
            "on time": bool(abs(v["found"] - v["expected"]) <= v["resolution"]), "strongest order": v["strongest"],
            "line over median": v["height"], "rms m/s^2": v["rms"], "rms over healthy": v["rms"] / v["healthy_rms"],
        }  # fmt: skip


STUDY = Study(
    name="dynamics",
    title="contact dynamics, simulated",
    options=jobs.Options,
    steps=(
        Step(
            "healthy",
            jobs.settle,
            lambda work: jobs.cases(work, ("healthy",), work.options.settle_s),
            lambda work: as_input(work.options),
        ),
        Step(
            "faulty",
            jobs.strike,
            lambda work: jobs.cases(work, work.options.faults, work.options.fault_s),
            lambda work: as_input(work.options),
        ),
    ),
    tables=all_tables,
    figures=figures.all_figures,
    headlines=("dynamics-balance", "dynamics-faults"),
)
