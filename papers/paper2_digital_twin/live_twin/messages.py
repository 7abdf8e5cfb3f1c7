"""Messages to a live twin: frequent states, occasional vibration.

thermometer, tachometer, load cell --> StateMessage --+
accelerometer ------------------------> Snapshot -----+--> `order.Reorder` --> `twin.LiveTwin`
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twingap.twins.contact_parameters import DEFECTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StateMessage:
    """Simple state signals of one moment.

    Parameters
    ----------
    time_s : float
        When it was measured, by the sender's clock; not when it arrived.
    temperature_c : float
        Of the bearing's outer ring.
    speed_rpm : float
        0 while the machine stands still.
    load_n : float or None
        Radial load; None where there is no load cell: the twin's own holds.
    number : int or None
        Counts the sender's messages; missing ones are then known exactly.
    """

    time_s: float
    temperature_c: float
    speed_rpm: float
    load_n: float | None = None
    number: int | None = None

    @property
    def usable(self) -> bool:
        """Whether every value is one that a machine can have."""
        values = [self.time_s, self.temperature_c, self.speed_rpm, 0.0 if self.load_n is None else self.load_n]
        if not np.isfinite(values).all():
            return False
        return self.speed_rpm >= 0 and -273.15 < self.temperature_c < 1000 and values[3] >= 0


@dataclass(frozen=True)
class Snapshot:
    """A stretch of vibration.

    Parameters
    ----------
    time_s : float
        When it begins.
    samples : Array [samples]
    fs_hz : float
    fault : str
        What the bearing is known to have; the twin is compared in that state.
    number : int or None
        As in `StateMessage`; snapshots are counted apart from states.
    """

    time_s: float
    samples: Array = field(repr=False)
    fs_hz: float = 0.0
    fault: str = "healthy"
    number: int | None = None

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
