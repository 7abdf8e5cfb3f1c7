"""The contact twin: an inner ring and its shaft on Hertzian contacts, in the two radial directions.

shaft angle --> cage angle (slip, jitter) --> which roller is where, which is in a defect --+
                                                                                            v
load, unbalance -------------------------> 2-DOF contact dynamics (`contact_kernel`, RK4, oversampled, decimated)
structure noise: white force --> the linearised contact mode --> + <-- acceleration in the load direction x gain
                                                                 v
                                                        filters, white noise, ...

The model is that of papers 2 and 3, from their prose (their equations are lost). Inner ring and shaft of mass m move by
(x, y); y is the load's direction. Roller j stands at phi_j = 2 pi (j / Z + cage turns) and is squeezed by

    delta_j = x cos phi_j + y sin phi_j - u - beta_j h
    Q_j = K max(delta_j, 0)^n, n = 3/2 for balls, 10/9 for cylinders
    m x'' + c x' + sum Q_j cos phi_j = F_x + m e w^2 cos(w t)   and in y with sin, F_y

with clearance u and defect depth h. beta_j is 1 while roller j is in the defect: at a fixed angle for the outer race,
at one that turns with the shaft for the inner race, and twice per spin (once on each race) for the ball that has it.
The papers' beta jumps; here it rises by a quintic over `edge` of the defect's half width unless `edge` is 0. A roller's
contact has a size and its centre sinks gradually, so the smooth edge is the more physical one, and it keeps RK4 at
fourth order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from twingap.bearing import Bearing
from twingap.effects import Draft, Effect, Mode, catalogue
from twingap.effects.modes import LEAD, modal_response, response_rms
from twingap.errors import TwingapError
from twingap.records import Condition, Record
from twingap.streams import Streams
from twingap.twins.base import Twin
from twingap.twins.contact_dynamics import Job, accelerations, equilibrium, statics
from twingap.twins.contact_parameters import PRESETS, ContactParameters, hertz_stiffness, sink_depth_um

__all__ = [
    "PRESETS",
    "ContactParameters",
    "ContactTwin",
    "hertz_stiffness",
    "make_each",
    "make_together",
    "respond_together",
    "sink_depth_um",
    "through",
]

Array = NDArray[np.float64]


@dataclass
class ContactDraft(Draft):
    """Draft with initial angles of shaft, cage and rollers, in turns."""

    shaft_start: float = 0.0
    cage_start: float = 0.0
    spin_start: float = 0.0


class ContactTwin(Twin):
    """Nonlinear contact dynamics of a loaded ring on rollers that pass a defect.

    Parameters
    ----------
    bearing : Bearing
        Geometry of the bearing under test.
    parameters : ContactParameters
        See `PRESETS`; the physical ones when left out.
    effects : iterable of Effect
        What is modelled beyond the baseline.
    unit : str
        Unit of the samples; `parameters.scale` converts from m/s^2.

    Notes
    -----
    The load zone, both edges of a defect and the cage-rate modulation of a ball defect follow from the dynamics
    (`inherent_effects`): naming these effects is allowed and changes nothing.

    A draft's first mode is the contact itself, linearised about its static equilibrium; the structure noise's force and
    what effects add to it go through it. Modes that effects append respond to the same excitation: the contact's
    acceleration is filtered by H_new / H_contact, so that what would be a hit A h_contact(t) gains A h_new(t)
    in addition, as in the phenomenological twin. The force passes through all modes.

    Random streams of a record: "contact_phase" (angles at its start), "structure_noise", "white_noise", and one for
    each effect by its name.
    """

    model: ClassVar[str] = "contact"
    batch: ClassVar[int] = 64
    devices: ClassVar[tuple[str, ...]] = ("cpu", "cuda")
    excitation: ClassVar[Literal["impacts", "rollers", "waveform"]] = "rollers"
    inherent_effects: ClassVar[frozenset[str]] = frozenset(
        name for name, kind in catalogue().items() if "contact" in kind.inherent_in
    )

    def __init__(
        self,
        bearing: Bearing,
        parameters: ContactParameters | None = None,
        effects: Iterable[Effect] = (),
        unit: str = "m/s^2",
    ) -> None:
        super().__init__(bearing, effects, unit)
        self.parameters = parameters or PRESETS["physical"]

    @property
    def white_noise_rms(self) -> float:
        """RMS of the measuring chain's white noise, in `unit`."""
        return self.parameters.scale * self.parameters.white_noise_rms

    @cached_property
    def reference_rms(self) -> float:
        """RMS of healthy vibration at 1800 rpm and the parameters' load, in `unit`: rollers passing, both noises."""
        return _references([self])[0]

    def contact_mode(self, load_n: float | None = None) -> Mode:
        """The contact in the load's direction, linearised about its static equilibrium."""
        w = equilibrium(self.bearing, statics(self.parameters, load_n)).w_y
        zeta = self.parameters.damping / (2 * self.parameters.mass_kg * w)
        return Mode(w / (2 * math.pi), min(max(zeta, 1e-4), 0.99))

    def excite(self, draft: Draft, streams: Streams) -> None:
        """Draw initial angles and the force of the structure noise."""
        assert isinstance(draft, ContactDraft)
        own, condition = self.parameters, draft.condition
        where = f"record {condition.name!r}, contact twin"
        if condition.fault is None:
            raise TwingapError("the fault is unknown, so nothing can be simulated", where=where, mend="give its fault")
        if condition.fault != "healthy" and condition.fault not in own.defect_depth_um:
            known = ", ".join(("healthy", *own.defect_depth_um))
            raise TwingapError(f"no contact model for fault {condition.fault!r}", where=where, mend=f"use {known}")
        mode = self.contact_mode(condition.load_n)
        if mode.frequency_hz >= condition.fs_hz / 2:
            raise TwingapError(
                f"the contact resonance at {mode.frequency_hz:.0f} Hz lies above half the sampling rate of "
                f"{condition.fs_hz:g} Hz",
                where=where, mend="raise fs_hz, lower stiffness, or raise mass_kg",
            )  # fmt: skip
        draft.modes.append(mode)
        draft.shaft_start, draft.cage_start, draft.spin_start = streams("contact_phase").random(3)
        if own.structure_noise_rms > 0:
            rng = streams("structure_noise")
            force = rng.standard_normal(condition.n_samples)
            rms = own.scale * own.structure_noise_rms / response_rms(draft.modes, condition.fs_hz)
            force *= rms
            draft.push(force, rng, rms)

    def respond(self, drafts: Sequence[Draft]) -> None:
        """Integrate the contact dynamics and apply the path."""
        respond_together([self] * len(drafts), drafts)

    def _begin(self, condition: Condition) -> Draft:
        plain = super()._begin(condition)
        return ContactDraft(**{each.name: getattr(plain, each.name) for each in fields(plain)})


