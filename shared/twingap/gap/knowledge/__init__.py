"""What the diagnosis has learnt from simulated gaps, and how it is learnt.

simulated gap --calibrate, compare--> examples --learn--> detectors, estimators, nulls ----+
simulated gap --search with these--> ends of searches --> calibration of probabilities ----+--> learnt/, in the package

Add to what is learnt: draw effects in `simulated_gaps`, change what is learnt in `learn`, run `twingap train`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from twingap.gap.knowledge.learnt import Learnt

SHIPPED: Final = Path(__file__).parent / "learnt"


@cache
def shipped() -> Learnt:
    """What the package ships with.

    Raises
    ------
    TwingapError
        When the files are missing or altered.
    """
    from twingap.gap.features.comparison import feature_names
    from twingap.gap.knowledge.learnt_file import read_learnt

    return read_learnt(SHIPPED, feature_names())


def shipped_digest() -> str:
    """sha256 of what the package ships with: results of a diagnosis depend on it."""
    from twingap.files import sha256

    return sha256(SHIPPED / "learnt.json")
