"""Base class of twins: a chain of effects around a model of excitation and path.

Condition -> Draft -> SHAFT effects -> excite -> EXCITATION effects -> PATH effects -> respond
                   -> white noise -> DISTURBANCE effects -> ACQUISITION effects -> Record
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ClassVar, Final, Literal, Self

import numpy as np

from twingap.bearing import Bearing
from twingap.effects import Draft, Effect, Stage, in_order
from twingap.effects.base import apply_effect
from twingap.effects.modes import LEAD
from twingap.errors import TwingapError
from twingap.records import Condition, Record, RecordSet
from twingap.streams import Streams, root_entropy

_MOST_TURNS: Final = 10

GPU_SAMPLES: Final = 2**24
"""Samples of a batch for a GPU, which needs many records at once. More need more memory, some 60 bytes each."""


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
    excitation : {"impacts", "rollers", "waveform"}
        What its drafts let an effect act on, see `Draft`.
    inherent_effects : frozenset[str]
        Effects that follow from its own physics: naming one is allowed and changes nothing.
    devices : tuple[str, ...]
        Where its response can be computed.
    device : str
        Where it is computed, see `on`.
    """

    model: ClassVar[str]
    batch: ClassVar[int] = 1
    excitation: ClassVar[Literal["impacts", "rollers", "waveform"]] = "impacts"
    inherent_effects: ClassVar[frozenset[str]] = frozenset()
    devices: ClassVar[tuple[str, ...]] = ("cpu",)
    device: str = "cpu"

    def __init__(self, bearing: Bearing, effects: Iterable[Effect] = (), unit: str = "m/s^2") -> None:
        self.bearing, self.unit = bearing, unit
        self.effects = in_order(tuple(effects))
        names = [effect.name for effect in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise TwingapError(f"effect {name!r} is named twice", where=f"twin {self.model}")

    def on(self, device: str) -> Self:
        """This twin, computing its response on another device from now on.

        Parameters
        ----------
        device : {"cpu", "cuda"}
            "cuda": an NVIDIA GPU, for many records of the contact twin at once. Random numbers and effects stay on the
            CPU, so that each record is the same within rounding.

        Raises
        ------
        TwingapError
            For an unknown device, one that this twin cannot use, or one that is not there.
        """
        where = f"twin {self.model}"
        if device not in ("cpu", "cuda"):
            raise TwingapError(f"unknown device {device!r}", where=where, mend="use cpu or cuda")
        if device not in self.devices:
            what = f"only the integration of the contact twin runs on {device!r}"
            raise TwingapError(what, where=where, mend="leave the device out")
        if device == "cuda":
            try:
                from twingap.twins import gpu
            except ImportError as error:
                raise TwingapError(
                    f"numba has no CUDA: {error}", where=where, mend="pip install 'twingap[gpu]'"
                ) from error
            gpu.check(where)
        self.device = device
        return self

    @property
    @abstractmethod
    def reference_rms(self) -> float:
        """RMS of the healthy vibration, in `unit`, to which disturbances are relative."""

    @property
    @abstractmethod
    def white_noise_rms(self) -> float:
        """RMS of the measuring chain's white noise, in `unit`."""

    @abstractmethod
    def excite(self, draft: Draft, streams: Streams) -> None:
        """Set excitation (impacts, force) and modes of the structure, after the SHAFT effects."""

    @abstractmethod
    def respond(self, drafts: Sequence[Draft]) -> None:
        """Compute the waveform x of each draft with its filters, after the PATH effects."""

    def make(self, conditions: Sequence[Condition], streams: Sequence[Streams]) -> list[Record]:
        """Simulate one record per condition, each with its own random streams."""
        drafts = self.prepare(conditions, streams)
        self.respond(drafts)
        return self.finish(drafts, streams)

    def prepare(self, conditions: Sequence[Condition], streams: Sequence[Streams]) -> list[Draft]:
        """First half of `make`: all stages before the response of the structure."""
        drafts = [self._begin(condition) for condition in conditions]
        for draft, own in zip(drafts, streams, strict=True):
            self._act(Stage.SHAFT, draft, own)
            self.excite(draft, own)
            self._act(Stage.EXCITATION, draft, own)
            self._act(Stage.PATH, draft, own)
        return drafts

    def finish(self, drafts: Sequence[Draft], streams: Sequence[Streams]) -> list[Record]:
        """Second half of `make`: all stages after the response of the structure."""
        for draft, own in zip(drafts, streams, strict=True):
            if self.white_noise_rms > 0:
                draft.x += draft.own_noise * self.white_noise_rms * _white(draft, own)
            self._act(Stage.DISTURBANCE, draft, own)
            self._act(Stage.ACQUISITION, draft, own)
        return [Record(draft.condition, draft.x) for draft in drafts]

    def stream(
        self, conditions: Iterable[Condition], rng: np.random.Generator, threads: int | None = None
    ) -> Iterator[Record]:
        """Simulate records in batches, in order and with bounded memory.

        Parameters
        ----------
        conditions : iterable of Condition
        rng : numpy.random.Generator
            Drawn from once; record i depends on that draw and on i alone, so the bytes are the same on any number of
            threads.
        threads : int, optional
            Batches made at once. None is `default_threads()`.

        Yields
        ------
        Record
        """
        root, batches = root_entropy(rng), _batches(conditions, self.batch, GPU_SAMPLES if self.device == "cuda" else 0)

        def made(start: int, batch: list[Condition]) -> list[Record]:
            return self.make(batch, [Streams(root, start + i) for i in range(len(batch))])

        threads = threads or self.default_threads()
        if threads == 1:
            for start, batch in batches:
                yield from made(start, batch)
            return
        with ThreadPoolExecutor(threads) as pool:
            waiting: deque[Future[list[Record]]] = deque()
            try:
                for start, batch in batches:
                    waiting.append(pool.submit(made, start, batch))
                    # Some batches ahead keep all threads busy.
                    if len(waiting) > 2 * threads:
                        yield from waiting.popleft().result()
                while waiting:
                    yield from waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def default_threads(self) -> int:
        """Default number of batches to make at once. 1 for a model whose kernel uses all cores by itself."""
        return 1

    def simulate(self, conditions: Iterable[Condition], rng: np.random.Generator) -> RecordSet:
        """Records of these conditions, in memory; for many records, use `stream`."""
        return RecordSet.from_records(f"{self.model} twin", self.unit, self.bearing, self.stream(conditions, rng))

    def _begin(self, condition: Condition) -> Draft:
        per_sample = condition.speed_rpm / 60 / condition.fs_hz
        if per_sample > _MOST_TURNS:  # each turn has impacts, which need memory
            raise TwingapError(
                f"the shaft turns {per_sample:.3g} times per sample, at most {_MOST_TURNS} expected",
                where=f"record {condition.name!r}",
                mend="check speed_rpm, or raise fs_hz",
            )
        t = np.arange(condition.n_samples) / condition.fs_hz
        turns = t * (condition.speed_rpm / 60)
        own_noise = math.prod(effect.own_noise for effect in self.effects)
        return Draft(
            condition, self.bearing, self.reference_rms, t, turns, excitation=self.excitation, own_noise=own_noise
        )

    def _act(self, stage: Stage, draft: Draft, streams: Streams) -> None:
        for effect in self.effects:
            if effect.stage == stage and effect.name not in self.inherent_effects:
                apply_effect(effect, draft, streams(effect.name), f"twin {self.model}")


def _white(draft: Draft, streams: Streams) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """[samples] White noise of unit power: that of the measuring chain, and that which passes the sensor."""
    n = draft.x.size
    white, _ = streams.normal("white_noise", n)
    if not draft.sensed_noise:
        return white
    part = max(part for part, _ in draft.sensed_noise)
    before, _ = streams.normal("background", LEAD + n)
    for _, act in draft.sensed_noise:
        before = act(before)
    return np.asarray(math.sqrt(1 - part) * white + math.sqrt(part) * before[LEAD:])


def _batches(conditions: Iterable[Condition], size: int, samples: int) -> Iterator[tuple[int, list[Condition]]]:
    """Index of the first condition, and the conditions, of each batch: `size` records, or more for so many samples."""
    done, long, batch = 0, 0.0, list[Condition]()
    for condition in conditions:
        batch.append(condition)
        # A short record is integrated from long before its start.
        long += max(condition.n_samples, condition.fs_hz / 8)
        if len(batch) >= size and long >= samples:
            yield done, batch
            done, long, batch = done + len(batch), 0.0, []
    if batch:
        yield done, batch
