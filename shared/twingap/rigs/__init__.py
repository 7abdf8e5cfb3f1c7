"""Virtual machines in place of real ones, for studies with known truth and for runs without data.

Their dynamics are independent of the twins: this package imports nothing of the effects, twins and diagnosis, nor they
of it; a test verifies this. It shares only the geometry of bearings.
"""

from collections.abc import Callable
from typing import Any, Final, Protocol

from twingap.errors import TwingapError
from twingap.records import RecordSet
from twingap.rigs.drifting import Drifting, arrivals
from twingap.rigs.machine import Machine, digest
from twingap.rigs.smart_maintenance import RunTruth, SmartMaintenanceRig, truth
from twingap.rigs.stored import stored_folder, stored_records
from twingap.rigs.structure import Structure
from twingap.rigs.virtual_cwru import VirtualCwru
from twingap.rigs.wrong_speeds import WrongSpeeds


class Rig(Protocol):
    """A virtual machine under test.

    Attributes
    ----------
    name : str
    """

    @property
    def name(self) -> str:
        """Name in the registry."""
        ...

    def records(self, seed: int = 0) -> RecordSet:
        """Measured records; the same bytes for the same seed."""
        ...


RIGS: Final[dict[str, Callable[..., Rig]]] = {
    "drifting": Drifting,
    "virtual_cwru": VirtualCwru,
    "virtual_smart_maintenance": SmartMaintenanceRig,
    "wrong_speeds": WrongSpeeds,
}
"""Name -> class, whose keyword arguments are the rig's options."""


def make_rig(name: str, **options: Any) -> Rig:
    """Rig with a given name.

    Parameters
    ----------
    name : str
        One of `RIGS`.
    **options
        Options of that rig, for instance ``duration_s``.

    Raises
    ------
    TwingapError
        For an unknown name or option, or a value outside its range.
    """
    if name not in RIGS:
        raise TwingapError(f"unknown rig {name!r}", mend=f"known rigs: {', '.join(RIGS)}")
    try:
        return RIGS[name](**options)
    except TypeError as error:
        raise TwingapError(f"unknown option: {error}", where=f"rig {name}") from None


__all__ = [
    "RIGS", "Drifting", "Machine", "Rig", "RunTruth", "SmartMaintenanceRig", "Structure", "VirtualCwru", "WrongSpeeds",
    "arrivals", "digest", "make_rig", "stored_folder", "stored_records", "truth",
]  # fmt: skip
