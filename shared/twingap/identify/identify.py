"""From records to an identified twin.

TWIN spec + records --(the model's own identification)--> values, intervals, curves, notes --> spec with all of them
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from twingap import __version__
from twingap.errors import TwingapError
from twingap.identify.result import Identified, Outcome, Report
from twingap.records import RecordSet
from twingap.twins.twin_file import Provenance, TwinSpec, in_unit, model_of

LEVEL = 0.9
"""Coverage that intervals claim unless asked for another."""


class Identification(Protocol):
    """How one model's free parameters are found."""

    def __call__(
        self, spec: TwinSpec, records: RecordSet, rng: np.random.Generator, *, level: float, method: str, report: Report
    ) -> Outcome: ...


def _phenomenological() -> Identification:
    from twingap.identify.phenomenological import identify_phenomenological

    return identify_phenomenological


def _contact() -> Identification:
    from twingap.identify.contact import identify_contact

    return identify_contact


IDENTIFICATIONS = {"phenomenological": _phenomenological, "contact": _contact}
"""Model -> function that imports and returns its `Identification`. A user's own model may join."""


def identify(
    spec: TwinSpec,
    records: RecordSet,
    rng: np.random.Generator,
    *,
    level: float = LEVEL,
    method: str = "whittle",
    optimiser: str | None = None,
    seed: int = -1,
    report: Report = lambda what, fraction: None,
) -> Identified:
    """Identify the parameters that a twin leaves free.

    Intervals hold the scatter of records of the twin as given, and no more. What the records have and the twin lacks
    moves values beyond them: with jitter of 5 % unmodelled, and a mode that still rings when the next impact strikes,
    the amplitude of inner-race impacts comes out 20 % low and its 90 % interval holds the truth one time in four
    (simulated). Modes so sharp that a record does not resolve them (zeta 0.004 at 1.5 kHz: records under 0.5 s) may be
    taken for lines and left out: bring longer records.

    Of the contact twin: 90 % intervals have held stiffness of 20 and damping of 18 of 20 simulated machines with a
    ball defect, whose records of 10 s stood 10 dB above white noise. Damping below some 150 N s/m, a mode narrower than
    its spectra resolve, may be off by a tenth and more, mostly without an interval. Records of four groups and more at
    speeds of their own give none: what one of them less changes is the mixture of speeds. Mass, load and the defect's
    size are taken as known.

    Parameters
    ----------
    spec : TwinSpec
        What is fixed; what is absent is free. Parameters of effects are not identified: they keep what the spec or
        their defaults say.
    records : RecordSet
        Healthy records for resonance, damping, noise levels and scale; faulty ones for the impacts. Where a kind is
        missing, what can be found without is found, and `notes` say what was not.
    rng : numpy.random.Generator
    level : float
        Coverage of the intervals, between 0.5 and 0.999.
    method : {"whittle", "eq8"}
        How resonance and damping are found: jointly with the noises by likelihood, or by eq. 8 of paper 1.
    optimiser : str or None
        What searches stiffness and damping of the contact twin, a key of `twingap.identify.optimise.OPTIMISERS`; None:
        the model's own choice.
    seed : int
        Only noted in the provenance.
    report : callable
        Told of progress.

    Returns
    -------
    Identified

    Raises
    ------
    TwingapError
        When there is nothing to identify from.
    """
    if not 0.5 <= level <= 0.999:
        raise TwingapError(f"level = {level:g}, a number between 0.5 and 0.999 expected", where="identification")
    if model_of(spec).name not in IDENTIFICATIONS:
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
    outcome = IDENTIFICATIONS[spec.model]()(spec, records, rng, level=level, method=method, report=report, **chosen)
    if not outcome.estimates:
        told = "the twin file gives every parameter that records could tell: nothing was identified, it stays as it is"
        return Identified(spec, {}, outcome.fits, (*outcome.notes, told))
    notes = outcome.notes
    if spec.identified is not None and (earlier := sorted(spec.intervals.keys() - outcome.estimates.keys())):
        told = f"{', '.join(earlier)}: as identified before, from records {spec.identified.records_sha256[:12]}"
        notes = (*notes, told)
    provenance = Provenance(records.digest, records.unit, level, __version__, method, seed, notes)
    values = {name: estimate.value for name, estimate in outcome.estimates.items()}
    intervals = {name: e.interval for name, e in outcome.estimates.items() if e.interval is not None}
    return Identified(spec.with_values(values, intervals, provenance), outcome.estimates, outcome.fits, notes)
