"""Identification of a twin's free parameters from records, with intervals.

records + TwinSpec --(the model's own identification)--> values, intervals, curves, notes --> spec with all of them
"""

from __future__ import annotations

import os
from dataclasses import fields
from typing import Any, Protocol

import numpy as np

from twingap import __version__
from twingap.errors import TwingapError
from twingap.identification.result import Estimate, Identified, Outcome, Progress
from twingap.identification.user_model import first_of_each_state, fits_of, levelled
from twingap.records import RecordSet, read_record_set
from twingap.twins.twin_file import Provenance, TwinSpec, in_unit, model_of, overruled, read_twin

LEVEL = 0.9
"""Coverage of intervals by default; higher coverage makes them wider."""


class Identification(Protocol):
    """Identification function of a twin model."""

    def __call__(
        self,
        spec: TwinSpec,
        records: RecordSet,
        rng: np.random.Generator,
        *,
        level: float,
        method: str,
        progress: Progress,
    ) -> Outcome: ...


def _phenomenological() -> Identification:
    from twingap.identification.phenomenological import identify_phenomenological

    return identify_phenomenological


def _contact() -> Identification:
    from twingap.identification.contact import identify_contact

    return identify_contact


def _user_model(
    spec: TwinSpec, records: RecordSet, rng: np.random.Generator, *, level: float, method: str, progress: Progress
) -> Outcome:
    """Level and healthy vibration of a registered function, without intervals."""
    notes: list[str] = []
    few = first_of_each_state(records)
    twin, found = levelled(spec, few, rng, notes)
    return Outcome({name: Estimate(value) for name, value in found.items()}, fits_of(twin, few), tuple(notes))


IDENTIFICATIONS = {"phenomenological": _phenomenological, "contact": _contact}
"""Model -> function that imports and returns its `Identification`. A user's model can be added."""


def identify(
    records: RecordSet | str | os.PathLike[str],
    twin: TwinSpec | str | os.PathLike[str],
    *,
    seed: int | np.random.Generator = 0,
    level: float = LEVEL,
    method: str = "whittle",
    optimiser: str | None = None,
    progress: Progress | None = None,
) -> Identified:
    """Identify the free parameters of a twin.

    Intervals cover the scatter of records of the twin as given. Effects that the records have and the twin lacks bias
    values beyond them: with unmodelled jitter of 5 % and a mode that has not decayed at the next impact, the amplitude
    of inner-race impacts is 20 % too low. Modes that a record does not resolve (damping ratio 0.004 at 1.5 kHz: records
    under 0.5 s) may be excluded as lines; use longer records.

    For the contact twin, damping below about 150 N s/m (a mode narrower than its spectra resolve) may be wrong by 10 %
    and more, mostly without an interval. Four or more groups at different speeds give no intervals, since leaving one
    out changes the distribution of speeds. Mass, load and the size of the defect are assumed known.

    Parameters
    ----------
    records : RecordSet or path-like
        A record set, or its folder. Healthy records for resonance, damping, noise levels and scale; faulty ones for
        the impacts. Where a kind is missing, the other parameters are identified, and `notes` name those that are not.
    twin : TwinSpec or path-like
        A twin, or its file. Parameters that it states are fixed; absent ones are free. Parameters of effects are not
        identified: they keep their stated or default values.
    seed : int or numpy.random.Generator
        Seed or generator; an int is stated in the provenance.
    level : float
        Coverage of the intervals, between 0.5 and 0.999.
    method : {"whittle", "eq8"}
        Method for resonance and damping: jointly with the noises by likelihood, or by eq. 8 of paper 1.
    optimiser : str or None
        Optimiser of stiffness and damping of the contact twin, a key of `optimise.OPTIMISERS`; None = the default.
    progress : callable (what, fraction), optional
        Called as the identification proceeds.

    Returns
    -------
    Identified

    Raises
    ------
    TwingapError
        When the records are not sufficient, or a file cannot be read.
    """
    records = records if isinstance(records, RecordSet) else read_record_set(records)
    spec = twin if isinstance(twin, TwinSpec) else read_twin(twin)
    rng = np.random.default_rng(seed)
    if not 0.5 <= level <= 0.999:
        raise TwingapError(f"level = {level:g}, a number between 0.5 and 0.999 expected", where="identification")
    known = model_of(spec)
    own = known.name not in IDENTIFICATIONS and {"scale", "healthy_rms"} <= {f.name for f in fields(known.parameters)}
    if known.name not in IDENTIFICATIONS and not own:
        raise TwingapError(
            f"model {spec.model!r} has no identification",
            where="[twin] model",
            mend=f"give all its parameters, or use one of {', '.join(IDENTIFICATIONS)}",
        )
    chosen: dict[str, Any] = {}
    if optimiser is not None:
        if model_of(spec).name != "contact":
            raise TwingapError(
                f"optimiser {optimiser!r} is for the contact twin", where="identification", mend="leave it out"
            )
        chosen["optimiser"] = optimiser
    spec = in_unit(spec, records.unit)
    run = _user_model if own else IDENTIFICATIONS[spec.model]()
    outcome = run(
        spec, records, rng, level=level, method=method, progress=progress or (lambda what, fraction: None), **chosen
    )
    if not outcome.estimates:
        note = "the twin file states all parameters that can be identified: the twin is unchanged"
        return Identified(spec, {}, outcome.fits, (*outcome.notes, note))
    notes = outcome.notes if (other := overruled(spec, records.bearing)) is None else (other, *outcome.notes)
    if spec.identified is not None and (earlier := sorted(spec.intervals.keys() - outcome.estimates.keys())):
        note = f"{', '.join(earlier)}: as identified before, from records {spec.identified.records_sha256[:12]}"
        notes = (*notes, note)
    stated_seed = seed if isinstance(seed, int) else -1
    provenance = Provenance(records.digest, records.unit, level, __version__, method, stated_seed, notes)
    values = {name: estimate.value for name, estimate in outcome.estimates.items()}
    intervals = {name: e.interval for name, e in outcome.estimates.items() if e.interval is not None}
    return Identified(spec.with_values(values, intervals, provenance), outcome.estimates, outcome.fits, notes)
