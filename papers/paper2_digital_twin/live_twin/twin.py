"""Contact twin that is updated live: it follows temperature by law, and is fitted anew when its residuals drift.

messages --> Reorder --> state ------> temperature moved? --> clearance, damping by `laws` ----------> journal (law)
                     --> snapshot --> spectrum against the twin's --> deviation --> DriftDetector
                                                                                       | alarm
                          snapshots since the drift began --> `refit` from where the twin stands --> journal (drift,
                                                              again with each of the next few           following)

The first snapshots commission the twin: they are fitted together and show how much deviations scatter. An alarm then
names the parameter that drifts and since when. What is fitted grows with each further snapshot until `window` of them
stand behind the new values; then the detector watches again. A machine that stands still does not show them: its
snapshots are counted and left out.
"""

import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from papers.arrays import Array
from papers.paper2_digital_twin.live_twin.drift import Alarm, DriftDetector, threshold_for
from papers.paper2_digital_twin.live_twin.journal import Evaluation, Journal, Kind, Update
from papers.paper2_digital_twin.live_twin.laws import Laws
from papers.paper2_digital_twin.live_twin.messages import (
    Message,
    OrderOptions,
    Reorder,
    Snapshot,
    StateMessage,
    kind_of,
)
from papers.paper2_digital_twin.live_twin.refit import Fit, deviation, refit, relative_error
from papers.paper2_digital_twin.live_twin.spectrum import FREE, Band, MachineState, Prediction, SpectrumModel
from twingap import Bearing, TwingapError
from twingap.twins.contact_parameters import ContactParameters

WATCHED = FREE[:3]
STARTS: Final = (0.0, -0.7, 0.7, -1.4, 1.4)
"""Added to the logarithm of the stiffness that the twin was given, at commissioning."""
FILM_SHARES: Final = (0.8, 0.6, 0.4, 0.2, 0.0, 1.0)  # tried at commissioning, at the reference temperature


@dataclass(frozen=True)
class LiveOptions:
    follow_temperature: bool = True  # whether clearance and damping follow it
    # Whether the rest is identified anew on drift. With neither the twin is frozen after commissioning.
    reidentify: bool = True
    temperature_step_k: float = 0.5  # change of temperature from which on the laws are applied again
    stale_s: float = 600.0  # age of the last state beyond which a snapshot cannot be judged
    lowest_hz: float = 500.0  # spectra are compared from here on
    commissioning: int = 10  # snapshots that set the twin up, at least 4
    window: int = 6  # most snapshots behind a later identification, at least 4
    # change of temperature during commissioning from which on the film's share of the damping is learnt from it; below,
    # `Laws` keeps its value
    warm_up_k: float = 12.0
    rate: float = 0.002  # false alarms per snapshot, for deviations that scatter as they did in commissioning
    allowance: float = 1.0  # of the detector, standard deviations
    spread: float = 5.0  # stiffness, damping and levels stay within this factor of their values at commissioning
    evaluations: int = 4  # of the model, at most, per update
    # standard deviations by which a further snapshot may be off while the twin follows a drift; beyond, older ones are
    # forgotten: the drift goes on
    restart: float = 4.0

    def __post_init__(self) -> None:
        limits = {
            "temperature_step_k": (0.0, 100.0), "stale_s": (0.0, 1e9), "lowest_hz": (0.0, 1e6),
            "commissioning": (4, 1000), "window": (4, 1000), "allowance": (0.1, 5.0), "spread": (1.1, 100.0),
            "evaluations": (2, 100), "restart": (2.0, 1e9), "warm_up_k": (0.0, 1e9),
        }  # fmt: skip
        for key, (low, high) in limits.items():
            if not low <= getattr(self, key) <= high:
                raise TwingapError(
                    f"{key} = {getattr(self, key)!r}, between {low:g} and {high:g} expected", where="live options"
                )


@dataclass(frozen=True)
class _Seen:
    """A snapshot as it is remembered: spectrum, state, what the rollers add unless they matter, what was predicted."""

    amplitude: Array
    state: MachineState
    averages: float
    rolling: Array | None = None
    predicted: Prediction | None = None


