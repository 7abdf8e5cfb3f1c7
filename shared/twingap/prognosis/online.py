"""Online estimation of remaining life, row by row while a run is measured; used by `twingap rul`.

row: time, speed, peak to peak --> S(k), eqs. 9-11 --> alarm? --yes--> growth laws --> remaining revolutions, 90 %
                                        (healthy rows)    |no                                    |
                                                          v                                      v
                                                  prior of other runs, if any             / speed, eq. 14 --> time

The estimate of a row is made with that row, so it cannot depend on later ones. Intervals are those of the posterior,
calibrated on simulated runs (see `calibration`). Where the first rows may not have been healthy (see `healthy_start`)
and the end of life is a ratio to them, the lower end of intervals is 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.prognosis.anomaly import AnomalyRule, detect_anomaly, rank
from twingap.prognosis.calibration import Posterior, calibrated
from twingap.prognosis.columns import Columns
from twingap.prognosis.estimate import Estimate, LifeOptions
from twingap.prognosis.growth import Observations, lives
from twingap.prognosis.healthy_start import rises, shown_healthy
from twingap.prognosis.life_law import QUANTILES
from twingap.prognosis.past_errors import Interval
from twingap.prognosis.prior import Prior, quantiles_of
from twingap.prognosis.revolutions import RevolutionCount
from twingap.prognosis.speed_influence import SAME_SPEED, SpeedInfluence, fit_speed_influence

Array = NDArray[np.float64]

_PER_SPEED: Final = 4
"""Rows from which the healthy amplitude of a speed is estimated; with fewer, wrong speed readings count as speeds."""
_RUN_IN: Final = 0.15
"""Decrease of healthy log amplitude from which it is estimated again; larger ignores more running in."""
_CALM: Final = 40
"""Rows of which nine tenths must be within the healthy limit for an anomaly to be withdrawn; more keep it longer."""
_FADED: Final = 0.2
"""Amplitude relative to that of the first rows below which a sensor is taken as failing; larger takes running in as
that, lower follows a fading sensor longer."""
_BINS: Final = 36
"""Bins of the amplitudes that enter the posterior; more follow amplitude more closely and are slower."""


class OnlineLife:
    """Online estimator of the remaining life of one run, whose rows are given in order of time.

    Parameters
    ----------
    options : LifeOptions, optional
    prior : Prior, optional
        From ended runs. With it, there are estimates before the anomaly.

    Attributes
    ----------
    notes : list of str
        Unusual properties of the run so far, and how they are treated.
    onset_row, alarm_row : int or None
        First row of the anomaly, and row of the alarm, counted from 0.
    faded : int
        Rows that were left out since amplitude is far below that of the first rows.
    """

    def __init__(self, options: LifeOptions | None = None, prior: Prior | None = None) -> None:
        self.options = options or LifeOptions()
        self.prior = prior
        self.notes: list[str] = []
        self.onset_row: int | None = None
        self.alarm_row: int | None = None
        self.end_row: int | None = None
        self._turned = RevolutionCount(self.options.gaps)
        self._turns_at_end = 0.0
        self._influence: SpeedInfluence | None = None
        self._same_speed = SAME_SPEED
        self._limit = float("nan")
        self._healthy: list[tuple[float, float]] = []
        self._learning: dict[int, list[tuple[float, float]]] = {}
        # All rows since the first healthy one, and how many of them are the healthy reference.
        self._seen_rows = Columns("speed_rpm", "peak_to_peak")
        self._reference_rows = 0
        self._shown_healthy = True
        self._reference = (0.0, 0.1, 0.0)  # mean, standard deviation, memory of log amplitude
        self._run: list[int] = []
        self._together = 1
        self._used_rule = self.options.rule
        self._settled_at = 0
        self._beyond = False
        self._log = _no_monitored_rows()
        self._last: tuple[float, Interval, float] | None = None
        self._highest_gain = 0.0
        self._ended_at = 0
        self._gains_beyond: list[float] = []
        self._been_below = False
        self.faded = 0
        self._ran_in = 0.0

    def take(
        self, time_s: float, speed_rpm: float, peak_to_peak: float, *, full_peak_to_peak: float | None = None
    ) -> None:
        """Process the next row without an estimate.

        Parameters
        ----------
        time_s : float
            Time, s, not before that of the last row.
        speed_rpm : float
            Speed; 0 while the machine stands still.
        peak_to_peak : float
            Amplitude; NaN when the record cannot be used.
        full_peak_to_peak : float, optional
            Peak to peak of the complete record, where `peak_to_peak` is that of a part whose length depends on the
            healthy rows. Among these it decides whether the limit is reached, so that this does not depend on later
            rows.
        """
        row, before_s = self._turned.rows, self._turned.time_s
        if not np.isfinite(time_s):
            raise TwingapError(f"time_s = {time_s!r}, a finite number expected", where=f"row {row}")
        if before_s is not None and time_s < before_s:
            raise TwingapError("is before the last row", where=f"time_s = {time_s:g}", mend="sort rows by time")
        self.notes += self._turned.take(time_s, speed_rpm)
        learning = self._influence is None
        if (
            learning
            and speed_rpm > 0
            and self._reaches_limit(row, peak_to_peak if full_peak_to_peak is None else full_peak_to_peak)
        ):
            return
        if not (speed_rpm > 0 and np.isfinite(peak_to_peak) and peak_to_peak > 0):
            return
        self._seen_rows.append(speed_rpm, peak_to_peak)
        if learning:
            if self.end_row is None:
                self._take_healthy(row, speed_rpm, peak_to_peak)
        elif self.alarm_row is None and self.options.limit is not None and peak_to_peak >= self.options.limit:
            self._ended_at_once(row, peak_to_peak)
        elif self.alarm_row is None and not self._known(speed_rpm):
            self._learn_speed(speed_rpm, peak_to_peak)
        else:
            self._monitor(row, speed_rpm, peak_to_peak)

    def _reaches_limit(self, row: int, peak_to_peak: float) -> bool:
        """Whether one of the first rows ends the life: it reaches the limit after earlier rows below it.

        Where all rows so far are at the limit, the machine may be defective or the limit wrong; this is left open.
        """
        limit = self.options.limit
        if limit is None or self.end_row is not None:
            return False
        if peak_to_peak >= limit and self._been_below:
            self._ended_at_once(row, peak_to_peak)
            return True
        self._been_below |= peak_to_peak < limit
        return False

    def _take_healthy(self, row: int, speed_rpm: float, peak_to_peak: float) -> None:
        """Add one of the first rows to the reference."""
        self._healthy.append((speed_rpm, peak_to_peak))
        if len(self._healthy) >= self.options.healthy_rows:
            self._learn(row)

    def estimate(self) -> Estimate:
        """Remaining life after the rows so far."""
        speed = self._turned.speed_rpm
        if self.end_row is not None:
            return Estimate(True, 0.0, 0.0, 0.0, speed)
        if self.alarm_row is None:
            return self._before(speed)
        if self.timeless:
            return replace(self._before(speed), anomaly=True)
        low, middle, high = self.quantiles()
        if not np.isfinite(middle):
            return Estimate(True, speed_rpm=speed)
        if self.open_below:
            return Estimate(True, middle, 0.0, high, speed, closed_lo=low)
        return Estimate(True, middle, low, high, speed)

    def quantiles(self, shares: Sequence[float] = QUANTILES) -> tuple[float, ...]:
        """Quantiles of remaining revolutions after the rows so far; NaN where there is no estimate."""
        if self.end_row is not None:
            return (0.0,) * len(shares)
        if self.alarm_row is None or self.timeless:
            return (float("nan"),) * len(shares) if self.prior is None else self.prior.before(self.revolutions, shares)
        if len(self._log) and (self._last is None or self._last[0] != self._log["turns"][-1]):
            found = self.posterior()
            assert found is not None
            self._last = (float(self._log["turns"][-1]), calibrated(found), found.per_row)
        if self._last is None:
            return (float("nan"),) * len(shares)
        at, growth, per_row = self._last
        if self.prior is None:
            values = growth if shares is QUANTILES else quantiles_of(growth, per_row / 2, shares)
        else:
            values = self.prior.joined(growth, at, at - self.revolutions_at_onset, per_row, shares)
        since = self.revolutions - at
        return tuple(max(v - since, 0.0) for v in values)

    def update(
        self, time_s: float, speed_rpm: float, peak_to_peak: float, *, full_peak_to_peak: float | None = None
    ) -> Estimate:
        """`take` and then `estimate`."""
        self.take(time_s, speed_rpm, peak_to_peak, full_peak_to_peak=full_peak_to_peak)
        return self.estimate()

    def reaches_end(self, speed_rpm: float, peak_to_peak: float) -> bool:
        """Whether a row of this amplitude would end the life."""
        if self.options.limit is not None:
            return peak_to_peak >= self.options.limit
        if self._influence is None or not (speed_rpm > 0 and peak_to_peak > 0):
            return False
        return float(np.log(peak_to_peak / self._influence.amplitude(speed_rpm))) - self._reference[0] >= self._end()

    @property
    def revolutions(self) -> float:
        """Revolutions since the first row."""
        return self._turned.revolutions

    @property
    def monitored(self) -> bool:
        """Whether rows after the healthy ones have been processed."""
        return len(self._log) > 0

    @property
    def above(self) -> int:
        """Number of consecutive rows above the limit of the anomaly, up to the last one."""
        return len(self._run)

    @property
    def together(self) -> int:
        """Number of consecutive rows that give an alarm."""
        return self._together

    @property
    def open_below(self) -> bool:
        """Whether the lower end of intervals is 0, as the end of life is relative to possibly damaged rows."""
        return self.alarm_row is not None and self.options.limit is None and not self._shown_healthy

    @property
    def timeless(self) -> bool:
        """Whether there were no revolutions since the onset of the anomaly, so that growth has no rate."""
        if self.alarm_row is None or self.end_row is not None or not self.monitored:
            return False
        return not self._log["turns"][-1] > self.revolutions_at_onset

    @property
    def amplitudes(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Index, revolutions since the first row, and log normalised amplitude of the monitored rows [rows each]."""
        return self._log["row"].astype(np.int64), self._log["turns"].copy(), self._log["log"].copy()

    @property
    def end_level(self) -> float:
        """Log normalised amplitude at which life ends, as estimated at this row."""
        return self._end()

    @property
    def scatter(self) -> float:
        """Standard deviation of healthy log amplitude."""
        return self._reference[1]

    @property
    def level(self) -> float:
        """Median log normalised amplitude of the last five monitored rows; NaN without any."""
        return float(np.median(self._log["log"][-5:])) if self.monitored else float("nan")

    @property
    def revolutions_at_onset(self) -> float:
        """Revolutions from the first row to the onset of the anomaly; NaN without one."""
        if self.onset_row is None:
            return float("nan")
        place = int(np.searchsorted(self._log["row"], self.onset_row))
        if place == len(self._log):
            return self._turns_at_end or self.revolutions
        return float(self._log["turns"][place])

    def _learn(self, row: int) -> None:
        """Estimate S(k), the limit of the anomaly and the scatter from the healthy rows."""
        speed, p = (np.array(v) for v in zip(*self._healthy, strict=True))
        for same_speed in (SAME_SPEED, 0.06, 0.12, 0.25, 0.5, 1.0, 1e9):
            influence = fit_speed_influence(p, speed, same_speed=same_speed)
            if influence.speeds_rpm.size == 1 or np.median(influence.counts) >= _PER_SPEED:
                break
        normalised = p / influence.amplitude(speed)
        if (start := rises(normalised)) is not None:
            self._without_healthy_start(row, start)
            return
        speeds = int(influence.speeds_rpm.size)
        rule = self.options.rule
        # With few healthy rows, longer sequences keep the false-alarm probability.
        for more in range(rule.consecutive, min(rule.horizon_rows, 60)):
            used = AnomalyRule(rule.false_alarm, rule.horizon_rows, more, rule.law)
            if rule.law == "normal" or rank(normalised.size, used) > 0:
                break
        try:
            found = detect_anomaly(normalised, normalised.size, used, speeds=speeds)
        except TwingapError as error:
            if len(self._healthy) > 20 * self.options.healthy_rows or "equal" in error.what:
                raise
            return  # more rows are needed; tried again with the next one
        if len(self._healthy) > self.options.healthy_rows:
            self.notes.append(f"{len(self._healthy)} healthy rows were needed for {speeds} speeds")
        if used.consecutive > rule.consecutive:
            self.notes.append(
                f"{normalised.size} healthy rows keep the stated rate of false alarms with {used.consecutive} "
                f"consecutive rows instead of {rule.consecutive}"
            )
        self._together, self._used_rule = used.consecutive, used
        self._influence, self._same_speed, self._limit = influence, max(same_speed, SAME_SPEED), found.limit
        self._reference_rows = len(self._healthy)
        self._set_reference(normalised)
        self._check_limit()

    def _without_healthy_start(self, row: int, first: int) -> None:
        """Use the first of the healthy rows as reference, since amplitude rises within them."""
        head = self._healthy[:first]
        speed, p = (np.array(v) for v in zip(*head, strict=True))
        self._influence = fit_speed_influence(p, speed, same_speed=0.25)
        self._same_speed = 1e9
        self._set_reference(p / self._influence.amplitude(speed))
        self._check_limit()
        self._reference_rows, self._shown_healthy = first, False
        self.notes.append(
            f"no healthy start: amplitude rises within the first {len(self._healthy)} rows, so the anomaly begins at "
            f"the first row and amplitude is relative to the first {first} (if the machine was warming up, leave those "
            "rows out of the run)" + self._late_end()
        )
        self.onset_row, self.alarm_row = 0, row
        # Revolutions of the first rows are not stored; they are assumed evenly spaced.
        turns = np.linspace(0, self.revolutions, len(self._healthy))
        for place, (u, (s, a)) in enumerate(zip(turns, self._healthy, strict=True)):
            relative = float(np.log(a / self._influence.amplitude(s))) - self._reference[0]
            self._log.append(place, float(u), relative)
            self._highest_gain = max(self._highest_gain, float(self._influence.amplitude(s)))

    def _check_start(self) -> None:
        """Test at an alarm whether the first rows were healthy; not needed for an end in absolute amplitude."""
        if self.options.limit is not None:
            return
        assert self._influence is not None
        speed, p = self._seen_rows["speed_rpm"], self._seen_rows["peak_to_peak"]
        logs = np.log(p / self._influence.amplitude(speed)) - self._reference[0]
        _, scatter, memory = self._reference
        self._shown_healthy = shown_healthy(
            logs, speed, self._reference_rows, len(self._seen_rows) - self._together, scatter=scatter, memory=memory
        )
        if not self._shown_healthy:
            self.notes.append(
                f"the start may not have been healthy: growth from the first row explains amplitude up to row "
                f"{self.alarm_row} about as well as growth after the {self._reference_rows} rows assumed healthy"
                + self._late_end()
            )

    def _late_end(self) -> str:
        """Text on the effect of damage in the first rows on the end of life; "" with an absolute limit."""
        if self.options.limit is not None:
            return ""
        return (
            "; relative to damaged rows the end of life by ratio is predicted too late, so the lower end of "
            "remaining life is set to 0 (--limit does not depend on these rows)"
        )

    def _set_reference(self, normalised: Array) -> None:
        x = np.log(normalised)
        x = x - np.median(x)
        std = float(1.4826 * np.median(np.abs(x)))
        std = max(std, 0.5 * float(x.std()), 1e-3)
        core = np.clip(x, -3 * std, 3 * std)
        memory = float(np.mean(core[1:] * core[:-1]) / max(np.mean(core**2), 1e-12))
        self._reference = (float(np.median(np.log(normalised))), std, float(np.clip(memory, 0.0, 0.9)))

    def _check_limit(self) -> None:
        assert self._influence is not None
        amplitudes = self._influence.amplitude(self._influence.speeds_rpm)
        healthy, speed = float(amplitudes.max()), float(self._influence.speeds_rpm[amplitudes.argmax()])
        if self.options.limit is not None and healthy >= self.options.limit:
            raise TwingapError(
                f"healthy rows at {speed:.4g} rpm already have {healthy:.4g} peak to peak",
                where=f"limit {self.options.limit:g}", mend="raise the limit, in the unit of the records",
            )  # fmt: skip
        self._highest_gain = healthy

    def _ended_at_once(self, row: int, peak_to_peak: float) -> None:
        """End of life at a row that reaches the absolute limit, without an anomaly before."""
        self.onset_row = self.alarm_row = self.end_row = row
        self._turns_at_end = self.revolutions
        self.notes.append(
            f"{peak_to_peak:.4g} peak to peak in row {row} reach the limit before any anomaly; if a healthy machine "
            "vibrates as much at this speed, raise the limit"
        )

    def _known(self, speed_rpm: float) -> bool:
        assert self._influence is not None
        near = np.abs(self._influence.speeds_rpm / speed_rpm - 1) <= self._same_speed
        return bool(near.any())

    def _learn_speed(self, speed_rpm: float, peak_to_peak: float) -> None:
        """Estimate S at a speed that the healthy rows do not contain, from its own first rows before any anomaly."""
        assert self._influence is not None
        place = round(np.log(speed_rpm) / np.log1p(self._same_speed))
        rows = self._learning.setdefault(place, [])
        rows.append((speed_rpm, peak_to_peak))
        if len(rows) < _PER_SPEED:
            return
        new = fit_speed_influence([p for _, p in rows], [s for s, _ in rows], same_speed=1e9)
        old = self._influence
        order = np.argsort(np.concatenate((old.speeds_rpm, new.speeds_rpm)), kind="stable")
        self._influence = SpeedInfluence(
            np.concatenate((old.speeds_rpm, new.speeds_rpm))[order],
            np.concatenate((old.c, new.c))[order],
            np.concatenate((old.counts, new.counts))[order],
        )
        del self._learning[place]
        self._highest_gain = max(self._highest_gain, float(self._influence.amplitude(self._influence.speeds_rpm).max()))
        self.notes.append(
            f"{new.speeds_rpm[0]:.0f} rpm was not among the healthy rows: its healthy amplitude is estimated from its "
            f"first {len(rows)} rows, which are not monitored"
        )

    def _monitor(self, row: int, speed_rpm: float, peak_to_peak: float) -> None:
        """Update anomaly and end of life by a row of the running machine after the healthy ones."""
        assert self._influence is not None
        gain = float(self._influence.amplitude(speed_rpm))
        normalised = peak_to_peak / gain
        low = np.log(normalised) - self._reference[0] + self._ran_in < np.log(_FADED)
        if low and self._influence.covers(speed_rpm):  # beyond, healthy amplitude is extrapolated
            self.faded += 1
            return
        self._log.append(row, self.revolutions, float(np.log(normalised)) - self._reference[0])
        if self.alarm_row is None and self._settled():
            return
        self._raise_highest_gain(speed_rpm, gain)
        if self.alarm_row is None:
            self._run = [*self._run, row] if normalised > self._limit else []
            if len(self._run) >= self._together:
                self.onset_row, self.alarm_row = self._run[0], row
                self._check_start()
        elif self.end_row is None and self._calm(row):
            self.notes.append(
                f"the anomaly of row {self.onset_row} is withdrawn at row {row}: amplitude is healthy again"
            )
            self.onset_row = self.alarm_row = self._last = None
            self._run = []
        if self.alarm_row is not None and not self._beyond and not self._influence.covers(speed_rpm):
            self._beyond = True
            self.notes.append(
                f"{speed_rpm:.0f} rpm is outside the healthy speeds: its healthy amplitude is extrapolated"
            )
        if self.alarm_row is not None and self.end_row is None:
            ended = (
                peak_to_peak >= self.options.limit
                if self.options.limit is not None
                else self._log["log"][-1] >= self._end()
            )
            if ended:
                self.end_row, self._ended_at = row, len(self._log)
        elif self.end_row is not None and self.options.limit is None:
            self._withdraw_end(row)

    def _withdraw_end(self, row: int) -> None:
        """Withdraw an end by ratio when the next rows are below it, since a single row may be an impulse.

        As many rows as give an alarm are needed. An end by an absolute limit is not withdrawn.
        """
        since = self._log["log"][self._ended_at :]
        if since.size < self._together or (since[-self._together :] >= self._end()).any():
            return
        self.notes.append(
            f"the end of row {self.end_row} is withdrawn at row {row}: the last {self._together} rows are below it"
        )
        self.end_row = self._last = None

    def _raise_highest_gain(self, speed_rpm: float, gain: float) -> None:
        """Update the largest healthy amplitude; speeds outside the healthy ones count after several rows."""
        assert self._influence is not None
        if not self._influence.covers(speed_rpm):
            self._gains_beyond = [*self._gains_beyond[1 - _PER_SPEED :], gain]
            if len(self._gains_beyond) < _PER_SPEED:
                return
            gain = min(self._gains_beyond)
        self._highest_gain = max(self._highest_gain, gain)

    def _settled(self) -> bool:
        """Whether healthy amplitude has fallen (running in); it is then estimated again."""
        assert self._influence is not None
        count = self.options.healthy_rows
        if len(self._log) - self._settled_at < count:
            return False
        self._settled_at = len(self._log)
        last = self._log["log"][-count:]
        fallen = float(np.median(last))
        if fallen > -_RUN_IN:
            return False
        old = self._influence
        normalised = np.exp(last - fallen)
        try:
            found = detect_anomaly(normalised, count, self._used_rule, speeds=int(old.speeds_rpm.size))
        except TwingapError:
            return False
        self._influence = SpeedInfluence(old.speeds_rpm, old.c * np.exp(fallen + self._reference[0]), old.counts)
        self._limit = found.limit
        self._ran_in += fallen
        self._set_reference(normalised)
        self._run, self._log, self._settled_at = [], _no_monitored_rows(), 0
        self._seen_rows.keep_last(count)
        self._reference_rows = count
        self._check_limit()
        self.notes.append(
            f"amplitude has fallen to {np.exp(fallen):.2f} of that of the first rows by row {self._turned.rows - 1} "
            f"(running in): the last {count} rows are the healthy reference from there on"
        )
        return True

    def _calm(self, row: int) -> bool:
        """Whether amplitude has returned to its healthy scatter."""
        assert self.alarm_row is not None
        last = self._log["log"][-_CALM:]
        if last.size < _CALM or row - self.alarm_row < _CALM or not np.isfinite(self._limit):
            return False
        return float(np.mean(last > np.log(self._limit) - self._reference[0])) <= 0.1

    def _end(self) -> float:
        """Log normalised amplitude at the end of life."""
        if self.options.limit is not None and not self._highest_gain > 0:
            return float("nan")
        if self.options.limit is not None:
            # The limit is reached first at the speed with the largest healthy amplitude.
            return float(np.log(self.options.limit / self._highest_gain)) - self._reference[0]
        return float(np.log(self.options.limit_ratio)) - self._reference[0]

    def _before(self, speed: float) -> Estimate:
        """Estimate without growth: from the lives of other runs, given the life so far."""
        if self.prior is None:
            return Estimate(False, speed_rpm=speed)
        low, middle, high = self.prior.before(self.revolutions)
        return Estimate(False, middle, low, high, speed)

    def posterior(self) -> Posterior | None:
        """Posterior of growth laws at the last monitored row, before calibration; None before the anomaly."""
        if self.alarm_row is None or not self.monitored:
            return None
        observed, rows = self._observations()
        end = self._end()
        found = lives(observed, end)
        low, middle, high = (found.quantile(q) for q in (0.05, 0.5, 0.95))
        return Posterior(low, middle, high, observed.per_row, rows, found.level / max(end, 1e-9), observed.since_onset)

    def _observations(self) -> tuple[Observations, int]:
        """Observations since the onset and from as many rows before it, and the number of rows since the onset."""
        assert self.onset_row is not None
        rows, turns, logs = (self._log[name] for name in ("row", "turns", "log"))
        now = float(turns[-1])
        first = int(np.searchsorted(rows, self.onset_row))
        since_rows = rows.size - first
        begin = max(first - since_rows, 0)
        u, x = turns[begin:], logs[begin:]
        after = np.arange(begin, rows.size) >= first
        since = max(now - float(turns[first]), 1e-9)
        per_row = since / max(since_rows - 1, 1)
        _, std, memory = self._reference
        recent = np.diff(x[-60:])
        if recent.size >= 10:
            std = max(std, float(1.4826 * np.median(np.abs(recent)) / np.sqrt(2)))
        independent = (1 - memory) / (1 + memory)
        # The last rows are bins of one row; the others are in equal bins with the onset as an edge.
        edges = {0, x.size, max(x.size - 5, 0), first - begin}
        edges |= {int(v) for v in np.linspace(0, max(x.size - 5, 0), _BINS)}
        cuts = np.array(sorted(edges))
        size = np.diff(cuts)
        middle = np.array([np.median(x[a:b]) for a, b in pairwise(cuts)])
        place = np.add.reduceat(u, cuts[:-1]) / size
        variance = std**2 * np.minimum(np.pi / 2, 1 + 0.57 * (size > 1)) / np.maximum(size * independent, 1.0)
        began = np.logical_and.reduceat(after, cuts[:-1])
        return Observations(now - place, middle, variance, began, since, std, max(per_row, 1e-9)), since_rows


def _no_monitored_rows() -> Columns:
    """Empty table of monitored rows: index, revolutions since the first row, log normalised amplitude."""
    return Columns("row", "turns", "log")
