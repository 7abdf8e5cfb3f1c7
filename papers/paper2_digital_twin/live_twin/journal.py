"""Journal of a live twin: updates with reasons, evaluated snapshots, and what became of messages."""

from collections import Counter, deque
from dataclasses import asdict, dataclass, field
from typing import Any, Final, Literal

import pandas as pd

Kind = Literal["law", "commissioning", "drift", "following", "kept"]
"""law: clearance and damping followed temperature. commissioning, drift, following: stiffness, damping and levels were
identified anew. kept: they should have been, and were not; `why` says the reason."""
CAPACITY: Final = 100_000  # updates and evaluations that are kept, the last of each


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


@dataclass
class Journal:
    """Kept while the twin lives; `counts` are of messages by kind and what became of them."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    updates: deque[Update] = field(default_factory=lambda: deque(maxlen=CAPACITY))
    evaluations: deque[Evaluation] = field(default_factory=lambda: deque(maxlen=CAPACITY))

    def frame(self) -> pd.DataFrame:
        """A row per update: when, what kind, why, from, to."""
        rows: list[dict[str, Any]] = []
        for each in self.updates:
            row: dict[str, Any] = {"time_s": each.time_s, "kind": each.kind, "why": each.why}
            for name in each.before:
                row[f"{name} from"], row[f"{name} to"] = each.before[name], each.after[name]
            row |= {"error from": each.error_before, "error to": each.error_after}
            rows.append(row | {"snapshots": each.snapshots, "seconds": each.seconds})
        return pd.DataFrame(rows)

    def judged(self) -> pd.DataFrame:
        """A row per snapshot: the errors before the twin saw it."""
        return pd.DataFrame([asdict(each) for each in self.evaluations])