class LiveTwin:
    """A contact twin that is updated from messages, the same for the same messages in the same order; `journal` says
    what it did and why. It starts from `parameters`, which hold at `laws.reference_c`. Raises `TwingapError` for too
    narrow a band, and for a rate and an allowance that no threshold of the detector goes with."""

    def __init__(
        self, bearing: Bearing, parameters: ContactParameters, fs_hz: float, *, laws: Laws | None = None,
        options: LiveOptions | None = None, order: OrderOptions | None = None,
    ) -> None:  # fmt: skip
        self.options = options or LiveOptions()
        self.band = Band.of(fs_hz, self.options.lowest_hz)
        if self.band.inside.sum() < 32:
            raise TwingapError(
                f"only {int(self.band.inside.sum())} bins between lowest_hz and 0.42 fs, at least 32 expected",
                where="live twin", mend="lower lowest_hz, or sample faster",
            )  # fmt: skip
        for baseline in (self.options.commissioning, self.options.window):
            # Refused now what would fail at every snapshot once there are enough; and found outside any update.
            threshold_for(self.options.rate, self.options.allowance, len(WATCHED), baseline)
        self.model = SpectrumModel(bearing, parameters, laws or Laws(), follow=self.options.follow_temperature)
        self.journal = Journal()
        self._buffer = Reorder(order)
        self.journal.counts = self._buffer.counts
        # The latest that was let go by the buffer; its temperature is the one that the laws were last set by.
        self.state: MachineState | None = None
        self._theta: Array | None = None
        self._bounds: tuple[Array, Array] | None = None
        self._recent: deque[_Seen] = deque(maxlen=max(self.options.window, self.options.commissioning))
        self._detector: DriftDetector | None = None
        self._mean, self._scatter = np.zeros(len(FREE)), np.ones(len(FREE))
        self._following = 0  # snapshots behind the new values; 0: watching

    @property
    def parameters(self) -> ContactParameters:
        """Of the contact twin, now; without structure noise at standstill. `TwingapError` before the first running
        state."""
        if self.state is None or self._theta is None:
            raise self._not_started()
        return self.model.at(self._theta, self.state, self.band.fs_hz)

    def predict(self, state: MachineState) -> Array:
        """Amplitude spectrum (root of the PSD) in the band that a snapshot in this state should have [bins]."""
        if self._theta is None:
            raise self._not_started()
        return self.model.predict(self._theta, [state], self.band, slopes=False)[0].amplitude

    def receive(self, message: Message) -> list[Update]:
        """Take a message as it arrives, whatever its order, and say what it led to. Raises `TwingapError` when one that
        the buffer let go could not be acted on, after the others have been."""
        return self._act_on(self._buffer.push(message))

    def flush(self) -> list[Update]:
        """Act on all messages that still wait for earlier ones: the stream has ended. Raises as `receive` does."""
        return self._act_on(self._buffer.flush())

    def _act_on(self, released: Iterable[Message]) -> list[Update]:
        """One after another; the first error is raised when all have had their turn."""
        made: list[Update] = []
        failed: Exception | None = None
        for message in released:
            try:
                found = self._told(message) if isinstance(message, StateMessage) else self._shown(message)
            except Exception as error:
                self.journal.counts[kind_of(message), "failed"] += 1
                failed = failed or error
            else:
                self.journal.updates.extend(found)
                made += found
        if failed is not None:
            raise failed
        return made

    def _told(self, message: StateMessage) -> list[Update]:
        """A state: the operating point as it is, temperature in steps."""
        load = self.model.parameters.load_n if message.load_n is None else message.load_n
        before = self.state
        now = MachineState(message.time_s, message.temperature_c, message.speed_rpm, load)
        if before is None or self._theta is None:
            if now.speed_rpm > 0:  # levels are those at a speed, which a machine that stands still does not have
                self._theta = self.model.start(now, self.band.fs_hz)
            self.state = now
            return []
        if abs(now.temperature_c - before.temperature_c) < self.options.temperature_step_k:
            self.state = replace(now, temperature_c=before.temperature_c)
            return []
        self.state = now
        if not self.options.follow_temperature:
            return []
        began = time.process_time()
        moved = now.temperature_c - before.temperature_c
        old, new = self._values(replace(now, temperature_c=before.temperature_c)), self._values(now)
        why = f"temperature moved by {moved:+.1f} K to {now.temperature_c:.1f} deg C"
        return [Update(now.time_s, "law", why, old, new, seconds=time.process_time() - began)]

    def _shown(self, snapshot: Snapshot) -> list[Update]:
        """A snapshot: judged, and reacted to."""
        counts, began = self.journal.counts, time.process_time()
        if self.state is None or snapshot.time_s - self.state.time_s > self.options.stale_s:
            counts["snapshot", "without a fresh state"] += 1
            return []
        if not self.state.speed_rpm > 0:
            counts["snapshot", "at standstill"] += 1
            return []
        if snapshot.fs_hz != self.band.fs_hz or snapshot.samples.size < 2 * self.band.segment:
            counts["snapshot", "of another rate or too short"] += 1
            return []
        assert self._theta is not None
        state = replace(self.state, time_s=snapshot.time_s, fault=snapshot.fault)
        seen = _Seen(self.band.amplitude(snapshot.samples), state, self.band.averages(snapshot.samples.size))
        (predicted,) = self.model.predict(self._theta, [state], self.band)
        off, chance = deviation(seen.amplitude, predicted, seen.averages)
        error, a, b = relative_error([seen.amplitude], [predicted]), seen.amplitude, predicted.amplitude
        # Under the best common factor: the sine of the angle between the two spectra.
        shape = float(np.sqrt(max(1 - float(a @ b) ** 2 / float((a @ a) * (b @ b)), 0.0)))
        self.journal.evaluations.append(Evaluation(snapshot.time_s, error, shape))
        held = predicted.rolling if predicted.quiet else None
        self._recent.append(replace(seen, rolling=held, predicted=predicted))
        if self._detector is None:
            if len(self._recent) < self.options.commissioning:
                return []
            return [self._commission(snapshot.time_s, chance, began)]
        if not self.options.reidentify:
            return []
        z = ((off - self._mean) / self._scatter)[: len(WATCHED)]
        if self._following:
            # Where the newest snapshot is far off the values just found, the drift goes on: the two newest count.
            self._following = 2 if np.abs(z).max() > self.options.restart else self._following + 1
            why = f"{self._following} of {self.options.window} snapshots since the drift"
            return [self._follow(snapshot.time_s, "following", why, began)]
        alarm = self._detector.push(z)
        if alarm is None:
            return []
        self._following = min(alarm.since, self.options.window)
        return [self._follow(snapshot.time_s, "drift", _in_words(alarm), began)]

    def _commission(self, time_s: float, chance: Array, began: float) -> Update:
        """The first values of its own, and how much deviations scatter about them."""
        seen = list(self._recent)[-self.options.commissioning :]
        self._theta = self._best_start(seen)
        update, _ = self._fit(time_s, "commissioning", f"the first {len(seen)} snapshots", seen, began, 20)
        assert self._theta is not None
        warmed = [s.state.temperature_c for s in seen]
        if self.options.follow_temperature and max(warmed) - min(warmed) >= self.options.warm_up_k:
            update = self._learn_film(update, seen, began)
        for place, one in enumerate(self._recent):  # what was predicted under other laws of damping
            self._recent[place] = replace(one, predicted=None)
        offs = self._deviations(seen)
        # The fitted mean has taken one degree of freedom; chance alone sets a floor that few snapshots may fall below.
        self._mean, self._scatter = offs.mean(axis=0), np.maximum(offs.std(axis=0, ddof=1), chance)
        # White noise may be anything: where the rest drowns it, it is not known.
        room = np.log([self.options.spread] * len(WATCHED) + [1e4])
        self._bounds = (self._theta - room, self._theta + room)
        self._detector = self._new_detector(len(seen))
        return update

    def _best_start(self, seen: list[_Seen]) -> Array:
        """Where to begin: a search that only goes downhill needs a resonance that overlaps the measured one."""
        assert self._theta is not None
        tried = []
        for shift in STARTS:
            theta = self._theta + np.array([shift, 0.0, 0.0, 0.0])
            try:
                fit = self._refit(theta, seen[-1:], 12)
            except TwingapError:
                continue
            tried.append((fit.after, shift, fit.theta))
        if not tried:
            raise TwingapError(
                "cannot be simulated near its first parameters", where="live twin", mend="start from identified ones"
            )
        return min(tried, key=lambda one: one[:2])[2]

    def _refit(self, theta: Array, seen: list[_Seen], evaluations: int, **more: Any) -> Fit:
        """Fit from there to snapshots; what the rollers add is held where it matters in none."""
        amplitudes, states = [s.amplitude for s in seen], [s.state for s in seen]
        return refit(
            self.model, theta, amplitudes, states, self.band, evaluations=evaluations, rolling=_held(seen), **more
        )  # fmt: skip

    def _learn_film(self, update: Update, seen: list[_Seen], began: float) -> Update:
        """While the machine warmed up its damping showed how much of it is the oil film's: the best of a few shares."""
        assert self._theta is not None
        laws, best, tried = self.model.laws, self._theta, []
        for share in FILM_SHARES:
            self.model.laws = replace(laws, film=share)
            try:
                fit = self._refit(best, seen, 5)
            except TwingapError:
                continue
            tried.append((fit.after, share, fit))
        error, share, fit = min(tried, key=lambda one: one[0])
        self.model.laws, self._theta = replace(laws, film=share), fit.theta
        why = f"{update.why}; warming up showed the film's share of the damping: {share:g}"
        after = self._values(seen[-1].state)
        return replace(update, why=why, after=after, error_after=error, seconds=time.process_time() - began)

    def _follow(self, time_s: float, kind: Kind, why: str, began: float) -> Update:
        """Identify anew from the snapshots since the drift began; when there are enough of them, watch again."""
        seen = list(self._recent)[-self._following :]
        update, predicted = self._fit(time_s, kind, why, seen, began, self.options.evaluations)
        if self._following >= self.options.window:
            self._mean, self._following = self._deviations(seen, predicted).mean(axis=0), 0
            self._detector = self._new_detector(len(seen))
        return update

    def _fit(
        self, time_s: float, kind: Kind, why: str, seen: list[_Seen], began: float, evaluations: int
    ) -> tuple[Update, list[Prediction] | None]:
        assert self._theta is not None and self.state is not None
        state, before = seen[-1].state, self._values(seen[-1].state)
        fit: Fit | None
        try:
            known = [s.predicted for s in seen]
            fit = self._refit(self._theta, seen, evaluations, bounds=self._bounds, known=known)
        except TwingapError as error:
            fit, kind, why = None, "kept", f"{why}; could not be simulated: {error}"
        if fit is not None and not fit.after < fit.before:
            kind, why = "kept", f"{why}; no better values found nearby"
        elif fit is not None:
            moved, self._theta = fit.theta - self._theta, fit.theta
            # What is predicted of the newest snapshots now: the next fit begins there.
            for place, made in enumerate(fit.predicted, start=len(self._recent) - len(seen)):
                self._recent[place] = replace(self._recent[place], predicted=made)
            if kind in ("drift", "following"):
                # The alarm's linear view names the wrong chart when a resonance jumps far; the fit knows better.
                most = int(np.abs(moved / self._scatter)[: len(WATCHED)].argmax())
                why += f"; {WATCHED[most]} changed by {100 * np.expm1(moved[most]):+.1f} %"
            low, high = self._bounds or (-np.inf, np.inf)
            if ((fit.theta <= low) | (fit.theta >= high))[: len(WATCHED)].any():
                why += f"; stopped at a factor of {self.options.spread:g} from commissioning"
        off, left = (None, None) if fit is None else (fit.before, fit.after)
        after, spent = self._values(state), time.process_time() - began
        update = Update(time_s, kind, why, before, after, off, left, len(seen), spent)
        return update, None if fit is None else fit.predicted

    def _deviations(self, seen: list[_Seen], predicted: list[Prediction] | None = None) -> Array:
        """Deviations by snapshot [snapshots, 4], from predictions at the twin's values where they are known."""
        assert self._theta is not None
        if predicted is None:
            predicted = self.model.predict(self._theta, [s.state for s in seen], self.band, rolling=_held(seen))
        return np.array([deviation(s.amplitude, p, s.averages)[0] for s, p in zip(seen, predicted, strict=True)])

    def _values(self, state: MachineState) -> dict[str, float]:
        assert self._theta is not None
        own = self.model.at(self._theta, state, self.band.fs_hz)
        level, white = (float(v) for v in np.exp(self._theta[2:]))
        return {
            "stiffness": own.stiffness, "damping": own.damping, "clearance_um": own.clearance_um, "force_level": level,
            "white_noise": white, "temperature_c": state.temperature_c,
        }  # fmt: skip

    def _not_started(self) -> TwingapError:
        what = "no state has been received yet" if self.state is None else "the machine has stood still so far"
        return TwingapError(what, where="live twin")

    def _new_detector(self, baseline: int) -> DriftDetector:
        return DriftDetector(WATCHED, self.options.rate, self.options.allowance, baseline)


def _held(seen: list[_Seen]) -> list[Array] | None:
    """What the rollers add to each snapshot, unless it matters in one: then all are integrated anew."""
    known = [s.rolling for s in seen if s.rolling is not None]
    return known if len(known) == len(seen) else None


def _in_words(alarm: Alarm) -> str:
    return (
        f"{alarm.chart} drifts {alarm.direction}: sum of deviations {alarm.sum:.1f} > {alarm.threshold:.1f} standard "
        f"deviations, since {alarm.since} snapshot{'s' * (alarm.since > 1)}"
    )
