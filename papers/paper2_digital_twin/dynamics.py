"""Dynamics study: whether the contact model settles to balance, and whether faults give impacts at their rates.

settings x speeds x loads x clearances --> RK4 from rest at the centre --> displacement, velocity --> settled?
                                                  |                              |
         static Hertz solution by a root finder --+       energy balance --------+------ SciPy's DOP853, written anew
inner, outer, ball --> records of the contact twin --> squared envelope spectrum --> order found, order expected

Used in: Paper 2, section 2: figure 5 (normal bearing, displacement and velocity in x and y) and figure 6 (the same from
the paper's reference [32], whose parameters and waveforms are not in the text: `reference.py` stands in its place).
Run as part of the paper, or alone: python -m papers.paper2_digital_twin.dynamics --out DIR
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

import twingap._compiled
import twingap.bearing
import twingap.effects
import twingap.signal
import twingap.streams
import twingap.twins
from papers.paper2_digital_twin import contact_motion, dynamics_study, reference
from papers.paper2_digital_twin.contact_motion import motions
from papers.paper2_digital_twin.dynamics_study import (
    CONFIG,
    Case,
    Dynamics,
    DynamicsOptions,
    DynamicsProfile,
    read_dynamics,
)
from papers.studies import Count, Progress, command, keep_figures, keep_tables, profile_of
from twingap.bearing import BEARINGS
from twingap.provenance import digest_of_code
from twingap.records import Condition
from twingap.signal import squared_envelope_spectrum
from twingap.sweep import Result, sweep
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_dynamics import Job
from twingap.twins.contact_parameters import PRESETS, ContactParameters

if TYPE_CHECKING:
    from twingap.track import Run

Array = NDArray[np.float64]
HIGHEST_ORDER: Final = 12.0
"""Up to which a fault's first line is sought: above the inner race's, below second harmonics' crowd."""


def parameters_of(case: Case) -> ContactParameters:
    """The twin's parameters in a case, without noise: what is judged is the contact."""
    own = replace(PRESETS[case.setting], load_n=case.load_n, clearance_um=case.clearance_um)
    return replace(own, structure_noise_rms=0.0, white_noise_rms=0.0)


def job_of(case: Case, duration_s: float) -> Job:
    """The trajectory of a case, its cage at zero angle at the start."""
    samples = round(duration_s * case.fs_hz)
    turns = np.arange(samples, dtype=np.float64) * (case.speed_rpm / 60 / case.fs_hz)
    condition = Condition(case.setting, case.speed_rpm, case.fs_hz, samples, case.fault, case.load_n)
    return Job(BEARINGS[case.bearing], parameters_of(case), condition, turns)


def settle(case: Case) -> dict[str, Any]:
    """A healthy bearing from rest at the centre: where and when it settles, its energy, and what SciPy makes of it."""
    bearing, own = BEARINGS[case.bearing], parameters_of(case)
    (motion,) = motions([job_of(case, case.duration_s)])
    state = np.array([motion.x_m, motion.y_m, motion.vx_m_s, motion.vy_m_s])
    judged = round((1 - case.settled_part) * motion.t_s.size)
    late = slice(judged, None)
    # Some two hundred cage angles are enough: the static solution changes slowly and smoothly with it.
    every = max(1, motion.t_s.size // 400)
    thin = np.arange(0, motion.t_s.size, every)
    still = np.array([reference.rest(bearing, own, case.load_n, float(motion.cage_turns[i])) for i in thin]).T
    off = np.hypot(*(state[:2, thin] - still))
    size = float(np.hypot(*still.mean(axis=1)))
    cage_hz = bearing.ftf * case.speed_rpm / 60
    total, power = reference.energy(bearing, own, case.load_n, state, motion.cage_turns, cage_hz)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) / case.fs_hz])
    inside = thin >= judged
    short = round(case.reference_s * case.fs_hz)
    theirs = reference.integrated(bearing, own, case.load_n, motion.t_s[:short], cage_hz)
    apart = np.sqrt(((state[:, :short] - theirs) ** 2).sum(axis=1) / (theirs**2).sum(axis=1))
    return {
        "t_s": motion.t_s, "state": state, "still_t_s": motion.t_s[thin], "still": still, "theirs": theirs,
        "mean_x_um": 1e6 * float(state[0, late].mean()), "mean_y_um": 1e6 * float(state[1, late].mean()),
        "still_x_um": 1e6 * float(still[0, inside].mean()), "still_y_um": 1e6 * float(still[1, inside].mean()),
        "most_off_percent": 100 * float(off[inside].max()) / size,
        "settled_s": settled_at(motion.t_s[thin], off, case.within * size, float(motion.t_s[judged])),
        "energy_residual_percent": 100 * float(np.abs(total - total[0] - work).max() / np.abs(total - total[0]).max()),
        "speed_rms_mm_s": [1e3 * float(state[i, late].std()) for i in (2, 3)],
        "apart_percent": [100 * float(v) for v in apart],
    }  # fmt: skip


