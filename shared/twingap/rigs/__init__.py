"""Virtual machines that play reality: for runs without data, for blind studies.

Other dynamics and own code: this package imports nothing of the effects, twins and diagnosis, nor they of it, and a
test keeps it so. What it knows of bearings is their geometry.
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


class Rig(Protocol):
    """A virtual machine under test.

    Attributes
    ----------
    name : str
    """

    @property
    def name(self) -> str:
        """Its name in the registry."""
        ...

    def records(self, seed: int = 0) -> RecordSet:
        """What its recorder wrote down; the same bytes for the same seed."""
        ...


RIGS: Final[dict[str, Callable[..., Rig]]] = {
    "drifting": Drifting,
    "virtual_cwru": VirtualCwru,
    "virtual_smart_maintenance": SmartMaintenanceRig,
}
"""Name -> maker, whose keyword arguments are the rig's options."""


def make_rig(name: str, **options: Any) -> Rig:
    """A rig by its name.

    Parameters
    ----------
    name : str
        One of `RIGS`.
    **options
        Of that rig, for instance ``duration_s``.

    Raises
    ------
    TwingapError
        For an unknown name or option, or a value that the rig cannot have.
    """
    if name not in RIGS:
        raise TwingapError(f"unknown rig {name!r}", mend=f"known rigs: {', '.join(RIGS)}")
    try:
        return RIGS[name](**options)
    except TypeError as error:
        raise TwingapError(f"takes no such option: {error}", where=f"rig {name}") from None


__all__ = [
    "RIGS", "Drifting", "Machine", "Rig", "RunTruth", "SmartMaintenanceRig", "Structure", "VirtualCwru", "arrivals",
    "digest", "make_rig", "stored_folder", "stored_records", "truth",
]  # fmt: skip
