"""Vibration snapshots of simulated lives with labels, and of the real run without.

Eq. 1 of paper 1: x_k = S(k) D(k) sum_i h(t - iT - tau_i) q(iT) A_i + n(t). S and D scale the impacts, and n(t) stays as
it is: `effects.SpeedGain`, which drives all excitation, is not eq. 1. The end of life is defined on peak to peak, so
each record's impacts are given the strength with which it, noise included, has S(k) D(k) peak to peak, give or take
what healthy records scatter about S.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array, spread
from papers.paper1_rul_varying_speed.methods.adaptive_twin import AdaptiveTwin
from papers.paper1_rul_varying_speed.methods.degradation import Trajectory
from papers.paper1_rul_varying_speed.methods.excited_modes import excited_modes
from twingap import Bearing, Condition, RecordSet, TwingapError
from twingap.effects import Draft, Effect, ImpactScatter, LoadZone, Mode, SlipJitter, Stage
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Samples = NDArray[np.float32]

CHUNK = 128  # records made at once


@dataclass(frozen=True)
class Snapshots:
    """Records of one or several lives, as a network is shown them."""

    samples: Samples  # [records, length] in the unit of the measurements
    speed_rpm: Array  # [records]
    position: Array  # [records] rows after K_anomaly, the pos of eq. 13.
    life: NDArray[np.int64]  # [records] which life each is of
    revolutions: Array | None = None  # [records] Remaining, eq. 14. None: not known, as of a bearing that still runs.

    def __len__(self) -> int:
        return int(self.samples.shape[0])

    def unlabelled(self) -> Snapshots:
        return replace(self, revolutions=None)

    def take(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> Snapshots:
        left = None if self.revolutions is None else self.revolutions[places]
        return Snapshots(
            self.samples[places], self.speed_rpm[places], self.position[places], self.life[places], left
        )  # fmt: skip


@dataclass(frozen=True)
class SignalModel:
    """What eq. 1 leaves open."""

    jitter: float = 0.02  # standard deviation of tau_i, impact spacings
    load_zone: float = 0.3  # depth of q
    scatter: float = 0.1  # standard deviation of A_i
    # "given", "matched": depth of q and scatter of A as given, or those of `IMPACT_SHAPES` with which simulated
    # records are as impulsive as the measured ones after the anomaly (peak to peak over RMS).
    impact_shape: Literal["given", "matched"] = "given"
    # "constant": n(t) of eq. 1 is the same at all speeds. "measured": it is a healthy record of the run at the nearest
    # speed, shifted in time.
    noise: Literal["constant", "measured"] = "constant"
    # peak to peak of simulated noise over that of a healthy record, at the speed where that is least
    noise_share: float = 0.8
    # "healthy", "excited": h(t) of eq. 1 is the dominant mode of healthy records (eq. 8). "excited": the modes
    # that stand out of records after the anomaly, see `excited_modes`.
    path: Literal["healthy", "excited"] = "healthy"
    modes: int = 4  # most modes of an excited path


IMPACT_SHAPES = tuple((zone, scatter) for zone in (0.3, 1.0) for scatter in (0.1, 0.2, 0.3, 0.45, 0.6))
"""Depths of q and scatters of A among which is matched."""


@dataclass(frozen=True)
class _MoreModes(Effect):
    stage: ClassVar[Stage] = Stage.PATH
    modes: tuple[Mode, ...] = ()

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        draft.modes.extend(self.modes)


class LifeSimulator:
    """Eq. 1 for one bearing, its amplitudes set by peak to peak; `healthy` and `faulty` (after K_anomaly, up to now)
    are what the options "measured", "excited" and "matched" read. Raises `TwingapError` where those are missing."""

    def __init__(
        self, twin: AdaptiveTwin, bearing: Bearing, fault: str, fs_hz: float, n_samples: int,
        rng: np.random.Generator, model: SignalModel | None = None, unit: str = "g", *,
        healthy: Snapshots | None = None, faulty: Snapshots | None = None,
    ) -> None:  # fmt: skip
        self.twin, self.fault, self.fs_hz, self.n_samples = twin, fault, fs_hz, n_samples
        self.model = model or SignalModel()
        self._healthy = healthy if self.model.noise == "measured" else None
        if (self.model.noise == "measured" or self.model.path == "excited") and (healthy is None or faulty is None):
            raise TwingapError("needs healthy records and those after the anomaly", where="signal model")
        own, mode = self.model, twin.mode
        total = float(np.hypot(mode.structure_noise_rms, mode.white_noise_rms))
        structure = mode.structure_noise_rms / total if total > 0 else 0.0
        white = float(np.sqrt(max(1 - structure**2, 0.0)))
        path: tuple[Mode, ...] = (Mode(mode.resonance_hz, mode.damping_ratio),)
        if own.path == "excited" and healthy is not None and faulty is not None:
            path = excited_modes(
                faulty.samples, faulty.speed_rpm, healthy.samples, healthy.speed_rpm, fs_hz, own.modes
            )  # fmt: skip
        self.path = path
        parameters = PhenomenologicalParameters(
            path[0].frequency_hz, path[0].damping_ratio, {fault: 1.0}, structure, max(white, 1e-9), 1.0
        )
        self._bearing, self._unit = bearing, unit
        self._parameters = parameters
        # Noise of unit RMS has this peak to peak in a record of this length; then n(t) is known.
        unit_noise = PhenomenologicalTwin(bearing, parameters, (_MoreModes(path[1:]),), unit)
        pilots = np.full(8, twin.influence.speeds_rpm[0])
        height = float(np.mean(np.ptp(self._made(unit_noise, pilots, rng, "healthy"), axis=1)))
        rms = own.noise_share * float(twin.influence.amplitude(twin.influence.speeds_rpm).min()) / height
        scaled = replace(parameters, structure_noise_rms=structure * rms, white_noise_rms=max(white * rms, 1e-9))
        self._quiet = PhenomenologicalTwin(bearing, scaled, unit_noise.effects, unit)
        self.impact_shape = (own.load_zone, own.scatter)
        if own.impact_shape == "matched":
            if faulty is None:
                raise TwingapError("needs records after the anomaly", where="signal model")
            self.impact_shape = self._matched(faulty, rng)

    def snapshots(self, lives: Sequence[Trajectory], rng: np.random.Generator, most: int | None = None) -> Snapshots:
        """Labelled records of every row after K_anomaly to the end; of more than `most`, evenly spread ones."""
        speed = np.concatenate([life.speed_rpm[1:] for life in lives])
        height = np.concatenate([life.peak_to_peak[1:] for life in lives])
        position = np.concatenate([life.positions[1:] for life in lives])
        left = np.concatenate([life.remaining_revolutions[1:] for life in lives])
        number = np.concatenate([np.full(life.speed_rpm.size - 1, i) for i, life in enumerate(lives)])
        running = np.flatnonzero(speed > 0)
        if most is not None:
            running = running[spread(running.size, most)]
        speed, height = speed[running], height[running]
        scatter = self.twin.anomaly.std
        height = height * np.exp(scatter * rng.standard_normal(height.size) - scatter**2 / 2)
        samples = self.records(speed, height, rng)
        return Snapshots(samples, speed, position[running], number[running].astype(np.int64), left[running])

    def records(
        self, speed_rpm: Array, peak_to_peak: Array, rng: np.random.Generator,
        impact_shape: tuple[float, float] | None = None,
    ) -> Samples:  # fmt: skip
        """Records of a faulty bearing with just these peaks to peak [records], of noise alone where that has more;
        `impact_shape` (depth of q, scatter of A) takes the place of the simulator's own."""
        zone, scatter = impact_shape or self.impact_shape
        silent = replace(self._parameters, structure_noise_rms=0.0, white_noise_rms=1e-12)
        effects = (
            SlipJitter(sigma=self.model.jitter), LoadZone(depth=zone), ImpactScatter(sigma=scatter),
            _MoreModes(self.path[1:]),
        )  # fmt: skip
        faulty = PhenomenologicalTwin(self._bearing, silent, effects, self._unit)
        out = np.empty((speed_rpm.size, self.n_samples), np.float32)
        for start in range(0, speed_rpm.size, CHUNK):
            own = slice(start, start + CHUNK)
            impacts = self._made(faulty, speed_rpm[own], rng, self.fault)
            noise = self.noise(speed_rpm[own], rng)
            out[own] = noise + strengths(noise, impacts, peak_to_peak[own])[:, None] * impacts
        return out

    def _matched(self, faulty: Snapshots, rng: np.random.Generator) -> tuple[float, float]:
        """The one of `IMPACT_SHAPES` whose records have the measured crest, at the same speeds and peaks to peak."""
        height = np.ptp(faulty.samples, axis=1).astype(float)
        wanted = float(np.mean(np.log(height / faulty.samples.std(axis=1))))
        # A third of the records is enough, and the same for all candidates.
        few = np.arange(0, len(faulty), max(1, len(faulty) // 12))
        seeds = rng.integers(0, 2**32, len(IMPACT_SHAPES))

        def miss(place: int) -> float:
            made = self.records(
                faulty.speed_rpm[few], height[few], np.random.default_rng(seeds[place]), IMPACT_SHAPES[place]
            )
            return abs(float(np.mean(np.log(height[few] / made.std(axis=1)))) - wanted)

        return IMPACT_SHAPES[min(range(len(IMPACT_SHAPES)), key=miss)]

    def noise(self, speed_rpm: Array, rng: np.random.Generator) -> Samples:
        """n(t) of each record [records, length]: the healthy twin's at these speeds, or "measured": healthy records of
        the nearest speeds, each shifted (cyclically) and turned over at random."""
        if self._healthy is None:
            return self._made(self._quiet, speed_rpm, rng, "healthy")
        own = self._healthy.speed_rpm
        out = np.empty((speed_rpm.size, self.n_samples), np.float32)
        for i, speed in enumerate(speed_rpm):
            far = np.abs(own - speed)
            chosen = int(rng.choice(np.flatnonzero(far <= far.min() * 1.001)))
            out[i] = np.roll(self._healthy.samples[chosen], int(rng.integers(self.n_samples)))
            out[i] *= rng.choice((-1.0, 1.0))
        return out

    def _made(self, chain: PhenomenologicalTwin, speed_rpm: Array, rng: np.random.Generator, fault: str) -> Samples:
        conditions = (
            Condition(str(i), float(speed), self.fs_hz, self.n_samples, fault) for i, speed in enumerate(speed_rpm)
        )
        out = np.empty((speed_rpm.size, self.n_samples), np.float32)
        for i, record in enumerate(chain.stream(conditions, rng, threads=1)):
            out[i] = record.samples
        return out


def strengths(noise: Samples, impacts: Samples, peak_to_peak: Array) -> Array:
    """Factors [records] on impacts with which records have the wanted peak to peak, to a thousandth; 0 where noise
    [records, samples] alone has more."""
    out = np.zeros(len(noise))
    for i, wanted in enumerate(peak_to_peak):
        own, faulty = noise[i], impacts[i]
        floor, unit = float(np.ptp(own)), float(np.ptp(faulty))
        if floor >= wanted or unit == 0:
            continue
        # Peak to peak is a convex function of the factor: the secant from beyond it comes down to it.
        low, at_low, high = 0.0, floor, (wanted + floor) / unit
        at_high = float(np.ptp(own + np.float32(high) * faulty))
        for _ in range(40):
            factor = low + (wanted - at_low) * (high - low) / (at_high - at_low)
            if not 0.02 < (factor - low) / (high - low) < 0.98:  # a secant that barely moves
                factor = (low + high) / 2
            height = float(np.ptp(own + np.float32(factor) * faulty))
            if abs(height - wanted) <= 1e-3 * wanted:
                break
            if height < wanted:
                low, at_low = factor, height
            else:
                high, at_high = factor, height
        out[i] = factor
    return out


def measured_snapshots(records: RecordSet, onset_row: int, rows: Iterable[int], n_samples: int) -> Snapshots:
    """Unlabelled records of a real run, which has a record per row: the first `n_samples` of these rows."""
    places = list(rows)
    out = np.empty((len(places), n_samples), np.float32)
    for i, record in enumerate(records.take(places)):
        if record.samples.size < n_samples:
            raise TwingapError(
                f"{record.samples.size} samples, {n_samples} needed", where=f"record {record.condition.name!r}",
                mend="choose a shorter window",
            )  # fmt: skip
        out[i] = record.samples[:n_samples]
    speed = np.array([records.conditions[p].speed_rpm for p in places], float)
    return Snapshots(out, speed, np.array(places, float) - onset_row, np.zeros(len(places), np.int64))


def joined(parts: Sequence[Snapshots]) -> Snapshots:
    """Labelled snapshots one after the other."""
    return Snapshots(*(np.concatenate([getattr(p, field.name) for p in parts]) for field in fields(Snapshots)))
