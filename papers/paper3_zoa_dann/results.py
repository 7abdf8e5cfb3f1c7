"""Results of one task, and of all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from papers.paper3_zoa_dann.comparison_study import Comparison
from papers.paper3_zoa_dann.job import Job, Measured
from papers.paper3_zoa_dann.options import Options
from papers.paper3_zoa_dann.source import Recipe
from papers.paper3_zoa_dann.tasks import Target, Task
from twingap.adapt import Scores
from twingap.sweep import Result


@dataclass(frozen=True)
class TaskResult:
    """All that came out of one task.

    Parameters
    ----------
    task : Task
    measured : Measured
    identified : Mapping[str, float]
    recipe : Recipe
    trainings : list[Result[Job]]
        In the order input, method, seed.
    majority : float
        Accuracy of calling everything the most frequent class.
    analyst : Scores
        Of the analyst's rule on the same windows.
    analyst_whole : Scores
        Of the same rule on whole recordings.
    analyst_calls, analyst_whole_calls : Array [windows, classes], [recordings, classes]
        What that rule called each, one-hot.
    """

    task: Task
    measured: Measured
    identified: Mapping[str, float]
    recipe: Recipe
    trainings: list[Result[Job]]
    majority: float
    analyst: Scores
    analyst_whole: Scores
    analyst_calls: NDArray[np.float64]
    analyst_whole_calls: NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """The whole result.

    Parameters
    ----------
    profile : str
    target : Target
    options : Options
    tasks : list[TaskResult]
    rows : list[dict]
        The accuracy table, one row per task, input and method, and per yardstick.
    out : Path
        Folder of tables and figures.
    run_id : str or None
        Of the MLflow run.
    computed : int
        Trainings that ran now; the others came from the store.
    comparison : Comparison or None
        Of the paper's methods, where the profile has one.
    """

    profile: str
    target: Target
    options: Options
    tasks: list[TaskResult]
    rows: list[dict[str, Any]]
    out: Path
    run_id: str | None
    computed: int
    comparison: Comparison | None = None
