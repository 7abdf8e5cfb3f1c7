"""Stored results of small simulated machines, which the running version must reproduce.

features.npz      examples of the machines, computed when what ships was learnt: all rows of the first machines, of the
                  others the row of the twin as given
diagnoses.json    ends of whole diagnoses with what ships

Made again by ``python -m tests.twingap.gap.stored``, after a change that is meant to change them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.gap import diagnose
from twingap.gap.knowledge.examples import examples
from twingap.gap.knowledge.learn import Examples
from twingap.gap.knowledge.simulated_gaps import SimulatedGap, draw_gap

FOLDER: Final = Path(__file__).parent
SEED: Final = 7
MACHINES: Final = 60
COMPUTED: Final = 12
"""Machines whose features a test computes again. More take longer and find rarer differences."""
DIAGNOSES: Final = 12
DIAGNOSED: Final = (0, 2, 3, 5, 8, 9)
"""Diagnoses that a test makes again: one of each status, with and without effects outside the catalogue."""
RECORDS: Final = 8
"""Records of a machine at most."""


def machines(first: int, count: int) -> Examples:
    """Examples of simulated machines that nothing was learnt from."""
    return examples(SEED, range(first, first + count), RECORDS)


def gap(number: int) -> SimulatedGap:
    """A simulated gap."""
    return draw_gap(np.random.default_rng([SEED, 1000 + number]), most_records=RECORDS)


def end(number: int) -> dict[str, Any]:
    """The end of a diagnosis: what a user is told."""
    drawn = gap(number)
    try:
        found = diagnose(drawn.records, drawn.spec, seed=number, sim=drawn.sim, quick=True)
    except TwingapError as error:
        return {"error": str(error)}
    verdict = found.report.verdict
    return {
        "missing": sorted(effect.name for effect in drawn.missing), "outside": drawn.outside,
        "status": verdict.status, "effects": sorted(verdict.effects), "p_value": round(verdict.p_value, 4),
        "closure": None if verdict.closure is None else round(verdict.closure, 3),
    }  # fmt: skip


def rounded(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Numbers with 12 of 23 binary digits of their mantissas: less than tests allow, for a smaller file."""
    return ((x.view(np.uint32) + 0x400) & 0xFFFFF800).view(np.float32)


def main() -> None:
    """Write the stored results."""
    made = machines(0, MACHINES)
    rows = made.first | (made.machine < COMPUTED)
    fields = ("machine", "missing", "modelled", "outside", "first")
    with (FOLDER / "features.npz").open("wb") as file:
        arrays = {name: getattr(made, name)[rows] for name in fields}
        np.savez_compressed(file, features=rounded(made.features[rows]), **arrays)
    ends = [end(number) for number in range(DIAGNOSES)]
    (FOLDER / "diagnoses.json").write_text(json.dumps(ends, indent=1) + "\n", encoding="utf-8")
