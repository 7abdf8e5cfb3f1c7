"""Results of one run, and of all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from papers.paper1_rul_varying_speed.cases import Array, Case
from papers.paper1_rul_varying_speed.job import Job
from papers.paper1_rul_varying_speed.options import Options
from twingap.sweep import Result


@dataclass(frozen=True)
class CaseResult:
    """All that came out of one run with one twin.

    Parameters
    ----------
    case : Case
    variant : str
        Of the twin.
    trainings : list[Result[Job]]
        In the order seed, model.
    """

    case: Case
    variant: str
    trainings: list[Result[Job]]

    def of(self, model: str) -> list[Result[Job]]:
        """The trainings of one model, seeds in order."""
        return [t for t in self.trainings if t.job.model == model]

    @property
    def models(self) -> list[str]:
        """In their order."""
        return list(dict.fromkeys(t.job.model for t in self.trainings))

    def predicted_min(self, training: Result[Job]) -> Array:
        """Remaining time at the present speed [judged rows], min, by the chosen checkpoint."""
        return self.case.minutes(np.asarray(training.value["revolutions"], float))


@dataclass(frozen=True)
class Outcome:
    """The whole result.

    Parameters
    ----------
    profile : str
    title : str
        What the numbers are of.
    real : bool
        Whether that is the real set.
    options : Options
    cases : list[CaseResult]
    rows : list[dict]
        Errors by run and model.
    out : Path
        Folder of tables and figures.
    run_id : str or None
        Of the MLflow run.
    computed : int
        Trainings that ran now; the others came from the store.
    missing : tuple of str
        Studies beside the trainings whose data are not at hand.
    """

    profile: str
    title: str
    real: bool
    options: Options
    cases: list[CaseResult]
    rows: list[dict[str, Any]]
    out: Path
    run_id: str | None
    computed: int
    missing: tuple[str, ...] = ()
