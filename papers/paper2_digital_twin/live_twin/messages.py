"""Messages to a live twin: frequent states, occasional vibration."""

from dataclasses import dataclass, field

import numpy as np

from papers.arrays import Array
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
