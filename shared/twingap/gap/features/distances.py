"""Features: distances between two sets of records, over all domains and in each.

Distances are in standard deviations between records, as in reports, but negative where the unbiased square is negative.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from twingap.gap.distance.domains import DOMAINS
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired


def _names() -> tuple[str, ...]:
    """Names: all domains, each domain, and each kind of bins of a domain with several kinds."""
    names = ["all_domains", *(domain.name for domain in DOMAINS)]
    for domain in DOMAINS:
        kinds = tuple(dict.fromkeys(domain.axis(Grid(1e4, 40.0, 20.0, 1.0)).kind))
        names += [f"{domain.name}_{kind}" for kind in kinds if len(kinds) > 1]
    return tuple(names)


NAMES: Final = _names()
"""Keys of `compare`."""


def compare(real: FeatureVectors, simulated: FeatureVectors) -> dict[str, float]:
    """`NAMES` -> distance between two sets of records of the same conditions, in the same order."""
    pair = Paired(real, [simulated])
    square = pair.over_strata(pair.squares())[0]
    found: dict[str, float] = {}
    for domain, axis in real.axes.items():
        own, kinds = square[real.columns(domain)], np.array(axis.kind)
        found[domain] = float(own @ axis.weight)
        found |= {f"{domain}_{kind}": float(own[kinds == kind].mean()) for kind in dict.fromkeys(axis.kind)}
    found["all_domains"] = float(np.mean([found[domain] for domain in real.domains]))
    values = np.array([found[name] for name in NAMES])
    return dict(zip(NAMES, np.sign(values) * np.sqrt(np.abs(values)), strict=True))
