"""What an effect is: one modelling choice that acts in one stage of a record.

A vibration record is made in five stages, and an `Effect` is one modelling choice that acts in one of them:

    shaft angle -> excitation -> path -> disturbance -> acquisition

A twin is a chain of effects. A user adds one in five lines, and everything downstream treats it alike::

    @register
    @dataclass(frozen=True)
    class Hum(Effect):
        "A tone that nobody modelled."

        stage: ClassVar[Stage] = Stage.DISTURBANCE
        level: float = parameter(0.1, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

        def apply(self, draft: Draft, rng: np.random.Generator) -> None:
            draft.x += self.level * draft.reference_rms * np.sin(2 * np.pi * 100.0 * draft.t)
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import math
import numbers
import re
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from twingap.errors import TwingapError

if TYPE_CHECKING:
    from twingap.effects.draft import Draft


class Stage(enum.IntEnum):
    """The five stages in which a record is made, in order."""

    SHAFT = 0
    EXCITATION = 1
    PATH = 2
    DISTURBANCE = 3
    ACQUISITION = 4


def parameter(
    default: float,
    *,
    unit: str,
    plausible: tuple[float, float],
    doc: str,
    allowed: tuple[float, float] = (0.0, math.inf),
    log: bool = False,
    fitted: bool = True,
) -> Any:
    """A typed parameter of an effect: a dataclass field that knows its unit and range.

    Parameters
    ----------
    default : float
        A middling value: visible, not extreme.
    unit : str
        "" for dimensionless.
    plausible : (float, float)
        Where real machines lie: bounds for fitting and for random draws.
    doc : str
        What it is, in a few words.
    allowed : (float, float)
        Closed interval outside which the effect has no meaning; construction fails there.
    log : bool
        Fit and draw on a logarithmic scale.
    fitted : bool
        False for a convention or a switch (50 or 60 Hz, say), which fitting leaves alone.
    """
    about = {"unit": unit, "plausible": plausible, "allowed": allowed, "doc": doc, "log": log, "fitted": fitted}
    return dataclasses.field(default=default, metadata=about)


class Effect(ABC):
    """One modelling choice, acting in one stage. Subclasses are frozen dataclasses of `parameter` fields.

    Attributes
    ----------
    stage : Stage
        Where in the chain it acts.
    references : tuple[str, ...]
        Equation, DOI or standard behind it.
    """

    stage: ClassVar[Stage]
    references: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        """Change the record under construction in place.

        Parameters
        ----------
        draft : Draft
            The record so far; an effect touches only what its stage owns (see `Draft`).
        rng : numpy.random.Generator
            The effect's own stream for this record.
        """

    def cannot_act_on(self, draft: Draft) -> str | None:
        """Why this effect cannot act on this draft, or None when it can.

        A draft of a foreign simulator has a waveform but no impacts, for instance.
        """
        return None

    @property
    def name(self) -> str:
        """The name in twins, reports and studies: the class name in snake case."""
        return effect_name(type(self))

    def __post_init__(self) -> None:
        for field in dataclasses.fields(cast(Any, self)):
            if "allowed" not in field.metadata:
                continue
            value, (low, high) = getattr(self, field.name), field.metadata["allowed"]
            whole = field.type in (int, bool, "int", "bool")
            if (
                not isinstance(value, numbers.Integral if whole else numbers.Real)
                or not math.isfinite(value)
                or not low <= value <= high
            ):
                unit = field.metadata["unit"] or ("a whole number" if whole else "a number")
                raise TwingapError(
                    f"{value!r} found, {unit} between {low:g} and {high:g} expected",
                    where=f"effect {self.name}: {field.name}",
                )


@functools.cache
def effect_name(kind: type[Effect]) -> str:
    """SecondResonance -> second_resonance."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower()
