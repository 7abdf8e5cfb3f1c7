"""Remaining life along a complete run, estimated row by row.

Run --OnlineLife, one record in memory--> Followed: an estimate for each row, notes, and the outcome of the run
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from twingap.errors import TwingapError
from twingap.prognosis.estimate import Estimate, LifeOptions
from twingap.prognosis.online import OnlineLife
from twingap.prognosis.outcomes import Outcome, outcome_of
from twingap.prognosis.prior import Prior
from twingap.prognosis.run_records import Run, RunRow

COLUMNS: Final = (
    "record", "anomaly", "remaining_revolutions", "remaining_time_s", "remaining_time_s_lo", "remaining_time_s_hi",
)  # fmt: skip
_NEARLY: Final = 0.9
"""Smallest length of a record relative to the healthy ones; lower accepts records whose peak to peak is too small."""
_OUTLIER: Final = 0.5
"""Length relative to the median below which a healthy record does not determine the common length."""
_IMPULSIVE: Final = 6.0
"""Median kurtosis of the first rows from which a note warns that they may not be healthy; higher warns less often."""
_DROPOUT: Final = 0.1
"""Share of equal consecutive samples from which a record is left out; larger keeps records with shorter dropouts."""
REACHED: Final = "end of life is reached"
"""Beginning of the note that names the record at which life ends."""


@dataclass(frozen=True)
class Followed:
    """A run with its estimates.

    Parameters
    ----------
    run : Run
    estimates : tuple of Estimate
        One for each row.
    notes : tuple of str
    outcome : Outcome
        Outcome, if the run has ended: with the last row, or where it reached an absolute limit.
    alarm, onset : str or None
        Names of the records of the alarm and of the onset.
    """

    run: Run
    estimates: tuple[Estimate, ...]
    notes: tuple[str, ...]
    outcome: Outcome
    alarm: str | None
    onset: str | None

    def rows(self) -> list[dict[str, Any]]:
        """Rows of rul.csv; None for an empty cell."""
        return [_row(row, e) for row, e in zip(self.run.rows, self.estimates, strict=True)]


def follow(
    run: Run,
    options: LifeOptions | None = None,
    prior: Prior | None = None,
    *,
    progress: Callable[[str, float], None] | None = None,
) -> Followed:
    """Estimates of remaining life after every row of a run, each from the rows up to it.

    Parameters
    ----------
    run : Run
    options : LifeOptions, optional
    prior : Prior, optional
    progress : callable (what, fraction), optional
        Called after every row.

    Raises
    ------
    TwingapError
        When the healthy rows of the run have no scatter, or are above the limit.

    Notes
    -----
    Peak to peak increases with the length of a record. Where lengths differ, it is that of the first samples of every
    record, as many as the shortest healthy record has. An average over segments would scatter less for longer records.
    Only healthy rows determine the length, so that estimates do not depend on later rows.
    """
    life = OnlineLife(options, prior)
    n_samples = _common_length(run, life.options.healthy_rows)
    estimates: list[Estimate] = []
    lived: list[float] = []
    skipped: list[str] = []
    short: list[str] = []
    kurtosis: list[float] = []
    fingerprints: set[tuple[float, float]] = set()
    usable = timeless = 0
    clipped: list[tuple[int, str, int]] = []
    settled: list[str] = []
    spiky: list[str] = []
    dropped: list[str] = []
    censored = 0
    for place, row in enumerate(run.rows):
        cut_off = False
        try:
            amplitude = row.amplitude(n_samples)
        except TwingapError as error:
            skipped.append(str(error))
            height, full, shape = (float("nan"),) * 3
        else:
            height, full, shape = amplitude.peak_to_peak, amplitude.full_peak_to_peak, amplitude.kurtosis
            if (fingerprint := amplitude.fingerprint(run.unit)) is not None:
                fingerprints.add(fingerprint)
            if amplitude.settling:
                settled.append(row.name)
            if amplitude.spikes:
                spiky.append(row.name)
            if _DROPOUT <= amplitude.constant < 1 and row.speed_rpm > 0:
                dropped.append(row.name)
                height, shape = float("nan"), float("nan")
            elif amplitude.clipped and row.speed_rpm > 0:
                clipped.append((place, row.name, amplitude.clipped))
                # The true amplitude is larger: only that the end is reached is certain.
                cut_off = life.alarm_row is not None and not life.reaches_end(row.speed_rpm, height)
            if row.speed_rpm > 0 and height <= 0:
                skipped.append(f"record {row.name!r} has no vibration")
            elif row.speed_rpm > 0 and row.channel and n_samples and row.channel.n_samples < _NEARLY * n_samples:
                short.append(row.name)
                height, shape = float("nan"), float("nan")
        if len(kurtosis) < life.options.healthy_rows and np.isfinite(shape):
            kurtosis.append(shape)
        usable += row.speed_rpm > 0 and height > 0
        try:
            used = float("nan") if cut_off else height
            estimate = life.update(row.time_s, row.speed_rpm, used, full_peak_to_peak=full)
        except TwingapError as error:
            raise TwingapError(error.what, where=f"run {run.name!r}, {error.where}", mend=error.mend) from error
        if clipped and life.onset_row is not None and clipped[-1][0] >= life.onset_row and life.end_row is None:
            estimate, censored = estimate.at_most(), censored + 1
        estimates.append(estimate)
        lived.append(life.revolutions)
        timeless += life.timeless
        if progress is not None:
            progress("remaining life", (place + 1) / len(run.rows))
    left_out = skipped[0] + (f", and {len(skipped) - 1} more" if len(skipped) > 1 else "") if skipped else None
    if not usable and dropped:
        left_out = left_out or f"in record {dropped[0]!r} the signal stands still"
    if left_out and not usable:
        raise TwingapError(f"no record can be used: {left_out}", where=f"run {run.name!r}")
    notes = [*run.notes, *_shortened(life.notes)]
    lengths = {row.channel.n_samples for row in run.rows if row.channel is not None and row.speed_rpm > 0}
    if n_samples is not None and len(lengths) > 1:
        notes.append(
            f"records have {min(lengths)} to {max(lengths)} samples, and peak to peak grows with length: it is that of "
            f"the first {n_samples} of each, as many as the shortest healthy record has"
        )
    if clipped:
        notes.append(_clipping(clipped, censored))
    for names, what in (
        (settled, "the sensor settles after power-on: its exponential offset is taken out"),
        (spiky, "single samples stand out as of a loose contact: they are taken out"),
        (dropped, "the signal stands still as of a failing sensor or cable: left out"),
    ):
        if names:
            them = f"record {names[0]!r}" if len(names) == 1 else f"{len(names)} records, the first {names[0]!r},"
            notes.append(f"in {them} {what}")
    if short:
        them = f"record {short[0]!r} has" if len(short) == 1 else f"{len(short)} records, the first {short[0]!r}, have"
        notes.append(
            f"{them} too few samples to be compared with healthy ones: left out, so no anomaly can be detected there"
        )
    if timeless:
        notes.append(
            f"by time_s there are no revolutions since the onset of the anomaly in {timeless} rows: remaining life by "
            "growth is unknown there"
        )
    if left_out:
        notes.append(f"left out, with the estimate of the row before continued: {left_out}")
    if kurtosis and float(np.median(kurtosis)) > _IMPULSIVE:
        notes.append(
            f"the first rows are impulsive (kurtosis {np.median(kurtosis):.1f}; Gaussian noise has 3): the bearing may "
            "not have been healthy at the start, to which amplitude is relative"
        )
    if life.alarm_row is None:
        notes.append(_why_none(life, usable))
    if life.faded:
        notes.append(
            f"in {life.faded} rows amplitude is less than a fifth of that of the first rows, as of a failing sensor: "
            "left out, so no anomaly can be detected there"
        )
    if life.end_row is not None:
        notes.append(f"{REACHED} at record {run.rows[life.end_row].name!r}: remaining life is 0 from there on")
    outcome = outcome_of(run.name, life, estimates, lived, frozenset(fingerprints), run.load_n())
    alarm, onset = (None if place is None else run.rows[place].name for place in (life.alarm_row, life.onset_row))
    return Followed(run, tuple(estimates), tuple(notes), outcome, alarm, onset)


def _clipping(clipped: Sequence[tuple[int, str, int]], censored: int) -> str:
    """Note on clipped records: place, name and number of clipped samples of each."""
    samples = sum(count for *_, count in clipped)
    first = clipped[0][1]
    them = f"record {first!r} is" if len(clipped) == 1 else f"{len(clipped)} records, the first {first!r}, are"
    said = f"{them} clipped ({samples} samples at the ends of the range): true amplitude is larger than recorded"
    if not censored:
        return said
    return (
        f"{said}; in {censored} rows remaining life is only bounded from above (at most remaining_time_s_hi): the "
        "estimate is left empty and the interval begins at 0"
    )


def _common_length(run: Run, healthy_rows: int) -> int | None:
    """Number of first samples of every record that peak to peak is taken of; None for a run without records.

    It is the shortest length among the healthy records, without those that are much shorter than their median.
    """
    lengths = [row.channel.n_samples for row in run.rows if row.channel is not None and row.speed_rpm > 0]
    healthy = np.array(lengths[:healthy_rows])
    return int(healthy[healthy >= _OUTLIER * np.median(healthy)].min()) if healthy.size else None


def _row(row: RunRow, e: Estimate) -> dict[str, Any]:
    values = (e.revolutions, *e.time_s())
    cells = [float(v) if np.isfinite(v) else None for v in values]
    return dict(zip(COLUMNS, (row.name, int(e.anomaly), *cells), strict=True))


def _shortened(notes: Sequence[str], kept: int = 3) -> list[str]:
    """The first notes of each kind (by their first two words), and the number of the others."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(" ".join(note.split()[:2]), []).append(note)
    out = []
    for alike in kinds.values():
        more = len(alike) - kept
        out += alike[:kept] if more > 1 else alike  # the text "and 1 more" would not be shorter
        out += [f"and {more} more such notes"] if more > 1 else []
    return out


def _why_none(life: OnlineLife, usable: int) -> str:
    if life.monitored:
        why = "amplitude does not stay above its healthy scatter"
        if life.above:
            last = "the last row is" if life.above == 1 else f"the last {life.above} rows are"
            why = f"{last} above the healthy scatter, {life.together} consecutive ones are needed"
        return f"no anomaly: {why}; remaining life is left empty" + (
            "" if life.prior is None else " except for estimates from other runs"
        )
    return (
        f"{usable} {'row' if usable == 1 else 'rows'} of the running machine are usable, too few to detect an "
        f"anomaly: the first {life.options.healthy_rows} of them are assumed healthy (--healthy-rows)"
    )
