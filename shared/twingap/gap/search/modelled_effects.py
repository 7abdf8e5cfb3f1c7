"""Values of modelled effects that the twin file names without a value, estimated on the fit part.

twin without them --calibrate--> features of the fit part --estimates, then optimised--> twin with their values

A modelled effect at a default value that differs from the machine's would cause a gap, and the diagnosis would name
another effect for it. An effect with at least one given value keeps the defaults of its other parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twingap.effects import Effect
from twingap.gap.knowledge.learnt import Learnt
from twingap.gap.search.effect_search import with_fitted_values
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.gap.search.parameter_scale import coordinates
from twingap.identification.calibrate import Prepared, calibrate_prepared
from twingap.streams import root_entropy
from twingap.twins.twin_file import TwinSpec


def without_values(spec: TwinSpec) -> tuple[str, ...]:
    """Effects with learnable parameters for which the twin file gives no value."""
    learnable = {name for name, _ in coordinates()}
    return tuple(dict.fromkeys(n for n in spec.effects if n in learnable and not spec.parameters.get(n)))


def completed(
    prepared: Prepared, spec: TwinSpec, rng: np.random.Generator, learnt: Learnt
) -> tuple[TwinSpec, tuple[str, ...]]:
    """The twin with values for all its effects, and notes for the report that name the estimated ones.

    Only the fit part of the records is used. `rng` is a copy of the generator that is passed to the calibration.

    Raises
    ------
    TwingapError
        When the calibration fails.
    """
    names = without_values(spec)
    if not names or spec.model != "phenomenological":
        return spec, ()
    kept = {name: value for name, value in spec.parameters.items() if name not in names}
    bare = replace(spec, effects=tuple(n for n in spec.effects if n not in names), parameters=kept)
    calibrated = calibrate_prepared(prepared, bare, rng)
    evidence = Evidence(calibrated, simulator_of(calibrated), bare, root_entropy(rng) >> 66, THOROUGH)
    found = with_fitted_values(evidence, learnt, names)
    values = {effect.name: effect.parameter_values() for effect in found}
    return replace(spec, parameters={**kept, **values}), _notes(found)


def _notes(found: Sequence[Effect]) -> tuple[str, ...]:
    """Note on the estimated values, for the report."""
    if not found:
        return ()
    each = []
    for effect in found:
        values = ", ".join(
            f"{name} = {_words(value)}"
            for name, value in effect.parameter_values().items()
            if name not in effect.idle_parameters and value != ()
        )
        each.append(f"{effect.name} ({values})")
    return (f"the twin file names effects without a value; they were estimated on the fit part: {'; '.join(each)}",)


def _words(value: float | Sequence[float]) -> str:
    """A number, or the numbers of a list."""
    return f"{value:.4g}" if isinstance(value, (int, float)) else "[" + ", ".join(f"{one:.4g}" for one in value) + "]"
