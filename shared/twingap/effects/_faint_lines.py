"""Faint lines: whether all records share lines of an effect that the twin lacks, though each hardly shows them."""

from __future__ import annotations

import math
from typing import Final

from twingap.effects.observations import Observations

SIDES: Final = "sides"
"""Side lines of a carrier, whose place is not known."""
_LEAD: Final = 1.95
"""z by which lines have to exceed those of no cause. A smaller value finds fainter lines, and more by chance."""
_OF_TWIN: Final = 0.5
"""Part of z, and of the lead, from which the twin has these lines too. A larger value takes weaker lines of the twin
for missing ones."""
_OF_WAVEFORM: Final = 0.25
"""The same part of z for finished waveforms, which may hold as faint lines as the records do: then chance makes z of
both differ. A larger value takes these for missing lines more often."""

_CLEAR: Final = math.log1p(6.0)
"""Compressed z from which lines are clear without a search for faint ones. A smaller value takes lines by chance for
clear ones of the twin."""


def lacks_faint_lines(seen: Observations, kind: str, least: float, clear: str = "") -> bool:
    """Whether records have lines of a kind (see `gap.features.pooled.faint`) of at least this z, and the twin none.

    `clear` names the feature that shows such lines where they are not faint. Lines that are clear in the twin are not
    missing. The search for faint ones may not find them: it leaves out orders of the shaft that are near multiples of
    the mains, at the speeds of the twin's records.
    """
    if clear and seen.features[clear] - seen.features[f"{clear}.diff"] > _CLEAR:
        return False
    name = f"pooled|faint_{kind}"
    z, rival = seen.features.get(name, math.nan), seen.features.get(f"{name}_rival", math.nan)
    if not (z >= least and z >= rival + _LEAD):
        return False
    # Faint lines of the twin's need not stand out in every state, as those of the records have to.
    own = f"{name}_any" if f"{name}_any" in seen.features else name
    theirs = seen.features.get(own, math.nan) - seen.features.get(f"{own}.diff", math.nan)
    their_rival = rival - seen.features.get(f"{name}_rival.diff", math.nan)
    # The best of many places has a large z by chance; lines at known places have not.
    if kind == SIDES:
        return not theirs > max(their_rival + _OF_TWIN * _LEAD, _OF_TWIN * z)
    return not theirs > (_OF_TWIN if seen.own_mode is not None else _OF_WAVEFORM) * z
