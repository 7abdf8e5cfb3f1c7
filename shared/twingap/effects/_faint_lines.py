"""Faint lines: whether all records share lines of an effect that the twin lacks, though each hardly shows them."""

from __future__ import annotations

import math
from typing import Final

from twingap.effects.observations import Observations

_LEAD: Final = 1.95
"""z by which lines have to exceed those of no cause. A smaller value finds fainter lines, and more by chance."""
_OF_TWIN: Final = 0.5
"""Part of the lead and of z from which the twin has these lines too. A larger value takes weaker lines of the twin for
missing ones."""


def lacks_faint_lines(seen: Observations, kind: str, least: float) -> bool:
    """Whether records have lines of a kind (see `gap.features.pooled.faint`) of at least this z, and the twin none."""
    name = f"pooled|faint_{kind}"
    z, rival = seen.features.get(name, math.nan), seen.features.get(f"{name}_rival", math.nan)
    theirs = z - seen.features.get(f"{name}.diff", math.nan)
    their_rival = rival - seen.features.get(f"{name}_rival.diff", math.nan)
    twin_has = theirs > _OF_TWIN * z and theirs > their_rival + _OF_TWIN * _LEAD
    return z >= least and z >= rival + _LEAD and not twin_has
