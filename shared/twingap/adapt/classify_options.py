"""Options of a classification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from twingap.errors import TwingapError

ORDERS: Final = "orders"
NETWORKS: Final = (
    "VMD+SVM", "Non-DA", "MMD", "DANN", "DACD", "Base-Attn", "Non-DN", "Base-NDN", "Proposed",
)  # fmt: skip
"""Keys of `twingap.adapt.METHODS`, which is slow to import."""
METHODS_OF_CLASSIFY: Final = (ORDERS, *NETWORKS)
"""Trees on fault orders and levels, or a method of paper 3. Of these, methods without adaptation are more accurate on
real records, since adaptation may align different classes with each other."""
FEWEST_MACHINES: Final = 4
"""Fewest simulated machines per class; more are needed for a useful network."""


@dataclass(frozen=True)
class ClassifyOptions:
    """Options of a classification.

    Parameters
    ----------
    method : str
        "orders", or a key of `METHODS`.
    machines : int
        Simulated machines per class for the training of a network; half as many are added for calibration. The trees
        need no training.
    steps : int
        Gradient steps of a network.
    windows : int
        Windows per record, evenly spaced.
    match : bool
        Whether to read true speeds off the records, without their labels; for a network also free parameters of the
        twin.
    max_iterations : int
        Most iterations of the networks' mode decomposition.

    Raises
    ------
    TwingapError
        For an unknown method or a value that is too small.
    """

    method: str = ORDERS
    machines: int = 200
    steps: int = 600
    windows: int = 6
    match: bool = True
    max_iterations: int = 200

    def __post_init__(self) -> None:
        if self.method not in METHODS_OF_CLASSIFY:
            known = ", ".join(METHODS_OF_CLASSIFY)
            raise TwingapError(f"unknown method {self.method!r}", mend=f"use one of {known}")
        for name, least in (("machines", FEWEST_MACHINES), ("steps", 1), ("windows", 1)):
            if getattr(self, name) < least:
                raise TwingapError(f"{name} = {getattr(self, name)}, at least {least} expected")
