"""Messages to a live twin, frequent states and occasional vibration, and the buffer that puts them in order of time.

The watermark is the latest time seen less the lateness allowed (Akidau et al. 2015, doi:10.14778/2824032.2824076): what
is older than it has been let go, and whatever comes from before that is too late. Clocks are taken to be right.
"""

import heapq
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from papers.arrays import Array
from twingap import TwingapError
from twingap.twins.contact_parameters import DEFECTS


@dataclass(frozen=True)
class StateMessage:
    time_s: float  # when it was measured, by the sender's clock; not when it arrived
    temperature_c: float  # of the bearing's outer ring
    speed_rpm: float  # 0 while the machine stands still
    load_n: float | None = None  # radial load; None where there is no load cell: the twin's own holds
    number: int | None = None  # counts the sender's messages; missing ones are then known exactly

    @property
    def usable(self) -> bool:
        """Whether every value is one that a machine can have."""
        values = [self.time_s, self.temperature_c, self.speed_rpm, 0.0 if self.load_n is None else self.load_n]
        if not np.isfinite(values).all():
            return False
        return self.speed_rpm >= 0 and -273.15 < self.temperature_c < 1000 and values[3] >= 0


@dataclass(frozen=True)
class Snapshot:
    time_s: float  # when it begins
    samples: Array = field(repr=False)  # [samples]
    fs_hz: float = 0.0
    fault: str = "healthy"  # what the bearing is known to have; the twin is compared in that state
    number: int | None = None  # as in `StateMessage`; snapshots are counted apart from states

    @property
    def usable(self) -> bool:
        """Whether a spectrum can be taken and compared: finite, long enough, not constant (a torn cable), a fault that
        the contact model knows.
        """
        if self.fault not in ("healthy", *DEFECTS):
            return False
        if not (np.isfinite(self.time_s) and np.isfinite(self.fs_hz) and self.fs_hz > 0 and self.samples.size >= 2048):
            return False
        return bool(np.isfinite(self.samples).all() and np.ptp(self.samples) > 0)


Message = StateMessage | Snapshot


def kind_of(message: Message) -> str:
    """ "state" or "snapshot": what is counted together."""
    return "state" if isinstance(message, StateMessage) else "snapshot"


@dataclass(frozen=True)
class OrderOptions:
    lateness_s: float = 120.0  # how late a message may be against the latest one and still be put in its place
    remembered: int = 4096  # most messages of which it is remembered that they were seen

    def __post_init__(self) -> None:
        for key, low in (("lateness_s", 0.0), ("remembered", 1)):
            if not getattr(self, key) >= low:
                raise TwingapError(f"{key} = {getattr(self, key)!r}, at least {low} expected", where="order options")


_Key = tuple[str, float, int | None]  # what two messages differ in: kind, time, number


class Reorder:
    """The buffer; `counts` are (kind, case) -> messages: of kind "state" or "snapshot", "accepted", "out of order",
    "repeated", "late", "unusable" or "missing" (has not come when its place in the order has passed)."""

    def __init__(self, options: OrderOptions | None = None) -> None:
        self.options = options or OrderOptions()
        self.counts: Counter[tuple[str, str]] = Counter()
        self._heap: list[tuple[float, bool, int, Message]] = []
        self._entered = 0
        self._latest = self._let_go = float("-inf")
        self._seen: dict[_Key, None] = {}
        self._expected: dict[str, int] = {}
        self._first: dict[str, int] = {}

    def push(self, message: Message) -> list[Message]:
        """Take a message; give back those whose turn has come, in order of time."""
        kind = kind_of(message)
        key = kind, message.time_s, message.number
        late = message.time_s < self._let_go
        case = "unusable" if not message.usable else "repeated" if key in self._seen else "late" if late else "accepted"
        self.counts[kind, case] += 1
        if case in ("unusable", "repeated"):
            return []
        self._seen[key] = None
        if len(self._seen) > self.options.remembered:
            del self._seen[next(iter(self._seen))]
        if late:
            number = message.number
            if number is not None and self._first.get(kind, 0) < number < self._expected.get(kind, 0):
                self.counts[kind, "missing"] -= 1  # it was not lost after all; one before the first never was
            return []
        if message.time_s < self._latest:
            self.counts[kind, "out of order"] += 1
        self._latest = max(self._latest, message.time_s)
        # States before snapshots of the same moment: the snapshot is judged in that state.
        heapq.heappush(self._heap, (message.time_s, kind == "snapshot", self._entered, message))
        self._entered += 1
        out = []
        while self._heap and self._heap[0][0] <= self._latest - self.options.lateness_s:
            out.append(self._pop())
        return out

    def flush(self) -> list[Message]:
        """Let go of everything: the stream has ended."""
        return [self._pop() for _ in range(len(self._heap))]

    def _pop(self) -> Message:
        self._let_go, _, _, message = heapq.heappop(self._heap)
        if message.number is not None:
            kind = kind_of(message)
            self._first.setdefault(kind, message.number)
            if kind in self._expected and message.number > self._expected[kind]:
                self.counts[kind, "missing"] += message.number - self._expected[kind]
            self._expected[kind] = max(message.number + 1, self._expected.get(kind, 0))
        return message
