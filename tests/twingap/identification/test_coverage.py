"""Do intervals keep their level? Simulated sets, identified blind, and how often the truth is inside.

    python tests/twingap/identification/test_coverage.py 120

prints the table for 120 sets of each scenario; the test runs the first of them.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.identification import identify
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, flat

OWN = PhenomenologicalParameters()
# name: parameters, fs_hz, samples, healthy records, faulty records of each fault
SCENARIOS = {
    "five healthy, three inner": (OWN, 12000.0, 6000, 5, {"inner": 3}),
    "two and two": (OWN, 12000.0, 6000, 2, {"inner": 2}),
    "one and one, in blocks": (OWN, 12000.0, 12000, 1, {"inner": 1}),
    "weak faults": (
        PhenomenologicalParameters(2500.0, 0.03, {"inner": 0.3, "outer": 1.0}, 0.5, 0.75**0.5, 3.0),
        12000.0, 6000, 6, {"inner": 6, "outer": 6},
    ),
    "sharp mode at 48 kHz": (
        PhenomenologicalParameters(3000.0, 0.01, {"outer": 4.0}, 0.6, 0.8, 1.0), 48000.0, 24000, 5, {"outer": 5},
    ),
    "no healthy record": (OWN, 12000.0, 6000, 0, {"inner": 5}),
    "no healthy record, three faults": (OWN, 12000.0, 12000, 0, {"inner": 5, "outer": 5, "ball": 5}),
}  # fmt: skip


def coverage(scenario: str, sets: int) -> dict[str, float]:
    """Part of the sets that give an interval in which each parameter's 90 % one holds the truth."""
    own, fs_hz, samples, healthy, faulty = SCENARIOS[scenario]
    twin = PhenomenologicalTwin(BEARINGS["6205"], own)
    true = flat({name: getattr(own, name) for name in own.__dataclass_fields__})
    states = [("healthy", healthy), *faulty.items()]
    conditions = [Condition(f"{f}{i}", 1797.0, fs_hz, samples, f) for f, n in states for i in range(n)]
    inside: Counter[str] = Counter()
    given: Counter[str] = Counter()
    for seed in range(sets):
        rng = np.random.default_rng([seed, 7])
        found = identify(twin.simulate(conditions, rng), TwinSpec("phenomenological"), seed=rng).estimates
        for name, estimate in found.items():
            if estimate.interval is not None:
                given[name] += 1
                inside[name] += estimate.interval[0] <= true[name] <= estimate.interval[1]
    return {name: inside[name] / number for name, number in given.items()}


@pytest.mark.slow
def test_intervals_keep_their_level() -> None:
    """90 % intervals over 60 sets: three standard errors of 0.04 below, and not too wide all together."""
    shares = coverage("five healthy, three inner", 60)
    assert len(shares) == 6
    for name, share in shares.items():
        assert share >= 0.78, name
    assert np.mean(list(shares.values())) <= 0.97


if __name__ == "__main__":
    for each in SCENARIOS:
        shares = coverage(each, int(sys.argv[1]))
        print(each, {name: f"{share:.2f}" for name, share in shares.items()}, flush=True)