def settled_at(t_s: Array, off: Array, limit: float, judged_s: float) -> float | None:
    """From when on a ring stays where it should be.

    Parameters
    ----------
    t_s : Array [points]
    off : Array [points]
        Distance to the static solution.
    limit : float
        Beyond it the ring is away.
    judged_s : float
        Where the judged part begins; it lasts to the end.

    Returns
    -------
    float or None
        None where the ring is away anywhere in the judged part: few points near the end say little.
    """
    away = np.flatnonzero(off > limit)
    if away.size and t_s[away[-1]] >= judged_s:
        return None
    return float(t_s[away[-1] + 1 if away.size else 0])


def strike(case: Case) -> dict[str, Any]:
    """A faulty bearing: its record, and the strongest line of its squared envelope spectrum."""
    bearing = BEARINGS[case.bearing]
    condition = Condition(
        case.fault, case.speed_rpm, case.fs_hz, round(case.duration_s * case.fs_hz), case.fault, case.load_n
    )  # fmt: skip
    twin = ContactTwin(bearing, parameters_of(case))
    quiet = replace(condition, fault="healthy")
    (record,) = twin.simulate([condition], np.random.default_rng(0))
    (healthy,) = twin.simulate([quiet], np.random.default_rng(0))
    expected = bearing.fault_order(case.fault)
    spectrum = squared_envelope_spectrum(record.samples, case.fs_hz).in_orders(case.speed_rpm)
    # Half an order is above the cage's own line and below every fault's.
    inside = (spectrum.frequency > 0.5) & (spectrum.frequency < HIGHEST_ORDER)
    lines = np.where(inside, spectrum.values, 0.0)
    strongest = float(spectrum.frequency[int(lines.argmax())])
    near = np.abs(spectrum.frequency - expected) < 0.05 * expected
    found = float(spectrum.frequency[int(np.where(near, lines, 0.0).argmax())])
    return {
        "samples": record.samples.astype(np.float32), "order": spectrum.frequency[inside], "lines": lines[inside],
        "expected": expected, "strongest": strongest, "found": found,
        "resolution": spectrum.resolution, "height": float(lines[near].max() / np.median(lines[inside])),
        "rms": float(record.samples.std()), "healthy_rms": float(healthy.samples.std()),
        "carrier_hz": twin.contact_mode(case.load_n).frequency_hz,
    }  # fmt: skip


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    draw: bool = True,
) -> Dynamics:
    """Run the study; what an interrupted run has finished is taken up again.

    Parameters
    ----------
    profile : {"smoke", "full"}
    out : Path
        Folder for ``tables/``, ``figures/`` and ``results/``.
    root, seed
        Not needed here (nothing is measured, nothing drawn by lot); the same call serves all studies.
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables and figures go there as well.
    progress : callable
    config : Path
    draw : bool
        Make the figures.
    """
    options = read_dynamics(config)
    sizes = profile_of(options.profiles, profile, config)
    healthy = list(_cases(options, sizes, "healthy", options.settle_s))
    faulty = [c for f in options.faults for c in _cases(options, sizes, f, options.fault_s)]
    code = digest_of_code(
        sys.modules[__name__], dynamics_study, contact_motion, reference, twingap.bearing, twingap.effects,
        twingap.signal, twingap._compiled, twingap.streams, twingap.twins,
    )  # fmt: skip
    given: dict[str, Any] = {
        "store": out / "results", "backend": backend, "address": address, "version": code,
        "on_result": Count("dynamics", len(healthy) + len(faulty), progress),
    }  # fmt: skip
    settled: list[Result[Case]] = sweep(settle, healthy, **given)
    struck: list[Result[Case]] = sweep(strike, faulty, **given)
    from papers.paper2_digital_twin import tables_dynamics as tables

    study = Dynamics(options, settled, struck, tables.all_tables(settled, struck), BEARINGS[options.bearing])
    keep_tables(study.tables, out, log)
    if draw:
        from papers.paper2_digital_twin import figures_dynamics as figures

        keep_figures(figures.all_figures(study), out, log)
    return study


def _cases(options: DynamicsOptions, profile: DynamicsProfile, fault: str, duration_s: float) -> list[Case]:
    """Operating points of every setting."""
    found = []
    for setting in options.settings:
        own = PRESETS[setting]
        loads = profile.loads_n if setting == "physical" else (own.load_n,)
        clearances = profile.clearances_um if setting == "physical" else (own.clearance_um,)
        for speed_rpm, load_n, clearance_um in itertools.product(profile.speeds_rpm, loads, clearances):
            found.append(
                Case(
                    setting, options.bearing, fault, speed_rpm, load_n, clearance_um, options.fs_hz, duration_s,
                    options.reference_s, options.settled_part, options.within,
                )
            )  # fmt: skip
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""
    command(run, "Dynamics of paper 2's twin: tables and figures.", lambda study: study.tables, arguments)


if __name__ == "__main__":
    # Under its own name, so that results are the same jobs as those of the pipeline.
    from papers.paper2_digital_twin.dynamics import main as run_main

    run_main()
