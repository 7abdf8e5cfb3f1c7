"""Base class of effects: modelling choices that act in one stage of a record.

A vibration record is made in five stages, and an `Effect` is one modelling choice that acts in one of them:

    shaft angle -> excitation -> path -> disturbance -> acquisition

A twin is a chain of effects. A user adds one in a few lines, and all commands treat it like any other::

    @register
    @dataclass(frozen=True)
    class Hum(Effect):
        "A tone at 100 Hz."

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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, Self, cast

import numpy as np

from twingap.effects import measurements
from twingap.effects.drawing import log_uniform
from twingap.errors import TwingapError

if TYPE_CHECKING:
    from twingap.effects.draft import Draft
    from twingap.effects.machine import Machine
    from twingap.effects.observations import Observations
    from twingap.records import Condition, Record, RecordSet

RelativeTo = Literal["", "rate", "run", "speed"]


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
    strength: bool | None = None,
    exact: bool = False,
    searched: bool = True,
    relative_to: RelativeTo | None = None,
    above_nyquist: bool = False,
    log_estimate: bool | None = None,
    choices: tuple[float, ...] = (),
    least_spread: float = 0.0,
) -> Any:
    """A typed parameter of an effect: a dataclass field that knows its unit and range.

    Parameters
    ----------
    default : float
        A medium value: detectable, not extreme.
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
    strength : bool, optional
        Whether the effect vanishes as this goes to 0, so that a smaller value is a weaker effect. By default those in
        multiples of the healthy RMS are.
    exact : bool
        An estimate has this value right or not at all (a number of teeth): estimates are never a little off.
    searched : bool
        False where a search by simulation keeps the estimate: neighbouring values are as wrong as any other, or a few
        simulations do not resolve them.
    relative_to : {"", "rate", "run", "speed"}, optional
        What makes values comparable between machines: nothing; the sampling rate; the run, for a time (s) or a rate
        (1/s) of it; or the speed, for a reference that is set to the median speed and never estimated. By default
        frequencies (Hz) that reach beyond 400 Hz are relative to the sampling rate.
    above_nyquist : bool
        A frequency relative to the sampling rate may lie above half of it.
    log_estimate : bool, optional
        Estimate on a logarithmic scale; as `log` when left out.
    choices : tuple of float
        Allowed values; an estimate becomes the nearest one.
    least_spread : float
        Part of the value by which the ends of its interval lie at least apart from it.
    """
    for what, (low, high) in (("plausible", plausible), ("allowed", allowed)):
        if not low <= high:
            raise TwingapError(f"range {what}=({low:g}, {high:g}) of a parameter ends before it begins")
    places = unit == "Hz" and plausible[1] > _PLACE_IN_SPECTRUM_HZ
    about = {
        "unit": unit, "plausible": plausible, "allowed": allowed, "doc": doc, "log": log, "fitted": fitted,
        "strength": unit == "healthy rms" if strength is None else strength, "exact": exact, "searched": searched,
        "relative_to": ("rate" if places else "") if relative_to is None else relative_to,
        "above_nyquist": above_nyquist, "log_estimate": log if log_estimate is None else log_estimate,
        "choices": choices, "least_spread": least_spread,
    }  # fmt: skip
    return dataclasses.field(default=default, metadata=about)


def profile(default: tuple[float, ...], *, unit: str, doc: str, allowed: tuple[float, float] = (0.0, math.inf)) -> Any:
    """A list of numbers of an effect, such as a frequency response: measured from spectra, never searched.

    Parameters
    ----------
    default : tuple of float
    unit, doc : str
        As for `parameter`.
    allowed : (float, float)
        Closed interval outside which a number has no meaning.
    """
    about = {"unit": unit, "doc": doc, "allowed": allowed, "profile": True}
    return dataclasses.field(default=default, metadata=about)


HEALTHY_RMS: Final = "healthy rms"
"""Unit of amplitudes that are relative to the healthy vibration."""
_PLACE_IN_SPECTRUM_HZ: Final = 400.0
"""Highest plausible value from which a frequency is relative to the sampling rate. A lower value would include rates
of slow processes."""
WEAKER: Final = (0.5, 0.25, 0.12, 0.06)
"""Factors on an effect's strength that a search tries where the estimate is too strong. More factors cost one
simulation each."""
_QUANTILES: Final = (0.1, 0.5, 0.9)
"""Where in a plausible range the default initial values lie. More values cost one simulation each."""

_DECIDING: Final = {
    Stage.SHAFT: measurements.TACHO,
    Stage.EXCITATION: measurements.LONGER,
    Stage.PATH: measurements.HAMMER,
    Stage.DISTURBANCE: measurements.OTHER_SPEED,
    Stage.ACQUISITION: measurements.CHAIN,
}


def apply_effect(effect: Effect, draft: Draft, rng: np.random.Generator, where: str) -> None:
    """Apply an effect to a draft; `where` names what has the effect.

    Raises
    ------
    TwingapError
        When it cannot act on the draft, or changes the number of samples.
    """
    where = f"{where}, effect {effect.name}"
    if reason := effect.cannot_act_on(draft):
        raise TwingapError(reason, where=where)
    effect.apply(draft, rng)
    if draft.x.shape not in ((0,), draft.t.shape):
        raise TwingapError(f"makes samples of shape {draft.x.shape}, {draft.t.shape} expected", where=where)


class Effect(ABC):
    """One modelling choice, acting in one stage. Subclasses are frozen dataclasses of `parameter` fields.

    An effect needs a stage, its parameters and `apply`. All else is what the diagnosis may know of it, and has a
    default that works from the parameters' ranges alone.

    Attributes
    ----------
    stage : Stage
        Where in the chain it acts.
    references : tuple[str, ...]
        Equation, DOI or standard behind it.
    group : str
        Effects of one group resemble each other: where single names are uncertain, the group is named. "" is no group.
    look_alikes : tuple[str, ...]
        Names of effects that it is most easily taken for; `registry.look_alikes` adds those that name it.
    deciding_measurement : str
        Measurement that distinguishes it from these; by default one that isolates its stage.
    features : tuple[str, ...]
        Patterns of the features that indicate it or its look-alikes; empty for all. Its detector uses no others, so
        that it learns no spurious correlations.
    trends : tuple[str, ...]
        Trends of features that indicate it: "on_speed", "on_time".
    draw_weight : float
        Relative frequency in simulated gaps. More for effects that are hard to see, or that few machines could show.
    by_chance : bool
        Whether it acts at a few random moments of a record, so that two simulations of one record may differ much.
    inherent_in : tuple[str, ...]
        Models that have it by their own physics.
    trained : bool
        Whether a detector and estimators are trained for it. An effect of the catalogue without them is a part of the
        closest twin alone, where its group is shown if leaving it out widens the gap significantly.
    measured : bool
        Whether its profiles are measured from spectra of records and twin (`gap.search.free_spectra`).
    told_from_paths : bool
        Whether a certain detection stays although a free path closes more: machines with a path of several modes are
        not taken for it.
    irregular_impacts : tuple of Mapping
        Kinds of irregular impacts that it makes, alone or with others: effects, by name, with their values. With each,
        the closest twin's path and background are measured.
    """

    stage: ClassVar[Stage]
    _registered: ClassVar[bool] = False
    references: ClassVar[tuple[str, ...]] = ()
    group: ClassVar[str] = ""
    look_alikes: ClassVar[tuple[str, ...]] = ()
    deciding_measurement: ClassVar[str] = ""
    features: ClassVar[tuple[str, ...]] = ()
    trends: ClassVar[tuple[str, ...]] = ()
    draw_weight: ClassVar[float] = 1.0
    by_chance: ClassVar[bool] = False
    inherent_in: ClassVar[tuple[str, ...]] = ()
    trained: ClassVar[bool] = True
    measured: ClassVar[bool] = False
    told_from_paths: ClassVar[bool] = False
    irregular_impacts: ClassVar[tuple[Mapping[str, Mapping[str, float]], ...]] = ()

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        stage = getattr(cls, "stage", None)
        if not cls.deciding_measurement and isinstance(stage, Stage):
            cls.deciding_measurement = _DECIDING[stage]

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
        """Reason why this effect cannot act on this draft, or None.

        A draft of a foreign simulator has a waveform but no impacts, for instance.
        """
        return None

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        """Random plausible values, detectable in this machine's records; None where the records cannot show the effect.

        By default from the plausible ranges. An effect's own draw leaves out values that are undetectable.
        """
        values: dict[str, float] = {}
        for field in cls.parameters():
            low, high = field.metadata["plausible"]
            if not field.metadata["fitted"]:
                continue
            if field.type in ("bool", bool):
                values[field.name] = bool(rng.random() < 0.5)
                continue
            value = log_uniform(rng, low, high) if field.metadata["log"] else rng.uniform(low, high)
            values[field.name] = round(value) if field.type in ("int", int) else value
        return values

    def variant(self, machine: Machine, rng: np.random.Generator) -> Effect | None:
        """A form of the effect at these values that real machines have and the catalogue does not, or None.

        Models trained only on the catalogue's form do not transfer to machines with another form. A variant is a
        subclass that is not registered; it has the name of its base.
        """
        return None

    @classmethod
    def read_off(cls, records: Iterable[Record], simulated: Iterable[Record]) -> Mapping[str, float]:
        """Values that the records show exactly, such as a rail: they are set, not searched. None by default.

        Parameters
        ----------
        records : iterable of Record
        simulated : iterable of Record
            Records of the twin without the effect under the same conditions, simulated as they are iterated over.

        Returns
        -------
        Mapping[str, float]
            By parameter; those in units of the healthy rms in the unit of the records.
        """
        return {}

    @classmethod
    def read_off_unit(cls, records: RecordSet, simulated: Iterable[Record]) -> Mapping[str, float]:
        """Values that the records of one unit (bearing, mounting) show exactly. None by default.

        As `read_off`, for values that differ between units, such as the slip of each bearing's cage: in the closest
        twin each unit has its own.
        """
        return {}

    @classmethod
    def certain(cls, seen: Observations) -> bool:
        """Whether features show beyond doubt that the twin lacks it, whatever its detector says. False by default."""
        return False

    @classmethod
    def excluded(cls, seen: Observations) -> bool:
        """Whether features rule it out, whatever its detector and `certain` say. False by default."""
        return False

    @classmethod
    def shows_gap(cls, seen: Observations) -> bool:
        """Whether features show by it that there is a gap, though no test for a gap does. False by default.

        At most one in 100 machines without a gap may show one, over all effects together.
        """
        return False

    @classmethod
    def shown(cls, seen: Observations) -> Mapping[str, float]:
        """Values, by parameter, that features show exactly, in place of learnt estimates. None by default."""
        return {}

    @classmethod
    def shown_errors(cls) -> Mapping[str, float]:
        """Bounds, by parameter, of the errors of nine of ten values of `shown`, on the scale of estimates.

        A search stays near values with such a bound; other values are where it begins.
        """
        return {}

    @classmethod
    def not_read_off(cls, conditions: Sequence[Condition]) -> str:
        """Why records of these conditions cannot show such values, and what to record instead; "" where they can."""
        return ""

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        """Further initial values of a search for the effect's values, besides this estimate.

        By default low, middle and high plausible values of each parameter for an effect without `features`; none for
        others, whose estimates are learnt.
        """
        if self.features:
            return
        for field in self.parameters():
            if not field.metadata["fitted"] or not field.metadata["searched"]:
                continue
            low, high = field.metadata["plausible"]
            if field.metadata["log"]:
                values = [low ** (1 - part) * high**part for part in _QUANTILES]
            else:
                values = [low + part * (high - low) for part in _QUANTILES]
            tried: list[Effect] = [self]
            for place in (self.moved(**{field.name: value}) for value in values):
                if place not in tried:
                    tried.append(place)
                    yield place

    def spectral_values(self, seen: Observations) -> Sequence[Effect]:
        """The few values that explain the mean spectra best, in closed form; none for most effects."""
        return ()

    @classmethod
    def consistent(cls, values: dict[str, float]) -> dict[str, float]:
        """Values made consistent with each other, where each was estimated separately."""
        return values

    @classmethod
    def parameters(cls) -> tuple[dataclasses.Field[Any], ...]:
        """Its fields that are a `parameter`."""
        return tuple(field for field in dataclasses.fields(cast(Any, cls)) if "plausible" in field.metadata)

    @classmethod
    def profiles(cls) -> tuple[dataclasses.Field[Any], ...]:
        """Its fields that are a `profile`."""
        return tuple(field for field in dataclasses.fields(cast(Any, cls)) if "profile" in field.metadata)

    @property
    def listed_profiles(self) -> Mapping[str, tuple[float, ...]]:
        """Its profiles as a report lists them, number by number."""
        return {field.name: getattr(self, field.name) for field in self.profiles()}

    @property
    def idle_parameters(self) -> frozenset[str]:
        """Parameters without influence at the values of others."""
        return frozenset()

    @property
    def measured_parameters(self) -> frozenset[str]:
        """Parameters that records showed, and that a search leaves as they are."""
        return frozenset()

    @property
    def own_noise(self) -> float:
        """Factor on the twin's own noises: below 1 for an effect that brings noise in their place."""
        return 1.0

    @property
    def name(self) -> str:
        """The name in twins, reports and studies: the class name in snake case."""
        return effect_name(type(self))

    def parameter_values(self) -> dict[str, Any]:
        """Its parameters and profiles by name."""
        return {field.name: getattr(self, field.name) for field in (*self.parameters(), *self.profiles())}

    def moved(self, **values: float) -> Self:
        """The effect at other values, each moved into its allowed range."""
        kinds = {field.name: field for field in self.parameters()}
        inside = {name: within_allowed(kinds[name], value) for name, value in values.items()}
        return cast(Self, dataclasses.replace(cast(Any, self), **inside))

    def weakened(self, factor: float) -> Self:
        """The effect at this part of its strength; as it is where none of its parameters is a strength."""
        strengths = [field.name for field in self.parameters() if field.metadata["strength"]]
        return cast(Self, dataclasses.replace(cast(Any, self), **{n: factor * getattr(self, n) for n in strengths}))

    def forms(self) -> Iterator[Effect]:
        """Forms of the effect, at these values of its strength, that units of a machine may have each of their own.

        By default the effect itself, and itself with each of its switches that fitting leaves alone in the other
        position.
        """
        yield self
        yield from self.switched()

    def switched(self) -> Iterator[Self]:
        """The effect with each of its switches that fitting leaves alone in the other position."""
        for field in self.parameters():
            if field.type in ("bool", bool) and not field.metadata["fitted"]:
                yield self.moved(**{field.name: not getattr(self, field.name)})

    def weaker(self) -> list[Self]:
        """The effect at parts `WEAKER` of its strength; none where none of its parameters is a strength."""
        return [one for factor in WEAKER if (one := self.weakened(factor)) != self]

    def __post_init__(self) -> None:
        for field in dataclasses.fields(cast(Any, self)):
            if "allowed" not in field.metadata:
                continue
            value, (low, high) = getattr(self, field.name), field.metadata["allowed"]
            if "profile" in field.metadata:
                object.__setattr__(self, field.name, self._checked_profile(field, value))
                continue
            integer = field.type in (int, bool, "int", "bool")
            unit, expected = field.metadata["unit"], f"between {low:g} and {high:g}"
            allowed = isinstance(value, numbers.Integral if integer else numbers.Real)
            allowed = allowed and math.isfinite(value) and low <= value <= high
            if choices := field.metadata["choices"]:
                allowed = allowed and value in choices
                unit, expected = " or ".join(f"{choice:g}" for choice in choices), unit
            if not allowed:
                raise TwingapError(
                    f"{value!r} found, {unit or ('a whole number' if integer else 'a number')} {expected} expected",
                    where=f"effect {self.name}: {field.name}",
                )

    def _checked_profile(self, field: dataclasses.Field[Any], value: Any) -> tuple[float, ...]:
        """A profile as a tuple of floats."""
        low, high = field.metadata["allowed"]
        numbers_given = isinstance(value, (tuple, list)) and all(
            isinstance(one, numbers.Real) and low <= one <= high and math.isfinite(one) for one in value
        )
        if not numbers_given:
            what, unit = f"{value!r}", field.metadata["unit"] or "numbers"
            raise TwingapError(
                f"{what if len(what) <= 80 else what[:77] + '...'} found, a list of {unit} between {low:g} and "
                f"{high:g} expected",
                where=f"effect {self.name}: {field.name}",
            )
        return tuple(float(one) for one in value)


def within_allowed(field: dataclasses.Field[Any], value: float, most: float = math.inf) -> float:
    """The allowed value of a parameter that is nearest: in its range, one of its choices, an integer.

    Parameters
    ----------
    field : dataclasses.Field
        A `parameter`.
    value : float
    most : float
        Upper end besides the parameter's own.
    """
    low, high = field.metadata["allowed"]
    if choices := field.metadata["choices"]:
        value = min(reversed(choices), key=lambda choice: abs(value - choice))
    value = float(min(max(value, low), min(high, most)))
    if field.type in ("bool", bool):
        return bool(value >= 0.5)
    return round(value) if field.type in ("int", int) else value


def effect_name(kind: type[Effect]) -> str:
    """SecondResonance -> second_resonance. An unregistered subclass of a registered effect has the name of its base."""
    registered = (base for base in kind.__mro__ if vars(base).get("_registered", False))
    return snake_case(next(registered, kind))


@functools.cache
def snake_case(kind: type) -> str:
    """SecondResonance -> second_resonance, whatever is registered."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower()
