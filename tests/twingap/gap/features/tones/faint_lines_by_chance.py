"""How often machines without an effect have faint lines that all records share and that count as that effect's, and
how often catalogued machines have a line below the shaft's order that is not at half of it.

``python -m tests.twingap.gap.features.tones.faint_lines_by_chance SEED WORLDS`` prints it for each kind of line.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace

from scipy.stats import binomtest

from twingap.effects import catalogue
from twingap.effects.subsynchronous import shared_line
from twingap.gap.features.pooled import faint
from twingap.gap.features.tones import subsynchronous
from twingap.gap.features.tones.whitened_spectra import whiten
from twingap.rigs.worlds import World, cases, make_world
from twingap.signal.record_transforms import Frame, RecordTransforms

EFFECTS = ("drive_interference", "mains_interference", "shaft_harmonics")
BELOW = "line below the shaft's order"


def shown(world: World) -> list[str]:
    """Effects that the lines of a world's records show, against a twin that has no lines, and `BELOW`."""
    frame = Frame(world.records.bearing, (0.0, world.layout.fs_hz / 2), 1.0)
    white = [whiten(RecordTransforms(r.samples, r.condition, frame)) for r in world.records]
    found = {f"pooled|{name}": value for name, value in faint.measure(white, 1.0).items()}
    unseen = ("pair", "order_few", "mains_50_max", "mains_60_max")
    nothing = {f"pooled|{name}{of}": 0.0 for name in unseen for of in ("", ".diff")}
    nothing |= {"context|speeds": 0.0, "pooled|foreign": 0.0}
    found |= {f"pooled|{n}": v for n, v in zip(subsynchronous.NAMES, subsynchronous.measure(white), strict=True)}
    seen = SimpleNamespace(features=found | nothing)
    line = shared_line(seen)
    others = [BELOW] if line is not None and not line.is_at(0.5) else []
    return [*(name for name in EFFECTS if catalogue()[name].certain(seen)), *others]


def main(seed: int, count: int) -> None:
    """Print for each effect how many worlds without it have its lines, of those diagnosed through the twin."""
    found = [(case, shown(make_world(case, seed))) for case in cases(2 * count, seed) if case.arm == "twin"]
    for name in (*EFFECTS, BELOW):
        without = [lines for case, lines in found if name not in case.effect_names and not case.uncatalogued]
        false = sum(name in lines for lines in without)
        bound = binomtest(false, len(without), alternative="less").proportion_ci().high
        print(f"{name}: {false} of {len(without)} worlds, at most {bound:.3f} with 95 % confidence")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
