"""What a twin is: a chain of effects around a model of the excitation and of the path.

Condition -> Draft -> SHAFT effects -> excite -> EXCITATION effects -> PATH effects -> respond
                   -> white noise -> DISTURBANCE effects -> ACQUISITION effects -> Record
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import ClassVar

import numpy as np

from twingap.bearing import Bearing
from twingap.effects import Draft, Effect, Stage, in_order
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.streams import Streams, root_entropy


class Twin(ABC):
    """A simulator of one machine.

    Parameters
    ----------
    bearing : Bearing
        Geometry of the bearing under test.
    effects : iterable of Effect
        What is modelled beyond the baseline, in any order; they act in the order of the chain.
    unit : str
        Unit of the samples it makes.

    Attributes
    ----------
    model : str
        Its name in twin files.
    batch : int
        How many records it makes at once (one vector's worth of trajectories, say).
    """

    model: ClassVar[str]
    batch: ClassVar[int] = 1

    def __init__(self, bearing: Bearing, effects: Iterable[Effect] = (), unit: str = "m/s^2") -> None:
        self.bearing, self.unit = bearing, unit
        self.effects = in_order(tuple(effects))
        names = [effect.name for effect in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise TwingapError(f"effect {name!r} is named twice", where=f"twin {self.model}")

    @property
    @abstractmethod
    def reference_rms(self) -> float:
        """RMS of the healthy vibration, in `unit`: the yardstick of disturbances."""

    @property
    @abstractmethod
    def white_noise_rms(self) -> float:
        """RMS of the measuring chain's white noise, in `unit`."""

    @abstractmethod
    def excite(self, draft: Draft, streams: Streams) -> None:
        """After the SHAFT effects: say what excites the structure (impacts, force) and through which modes."""

    @abstractmethod
    def respond(self, drafts: Sequence[Draft]) -> None:
        """After the PATH effects: make each draft's waveform x, its filters applied."""

    def make(self, conditions: Sequence[Condition], streams: Sequence[Streams]) -> list[Record]:
        """Make one record per condition, each from its own random streams."""
        drafts = [self._begin(condition) for condition in conditions]
        for draft, own in zip(drafts, streams, strict=True):
            self._act(Stage.SHAFT, draft, own)
            self.excite(draft, own)
            self._act(Stage.EXCITATION, draft, own)
            self._act(Stage.PATH, draft, own)
        self.respond(drafts)
        for draft, own in zip(drafts, streams, strict=True):
            if self.white_noise_rms > 0:
                draft.x += self.white_noise_rms * own("white_noise").standard_normal(draft.x.size)
            self._act(Stage.DISTURBANCE, draft, own)
            self._act(Stage.ACQUISITION, draft, own)
        return [Record(draft.condition, draft.x) for draft in drafts]

    def stream(self, conditions: Iterable[Condition], rng: np.random.Generator) -> Iterator[Record]:
        """Make records one batch at a time, in bounded memory however many there are.

        Parameters
        ----------
        conditions : iterable of Condition
        rng : numpy.random.Generator
            Drawn from once; record i depends on that draw and on i alone.

        Yields
        ------
        Record
        """
        root, source, done = root_entropy(rng), iter(conditions), 0
        while batch := list(islice(source, self.batch)):
            yield from self.make(batch, [Streams(root, done + i) for i in range(len(batch))])
            done += len(batch)

    def simulate(self, conditions: Iterable[Condition], rng: np.random.Generator) -> RecordSet:
        """The records of these conditions, in memory. For many, write `stream` to disk instead."""
        return RecordSet.from_records(f"{self.model} twin", self.unit, self.bearing, self.stream(conditions, rng))

    def _begin(self, condition: Condition) -> Draft:
        t = np.arange(condition.n_samples) / condition.fs_hz
        return Draft(condition, self.bearing, self.reference_rms, t, t * (condition.speed_rpm / 60))

    def _act(self, stage: Stage, draft: Draft, streams: Streams) -> None:
        for effect in self.effects:
            if effect.stage == stage:
                if reason := effect.cannot_act_on(draft):
                    raise TwingapError(reason, where=f"twin {self.model}, effect {effect.name}")
                effect.apply(draft, streams(effect.name))
