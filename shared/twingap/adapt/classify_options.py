"""Options of a classification: which method, and how much of it."""

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
"""Trees on fault orders and levels; or one of paper 3's, of which those without adaptation did better on real records:
the others align unlike classes with each other."""
FEWEST_MACHINES: Final = 4


@dataclass(frozen=True)
class ClassifyOptions:
    """How records are classified.

    Parameters
    ----------
    method : str
        "orders", or a key of `METHODS`.
    machines : int
        Simulated machines a class to train a network on; half as many more to calibrate on. The trees are trained.
    steps : int
        Gradient steps of a network.
    windows : int
        Per record, evenly spread.
    match : bool
        Correct speeds from the records, without their labels; for a network also identify what the twin leaves free.
    max_iterations : int
        Of the networks' mode decomposition.

    Raises
    ------
    TwingapError
        For an unknown method or sizes too small.
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
