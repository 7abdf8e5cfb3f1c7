"""Closing a gap: diagnose, add what is named, and diagnose again until nothing more closes.

records, twin --diagnose--> verdict --its effects at the values found--> twin --diagnose--> ... --> closest twin
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from twingap.gap.api import diagnose
from twingap.gap.diagnosis import Diagnosis, FilePath, Progress, no_progress
from twingap.gap.report.model import listed
from twingap.records import RecordSet
from twingap.records.folder import read_record_set
from twingap.twins.twin_file import TwinSpec, read_twin

MOST: Final = 5
"""Largest number of diagnoses. Each takes as long as `diagnose`; real machines seldom need more than three."""


@dataclass(frozen=True)
class Closing:
    """The way from a twin to one that nothing more can be added to."""

    # One a step. Each is of the twin that the step before left; effects of the last one were not added.
    diagnoses: tuple[Diagnosis, ...]
    twin: TwinSpec  # the closest twin of the last diagnosis: all effects added, and whatever else brings it closer

    @property
    def added(self) -> tuple[tuple[str, ...], ...]:
        """Effects that each step but the last added."""
        return tuple(_addable(found) for found in self.diagnoses[:-1])

    @property
    def gaps(self) -> tuple[float, ...]:
        """Overall gap of the calibrated twin at each step, on the same held-out records, in standard deviations."""
        return tuple(found.report.metrics[0].before for found in self.diagnoses)

    @property
    def closure(self) -> float:
        """Part of the first twin's gap that the last twin closes; 0 where there was none."""
        first, last, floor = self.gaps[0], self.left, self.diagnoses[-1].report.metrics[0].floor
        return (first - last) / (first - floor) if first > floor else 0.0

    @property
    def left(self) -> float:
        """Overall gap of the last twin, in standard deviations."""
        metrics = self.diagnoses[-1].report.closest.metrics
        return min(metrics[0].after, self.gaps[-1]) if metrics else self.gaps[-1]

    @property
    def sentence(self) -> str:
        """What was added, and what it closed."""
        names = [name for step in self.added for name in step]
        if not names and self.left >= self.gaps[0]:
            return "Nothing was added: " + self.diagnoses[0].report.sentence
        near = f"the closest twin leaves {self.left:.3g}" if self.left < self.gaps[-1] else "nothing else closes it"
        if names:
            falls = f"the gap falls from {self.gaps[0]:.3g} to {self.gaps[-1]:.3g} standard deviations"
            start = f"With {listed(names)} added, {falls}; {near}"
        else:
            start = f"Of a gap of {self.gaps[0]:.3g} standard deviations, {near}"
        return f"{start} ({round(100 * self.closure)} % of the gap is closed)."


def close(
    records: RecordSet | FilePath, twin: TwinSpec | FilePath, *, seed: int = 0, progress: Progress | None = None
) -> Closing:
    """Add effects to a twin until no diagnosis names one that closes more of the gap.

    Parameters
    ----------
    records : RecordSet or path-like
        Records of the machine, or their folder.
    twin : TwinSpec or path-like
        The twin, or its twin file.
    seed : int
        Of each diagnosis; the same seed gives the same way.
    progress : callable, optional
        Called with a description of the current step and the completed part, 0 to 1.

    Raises
    ------
    TwingapError
        As `diagnose`.
    """
    records = records if isinstance(records, RecordSet) else read_record_set(records)
    spec = twin if isinstance(twin, TwinSpec) else read_twin(twin)
    progress = progress or no_progress
    found: list[Diagnosis] = []
    specs = [spec]
    while len(found) < MOST:
        now = diagnose(records, spec, seed=seed, quick=True, progress=_of_step(progress, len(found)))
        if found and now.report.metrics[0].before >= found[-1].report.metrics[0].before:
            break  # the effects that were named close nothing once the baseline is calibrated with them
        found.append(now)
        if not (names := _addable(now)) or (now.report.verdict.closure or 0.0) <= 0:
            break
        values = {effect.name: effect.parameter_values() for effect in now.explanation.after.effects}
        spec = replace(
            spec, effects=(*spec.effects, *names), parameters={**spec.parameters, **{n: values[n] for n in names}}
        )
        specs.append(spec)
    if found[-1].report.verdict.status != "no_gap":
        step = _of_step(progress, MOST - 1)
        found[-1] = diagnose(records, specs[len(found) - 1], seed=seed, progress=step)
    last = found[-1].closest_twin()
    assert last is not None and last.identified is not None  # only simulators of the user's own have none
    return Closing(tuple(found), replace(last, identified=replace(last.identified, method="twingap close")))


def _of_step(progress: Progress, step: int) -> Progress:
    """Progress of one diagnosis as a part of all."""
    return lambda what, part: progress(f"step {step + 1}, {what}", (step + part) / MOST)


def _addable(found: Diagnosis) -> tuple[str, ...]:
    """The verdict's effects that can be added to the twin."""
    return tuple(name for name in found.report.verdict.effects if name not in found.explanation.cannot)
