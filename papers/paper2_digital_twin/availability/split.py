"""Folds and labels of the availability study: which recordings are judged, which records are labelled.

recordings --by recording (shuffled by seed) or by bearing--> folds: learn | judge
learn --n records of each fault, from as many recordings as there are--> labelled

Used in: Paper 2, diagnosis by how much fault data there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from papers.paper2_digital_twin.availability.records import Measured

Split = Literal["recording", "bearing"]
SPLITS: Final[tuple[Split, ...]] = ("recording", "bearing")
ALL: Final = -1
"""All labelled records that there are."""


def judged(data: Measured, split: Split, fold: int, folds: int, seed: int) -> tuple[str, ...]:
    """Recordings of one fold.

    Healthy recordings are dealt in their order, whatever the split: there is one healthy bearing, and what learnt from
    one of its recordings cannot be kept from all of it. Recordings of a fault are shuffled by the seed ("recording") or
    kept with those of their bearing, one size a fold ("bearing"), so that every seed judges the same.
    """
    rng = np.random.default_rng([seed, 21])
    healthy = data.healthy()
    chosen = [str(r) for r in np.array_split(np.array(healthy), folds)[fold]]
    for label in sorted(set(data.labels.values())):
        own = [r for r, c in data.labels.items() if c == label and r not in healthy]
        if not own:
            continue
        if split == "recording":
            order = rng.permutation(len(own))
            chosen += [own[i] for i in np.array_split(order, folds)[fold]]
        else:
            names = sorted(
                {data.bearings[r] for r in own}, key=lambda b: min(data.sizes[r] for r in own if data.bearings[r] == b)
            )
            kept = {str(b) for b in np.array_split(np.array(names), folds)[fold]}
            chosen += [r for r in own if data.bearings[r] in kept]
    return tuple(r for r in data.recordings if r in set(chosen))


def labelled(
    data: Measured, learn: Sequence[str], count: int, rng: np.random.Generator, *, all_healthy: bool
) -> NDArray[np.int64]:
    """Places of the labelled pieces: `count` of each fault, and healthy ones.

    The first of each recording in turn (in random order), then the second of each, so that `count` records come from
    as many recordings as there are.

    Parameters
    ----------
    learn : sequence of str
        Recordings that may be learnt from.
    count : int
        `ALL` for all.
    all_healthy : bool
        Healthy records are not scarce: all of them; or as many as of a fault, since more drown the few.
    """
    chosen: list[int] = []
    healthy = data.healthy()
    for label in sorted(set(data.labels.values())):
        own = [r for r in learn if data.labels[r] == label]
        piles = [list(rng.permutation(data.pieces([own[i]]))) for i in rng.permutation(len(own))]
        longest = max((len(pile) for pile in piles), default=0)
        dealt = [int(pile[turn]) for turn in range(longest) for pile in piles if turn < len(pile)]
        free = all_healthy and own[:1] and own[0] in healthy
        chosen += dealt if count == ALL or free else dealt[:count]
    return np.array(sorted(chosen), dtype=np.int64)


def counts_of(data: Measured, places: NDArray[np.int64]) -> int:
    """Labelled records of the fault that has fewest among some pieces."""
    labels = data.piece_labels()[places]
    healthy = {data.labels[r] for r in data.healthy()}
    return min(int((labels == c).sum()) for c in set(data.labels.values()) - healthy)
