"""Results of one run to failure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from papers.paper1_rul_varying_speed.cases import Array, Case
from papers.paper1_rul_varying_speed.job import Job
from twingap.sweep import Result


@dataclass(frozen=True)
class CaseResult:
    case: Case
    variant: str  # of the twin
    trainings: list[Result[Job]]  # in the order seed, model

    def of(self, model: str) -> list[Result[Job]]:
        return [t for t in self.trainings if t.job.model == model]

    @property
    def models(self) -> list[str]:
        return list(dict.fromkeys(t.job.model for t in self.trainings))

    def predicted_min(self, training: Result[Job]) -> Array:
        """Remaining time at the present speed [judged rows], min, by the chosen checkpoint."""
        return self.case.minutes(np.asarray(training.value["revolutions"], float))
