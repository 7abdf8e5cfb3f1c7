"""Buffer that puts messages in order of time, in bounded memory, and counts those that it cannot use.

arriving messages --> usable? --> new? --> not behind the watermark? --> heap, at most `capacity` --> in order of time
                        |          |            |                            |
                    unusable    repeated       late                      overflowed (let go early)

The watermark is the latest time seen less the lateness allowed (Akidau et al. 2015, doi:10.14778/2824032.2824076): what
is older than it has been let go, and whatever comes from before that is too late. A message far ahead of all others
would carry the watermark with it and make the rest late; it is left out, unless the last one that was left out, another
one, agrees with it: then a machine is heard of again after a long time. So is the very first one when the second lies
far behind.

The other way round, a clock may have been set back: the sender has started again at 0, or what it sent first was dated
by a clock that ran far ahead until it was set. Then all that follows would be late for ever. `BEGUN_ANEW` messages one
after another, each far behind and close to the one before it, make the buffer let go of what it holds and begin anew
with them; nothing but this makes what comes out go back in time.
"""

from __future__ import annotations

import heapq
import zlib
from collections import Counter, OrderedDict
from dataclasses import dataclass
from typing import Final

from papers.paper2_digital_twin.live_twin.messages import Message, StateMessage, kind_of
from twingap import TwingapError

CASES = (
    "accepted", "out of order", "repeated", "late", "missing", "unusable", "from the future", "overflowed",
    "begun anew",
)  # fmt: skip
"""What is counted, "missing" being what has not come when its place in the order has passed. "begun anew" is no fate of
a message but how often a clock was set back, counted with the kind of message that settled it."""
BEGUN_ANEW: Final = 5
"""Messages in a row that show the clock was set back. A few that were days on their way come singly, among those of
now; held are so few that snapshots among them cost little memory."""


@dataclass(frozen=True)
class OrderOptions:
    lateness_s: float = 120.0  # how late a message may be against the latest one and still be put in its place
    capacity: int = 256  # most messages held
    # A message further ahead of all others than this is left out, until a second one agrees with it: no further from it
    # than this. One as far behind the latest (and beyond `lateness_s`) is late, until `BEGUN_ANEW` agree.
    ahead_s: float = 86400.0
    remembered: int = 4096  # most messages of which it is remembered that they were seen

    def __post_init__(self) -> None:
        for key, low in (("lateness_s", 0.0), ("capacity", 1), ("ahead_s", 0.0), ("remembered", 1)):
            if not getattr(self, key) >= low:
                raise TwingapError(f"{key} = {getattr(self, key)!r}, at least {low} expected", where="order options")


_Key = tuple[str, float, int | None]
"""What two messages differ in: kind, time, number."""
_Content = tuple[float | None, ...]


class Reorder:
    """The buffer.

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
        self._ahead: _Key | None = None
        self._behind: dict[_Key, Message] = {}
        self._seen: OrderedDict[_Key, _Content] = OrderedDict()
        self._expected: dict[str, int] = {}
        self._first: dict[str, int] = {}

    @property
    def watermark_s(self) -> float | None:
        """Time before which nothing is accepted any more; None before the first message."""
        return None if self._latest is None else self._latest - self.options.lateness_s

    @property
    def held(self) -> int:
        return len(self._heap)

    def push(self, message: Message) -> list[Message]:
        """Take a message; give back those whose turn has come, in order of time."""
        kind = kind_of(message)
        key = kind, message.time_s, message.number
        if not message.usable:
            return self._leave_out(kind, "unusable")
        if self._repeated(key, message):
            return self._leave_out(kind, "repeated")
        if self._latest is not None and message.time_s > self._latest + self.options.ahead_s:
            agreed = self._ahead is not None and self._agree(self._ahead, key)
            self._ahead = None if agreed else key
            if not agreed:
                self._remember(key, message)
                return self._leave_out(kind, "from the future")
        if self._entered == 1 and len(self._heap) == 1 and self._far_behind(message):
            # The only message so far lies so far ahead of this one that its clock was wrong.
            (_, _, _, first), self._latest = self._heap.pop(), None
            self.counts[kind_of(first), "accepted"] -= 1
            self.counts[kind_of(first), "from the future"] += 1
        if self._far_behind(message):
            return self._hold_behind(key, message)
        self._behind.clear()
        if self._let_go is not None and message.time_s < self._let_go:
            self._leave_late(key, message)
            return []
        self._remember(key, message)
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

    def _leave_out(self, kind: str, case: str) -> list[Message]:
        self.counts[kind, case] += 1
        return []

    def _repeated(self, key: _Key, message: Message) -> bool:
        """Whether it was seen before.

        A sender that starts again at 0 may name times and numbers of its first start, but with other content.
        """
        # The last one ahead and those behind are known beside `_seen`, which may remember fewer.
        if key == self._ahead or key in self._behind:
            return True
        return key in self._seen and not (self._far_behind(message) and self._seen[key] != _content_of(message))

    def _agree(self, one: _Key, other: _Key) -> bool:
        """Whether two messages may be by the same clock."""
        return abs(other[1] - one[1]) <= self.options.ahead_s

    def _far_behind(self, message: Message) -> bool:
        """Whether it lies so far behind the latest that one of the two clocks was wrong."""
        far_s = max(self.options.ahead_s, self.options.lateness_s)
        return self._latest is not None and message.time_s < self._latest - far_s

    def _leave_late(self, key: _Key, message: Message) -> None:
        self.counts[key[0], "late"] += 1
        self._remember(key, message)
        if self._was_missed(message):
            self.counts[key[0], "missing"] -= 1  # it was not lost after all

    def _was_missed(self, message: Message) -> bool:
        """Whether a late message has been counted as missing; one before the first never was."""
        kind, number = kind_of(message), message.number
        return number is not None and self._first.get(kind, 0) < number < self._expected.get(kind, 0)

    def _hold_behind(self, key: _Key, message: Message) -> list[Message]:
        """Late, unless enough of its like come in a row: the clock was set back, and a new stream begins with them.

        What is held of the old one is let go before them.
        """
        if self._behind and not self._agree(next(reversed(self._behind)), key):
            self._behind.clear()
        self._leave_late(key, message)
        self._behind[key] = message
        if len(self._behind) < BEGUN_ANEW:
            return []
        again, self._behind = list(self._behind.values()), {}
        for each in again:
            self.counts[kind_of(each), "late"] -= 1
            if self._was_missed(each):
                self.counts[kind_of(each), "missing"] += 1
        out = self.flush()
        self.counts[key[0], "begun anew"] += 1
        self._latest = self._let_go = self._ahead = None
        self._seen.clear()
        self._expected.clear()
        self._first.clear()
        for each in sorted(again, key=lambda m: (m.time_s, kind_of(m) == "snapshot")):
            out += self.push(each)
        return out

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

    def _remember(self, key: _Key, message: Message) -> None:
        self._seen[key] = _content_of(message)
        self._seen.move_to_end(key)
        while len(self._seen) > self.options.remembered:
            self._seen.popitem(last=False)


def _content_of(message: Message) -> _Content:
    """Key of a message's content, short enough to be kept."""
    if isinstance(message, StateMessage):
        return message.temperature_c, message.speed_rpm, message.load_n
    return (zlib.crc32(message.samples.tobytes()),)
