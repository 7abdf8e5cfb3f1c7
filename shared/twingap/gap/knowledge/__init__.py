"""Models of the diagnosis, learnt from simulated gaps, and their training.

simulated gap --calibrate, compare--> examples --learn--> detectors, estimators, nulls --+
simulated gap --search with these--> outcomes --> calibration of probabilities ----------+--> learnt/, in the package

To extend them: draw effects in `simulated_gaps`, change the models in `learn`, run `twingap train`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from twingap.gap.knowledge.learnt import Learnt

SHIPPED: Final = Path(__file__).parent / "learnt"
"""Folder of the models that are part of the package."""


@cache
def shipped() -> Learnt:
    """Models that are part of the package.

    Raises
    ------
    TwingapError
        When a file is missing or altered.
    """
    from twingap.gap.features.comparison import feature_names
    from twingap.gap.knowledge.learnt_file import read_learnt

    return read_learnt(SHIPPED, feature_names())


def shipped_digest() -> str:
    """sha256 of the models that are part of the package, for the provenance of a diagnosis."""
    from twingap.files import sha256

    return sha256(SHIPPED / "learnt.json")
