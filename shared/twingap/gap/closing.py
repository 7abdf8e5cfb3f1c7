"""Closing a gap: diagnose, add what is named, and diagnose again until nothing more closes.

records, twin --diagnose--> verdict --its effects at the values found--> twin --diagnose--> ... --> no further name
the last of these diagnoses that finds a gap --search of all values--> closest twin
"""

from __future__ import annotations

import math
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


_AT_FLOOR: Final = 2.0
"""Gap of a twin without further names, over its floor, from which a closer one is sought. A smaller value seeks one
more often, which takes as long as a diagnosis."""
_CLOSER: Final = 0.9
"""Factor on that gap which the closest twin has to reach. A larger value hands back more effects for a smaller gain."""


@dataclass(frozen=True)
class Closing:
    """The way from a twin to one that nothing more can be added to."""

    # One a step. Each is of the twin that the step before left; effects of the last one were not added. The last one
    # that finds a gap has its closest twin.
    diagnoses: tuple[Diagnosis, ...]
    place: int  # of the diagnosis whose twin is the closest
    twin: TwinSpec  # that twin: all effects added, and whatever else brings it closer

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
        first, last, floor = self.gaps[0], self.left, self.closest.report.metrics[0].floor
        return (first - last) / (first - floor) if first > floor else 0.0

    @property
    def left(self) -> float:
        """Overall gap of the closest twin, in standard deviations."""
        return min(self.gaps[-1], _left(self.diagnoses[self.place]))

    @property
    def closest(self) -> Diagnosis:
        """The diagnosis with the closest twin."""
        return self.diagnoses[self.place]

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
    last = found[-1].report
    place = len(found) - 1
    gaps = [k for k, one in enumerate(found) if one.report.verdict.status != "no_gap"]
    # A twin with effects may be called one without a gap for what other forms of these effects leave. The diagnosis
    # before can still move all values.
    if gaps and (gaps[-1] == place or last.metrics[0].before > _AT_FLOOR * last.metrics[0].floor):
        step = _of_step(progress, MOST - 1)
        found[gaps[-1]] = diagnose(records, specs[gaps[-1]], seed=seed, progress=step)
        if gaps[-1] == place or _left(found[gaps[-1]]) < _CLOSER * last.metrics[0].before:
            place = gaps[-1]
    twin_found = found[place].closest_twin()
    assert twin_found is not None and twin_found.identified is not None  # only simulators of the user's own have none
    identified = replace(twin_found.identified, method="twingap close")
    return Closing(tuple(found), place, replace(twin_found, identified=identified))


def _of_step(progress: Progress, step: int) -> Progress:
    """Progress of one diagnosis as a part of all."""
    return lambda what, part: progress(f"step {step + 1}, {what}", (step + part) / MOST)


def _addable(found: Diagnosis) -> tuple[str, ...]:
    """The verdict's effects that can be added to the twin."""
    return tuple(name for name in found.report.verdict.effects if name not in found.explanation.cannot)


def _left(found: Diagnosis) -> float:
    """Overall gap of a diagnosis' closest twin; infinite where none was sought."""
    metrics = found.report.closest.metrics
    return metrics[0].after if metrics else math.inf
