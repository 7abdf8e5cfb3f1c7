"""What records have already, and the advice that takes the place of recording it.

conditions --records_have--> entry of the provenance --without_what_is_there--> advice
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from twingap.effects import measurements
from twingap.records import Condition

RECORDS_HAVE: Final = "records_have"
"""Entry of the provenance."""
_OTHER: Final = 1.05
"""Ratio of two speeds or loads from which one is another. A larger ratio advises further ones more often."""
_TACHO: Final = re.compile(r"tacho|encoder|key.?phasor", re.IGNORECASE)
_INSTEAD: Final[Mapping[str, tuple[str, str]]] = {
    "speed_rpm": (
        measurements.OTHER_SPEED,
        "compare records at the speeds that you have, {} to {} rpm, and take more or longer ones there: lines of "
        "mains, drive and structure stay at their frequency, lines of shaft, gears and bearings move with the speed",
    ),
    "load_n": (
        measurements.LOAD,
        "compare records at the loads that you have, {} to {} N, and take more there: modulation by the load zone "
        "changes with the load, modulation by the cage hardly does",
    ),
    "tacho": (
        measurements.TACHO,
        "resample the records in shaft angle by the tacho or encoder that you have ({}): whatever stays in the lines "
        "belongs to the cage and not to the shaft",
    ),
}
"""What records have -> the measurement that is pointless then, and what to do with what they have."""


def records_have(conditions: Sequence[Condition]) -> dict[str, Any]:
    """Ends of speeds and loads that differ within a state, and the column that names a tacho or encoder."""
    had: dict[str, Any] = {}
    for name in ("speed_rpm", "load_n"):
        of: dict[str | None, list[float]] = {}
        for c in conditions:
            if (value := getattr(c, name)) is not None:
                of.setdefault(c.fault, []).append(float(value))
        ends = [(min(own), max(own)) for own in of.values()]
        if differing := [(low, high) for low, high in ends if high > _OTHER * low]:
            had[name] = [min(low for low, _ in differing), max(high for _, high in differing)]
    columns = dict.fromkeys(
        column for c in conditions for column, value in c.extra.items()
        if value not in (None, "", False) and _TACHO.search(f"{column} {value}")
    )  # fmt: skip
    if columns:
        had["tacho"] = f"column {next(iter(columns))} of records.csv"
    return had


def without_what_is_there(advice: str, had: Mapping[str, Any]) -> str:
    """Advice with another measurement in place of each that the records have already."""
    for name, (pointless, instead) in _INSTEAD.items():
        if name in had:
            values = had[name] if isinstance(had[name], (list, tuple)) else [had[name]]
            shown = (f"{v:.0f}" if isinstance(v, (int, float)) else v for v in values)
            advice = advice.replace(pointless, instead.format(*shown))
    return advice
