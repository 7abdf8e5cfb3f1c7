"""Target data: recordings to adapt to and to evaluate on."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from papers.paper3_zoa_dann.inputs.options import TargetOptions
from twingap import Condition, RecordSet, TwingapError, data
from twingap.rigs import make_rig


@dataclass(frozen=True)
class Target:
    records: RecordSet  # recordings at the loads in question, labelled
    title: str  # what stands beside every number: "CWRU", or "virtual rig, not CWRU"


@dataclass(frozen=True)
class Task:
    """One question put to the methods; raises `TwingapError` when a recording is on both sides."""

    name: str  # as in the configuration
    title: str  # in words
    adapt: RecordSet  # recordings to adapt to, their faults taken away
    evaluate: RecordSet  # recordings to judge on

    def __post_init__(self) -> None:
        both = set(self.adapt.groups) & set(self.evaluate.groups)
        if both:
            raise TwingapError(f"recordings {sorted(both)} are adapted to and judged on", where=f"task {self.name}")
        if any(c.fault is not None for c in self.adapt.conditions):
            raise TwingapError("the recordings of adaptation carry labels", where=f"task {self.name}")


def load_target(options: TargetOptions, root: Path | None, rig_duration_s: float) -> Target:
    """The public records when they are at hand, else the virtual rig with recordings so long. Raises `TwingapError`
    when they are there in part, or `root` is given without them: who names data wants those used."""
    try:
        return Target(_wanted(data.load(options.data_set, root), options), options.data_set.upper())
    except data.NotAtHandError:
        if root is not None:
            raise
    rig = make_rig(options.surrogate, duration_s=rig_duration_s)
    return Target(_wanted(rig.records(options.surrogate_seed), options), "virtual rig, not CWRU")


def _wanted(records: RecordSet, options: TargetOptions) -> RecordSet:
    """Recordings at the loads in question, of whole recordings only, every class at every load."""
    kept = records.select(
        lambda c: c.extra["load_hp"] in options.loads_hp and c.fault in options.classes and c.group == c.name
    )
    wanted = {(fault, hp) for hp in options.loads_hp for fault in options.classes}
    if missing := sorted(wanted - {(c.fault, c.extra["load_hp"]) for c in kept.conditions}):
        fault, hp = missing[0]
        raise TwingapError(
            f"holds no {fault} recording at {hp} hp", where=f"data set {records.name}",
            mend="complete it (`twingap data list` says what is missing), or leave it out altogether",
        )  # fmt: skip
    return kept


def make_tasks(names: Sequence[str], records: RecordSet) -> list[Task]:
    """Tasks by name, on records with the columns load_hp and fault_size_inch: ``load_A_to_B`` adapts to all recordings
    at A hp and judges all at B; ``unseen_S_A_to_B`` leaves defective bearings of size S (inch) out of adaptation and
    judges them and the healthy one alone."""
    return [_task(name, records) for name in names]


def _task(name: str, records: RecordSet) -> Task:
    found = re.fullmatch(r"(?:load|unseen_(\d+(?:\.\d+)?))_(\d+)_to_(\d+)", name)
    if found is None:
        raise TwingapError(f"unknown task {name!r}", mend="name it load_0_to_2 or unseen_0.014_0_to_2")
    size = float(found[1]) if found[1] else None
    low, high = int(found[2]), int(found[3])

    def of_size(c: Condition) -> bool:
        return size is not None and abs(float(c.extra["fault_size_inch"]) - size) < 1e-9

    adapt = records.select(lambda c: c.extra["load_hp"] == low and not of_size(c)).without_labels()
    evaluate = records.select(
        lambda c: c.extra["load_hp"] == high and (size is None or of_size(c) or c.fault == "healthy")
    )
    title = f"{low} hp to {high} hp" + ("" if size is None else f", unseen bearings ({size:g} in)")
    return Task(name, title, adapt, evaluate)
