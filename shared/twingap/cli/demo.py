"""`twingap demo`: a simulated machine with hidden effects, its diagnosis, and the truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import typer

from twingap.cli.options import Effects, Json, Seed, say, say_json, show, wrote
from twingap.cli.progress import progress

if TYPE_CHECKING:
    from twingap.gap.report.model import GapReport
    from twingap.rigs.worlds import Case, World

DRAWN_FROM: Final = (
    "slip_jitter", "load_zone", "shaft_harmonics", "mains_interference", "second_resonance", "looseness",
    "coloured_noise", "clipping",
)  # fmt: skip
"""Effects that a demonstration machine may have: those of which one page of figures shows the signature."""


def demo(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="New folder for the records, the twin, the diagnosis and the truth.")
    ] = Path("twingap-demo"),
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Simulate a machine with two hidden effects, diagnose what its twin lacks, and show the truth.

    The machine comes from the generator of the blind study, which shares no code with the diagnosis. Another seed is
    another machine with other effects.
    """
    from twingap.config import to_toml
    from twingap.files import replacing_folder
    from twingap.records.folder import write_record_set
    from twingap.rigs.worlds import make_world

    with progress("simulating the machine") as shown:
        world = make_world(demo_case(seed), seed)
        with replacing_folder(out) as folder:
            write_record_set(world.records, folder / "records")
            (folder / "twin.toml").write_text(to_toml(world.twin), encoding="utf-8")
            truth = json.loads(world.truth.to_json())
            (folder / "truth.json").write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
        if not as_json:
            say(*_introduction(world, out), "")
        from twingap.gap import diagnose

        report = (found := diagnose(out / "records", out / "twin.toml", seed=seed, progress=shown.share)).report
        paths = found.write(out / "gap", progress=shown.share)
    if as_json:
        say_json({"sentence": report.sentence, "named": report.verdict.effects, "true": world.case.effect_names})
    else:
        say(*filter(None, (report.sentence, report.closest_sentence)), "")
        show(_compared(report, world), False, title="Found, and true")
    wrote(*paths, out / "truth.json", as_json=as_json)


def demo_case(seed: int) -> Case:
    """Two effects, drawn by the seed, on a machine with all faults."""
    from twingap.rigs.worlds import Case

    hidden = np.random.default_rng([seed, 1]).choice(DRAWN_FROM, 2, replace=False)
    effects = tuple((str(name), "strong") for name in sorted(hidden, key=DRAWN_FROM.index))
    faults = ("healthy", "inner", "outer", "ball")
    return Case("pair", effects=effects, name="demo", n_records=16, fs_hz=12000.0, faults=faults)


def _introduction(world: World, out: Path) -> list[str]:
    records = world.records
    speeds = [c.speed_rpm for c in records.conditions]
    return [
        f"A bearing {world.layout.bearing.name}: {len(records)} records of 1 s at 12 kHz and "
        f"{min(speeds):.0f} to {max(speeds):.0f} rpm, healthy and with faults of inner race, outer race and ball.",
        "The machine has two effects that its twin does not model. The diagnosis sees the records and the twin:",
        "",
        f"    twingap gap {out / 'records'} --twin {out / 'twin.toml'} --seed {world.seed} --out {out / 'gap'}",
    ]


def _compared(report: GapReport, world: World) -> list[dict[str, Any]]:
    """One row an effect that was named or is true."""
    named, true = report.verdict.effects, world.case.effect_names
    probability = {c.effect: c.probability for c in report.candidates}
    return [
        {
            "effect": effect,
            "found": "named" if effect in named else "",
            "probability": f"{probability.get(effect, 0.0):.0%}",
            "the machine has it": "yes" if effect in true else "no",
        }
        for effect in dict.fromkeys((*named, *true))
    ]
