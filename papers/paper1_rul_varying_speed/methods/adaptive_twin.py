"""Twin of one bearing, fitted to its run up to now, that simulates how the run may go on.

healthy rows ----> eq. 8: mode            ----------------------------+
             \\--> eqs. 9, 10: S(speed) --> eq. 11 --> K_anomaly ------+--> AdaptiveTwin: lives with speeds, S, D and
rows K_anomaly .. now --> eq. 12: rate a, give or take ---------------+    remaining revolutions (eq. 14)

No row after `now_row` is used: `adapt` is handed none. Source: section 3 of paper 1 (Simulation-based remaining
useful life prediction of rolling element bearings under varying operating conditions).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from papers.arrays import Array, spread
from papers.paper1_rul_varying_speed.methods.degradation import DamageFit, Trajectory, fit_damage, trajectories
from papers.paper1_rul_varying_speed.methods.run import Run, period_rows, planned_speed
from twingap import RecordSet, TwingapError
from twingap.identification import HealthyFit, equation_8, spectra
from twingap.prognosis.anomaly import Anomaly, AnomalyRule, detect_anomaly
from twingap.prognosis.speed_influence import SpeedInfluence, fit_speed_influence, normalised_peak_to_peak


class NoLifeError(TwingapError):
    """No simulated life ends within the run's: nothing can be predicted of it, though all of it can be read."""


@dataclass(frozen=True)
class Adaptation:
    """How a run is read."""

    # length of the healthy beginning [t0, t1], min; a whole number of periods of the speed profile serves best
    reference_min: float = 40.0
    # measurements after the alarm that are waited for before damage is fitted: 10 in the paper
    after_alarm_min: float = 10.0
    limit: float = 15.0  # peak to peak at which a life ends, unit of the records: 15 g in the paper
    # "one", "free": of the damage curve at K_anomaly, see `fit_damage`; "one" as printed.
    level: Literal["one", "free"] = "one"
    lives: int = 6  # simulated for training: 6 in the paper
    held_out_lives: int = 2  # simulated at rates between those, to choose a checkpoint by
    simulation_range_min: float = 40.0  # greatest difference between two simulated ends: 40 in the paper
    horizon_min: float = 240.0  # longest life after K_anomaly that is thought possible
    mode_records: int = 44  # healthy records from which the mode is read, evenly spread over the beginning
    lowest_mode_hz: float = 0.0  # the mode is sought above it, Hz
    rule: AnomalyRule = field(default_factory=AnomalyRule)


@dataclass(frozen=True)
class AdaptiveTwin:
    """One bearing's twin at one moment."""

    mode: HealthyFit  # Resonance and damping, eq. 8, and the two noises of healthy records.
    influence: SpeedInfluence  # S, eqs. 9 and 10.
    anomaly: Anomaly  # with its limit; found
    damage: DamageFit  # D, eq. 12.
    lives: tuple[Trajectory, ...]  # for training, shortest first
    held_out: tuple[Trajectory, ...]  # between them, for the choice of a checkpoint
    period_rows: int  # of the speed profile: what was taken to come after now repeats it
    now_row: int  # last row that was used

    @property
    def onset_row(self) -> int:
        assert self.anomaly.onset_row is not None
        return self.anomaly.onset_row


def find_anomaly(run: Run, options: Adaptation) -> tuple[SpeedInfluence, Array, Anomaly]:
    """S from the healthy beginning, normalised peak to peak [rows], and the first anomaly if there is one."""
    healthy = run.rows_in(options.reference_min)
    influence = fit_speed_influence(run.peak_to_peak[:healthy], run.speed_rpm[:healthy])
    normalised = normalised_peak_to_peak(run.peak_to_peak, run.speed_rpm, influence)
    return influence, normalised, detect_anomaly(normalised, healthy, options.rule, speeds=influence.speeds_rpm.size)


def read_mode(records: RecordSet, run: Run, options: Adaptation) -> HealthyFit:
    """Eq. 8 from healthy records of a run."""
    healthy = run.rows_in(options.reference_min)
    places = spread(healthy, options.mode_records).tolist()
    return equation_8(spectra(records.take(places)), lowest_hz=options.lowest_mode_hz)


def adapt(run: Run, mode: HealthyFit, options: Adaptation | None = None) -> AdaptiveTwin:
    """Read a run up to its last row, which is now (`Run.until`), with a mode from `read_mode`. Raises `TwingapError`
    without an anomaly, growth, or a life that could follow; the message says which."""
    options = options or Adaptation()
    influence, normalised, anomaly = find_anomaly(run, options)
    if anomaly.onset_row is None:
        raise TwingapError("no anomaly up to now", where="run", mend="wait for more measurements")
    now, onset = run.time_s.size - 1, anomaly.onset_row
    damage = fit_damage(np.arange(now + 1), normalised, onset, level=options.level)
    lives, held_out, period = lives_that_may_follow(run, influence, damage, options)
    return AdaptiveTwin(mode, influence, anomaly, damage, lives, held_out, period, now)


def lives_that_may_follow(
    run: Run, influence: SpeedInfluence, damage: DamageFit, options: Adaptation
) -> tuple[tuple[Trajectory, ...], tuple[Trajectory, ...], int]:
    """Lives about the end that a rate of growth foretells, none of which ends before now, the run's last row: for
    training (shortest first), held out between those, and the period (rows) by which the speed profile goes on. Raises
    `TwingapError` when no life could follow."""
    now, onset = run.time_s.size - 1, round(damage.onset)
    # The period is read where the machine still ran as usual; at least as many rows as it needs are there.
    period = period_rows(run.speed_rpm[: onset + 1])
    wanted = onset + 1 + int(60 * options.horizon_min / run.dt_s)
    profile = planned_speed(run.speed_rpm, max(wanted, now + 1), min(period, now + 1))[onset:]
    total = options.lives + options.held_out_lives
    lives = trajectories(
        damage, influence, profile, run.dt_s, options.limit, count=total,
        simulation_range_s=60 * options.simulation_range_min, not_before_row=now,
    )  # fmt: skip
    # Held-out lives lie evenly between the others: never the shortest nor the longest.
    held = {round((i + 1) * total / (options.held_out_lives + 1) - 0.5) for i in range(options.held_out_lives)}
    kept, held_out = (tuple(x for i, x in enumerate(lives) if (i in held) == wanted) for wanted in (False, True))
    return kept, held_out, period


def adapt_when_possible(
    run: Run, mode: HealthyFit, options: Adaptation, note: Callable[[str], None] = lambda why: None
) -> AdaptiveTwin:
    """Adapt `after_alarm_min` after the alarm, or a minute later and so on, until growth is seen and lives may follow;
    rows after `now_row` are not used, `note` gets the reason of each failed attempt. Raises `TwingapError` when there
    is no anomaly, `NoLifeError` when the run is over first."""
    _, _, anomaly = find_anomaly(run, options)
    if anomaly.alarm_row is None:
        raise TwingapError("no anomaly in the whole run", where="run", mend="check the reference and the rule")
    step = max(1, round(60 / run.dt_s))
    now = anomaly.alarm_row + int(np.ceil(60 * options.after_alarm_min / run.dt_s))
    why = f"the run ends within {options.after_alarm_min:g} min of the alarm"
    while now < run.time_s.size:
        try:
            return adapt(run.until(now), mode, options)
        except TwingapError as error:
            why = str(error)
            note(f"row {now}: {why}")
        now += step
    raise NoLifeError(f"no life could be simulated before the run's end: {why}", where="run")
