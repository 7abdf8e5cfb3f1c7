"""Recordings of the availability study, cut into pieces of equal shaft angle; folds and labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.paper2_digital_twin.availability.source import Background
from papers.paper2_digital_twin.methods.condition_features import line_features, window_features
from papers.paper2_digital_twin.methods.scalograms import ImageOptions, Modulation, modulation, pieces_of
from twingap import BEARINGS, Bearing, RecordSet, TwingapError, data
from twingap.data import NotAtHandError

RIG: Final = "virtual_cwru"
SHORTEST: Final = 4
"""A recording at hand in stretches shorter than so many pieces is no background for the twin."""
WINDOW: Final = 1024  # samples of a short window: as long as a piece of CWRU's 98.mat at hand, 85 ms at 12 kHz
RATE_HZ: Final = {"cwru": 12_000.0, "hit_sm": 12_800.0, "virtual_cwru": 12_000.0}
TITLES: Final = {"cwru": "CWRU", "hit_sm": "HIT-SM", "virtual_cwru": "virtual rig, not CWRU"}
CLASSES: Final = {
    "cwru": ("healthy", "inner", "outer", "ball"),
    "hit_sm": ("healthy", "inner", "outer"),
    "virtual_cwru": ("healthy", "inner", "outer", "ball"),
}


@dataclass(frozen=True)
class Measured:
    """All pieces and windows of a data set."""

    name: str  # of the data set
    bearing: Bearing
    classes: tuple[str, ...]
    found: Modulation  # of all pieces
    features: Array  # [pieces, features] `PIECE_FEATURES`
    recording: NDArray[np.str_]  # [pieces]
    # [windows, features] `WINDOW_FEATURES` of short windows for the healthy map: levels of bands are medians over their
    # lines
    windows: Array
    window_recording: NDArray[np.str_]  # [windows]
    # by recording
    labels: dict[str, int]  # place in `classes`
    bearings: dict[str, str]
    sizes: dict[str, float]  # of the defect, as the data set states it
    speeds_rpm: dict[str, float]
    fs_hz: float

    @property
    def recordings(self) -> tuple[str, ...]:
        return tuple(self.labels)

    def pieces(self, recordings: Sequence[str]) -> NDArray[np.int64]:
        """Places of the pieces of some recordings."""
        return np.flatnonzero(np.isin(self.recording, list(recordings)))

    def piece_labels(self) -> NDArray[np.int64]:
        return np.array([self.labels[r] for r in self.recording], dtype=np.int64)

    def healthy(self) -> tuple[str, ...]:
        return tuple(r for r, label in self.labels.items() if self.classes[label] == "healthy")

    def baseline(self, recordings: Sequence[str]) -> Array:
        """Healthy level of each carrier: geometric mean over healthy recordings, each counted once. [carriers]"""
        each = [np.log(self.found.power[self.recording == r].mean(axis=0)) for r in recordings]
        return np.asarray(np.exp(np.mean(each, axis=0)))


def load(name: str, root: Path | None, rig_duration_s: float = 4.0) -> RecordSet:
    """The data set, at the rate at which it is judged."""
    return data.load(name, duration_s=rig_duration_s) if name == RIG else data.load(name, root, fs_hz=RATE_HZ[name])


def measure(records: RecordSet, name: str, options: ImageOptions) -> Measured:
    """Cut and measure every recording. One that is only at hand in short windows (98.mat of CWRU) becomes pieces of as
    many windows as make the length of a piece, whose powers are averaged."""
    classes, bearing, parts = CLASSES[name], records.bearing or BEARINGS["6205"], []
    labels: dict[str, int] = {}
    bearings: dict[str, str] = {}
    sizes: dict[str, float] = {}
    speeds: dict[str, float] = {}
    for group in records.groups:
        places = [i for i, c in enumerate(records.conditions) if c.group == group]
        first = records.conditions[places[0]]
        if first.fault not in classes:
            raise TwingapError(f"fault {first.fault!r}, one of {', '.join(classes)} expected", where=f"{name}: {group}")
        labels[group] = classes.index(first.fault)
        bearings[group] = str(first.extra["bearing_id"])
        sizes[group] = float(first.extra.get("fault_size_inch", first.extra.get("defect_arc_deg", np.nan)))
        speeds[group] = first.speed_rpm
        length = options.piece_samples(first.fs_hz, first.speed_rpm)
        each = [records[i].samples for i in places]
        if len(each) == 1:
            cut = pieces_of(each[0], length)
            found = modulation(cut, first.fs_hz, first.speed_rpm, options)
            short = [pieces_of(piece, WINDOW) for piece in cut]
        else:
            per = max(1, round(length / each[0].size))
            count = len(each) // per
            every = np.stack(each[: count * per])
            raw = modulation(every, first.fs_hz, first.speed_rpm, options)
            found = Modulation(
                raw.lines.reshape(count, per, *raw.lines.shape[1:]).mean(axis=1),
                raw.power.reshape(count, per, -1).mean(axis=1),
            )
            short = np.split(every[:, :WINDOW], count)
        own = np.stack([window_features(s).mean(axis=0) for s in short])
        features = np.concatenate((own, line_features(found, bearing, options)), axis=-1)
        parts.append((found.lines, found.power, features, window_features(np.concatenate(short), np.median)))
    lines, power, features, windows = (np.concatenate(part) for part in zip(*parts, strict=True))
    recording, window_recording = (np.repeat(list(labels), [len(part[i]) for part in parts]) for i in (0, 3))
    return Measured(
        name, bearing, classes, Modulation(lines, power), features, recording, windows, window_recording, labels,
        bearings, sizes, speeds, records.conditions[0].fs_hz,
    )  # fmt: skip


def at_hand(names: Sequence[str], root: Path | None, rig_duration_s: float) -> dict[str, RecordSet]:
    """Those of the named data sets that are at hand; the virtual rig when none is."""
    found: dict[str, RecordSet] = {}
    for name in names:
        try:
            found[name] = load(name, root, rig_duration_s)
        except NotAtHandError:
            if root is not None:
                raise
    return found or {RIG: load(RIG, root, rig_duration_s)}


def backgrounds(records: RecordSet, data: Measured, image: ImageOptions) -> dict[str, Background]:
    """Healthy recordings that are long enough for the twin to stand on."""
    found = {}
    for place, c in enumerate(records.conditions):
        least = SHORTEST * image.piece_samples(c.fs_hz, c.speed_rpm)
        if c.group in data.healthy() and c.n_samples >= least:
            found[str(c.group)] = Background(records[place].samples, c.speed_rpm)
    return found


Split = Literal["recording", "bearing"]
SPLITS: Final[tuple[Split, ...]] = ("recording", "bearing")
ALL: Final = -1  # all labelled records that there are


def judged(data: Measured, split: Split, fold: int, folds: int, seed: int) -> tuple[str, ...]:
    """Recordings of one fold. Healthy ones are dealt in their order, whatever the split, since there is one healthy
    bearing; those of a fault are shuffled by the seed ("recording") or kept with those of their bearing, one size a
    fold ("bearing")."""
    rng = np.random.default_rng([seed, 21])
    healthy = data.healthy()
    chosen = [str(r) for r in np.array_split(np.array(healthy), folds)[fold]]
    for label in sorted(set(data.labels.values())):
        own = [r for r, c in data.labels.items() if c == label and r not in healthy]
        if not own:
            continue
        if split == "recording":
            order = rng.permutation(len(own))
            chosen += [own[i] for i in np.array_split(order, folds)[fold]]
        else:
            names = sorted(
                {data.bearings[r] for r in own}, key=lambda b: min(data.sizes[r] for r in own if data.bearings[r] == b)
            )
            kept = {str(b) for b in np.array_split(np.array(names), folds)[fold]}
            chosen += [r for r in own if data.bearings[r] in kept]
    return tuple(r for r in data.recordings if r in set(chosen))


def labelled(
    data: Measured, learn: Sequence[str], count: int, rng: np.random.Generator, *, all_healthy: bool
) -> NDArray[np.int64]:
    """Places of the labelled pieces of the recordings `learn`: `count` (or `ALL`) of each fault, from as many
    recordings as there are; of healthy ones as many, since more drown the few, or all (`all_healthy`)."""
    chosen: list[int] = []
    healthy = data.healthy()
    for label in sorted(set(data.labels.values())):
        own = [r for r in learn if data.labels[r] == label]
        piles = [list(rng.permutation(data.pieces([own[i]]))) for i in rng.permutation(len(own))]
        longest = max((len(pile) for pile in piles), default=0)
        dealt = [int(pile[turn]) for turn in range(longest) for pile in piles if turn < len(pile)]
        free = all_healthy and own[:1] and own[0] in healthy
        chosen += dealt if count == ALL or free else dealt[:count]
    return np.array(sorted(chosen), dtype=np.int64)


def counts_of(data: Measured, places: NDArray[np.int64]) -> int:
    """Labelled records of the fault that has fewest among some pieces."""
    labels = data.piece_labels()[places]
    healthy = {data.labels[r] for r in data.healthy()}
    return min(int((labels == c).sum()) for c in set(data.labels.values()) - healthy)
