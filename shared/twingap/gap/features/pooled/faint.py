"""Faint lines of a set of records: side lines of a carrier, hum of the mains, harmonics of the shaft.

Whitened of each record --FineSpectra--> each kind of line: z, z of the best rival, place, amplitude
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from twingap.gap.features.tones import faint_harmonics, faint_mains, side_lines
from twingap.gap.features.tones.fine_spectra import FineSpectra
from twingap.gap.features.tones.whitened_spectra import Whitened

KINDS: Final = ("sides", "mains", "shaft")
NAMES: Final = (
    *(f"faint_{kind}{part}" for kind in KINDS for part in ("", "_rival")),
    "faint_sides_fs", "faint_sides_order", "faint_sides_own", "faint_sides_level", "faint_sides_own_level",
    "faint_mains_hz", "faint_mains_level", "faint_shaft_half", "faint_shaft_any",
    *(f"faint_shaft_level_{k}" for k in (1, 2, 3)),
)  # fmt: skip
_LOOSE: Final = 4.0
"""z of half orders from which they are left out of the spectra that a hum is sought in. A larger value finds fainter
hums, and takes half orders for one."""


def measure(records: Sequence[Whitened], scale: float) -> dict[str, float]:
    """`NAMES` -> value of a set of records; NaN where lines cannot be sought.

    Of each kind: z, and z of the best lines that are none. Of side lines: logarithm of the carrier over the sampling
    rate, shaft orders between, z of a line at the carrier. Of the shaft: z of half orders, and z of whole ones that may
    be in a part of the records alone. Of all: ln of amplitudes over `scale`.
    """
    out = dict.fromkeys(NAMES, math.nan)
    spectra = FineSpectra.of(records)
    if spectra is None:
        return out
    unit = math.log(max(scale, 1e-300))
    if (sides := side_lines.strongest(spectra)) is not None:
        fs_hz = min(record.fs_hz for record in spectra.records)
        out |= {
            "faint_sides": sides.z, "faint_sides_rival": sides.rival_z, "faint_sides_own": sides.own_z,
            "faint_sides_fs": math.log(sides.carrier_hz / fs_hz), "faint_sides_order": sides.order,
            "faint_sides_level": sides.level_log - unit, "faint_sides_own_level": sides.own_level_log - unit,
        }  # fmt: skip
    if (shaft := faint_harmonics.strongest(spectra)) is not None:
        out |= {"faint_shaft": shaft.z, "faint_shaft_rival": shaft.rival_z, "faint_shaft_half": shaft.half_z}
        out["faint_shaft_any"] = shaft.any_z
        out |= {f"faint_shaft_level_{k}": level - unit for k, level in enumerate(shaft.level_logs, start=1)}
    loose = shaft is None or not shaft.half_z < _LOOSE
    if (mains := faint_mains.strongest(spectra, half_orders=loose)) is not None:
        out |= {
            "faint_mains": mains.z, "faint_mains_rival": mains.rival_z, "faint_mains_hz": mains.mains_hz,
            "faint_mains_level": mains.level_log - unit,
        }  # fmt: skip
    return out
