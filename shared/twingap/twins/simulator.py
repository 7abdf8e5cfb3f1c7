"""Simulators of a diagnosis: records of given conditions with any effects, with common random numbers.

conditions + effects --TwinSimulator------> the twin with those effects, streams by record and replicate --> records
                     --ExternalSimulator--> the user's simulated records (`gap.external_simulator`) ------> records

The random numbers of a record depend on the root, the replicate, its condition's name and the purpose alone: records
simulated with and without an effect differ by that effect and by nothing else.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects import Draft, Effect, catalogue, in_order, make_effect
from twingap.errors import TwingapError
from twingap.records import Condition, Record
from twingap.streams import KeptStreams, Streams
from twingap.twins.base import Twin
from twingap.twins.twin_file import TwinSpec, build_twin

Array = NDArray[np.float64]


class Simulator(Protocol):
    """Interface of a simulator of a diagnosis.

    Attributes
    ----------
    name : str
        For the report.
    has : tuple[str, ...]
        Effects that it models already.
    makes_waveforms : bool
        Whether it is the user's own, which makes finished waveforms: a record set or a function.
    reference_rms : float
        RMS of its healthy vibration, in the unit of the records, to which effects are relative.
    """

    name: str
    has: tuple[str, ...]

    @property
    def makes_waveforms(self) -> bool: ...

    @property
    def reference_rms(self) -> float: ...

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """One record per condition, with effects in addition to those that it models.

        Parameters
        ----------
        effects : tuple of Effect
            One that it has already is not added again.
        conditions : sequence of Condition
        streams_root : int
            Entropy of all random numbers: the same root gives the same ones for all effects.
        replicate : int
            Number of the replicate, from 0; each has its own random numbers.
        """
        ...

    def can_add(self, name: str) -> str | None:
        """Reason why an effect cannot be added; None when it can."""
        ...


def streams_of(condition: Condition, streams_root: int, replicate: int) -> Streams:
    """Random streams of one record, which depend on its name and not on other records."""
    return KeptStreams(streams_root, (replicate << 32) | zlib.crc32(condition.name.encode()))


def _forbids(name: str, draft: Draft) -> str | None:
    try:
        return make_effect(name).cannot_act_on(draft)
    except TwingapError as error:
        return error.what


class TwinSimulator:
    """Simulator of a twin file's twin, with effects added to it.

    Parameters
    ----------
    spec : TwinSpec
        With all its parameters.
    bearing : Bearing, optional
        Of the records; the file's own when absent.
    unit : str
        Of the records.
    conditions : sequence of Condition, optional
        Those to be simulated, which `can_add` checks.

    Raises
    ------
    TwingapError
        For a twin that cannot be built.
    """

    def __init__(
        self,
        spec: TwinSpec,
        bearing: Bearing | None = None,
        unit: str = "m/s^2",
        conditions: Sequence[Condition] = (),
    ) -> None:
        self.spec, self.unit = spec, unit
        self.twin = build_twin(spec, bearing, unit)
        self.bearing = self.twin.bearing
        self.name = spec.model
        self.has = tuple(effect.name for effect in self.twin.effects)
        if self.makes_waveforms:  # stated by whom it was registered
            self.has = (*self.has, *sorted(self.twin.inherent_effects))
        self.conditions = tuple(conditions)

    @property
    def makes_waveforms(self) -> bool:
        """Whether the twin is a function of the user's."""
        return self.twin.excitation == "waveform"

    @property
    def reference_rms(self) -> float:
        """RMS of its healthy vibration, in the unit of the records."""
        return self.twin.reference_rms

    def simulate(
        self, effects: tuple[Effect, ...], conditions: Sequence[Condition], streams_root: int, replicate: int
    ) -> list[Record]:
        """See `Simulator.simulate`."""
        twin = self._with(effects)
        streams = [streams_of(c, streams_root, replicate) for c in conditions]
        out: list[Record] = []
        for begin in range(0, len(conditions), twin.batch):
            end = begin + twin.batch
            out += twin.make(conditions[begin:end], streams[begin:end])
        return out

    def _with(self, effects: tuple[Effect, ...]) -> Twin:
        more = [e for e in effects if e.name not in self.has]
        if not more:
            return self.twin
        twin = build_twin(self.spec, self.bearing, self.unit)
        return _chained(twin, (*twin.effects, *more))

    def can_add(self, name: str) -> str | None:
        """See `Simulator.can_add`."""
        if name in self.twin.inherent_effects:
            return "it follows from the twin's own physics"
        if name in self.has:
            return "the twin already has it"
        return why_not(name, self.conditions, self.bearing, self.twin.reference_rms, self.twin.excitation)


def _chained(twin: Twin, effects: tuple[Effect, ...]) -> Twin:
    """The same twin object with another chain of effects."""
    twin.effects = in_order(effects)
    return twin


def why_not(
    name: str,
    conditions: Sequence[Condition],
    bearing: Bearing,
    reference_rms: float,
    excitation: Literal["impacts", "rollers", "waveform"],
    force_response: Callable[[], Array | None] = lambda: None,
) -> str | None:
    """Reason why an effect cannot act on any record of these conditions; None when it can act on one.

    Conditions are checked at a very high sampling rate, since default parameters may be impossible at some rates (a
    carrier above half the rate) where others are possible.
    """
    if name not in catalogue():
        return f"unknown effect {name!r}"
    checked = conditions or (Condition("any", 1800.0, 1e6, 64, "inner"),)
    reasons = set()
    for fault in dict.fromkeys(c.fault for c in checked):
        condition = Condition("any", 1800.0, 1e6, 64, fault)
        t = np.arange(64) / condition.fs_hz
        draft = Draft(
            condition, bearing, reference_rms, t, t * 30.0, excitation=excitation, force_response=force_response
        )
        reason = _forbids(name, draft)
        if reason is None:
            return None
        reasons.add(reason)
    return min(reasons)
