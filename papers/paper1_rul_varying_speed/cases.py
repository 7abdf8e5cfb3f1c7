"""Runs to predict: what is known of each at the moment of prediction, and, for evaluation alone, its continuation."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.paper1_rul_varying_speed.lives.options import TargetOptions
from papers.paper1_rul_varying_speed.methods import adaptive_twin
from papers.paper1_rul_varying_speed.methods.adaptive_twin import Adaptation, AdaptiveTwin, NoLifeError
from papers.paper1_rul_varying_speed.methods.degradation import end_row
from papers.paper1_rul_varying_speed.methods.run import Run, read_run, remaining_revolutions, remaining_time_s
from papers.paper1_rul_varying_speed.methods.simulated_lives import Snapshots, measured_snapshots
from twingap import Bearing, RecordSet, TwingapError, data
from twingap.prognosis import normalised_peak_to_peak
from twingap.rigs import SmartMaintenanceRig, stored_records, truth


@dataclass(frozen=True)
class Target:
    """The machine, its runs, and what stands beside every number."""

    records: RecordSet  # all runs; group = bearing
    title: str  # "Smart Maintenance", or "virtual Smart Maintenance rig (surrogate)"
    onsets_s: dict[str, float]  # when damage really began, where that is known: of the rig


@dataclass(frozen=True)
class Known:
    """What a training may see of a run: nothing of it comes from after `twin.now_row`."""

    name: str  # of the bearing
    bearing: Bearing
    fault: str
    fs_hz: float
    unit: str
    dt_s: float
    twin: AdaptiveTwin
    healthy: Snapshots  # records of the healthy beginning
    real: Snapshots  # records from K_anomaly to now, without labels

    def __post_init__(self) -> None:
        last = self.twin.now_row - self.twin.onset_row
        if self.real.revolutions is not None or self.real.position.max() > last:
            raise AssertionError("a training may see neither labels nor records after now")


@dataclass(frozen=True)
class Case:
    known: Known
    run: Run  # all rows to the end of life
    # records from K_anomaly to the end of life, with their true remaining revolutions: for the judge alone
    judged: Snapshots
    onset_s: float | None  # when damage really began, where that is known
    waited: tuple[str, ...]  # why the twin could not be adapted earlier

    @property
    def name(self) -> str:
        return self.known.name

    @property
    def true_min(self) -> Array:
        """True remaining time at the present speed [judged rows], min: eq. 14."""
        assert self.judged.revolutions is not None
        return remaining_time_s(self.judged.revolutions, self.judged.speed_rpm) / 60

    def minutes(self, revolutions: Array) -> Array:
        """Remaining revolutions [judged rows] as time at the present speed, min."""
        return remaining_time_s(revolutions, self.judged.speed_rpm) / 60

    @property
    def later(self) -> NDArray[np.bool_]:
        """Judged rows after now: records that training never saw."""
        twin = self.known.twin
        return np.asarray(self.judged.position > twin.now_row - twin.onset_row)

    @cached_property
    def normalised(self) -> Array:
        """Normalised peak to peak [rows of the run], eq. 11."""
        return normalised_peak_to_peak(self.run.peak_to_peak, self.run.speed_rpm, self.known.twin.influence)

    @cached_property
    def digest(self) -> str:
        """Hex sha256 of run and judged records, in steps of 1e-6, so that no processor's last bit matters."""
        about = (self.name, self.known.fs_hz, self.known.fault, self.judged.samples.shape)
        whole = hashlib.sha256(repr(about).encode())
        for part in (self.run.time_s, self.run.speed_rpm, self.run.peak_to_peak, self.judged.samples):
            whole.update(np.round(part * 1e6).astype("<i8").tobytes())
        return whole.hexdigest()

    def mean_of_lives(self) -> Array:
        """Remaining revolutions [judged rows] that the simulated lives have on average: what needs no network."""
        twin, rows = self.known.twin, self.judged.position.astype(int)
        each = []
        for life in twin.lives:
            left = np.zeros(max(rows.max() + 1, life.speed_rpm.size))
            left[: life.speed_rpm.size] = life.remaining_revolutions
            each.append(left[rows])
        return np.asarray(np.mean(each, axis=0))


