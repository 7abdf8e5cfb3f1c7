"""Small studies, for trials of what their commands store: called in the process of the command, before it starts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any


def worlds() -> None:
    """Let `twingap study blind` have short worlds, with stand-ins for what is computed on each of them.

    What is tried is how a study seals, stores, resumes and writes; diagnoses are killed in the trials of `twingap gap`.
    """
    from tests.twingap.study import study_standins
    from twingap.rigs import worlds
    from twingap.study import closure, runner

    plan = worlds.cases

    def small(n: int, seed: int = 0, rich: int = 0) -> list[worlds.Case]:
        return [replace(case, n_records=4, duration_s=0.25) for case in plan(n, seed)]

    worlds.cases = small
    runner.diagnosis = lambda: study_standins.by_level
    runner.run_study.__kwdefaults__ |= {"prepare": study_standins.noisy_copy, "permutations": 2}
    closure.true_closure = lambda world, seed: 0.5
    closure.left_without_effects = lambda world, seed: 0.5


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


def training() -> None:
    """Let `twingap train` learn from machines of few records, in small chunks, and from two fleets."""
    from twingap.adapt import learning
    from twingap.gap.knowledge import training

    training.CHUNK, training.SEARCH_CHUNK, training.MOST_RECORDS = 10, 2, 4  # type: ignore[misc]
    learning.FLEETS_PER_PART = 1  # type: ignore[misc]
    learning.train_classifier.__kwdefaults__ |= {"fleets": 2}
