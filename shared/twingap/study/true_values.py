"""Gap that remains when the machine's one missing effect is added to the twin at its true values.

simulated machine with one effect --calibrate--> initial distance
                                  --the effect at its true values added, baseline matched anew--> distance left

No model is trained, estimated or searched here: a remainder beyond chance is an error of calibration, of the simulator
to which effects are added, or of the distance. Run as ``python -m twingap.study.true_values``; it prints one line per
effect. ``--own`` represents machines by records of their own simulator, ``--without-healthy`` uses only records with
defects.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np

from twingap.effects import Effect, catalogue
from twingap.errors import TwingapError
from twingap.gap.features.comparison import feature_names
from twingap.gap.knowledge.machines import Machine, draw_machine
from twingap.gap.knowledge.null import DISTANCE
from twingap.gap.knowledge.simulated_gaps import draw_effects, simulated
from twingap.gap.search.evidence import THOROUGH, Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.records import Record, RecordSet
from twingap.twins.twin_file import TwinSpec

MOST_RECORDS = 12
"""Most records of a machine; more are slower."""
_TRIES = 400
"""Most machines drawn until one has records that show the effect; more find rarer cases."""
_GAIN = 1.3
"""Gain of the records relative to the machine's own simulator, so that its level has to be matched."""


@dataclass(frozen=True)
class Left:
    """Distances of one machine without the effect, and with it at its true values, in standard deviations; negative
    where the unbiased square is negative."""

    before: float
    after: float


def left(name: str, number: int, seed: int, *, own: bool = False, healthy: bool = True) -> Left | None:
    """Distances of one machine before and after its true effect is added.

    None where no machine's records could show the effect, or the simulator cannot have it.

    Parameters
    ----------
    name : str
        Name of the effect.
    number : int
        Number of the machine, which depends on this, the name and the seed alone.
    own : bool
        Whether the machine is represented by records of its own simulator.
    healthy : bool
        Whether some of the records are healthy.
    """
    rng = np.random.default_rng([seed, number, sum(map(ord, name))])
    drawn = _drawn(name, rng, own, healthy)
    if drawn is None:
        return None
    machine, effects = drawn
    made = simulated(machine, effects, rng)
    records = RecordSet.from_records(
        "machine", "", machine.bearing,
        (Record(c, r.samples) for c, r in zip(machine.nominal, made, strict=True)),
    )  # fmt: skip
    sim = simulated(replace(machine, conditions=machine.nominal), (), rng, _GAIN) if own else None
    spec = TwinSpec("phenomenological")
    try:
        calibrated = calibrate(records, None if own else spec, rng, sim=sim)
        evidence = Evidence(calibrated, simulator_of(calibrated, sim), spec, seed, THOROUGH)
        if evidence.can_add(name) is not None:
            return None
        place = feature_names().index(DISTANCE)
        return Left(*(float(evidence.against(chain).held_out[place]) for chain in ((), effects)))
    except TwingapError:  # a machine that cannot be calibrated is skipped
        return None


def _drawn(name: str, rng: np.random.Generator, own: bool, healthy: bool) -> tuple[Machine, tuple[Effect, ...]] | None:
    for _ in range(_TRIES):
        machine = draw_machine(rng, own, MOST_RECORDS)
        if any(c.fault == "healthy" for c in machine.conditions) == healthy:
            effects = draw_effects(rng, machine, 1, (name,))
            if effects:
                return machine, effects
    return None


def main() -> None:
    """Print the distances left for every effect, on a few machines each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("effects", nargs="*", help="names of effects; all of the catalogue when none is given")
    parser.add_argument("--machines", type=int, default=6)
    parser.add_argument("--seed", type=int, default=991)
    parser.add_argument("--own", action="store_true", help="represent machines by records of their own simulator")
    parser.add_argument("--without-healthy", action="store_true", help="use only records with defects")
    options = parser.parse_args()
    for name in options.effects or catalogue():
        found = [
            left(name, number, options.seed, own=options.own, healthy=not options.without_healthy)
            for number in range(options.machines)
        ]
        distances = ", ".join(f"{one.before:.2f} to {one.after:.2f}" for one in found if one is not None)
        print(f"{name:22} {distances or 'cannot be added'}", flush=True)


if __name__ == "__main__":
    main()