def load_target(
    options: TargetOptions, root: Path | None, bearings: Sequence[str],
    progress: Callable[[str, float], None] = lambda what, fraction: None,
) -> Target:  # fmt: skip
    """The real runs when they are at hand, else the virtual rig's, of whose making `progress` is told. Raises
    `TwingapError` when `root` is given without them (who names data wants those used), or runs are missing."""
    try:
        records = data.load(options.data_set, root)
    except data.NotAtHandError:
        if root is not None:
            raise
    else:
        if missing := [b for b in bearings if b not in records.groups]:
            raise TwingapError(f"holds no run of {', '.join(missing)}", where=f"data set {records.name}")
        return Target(records, "Smart Maintenance", {})
    rig = SmartMaintenanceRig(interval_s=options.interval_s, profile=options.profile, bearings=tuple(bearings))
    records = stored_records(rig, options.surrogate_seed, progress=progress)
    onsets_s = {name: own.onset_s for name, own in truth(rig, options.surrogate_seed).items()}
    return Target(records, rig.title, onsets_s)


def read_case(target: Target, name: str, options: TargetOptions, adaptation: Adaptation) -> Case:
    """Read one run; raises `TwingapError` when nothing can be predicted of it, or it does not reach the end of life."""
    records = target.records.select(lambda c: c.group == name)
    run = read_run(records)
    twin, waited = adapted(records, run, name, adaptation)
    # From here on the end of the run is looked at: for labels that only the judge gets.
    beyond = end_row(run.peak_to_peak[twin.onset_row :], adaptation.limit)
    if beyond is None:
        raise TwingapError(f"never reaches {adaptation.limit:g}", where=f"run {name}", mend="lower adaptation.limit")
    end = twin.onset_row + beyond
    return case_of(
        records, run, twin, end, waited, name=name, fault=options.fault, n_samples=options.window_samples,
        healthy_rows=run.rows_in(adaptation.reference_min), onset_s=target.onsets_s.get(name),
    )  # fmt: skip


def adapted(records: RecordSet, run: Run, name: str, adaptation: Adaptation) -> tuple[AdaptiveTwin, tuple[str, ...]]:
    """The twin at the first moment at which it can be had, and why not earlier; errors name the run."""
    waited: list[str] = []
    try:
        twin = adaptive_twin.adapt_when_possible(
            run, adaptive_twin.read_mode(records, run, adaptation), adaptation, waited.append
        )
    except TwingapError as error:
        place = f"run {name}" if error.where in (None, "run") else f"run {name}, {error.where}"
        kind = NoLifeError if isinstance(error, NoLifeError) else TwingapError
        raise kind(error.what, where=place, mend=error.mend) from error
    return twin, tuple(waited)


def case_of(
    records: RecordSet, run: Run, twin: AdaptiveTwin, end: int, waited: tuple[str, ...], *, name: str, fault: str,
    n_samples: int, healthy_rows: int, onset_s: float | None = None,
) -> Case:  # fmt: skip
    """The first `n_samples` of records up to now for training, unlabelled; of those to the end, with labels, for the
    judge alone."""
    if records.bearing is None:
        raise TwingapError("brings no bearing geometry", where=f"record set {records.name!r}")
    onset, fs_hz = twin.onset_row, records.conditions[0].fs_hz
    judged = measured_snapshots(records, onset, range(onset + 1, end + 1), n_samples)
    left = remaining_revolutions(run.speed_rpm[onset : end + 1], run.dt_s)[1:]
    seen = judged.take(judged.position <= twin.now_row - onset)
    healthy = measured_snapshots(records, onset, range(healthy_rows), n_samples)
    known = Known(name, records.bearing, fault, fs_hz, records.unit, run.dt_s, twin, healthy, seen)
    return Case(known, run.until(end), replace(judged, revolutions=left), onset_s, waited)
