"""Journal of a live twin: updates with reasons, evaluated snapshots, unusable messages.

updates, evaluations, counts --> data frames --> tracker
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from papers.paper2_digital_twin.live_twin.spectrum import FREE

if TYPE_CHECKING:
    import pandas as pd

    from twingap.track import Run

Array = NDArray[np.float64]
Kind = Literal["law", "commissioning", "drift", "following", "kept"]
"""law: clearance and damping followed temperature. commissioning, drift, following: stiffness, damping and levels were
identified anew. kept: they should have been, and were not; `why` says the reason."""


@dataclass(frozen=True)
class Update:
    """One change of the twin, or one that was refused."""

    time_s: float  # of the message that caused it, by the sender's clock
    kind: Kind
    why: str
    # before, after: name -> value: stiffness (N/m^1.5), damping (N s/m), clearance_um, force_level, white_noise in the
    # state at hand; temperature_c for which they hold
    before: dict[str, float]
    after: dict[str, float]
    error_before: float | None = None  # error_before, error_after: relative error of the spectra that it was fitted to
    error_after: float | None = None
    snapshots: int = 0  # how many those were
    # what it cost: CPU seconds of this process, so that neighbours on a shared machine do not count
    seconds: float = 0.0


@dataclass(frozen=True)
class Evaluation:
    """One snapshot against the twin as it was before it saw it."""

    time_s: float
    error: float  # relative error of the amplitude spectrum
    shape: float  # what is left of it when the twin's spectrum may be scaled as a whole
    deviation: tuple[float, ...]  # by how much the logarithms of `FREE` seem off
    # the same in standard deviations, for the parameters that are watched; empty before commissioning is over
    z: tuple[float, ...] = ()


@dataclass
class Journal:
    """Kept while the twin lives; bounded: of each list the last `capacity` entries."""

    capacity: int = 100_000
    counts: Counter[tuple[str, str]] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.updates: deque[Update] = deque(maxlen=self.capacity)
        self.evaluations: deque[Evaluation] = deque(maxlen=self.capacity)

    def frame(self) -> pd.DataFrame:
        """A row per update: when, what kind, why, from, to."""
        import pandas as pd

        rows: list[dict[str, Any]] = []
        for each in self.updates:
            row: dict[str, Any] = {"time_s": each.time_s, "kind": each.kind, "why": each.why}
            for name in each.before:
                row[f"{name} from"], row[f"{name} to"] = each.before[name], each.after[name]
            row |= {
                "error from": each.error_before, "error to": each.error_after, "snapshots": each.snapshots,
                "seconds": each.seconds,
            }  # fmt: skip
            rows.append(row)
        return pd.DataFrame(rows)

    def judged(self) -> pd.DataFrame:
        """A row per snapshot: error before the twin saw it, and what seemed off."""
        import pandas as pd

        rows = []
        for each in self.evaluations:
            row = {"time_s": each.time_s, "error": each.error, "shape": each.shape}
            row |= {f"{name} off": value for name, value in zip(FREE, each.deviation, strict=True)}
            row |= {f"{name} z": value for name, value in zip(FREE, each.z, strict=False)}
            rows.append(row)
        return pd.DataFrame(rows)

    def messages(self) -> pd.DataFrame:
        """A row per kind of message and what became of it."""
        import pandas as pd

        rows = [{"message": kind, "case": case, "count": n} for (kind, case), n in sorted(self.counts.items())]
        return pd.DataFrame(rows, columns=["message", "case", "count"])

    def log(self, run: Run) -> None:
        """The three tables and the numbers of updates, to a tracker's run."""
        for name, frame in (("updates", self.frame()), ("judged", self.judged()), ("messages", self.messages())):
            if len(frame):
                run.table(name, frame)
        kinds = Counter(each.kind for each in self.updates)
        run.metrics({f"updates {kind}": float(n) for kind, n in kinds.items()})
