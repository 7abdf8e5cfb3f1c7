"""Gear mesh: the integer order with the highest line and side lines one order beside it, over a set of records.

records --each at the speed where it stands highest--> score of every number of teeth --over what is usual--> z

Speeds of records with a defect come from its comb; those of healthy ones may have errors of per cents. The mesh is
therefore searched twice: at the stated speeds, where integer orders can be distinguished from others, and with healthy
records shifted freely, where only side lines give the shaft's rate and distinguish a mesh from a carrier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.ndimage import median_filter

from twingap.gap.features.tones.aligned_combs import aligned
from twingap.gap.features.tones.whitened_spectra import Single, Whitened
from twingap.records import Array
from twingap.signal.record_transforms import medians

_EACH: Final = ("", "_main", "_sides", "_teeth", "_rival")
NAMES: Final = (*(f"gear{part}" for part in _EACH), *(f"gear_free{part}" for part in _EACH), "gear_integer_lead")

_TEETH: Final = np.arange(6.0, 100.0)
"""Numbers of teeth that are tried."""
_LINES: Final = np.array([0.0, -1.0, 1.0])
_WEIGHTS: Final = np.array([1.0, 0.7, 0.7, 0.5])
"""Weights of the mesh, its side lines and its double: larger side weights find carriers too."""
_KNOWN: Final = 0.0015
"""Largest relative error of a speed that was read from a comb."""
_FREE: Final = 0.03
"""The same of a stated speed."""
_OFF: Final = np.array([-0.5, -0.4, -0.3, 0.3, 0.4, 0.5])
"""Distances from an integer order at which there is no mesh, orders."""
_ABOUT: Final = 25
"""Neighbouring numbers of teeth whose median score is subtracted, as chance scores increase with the number of bins."""
_FEWEST: Final = 12
"""Smallest number of scored numbers of teeth. With fewer, nothing is reported."""


def measure(records: Sequence[Whitened], deviates: Sequence[Single]) -> dict[str, float]:
    """`NAMES` -> value of a set of records and the `deviates` [bins] of each; NaN where their spectra are too short.

    Of each search: z of the best number of teeth; mean deviate of its first line and of its side lines; its logarithm;
    z of the best that is neither beside it nor its half or double. Last, the score at the integer order less the
    highest between integer orders.
    """
    out = dict.fromkeys(NAMES, math.nan)
    for name, far in (("gear", _KNOWN), ("gear_free", _FREE)):
        reach = [far if record.kind == "healthy" else _KNOWN for record in records]
        found = aligned(records, deviates, _combs(_TEETH), _WEIGHTS, reach)
        mean = found.mean()
        known = np.flatnonzero(np.isfinite(mean))
        if known.size < _FEWEST:
            continue
        above = mean[known] - median_filter(mean[known], size=_ABOUT, mode="nearest")
        z = above / max(1.4826 * float(medians(np.abs(above))), 1e-3)
        best = int(np.argmax(z))
        teeth = _TEETH[known]
        near = np.abs(teeth[:, None] - teeth[best] * np.array([1.0, 0.5, 2.0])) <= np.array([2.0, 1.0, 1.0])
        rivals = z[~near.any(axis=1)]
        lines, rival = found.lines[known[best]], rivals.max() if rivals.size else np.nan
        values = z[best], lines[0], lines[1] + lines[2], math.log(teeth[best]), rival
        out |= {f"{name}{part}": float(value) for part, value in zip(_EACH, values, strict=True)}
        if name == "gear":
            off = aligned(records, deviates, _combs(teeth[best] + _OFF), _WEIGHTS, reach).mean()
            out["gear_integer_lead"] = float(mean[known[best]] - np.nanmax(off)) if np.isfinite(off).any() else math.nan
    return out


def _combs(teeth: Array) -> Array:
    """[teeth, lines] Orders of a mesh, of its side lines and of its double."""
    return np.column_stack((teeth[:, None] + _LINES, 2 * teeth))
