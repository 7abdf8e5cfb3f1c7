"""Effects that the twin file names without a value: read off the fit part, as whatever else it leaves open.

twin without them --calibrated--> features of the fit part --estimates, brought nearest--> twin with their values

A modelled effect at a default that is not the machine's is a gap of the file's making, not of the twin's: it would be
blamed on whatever looks like the difference. Effects of which the file gives any value keep defaults for the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from twingap.gap.search.effect_search import valued
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of, values_of
from twingap.identify.calibrate import calibrate
from twingap.records import RecordSet
from twingap.streams import root_entropy
from twingap.twins.twin_file import TwinSpec

if TYPE_CHECKING:
    from twingap.effects import Effect
    from twingap.gap.knowledge.learnt import Learnt


def without_values(spec: TwinSpec) -> tuple[str, ...]:
    """Effects of the twin file of which it gives no value, and which have one to give."""
    from twingap.gap.search.parameter_scale import coordinates

    learnable = {name for name, _ in coordinates()}
    return tuple(dict.fromkeys(n for n in spec.effects if n in learnable and not spec.parameters.get(n)))


def completed(
    records: RecordSet, spec: TwinSpec, rng: np.random.Generator, learnt: Learnt
) -> tuple[TwinSpec, tuple[str, ...]]:
    """The twin with values for all its effects, and notes of those that were found.

    Parameters
    ----------
    records : RecordSet
        All of them; only the fit part is looked at.
    spec : TwinSpec
    rng : numpy.random.Generator
        In the state in which the calibration will get it, so that the fit part is the same.
    learnt : Learnt

    Raises
    ------
    TwingapError
        When the records cannot be calibrated on.
    """
    names = without_values(spec)
    if not names or spec.model != "phenomenological":
        return spec, ()
    kept = {name: value for name, value in spec.parameters.items() if name not in names}
    bare = replace(spec, effects=tuple(n for n in spec.effects if n not in names), parameters=kept)
    calibrated = calibrate(records, bare, rng)
    evidence = Evidence(calibrated, simulator_of(calibrated), bare, root_entropy(rng) >> 66, THOROUGH)
    found = valued(evidence, learnt, names)
    values = {effect.name: values_of(effect) for effect in found}
    return replace(spec, parameters={**kept, **values}), _told(found)


def _told(found: Sequence[Effect]) -> tuple[str, ...]:
    if not found:
        return ()
    each = "; ".join(
        f"{e.name} ({', '.join(f'{name} = {value:.4g}' for name, value in values_of(e).items())})" for e in found
    )
    return (f"the twin file gives no value of effects that it names; they were read off the fit part: {each}",)
