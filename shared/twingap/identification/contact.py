"""Identification of the contact twin: stiffness and damping by matching spectra, levels in closed form.

records --> `contact_objective`: error of spectra --optimiser--> best point --`contact_bottom`--> values, intervals

Any optimiser can be used (section 2.2 of paper 3 uses the zebra optimisation algorithm); a local search with more
trajectories follows. Mass, load, clearance and the size of defects are not free, since a spectrum does not separate
them from stiffness and scale; they keep the value of the twin file or preset.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.identification.contact_bottom import descend
from twingap.identification.contact_objective import SpectrumObjective, states_of
from twingap.identification.optimise import DEFAULT, Optimiser, optimiser_of
from twingap.identification.result import Estimate, Fit, Outcome, Progress
from twingap.records import RecordSet
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_parameters import DEFECTS
from twingap.twins.twin_file import TwinSpec, build_twin, flat, scaled_for

Array = NDArray[np.float64]

BOUNDS = {"stiffness": (3e8, 1e11), "damping": (20.0, 5000.0)}
EVALUATIONS = 336
"""Evaluations of the optimiser (21 populations of 16); more are slower and search more thoroughly."""
MISFIT = 0.1
"""Relative error of spectra above which a note warns that intervals are too narrow; records of the twin itself are
below."""
NOT_FREE = ("mass_kg", "load_n", "clearance_um", "defect_depth_um", "defect_width_mm")


def identify_contact(
    spec: TwinSpec,
    records: RecordSet,
    rng: np.random.Generator,
    *,
    level: float,
    method: str,
    progress: Progress,
    optimiser: Optimiser | str = DEFAULT,
    evaluations: int = EVALUATIONS,
) -> Outcome:
    """Identify stiffness, damping, scale and noise levels of the contact twin. See `identify`.

    Parameters
    ----------
    optimiser : Optimiser or str
        Optimiser of stiffness and damping, or its name in `twingap.identification.optimise.OPTIMISERS`.
    evaluations : int
        Evaluations of the optimiser; the local search needs two to five hundred more.
    """
    if method == "eq8":
        raise TwingapError('method "eq8" is for the phenomenological twin', where="identification", mend="leave it out")
    search = optimiser_of(optimiser) if isinstance(optimiser, str) else optimiser
    notes: list[str] = []
    unfitted: dict[str, Estimate] = {}
    twin = _built(spec, records)
    given = flat(spec.parameters)
    if acting := [effect.name for effect in twin.effects if effect.name not in twin.inherent_effects]:
        notes.append(f"effects of the twin were not used in matching spectra: {', '.join(acting)}")
    kept = [name for name in NOT_FREE if not any(key.split(".")[0] == name for key in given)]
    if kept:
        notes.append(
            f"a spectrum does not separate them from stiffness and scale: {', '.join(kept)} keep their defaults"
        )
    states = states_of(records, notes)
    if not any(state.fault in DEFECTS for state in states):
        # Healthy trajectories hardly vibrate, so scale and structure noise could not be separated.
        notes.append("no record of a fault in inner race, outer race or ball: scale keeps its value")
        if "scale" not in given:
            # It is stated as the factor to the unit of the records, which the file would otherwise lack.
            spec, note = scaled_for(spec, records.unit)
            notes += [note] if note else []
            twin = _built(spec, records)
            unfitted["scale"] = Estimate(twin.parameters.scale)
            given = {"scale": twin.parameters.scale, **given}
    starts = rng.random((sum(len(state.conditions) for state in states), 3))
    fixed_levels: dict[str, float] = {
        n: given[n] for n in ("scale", "structure_noise_rms", "white_noise_rms") if n in given
    }
    objective = SpectrumObjective(twin, states, starts, fixed_levels)
    free = [name for name in BOUNDS if name not in given]
    start = np.log([twin.parameters.stiffness, twin.parameters.damping])
    done = 0

    def counted(points: Array) -> Array:
        nonlocal done
        done += len(points)
        progress("stiffness and damping", min(1.0, done / evaluations))
        complete = np.tile(start, (len(points), 1))
        complete[:, [list(BOUNDS).index(name) for name in free]] = points
        return objective(complete)

    best = start.copy()
    places = [list(BOUNDS).index(name) for name in free]
    if free:
        bounds = np.log([BOUNDS[name] for name in free])
        best[places] = search(counted, bounds, rng, evaluations)
    if objective.components([objective.parameters(best)])[0] is None:
        raise TwingapError(
            "no stiffness and damping within the bounds can be simulated at this sampling rate",
            where=f"record set {records.name!r}",
            mend="use records at a higher fs_hz, or raise mass_kg in [parameters]",
        )
    progress("intervals", 1.0)
    bottom = descend(objective, best, places, rng, notes)
    parameters = objective.parameters(bottom.point)
    notes.append(f"relative error of the amplitude spectra: {bottom.error:.3g}")
    if bottom.scatter is not None and bottom.error > MISFIT:
        notes.append("the twin's spectra differ from the records': what it lacks moves values beyond their intervals")
    if bottom.powers[0] == 0:
        notes.append("the records contain no vibration of the contact, only noise: scale is nearly 0")
    found = bottom.estimates(level)
    fits = tuple(
        Fit(
            f"{state.fault}, {len(state.measured.places)} at {state.measured.fs_hz:g} Hz",
            state.measured.f_hz, state.psd, bottom.powers @ part, state.measured.usable,
            ContactTwin(twin.bearing, parameters).contact_mode(state.conditions[0].load_n).frequency_hz, records.unit,
        )
        for state, part in zip(states, bottom.parts, strict=True)
    )  # fmt: skip
    return Outcome({n: e for n, e in found.items() if n not in given} | unfitted, fits, tuple(notes))


def _built(spec: TwinSpec, records: RecordSet) -> ContactTwin:
    twin = build_twin(spec, records.bearing, records.unit)
    assert isinstance(twin, ContactTwin)
    return twin
