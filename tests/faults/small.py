"""Small studies, for trials of what their commands store: called in the process of the command, before it starts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any


def worlds() -> None:
    """Let `twingap study blind` plan two worlds, one without a gap, of four records of a quarter of a second."""
    from twingap.rigs import worlds

    plan = worlds.cases

    def small(n: int, seed: int = 0) -> list[worlds.Case]:
        kept = [case for case in plan(n, seed) if case.kind in ("none", "single")][:2]
        return [replace(case, n_records=4, duration_s=0.25) for case in kept]

    worlds.cases = small


def lives() -> None:
    """Let `twingap run paper1` train two networks on one twin for a few steps, on a third of the snapshots."""
    from papers.framework import Study

    read = Study.read

    def small(self: Study, config: Path | None = None) -> Any:
        options = read(self, config)
        size = replace(
            options.profiles["smoke"], variants=("printed",), models=("CNN", "Proposed model 3"), steps=8,
            most_records=100,
        )  # fmt: skip
        target = replace(options.target, interval_s=60.0)
        return replace(options, target=target, profiles={**options.profiles, "smoke": size})

    Study.read = small  # type: ignore[method-assign]
