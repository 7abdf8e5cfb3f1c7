"""Messages put in order, in bounded memory: late, out of order, repeated, missing, impossible; each counted.

arriving messages --> usable? --> new? --> not behind the watermark? --> heap, at most `capacity` --> in order of time
                        |          |            |                            |
                    unusable    repeated       late                      overflowed (let go early)

The watermark is the latest time seen less the lateness allowed (Akidau et al. 2015, doi:10.14778/2824032.2824076): what
is older than it has been let go, and whatever comes from before that is too late. A message far ahead of all others
would carry the watermark with it and make the rest late; it is left out, unless the last one that was left out agrees
with it: then a machine is heard of again after a long time. So is the very first one when the second lies far behind.
"""

from __future__ import annotations

import heapq
from collections import Counter, OrderedDict
from dataclasses import dataclass

from twingap.errors import TwingapError
from twingap.twins.live.messages import Message, kind_of

CASES = ("accepted", "out of order", "repeated", "late", "missing", "unusable", "from the future", "overflowed")
"""What is counted, "missing" being what has not come when its place in the order has passed."""


@dataclass(frozen=True)
class OrderOptions:
    """How patient the buffer is.

    Parameters
    ----------
    lateness_s : float
        How late a message may be against the latest one and still be put in its place.
    capacity : int
        Most messages held.
    ahead_s : float
        A message further ahead of all others than this is left out, until a second one agrees with it.
    remembered : int
        Most messages of which it is remembered that they were seen.
    """

    lateness_s: float = 120.0
    capacity: int = 256
    ahead_s: float = 86400.0
    remembered: int = 4096

    def __post_init__(self) -> None:
        for key, low in (("lateness_s", 0.0), ("capacity", 1), ("ahead_s", 0.0), ("remembered", 1)):
            if not getattr(self, key) >= low:
                raise TwingapError(f"{key} = {getattr(self, key)!r}, at least {low} expected", where="order options")


class Reorder:
    """The buffer.

    Parameters
    ----------
    options : OrderOptions

    Attributes
    ----------
    counts : Counter
        (kind, case) -> messages; kinds are "state" and "snapshot", cases those of `CASES`.
    """

    def __init__(self, options: OrderOptions | None = None) -> None:
        self.options = options or OrderOptions()
        self.counts: Counter[tuple[str, str]] = Counter()
        self._heap: list[tuple[float, bool, int, Message]] = []
        self._entered = 0
        self._latest: float | None = None
        self._let_go: float | None = None
        self._ahead: float | None = None
        self._seen: OrderedDict[tuple[str, float, int | None], None] = OrderedDict()
        self._expected: dict[str, int] = {}
        self._first: dict[str, int] = {}

    @property
    def watermark_s(self) -> float | None:
        """Time before which nothing is accepted any more; None before the first message."""
        return None if self._latest is None else self._latest - self.options.lateness_s

    @property
    def held(self) -> int:
        """Messages waiting."""
        return len(self._heap)

    def push(self, message: Message) -> list[Message]:
        """Take a message; give back those whose turn has come, in order of time."""
        kind = kind_of(message)
        if not message.usable:
            self.counts[kind, "unusable"] += 1
            return []
        key = (kind, message.time_s, message.number)
        if key in self._seen:
            self.counts[kind, "repeated"] += 1
            return []
        if self._latest is not None and message.time_s > self._latest + self.options.ahead_s:
            agreed = self._ahead is not None and abs(message.time_s - self._ahead) <= self.options.ahead_s
            self._ahead = message.time_s
            if not agreed:
                self.counts[kind, "from the future"] += 1
                return []
        if self._first_was_ahead(message):
            (_, _, _, first), self._latest = self._heap.pop(), None
            self.counts[kind_of(first), "accepted"] -= 1
            self.counts[kind_of(first), "from the future"] += 1
        if self._let_go is not None and message.time_s < self._let_go:
            self.counts[kind, "late"] += 1
            self._remember(key)
            if message.number is not None and self._first.get(kind, 0) < message.number < self._expected.get(kind, 0):
                self.counts[kind, "missing"] -= 1  # it was not lost after all; one before the first was never missed
            return []
        self._remember(key)
        self.counts[kind, "accepted"] += 1
        if self._latest is not None and message.time_s < self._latest:
            self.counts[kind, "out of order"] += 1
        self._latest = message.time_s if self._latest is None else max(self._latest, message.time_s)
        # States before snapshots of the same moment: the snapshot is judged in that state.
        heapq.heappush(self._heap, (message.time_s, kind == "snapshot", self._entered, message))
        self._entered += 1
        out = []
        while self._heap and self._heap[0][0] <= self._latest - self.options.lateness_s:
            out.append(self._pop())
        while len(self._heap) > self.options.capacity:
            self.counts[kind_of(self._heap[0][-1]), "overflowed"] += 1
            out.append(self._pop())
        return out

    def _first_was_ahead(self, message: Message) -> bool:
        """Whether the only message so far lies so far ahead of this one that its clock was wrong."""
        ahead_s = max(self.options.ahead_s, self.options.lateness_s)
        alone = self._entered == 1 and len(self._heap) == 1
        return alone and self._latest is not None and message.time_s < self._latest - ahead_s

    def flush(self) -> list[Message]:
        """Let go of everything: the stream has ended."""
        return [self._pop() for _ in range(len(self._heap))]

    def _pop(self) -> Message:
        time_s, _, _, message = heapq.heappop(self._heap)
        self._let_go = time_s
        if message.number is not None:
            kind = kind_of(message)
            self._first.setdefault(kind, message.number)
            if kind in self._expected and message.number > self._expected[kind]:
                self.counts[kind, "missing"] += message.number - self._expected[kind]
            self._expected[kind] = max(message.number + 1, self._expected.get(kind, 0))
        return message

    def _remember(self, key: tuple[str, float, int | None]) -> None:
        self._seen[key] = None
        while len(self._seen) > self.options.remembered:
            self._seen.popitem(last=False)
