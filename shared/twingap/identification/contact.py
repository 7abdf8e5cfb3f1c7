"""Identification of the contact twin: stiffness and damping by matching spectra, levels in closed form.

records --> `contact_objective`: error of spectra --optimiser--> best point --`contact_bottom`--> values, intervals

Any optimiser can search the objective (section 2.2 of paper 3 searches by the zebra optimisation algorithm); from its
best point it goes down to the bottom, with more trajectories. Mass, load, clearance and the defects' sizes are not
free: a spectrum does not separate them from stiffness and scale, so they keep their value in the twin file or preset.
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
"""Twenty-one populations of sixteen."""
MISFIT = 0.1
"""Relative error of spectra from which on intervals are called too narrow: the twin's own records stay below."""
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
        What searches stiffness and damping, or its name in `twingap.identification.optimise.OPTIMISERS`.
    evaluations : int
        That it may spend. The descent that follows costs two to five hundred more.
    """
    if method == "eq8":
        raise TwingapError('method "eq8" is for the phenomenological twin', where="identification", mend="leave it out")
    search = optimiser_of(optimiser) if isinstance(optimiser, str) else optimiser
    notes: list[str] = []
    unfitted: dict[str, Estimate] = {}
    twin = _built(spec, records)
    given = flat(spec.parameters)
    if acting := [effect.name for effect in twin.effects if effect.name not in twin.inherent_effects]:
        notes.append(f"effects of the twin took no part in matching spectra: {', '.join(acting)}")
    kept = [name for name in NOT_FREE if not any(key.split(".")[0] == name for key in given)]
    if kept:
        notes.append(
            f"a spectrum does not separate them from stiffness and scale: {', '.join(kept)} keep their defaults"
        )
    states = states_of(records, notes)
    if not any(state.fault in DEFECTS for state in states):
        # Healthy trajectories hardly move: scale and structure noise would be traded for each other.
        notes.append("no record of a fault in inner race, outer race or ball: scale keeps its value")
        if "scale" not in given:
            # It is found all the same, as what leads to the records' unit: without it the file would not state it.
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
        whole = np.tile(start, (len(points), 1))
        whole[:, [list(BOUNDS).index(name) for name in free]] = points
        return objective(whole)

    best = start.copy()
    places = [list(BOUNDS).index(name) for name in free]
    if free:
        bounds = np.log([BOUNDS[name] for name in free])
        best[places] = search(counted, bounds, rng, evaluations)
    if objective.components([objective.parameters(best)])[0] is None:
        raise TwingapError(
            "no stiffness and damping within the bounds can be simulated at this sampling rate",
            where=f"record set {records.name!r}",
            mend="bring records at a higher fs_hz, or raise mass_kg in [parameters]",
        )
    progress("intervals", 1.0)
    bottom = descend(objective, best, places, rng, notes)
    parameters = objective.parameters(bottom.point)
    notes.append(f"relative error of the amplitude spectra: {bottom.error:.3g}")
    if bottom.scatter is not None and bottom.error > MISFIT:
        notes.append("the twin's spectra are not the records': what it lacks moves values beyond their intervals")
    if bottom.powers[0] == 0:
        notes.append("no trace of the contact's vibration in the records: scale is next to nothing, noise is all")
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
