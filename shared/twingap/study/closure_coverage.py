"""Coverage of the closure's 90 % interval, against many more records of the same machine.

world --diagnose blind--> verdict's effects, closure, interval
the same machine run again, many times --the same two twins, the same distance--> reference closure over all runs

Run as ``python -m twingap.study.closure_coverage``; it prints one line per world and the coverage. The reference uses
the effects of the verdict; whether these are right is evaluated by the blind study. The reference has a sampling error
of about the interval's half width over the root of the number of runs, so the coverage is slightly underestimated.
"""

from __future__ import annotations

import argparse
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twingap.errors import TwingapError
from twingap.gap.distance.closure import closure, closure_interval, paired
from twingap.gap.distance.feature_vectors import FeatureVectors, measure_vectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired
from twingap.gap.search.effect_search import explain
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.signal.record_transforms import RecordTransforms
from twingap.study.blind import anonymous, blinded

if TYPE_CHECKING:
    from twingap.gap.knowledge.learnt import Learnt
    from twingap.rigs.worlds import Case

RUNS = 8
"""Further runs of each machine; more give a more precise reference."""
REPLICATES = 4
"""Simulated replicates of each record; more lower the sampling error of the distances."""


@dataclass(frozen=True)
class Checked:
    """Effects named by the verdict of one world, their closure with its 90 % interval, and the closure over all runs of
    the machine, the reference."""

    case: str
    effects: tuple[str, ...]
    closure: float
    ci: tuple[float, float]
    reference: float

    @property
    def covered(self) -> bool:
        """Whether the interval contains the reference."""
        return self.ci[0] <= self.reference <= self.ci[1]


def check(case: Case, seed: int, learnt: Learnt) -> Checked | None:
    """Interval of a world's closure and the reference from more runs of its machine; None where no effect is named."""
    from twingap.rigs.worlds import make_world, replay

    world = make_world(case, seed)
    blind = blinded(world)
    rng = np.random.default_rng([seed, zlib.crc32(case.name.encode())])
    calibrated = calibrate(blind.records, None if blind.sim is not None else blind.twin, rng, sim=blind.sim)
    root = int(rng.integers(2**62))
    evidence = Evidence(calibrated, simulator_of(calibrated, blind.sim), blind.twin, root, THOROUGH)
    found = explain(evidence, learnt, lambda what, part: None)
    if not found.gap or not found.after.effects:
        return None
    part = calibrated.held_out
    grid = Grid.of(part.conditions, evidence.frame.bearing)
    places = {c.name: place for place, c in enumerate(blind.records.conditions)}

    def twins(first: int) -> tuple[list[FeatureVectors], list[FeatureVectors]]:
        """Feature vectors of the replicates before and after, from replicate number `first` on."""
        before, after = (
            [
                evidence.vectors(evidence.simulated(c.simulator, c.effects, part.conditions, first + k), grid)
                for k in range(REPLICATES)
            ]
            for c in (found.before, found.after)
        )
        return before, after

    real = evidence.vectors(part, grid)
    pairs = paired(real, *twins(2))
    floor, _ = pairs[1].floor(rng)
    own = closure_interval(*pairs, floor, rng)
    sums = np.zeros(3)
    for run in range(RUNS):
        again = list(anonymous(replay(world, effects=case.effect_names, seed=run), "again"))
        vectors = measure_vectors(
            (RecordTransforms(again[places[c.name]].samples, c, evidence.frame) for c in part.conditions), grid
        )
        before, after = (Paired(vectors, sims, pairs[0].scale) for sims in twins(20 + REPLICATES * run))
        (b,), (a,) = (p.over_domains(p.squares())[0] for p in (before, after))
        sums += np.array([b, a, after.floor(rng)[0]]) / RUNS
    return Checked(case.name, found.names, own.closure, own.ci, closure(*(float(v) for v in sums)))


def main() -> None:
    """Print interval and reference of worlds with one to five effects, and the coverage."""
    from twingap.gap.knowledge import shipped
    from twingap.rigs.worlds.plan import cases

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--worlds", type=int, default=40)
    parser.add_argument("--seed", type=int, default=77)
    options = parser.parse_args()
    learnt = shipped()
    done: list[Checked] = []
    for case in cases(4 * options.worlds, options.seed):
        if len(done) == options.worlds:
            break
        if case.kind not in ("single", "pair", "crowd"):
            continue
        try:
            one = check(case, options.seed, learnt)
        except TwingapError as error:
            print(f"{case.name}: {error}")
            continue
        if one is not None:
            done.append(one)
            print(
                f"{one.case} {', '.join(one.effects)}: closure {one.closure:.2f} ({one.ci[0]:.2f} to {one.ci[1]:.2f}), "
                f"more runs {one.reference:.2f}{'' if one.covered else '  outside'}",
                flush=True,
            )
    print(f"covered: {sum(one.covered for one in done)} of {len(done)}")


if __name__ == "__main__":
    main()
