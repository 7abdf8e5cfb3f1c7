"""True shaft speeds of a record set, and the slip of its cage, from speed readings of single records.

record --speed_reading--> log ratios to nominal: of the shaft itself, of the fault's comb
all records: log ratio (shaft) = c_j, log ratio (comb) = c_j + k(fault) slip + spin --Gaussian, closed--> c_j, slip

A wrong speed scales all orders alike; a slipping cage scales BPFO by 1 - s and shifts BPFI the other way, see
`Bearing.slipped`. A single record therefore separates speed from slip only where it contains the shaft rate itself. A
set does where its speeds have a common error (of the tachometer) and it contains faults of both races. The impact order
of rollers follows BPFI as long as they roll on the inner ring; otherwise it has its own shift (spin), independent
of slip.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.errors import TwingapError
from twingap.identification.speed_reading import (
    BARRED,
    NOT_DETECTED,
    SHAFT_LINES,
    Reading,
    comb_of,
    read_speed,
)
from twingap.records import Condition, RecordSet

Array = NDArray[np.float64]

COMBINED: Final = "common factor from inner and outer"
COMB_ONLY: Final = "fault comb"
"""Values of `SpeedEstimate.found_by`."""

_COMMON_SD, _SLIP_SD, _SPIN_SD = 0.03, 0.02, 0.02  # prior standard deviations: wider admit larger errors
_SCATTERS = (1e-5, 3e-4, 1e-3, 4e-3, 0.015)  # candidate standard deviations of records' own speed errors
_OUTLIER = math.log(0.02 / 0.16)  # log density of a wrong reading: 2 % of readings, anywhere within the search
_MOST_SLIP = 0.065  # slip from which combs alone are asked, too: larger takes lines of other shafts for this one's
_FAR = 0.01  # log ratio from which a comb is compared with healthy records: smaller takes longer
_OFTEN = 0.2  # part of the healthy records that show another bearing's comb: larger misses faint ones
_MANY, _FEW = 4, 0.2  # at least so many records, of which at most this part shows a speed: more combs are doubted
_LONE, _AGREE = 0.025, 0.01  # log ratio from which a comb needs another record, and how near: nearer, fewer combs count
_MARGIN = 3.0  # log evidence required for slip over wrong speeds: larger attributes weak slip to wrong speeds


@dataclass(frozen=True)
class SpeedEstimate:
    """Estimated speed of one record.

    Parameters
    ----------
    ratio : float
        True over nominal speed; 1 where it was not detected.
    sigma : float
        Standard error of `ratio`; infinite where unknown.
    found_by : str
        "shaft lines", "sidebands", "common factor from inner and outer", "fault comb" (given the set's slip),
        "common factor" (of the other records) or "not detected".
    """

    ratio: float
    sigma: float
    found_by: str


@dataclass(frozen=True)
class Speeds:
    """Speeds of a record set.

    Parameters
    ----------
    estimates : tuple[SpeedEstimate, ...]
        One per record.
    common_ratio : float
        Common factor of true over nominal speeds; 1 when none is established.
    common_sigma : float
        Its standard error.
    slip : float
        Fraction by which the cage lags its kinematic speed; 0 when none is established.
    slip_sigma : float
        Its standard error; infinite where the records cannot show slip.
    slip_free : float
        Estimate of slip in the model with slip and a common factor, whether or not slip is established.
    slip_evidence : float
        Log evidence of the best model with slip over the best one without.
    scatter : float
        Standard deviation of the records' own deviations from `common_ratio`.
    decidable : bool
        Whether the records separate slip from a wrong speed.
    notes : tuple[str, ...]
        For the report.
    """

    estimates: tuple[SpeedEstimate, ...]
    common_ratio: float
    common_sigma: float
    slip: float
    slip_sigma: float
    slip_free: float
    slip_evidence: float
    scatter: float
    decidable: bool
    notes: tuple[str, ...]

    def corrected(self, records: RecordSet) -> RecordSet:
        """The records with these speeds in their conditions; samples are unchanged."""
        if len(records) != len(self.estimates):
            raise ValueError(f"{len(self.estimates)} speeds for {len(records)} records")
        conditions = [
            replace(c, speed_rpm=c.speed_rpm * e.ratio) for c, e in zip(records.conditions, self.estimates, strict=True)
        ]
        return RecordSet(records.name, records.unit, records.bearing, conditions, Samples(records))


@dataclass(frozen=True)
class Samples:
    """Loader of the samples of record i."""

    records: RecordSet

    def __call__(self, index: int) -> Array:
        return self.records[index].samples


def estimate_speeds(records: RecordSet, bearing: Bearing | None = None) -> Speeds:
    """True speeds of records, where the records determine them.

    Parameters
    ----------
    records : RecordSet
        One record's samples in memory at a time.
    bearing : Bearing, optional
        Bearing under test; None = the set's own.

    Returns
    -------
    Speeds

    Raises
    ------
    TwingapError
        When the bearing is unknown.
    """
    own = bearing or records.bearing
    if own is None:
        raise TwingapError(
            "the bearing is not known", where=f"record set {records.name!r}", mend="add [bearing] to the twin file"
        )
    readings = [read_speed(record.samples, record.condition, own) for record in records]
    for fault, barred in _other_bearings(readings, records, own).items():
        for place, condition in enumerate(records.conditions):
            comb = readings[place].comb if math.isfinite(readings[place].comb_sigma) else math.inf
            if condition.fault == fault and abs(comb - barred) < BARRED:
                readings[place] = _away_from(barred, read_speed(records[place].samples, condition, own, barred))
    return combine(_supported(readings), records.conditions, own)


def _other_bearings(readings: Sequence[Reading], records: RecordSet, bearing: Bearing) -> dict[str, float]:
    """Fault -> log ratio of combs that healthy records have too: those of another bearing.

    Only combs far from the fault's nominal rate are compared: nearer ones hardly change a speed.
    """
    healthy = [place for place, c in enumerate(records.conditions) if c.fault == "healthy"]
    own: dict[str, list[float]] = {}
    for reading, condition in zip(readings, records.conditions, strict=True):
        if math.isfinite(reading.comb_sigma) and abs(reading.comb) > _FAR:
            own.setdefault(str(condition.fault), []).append(reading.comb)
    if not healthy or not own:
        return {}
    found = np.array([
        [comb_of(record.samples, record.condition, bearing, fault) for fault in own]
        for record in (records[place] for place in healthy)
    ])  # fmt: skip
    out: dict[str, float] = {}
    for (fault, combs), theirs in zip(own.items(), found.T, strict=True):
        shared = max((np.abs(theirs - comb) < 0.5 * BARRED for comb in combs), key=np.sum)
        if shared.sum() >= max(2, _OFTEN * len(healthy)) and abs(np.median(theirs[shared])) > _FAR + BARRED:
            out[fault] = float(np.median(theirs[shared]))
    # Faint lines of this bearing's own races lie where its speed puts them: together, or where shaft lines put it.
    shaft = [r.shaft for r in readings if r.found_by == SHAFT_LINES]
    known = float(np.median(shaft)) if shaft else math.nan
    together = len(out) > 1 and max(out.values()) - min(out.values()) < BARRED
    return {} if together else {f: barred for f, barred in out.items() if not abs(barred - known) < BARRED}


def _away_from(barred: float, reading: Reading) -> Reading:
    """The reading without a comb that the fit of its lines has led back to another bearing's."""
    back = math.isfinite(reading.comb_sigma) and abs(reading.comb - barred) < BARRED
    return replace(reading, comb=0.0, comb_sigma=math.inf, height=0.0) if back else reading


def _supported(readings: Sequence[Reading]) -> list[Reading]:
    """The readings, without far combs that no other record confirms where few of many records show a speed at all."""
    seen = [r for r in readings if math.isfinite(min(r.shaft_sigma, r.comb_sigma))]
    if len(readings) < _MANY or len(seen) > _FEW * len(readings):
        return list(readings)

    def alone(reading: Reading) -> bool:
        others = [r.shaft if math.isfinite(r.shaft_sigma) else r.comb for r in seen if r is not reading]
        far = math.isfinite(reading.comb_sigma) and abs(reading.comb) > _LONE and not math.isfinite(reading.shaft_sigma)
        return far and all(abs(other - reading.comb) > _AGREE for other in others)

    return [replace(r, comb=0.0, comb_sigma=math.inf, height=0.0) if alone(r) else r for r in readings]


@dataclass(frozen=True)
class _Model:
    """Model of all readings: with or without a common factor, own deviations, slip (and spin)."""

    evidence: float
    scatter: float
    common: float
    slip: float
    spin: float
    covariance: Array  # of common, slip and spin
    kept: NDArray[np.bool_]  # readings [records, 2] that count as correct under it


def combine(readings: Sequence[Reading], conditions: Sequence[Condition], bearing: Bearing) -> Speeds:
    """Speeds of a set from readings of its records.

    Log ratios of the shaft are a common factor plus an own deviation of the record; those of the comb are also shifted
    by slip. All are Gaussian, so the evidence of each model has a closed form. Of models with about equal evidence, one
    without slip is chosen.

    Parameters
    ----------
    readings : sequence of Reading
    conditions : sequence of Condition
    bearing : Bearing

    Returns
    -------
    Speeds
    """
    y = np.array([(r.shaft, r.comb) for r in readings])
    sigma = np.array([(r.shaft_sigma, r.comb_sigma) for r in readings])
    moves = np.array([(_slip_factor(bearing, c.fault), float(c.fault == "ball")) for c in conditions])
    seen = np.isfinite(sigma)
    sigma = np.where(seen, np.hypot(sigma, 3e-5), 1.0)
    kinds = ((False, False), (True, False)) + (((True, True),) if _rollers_apart(seen, conditions) else ())
    models = [
        _model(y, sigma, seen, moves, scatter, common, slip, spin)
        for scatter, common, (slip, spin) in product(_SCATTERS, (False, True), kinds)
    ]
    without = max((a for a in models if a.covariance[1, 1] == 0), key=lambda a: a.evidence)
    with_slip = max((a for a in models if a.covariance[1, 1] > 0), key=lambda a: a.evidence)
    if with_slip.evidence > without.evidence + _MARGIN and abs(with_slip.slip) > _MOST_SLIP and seen[:, 0].any():
        combs_alone = [replace(r, shaft=0.0, shaft_sigma=math.inf, found_by=NOT_DETECTED) for r in readings]
        found = combine(combs_alone, conditions, bearing)
        if abs(math.log(found.common_ratio)) < abs(with_slip.common):
            note = (
                f"lines that look like the shaft's would mean a slip of the cage of {100 * with_slip.slip:.0f} %, and "
                "speeds farther from those given than the fault combs show: they were taken for lines of another shaft"
            )
            return replace(found, notes=(note, *found.notes))
    best = with_slip if with_slip.evidence > without.evidence + _MARGIN else without
    notes: list[str] = []
    estimates, mean_sigma = _estimates(best, y, sigma, moves, readings)
    slip_free, slip_sigma = _free_slip(y, sigma, seen, moves, best)
    combs = int(seen[:, 1].sum())
    off = abs(best.common) > 1e-3 or best.scatter > 5e-4
    doubtful = combs > 0 and slip_sigma > 0.004
    if doubtful and best is without:
        if off:
            notes.append(
                "fault combs lie off their kinematic places, and nothing in the records tells slip of the cage from "
                "wrong speeds: speeds were taken to be wrong, and no slip"
            )
        else:
            notes.append(
                "nothing in the records but the fault combs shows the shaft: slip of the cage would look as a wrong "
                "speed does"
            )
    if best.common != 0 and abs(best.common) > 2 * mean_sigma:
        notes.append(
            f"all speeds were multiplied by {math.exp(best.common):.5f}, as lines tied to the shaft or to faults show"
        )
    if best.scatter > 5e-4:
        notes.append(f"speeds deviate from record to record by about {100 * best.scatter:.1g} %")
    if best.slip != 0:
        how = "lags" if best.slip > 0 else "runs ahead of"
        notes.append(f"the cage {how} its kinematic speed by {100 * abs(best.slip):.2f} %, at all shaft speeds")
    hidden = sum(e.found_by == NOT_DETECTED for e in estimates)
    if hidden:
        notes.append(
            f"{hidden} of {len(estimates)} records do not show their speed: it was taken as given, but for what is "
            "common to all"
        )
    return Speeds(
        tuple(estimates), math.exp(best.common), mean_sigma, best.slip, slip_sigma if combs else math.inf,
        slip_free, with_slip.evidence - without.evidence,
        0.0 if best.scatter <= 1e-5 else best.scatter, not doubtful, tuple(notes),
    )  # fmt: skip


def _rollers_apart(seen: NDArray[np.bool_], conditions: Sequence[Condition]) -> bool:
    """Whether combs of both races determine the cage, so that those of rollers are not needed for it."""
    return {"inner", "outer", "ball"} <= {str(c.fault) for c, (_, comb) in zip(conditions, seen, strict=True) if comb}


def _slip_factor(bearing: Bearing, fault: str | None) -> float:
    """d log(fault order) / d slip."""
    aside = bearing.ftf / (1 - bearing.ftf)
    return {"outer": -1.0, "cage": -1.0, "inner": aside, "ball": aside}.get(str(fault), 0.0)


def _precision(sigma: Array, seen: NDArray[np.bool_], scatter: float) -> Array:
    """Inverse covariance [records, 2, 2] of readings whose records deviate by `scatter`; zero weight where not seen."""
    w = np.where(seen, sigma**-2, 0.0)
    # Sherman-Morrison: (D + t^2 1 1')^-1 = D^-1 - t^2 D^-1 1 1' D^-1 / (1 + t^2 1' D^-1 1)
    out = -(scatter**2) * w[:, :, None] * w[:, None, :] / (1 + scatter**2 * w.sum(axis=1))[:, None, None]
    out[:, 0, 0] += w[:, 0]
    out[:, 1, 1] += w[:, 1]
    return np.asarray(out)


def _model(
    y: Array, sigma: Array, seen: NDArray[np.bool_], moves: Array, scatter: float, common: bool, slip: bool, spin: bool
) -> _Model:
    """Evidence and estimates of one model; readings that are very unlikely under it count as outliers."""
    design = np.zeros((len(y), 2, 3))  # [records, (shaft, comb), (common, slip, spin)]
    design[:, :, 0], design[:, 1, 1:] = 1.0, moves
    free = np.array([common, slip, spin])
    prior = np.diag(np.where(free, np.array([_COMMON_SD, _SLIP_SD, _SPIN_SD]) ** -2, 1e18))
    kept = seen.copy()
    evidence, mean, covariance = -math.inf, np.zeros(3), np.zeros((3, 3))
    for turn in range(4):
        p = _precision(sigma, kept, scatter)
        information = prior + np.einsum("rik,rij,rjl->kl", design, p, design)
        covariance = np.linalg.inv(information)
        mean = covariance @ np.einsum("rik,rij,rj->k", design, p, y)
        rest = y - design @ mean
        w = np.where(kept, sigma**-2, 0.0)
        logdet = -np.log(w[kept]).sum() + np.log1p(scatter**2 * w.sum(axis=1)).sum()
        logdet += np.linalg.slogdet(information)[1] - np.log(np.diag(prior)).sum()
        fit = float(np.einsum("ri,rij,rj->", rest, p, rest) + mean @ prior @ mean)
        evidence = -0.5 * (fit + logdet + kept.sum() * math.log(2 * math.pi)) + _OUTLIER * (seen & ~kept).sum()
        spread = np.sqrt(sigma**2 + scatter**2)
        density = -0.5 * (rest / spread) ** 2 - np.log(spread * math.sqrt(2 * math.pi))
        right = seen & (density > _OUTLIER)
        # No model may discard more than a fifth of the readings.
        if (right == kept).all() or turn == 3 or right.sum() < 0.8 * seen.sum():
            break
        kept = right
    covariance = np.where(np.outer(free, free), covariance, 0.0)
    evidence -= 1.0 * int(free.sum()) + 1.0 * (scatter > 1e-5)
    found = np.where(free, mean, 0.0)
    return _Model(evidence, scatter, float(found[0]), float(found[1]), float(found[2]), covariance, kept)


def _free_slip(y: Array, sigma: Array, seen: NDArray[np.bool_], moves: Array, best: _Model) -> tuple[float, float]:
    """Slip and its standard error in the model with slip and a common factor."""
    both = _model(y, sigma, seen, moves, best.scatter, True, True, best.spin != 0)
    return both.slip, math.sqrt(both.covariance[1, 1])


def _estimates(
    best: _Model,
    y: Array,
    sigma: Array,
    moves: Array,
    readings: Sequence[Reading],
) -> tuple[list[SpeedEstimate], float]:
    """Speed of each record under the model, and the standard error of the common factor."""
    mean_sigma = math.sqrt(best.covariance[0, 0])
    shares, of_comb = moves[:, 0], moves @ np.array([best.slip, best.spin])
    kinds = {"outer" if m < 0 else "inner" for m, (_, comb) in zip(shares, best.kept, strict=True) if comb and m != 0}
    out = []
    for place, reading in enumerate(readings):
        shaft, comb = best.kept[place]
        weight, total = best.scatter**-2, best.scatter**-2 * best.common
        if shaft:
            weight += sigma[place, 0] ** -2
            total += y[place, 0] * sigma[place, 0] ** -2
        if comb:
            error = math.sqrt(sigma[place, 1] ** 2 + moves[place] @ best.covariance[1:, 1:] @ moves[place])
            weight += error**-2
            total += (y[place, 1] - of_comb[place]) * error**-2
        log_ratio = total / weight
        own = math.hypot(weight**-0.5, mean_sigma * best.scatter**-2 / weight)
        if shaft:
            how = reading.found_by
        elif comb:
            how = COMBINED if len(kinds) > 1 and best.scatter < 5e-4 else COMB_ONLY
        elif best.kept.any() and best.scatter < 5e-4:
            how = "common factor"
        else:
            how, own = NOT_DETECTED, math.inf
            log_ratio = best.common
        if not best.kept.any():
            how, own, log_ratio = NOT_DETECTED, math.inf, 0.0
        out.append(SpeedEstimate(math.exp(log_ratio), own, how))
    return out, mean_sigma