def respond_together(twins: Sequence[ContactTwin], drafts: Sequence[Draft]) -> None:
    """Compute the waveform of each draft by its own twin, all integrated at once on the first one's device."""
    jobs = []
    for twin, draft in zip(twins, drafts, strict=True):
        assert isinstance(draft, ContactDraft)
        starts = (draft.shaft_start, draft.cage_start, draft.spin_start)
        jobs.append(
            Job(
                twin.bearing,
                twin.parameters,
                draft.condition,
                draft.turns,
                draft.cage_speed_ratio,
                draft.cage_lag,
                starts,
            )
        )
    device = twins[0].device if twins else "cpu"
    for twin, draft, (contact, lead) in zip(twins, drafts, accelerations(jobs, device), strict=True):
        gain = twin.parameters.scale * (np.ones(draft.t.size) if draft.gain is None else draft.gain)
        contact *= np.pad(gain, (lead, 0), mode="edge")
        total = contact.copy()
        for mode in draft.modes[1:]:
            total += through(mode, draft.modes[0], contact, draft.condition.fs_hz)
        before = min(lead, LEAD)
        x = total[lead - before :]
        if draft.force is not None:
            stirred = modal_response(
                draft.modes, draft.condition.fs_hz, draft.force.size, force=draft.force, past=draft.past
            )
            x = x + stirred[LEAD - before :]
        for act in draft.filters:
            x = act(x)
        draft.x = x[before:].copy()


def make_together(
    twins: Sequence[ContactTwin], conditions: Sequence[Condition], streams: Sequence[Streams]
) -> list[list[Record]]:
    """The same records by several twins with common random numbers, for instance candidates of an identification.

    Every candidate is a lane of the integrator, so sixteen are as fast as one.

    Returns
    -------
    list of list of Record
        For each twin what its `make(conditions, streams)` gives, to the bit.
    """
    return make_each(twins, [conditions] * len(twins), [streams] * len(twins))


def make_each(
    twins: Sequence[ContactTwin], conditions: Sequence[Sequence[Condition]], streams: Sequence[Sequence[Streams]]
) -> list[list[Record]]:
    """Records of several twins, each under its own conditions, all integrated at once.

    Parameters
    ----------
    twins : sequence of ContactTwin
    conditions, streams : sequences, one a twin

    Returns
    -------
    list of list of Record
        For each twin what its `make` gives, to the bit.
    """
    waiting = [twin for twin in twins if "reference_rms" not in vars(twin)]
    for twin, rms in zip(waiting, _references(waiting), strict=True):
        vars(twin)["reference_rms"] = rms  # the cache of the property
    prepared = [twin.prepare(own, chances) for twin, own, chances in zip(twins, conditions, streams, strict=True)]
    owners = [twin for twin, own in zip(twins, conditions, strict=True) for _ in own]
    respond_together(owners, [draft for drafts in prepared for draft in drafts])
    return [twin.finish(drafts, chances) for twin, drafts, chances in zip(twins, prepared, streams, strict=True)]


def _references(twins: Sequence[ContactTwin]) -> list[float]:
    """`ContactTwin.reference_rms` of several, integrated at once."""
    condition = Condition("reference", 1800.0, 25600.0, 6400, "healthy")
    turns = np.linspace(0.0, 30 * condition.duration_s, condition.n_samples, endpoint=False, dtype=np.float64)
    found = []
    jobs = [Job(twin.bearing, twin.parameters, condition, turns) for twin in twins]
    for twin, (rolling, _) in zip(twins, accelerations(jobs), strict=True):
        own = twin.parameters
        rms = math.hypot(float(np.std(rolling)), own.structure_noise_rms, own.white_noise_rms)
        found.append(own.scale * rms if rms > 0 else own.scale)
    return found


def through(new: Mode, old: Mode, x: Array, fs_hz: float) -> Array:
    """Response of mode `new` to the impacts whose response by mode `old` is `x`.

    Sampled modes are b / (1 - 2 r cos(a) / z + r^2 / z^2), so their ratio is a filter of second order.
    """
    p, q = np.exp(new.pole / fs_hz), np.exp(old.pole / fs_hz)
    up = np.array([1.0, -2 * q.real, abs(q) ** 2]) * (new.gain * p.imag / (old.gain * q.imag))
    return np.asarray(lfilter(up, [1.0, -2 * p.real, abs(p) ** 2], x), dtype=np.float64)
