"""Dynamics study: whether the contact model settles to balance, and whether faults give impacts at their rates.

settings x speeds x loads x clearances --> RK4 from rest at the centre --> displacement, velocity --> settled?
                                                  |                              |
         static Hertz solution by a root finder --+       energy balance --------+------ SciPy's DOP853, written anew
inner, outer, ball --> records of the contact twin --> squared envelope spectrum --> order found, order expected

Used in: Paper 2, section 2: figure 5 (normal bearing, displacement and velocity in x and y) and figure 6 (the same from
the paper's reference [32], whose parameters and waveforms are not in the text: `reference.py` stands in its place).
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from papers.arrays import Array
from papers.framework import Work
from papers.options import expect
from papers.paper2_digital_twin.dynamics import reference
from papers.paper2_digital_twin.dynamics.contact_motion import motion_of
from twingap import BEARINGS, Condition
from twingap.signal import squared_envelope_spectrum
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_dynamics import Job
from twingap.twins.contact_parameters import PRESETS, ContactParameters

HIGHEST_ORDER: Final = 12.0
"""Up to which a fault's first line is sought: above the inner race's, below second harmonics' crowd."""


@dataclass(frozen=True)
class Size:
    speeds_rpm: tuple[float, ...]
    loads_n: tuple[float, ...]
    clearances_um: tuple[float, ...]


@dataclass(frozen=True)
class Options:
    settings: tuple[Literal["physical", "paper"], ...]
    bearing: str
    faults: tuple[str, ...]
    fs_hz: float
    settle_s: float
    fault_s: float
    reference_s: float
    settled_part: float
    within: float
    profiles: dict[str, Size]

    def __post_init__(self) -> None:
        expect(self.bearing, BEARINGS, "bearing")
        for setting, fault in itertools.product(self.settings, self.faults):
            expect(fault, PRESETS[setting].defect_depth_um, "faults")


@dataclass(frozen=True)
class Case:
    """One bearing at one operating point."""

    setting: str
    fault: str
    speed_rpm: float
    load_n: float
    clearance_um: float
    duration_s: float


def cases(work: Work, faults: tuple[str, ...], duration_s: float) -> Iterator[Case]:
    """Operating points of every fault and setting; the "paper" preset keeps its own load and clearance."""
    options, size = work.options, work.size
    for fault, setting in itertools.product(faults, options.settings):
        own = PRESETS[setting]
        loads = size.loads_n if setting == "physical" else (own.load_n,)
        clearances = size.clearances_um if setting == "physical" else (own.clearance_um,)
        for speed_rpm, load_n, clearance_um in itertools.product(size.speeds_rpm, loads, clearances):
            yield Case(setting, fault, speed_rpm, load_n, clearance_um, duration_s)


def parameters_of(case: Case) -> ContactParameters:
    """The twin's parameters in a case, without noise: what is judged is the contact."""
    own = replace(PRESETS[case.setting], load_n=case.load_n, clearance_um=case.clearance_um)
    return replace(own, structure_noise_rms=0.0, white_noise_rms=0.0)


def settle(case: Case, options: Options) -> dict[str, Any]:
    """A healthy bearing from rest at the centre: where and when it settles, its energy, and what SciPy makes of it."""
    bearing, own, fs_hz = BEARINGS[options.bearing], parameters_of(case), options.fs_hz
    # The cage is at zero angle at the start.
    samples = round(case.duration_s * fs_hz)
    turns = np.arange(samples, dtype=np.float64) * (case.speed_rpm / 60 / fs_hz)
    condition = Condition(case.setting, case.speed_rpm, fs_hz, samples, case.fault, case.load_n)
    motion = motion_of(Job(bearing, own, condition, turns))
    state = motion.state
    judged = round((1 - options.settled_part) * motion.t_s.size)
    late = slice(judged, None)
    # Some two hundred cage angles are enough: the static solution changes slowly and smoothly with it.
    thin = np.arange(0, motion.t_s.size, max(1, motion.t_s.size // 400))
    still = np.array([reference.rest(bearing, own, case.load_n, float(motion.cage_turns[i])) for i in thin]).T
    off = np.hypot(*(state[:2, thin] - still))
    size = float(np.hypot(*still.mean(axis=1)))
    cage_hz = bearing.ftf * case.speed_rpm / 60
    total, power = reference.energy(bearing, own, case.load_n, state, motion.cage_turns, cage_hz)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) / fs_hz])
    inside = thin >= judged
    short = round(options.reference_s * fs_hz)
    theirs = reference.integrated(bearing, own, case.load_n, motion.t_s[:short], cage_hz)
    apart = np.sqrt(((state[:, :short] - theirs) ** 2).sum(axis=1) / (theirs**2).sum(axis=1))
    return {
        "t_s": motion.t_s, "state": state, "still_t_s": motion.t_s[thin], "still": still, "theirs": theirs,
        "mean_x_um": 1e6 * float(state[0, late].mean()), "mean_y_um": 1e6 * float(state[1, late].mean()),
        "still_x_um": 1e6 * float(still[0, inside].mean()), "still_y_um": 1e6 * float(still[1, inside].mean()),
        "most_off_percent": 100 * float(off[inside].max()) / size,
        "settled_s": settled_at(motion.t_s[thin], off, options.within * size, float(motion.t_s[judged])),
        "energy_residual_percent": 100 * float(np.abs(total - total[0] - work).max() / np.abs(total - total[0]).max()),
        "speed_rms_mm_s": [1e3 * float(state[i, late].std()) for i in (2, 3)],
        "apart_percent": [100 * float(v) for v in apart],
    }  # fmt: skip


def settled_at(t_s: Array, off: Array, limit: float, judged_s: float) -> float | None:
    """From when on a ring stays within a limit of the static solution [points]; None where it is away in the judged
    part."""
    away = np.flatnonzero(off > limit)
    if away.size and t_s[away[-1]] >= judged_s:
        return None
    return float(t_s[away[-1] + 1 if away.size else 0])


def strike(case: Case, options: Options) -> dict[str, Any]:
    """A faulty bearing: its record, and the strongest line of its squared envelope spectrum."""
    bearing, fs_hz = BEARINGS[options.bearing], options.fs_hz
    twin, samples = ContactTwin(bearing, parameters_of(case)), round(case.duration_s * fs_hz)
    condition = Condition(case.fault, case.speed_rpm, fs_hz, samples, case.fault, case.load_n)
    (record,) = twin.simulate([condition], np.random.default_rng(0))
    (healthy,) = twin.simulate([replace(condition, fault="healthy")], np.random.default_rng(0))
    expected = bearing.fault_order(case.fault)
    spectrum = squared_envelope_spectrum(record.samples, fs_hz).in_orders(case.speed_rpm)
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
    }  # fmt: skip
