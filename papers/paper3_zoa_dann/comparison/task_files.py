"""Tasks A1-A4 and B1-B3, one file each under tasks/: records to adapt to and to evaluate on.

Labels decide what an experiment is given to adapt to (as many healthy windows as that, as many of each fault), as they
would decide which machines stand in the hall; they are then taken away. Methods see windows without them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from papers.options import expect
from papers.paper3_zoa_dann.inputs.options import TargetOptions
from papers.paper3_zoa_dann.job import Measured
from papers.paper3_zoa_dann.tasks import Target, Task
from twingap import Condition, RecordSet, TwingapError, data
from twingap.adapt import Windows, cut, joined
from twingap.bearing import FAULTS
from twingap.config import build, read_toml
from twingap.provenance import digest_of_value
from twingap.rigs import make_rig

FOLDER: Final = Path(__file__).with_name("tasks")
TITLES: Final = {"cwru": "CWRU", "hit_sm": "HIT-SM"}
Counts = Mapping[str, int]  # windows by class


@dataclass(frozen=True)
class TaskFile:
    """A task, as its file says it; refused are counts of other classes, and sides that would share recordings."""

    name: str  # short
    title: str  # in words
    # "A", "B": tasks over which a mean is taken, and which published mean stands beside it.
    family: Literal["A", "B"]
    data_set: str  # by its name in `twingap.data`
    fs_hz: float  # rate to which recordings are brought
    classes: tuple[str, ...]  # faults in the order of their labels, "healthy" among them
    window_samples: int
    condition: str  # column (or speed_rpm) that tells the machine's conditions apart
    adapt_at: tuple[float, ...]  # conditions whose faulty recordings are adapted to
    healthy_adapt_at: tuple[float, ...]  # the same of healthy recordings
    judge_at: tuple[float, ...]  # conditions whose faulty recordings are judged on
    healthy_judge_at: tuple[float, ...]  # the same of healthy recordings
    size: str  # column that tells the bearings of one fault apart
    sizes: tuple[float, ...]  # its values; each is one bearing of each fault
    # whether, outside the strict column, bearings that are judged are also adapted to (in other recordings)
    same_bearings: bool
    width_mm: tuple[float, ...]  # range of the virtual bearings' defect widths
    judged: dict[str, int]  # windows to judge on, by class
    available: dict[str, dict[str, int]]  # what there is to adapt to, by name: windows by class

    def __post_init__(self) -> None:
        for fault in self.classes:
            expect(fault, FAULTS, "classes")
        if "balanced" not in self.available:
            raise TwingapError("nothing is said of balanced data", mend="add a table [available.balanced]")
        for name, counts in {"judged": self.judged, **self.available}.items():
            if set(counts) != set(self.classes) or min(counts.values()) < 1:
                raise TwingapError(f"{name}: at least 1 window of each of {', '.join(self.classes)} expected")
        if set(self.healthy_adapt_at) & set(self.healthy_judge_at):
            raise TwingapError("healthy recordings of one condition are adapted to and judged on")
        if self.same_bearings and set(self.adapt_at) & set(self.judge_at):
            mend = "choose another condition, or same_bearings = false"
            raise TwingapError("faulty recordings of one condition are adapted to and judged on", mend=mend)
        if len(self.width_mm) != 2 or not 0 < self.width_mm[0] < self.width_mm[1]:
            raise TwingapError(f"width_mm = {list(self.width_mm)}, [low, high] with 0 < low < high expected")

    def unseen(self, seed: int) -> float:
        """Size whose bearings the given seed leaves out of adaptation."""
        return self.sizes[seed % len(self.sizes)]


def read_task(name: str, folder: Path = FOLDER) -> TaskFile:
    """Read tasks/NAME.toml; errors name file, key, value and what was expected."""
    path = folder / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in folder.glob("*.toml")))
        raise TwingapError(f"unknown task {name!r}", mend=f"use one of {known}")
    task = build(TaskFile, read_toml(path), path)
    if task.name != name:
        raise TwingapError(f"calls itself {task.name!r}", where=path, mend=f"name it {name!r}")
    return task


@dataclass(frozen=True)
class Material(Measured):
    """What one training is given and judged by."""

    adapted: tuple[str, ...]  # bearings that were adapted to
    bearing: NDArray[np.str_]  # [windows] bearing of each window that is judged

    @property
    def unseen(self) -> NDArray[np.bool_]:
        """Which windows are of bearings of which nothing was adapted to: the strict column."""
        return ~np.isin(self.bearing, self.adapted)

    @property
    def digest(self) -> str:
        return digest_of_value([super().digest, list(self.adapted), [str(name) for name in self.bearing]])


def load_recordings(task: TaskFile, root: Path | None, surrogate: TargetOptions, duration_s: float) -> Target | None:
    """The recordings of a task's data set, or of the virtual rig in place of the surrogate's own; None where neither is
    at hand. Raises `TwingapError` when they are there in part or `root` is given without a set that has a stand-in."""
    title = TITLES.get(task.data_set, task.data_set)
    try:
        records = data.load(task.data_set, root, fs_hz=task.fs_hz)
        _check(task, records)
        return Target(records, title)
    except data.NotAtHandError:
        if root is not None and (task.data_set == surrogate.data_set or (root / task.data_set).exists()):
            raise
    if task.data_set != surrogate.data_set:
        return None
    rig = make_rig(surrogate.surrogate, duration_s=duration_s).records(surrogate.surrogate_seed)
    _check(task, rig)
    return Target(rig, f"virtual rig, not {title}")


def split(task: TaskFile, records: RecordSet, unseen: float | None) -> tuple[Task, RecordSet]:
    """Recordings to adapt to (without bearings of the size `unseen`) and to judge on (those and healthy ones alone);
    the former once more, labelled. Raises `TwingapError` when one would be on both sides, or a class is missing."""
    if unseen is None and not task.same_bearings:
        raise TwingapError("adapts to the conditions it is judged at: some bearings must be left out", where=task.name)
    adapt = records.select(
        lambda c: _at(task, c, task.adapt_at, task.healthy_adapt_at) and _size(task, c) in (None, *task.sizes)
        and (unseen is None or _size(task, c) != unseen)
    )  # fmt: skip
    judge = records.select(
        lambda c: _at(task, c, task.judge_at, task.healthy_judge_at)
        and _size(task, c) in (None, *(task.sizes if unseen is None else (unseen,)))
    )  # fmt: skip
    for side, held in (("adapt to", adapt), ("judge on", judge)):
        if missing := set(task.classes) - {c.fault for c in held.conditions}:
            raise TwingapError(
                f"holds no {', '.join(sorted(missing))} recording to {side} for task {task.name}",
                where=f"data set {records.name}", mend="complete it: `twingap data list` says what is missing",
            )  # fmt: skip
    title = task.title if unseen is None else f"{task.title}, unseen bearings ({unseen:g})"
    return Task(task.name, title, adapt.without_labels(), judge), adapt


def material(task: TaskFile, records: RecordSet, available: str, unseen: float | None) -> Material:
    """The windows of one task, in one state of what is available."""
    if available not in task.available:
        raise TwingapError(f"unknown {available!r}", where=task.name, mend=f"use one of {', '.join(task.available)}")
    sides, labelled = split(task, records, unseen)
    adapt, adapted = _windows(labelled, task.available[available], task)
    evaluate, judged = _windows(sides.evaluate, task.judged, task)
    return Material(adapt.unlabelled(), evaluate, tuple(dict.fromkeys(str(name) for name in adapted)), judged)


def windows_to_adapt_to(task: TaskFile, records: RecordSet, available: str, unseen: float | None) -> Windows:
    """The windows that `material` adapts to, with their labels: for a reference that is taught by them."""
    return _windows(split(task, records, unseen)[1], task.available[available], task)[0]


def _windows(records: RecordSet, counts: Counts, task: TaskFile) -> tuple[Windows, NDArray[np.str_]]:
    """Windows with so many of each class, shared out over its recordings as evenly as whole numbers go; bearings."""
    parts: list[Windows] = []
    bearings: list[str] = []
    for fault in task.classes:
        places: dict[str, list[int]] = {}
        for place, condition in enumerate(records.conditions):
            if condition.fault == fault:
                places.setdefault(str(condition.group), []).append(place)
        each, more = divmod(counts[fault], len(places))
        for number, held in enumerate(places.values()):
            for place, wanted in _spread(held, each + (number < more)):
                parts.append(cut(records.take([place]), task.window_samples, wanted, task.classes))
                bearings += [str(records.conditions[place].extra["bearing_id"])] * wanted
    return joined(parts), np.array(bearings)


def _spread(places: list[int], count: int) -> list[tuple[int, int]]:
    """(record, windows) of one recording, which some data sets bring in many pieces: evenly over them."""
    if count <= len(places):
        chosen = np.linspace(0, len(places) - 1, count).astype(int)
        return [(places[i], 1) for i in chosen]
    each, more = divmod(count, len(places))
    return [(place, each + (i < more)) for i, place in enumerate(places)]


def _at(task: TaskFile, c: Condition, faulty: tuple[float, ...], healthy: tuple[float, ...]) -> bool:
    """Whether a recording is of a class of the task, and at one of these conditions."""
    at = float(c.speed_rpm if task.condition == "speed_rpm" else c.extra[task.condition])
    return c.fault in task.classes and at in (healthy if c.fault == "healthy" else faulty)


def _size(task: TaskFile, c: Condition) -> float | None:
    """Size of a faulty bearing's defect."""
    return None if c.fault == "healthy" else float(c.extra[task.size])


def _check(task: TaskFile, records: RecordSet) -> None:
    """Refuse a record set in which a state of the task cannot be set up."""
    for unseen in (None, *task.sizes) if task.same_bearings else task.sizes:
        split(task, records, unseen)
