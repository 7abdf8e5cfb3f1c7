"""How often machines without a drive have a pair of lines about a carrier that counts as certain.

``python -m tests.twingap.gap.features.tones.pairs_by_chance SEED WORLDS`` prints how many do, and the largest z.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from scipy.stats import binomtest

from twingap.effects.drive_interference import CERTAIN_PAIR
from twingap.gap.features.tones.side_pairs import SidePair, strongest_pair
from twingap.gap.features.tones.whitened_spectra import whiten
from twingap.rigs.worlds import World, cases, make_world
from twingap.signal.record_transforms import Frame, RecordTransforms


def pairs(seed: int, count: int) -> Iterator[SidePair]:
    """The strongest pair of each of so many worlds of the blind study's generator that have no drive."""
    without = [case for case in cases(2 * count, seed) if "drive_interference" not in case.effect_names]
    for case in without[:count]:
        if (found := pair_of(make_world(case, seed))) is not None:
            yield found


def pair_of(world: World) -> SidePair | None:
    """The strongest pair of a world's records, at the stated speeds."""
    frame = Frame(world.records.bearing, (0.0, world.layout.fs_hz / 2), 1.0)
    white = [whiten(RecordTransforms(r.samples, r.condition, frame)) for r in world.records]
    return strongest_pair(white)


def main(seed: int, count: int) -> None:
    """Print the part of the worlds with a certain pair, its upper bound, and the largest z."""
    z = [found.z for found in pairs(seed, count)]
    certain = sum(one > CERTAIN_PAIR for one in z)
    bound = binomtest(certain, len(z), alternative="less").proportion_ci().high
    print(f"{certain} of {len(z)} worlds, at most {bound:.4f} with 95 % confidence; largest z {max(z):.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
