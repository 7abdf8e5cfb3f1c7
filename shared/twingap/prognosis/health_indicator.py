"""Health indicators of a run: features, their fusion, and selection of the most suitable.

records --> 11 time-domain, 4 spectral-kurtosis features [rows, 15]
features --healthy start--> normalised features, fusion features --criteria--> selected one

Source: section 4 of paper 2. Indicators are online: they depend on the first `healthy_rows` and on the row itself.
Selection depends on the runs it is given; where these are other runs, the whole procedure is online.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.prognosis.fusion import Fusion, Order, Scaling, constant, learn_fusion
from twingap.prognosis.indicator_criteria import IndicatorCriteria, evaluate_indicator
from twingap.prognosis.one_run import in_order
from twingap.records import RecordSet
from twingap.records.artefacts import clipped_samples, without_settling
from twingap.records.measurable import refuse_unmeasurable
from twingap.signal.features import PAPER2_FEATURES, paper2_features

Array = NDArray[np.float64]

WINDOW_SAMPLES: Final = 128
"""Window of the spectral kurtosis; longer resolves frequency better and needs longer records."""
SILENT: Final = 0.2
"""RMS relative to the healthy one below which a record is silent (machine stopped, or sensor off)."""


@dataclass(frozen=True)
class Run:
    """Features along one run.

    Parameters
    ----------
    name : str
    time_s : Array [rows]
        Time, s, not decreasing.
    names : tuple of str
    features : Array [rows, features]
    """

    name: str
    time_s: Array
    names: tuple[str, ...]
    features: Array

    def __post_init__(self) -> None:
        if self.features.shape != (self.time_s.size, len(self.names)):
            raise TwingapError(
                f"features of shape {self.features.shape} for {self.time_s.size} times and {len(self.names)} names",
                where=self.name,
            )
        if not (np.isfinite(self.features).all() and np.isfinite(self.time_s).all()):
            raise TwingapError("contains NaN or infinity", where=self.name, mend="leave these rows out")
        if (np.diff(self.time_s) < 0).any():
            raise TwingapError("times decrease", where=self.name, mend="sort the rows by time")

    def until(self, rows: int) -> Run:
        """The run up to a number of rows."""
        return Run(self.name, self.time_s[:rows], self.names, self.features[:rows])

    def only(self, names: Sequence[str]) -> Run:
        """The run with these features, in this order."""
        places = [self.names.index(name) for name in names]
        return Run(self.name, self.time_s, tuple(names), self.features[:, places])


@dataclass(frozen=True)
class Indicators:
    """Candidate indicators of one run: normalised features, and fusion features "fusion 1", "fusion 2", ...

    Parameters
    ----------
    fusion : Fusion
        Fusion of the features that vary.
    values : dict[str, Array [rows]]
        Candidates by name.
    constant : tuple of str
        Features left out, since they are constant in the rows of the fit.
    """

    fusion: Fusion
    values: dict[str, Array]
    constant: tuple[str, ...]


def features_of(
    records: RecordSet,
    name: str | None = None,
    *,
    window_samples: int = WINDOW_SAMPLES,
    progress: Callable[[], None] = lambda: None,
    notes: list[str] | None = None,
) -> Run:
    """The 15 features of each record of a run, one record in memory at a time.

    Parameters
    ----------
    records : RecordSet
        Records of one run with `time_s`, by which they are sorted.
    name : str, optional
        Name of the run; that of the set when absent.
    window_samples : int
        Window of the spectral kurtosis.
    progress : callable
        Called after each record.
    notes : list of str, optional
        Extended by what was unusual: rows out of order, clipped samples, a sensor that settles.

    Returns
    -------
    Run

    Raises
    ------
    TwingapError
        When records have no time, each share one with another, are too short for the spectral kurtosis, or cannot be
        measured by an accelerometer.
    """
    missing = [c.name for c in records.conditions if c.time_s is None]
    if missing:
        raise TwingapError(
            f"{len(missing)} of {len(records)} records have no time_s, the first is {missing[0]!r}",
            where=records.name, mend="add a column time_s: seconds from the start of the run",
        )  # fmt: skip
    times = np.array([c.time_s for c in records.conditions], float)
    order, sorting = in_order(times.tolist(), [c.name for c in records.conditions], records.name)
    clipped: list[str] = []
    settled: list[str] = []
    rows = np.empty((len(records), len(PAPER2_FEATURES)))
    for place, at in enumerate(order):
        record = records[at]
        where, n_samples = f"record {record.condition.name!r}", record.condition.n_samples
        refuse_unmeasurable(record.samples, where)
        if n_samples < window_samples:
            raise TwingapError(
                f"{n_samples} samples, at least {window_samples} expected for its spectral kurtosis", where=where,
                mend="give longer records",
            )  # fmt: skip
        try:
            samples, offset = without_settling(record.samples)
            clipped += [record.condition.name] * bool(clipped_samples(record.samples))
            settled += [record.condition.name] * bool(offset)
            rows[place] = paper2_features(samples, record.condition.fs_hz, window_samples=window_samples).values
        except TwingapError as error:
            raise TwingapError(error.what, where=where, mend=error.mend) from error
        progress()
    if notes is not None:
        notes += sorting
        if clipped:
            notes.append(f"{len(clipped)} records are clipped, the first {clipped[0]!r}: true amplitude is larger")
        if settled:
            notes.append(
                f"in {len(settled)} records, the first {settled[0]!r}, the sensor settles after power-on: its "
                "exponential offset is taken out"
            )
    return Run(name or records.name, times[order], PAPER2_FEATURES, rows)


def running(run: Run, healthy_rows: int, share: float = SILENT) -> NDArray[np.bool_]:
    """Whether records [rows] are not silent: RMS above a fraction of the healthy one.

    All are kept where there is no RMS, or where it is negative and so in decibels. The healthy RMS is the upper
    quartile of the first rows with vibration, since a machine may stand still at first.
    """
    if "rms" not in run.names or negative_rms(run) is not None:
        return np.ones(run.time_s.size, dtype=bool)
    rms = run.features[:, run.names.index("rms")]
    first = rms[rms > 0][:healthy_rows]
    if not first.size:  # no row with vibration
        return np.ones(rms.size, dtype=bool)
    return np.asarray((rms > 0) & (rms >= share * np.quantile(first, 0.75)))


def negative_rms(run: Run) -> int | None:
    """Number of rows with an `rms` below 0, which is then no RMS; None without such rows."""
    if "rms" not in run.names:
        return None
    below = int(np.count_nonzero(run.features[:, run.names.index("rms")] < 0))
    return below or None


def online_indicators(
    run: Run, healthy_rows: int, *, scaling: Scaling = "z", order: Order = "descending"
) -> Indicators:
    """Candidates fitted on the first rows; the value at a row depends on these and on the row itself.

    Parameters
    ----------
    run : Run
    healthy_rows : int
        Number of first rows, assumed healthy.
    scaling, order
        See `learn_fusion`.

    Raises
    ------
    TwingapError
        When the run is not longer than its healthy start, or all features are constant.
    """
    if not 3 <= healthy_rows < run.time_s.size:
        raise TwingapError(
            f"{healthy_rows} healthy rows of {run.time_s.size}, at least 3 and fewer than all expected", where=run.name
        )
    return _indicators(run, run.features[:healthy_rows], scaling, order)


def offline_indicators(run: Run, *, scaling: Scaling = "z", order: Order = "descending") -> Indicators:
    """Candidates as in paper 2, fitted on the complete run, so that values depend on later rows.

    Parameters and errors are those of `online_indicators`.
    """
    return _indicators(run, run.features, scaling, order)


def _indicators(run: Run, learnt_from: Array, scaling: Scaling, order: Order) -> Indicators:
    flat = constant(learnt_from)
    if flat.all():
        raise TwingapError(
            f"all {flat.size} features are constant in the {learnt_from.shape[0]} rows of the fit", where=run.name,
            mend="give measured features, or more healthy rows",
        )  # fmt: skip
    names = [name for name, is_flat in zip(run.names, flat, strict=True) if not is_flat]
    if taken := [name for name in names if name in {f"fusion {k + 1}" for k in range(len(names))}]:
        raise TwingapError(
            f"has a feature with the name {taken[0]!r} of a fusion feature", where=run.name, mend="rename it"
        )
    fusion = learn_fusion(learnt_from[:, ~flat], scaling=scaling, order=order)
    kept = run.features[:, ~flat]
    values: dict[str, Array] = dict(zip(names, fusion.normalised(kept).T, strict=True))
    values |= {f"fusion {k + 1}": column for k, column in enumerate(fusion.fused(kept).T)}
    return Indicators(fusion, values, tuple(n for n, is_flat in zip(run.names, flat, strict=True) if is_flat))


def evaluate_candidates(
    indicators: Indicators, time_s: Array, *, healthy_rows: int, window: int
) -> dict[str, IndicatorCriteria]:
    """Criteria of every candidate; see `evaluate_indicator`."""
    return {
        name: evaluate_indicator(values, time_s, healthy_rows=healthy_rows, window=window)
        for name, values in indicators.values.items()
    }


def chosen(found: Sequence[Mapping[str, IndicatorCriteria]]) -> str:
    """Name of the candidate with the highest mean suitability over runs; the first among equals.

    Parameters
    ----------
    found : sequence of mappings
        Criteria by candidate, one mapping per run. Only candidates of all runs can be selected.

    Raises
    ------
    TwingapError
        When the runs have no common candidate.
    """
    common = [name for name in (found[0] if found else {}) if all(name in each for each in found)]
    if not common:
        raise TwingapError("no indicator is common to all runs", where="choice of the health indicator")
    return max(common, key=lambda name: float(np.mean([each[name].suitability for each in found])))
